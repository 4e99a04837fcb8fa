"""A base that moves as it is told: pose, velocity and acceleration of one function, and the arm upon it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.backends.reference.plain import execute
from met.program import build
from tests.ic.small_decks import changed, experiment
from tests.met.program.free_flyers import ARM, matrix
from tests.oracles.package import Package
from tests.oracles.pinocchio_floating import Flight, FloatingPinocchio
from tests.oracles.plan_tree import bodies

mpmath = Package("mpmath")

RUN = """\
run shaken {
    arm      = flyer;
    base     = prescribed {
        x     = sine(amplitude = 20 cm, frequency = 0.8 Hz, phase = 20 deg);
        y     = chirp(amplitude = 10 cm, f0 = 0.5 Hz, f1 = 2 Hz, over = 10 s);
        z     = 1.5 m;
        roll  = sine(amplitude = 30 deg, frequency = 0.5 Hz);
        pitch = sine(amplitude = 0.4 rad, frequency = 0.7 Hz, offset = 10 deg);
        yaw   = trapezoid(to = 100 deg, max_rate = 61 deg/s, max_acceleration = 50 deg/s^2);
    }
    initial  { shoulder.q = 20 deg;  elbow.q = 40 deg;  shoulder.qd = 0.5 rad/s;  elbow.qd = -1 rad/s; }
    environment { gravity = [1, -2, -9] m/s^2;  push = wrench { link = lower; force = [3, 2, 1] N; } }
    rates    { dynamics = 500 Hz; record = 10 Hz; }
    integrator = rk4;
    duration = 2 s;
    record   = [q, qd, qdd, tau_load, links.base.position, links.base.orientation, links.base.velocity,
                links.base.rate, links.lower.velocity];
}
"""


def course(t: mpmath.mpf) -> tuple[mpmath.matrix, mpmath.matrix]:
    """Position and orientation of the deck's base, by mpmath; up to 2 s the trapezoid is in its first two parts."""
    mp, deg = mpmath, mpmath.pi / 180
    p = mp.matrix(
        [
            0.2 * mp.sin(2 * mp.pi * 0.8 * t + 20 * deg),
            mp.mpf("0.1") * mp.sin(2 * mp.pi * t * (mp.mpf("0.5") + mp.mpf("0.075") * t)),
            mp.mpf("1.5"),
        ]
    )
    roll = 30 * deg * mp.sin(2 * mp.pi * mp.mpf("0.5") * t)
    pitch = mp.mpf("0.4") * mp.sin(2 * mp.pi * mp.mpf("0.7") * t) + 10 * deg
    rises = mp.mpf(61) / 50
    yaw = (25 * t * t if t < rises else 25 * rises * rises + 61 * (t - rises)) * deg
    if t > mp.mpf(100) / 61:
        yaw = (100 - 25 * (mp.mpf(100) / 61 + rises - t) ** 2) * deg

    def about(axis: int, angle: mpmath.mpf) -> mpmath.matrix:
        c, s = mp.cos(angle), mp.sin(angle)
        i, j = ((1, 2), (2, 0), (0, 1))[axis]
        R = mp.eye(3)
        R[i, i], R[j, j], R[i, j], R[j, i] = c, c, -s, s
        return R

    return p, about(2, yaw) * about(1, pitch) * about(0, roll)


def motion(t: float) -> tuple[np.ndarray, ...]:
    """R, p, and in world axes w, v, wd, a, by differences of fifty digits."""
    with mpmath.workdps(50):
        h = mpmath.mpf(10) ** -12
        before, now, after = (course(mpmath.mpf(t) + k * h) for k in (-1, 0, 1))
        v = (after[0] - before[0]) / (2 * h)
        a = (after[0] - 2 * now[0] + before[0]) / (h * h)
        first, second = (after[1] - before[1]) / (2 * h), (after[1] - 2 * now[1] + before[1]) / (h * h)
        W = first * now[1].T
        Wd = second * now[1].T + first * first.T
        w, wd = ([x[2, 1], x[0, 2], x[1, 0]] for x in (W, Wd))
        return tuple(
            np.array(x.tolist() if hasattr(x, "tolist") else x, float).squeeze() for x in (now[1], now[0], w, v, wd, a)
        )


@pytest.mark.oracle
def test_pose_and_velocity_are_those_of_the_courses(tmp_path: Path) -> None:
    run = engine.run(experiment(tmp_path, ARM, RUN))
    for i, t in enumerate(run.time):
        R, p, w, v, _, _ = motion(float(t))
        found = {name: run.signals[f"links.base.{name}"][0, i] for name in ("position", "velocity", "rate")}
        for name, expected in (("position", p), ("velocity", v), ("rate", w)):
            np.testing.assert_allclose(found[name], expected, rtol=0, atol=2e-14, err_msg=f"{name} at {t} s")
        q = run.signals["links.base.orientation"][0, i]
        np.testing.assert_allclose(matrix(q), R, rtol=0, atol=1e-15 * 4)


@pytest.mark.oracle
def test_the_arm_upon_it_moves_as_pinocchio_says(tmp_path: Path) -> None:
    # The joints are free, so what Pinocchio's inverse dynamics needs of them for this motion of base and joints is
    # nothing; as a share of what the base's acceleration asks of joints that are held.
    found = experiment(tmp_path, ARM, RUN)
    run = engine.run(found)
    theirs = FloatingPinocchio(bodies(found), (1.0, -2.0, -9.0), (0.0, 0.0))
    for i, t in enumerate(run.time):
        R, p, w, v, wd, a = motion(float(t))
        base = Flight(R, p, R.T @ w, R.T @ v)
        lower = _pose(theirs, base, run.signals["q"][0, i])
        wrenches = {"lower": ((0.0, 0.0, 0.0), tuple(lower.T @ (3.0, 2.0, 1.0)))}
        state = base, run.signals["q"][0, i], run.signals["qd"][0, i]
        _, tau = theirs.forces(*state, R.T @ wd, R.T @ a, run.signals["qdd"][0, i], wrenches)
        _, held = theirs.forces(*state, R.T @ wd, R.T @ a, (0.0, 0.0), wrenches)
        assert np.max(np.abs(tau)) < 2e-13 * np.max(np.abs(held)), f"{t} s"


@pytest.mark.release
def test_plain_numbers_and_every_lane_give_the_same(tmp_path: Path) -> None:
    sweep = """\
sweep some of shaken {
    zip { base.x.amplitude = [0, 10, 20] cm;  base.yaw.max_rate = [20, 40, 60] deg/s;  base.z.value = [0, 1, 2] m; }
}
"""
    found = experiment(tmp_path, ARM, changed(RUN, ("500 Hz", "100 Hz")), sweep, select=["some"])
    runs = [engine.run(found, threads=1, lanes=lanes) for lanes in (2, 8)]
    assert runs[0].cause == [""] * 3
    for name, values in runs[0].signals.items():
        assert runs[1].signals[name].tobytes() == values.tobytes(), name
    inputs = {coordinate.path: float(coordinate.values[1]) for coordinate in found.cases.coordinates}
    rows, _ = execute(build(found), inputs, found.structure.schedule.ticks)
    kernel = np.concatenate(
        [runs[0].signals[each.name][1].reshape(len(rows), -1) for each in found.structure.record], axis=1
    )
    assert np.abs(kernel - rows).max() < 1e-11 * np.abs(rows).max()
    np.testing.assert_allclose(runs[0].signals["links.base.position"][:, 0, 2], [0.0, 1.0, 2.0])


@pytest.mark.slow
def test_a_base_of_constants_is_a_fixed_one_that_stands_elsewhere(tmp_path: Path) -> None:
    elsewhere = "prescribed { x = 2 m; y = -1 m; yaw = 90 deg; }"
    still = RUN[RUN.index("prescribed {") : RUN.index("initial ")]
    off = ("gravity = [1, -2, -9]", "velocity_products = off; gravity = [1, -2, -9]")
    text = changed(RUN, (still, f"{elsewhere};\n    "), off)
    ground = changed(
        text,
        (f"base     = {elsewhere};", ""),
        ("gravity = [1, -2, -9]", "gravity = [-2, -1, -9]"),
        ("force = [3, 2, 1]", "force = [2, -3, 1]"),
    )
    one, other = (engine.run(experiment(tmp_path, ARM, each)).signals for each in (text, ground))
    for name in ("q", "qd", "qdd"):
        np.testing.assert_allclose(one[name], other[name], rtol=0, atol=1e-12)
    x, y, z = np.moveaxis(other["links.lower.velocity"], -1, 0)
    np.testing.assert_allclose(one["links.lower.velocity"], np.stack([-y, x, z], -1), rtol=0, atol=1e-12)
    assert (one["links.base.position"] == [2.0, -1.0, 0.0]).all()


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["modified_euler", "rk4"])
def test_a_run_upon_it_keeps_the_integrators_order(tmp_path: Path, integrator: str) -> None:
    smooth = changed(RUN, ("yaw   = trapezoid(to = 100 deg, max_rate = 61 deg/s, max_acceleration = 50 deg/s^2);", ""))

    def last(hz: int, name: str) -> np.ndarray:
        run = engine.run(experiment(tmp_path, ARM, changed(smooth, ("500 Hz", f"{hz} Hz"), ("rk4", name))))
        return np.concatenate([run.signals[each][0, -1] for each in ("q", "qd")])

    exact = last(2560, "rk4")
    rates = (80, 160) if integrator == "rk4" else (320, 640)
    errors = [np.max(np.abs(last(hz, integrator) - exact)) for hz in rates]
    found = np.log2(errors[0] / errors[1])
    print(f"{integrator}: order {found:.2f}")
    assert abs(found - (4 if integrator == "rk4" else 2)) < 0.25


def _pose(theirs: FloatingPinocchio, base: Flight, q: np.ndarray) -> np.ndarray:
    import pinocchio as pin

    pin.forwardKinematics(theirs.model, theirs.data, theirs.configuration(base, q))
    return np.array(theirs.data.oMi[theirs.model.getJointId("elbow")].rotation)
