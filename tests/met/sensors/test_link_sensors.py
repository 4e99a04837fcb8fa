"""Sensors of links in a run: what they feel, against Pinocchio and closed forms; filters, ticks, noise, bits."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from met import models
from met import run as engine
from met.backends.reference.plain import execute
from met.program import build
from met.run import Run
from tests.ic.small_decks import changed, experiment
from tests.met.program.free_flyers import ARM as FLYER
from tests.met.program.free_flyers import RUN as TUMBLING
from tests.met.program.payload_decks import RUN as GRAPPLING
from tests.met.program.test_prescribed_base import RUN as SHAKEN
from tests.met.program.test_prescribed_base import motion
from tests.met.sensors.felt import felt, known, recorded, triad
from tests.oracles.pinocchio_floating import Flight, FloatingPinocchio
from tests.oracles.plan_tree import bodies

POINT = (0.3, -0.2, 0.1)
GRAVITY = np.array([1.0, -2.0, -9.0])


def matrix(quaternion: np.ndarray) -> np.ndarray:
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


# What is felt


@pytest.mark.oracle
def test_on_a_free_arm_it_is_what_pinocchio_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Forward dynamics and kinematics are both Pinocchio's, gravity and a wrench in it; on a link and on the base."""
    known(monkeypatch)
    more = triad("lower", "lower", f"{list(POINT)} m") + triad("base", "base", f"{list(POINT)} m")
    text = changed(
        TUMBLING,
        (
            "environment {}",
            "environment { gravity = [1, -2, -9] m/s^2;  push = wrench { link = lower; "
            f"force = [3, 2, 1] N; axes = link; }} }}\n{more}",
        ),
        ("dynamics = 100 Hz; record = 10 Hz;", "dynamics = 100 Hz; servos = 100 Hz; record = 100 Hz;"),
        ("modified_euler", "semi_implicit_euler"),
        ("energy, momentum, J_eff, b", recorded("lower", "base")),
    )
    found = experiment(tmp_path, FLYER, text)
    run, theirs = engine.run(found), FloatingPinocchio([*bodies(found), base_body(found)], GRAVITY, (0.0, 0.0))
    ours = {name: felt(run, name) for name in ("lower", "base")}
    worst = 0.0
    for i in range(len(run.time) - 1):
        R = matrix(run.signals["links.base.orientation"][0, i])
        p, v, w = (run.signals[f"links.base.{name}"][0, i] for name in ("position", "velocity", "rate"))
        base = Flight(R, p, R.T @ w, R.T @ v)
        q, qd = run.signals["q"][0, i], run.signals["qd"][0, i]
        wd, a, qdd = theirs.accelerations(base, q, qd, np.zeros(2), {"lower": ((0.0, 0.0, 0.0), (3.0, 2.0, 1.0))})
        theirs.link_acceleration(base, q, qd, wd, a, qdd, "lower", POINT)
        for name in ours:
            b = theirs.link[name]
            axes = (theirs.data.oMi[theirs.joint_of[b]] * theirs.placed[b]).rotation
            expected = theirs.link_acceleration(base, q, qd, wd, a, qdd, name, POINT) - axes.T @ GRAVITY
            worst = max(worst, float(np.max(np.abs(ours[name][i] - expected))))
    print(f"largest difference {worst:.2g} m/s^2")
    # the state's own rounding, 1e-15 of some m/s, over a step of 10 ms
    assert worst < 1e-12, worst


@pytest.mark.oracle
def test_on_a_prescribed_base_its_acceleration_is_felt(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known(monkeypatch)
    more = triad("base", "base", "[0, 0, 0] m") + triad("lower", "lower", f"{list(POINT)} m")
    text = changed(
        SHAKEN,
        (
            "    rates    { dynamics = 500 Hz; record = 10 Hz; }",
            f"{more}    rates {{ dynamics = 100 Hz; servos = 100 Hz; record = 100 Hz; }}",
        ),
        ("integrator = rk4", "integrator = semi_implicit_euler"),
        ("tau_load,", f"{recorded('base', 'lower')},"),
    )
    found = experiment(tmp_path, FLYER, text)
    run, theirs = engine.run(found), FloatingPinocchio(bodies(found), GRAVITY, (0.0, 0.0))
    at_base, at_lower = felt(run, "base"), felt(run, "lower")
    for i in range(0, 200, 20):
        R, p, w, v, wd, a = motion(float(run.time[i]))
        np.testing.assert_allclose(at_base[i], R.T @ (a - GRAVITY), rtol=0, atol=1e-11)
        state = Flight(R, p, R.T @ w, R.T @ v), run.signals["q"][0, i], run.signals["qd"][0, i]
        expected = theirs.link_acceleration(*state, R.T @ wd, R.T @ a, run.signals["qdd"][0, i], "lower", POINT)
        axes = (theirs.data.oMi[theirs.joint_of[theirs.link["lower"]]]).rotation
        np.testing.assert_allclose(at_lower[i], expected - axes.T @ GRAVITY, rtol=0, atol=1e-11)


def base_body(found: object):  # type: ignore[no-untyped-def]
    """The base of the flyer as a body of Pinocchio's."""
    from met.dynamics.tree import Body

    return Body("base", "", "fixed", -1, mass=40.0, com=(0.1, 0.05, -0.1), inertia=(5.0, 7.0, 9.0, 0.3, -0.4, 0.5))


STILL = """\
arm swing {
    link bar { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base; child = bar; axis = y; }
}
servo held { model = locked; }
servo turn { model = ideal; command = acceleration(ACCELERATION); }
run it {
    arm = swing;  servos { hinge = SERVO; }
    initial { hinge.q = 30 deg;  hinge.qd = RATE; }
    environment { gravity = [0, 0, -9.81] m/s^2;  velocity_products = on; }
    SENSORS
    rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 1 kHz; }
    integrator = modified_euler;
    duration = 1 s;  record = [q, qd, qdd, sensors];
}
"""


def stood(
    folder: Path,
    sensors: str,
    *changes: tuple[str, str],
    servo: str = "held",
    rate: str = "0 rad/s",
    acceleration: str = "0 rad/s^2",
) -> Run:
    text = changed(STILL, ("SENSORS", sensors), ("SERVO", servo), ("RATE", rate), ("ACCELERATION", acceleration))
    return engine.run(experiment(folder, changed(text, *changes)))


def of(run: Run, name: str, case: int = 0) -> np.ndarray:
    return run.signals[f"sensors.{name}"][case].ravel()


def test_at_rest_it_reads_gravity_along_its_axis_from_the_first_tick_on(tmp_path: Path) -> None:
    run = stood(
        tmp_path,
        "\n".join(
            (
                "sensor up = accelerometer { link = bar; along = [0, 0, 3]; cutoff = 50 Hz; }",
                "sensor out = accelerometer { link = bar; along = [-1, 0, 0]; cutoff = 50 Hz; }",
                "sensor foot = accelerometer { link = base; along = [0, 0, 1]; cutoff = 50 Hz; }",
            )
        ),
    )
    # the hinge turns about y: z of the bar leans by 30 deg, and its x points down by as much
    for name, g in (("up", 9.81 * math.cos(math.pi / 6)), ("out", 9.81 * 0.5), ("foot", 9.81)):
        np.testing.assert_allclose(of(run, name), g, rtol=1e-13)


@pytest.mark.slow
def test_in_free_fall_it_reads_nothing_on_any_body(tmp_path: Path) -> None:
    """A free base, its arm at rest on it, and a payload that flies beside."""
    still = [
        ("= 0.5 rad/s", "= 0 rad/s"),
        ("= -1 rad/s", "= 0 rad/s"),
        ("[40, 20, -60]", "[0, 0, 0]"),
        ("rate     = [-30, 20, 45]", "rate     = [0, 0, 0]"),
        ("grapple  = 0.8 s;\n", "grapple = 5 s;\n"),
        ("        release  = 1.5 s;\n", ""),
        (
            "environment {}",
            "environment { gravity = [1, -2, -9] m/s^2; }\n"
            + "".join(
                f"sensor {link} = accelerometer {{ link = {link}; at = [0.3, 0.2, 0.1] m; along = [1, 2, 3]; "
                "cutoff = 5 Hz; }\n"
                for link in ("base", "lower", "box")
            ),
        ),
        ("record = 10 Hz", "servos = 50 Hz; record = 10 Hz"),
        ("energy,", "sensors, energy,"),
    ]
    run = engine.run(experiment(tmp_path, FLYER, changed(GRAPPLING, *still)))
    for link in ("base", "lower", "box"):
        assert np.max(np.abs(of(run, link))) < 1e-12, link


def test_turning_it_feels_what_holds_it_in_its_circle(tmp_path: Path) -> None:
    """alpha r along the way and -w^2 r outwards, beside gravity, whose share turns with the link."""
    run = stood(
        tmp_path,
        "sensor way = accelerometer { link = bar; at = [0.8, 0, 0] m; along = [0, 0, 1]; cutoff = 40 Hz; }\n"
        "sensor out = accelerometer { link = bar; at = [80, 0, 0] cm; along = [1, 0, 0]; cutoff = 40 Hz; }",
        ("[0, 0, -9.81]", "[0, 0, 0]"),
        servo="turn",
        rate="3 rad/s",
        acceleration="2 rad/s^2",
    )
    late = run.time > 0.5
    # H = 1 - sqrt(2) s/w_c + s^2/w_c^2 + ..., as of a delay of sqrt(2)/w_c: a parabola is late by that
    lag = math.sqrt(2.0) / (2.0 * math.pi * 40.0)
    # z of the bar goes down as the hinge turns forward about y
    np.testing.assert_allclose(of(run, "way")[late], -2.0 * 0.8, rtol=1e-9)
    expected = -((3.0 + 2.0 * (run.time - lag)) ** 2) * 0.8
    np.testing.assert_allclose(of(run, "out")[late], expected[late], rtol=1e-5)


# Filters and ticks


@pytest.mark.slow
@pytest.mark.parametrize(("cutoff", "hz"), [(20.0, 8.0), (20.0, 20.0), (50.0, 12.0)])
def test_the_filter_answers_as_its_transfer_function_does(cutoff: float, hz: float, tmp_path: Path) -> None:
    w = 2.0 * math.pi * hz
    run = stood(
        tmp_path,
        f"sensor way = accelerometer {{ link = bar; at = [0, 0, 1] m; along = [1, 0, 0]; cutoff = {cutoff} Hz; }}",
        ("[0, 0, -9.81]", "[0, 0, 0]"),
        ("dynamics = 1 kHz;  servos = 1 kHz", "dynamics = 4 kHz;  servos = 4 kHz"),
        servo="turn",
        rate=f"{-5.0 / w} rad/s",
        acceleration=f"sine(amplitude = 5 rad/s^2, frequency = {hz} Hz)",
    )
    s = 2j * math.pi * hz / (2.0 * math.pi * cutoff)
    H = 1.0 / (1.0 + math.sqrt(2.0) * s + s * s)
    late = run.time > 0.6  # the filter's own motion has died away by exp(-0.6 * 89)
    expected = 5.0 * (H * np.exp(1j * w * run.time)).imag
    # the command is held for a tick of 0.25 ms, half of it late: w h/2; the filter's own error is (h w_c)^2/6
    close = 5.0 * (w / 8000.0 + (2.0 * math.pi * cutoff / 4000.0) ** 2)
    np.testing.assert_allclose(of(run, "way")[late], expected[late], rtol=0, atol=close)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", models.find_own("integrator"))
def test_a_reading_is_of_the_integrators_order(integrator: str, tmp_path: Path) -> None:
    order = models.find("integrator", integrator).order
    sensors = (
        "sensor tip = accelerometer { link = lower; at = [1, 0.1, 0.2] m; along = [1, 2, 3]; cutoff = 2 Hz; "
        "rate = 10 Hz; }\nsensor spin = gyroscope { link = lower; along = [1, 1, 0]; filter = butterworth; "
        "cutoff = 3 Hz; rate = 10 Hz; }\n"
    )

    def last(hz: int, integrator: str) -> np.ndarray:
        text = changed(
            TUMBLING,
            ("environment {}", f"environment {{}}\n{sensors}"),
            ("momentum,", "sensors,"),
            ("dynamics = 100 Hz", f"dynamics = {hz} Hz"),
            ("modified_euler", integrator),
        )
        run = engine.run(experiment(tmp_path, FLYER, text))
        return np.array([of(run, name)[-1] for name in ("tip", "spin")])

    exact = last(2560, "rk4")
    rates = (80, 160) if order == 4 else (320, 640)
    errors = [np.max(np.abs(last(hz, integrator) - exact)) for hz in rates]
    found = math.log2(errors[0] / errors[1])
    print(f"{integrator}: order {found:.2f}, errors {errors}")
    assert abs(found - order) < 0.2  # the error's next term is a step's share of the first


def test_a_gyroscope_reads_the_rate_that_is(tmp_path: Path) -> None:
    """cos of the angle to the axis, times the rate; exactly where there is no filter."""
    run = stood(
        tmp_path,
        "sensor about = gyroscope { link = bar; along = [3, 4, 0]; }\n"
        "sensor off = gyroscope { link = bar; along = [0, 2, 0]; scale = 1.5; bias = 1 deg/s; }\n"
        "sensor none = gyroscope { link = base; along = [0, 1, 0]; }",
        servo="turn",
        rate="3 rad/s",
        acceleration="2 rad/s^2",
    )
    qd = run.signals["qd"][0].ravel()
    np.testing.assert_allclose(of(run, "about"), 0.8 * qd, rtol=1e-14)
    np.testing.assert_allclose(of(run, "off"), 1.5 * qd + math.radians(1.0), rtol=1e-14)
    assert (of(run, "none") == 0.0).all()


def test_a_reading_has_bias_scale_steps_and_delay_at_its_own_rate(tmp_path: Path) -> None:
    sensors = (
        "sensor true = gyroscope { link = bar; along = [0, 1, 0]; rate = 200 Hz; }\n"
        "sensor read = gyroscope { link = bar; along = [0, 1, 0]; rate = 200 Hz; scale = 1.1; "
        "bias = 0.05 rad/s; resolution = 0.01 rad/s; delay = 2; }"
    )
    run = stood(tmp_path, sensors, servo="turn", rate="3 rad/s", acceleration="2 rad/s^2")
    true, read = of(run, "true"), of(run, "read")
    assert (true.reshape(-1)[:1000].reshape(200, 5) == true[:1000:5, None]).all(), "held between ticks"
    digital = 0.01 * np.rint((1.1 * true[::5] + 0.05) / 0.01)
    assert (read[10::5] == digital[:-2]).all()
    assert (read[:10:5] == digital[0]).all()


@pytest.mark.slow
def test_noise_is_its_size_white_and_the_same_wherever_else_cases_differ(tmp_path: Path) -> None:
    sensors = (
        "sensor a = gyroscope { link = bar; along = [0, 1, 0]; noise = 0.05 rad/s; }\n"
        "sensor b = gyroscope { link = bar; along = [0, 1, 0]; noise = 0.05 rad/s; }\n"
        "sensor true = gyroscope { link = bar; along = [0, 1, 0]; }"
    )
    text = changed(STILL, ("SENSORS", sensors), ("SERVO", "held"), ("RATE", "0 rad/s"), ("ACCELERATION", "0 rad/s^2"))
    sweep = "sweep cases of it { vary links.bar.mass = [1, 2] kg; repeat 2; }\n"
    found = experiment(tmp_path, text, sweep, select=["cases"])
    run = engine.run(found)
    noise = np.array([[of(run, name, case) for case in range(4)] for name in "ab"])
    n = noise.shape[-1]
    order = np.lexsort((np.asarray(found.cases.coordinates[0].values), np.asarray(found.cases.repeats)))
    same = noise[:, order]
    assert (same[:, 0] == same[:, 1]).all() and (same[:, 2] == same[:, 3]).all()
    # of n draws: mean within 4/sqrt(n), size within 4/sqrt(2 n), neighbours, sensors and repeats uncorrelated
    first = same[0, 0]
    assert abs(first.mean()) < 4 * 0.05 / np.sqrt(n) and abs(first.std() / 0.05 - 1.0) < 4 / np.sqrt(2 * n)
    for one, other in ((first[1:], first[:-1]), (first, same[1, 0]), (first, same[0, 2])):
        assert abs(np.corrcoef(one, other)[0, 1]) < 4 / np.sqrt(n)


# What else is in the run


@pytest.mark.slow
def test_a_sensor_changes_nothing_else(tmp_path: Path) -> None:
    sensors = "sensor tip = accelerometer { link = lower; along = [1, 2, 3]; cutoff = 2 Hz; rate = 10 Hz; }\n"
    bare = engine.run(experiment(tmp_path, FLYER, TUMBLING))
    text = changed(TUMBLING, ("environment {}", f"environment {{}}\n{sensors}"))
    found = engine.run(experiment(tmp_path, FLYER, text))
    for name, values in bare.signals.items():
        assert found.signals[name].tobytes() == values.tobytes(), name


@pytest.mark.slow
def test_a_grapple_is_no_acceleration_and_a_payload_has_sensors_wherever_it_is(tmp_path: Path) -> None:
    """Carried, it goes with its link; flying, freely. Rates jump as it is grappled: a gyroscope shows it at once."""
    sensors = "".join(
        f"sensor {kind}_{name} = {kind} {{ link = {name}; along = [0, 0, 1]; "
        f"{'cutoff = 10 Hz; ' * (kind == 'accelerometer')} }}\n"
        for kind in ("accelerometer", "gyroscope")
        for name in ("box", "lower")
    )
    text = changed(
        GRAPPLING,
        ("environment {}", "environment {}\n" + sensors),
        ("energy,", "sensors, energy,"),
        ("dynamics = 100 Hz; record = 10 Hz", "dynamics = 200 Hz; servos = 200 Hz; record = 200 Hz"),
    )
    run = engine.run(experiment(tmp_path, FLYER, text))
    carried = run.signals["payloads.box.carried"][0].ravel() == 1.0
    assert carried.any() and not carried[0] and not carried[-1]
    box, rate = run.signals["payloads.box.orientation"][0], run.signals["payloads.box.rate"][0]
    z = np.array([matrix(q)[:, 2] for q in box])
    np.testing.assert_allclose(of(run, "gyroscope_box"), np.einsum("ij,ij->i", z, rate), rtol=0, atol=1e-13)
    # in flight nothing pushes it, and its frame is off its centre by the arm of 0.11 m: a centripetal share alone
    com = np.array([0.1, -0.05, 0.02])
    first = np.flatnonzero(carried)[0]
    w = np.array([matrix(q).T @ r for q, r in zip(box[:first], rate[:first], strict=True)])
    I = np.array([[0.8, 0.02, -0.03], [0.02, 0.9, 0.05], [-0.03, 0.05, 1.1]])  # noqa: E741
    wd = np.array([np.linalg.solve(I, -np.cross(x, I @ x)) for x in w])
    expected = -(np.cross(wd, com) + np.cross(w, np.cross(w, com)))[:, 2]
    late = slice(int(0.4 * 200), first)  # the filter is late by 20 ms of what changes by some 0.1 m/s^3
    assert np.max(np.abs(of(run, "accelerometer_box")[late] - expected[late])) < 0.02 * np.max(np.abs(expected)) + 5e-3
    # the jump of rates at 0.8 s lasts no time: the filtered force stays of the size of what follows
    assert np.isfinite(of(run, "accelerometer_lower")).all()
    assert np.max(np.abs(of(run, "accelerometer_lower"))) < 50.0


ORBIT = """\
arm station {
    link base { mass = 1000 kg; inertia = [800, 900, 1000] kg*m^2; }
    link boom { mass = 1e-6 kg; shape = sphere(radius = 1 cm); }
    joint out fixed { parent = base; child = boom; at = [20, 0, 0] m; }
    link arm { mass = 1e-6 kg; shape = sphere(radius = 1 cm); }
    joint turn revolute { parent = base; child = arm; axis = z; }
}
servo held { model = locked; }
run it {
    arm = station;  servos { turn = held; }
    base = free;
    initial { base.position = [3, 4, 5] m;  base.velocity = [0.01, -0.02, 0.03] m/s;  base.rate = RATE; }
    environment { tide = gravity_gradient { radius = 6778 km; frame = FRAME; } }
    sensor mid   = accelerometer { link = base; along = [1, 0, 0]; cutoff = 1 Hz; rate = 10 Hz; }
    sensor tidal = accelerometer { link = boom; along = [1, 0, 0]; cutoff = 1 Hz; rate = 10 Hz; }
    sensor turn  = gyroscope { link = base; along = [0, 0, 1]; rate = 10 Hz; }
    rates { dynamics = 100 Hz;  servos = 10 Hz;  record = 10 Hz; }
    duration = 3 s;  record = [sensors, links.base.rate];
}
"""
N = math.sqrt(3.986004418e14 / 6.778e6**3)


@pytest.mark.slow
@pytest.mark.parametrize("frame", ["inertial", "orbital"])
def test_in_orbit_it_feels_the_tide_away_from_the_centre_and_nothing_at_it(frame: str, tmp_path: Path) -> None:
    """Held against the Earth, 20 m above the centre of mass: -3 n^2 20 m, a third of it from the orbit's turning.

    Told twice: in a world that keeps its directions the station turns with n; in one that turns with the orbit it
    stands still. A gyroscope reads n either way.
    """
    rate = f"[0, 0, {N!r}] rad/s" if frame == "inertial" else "[0, 0, 0] rad/s"
    run = engine.run(experiment(tmp_path, changed(ORBIT, ("RATE", rate), ("FRAME", frame))))
    # the torque of the gradient on it is some 1e-4 N m, hence 1e-7 rad/s^2 of 20 m; the beginning is settled
    assert np.max(np.abs(of(run, "mid"))) < 1e-9
    np.testing.assert_allclose(of(run, "tidal"), -3.0 * N * N * 20.0, rtol=2e-2)
    np.testing.assert_allclose(of(run, "turn"), N, rtol=1e-3)


@pytest.mark.slow
def test_both_frames_of_the_gradient_feel_the_same(tmp_path: Path) -> None:
    """One motion in a world that keeps its directions, and in one that turns: specific force knows no frame."""
    w, v, p = np.array([0.0, 0.0, N]), np.array([0.01, -0.02, 0.03]), np.array([3.0, 4.0, 5.0])
    fixed = changed(
        ORBIT,
        ("FRAME", "inertial"),
        ("RATE", f"[0.2, -0.1, {0.3 + N!r}] rad/s"),
        ("[0.01, -0.02, 0.03]", str((v + np.cross(w, p)).tolist())),
    )
    turning = changed(ORBIT, ("FRAME", "orbital"), ("RATE", "[0.2, -0.1, 0.3] rad/s"))
    a, b = (engine.run(experiment(tmp_path, text)) for text in (fixed, turning))
    for name, size in (("mid", 1e-9), ("tidal", 2e-9), ("turn", 1e-8)):
        # Heun's error at 100 Hz: (h w)^3 a step of some 0.4 rad/s
        np.testing.assert_allclose(of(a, name), of(b, name), rtol=1e-6, atol=size, err_msg=name)


@pytest.mark.release
def test_plain_numbers_lanes_and_threads_give_the_same(tmp_path: Path) -> None:
    sensors = (
        "sensor tip = accelerometer { link = lower; at = [1, 0, 0] m; along = [1, 2, 3]; cutoff = 5 Hz; "
        "noise = 0.1 m/s^2; resolution = 1e-3 m/s^2; delay = 1; }\n"
        "sensor box = accelerometer { link = box; along = [1, 0, 0]; cutoff = 5 Hz; }\n"
        "sensor spin = gyroscope { link = base; along = [1, 0, 1]; noise = 1 deg/s; }\n"
    )
    text = changed(
        GRAPPLING,
        ("environment {}", "environment { gravity = [1, -2, -9] m/s^2; }\n" + sensors),
        ("energy,", "sensors, energy,"),
        ("record = 10 Hz", "servos = 50 Hz; record = 10 Hz"),
    )
    sweep = """\
sweep some of tumbling {
    zip {
        sensors.tip.at.x = [0, 1, 2] m;  sensors.tip.along.y = [1, 2, 3];  sensors.tip.cutoff = [3, 4, 5] Hz;
        sensors.tip.noise = [0, 0.1, 0.2] m/s^2;  sensors.spin.bias = [0, 1, 2] deg/s;
        links.lower.mass = [4, 5, 6] kg;  sensors.box.scale = [1, 1.1, 1.2];
    }
    repeat 3;
}
"""
    found = experiment(tmp_path, FLYER, text, sweep, select=["some"])
    runs = [engine.run(found, threads=threads, lanes=lanes) for threads, lanes in ((1, 2), (2, 8))]
    assert runs[0].cause == [""] * 9
    for name, values in runs[0].signals.items():
        assert runs[1].signals[name].tobytes() == values.tobytes(), name
    inputs = {coordinate.path: float(coordinate.values[4]) for coordinate in found.cases.coordinates}
    own = {"noise:repeat": float(np.asarray(found.cases.repeats)[4])}
    rows, _ = execute(build(found), {**inputs, **own}, found.structure.schedule.ticks)
    kernel = np.concatenate(
        [runs[0].signals[each.name][4].reshape(len(rows), -1) for each in found.structure.record], axis=1
    )
    # a rounding may turn one reading's step of 1e-3
    np.testing.assert_allclose(rows, kernel, rtol=1e-9, atol=2e-3)


def test_a_filter_that_comes_to_no_number_ends_its_case_and_says_so(tmp_path: Path) -> None:
    sensors = "sensor way = accelerometer { link = bar; along = [1, 0, 0]; cutoff = 100 Hz; }"
    text = changed(STILL, ("SENSORS", sensors), ("SERVO", "turn"), ("RATE", "3 rad/s"), ("ACCELERATION", "0 rad/s^2"))
    sweep = "sweep cases of it { vary sensors.way.at.x = [1, 1e308] m; }\n"
    run = engine.run(experiment(tmp_path, text, sweep, select=["cases"]))
    place = f"{tmp_path}/deck.ic:11"
    assert run.cause == [
        "",
        (
            f"t = 0 s: sensor way: its filter is no longer a finite number ({place}). Usual reasons: a step too long "
            "for its `cutoff` (try a faster rate for the dynamics), or numbers that no double holds."
        ),
    ]


STICKING = """\
arm sled {
    link cart { mass = 2 kg; shape = sphere(radius = 0.1 m); }
    link bar  { mass = 1 kg; shape = rod(length = 0.5 m, along = x); }
    joint slide prismatic { parent = base;  child = cart;  axis = x; }
    joint swing revolute  { parent = cart;  child = bar;   axis = z; }
}
servo rough { model = passive;  friction = 4 N; }
servo held  { model = locked; }
run it {
    arm = sled;  servos { slide = rough;  swing = held; }
    initial { slide.qd = 1 m/s; }
    environment { gravity = [0, 0, -9.81] m/s^2; }
    sensor way = accelerometer { link = bar; along = [1, 0, 0]; cutoff = 4 Hz; rate = 10 Hz; }
    rates { dynamics = 100 Hz; record = 10 Hz; }
    duration = 2 s;  record = [q, qd, sensors];
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("hz", [90, 170])
def test_what_sticks_stops_being_felt_where_it_does(hz: int, tmp_path: Path) -> None:
    """3 kg against 4 N for 0.75 s, between steps: a filter's answer to a rectangle, and nothing creeps after."""
    run = engine.run(experiment(tmp_path, changed(STICKING, ("dynamics = 100", f"dynamics = {hz * 10}"))))
    w, stops = 2.0 * math.pi * 4.0, 0.75
    a = w / math.sqrt(2.0)

    def step(t: np.ndarray) -> np.ndarray:
        t = np.maximum(t, 0.0)
        return 1.0 - np.exp(-a * t) * (np.cos(a * t) + np.sin(a * t))

    expected = -4.0 / 3.0 * (step(run.time) - step(run.time - stops))
    # Heun's own error, (h w)^2 of some 1 m/s^2, and that of a step that is cut where it sticks
    np.testing.assert_allclose(of(run, "way"), expected, rtol=0, atol=2.0 * (w / (10 * hz)) ** 2)
    assert run.signals["qd"][0, -1, 0] == 0.0 and run.events["splits"].tolist() == [1]


def test_it_feels_the_motion_that_is_whatever_the_dynamics_leave_out(tmp_path: Path) -> None:
    """Without velocity products the joint needs no force for its circle; the point goes it all the same."""
    sensors = "sensor out = accelerometer { link = bar; at = [2, 0, 0] m; along = [1, 0, 0]; cutoff = 40 Hz; }"
    run = stood(
        tmp_path,
        sensors,
        ("[0, 0, -9.81]", "[0, 0, 0]"),
        ("products = on", "products = off"),
        servo="turn",
        rate="3 rad/s",
    )
    np.testing.assert_allclose(of(run, "out"), -18.0, rtol=1e-12)


@pytest.mark.slow
def test_with_a_motor_on_a_bed_it_feels_the_acceleration_that_the_bed_gives(tmp_path: Path) -> None:
    servo = """\
servo motor { model = rigid_gearbox; ratio = 100; kp = 0.1 V*s/rad; ki = 1 V/rad; v_max = 24 V; resistance = 1 ohm;
    kt = 0.05 N*m/A; tau_max = 1 N*m; j_m = 1e-4 kg*m^2; command = rate(0.5 rad/s); }
"""
    sensors = (
        "sensor way = accelerometer { link = bar; at = [1, 0, 0] m; along = [0, 0, 1]; cutoff = 50 Hz; }\n"
        "substitute hinge { bed = emulated; }"
    )
    text = changed(
        STILL,
        ("SENSORS", sensors),
        ("SERVO", "motor"),
        ("RATE", "0 rad/s"),
        ("ACCELERATION", "0 rad/s^2"),
        ("[0, 0, -9.81]", "[0, 0, 0]"),
        ("sensors]", "sensors, sensors.way.filtered]"),
    )
    run = engine.run(experiment(tmp_path, servo + text))
    assert run.cause == [""]
    qdd, x = run.signals["qdd"][0].ravel(), of(run, "way")
    # the same filter over -qdd of 1 m, held from instant to instant, by exact steps of its own
    w, h = 2.0 * math.pi * 50.0, 1e-3
    A = np.array([[0.0, 1.0], [-w * w, -math.sqrt(2.0) * w]])
    values, vectors = np.linalg.eig(A)
    E = (vectors @ np.diag(np.exp(values * h)) @ np.linalg.inv(vectors)).real
    G = np.linalg.solve(A, (E - np.eye(2)) @ np.array([0.0, w * w]))
    y, expected = np.zeros(2), []
    for a in -qdd:
        expected.append(y[0])
        y = E @ y + G * a
    assert np.max(np.abs(qdd)) > 1.0
    # what changes within a step is not in it: h/2 of the filtered slope
    np.testing.assert_allclose(x, expected, rtol=0, atol=0.05 * np.max(np.abs(expected)))
