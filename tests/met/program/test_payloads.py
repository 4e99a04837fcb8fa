"""Payloads through runs: flight, grapple and release, what is kept, and what else the program does with them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from met import models
from met import run as engine
from met.backends.reference.plain import execute
from met.program.build import build
from met.run import Run
from tests.ic.small_decks import changed, experiment
from tests.met.program.free_flyers import ARM, matrix
from tests.met.program.payload_decks import BOX, RUN

STATE = (
    "q",
    "qd",
    "links.base.position",
    "links.base.orientation",
    "links.base.velocity",
    "links.base.rate",
    "payloads.box.position",
    "payloads.box.orientation",
    "payloads.box.velocity",
    "payloads.box.rate",
)
KEPT = ("momentum.linear", "momentum.angular")
EVERY = ("record = 10 Hz", "record = 100 Hz")
FIXED = (
    ("base     = free;", ""),
    *((f"        base.{name}", f"//        base.{name}") for name in ("position", "rpy", "velocity", "rate")),
)


def flown(folder: Path, *changes: tuple[str, str], arm: str = ARM, more: str = "") -> Run:
    return engine.run(experiment(folder, arm, more, changed(RUN, *changes)))


def at_rate(hz: int, integrator: str = "modified_euler") -> tuple[tuple[str, str], ...]:
    return ("dynamics = 100 Hz", f"dynamics = {hz} Hz"), ("modified_euler", integrator)


def momentum(run: Run) -> np.ndarray:
    """Momentum and kinetic energy, row by row."""
    return np.column_stack([run.signals[name][0].reshape(len(run.time), -1) for name in (*KEPT, "energy.kinetic")])


def assert_kept(now: np.ndarray, was: np.ndarray) -> None:
    """The same to some roundings of the largest."""
    np.testing.assert_allclose(now, was, rtol=0, atol=2e-15 * np.max(np.abs(was)))


@pytest.mark.release
@pytest.mark.parametrize("integrator", models.find_own("integrator"))
def test_a_run_with_a_grapple_and_a_release_keeps_the_integrators_order(tmp_path: Path, integrator: str) -> None:
    def last(run: Run) -> np.ndarray:
        return np.concatenate([run.signals[name][0, -1].ravel() for name in STATE])

    order = models.find("integrator", integrator).order
    exact = last(flown(tmp_path, *at_rate(2560, "rk4")))
    rates = (80, 160) if order == 4 else (320, 640)
    errors = [np.max(np.abs(last(flown(tmp_path, *at_rate(hz, integrator))) - exact)) for hz in rates]
    found = math.log2(errors[0] / errors[1])
    print(f"{integrator}: order {found:.2f}, errors {errors}")
    # The error's next term is a step's share of the first.
    assert abs(found - order) < 0.15


@pytest.mark.release
@pytest.mark.parametrize("integrator", models.find_own("integrator"))
def test_momentum_is_kept_from_end_to_end_to_the_integrators_order(tmp_path: Path, integrator: str) -> None:
    order = models.find("integrator", integrator).order
    rates = (40, 80) if order == 4 else (160, 320)
    lost = []
    for hz in rates:
        whole = momentum(flown(tmp_path, *at_rate(hz, integrator)))[:, :6]
        lost.append(np.max(np.abs(whole - whole[0])) / np.max(np.abs(whole)))
    found = math.log2(lost[0] / lost[1])
    print(f"{integrator}: order {found:.2f}, lost {lost}")
    assert found > order - 0.3


@pytest.mark.slow
def test_the_impact_keeps_momentum_to_rounding_and_loses_energy_and_the_release_nothing(tmp_path: Path) -> None:
    # The same run with what happens left for later shows the instant as it was before.
    run, before = flown(tmp_path, EVERY), flown(tmp_path, EVERY, ("grapple  = 0.8 s", "grapple  = 0.9 s"))
    kept = flown(tmp_path, EVERY, ("release  = 1.5 s", "release  = 1.6 s"))
    for name in STATE:
        assert run.signals[name][0, :80].tobytes() == before.signals[name][0, :80].tobytes()
    was, now = momentum(before)[80], momentum(run)[80]
    assert_kept(now[:6], was[:6])
    assert 0.7 * was[6] < now[6] < 0.8 * was[6], "a quarter of the energy goes"
    for name in ("q", "links.base.position", "payloads.box.position", "payloads.box.orientation"):
        np.testing.assert_allclose(run.signals[name][0, 80], before.signals[name][0, 80], rtol=0, atol=1e-15)
    assert run.signals["qd"][0, 80, 0] != before.signals["qd"][0, 80, 0]
    # row 150: released, or held for a tenth of a second more
    for name in STATE:
        np.testing.assert_allclose(run.signals[name][0, 150], kept.signals[name][0, 150], rtol=0, atol=4e-15)
    np.testing.assert_allclose(momentum(run)[150], momentum(kept)[150], rtol=1e-14)
    carried = run.signals["payloads.box.carried"][0]
    assert carried.tolist() == [0.0] * 80 + [1.0] * 70 + [0.0] * 51
    held = run.signals["payloads.box.distance"][0, 80:150]
    np.testing.assert_allclose(held, held[0], rtol=1e-13)


SPHERES = """\
arm chaser { link base { mass = 3 kg; inertia = [0.7, 0.7, 0.7] kg*m^2; } }
run it {
    arm = chaser; base = free;
    initial { base.velocity = [4, 0, 0] m/s; base.position = [-2, 0, 0] m; }
    payload ball { mass = 1 kg; inertia = [0.2, 0.2, 0.2] kg*m^2; on = base; at = [0, 0.5, 0] m; grapple = 0.5 s;
                   release = 1 s; position = [0, 0.5, 0] m; }
    rates { dynamics = 1 kHz; record = 10 Hz; }
    duration = 2 s;
    record = [payloads.ball.distance, payloads.ball.velocity, links.base.velocity, links.base.rate, energy, momentum];
}
"""


@pytest.mark.slow
def test_two_spheres_that_meet_lose_what_the_formula_says(tmp_path: Path) -> None:
    run = engine.run(experiment(tmp_path, SPHERES))
    signals, mu, d, v, I = run.signals, 0.75, 0.5, 4.0, 0.9  # noqa: E741
    energy = signals["energy.kinetic"][0]
    lost = 0.5 * mu * v * v * (1.0 - mu * d * d / (I + mu * d * d))
    assert energy[0] == 24.0
    assert energy[4] - energy[5] == pytest.approx(lost, rel=1e-13)
    w = mu * d * v / (I + mu * d * d)
    # apart again, each keeps what it had: Heun on a steady turn is exact, on its path of order 2
    np.testing.assert_allclose(signals["links.base.rate"][0, 5:], [[0.0, 0.0, w]] * 16, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(energy[5:], energy[5], rtol=1e-8)
    np.testing.assert_allclose(signals["momentum.linear"][0], [[12.0, 0.0, 0.0]] * 21, rtol=1e-8, atol=1e-7)
    np.testing.assert_allclose(signals["payloads.ball.distance"][0, 5:11], 0.0, atol=1e-6)
    spin = signals["payloads.ball.velocity"][0, 10:]
    np.testing.assert_allclose(spin, np.broadcast_to(spin[0], spin.shape), rtol=1e-13)


@pytest.mark.slow
def test_while_it_is_held_it_moves_with_its_link(tmp_path: Path) -> None:
    run = flown(
        tmp_path,
        EVERY,
        (
            "record   = [",
            "record   = [links.lower.position, links.lower.orientation, links.lower.velocity, links.lower.rate, ",
        ),
    )
    rows = slice(80, 150)
    p, v, w = (run.signals[f"links.lower.{name}"][0, rows] for name in ("position", "velocity", "rate"))
    r = run.signals["payloads.box.position"][0, rows] - p
    np.testing.assert_allclose(run.signals["payloads.box.rate"][0, rows], w, rtol=0, atol=1e-14)
    np.testing.assert_allclose(run.signals["payloads.box.velocity"][0, rows], v + np.cross(w, r), rtol=0, atol=1e-14)
    R = [matrix(q) for q in run.signals["links.lower.orientation"][0, rows]]
    own = np.array([each.T @ x for each, x in zip(R, r, strict=True)])
    np.testing.assert_allclose(own, np.broadcast_to(own[0], own.shape), rtol=0, atol=1e-14)


HELD = (
    ("        grapple  = 0.8 s;\n", ""),
    ("        position = [2.6, 3, 3.4] m;\n", ""),
    ("        attitude = [10, -20, 30] deg;\n", "        rpy = [10, -20, 30] deg;\n"),
    ("        velocity = [0.3, -0.6, 0.2] m/s;\n", ""),
    ("        rate     = [-30, 20, 45] deg/s;\n", ""),
)
MERGED = changed(
    ARM,
    (
        "    joint shoulder",
        "    link box { mass = 12 kg; com = [0.1, -0.05, 0.02] m; "
        "inertia = [0.8, 0.9, 1.1, 0.02, -0.03, 0.05] kg*m^2; }\n    joint shoulder",
    ),
    (
        "at = [1, 0, 0] m; }\n}",
        "at = [1, 0, 0] m; }\n    joint grip fixed { parent = lower; child = box; "
        "at = [1, 0, 0] m; rpy = [10, -20, 30] deg; }\n}",
    ),
)
BARE = changed(
    RUN,
    (BOX, ""),
    (
        ", payloads.box.position, payloads.box.orientation, payloads.box.velocity, "
        "payloads.box.rate, payloads.box.distance, payloads.box.carried, reaction]",
        ", links.box.position, reaction]",
    ),
)
SAME = ("q", "qd", "qdd", "tau", "J_eff", "b", "reaction.moment", "reaction.force", "energy.kinetic", *KEPT)


@pytest.mark.release
@pytest.mark.parametrize("base", ["free", "fixed"])
@pytest.mark.parametrize("released", [True, False])
def test_a_payload_that_is_held_is_a_link_behind_a_fixed_joint(tmp_path: Path, base: str, released: bool) -> None:
    still = () if base == "free" else FIXED
    on_it = (
        ()
        if base == "free"
        else (
            (
                "links.base.position, links.base.orientation, links.base.velocity, links.base.rate,\n                ",
                "",
            ),
        )
    )
    wanted = engine.run(experiment(tmp_path, MERGED, changed(BARE, *still, *on_it)))
    gone = () if released else (("        release  = 1.5 s;\n", ""),)
    found = flown(tmp_path, *HELD, *still, *on_it, *gone)
    rows = slice(0, 15 if released else None)
    assert found.signals["payloads.box.carried"][0].tolist() == [1.0] * 15 + [float(not released)] * 6
    for name in SAME:
        size = np.max(np.abs(wanted.signals[name][0]))
        np.testing.assert_allclose(
            found.signals[name][0, rows], wanted.signals[name][0, rows], rtol=0, atol=1e-12 * size, err_msg=name
        )
    np.testing.assert_allclose(
        found.signals["payloads.box.position"][0, rows],
        wanted.signals["links.box.position"][0, rows],
        rtol=0,
        atol=1e-12,
    )
    if released:
        assert np.max(np.abs(found.signals["qd"][0, -1] - wanted.signals["qd"][0, -1])) > 0.05
        kept = momentum(found)[:, 6]
        np.testing.assert_allclose(kept, kept[0], rtol=2e-3)


@pytest.mark.slow
def test_a_payload_falls_freely_until_it_is_grappled(tmp_path: Path) -> None:
    falls = [
        ("environment {}", "environment { gravity = [1, -2, -9] m/s^2; }"),
        ("        com      = [0.1, -0.05, 0.02] m;\n", ""),
        ("grapple  = 0.8 s", "grapple  = 1.8 s"),
        ("release  = 1.5 s", "release  = 1.9 s"),
    ]
    run = flown(tmp_path, *falls)
    t = run.time[:18, None]
    place = np.array([2.6, 3.0, 3.4]) + np.array([0.3, -0.6, 0.2]) * t + 0.5 * np.array([1.0, -2.0, -9.0]) * t * t
    # Heun makes a parabola exactly
    np.testing.assert_allclose(run.signals["payloads.box.position"][0, :18], place, rtol=1e-12)
    whole = run.signals["energy.kinetic"][0] + run.signals["energy.potential"][0]
    np.testing.assert_allclose(whole[:18], whole[0], rtol=1e-4)
    np.testing.assert_allclose(whole[18:], whole[18], rtol=1e-4)
    assert whole[18] < whole[17]


@pytest.mark.slow
def test_a_wrench_on_a_payload_is_felt_wherever_it_is(tmp_path: Path) -> None:
    push = "push = wrench { link = box; force = [6, 4, 2] N; moment = [1, 2, 3] N*m; point = [0.2, 0.1, 0] m; };"
    run = flown(tmp_path, ("environment {}", f"environment {{ {push} }}"), EVERY, *at_rate(200, "rk4"))
    force, moment = np.array([6.0, 4.0, 2.0]), np.array([1.0, 2.0, 3.0])
    R = np.array([matrix(q) for q in run.signals["payloads.box.orientation"][0]])
    point = run.signals["payloads.box.position"][0] + R @ (0.2, 0.1, 0.0)
    gained = momentum(run)[-1] - momentum(run)[0]
    np.testing.assert_allclose(gained[:3], 2.0 * force, rtol=1e-9)
    # the integral over smooth stretches by Simpson's rule: free, held, free
    rate = moment + np.cross(point, force)
    whole = sum(_simpson(rate[first : last + 1], 0.01) for first, last in ((0, 80), (80, 150), (150, 190)))
    whole = whole + _simpson(rate[190:], 0.01)
    np.testing.assert_allclose(gained[3:6], whole, rtol=1e-6)


@pytest.mark.slow
def test_a_gradient_of_gravity_pulls_at_payloads_too(tmp_path: Path) -> None:
    # Hill's equations of a point that is let go beside the origin: drift along the flight, 4 periods of 200 s on a
    # small and heavy world
    orbit = "tide = gravity_gradient { radius = 6800 km; frame = orbital; };"
    far = [
        ("environment {}", f"environment {{ {orbit} }}"),
        ("grapple  = 0.8 s", "grapple = 900 s"),
        ("        release  = 1.5 s;\n", ""),
        ("position = [2.6, 3, 3.4] m", "position = [0, 0, 0] m"),
        ("velocity = [0.3, -0.6, 0.2] m/s", "velocity = [0, 0.1, 0.05] m/s"),
        ("        com      = [0.1, -0.05, 0.02] m;\n", ""),
        ("duration = 2 s", "duration = 1000 s"),
        ("rate     = [-30, 20, 45] deg/s", "rate = [0, 0, 0] deg/s"),
        ("record = 10 Hz", "record = 1 Hz"),
        *FIXED,
        ("shoulder.qd   = 0.5", "shoulder.qd   = 0"),
        ("elbow.qd      = -1", "elbow.qd      = 0"),
        ("links.base.position, links.base.orientation, links.base.velocity, links.base.rate,", ""),
    ]
    run = flown(tmp_path, *far, *at_rate(10, "rk4"))
    n = math.sqrt(3.986004418e14 / 6.8e6**3)
    t = run.time[:900]
    s, c = np.sin(n * t), np.cos(n * t)
    place = np.column_stack([2.0 * 0.1 / n * (1.0 - c), 0.1 / n * (4.0 * s - 3.0 * n * t), 0.05 / n * s])
    np.testing.assert_allclose(run.signals["payloads.box.position"][0, :900], place, rtol=0, atol=1e-8)


PLUME = """\
arm tower { link mast { mass = 10 kg; shape = sphere(radius = 0.3 m); }
            joint turn revolute { parent = base; child = mast; axis = z; } }
run it {
    arm = tower;
    payload box { mass = 1000 kg; inertia = [90, 90, 90] kg*m^2; on = mast; grapple = 1 s; position = [3, 0, 0] m;
                  attitude = [0, -90, 0] deg; }
    environment {
        jet = plume { link = box; width = 2 cm; height = 2 cm; nozzle_link = mast; nozzle = [1, 0, 0] m;
                      axis = [1, 0, 0]; thrust = 50 N; exponent = 8; sigma_n = 1; sigma_t = 0; }
    }
    rates { dynamics = 100 Hz; record = 10 Hz; }
    duration = 2 s;
    record = [q, qd, payloads.box.velocity, payloads.box.carried, tau_load];
}
"""


@pytest.mark.release
def test_the_gas_of_a_thruster_pushes_a_payload_in_flight(tmp_path: Path) -> None:
    # straight on: 2 q A with q = (n + 2) thrust/(4 pi r^2), the plate a hundredth of the distance wide
    run = engine.run(experiment(tmp_path, PLUME))
    force = 2.0 * 4e-4 * 10.0 * 50.0 / (4.0 * math.pi * 2.0**2)
    assert run.signals["payloads.box.velocity"][0, 9, 0] == pytest.approx(0.9 * force / 1000.0, rel=2e-4)
    assert run.signals["payloads.box.carried"][0, 9:11].tolist() == [0.0, 1.0]
    assert run.signals["qd"][0, :10].tolist() == [[0.0]] * 10


SERVOS = """\
servo rub { model = passive; friction = 50 N*m; }
servo hold { model = locked; release = 1.5 s; }
servo soft {
    model = compliant_gearbox;
    ratio = 50; kp = 0.1 V*s/rad; ki = 1 V/rad; v_max = 24 V; resistance = 1 ohm; kt = 0.05 N*m/A; tau_max = 1 N*m;
    j_m = 1e-3 kg*m^2; stiffness = 2e3 N*m/rad;
    command = rate(0.2 rad/s);
}
servo drive {
    model = rigid_gearbox;
    ratio = 100; kp = 0.1 V*s/rad; ki = 1 V/rad; v_max = 24 V; resistance = 1 ohm; kt = 0.05 N*m/A; tau_max = 1 N*m;
    j_m = 1e-4 kg*m^2; f_c = 0.05 N*m;
    command = rate(0 rad/s);
}
"""


def both(folder: Path, servos: str, *changes: tuple[str, str]) -> tuple[Run, Run]:
    """A run with these servos, and the same with the grapple a tenth of a second later: before and after are row 8."""
    driven = ("base     = free;", f"base = free; servos {{ {servos} }}")
    some = (driven, ("record = 10 Hz;", "servos = 400 Hz; record = 10 Hz;"), *at_rate(400), *changes)
    runs = [flown(folder, *some, *more, more=SERVOS) for more in ((), (("grapple  = 0.8 s", "grapple  = 0.9 s"),))]
    return runs[0], runs[1]


@pytest.mark.release
def test_dry_friction_holds_no_joint_against_a_blow(tmp_path: Path) -> None:
    run, before = both(tmp_path, "shoulder = rub;", ("shoulder.qd   = 0.5", "shoulder.qd   = 0"))
    assert before.signals["qd"][0, 8, 0] == 0.0
    assert abs(run.signals["qd"][0, 8, 0]) > 0.1
    assert_kept(momentum(run)[8, :6], momentum(before)[8, :6])


@pytest.mark.slow
def test_a_locked_joint_does_not_jump_and_momentum_is_kept_all_the_same(tmp_path: Path) -> None:
    run, before = both(tmp_path, "elbow = hold;", ("elbow.qd      = -1", "elbow.qd      = 0"))
    assert run.signals["qd"][0, 8:15, 1].tolist() == [0.0] * 7
    assert run.signals["qd"][0, 8, 0] != before.signals["qd"][0, 8, 0]
    assert_kept(momentum(run)[8, :6], momentum(before)[8, :6])


@pytest.mark.release
def test_a_rotor_behind_a_compliant_gear_goes_on_turning_through_the_blow(tmp_path: Path) -> None:
    recorded = ("record   = [", "record   = [shoulder.servo.motor_rate, ")
    runs = both(tmp_path, "shoulder = soft;", recorded, ("shoulder.qd   = 0.5", "shoulder.qd   = 0"))
    roll, pitch = math.radians(20), math.radians(30)  # of the shoulder's frame on the base
    axis = np.array([math.cos(roll) * math.sin(pitch), -math.sin(roll), math.cos(roll) * math.cos(pitch)])
    of_base = [
        _turned(run.signals["links.base.orientation"][0, 8], axis) @ run.signals["links.base.rate"][0, 8]
        for run in runs
    ]
    of_motor = [run.signals["shoulder.servo.motor_rate"][0, 8] for run in runs]
    assert abs(of_base[0] - of_base[1]) > 0.1
    np.testing.assert_allclose(of_motor[0] + of_base[0], of_motor[1] + of_base[1], rtol=1e-13)
    assert abs(runs[0].signals["qd"][0, 8, 0] - runs[1].signals["qd"][0, 8, 0]) > 0.1


def _turned(orientation: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """A vector in world axes; orientation: the quaternion (w, x, y, z) of the frame that it is given in."""
    w, u = orientation[0], orientation[1:]
    return vector + 2.0 * np.cross(u, np.cross(u, vector) + w * vector)


@pytest.mark.release
def test_a_rigid_gears_rotor_takes_its_share_of_the_blow(tmp_path: Path) -> None:
    # With the base fixed, and rotors as heavy as can be: what is nearly held does not jump.
    free, _ = both(tmp_path, "", *FIXED[1:], ("base = free;", ""))
    held, before = both(
        tmp_path,
        "shoulder = drive; elbow = drive;",
        *FIXED[1:],
        ("base = free;", ""),
        ("shoulder.qd   = 0.5", "shoulder.qd   = 0"),
        ("elbow.qd      = -1", "elbow.qd      = 0"),
    )
    heavy, _ = both(
        tmp_path,
        "shoulder = drive { j_m = 1 kg*m^2; }; elbow = drive { j_m = 1 kg*m^2; };",
        *FIXED[1:],
        ("base = free;", ""),
        ("shoulder.qd   = 0.5", "shoulder.qd   = 0"),
        ("elbow.qd      = -1", "elbow.qd      = 0"),
    )
    jumped = np.abs(held.signals["qd"][0, 8] - before.signals["qd"][0, 8])
    assert (jumped > 1e-2).all()
    assert (np.abs(heavy.signals["qd"][0, 8]) < 2e-3).all()
    assert free.cause == [""]


@pytest.mark.release
def test_a_motor_on_a_bed_turns_on_as_its_shaft_does(tmp_path: Path) -> None:
    run, before = both(
        tmp_path,
        "shoulder = drive; } substitute shoulder { bed = emulated;",
        ("shoulder.qd   = 0.5", "shoulder.qd   = 0"),
    )
    assert abs(run.signals["qd"][0, 8, 0] - before.signals["qd"][0, 8, 0]) < 1e-9
    assert abs(run.signals["qd"][0, 8, 1] - before.signals["qd"][0, 8, 1]) > 0.1
    assert run.signals["J_eff"][0, 8, 0] > 1.2 * before.signals["J_eff"][0, 8, 0], "and feels what is held now"


@pytest.mark.release
def test_two_payloads_that_are_grappled_at_once_are_one_impact(tmp_path: Path) -> None:
    other = changed(
        BOX,
        ("payload box", "payload other"),
        ("on       = lower", "on       = upper"),
        ("position = [2.6, 3, 3.4] m", "position = [1, 1, 3] m"),
        ("mass     = 12 kg", "mass     = 7 kg"),
        ("release  = 1.5 s", "release  = 1.3 s"),
    )
    two = (BOX, BOX + other)
    run, before = (
        flown(tmp_path, two, EVERY, *more)
        for more in (
            (),
            (
                ("grapple  = 0.8 s", "grapple  = 0.9 s"),
                ("payload other {\n        mass     = 7 kg;", "payload other {\n        mass     = 7.0 kg;"),
            ),
        )
    )
    np.testing.assert_allclose(momentum(run)[79, :6], momentum(before)[79, :6], rtol=0, atol=1e-13)
    whole = momentum(run)[:, :6]
    assert np.max(np.abs(whole[80] - whole[79])) < 1e-4 * np.max(np.abs(whole))
    swapped = flown(tmp_path, (BOX, other + BOX), EVERY)
    for name in STATE:
        np.testing.assert_allclose(swapped.signals[name], run.signals[name], rtol=0, atol=1e-12)


@pytest.mark.release
@pytest.mark.parametrize("link", ["base", "lower"])
def test_on_a_base_that_is_told_its_way_a_payload_goes_along_and_off_with_its_speed(tmp_path: Path, link: str) -> None:
    told = (
        (
            "base     = free;",
            "base = prescribed { x = sine(amplitude = 0.1 m, frequency = 0.5 Hz); "
            "yaw = sine(amplitude = 0.2 rad, frequency = 0.3 Hz); };",
        ),
        *FIXED[1:],
        ("on       = lower", f"on = {link}"),
        EVERY,
    )
    run = flown(tmp_path, *told)
    later = flown(tmp_path, *told, ("release  = 1.5 s", "release = 1.7 s"))
    for name in STATE:
        np.testing.assert_allclose(run.signals[name][0, 150], later.signals[name][0, 150], rtol=0, atol=1e-14)
    own = run.signals["payloads.box.velocity"][0, 150:]
    inertial = own - np.cross(run.signals["payloads.box.rate"][0, 150:], 0.0 * own)
    assert np.max(np.abs(np.diff(inertial, axis=0))) < 0.01
    jumps = np.abs(np.diff(run.signals["qd"][0], axis=0)[79])
    assert (jumps > 0.05).all() if link == "lower" else (jumps < 0.05).all()


@pytest.mark.slow
def test_a_payload_on_the_ground_stays_there(tmp_path: Path) -> None:
    run = flown(
        tmp_path,
        *FIXED,
        ("on       = lower", "on = base"),
        ("links.base.position, links.base.orientation, links.base.velocity, links.base.rate,", ""),
    )
    place = run.signals["payloads.box.position"][0]
    np.testing.assert_allclose(place[8:], np.broadcast_to(place[8], place[8:].shape), rtol=0, atol=1e-15)
    assert not run.signals["payloads.box.velocity"][0, 8:].any()


SWEEP = """\
sweep some of tumbling {
    zip {
        payloads.box.grapple    = [0.8, 0.83, 5, 0] s;
        payloads.box.release    = [1.5, 0.9, 6, 0.001] s;
        payloads.box.mass       = [12, 20, 13, 5] kg;
        payloads.box.inertia.xx = [0.8, 1, 0.85, 0.7] kg*m^2;
        payloads.box.position.x = [2.6, 2, 2.65, 2.7] m;
    }
}
"""


@pytest.mark.release
def test_cases_that_are_grappled_at_other_times_leave_each_other_alone(tmp_path: Path) -> None:
    found = experiment(tmp_path, ARM, RUN, SWEEP, select=["some"])
    run = engine.run(found)
    assert run.cause == [""] * 4
    for case in range(4):
        alone = engine.run(found, cases=[case])
        for name in run.signals:
            assert run.signals[name][case].tobytes() == alone.signals[name][0].tobytes(), (case, name)
    single = flown(tmp_path)
    for name in STATE:
        np.testing.assert_allclose(run.signals[name][0], single.signals[name][0], rtol=0, atol=1e-12)
    assert run.signals["payloads.box.carried"].sum(axis=1).tolist() == [7.0, 0.0, 0.0, 1.0]
    second = changed(
        RUN,
        ("mass     = 12", "mass     = 20"),
        ("[0.8, 0.9, 1.1,", "[1, 0.9, 1.1,"),
        ("[2.6, 3, 3.4]", "[2, 3, 3.4]"),
        ("0.8 s", "0.83 s"),
        ("1.5 s", "0.9 s"),
    )
    other = engine.run(experiment(tmp_path, ARM, second))
    for name in STATE:
        np.testing.assert_allclose(run.signals[name][1], other.signals[name][0], rtol=0, atol=1e-12)


@pytest.mark.slow
def test_plain_numbers_give_the_kernels_results(tmp_path: Path) -> None:
    found = experiment(tmp_path, ARM, changed(RUN, ("duration = 2 s", "duration = 1.6 s")))
    plain, _ = execute(build(found), {}, found.structure.schedule.ticks)
    kernel = engine.run(found)
    ours = np.concatenate(
        [kernel.signals[each.name][0].reshape(len(kernel.time), -1) for each in found.structure.record], axis=1
    )
    np.testing.assert_allclose(plain, ours, rtol=0, atol=1e-10)


@pytest.mark.slow
def test_a_payload_that_runs_away_fails_its_case_and_says_so(tmp_path: Path) -> None:
    push = "push = wrench { link = box; force = [1e308, 1e308, 0] N; moment = [1e308, 0, 0] N*m; };"
    run = flown(tmp_path, ("environment {}", f"environment {{ {push} }}"))
    assert run.status[0] == engine.FAILED
    assert run.cause[0].replace(str(tmp_path), "") == (
        "t = 0.01 s: payload box: position, rate or acceleration is no longer a finite number (/deck.ic:21). Usual "
        "reasons: a step too long for what acts on it (try a faster rate for the dynamics), or a model that divides "
        "by zero."
    )


def _simpson(rows: np.ndarray, step: float) -> np.ndarray:
    weights = np.array([1.0, *[4.0, 2.0] * (len(rows) // 2 - 1), 4.0, 1.0])
    return step / 3.0 * weights @ rows
