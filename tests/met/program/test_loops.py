"""Runs of arms with loops, rams and linkages of four bars, against their closed forms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.analysis.linear.period import PeriodProgram
from met.plan.codec import Damaged
from met.plan.structure import check
from tests.ic.small_decks import changed, experiment

G = 9.81

CRANE = """\
arm crane {
    link boom     { mass = 40 kg;  shape = rod(length = 2 m, along = x); }
    link cylinder { mass = 5 kg;  shape = rod(length = 0.6 m, along = x); }
    link rod      { mass = 3 kg;  com = [0.4, 0, 0] m;  inertia = [0.01, 0.2, 0.2] kg*m^2; }
    joint hinge revolute { parent = base;  child = boom;  at = [0, 0, 1] m;  axis = -y; }
    joint swing revolute { parent = base;  child = cylinder;  at = [0.2, 0, 0.3] m;  axis = y; }
    joint stroke prismatic { parent = cylinder;  child = rod;  axis = x; }
    loop lift { leader = stroke;  link = rod;  at = [0.6, 0, 0] m;  to = boom;  to_at = [0.9, 0, -0.1] m;
                branch = left; }
}
servo drive { model = passive;  stiffness = 3e4 N/m;  rest = 0.35 m; }
run raise {
    arm = crane;
    servos { stroke = drive; }
    environment { gravity = [0, 0, -9.81] m/s^2; }
    initial { stroke.q = 0.3 m;  stroke.qd = 0.2 m/s; }
    rates { dynamics = 1 kHz;  record = 100 Hz; }
    duration = 0.5 s;
    record = [q, qd, qdd, energy, stroke.J_eff];
    metric end = final { of = hinge.q; }
}
"""
BARS = """\
arm bars {
    link crank   { mass = 2 kg;  shape = rod(length = 0.3 m, along = x); }
    link coupler { mass = 3 kg;  shape = rod(length = 0.8 m, along = x); }
    link rocker  { mass = 4 kg;  shape = rod(length = 0.6 m, along = y); }
    joint turn revolute { parent = base;  child = crank;  axis = z; }
    joint knee revolute { parent = crank;  child = coupler;  at = [0.3, 0, 0] m;  axis = -z; }
    joint nod revolute { parent = base;  child = rocker;  at = [0.9, 0.1, 0] m;  axis = z; }
    loop bars { leader = turn;  link = coupler;  at = [0.8, 0, 0] m;  to = rocker;  to_at = [0, 0.6, 0] m;
                branch = left; }
}
servo drive { model = passive;  stiffness = 20 N*m/rad;  rest = 80 deg; }
run swing {
    arm = bars;
    servos { turn = drive; }
    environment { gravity = [0, -9.81, 0] m/s^2; }
    initial { turn.q = 20 deg;  turn.qd = 1 rad/s; }
    rates { dynamics = 1 kHz;  record = 100 Hz; }
    duration = 0.5 s;
    record = [q, qd, qdd, energy, turn.J_eff];
    metric end = final { of = nod.q; }
}
"""
LINKED = (
    CRANE.replace(
        "run raise {", "servo pin { model = passive;  damping = 2 N*m*s/rad;  friction = 1 N*m; }\nrun raise {"
    )
    .replace(
        "{ stroke = drive; }", "{ stroke = drive { friction = 5 N; }  hinge = pin;  swing = pin;  turn = turned; }"
    )
    .replace(
        "    loop lift",
        """    link crank   { mass = 2 kg;  shape = rod(length = 0.3 m, along = x); }
    link coupler { mass = 3 kg;  shape = rod(length = 0.8 m, along = x); }
    link rocker  { mass = 4 kg;  shape = rod(length = 0.6 m, along = z); }
    joint turn revolute { parent = boom;  child = crank;  at = [1, 0, 0.1] m;  axis = -y; }
    joint knee revolute { parent = crank;  child = coupler;  at = [0.3, 0, 0] m;  axis = y; }
    joint nod revolute { parent = boom;  child = rocker;  at = [1.9, 0, 0.2] m;  axis = -y; }
    loop bars { leader = turn;  link = coupler;  at = [0.8, 0, 0] m;  to = rocker;  to_at = [0, 0, 0.6] m;
                branch = left; }
    loop lift""",
    )
    .replace("servo drive", "servo turned { model = passive;  stiffness = 50 N*m/rad;  rest = 40 deg; }\nservo drive")
    .replace("stroke.J_eff, ", "")
    + "sweep places of raise { zip { lift.to_at.x = [0.8, 0.9, 1] m;  bars.at.x = [0.75, 0.8, 0.85] m; } }\n"
)
"""A ram with dry friction at all its joints, which carries a linkage of four bars; its points vary."""

Pose = Callable[[complex], tuple[complex, ...]]
"""x, y and angle of each body, as functions of the leader's position that take complex steps."""


def of_crane(s: complex) -> tuple[complex, ...]:
    """Boom, cylinder and rod: y is up."""
    foot, pivot, arm = np.array([0.2, 0.3]), np.array([0.0, 1.0]), np.array([0.9, -0.1])
    ground, b, length = np.hypot(*(pivot - foot)), np.hypot(*arm), s + 0.6
    along = np.arctan2(*(pivot - foot)[::-1])
    at_foot = np.arccos((length**2 + ground**2 - b**2) / (2 * length * ground))
    ram = along - at_foot
    tip = foot + length * np.array([np.cos(ram), np.sin(ram)])
    boom = np.arctan((tip - pivot)[1] / (tip - pivot)[0]) - np.arctan2(*arm[::-1])
    return (
        pivot[0] + np.cos(boom), pivot[1] + np.sin(boom), boom,
        foot[0] + 0.3 * np.cos(ram), foot[1] + 0.3 * np.sin(ram), ram,
        foot[0] + (s + 0.4) * np.cos(ram), foot[1] + (s + 0.4) * np.sin(ram), ram,
    )  # fmt: skip


def of_bars(q: complex) -> tuple[complex, ...]:
    """Crank, coupler and rocker."""
    joint, foot = 0.3 * np.array([np.cos(q), np.sin(q)]), np.array([0.9, 0.1])
    way = foot - joint
    d2 = way @ way
    share = (0.8**2 - 0.6**2 + d2) / (2 * d2)
    off = np.sqrt(0.8**2 / d2 - share**2)
    pin = joint + share * way + off * np.array([-way[1], way[0]])
    coupler, rocker = ((pin - joint) / 0.8, (pin - foot) / 0.6)
    turned = np.arctan(coupler[1] / coupler[0]), -np.arctan(rocker[0] / rocker[1])
    return *(joint / 2), q, *(joint + 0.4 * coupler), turned[0], *(foot + 0.3 * rocker), turned[1]


CASES = [
    pytest.param(CRANE, "stroke", of_crane, (40, 40 / 3, 5, 0.15, 3, 0.2), (3e4, 0.35), id="ram"),
    pytest.param(BARS, "turn", of_bars, (2, 0.015, 3, 0.16, 4, 0.12), (20.0, np.radians(80.0)), id="four bars"),
]


def derivatives(function: Callable[[complex], complex], u: float) -> tuple[complex, complex]:
    """The first derivative by a complex step, the second by central differences of that."""
    h, step = 1e-200, 1e-5
    first = lambda x: (function(x + 1j * h)).imag / h  # noqa: E731
    return first(u), (first(u + step) - first(u - step)) / (2 * step)


@pytest.mark.slow
@pytest.mark.parametrize(("text", "leader", "pose", "matter", "spring"), CASES)
def test_the_motion_is_that_of_the_closed_form(
    tmp_path: Path, text: str, leader: str, pose: Pose, matter: tuple[float, ...], spring: tuple[float, float]
) -> None:
    """J u'' + J' u'^2/2 + V' = 0, with J and V of bodies whose places are found by trigonometry."""
    compiled = experiment(tmp_path, text)
    run, names = engine.run(compiled), [joint.name for joint in compiled.structure.moving]
    u, ud, udd = (run.signals[name][0, :, names.index(leader)] for name in ("q", "qd", "qdd"))
    masses = [x for m, moment in zip(matter[::2], matter[1::2], strict=True) for x in (m, m, moment)]

    def inertia(x: float) -> float:
        rates = [derivatives(lambda z, k=k: pose(z)[k], x)[0] for k in range(9)]  # type: ignore[misc]
        return float(sum(m * rate**2 for m, rate in zip(masses, rates, strict=True)))

    def energy(z: complex) -> complex:
        places = pose(z)
        return sum(m * G * places[3 * k + 1] for k, m in enumerate(matter[::2])) + spring[0] / 2 * (z - spring[1]) ** 2

    step = 1e-5
    for k in range(0, len(u), 10):
        J = inertia(u[k])
        slope = (inertia(u[k] + step) - inertia(u[k] - step)) / (2 * step)
        expected = -(slope * ud[k] ** 2 / 2 + derivatives(energy, u[k])[0]) / J
        assert udd[k] == pytest.approx(expected, rel=1e-8, abs=1e-8 * np.abs(udd).max())
        assert run.signals[f"{leader}.J_eff"][0, k] == pytest.approx(J, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("text", [CRANE, BARS], ids=["ram", "four bars"])
@pytest.mark.parametrize(("integrator", "order"), [("modified_euler", 2), ("rk4", 4)])
def test_integrators_keep_their_order_and_energy_stays(tmp_path: Path, text: str, integrator: str, order: int) -> None:
    ends, drifts = [], []
    for hz in (1600, 3200, 6400, 51200):
        at_rate = changed(
            text,
            ("dynamics = 1 kHz", f"dynamics = {hz} Hz"),
            ("    duration", f"    integrator = {integrator};\n    duration"),
        )
        signals = engine.run(experiment(tmp_path, at_rate)).signals
        ends.append(signals["q"][0])
        energy = signals["energy.kinetic"][0] + signals["energy.potential"][0]
        drifts.append(np.abs(energy - energy[0]).max() / np.ptp(signals["energy.kinetic"][0]))
    errors = np.array([np.abs(history - ends[3]).max() for history in ends[:3]])
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(order, abs=0.1)
    assert drifts[-1] < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("text", [CRANE, BARS], ids=["ram", "four bars"])
def test_a_loop_stays_closed_to_rounding(tmp_path: Path, text: str) -> None:
    wanted = "links.rod, links.boom" if text is CRANE else "links.coupler, links.rocker"
    names = [f"{link}.{kind}" for link in wanted.split(", ") for kind in ("position", "orientation")]
    signals = engine.run(
        experiment(tmp_path, changed(text, ("record = [q,", f"record = [{', '.join(names)}, q,")))
    ).signals
    pins = ([0.6, 0, 0], [0.9, 0, -0.1]) if text is CRANE else ([0.8, 0, 0], [0, 0.6, 0])
    places = [
        signals[names[2 * k]][0] + [turned(w, np.array(pins[k])) for w in signals[names[2 * k + 1]][0]] for k in (0, 1)
    ]
    assert np.abs(places[0] - places[1]).max() < 2e-15


def turned(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """A vector turned by a unit quaternion w, x, y, z."""
    return v + 2.0 * np.cross(q[1:], np.cross(q[1:], v) + q[0] * v)


def test_a_crank_turns_on_and_on_without_a_jump_of_what_follows_it(tmp_path: Path) -> None:
    moved = "servo drive { model = ideal;  bandwidth = 50 1/s;  command = rate(8 rad/s); }\nrun"
    start, _, rest = BARS.partition("servo drive")
    text = start + moved + rest.partition("run")[2].replace("dynamics = 1 kHz;", "dynamics = 1 kHz;  servos = 1 kHz;")
    signals = engine.run(experiment(tmp_path, text.replace("0.5 s", "2 s").replace("1 rad/s;", "8 rad/s;"))).signals
    q, qd = signals["q"][0], signals["qd"][0]
    assert q[-1, 0] > 2.0 * np.pi and np.abs(np.diff(q, axis=0)).max() < 0.3
    assert np.ptp(q[:, 2]) < 2.0 < np.ptp(q[:, 1])
    assert np.abs(np.gradient(q, 0.01, axis=0) - qd)[1:-1].max() < 0.05 * np.abs(qd).max()


@pytest.mark.parametrize(
    ("text", "changes", "joint"),
    [
        (CRANE, [("rest = 0.35 m", "rest = 2 m")], "hinge"),
        (BARS, [("rest = 80 deg", "rest = 200 deg"), ("[0, 0.6, 0]", "[0, 0.3, 0]")], "knee"),
    ],
    ids=["ram", "four bars"],
)
def test_a_pose_that_does_not_determine_the_motion_fails_the_case(
    tmp_path: Path, text: str, changes: list[tuple[str, str]], joint: str
) -> None:
    run = engine.run(experiment(tmp_path, changed(text, *changes, ("duration = 0.5 s", "duration = 2 s"))))
    (cause,) = run.cause
    assert f": joint {joint}: " in cause and "deck.ic:" in cause
    assert " comes to be stretched or folded flat" in cause


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["modified_euler", "midpoint", "rk4", "semi_implicit_euler"])
def test_no_step_jumps_over_a_dead_centre(tmp_path: Path, integrator: str) -> None:
    """A boom on an idle ram swings through the line of the ram, wherever it begins, with steps that are long and short
    there."""
    falling = changed(
        CRANE,
        ("stiffness = 3e4 N/m;  rest = 0.35 m;", ""),
        ("stroke.qd = 0.2 m/s;", ""),
        ("duration = 0.5 s;", f"integrator = {integrator};  duration = 2 s;"),
    )
    sweep = "default sweep starts of raise { vary initial.stroke.q = linspace(0.1, 0.4, 40) m; }\n"
    run = engine.run(experiment(tmp_path, falling + sweep))
    assert len(run.cause) == 40
    assert all(" comes to be stretched or folded flat" in cause for cause in run.cause), run.cause


def test_bars_do_not_change_their_branch_where_two_sums_of_sides_are_equal(tmp_path: Path) -> None:
    """At 180 deg a parallelogram is flat, and may go on as one whose bars cross."""
    equal = changed(
        BARS,
        ("{ turn = drive; }", "{ turn = ideal { command = rate(3 rad/s); } }"),
        ("at = [0.9, 0.1, 0] m", "at = [0.8, 0, 0] m"),
        ("to_at = [0, 0.6, 0] m", "to_at = [0.3, 0, 0] m"),
        ("record = 100 Hz", "servos = 1 kHz;  record = 100 Hz"),
        ("turn.qd = 1 rad/s", "turn.qd = 3 rad/s"),
        ("duration = 0.5 s", "duration = 2 s"),
    )
    (cause,) = engine.run(experiment(tmp_path, "#include <servos/ideal.ic>\n" + equal)).cause
    assert " comes to be stretched or folded flat" in cause
    assert 0.92 < float(cause.partition("t = ")[2].partition(" s")[0]) < np.radians(160) / 3


def test_a_follower_begins_in_the_turn_of_its_range(tmp_path: Path) -> None:
    """Within 180 deg of the middle of the range, not of 0."""
    ranged = changed(BARS, ("at = [0.9, 0.1, 0] m;", "at = [0.9, 0.1, 0] m;  q_min = 300 deg;  q_max = 500 deg;"))
    begins = [experiment(tmp_path, text).parameters["initial.nod.q"].value for text in (BARS, ranged)]
    assert begins[1] == pytest.approx(begins[0] + 2.0 * np.pi, abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("push", "slides"), [(0.999, False), (1.001, True)])
def test_a_loop_sticks_as_one(tmp_path: Path, push: float, slides: bool) -> None:
    """The friction at each joint acts on the ram by its rate against the ram's."""
    text = LINKED.partition("sweep")[0]
    ratio = ratios(tmp_path, CRANE)
    threshold = 5.0 + ratio["hinge"] + ratio["swing"]
    weightless = changed(
        changed(text, ("gravity = [0, 0, -9.81] m/s^2", "gravity = [0, 0, 0] m/s^2"), ("stroke.qd = 0.2 m/s;", "")),
        ("rest = 40 deg", "rest = 0 deg"), ("rest = 0.35 m", f"rest = {0.3 + push * threshold / 3e4!r} m"),
    )  # fmt: skip
    q = engine.run(experiment(tmp_path, weightless)).signals["q"][0, :, 2]
    assert (np.ptp(q) > 0.0) == slides


def ratios(folder: Path, text: str) -> dict[str, float]:
    """The sizes of the rates of the crane's joints for each unit of the stroke's, where it begins."""
    compiled = experiment(folder, text)
    rates = {name: compiled.parameters[f"initial.{name}.qd"].value for name in ("hinge", "swing", "stroke")}
    return {name: abs(rate / rates["stroke"]) for name, rate in rates.items()}  # type: ignore[operator]


def test_the_modes_of_a_loop_are_those_of_its_one_coordinate(tmp_path: Path) -> None:
    assert PeriodProgram(experiment(tmp_path, CRANE)).states == ("stroke.q", "stroke.qd")


@pytest.mark.slow
def test_cases_with_other_points_are_as_runs_alone(tmp_path: Path) -> None:
    swept = engine.run(experiment(tmp_path, LINKED, select="places"))
    for case, (x, at) in enumerate(((0.8, 0.75), (0.9, 0.8), (1, 0.85))):
        alone = changed(
            LINKED.partition("sweep")[0],
            ("[0.9, 0, -0.1]", f"[{x}, 0, -0.1]"),
            ("at = [0.8, 0, 0]", f"at = [{at}, 0, 0]"),
        )
        np.testing.assert_allclose(
            swept.signals["q"][case], engine.run(experiment(tmp_path, alone)).signals["q"][0], rtol=1e-11, atol=1e-13
        )


@pytest.mark.slow
def test_the_momentum_of_a_free_base_with_a_ram_stays(tmp_path: Path) -> None:
    text = changed(
        CRANE,
        ("    link boom", "    link base { mass = 90 kg;  inertia = [9, 9, 9] kg*m^2; }\n    link boom"),
        ("    arm = crane;", "    arm = crane;  base = free;"),
        ("environment { gravity = [0, 0, -9.81] m/s^2; }", ""),
        ("energy,", "momentum, energy,"),
        ("dynamics = 1 kHz", "dynamics = 4 kHz"), ("    duration", "    integrator = rk4;\n    duration"),
    )  # fmt: skip
    signals = engine.run(experiment(tmp_path, text)).signals
    for kind in ("linear", "angular"):
        momentum = signals[f"momentum.{kind}"][0]
        assert np.abs(momentum - momentum[0]).max() < 1e-9
    total = signals["energy.kinetic"][0] + signals["energy.potential"][0]
    assert np.ptp(total) < 1e-9 * np.ptp(signals["energy.kinetic"][0])


@pytest.mark.slow
def test_a_payload_that_a_boom_grapples_strikes_the_ram(tmp_path: Path) -> None:
    """J u' before is (J + m v^2) u' after, where v is the speed of the boom's tip for u' = 1."""
    ball = """payload ball { mass = 10 kg;  inertia = [1e-9, 1e-9, 1e-9] kg*m^2;  on = boom;  at = [2, 0, 0] m;
                   grapple = 0.001 s;  position = [0, 0, 0] m; }\n    rates"""
    text = changed(
        CRANE, ("    rates", f"    {ball}"), ("gravity = [0, 0, -9.81] m/s^2", "gravity = [0, 0, 0] m/s^2"),
        ("stiffness = 3e4", "stiffness = 0"), ("record = 100 Hz", "record = 1 kHz"),
        ("duration = 0.5 s", "duration = 0.002 s"),
    )  # fmt: skip
    place = engine.run(experiment(tmp_path, text)).signals
    tip = np.array([2 * np.cos(place["q"][0, 1, 0]), 0, 1 + 2 * np.sin(place["q"][0, 1, 0])])
    at_tip = changed(text, ("position = [0, 0, 0] m", f"position = {[float(x) for x in tip]} m"))
    signals = engine.run(experiment(tmp_path, at_tip)).signals
    ratio = signals["qd"][0, 1, 0] / signals["qd"][0, 1, 2]
    before, J = engine.run(experiment(tmp_path, CRANE)).signals["qd"][0, 0, 2], signals["stroke.J_eff"][0]
    assert J[1] - J[0] == pytest.approx(10 * (2 * ratio) ** 2, rel=1e-2)
    unhit = engine.run(experiment(tmp_path, changed(text, ("grapple = 0.001 s", "grapple = 1 s")))).signals
    free = unhit["stroke.J_eff"][0, 1]
    assert signals["qd"][0, 1, 2] == pytest.approx(
        unhit["qd"][0, 1, 2] * free / (free + 10 * (2 * ratio) ** 2), rel=1e-9
    )
    assert before == 0.2


def test_a_plan_whose_loop_does_not_hold_three_joints_is_damaged(tmp_path: Path) -> None:
    structure = experiment(tmp_path, CRANE).structure
    hinge, swing, stroke = structure.joints
    assert hinge.loop is not None
    for loop in (replace(hinge.loop, leader="swing"), replace(hinge.loop, link="boom"), replace(hinge.loop, to="rod")):
        with pytest.raises(Damaged, match="three moving joints"):
            check(replace(structure, joints=(replace(hinge, loop=loop), swing, stroke)), "structure")
