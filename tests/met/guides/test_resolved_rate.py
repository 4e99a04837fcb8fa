"""Resolved rates: the law against numpy's damped least squares on Pinocchio's kinematics, and what must hold of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from tests.ic.small_decks import experiment
from tests.met.guides.chains import HZ, PATH, Oracle, chain, least_squares, path, wanted
from tests.oracles.package import Package

pin = Package("pinocchio")

LAW = f"{path()} max_damping = 0.4 m; threshold = 0.6 m; gain = 3 1/s; length = 0.7 m;"
LENGTH, GAIN, DAMPING, THRESHOLD = 0.7, 3.0, 0.4, 0.6


def law(
    oracle: Oracle,
    q: np.ndarray,
    t: float,
    begun: tuple[np.ndarray, np.ndarray],
    rows: list[int],
    shown: float,
    slides: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The rates that the law gives at q, the path's error and J; shown: lambda."""
    R, p, J = oracle.at(q)
    far, turn, v, w = wanted(t, tuple(name for i, name in enumerate(PATH) if i in rows))
    error = np.concatenate([begun[1] + far - p, pin.log3(turn @ begun[0] @ R.T)])
    scale = np.array([1.0] * 3 + [LENGTH] * 3)[rows]
    task = scale * (np.concatenate([v, w]) + GAIN * error)[rows]
    units = np.ones(len(q))
    if slides >= 0:
        units[slides] = LENGTH
    scaled = scale[:, None] * J[rows] * units
    return units * least_squares(scaled, shown, task), error, scaled


@pytest.mark.release
@pytest.mark.oracle
@pytest.mark.parametrize(
    ("guides", "rows"),
    [
        ("pose", [0, 1, 2, 3, 4, 5]),
        ("position", [0, 1, 2]),
        ("xy", [0, 1]),
        ("xz", [0, 2]),
        ("yz", [1, 2]),
    ],
)
@pytest.mark.parametrize(("count", "sliding"), [(6, -1), (7, -1), (7, 2)])
def test_every_tick_is_the_damped_least_squares(
    guides: str, rows: list[int], count: int, sliding: int, tmp_path: Path
) -> None:
    names = tuple(name for i, name in enumerate(PATH) if i in rows)
    text = LAW.replace(path(), path(names)) + f" guides = {guides};"
    plan = experiment(tmp_path, chain(10 * count + sliding, count, text, sliding=sliding))
    run, oracle = engine.run(plan), Oracle(plan)
    begun = oracle.at(run.signals["q"][0, 0])[:2]
    damped = 0
    for i, t in enumerate(run.time):
        q, found = run.signals["q"][0, i], {name: values[0, i] for name, values in run.signals.items()}
        rates, error, J = law(oracle, q, t, begun, rows, found["guides.tip.damping"], sliding)
        np.testing.assert_allclose(found["servo.command"], rates, rtol=0, atol=1e-9 * (1.0 + np.abs(rates).max()))
        linear = [row for row in rows if row < 3]
        assert found["guides.tip.error"] == pytest.approx(np.linalg.norm(error[linear]), abs=1e-12)
        turned = np.linalg.norm(error[3:]) if guides == "pose" else 0.0
        assert found["guides.tip.turn_error"] == pytest.approx(turned, abs=1e-12)
        sigma, exact = found["guides.tip.manipulability"], np.linalg.svd(J, compute_uv=False)[-1]
        assert 0.93 * exact - 1e-5 < sigma < exact * (1.0 + 1e-6) + 1e-9
        grown = DAMPING * np.sqrt(max(1.0 - (sigma / THRESHOLD) ** 2, 0.0))
        assert found["guides.tip.damping"] == pytest.approx(grown, abs=1e-12)
        assert found["guides.tip.share"] == 1.0
        damped += grown > 0.0
    assert damped > 0 or guides != "pose"


@pytest.mark.oracle
def test_without_damping_the_path_is_kept(tmp_path: Path) -> None:
    text = f"{path()} max_damping = 0 m; threshold = 0 m; gain = 3 1/s;"
    plan = experiment(tmp_path, chain(3, 7, text))
    run, oracle = engine.run(plan), Oracle(plan)
    for i, t in enumerate(run.time):
        R, p, J = oracle.at(run.signals["q"][0, i])
        begun = oracle.at(run.signals["q"][0, 0])
        far, turn, v, w = wanted(t)
        error = np.concatenate([begun[1] + far - p, pin.log3(turn @ begun[0] @ R.T)])
        expected = np.linalg.pinv(J) @ (np.concatenate([v, w]) + 3.0 * error)
        np.testing.assert_allclose(run.signals["servo.command"][0, i], expected, rtol=0, atol=1e-9)
        assert run.signals["guides.tip.damping"][0, i] == 0.0


@pytest.mark.slow
def test_limits_shorten_the_rates_and_keep_their_direction(tmp_path: Path) -> None:
    bound = "max_rate = 0.08 rad/s; j3.max_rate = 0.03 rad/s;"
    free, held = (engine.run(experiment(tmp_path, chain(5, 7, f"{LAW} {more}"))) for more in ("", bound))
    first, asked = free.signals["servo.command"][0, 0], held.signals["servo.command"][0]
    limits = np.array([0.08] * 7)
    limits[3] = 0.03
    share = held.signals["guides.tip.share"][0]
    assert share[0] == pytest.approx(1.0 / (np.abs(first) / limits).max(), rel=1e-12)
    np.testing.assert_allclose(asked[0], share[0] * first, rtol=1e-12)
    reached = (np.abs(asked) / limits).max(axis=1)
    assert reached.max() <= 1.0 + 1e-15
    np.testing.assert_allclose(reached[share < 1.0], 1.0, rtol=1e-14)
    assert (share < 1.0).sum() > 40


@pytest.mark.oracle
def test_a_position_command_is_the_integral_of_the_rates(tmp_path: Path) -> None:
    # The ideal servo follows a position with its slope, so commands and joints go together up to its lag.
    plan = experiment(tmp_path, chain(5, 7, f"{LAW} loop = open;", command="position"))
    run = engine.run(plan)
    asked, oracle = run.signals["servo.command"][0], Oracle(plan)
    begun = oracle.at(run.signals["q"][0, 0])[:2]
    np.testing.assert_array_equal(asked[0], run.signals["q"][0, 0])
    for i, t in enumerate(run.time[:-1]):
        rates, _, _ = law(oracle, asked[i], t, begun, list(range(6)), run.signals["guides.tip.damping"][0, i], -1)
        np.testing.assert_allclose(asked[i + 1] - asked[i], rates / HZ, rtol=0, atol=1e-12)


@pytest.mark.oracle
def test_an_open_loop_goes_by_its_commands_and_shows_where_the_arm_is(tmp_path: Path) -> None:
    text = chain(5, 7, f"{LAW} loop = open;", command="position", bandwidth=3.0)
    plan = experiment(tmp_path, text)
    run, oracle = engine.run(plan), Oracle(plan)
    begun = oracle.at(run.signals["q"][0, 0])[:2]
    far, _, _, _ = wanted(float(run.time[-1]))
    _, p, _ = oracle.at(run.signals["q"][0, -1])
    shown = run.signals["guides.tip.error"][0, -1]
    assert shown == pytest.approx(np.linalg.norm(begun[1] + far - p), abs=1e-12)


@pytest.mark.release
@pytest.mark.oracle
def test_the_path_is_kept_better_in_proportion_to_the_period(tmp_path: Path) -> None:
    # Open loop with a position command: the law's own error, no servo's. Euler's steps of the path's rate, so order 1.
    errors = []
    for hz in (50, 100, 200, 400):
        rates = f"dynamics = 400 Hz; servos = {hz} Hz; record = 50 Hz;"
        text = f"{path()} max_damping = 0 m; threshold = 0 m; gain = 2 1/s; loop = open;"
        plan = experiment(tmp_path, chain(3, 7, text, command="position", rates=rates, duration="1 s"))
        run, oracle = engine.run(plan), Oracle(plan)
        begun = oracle.at(run.signals["q"][0, 0])[:2]
        far, turn, _, _ = wanted(1.0)
        R, p, _ = oracle.at(run.signals["servo.command"][0, -1])
        errors.append([np.linalg.norm(begun[1] + far - p), np.linalg.norm(pin.log3(turn @ begun[0] @ R.T))])
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    np.testing.assert_allclose(orders, 1.0, atol=0.1)


@pytest.mark.slow
def test_between_its_ticks_a_position_goes_on_with_the_rate(tmp_path: Path) -> None:
    rates = "dynamics = 200 Hz; servos = 200 Hz; record = 200 Hz;"
    text = chain(5, 7, f"{LAW} loop = open; rate = 50 Hz;", command="position", rates=rates)
    asked = engine.run(experiment(tmp_path, text)).signals["servo.command"][0]
    steps = np.diff(asked, axis=0).reshape(-1, 4, 7)
    np.testing.assert_allclose(steps, np.broadcast_to(steps[:, :1], steps.shape), rtol=0, atol=1e-14)


@pytest.mark.release
def test_a_continuous_servo_follows_between_the_ticks(tmp_path: Path) -> None:
    ends = []
    for servos in ("2 kHz", "continuous"):
        rates = f"dynamics = 2 kHz; servos = {servos}; record = 100 Hz;"
        plan = experiment(tmp_path, chain(5, 7, f"{LAW} rate = 100 Hz;", command="position", rates=rates))
        ends.append(engine.run(plan).signals["q"][0])
    # a command that is held for half a millisecond lags by a quarter of one on the mean, at rates below 1 rad/s
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=3e-4)
    assert np.ptp(ends[0], axis=0).max() > 0.1


@pytest.mark.release
def test_a_base_that_is_moved_is_made_up_for(tmp_path: Path) -> None:
    # It begins at rest, as the joints do: else these lag behind it from the first step on.
    base = "base = prescribed { x = sine(amplitude = 5 cm, frequency = 0.7 Hz, phase = 90 deg);"
    base += " yaw = sine(amplitude = 0.1 rad, frequency = 0.5 Hz, phase = 90 deg); }"
    errors = []
    for hz in (200, 400, 800):
        # without a gain only what the base does is told to the joints; a stiff servo, so that the period's is left
        text = chain(
            3,
            7,
            "max_damping = 0 m; threshold = 0 m; gain = 0 1/s;",
            base=base,
            command="position",
            bandwidth=300.0,
            rates=f"dynamics = 1600 Hz; servos = {hz} Hz; record = 50 Hz;",
        )
        run = engine.run(experiment(tmp_path, text))
        errors.append(run.signals["guides.tip.error"][0].max())
        assert np.ptp(run.signals["q"][0], axis=0).max() > 0.05
    assert errors[0] < 3e-3
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 1.0, atol=0.15)


FLYING = "base = free;"
TUMBLING = "base.velocity = [0.02, -0.01, 0.03] m/s; base.rate = [3, -2, 4] deg/s;"


@pytest.mark.release
@pytest.mark.parametrize("initial", ["", TUMBLING])
def test_the_generalized_jacobian_knows_what_a_free_base_does(initial: str, tmp_path: Path) -> None:
    text = f"{path()} max_damping = 0 m; threshold = 0 m; gain = 3 1/s; jacobian = "
    link = "    link base { mass = 30 kg; com = [0.1, 0, -0.2] m; inertia = [3, 4, 5, 0.1, 0.2, -0.3] kg*m^2; }\n"
    errors = {}
    for jacobian in ("arm", "generalized"):
        deck = chain(
            3,
            7,
            f"{text}{jacobian};",
            base=FLYING,
            initial=initial,
            bandwidth=400.0,
            duration="1 s",
            rates="dynamics = 2 kHz; servos = 200 Hz; record = 100 Hz;",
        )
        run = engine.run(experiment(tmp_path, deck.replace("arm chain {\n", "arm chain {\n" + link)))
        errors[jacobian] = run.signals["guides.tip.error"][0].max()
    # what is left is the first instants', in which the joints come to their rates, and the period's
    assert errors["generalized"] < 2e-3
    assert errors["arm"] > 5 * errors["generalized"]


@pytest.mark.release
def test_the_generalized_jacobian_knows_the_payloads_that_are_held_for_a_time(tmp_path: Path) -> None:
    """Held for good, released as the run ends, grappled as it begins: one motion, and so one course of the error."""
    text = f"{path()} max_damping = 0 m; threshold = 0 m; gain = 3 1/s; jacobian = generalized;"
    body = "payload box { mass = 15 kg; shape = sphere(radius = 0.2 m); on = link6; at = [0.1, -0.2, 0.05] m;"
    deck = (
        chain(3, 7, text, base=FLYING, bandwidth=400.0, rates="dynamics = 2 kHz; servos = 200 Hz; record = 100 Hz;")
        .replace("arm chain {\n", "arm chain {\n    link base { mass = 30 kg; inertia = [3, 4, 5] kg*m^2; }\n")
        .replace("record = [", "record = [payloads.box.position, ")
    )

    def carried(more: str) -> engine.Run:
        return engine.run(experiment(tmp_path, deck.replace("    guide tip", f"    {body} {more} }}\n    guide tip")))

    wanted, released = carried(""), carried("release = 0.5 s;")
    at = ", ".join(repr(float(x)) for x in wanted.signals["payloads.box.position"][0, 0])
    grappled = carried(f"grapple = 0 s; position = [{at}] m;")
    for found, rows in ((released, -1), (grappled, None)):
        for name in ("q", "guides.tip.error", "guides.tip.turn_error"):
            np.testing.assert_allclose(
                found.signals[name][0, :rows], wanted.signals[name][0, :rows], rtol=0, atol=1e-9, err_msg=name
            )


@pytest.mark.slow
def test_the_generalized_jacobian_of_a_base_that_is_held_is_the_arms(tmp_path: Path) -> None:
    one, other = (
        engine.run(experiment(tmp_path, chain(3, 7, f"{LAW} jacobian = {word};"))).signals["q"].tobytes()
        for word in ("arm", "generalized")
    )
    assert one == other
