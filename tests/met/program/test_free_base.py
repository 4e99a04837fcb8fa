"""A base that moves freely through a run: order, what is kept, closed forms, and what else the program does with it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from met import models
from met import run as engine
from met.backends.reference.plain import execute
from met.program import build
from met.program.system import System
from met.run import Run
from tests.ic.small_decks import changed, check, experiment
from tests.met.program.free_flyers import ARM, RUN, matrix

STATE = ("q", "qd", "links.base.position", "links.base.orientation", "links.base.velocity", "links.base.rate")


def flown(folder: Path, *changes: tuple[str, str], arm: str = ARM) -> Run:
    return engine.run(experiment(folder, arm, changed(RUN, *changes)))


def at_rate(hz: int, integrator: str = "modified_euler") -> tuple[tuple[str, str], ...]:
    return ("dynamics = 100 Hz", f"dynamics = {hz} Hz"), ("modified_euler", integrator)


def last(run: Run) -> np.ndarray:
    return np.concatenate([run.signals[name][0, -1].ravel() for name in STATE])


@pytest.mark.release
@pytest.mark.parametrize("integrator", models.find_own("integrator"))
def test_a_tumbling_free_flyer_is_integrated_to_the_integrators_order(tmp_path: Path, integrator: str) -> None:
    order = models.find("integrator", integrator).order
    exact = last(flown(tmp_path, *at_rate(2560, "rk4")))
    rates = (40, 80) if order == 4 else (160, 320)
    errors = [np.max(np.abs(last(flown(tmp_path, *at_rate(hz, integrator))) - exact)) for hz in rates]
    found = math.log2(errors[0] / errors[1])
    print(f"{integrator}: order {found:.2f}, errors {errors}")
    # The error's next term is a step's share of the first.
    assert abs(found - order) < 0.15


@pytest.mark.slow
@pytest.mark.parametrize("integrator", models.find_own("integrator"))
def test_momentum_and_energy_are_kept_to_the_integrators_order(tmp_path: Path, integrator: str) -> None:
    order = models.find("integrator", integrator).order
    rates = (40, 80) if order == 4 else (160, 320)
    lost = []
    for hz in rates:
        run = flown(tmp_path, *at_rate(hz, integrator))
        whole = np.column_stack(
            [
                run.signals[name][0].reshape(len(run.time), -1)
                for name in ("energy.kinetic", "momentum.linear", "momentum.angular")
            ]
        )
        lost.append(np.max(np.abs(whole - whole[0]), axis=0) / np.max(np.abs(whole), axis=0))
    found = np.log2(lost[0] / lost[1])
    print(f"{integrator}: orders {np.round(found, 2)}, lost {lost[1]}")
    assert (found > order - 0.3).all()


SPINNING = """\
arm top {{ link base {{ mass = 3 kg; inertia = {inertia} kg*m^2; }} }}
run it {{
    arm = top; base = free; integrator = {integrator};
    initial {{ base.rpy = [0.3, -0.4, 0.5] rad; base.rate = {rate} rad/s; }}
    rates {{ dynamics = {hz} Hz; record = 10 Hz; }}
    duration = 3 s;
    record = [links.base.orientation, links.base.rate, links.base.velocity, links.base.position];
}}
"""


@pytest.mark.slow
@pytest.mark.parametrize("integrator", models.find_own("integrator"))
def test_a_steady_spin_is_exact_at_any_step(tmp_path: Path, integrator: str) -> None:
    # a sphere spins about any axis; nothing but rounding is left, at a quarter of a turn a step, and no sign jumps
    w = np.array([3.0, -10.0, 12.0])
    text = SPINNING.format(inertia="[2, 2, 2]", integrator=integrator, rate=w.tolist(), hz=10)
    run = engine.run(experiment(tmp_path, text))
    found = run.signals["links.base.orientation"][0]
    size, first = np.linalg.norm(w), found[0]
    half = 0.5 * size * run.time[:, None]
    turn = np.concatenate([np.cos(half), np.sin(half) * (w / size)], axis=1)
    expected = np.array([_product(each, first) for each in turn])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)
    np.testing.assert_allclose(run.signals["links.base.rate"][0], np.broadcast_to(w, (31, 3)), rtol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, rtol=0, atol=3e-16)


@pytest.mark.slow
def test_a_symmetric_top_precesses_as_eulers_solution(tmp_path: Path) -> None:
    # In body axes w turns about z at (Iz - Ix)/Ix wz; rk4 at 200 Hz is good to 1e-9 here.
    text = SPINNING.format(inertia="[2, 2, 3]", integrator="rk4", rate=[0.5, 1.0, 4.0], hz=200)
    run = engine.run(experiment(tmp_path, text))
    q, rate = run.signals["links.base.orientation"][0], run.signals["links.base.rate"][0]
    w = np.array([_turned_back(each, vector) for each, vector in zip(q, rate, strict=True)])
    angle = 0.5 * w[0, 2] * run.time
    expected = np.column_stack(
        [
            w[0, 0] * np.cos(angle) - w[0, 1] * np.sin(angle),
            w[0, 1] * np.cos(angle) + w[0, 0] * np.sin(angle),
            np.full(31, w[0, 2]),
        ]
    )
    np.testing.assert_allclose(w, expected, rtol=0, atol=1e-8)


@pytest.mark.slow
def test_a_free_base_falls_with_its_arm_in_gravity(tmp_path: Path) -> None:
    # in its own axes nothing is felt of it: joints at rest stay so, whatever way up
    still = [
        ("= 0.5 rad/s", "= 0 rad/s"),
        ("= -1 rad/s", "= 0 rad/s"),
        ("[40, 20, -60]", "[0, 0, 0]"),
        ("environment {}", "environment { gravity = [1, -2, -9] m/s^2; }"),
    ]
    run = flown(tmp_path, *still)
    t = run.time[:, None]
    place = np.array([1.0, 2.0, 3.0]) + np.array([0.1, -0.2, 0.3]) * t + 0.5 * np.array([1.0, -2.0, -9.0]) * t * t
    # Heun makes a parabola exactly
    np.testing.assert_allclose(run.signals["links.base.position"][0], place, rtol=1e-12)
    assert np.max(np.abs(run.signals["qdd"])) < 1e-12
    energy = run.signals["energy.kinetic"][0] + run.signals["energy.potential"][0]
    np.testing.assert_allclose(energy, energy[0], rtol=1e-12)


@pytest.mark.slow
def test_a_wrench_on_the_base_moves_all_of_it(tmp_path: Path) -> None:
    push = "push = wrench { link = base; force = [3, 2, 1] N; point = [0.5, 0, 0] m; axes = link; until = 1 s; }"
    run = flown(tmp_path, ("environment {}", f"environment {{ {push} }}"), *at_rate(400, "rk4"))
    axes = [matrix(q) for q in run.signals["links.base.orientation"][0]]
    force = np.array([R @ (3.0, 2.0, 1.0) for R in axes])
    moment = np.cross(run.signals["links.base.position"][0] + [R @ (0.5, 0.0, 0.0) for R in axes], force)
    acting = run.time < 1.0
    for name, rate in (("momentum.linear", force), ("momentum.angular", moment)):
        gained = run.signals[name][0] - run.signals[name][0, 0]
        # the impulse by Simpson's rule over the recorded rows, ten a second
        rows = [0.1 / 3.0 * sum(w * x for w, x in zip([1, *[4, 2] * 4, 4, 1], rate[:11], strict=True))]
        assert np.count_nonzero(acting) == 10
        np.testing.assert_allclose(gained[-1], rows[0], rtol=2e-4, atol=2e-4)
        np.testing.assert_allclose(gained[11:], np.broadcast_to(gained[-1], gained[11:].shape), rtol=0, atol=1e-6)


RUB = "servo rub { model = passive; friction = 4 N*m; }\n"


@pytest.mark.slow
def test_joints_that_stick_and_slide_leave_momentum_alone(tmp_path: Path) -> None:
    rates = (200, 400, 800)
    runs = []
    for hz in rates:
        rubbing = ("base     = free;", "base = free; servos { shoulder = rub; elbow = rub; }")
        text = changed(RUN, rubbing, *at_rate(hz))
        runs.append(engine.run(experiment(tmp_path, ARM, RUB, text)))
    assert all(run.events["splits"][0] >= 2 for run in runs), "joints come to rest within a step"
    assert runs[0].signals["qd"][0, -1].tolist() == [0.0, 0.0], "both joints stick in the end"
    lost = []
    for run in runs:
        total = np.concatenate([run.signals[name][0] for name in ("momentum.linear", "momentum.angular")], axis=1)
        lost.append(np.max(np.abs(total - total[0])))
        norm = np.linalg.norm(run.signals["links.base.orientation"][0], axis=1)
        np.testing.assert_allclose(norm, 1.0, rtol=0, atol=3e-16)
    found = np.log2(np.array(lost[:-1]) / lost[1:])
    print(f"momentum lost {lost}, orders {found}")
    assert (found > 1.7).all(), "order 2 through events"


@pytest.mark.slow
def test_bits_depend_on_the_case_alone_and_plain_numbers_give_the_same(tmp_path: Path) -> None:
    sweep = """\
sweep some of tumbling {
    vary initial.base.rate.x = linspace(-1, 1, 5) rad/s;
    vary links.base.mass = [20, 80] kg;
}
"""
    found = experiment(tmp_path, ARM, RUN, sweep, select=["some"])
    runs = [engine.run(found, threads=1, lanes=lanes) for lanes in (2, 8)]
    assert runs[0].cause == [""] * 10
    for name, values in runs[0].signals.items():
        assert runs[1].signals[name].tobytes() == values.tobytes(), name
    inputs = {coordinate.path: float(coordinate.values[3]) for coordinate in found.cases.coordinates}
    rows, _ = execute(build(found), inputs, found.structure.schedule.ticks)
    kernel = np.concatenate(
        [runs[0].signals[each.name][3].reshape(len(rows), -1) for each in found.structure.record], axis=1
    )
    assert np.abs(kernel - rows).max() < 1e-10 * np.abs(rows).max()


def test_a_base_without_inertia_fails_and_says_so(tmp_path: Path) -> None:
    arm = changed(
        ARM,
        ("inertia = [5, 7, 9, 0.3, -0.4, 0.5] kg*m^2; com = [0.1, 0.05, -0.1] m;", "inertia = [0, 0, 0] kg*m^2;"),
        ("at = [0.5, 0, 0] m; rpy = [20, 30, 0] deg;", ""),
    )
    run = flown(tmp_path, arm=arm)
    assert run.status[0] == engine.FAILED
    assert run.cause[0].replace(str(tmp_path), "") == (
        "t = 0 s: the base: it moves freely and has no inertia in some direction, so its acceleration is undefined "
        "(/deck.ic:10). Give link base mass, and a shape or inertia, that of the rotors it carries among it."
    )


@pytest.mark.slow
def test_a_base_that_runs_away_fails_and_says_so(tmp_path: Path) -> None:
    text = changed(
        SPINNING.format(inertia="[2, 3, 4]", integrator="modified_euler", rate=[1, 2, 3], hz=10),
        (
            "base = free;",
            "base = free; environment { push = wrench { link = base; force = [1e308, 0, 0] N; "
            "moment = [1e308, 0, 0] N*m; } }",
        ),
    )
    run = engine.run(experiment(tmp_path, text))
    assert run.status[0] == engine.FAILED
    assert run.cause[0].replace(str(tmp_path), "") == (
        "t = 0.1 s: the base: position, rate or acceleration is no longer a finite number (/deck.ic:3). Usual reasons: "
        "a step too long for what acts on it (try a faster rate for the dynamics), or a model that divides by zero."
    )


@pytest.mark.release
@pytest.mark.parametrize(
    ("integrator", "limit"),
    [
        ("modified_euler", 0.199),
        ("midpoint", 0.199),
        ("semi_implicit_euler", 0.00254),
        ("rk4", 0.999),
    ],
)
def test_below_the_spin_that_is_warned_of_a_turn_keeps_the_energy_to_a_hundredth(
    integrator: str, limit: float, tmp_path: Path
) -> None:
    """Of three bodies, about 24 axes: what D300 says (ic/meaning/checks/swings.py), and well above it no more."""
    axes = np.random.default_rng(0).normal(size=(24, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    lost = []
    for share in (1.0, 4.0):
        turn = limit * share  # rad a step of 10 ms
        rates = (axes * turn * 100.0).T.tolist()
        worst = 0.0
        for inertia, com in (
            ("[1.5, 2, 3]", "[0, 0, 0]"),
            ("[1.5, 2, 3, 0.1, 0.2, -0.15]", "[0.1, 0.2, -0.3]"),
            ("[0.2, 2, 2.1]", "[0.5, 0, 0]"),
        ):
            varied = " ".join(
                f"initial.base.rate.{axis} = {rate} rad/s;" for axis, rate in zip("xyz", rates, strict=True)
            )
            deck = f"""\
arm a {{
    link base {{ mass = 10 kg; inertia = {inertia} kg*m^2; com = {com} m; }}
    link u {{ mass = 1 g; shape = sphere(radius = 1 cm); }}
    joint j revolute {{ parent = base; child = u; axis = z; }}
}}
servo still {{ model = locked; }}
run r {{
    arm = a; base = free; servos {{ j = still; }} integrator = {integrator};
    rates {{ dynamics = 100 Hz; servos = 100 Hz; record = 10 Hz; }}  duration = 1 s;  record = [energy];
}}
sweep s of r {{ zip {{ {varied} }} }}
"""
            kinetic = engine.run(experiment(tmp_path, deck, select=["s"])).signals["energy.kinetic"]
            drift = np.abs(np.log(kinetic[:, -1] / kinetic[:, 0])) / (100.0 * turn) * 2.0 * np.pi
            worst = max(worst, float(np.max(np.where(np.isnan(drift), np.inf, drift))))
        lost.append(worst)
    print(lost)
    assert lost[0] < 0.01 and lost[1] > 0.02


STIFF = """\
arm a {
    link base { mass = 10 kg; inertia = [2, 2, 3] kg*m^2; }
    link u { mass = 1 kg; shape = rod(length = 1 m, along = x); }
    joint j revolute { parent = base; child = u; axis = z; }
}
servo still { model = ideal; bandwidth = 10 1/s; command = rate(0 rad/s); }
run hard {
    arm = a; base = free; initial { base.rate = [0.1, 0.2, 0.3] rad/s; }
    environment { hold = attitude_hold { damping = [1e4, 1e4, 1e4] N*m*s/rad; } }
    rates { dynamics = 500 Hz; servos = 500 Hz; }  duration = 1 s;  record = [q];
}
"""


@pytest.mark.slow
def test_a_base_that_diverges_is_not_said_to_have_no_inertia(tmp_path: Path) -> None:
    run = engine.run(experiment(tmp_path, STIFF))
    assert run.cause[0].replace(str(tmp_path), "") == (
        "t = 0.012 s: the base: it moves freely and has no inertia in some direction any more, so its acceleration is "
        "undefined (/deck.ic:8). At the start it had: usually the motion has diverged, and a step is too long for what "
        "acts on the base or for a servo (try a faster rate for the dynamics)."
    )


@pytest.mark.slow
def test_a_joint_that_is_driven_is_not_blamed_for_its_base(tmp_path: Path) -> None:
    run = engine.run(experiment(tmp_path, STIFF.replace("arm = a;", "arm = a; servos { j = still; }")))
    assert run.cause[0].replace(str(tmp_path), "") == (
        "t = 0.014 s: the base: position, rate or acceleration is no longer a finite number (/deck.ic:8). Usual "
        "reasons: a step too long for what acts on it (try a faster rate for the dynamics), or a model that divides by "
        "zero."
    )


@pytest.mark.slow
def test_a_motor_on_a_bed_feels_an_arm_on_a_free_base(tmp_path: Path) -> None:
    # what the bed is told of the arm is what the record says of it, which linear algebra has shown (test_free_base.py
    # of the dynamics)
    servo = """\
servo drive {
    model = rigid_gearbox;
    ratio = 100; kp = 0.1 V*s/rad; ki = 1 V/rad; v_max = 24 V; resistance = 1 ohm; kt = 0.05 N*m/A;
    tau_max = 1 N*m; j_m = 1e-4 kg*m^2;
    command = rate(0.1 rad/s);
}
"""
    driven = "base = free; servos { shoulder = drive; elbow = drive; } substitute shoulder {}"
    text = changed(
        RUN,
        ("base     = free;", driven),
        ("record = 10 Hz;", "servos = 100 Hz; record = 10 Hz;"),
        ("shoulder.qd   = 0.5", "shoulder.qd   = 0.1"),
        ("elbow.qd      = -1", "elbow.qd      = 0.1"),
    )
    found = experiment(tmp_path, ARM, servo, text)
    run = engine.run(found)
    assert run.cause == [""]
    from met.analysis.margin import margins

    ((margin,),) = margins(found)
    rotor = 100.0**2 * 1e-4
    assert margin.r == pytest.approx(run.signals["J_eff"][0, 0, 0] / rotor, rel=1e-9)
    fixed = experiment(
        tmp_path,
        ARM,
        servo,
        changed(
            text,
            ("base = free;", "base = fixed;"),
            *((f"        base.{name}", f"//        base.{name}") for name in ("position", "rpy", "velocity", "rate")),
        ),
    )
    ((held,),) = margins(fixed)
    assert margin.r < held.r, "a base that yields is lighter"


@pytest.mark.slow
def test_the_base_is_no_body_where_it_is_fixed(tmp_path: Path) -> None:
    text = changed(
        RUN,
        ("base     = free;", ""),
        *((f"        base.{name}", f"//        base.{name}") for name in ("position", "rpy", "velocity", "rate")),
    )
    bare = changed(text, ("links.base.position, links.base.orientation, links.base.velocity, links.base.rate,", ""))
    without = "".join(line for line in ARM.splitlines(True) if "link base" not in line)
    one, other = (engine.run(experiment(tmp_path, arm, bare)) for arm in (ARM, without))
    for name in one.signals:
        assert one.signals[name].tobytes() == other.signals[name].tobytes(), name
    still = engine.run(experiment(tmp_path, ARM, text)).signals
    assert not still["links.base.position"].any()
    assert not still["links.base.rate"].any()
    sweep = "sweep heavy of tumbling { vary links.base.mass = [20, 80] kg; }"
    assert [d.code for d in check(tmp_path, ARM, text, sweep, select=["heavy"]).diagnostics] == ["D137"]


@pytest.mark.slow
def test_a_fixed_joint_holds_the_bases_matter_as_well(tmp_path: Path) -> None:
    mount = "}\n    joint mount fixed { parent = base; child = hull; }\n    link upper"
    mounted = changed(ARM, ("link base ", "link hull "), ("}\n    link upper", mount))
    one, other = flown(tmp_path), flown(tmp_path, arm=mounted)
    for name in STATE:
        np.testing.assert_allclose(other.signals[name], one.signals[name], rtol=0, atol=1e-13)


@pytest.mark.slow
def test_the_program_reads_the_trees_numbers_where_the_bases_mass_varies(tmp_path: Path) -> None:
    sweep = "sweep some of tumbling { vary links.base.mass = [40, 80] kg; }"
    found = experiment(tmp_path, ARM, RUN, sweep, select=["some"])
    assert System(found).varying == ("links.base.mass",)
    run = engine.run(found)
    single = flown(tmp_path)
    for name in STATE:
        np.testing.assert_allclose(run.signals[name][0], single.signals[name][0], rtol=0, atol=1e-12)
    assert np.max(np.abs(run.signals["q"][1] - single.signals["q"][0])) > 1e-3


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a o b of quaternions."""
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])


def _turned_back(q: np.ndarray, vector: np.ndarray) -> np.ndarray:
    return matrix(q).T @ vector
