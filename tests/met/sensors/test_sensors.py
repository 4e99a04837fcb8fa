"""Sensors between a joint and its servo's law: filters, noise, steps and delays; who sees them, and who may not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.run import Run
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, experiment, messages

MOVED = """\
servo moved {
    model = ideal;  bandwidth = 1 s^-1;
    command = acceleration(sine(amplitude = 40 rad/s^2, frequency = 8 Hz));
    SENSORS
}
run it {
    arm = swing;  servos { hinge = moved; }
    initial { hinge.qd = -0.795774715459477 rad/s; }
    rates { dynamics = 4 kHz;  servos = 1 kHz;  record = 1 kHz; }
    duration = 1 s;  record = [q, qd, tau, RECORD];
}
"""
"""A joint that swings at 8 Hz by 0.8 rad/s about zero, whatever its sensors."""


def moved(folder: Path, sensors: str, *record: str, more: str = "") -> Run:
    text = changed(MOVED, ("SENSORS", sensors), ("RECORD", ", ".join(record)))
    return engine.run(experiment(folder, ARM, text, more, select=["cases" if more else "it"]))


def of(run: Run, name: str, case: int = 0) -> np.ndarray:
    return run.signals[name][case, :, 0]


@pytest.mark.parametrize(
    ("sensor", "order"),
    [
        ("tachometer { filter = butterworth;  cutoff = 20 Hz; }", 2),
        ("low_pass { cutoff = 20 Hz; }", 1),
    ],
)
def test_a_filter_answers_as_its_transfer_function_does(sensor: str, order: int, tmp_path: Path) -> None:
    run = moved(tmp_path, f"sensor qd = {sensor}", "servo.sensor.qd")
    s = 2j * np.pi * 8.0 / (2.0 * np.pi * 20.0)
    H = 1.0 / (1.0 + s) if order == 1 else 1.0 / (1.0 + np.sqrt(2.0) * s + s * s)
    late = run.time > 0.5  # the filter's own motion has died away by exp(-0.5 * 89)
    amplitude = 40.0 / (2.0 * np.pi * 8.0)
    expected = -amplitude * (H * np.exp(2j * np.pi * 8.0 * run.time)).real
    # qd is off by the command's being held for a tick, and the filter by (h w)^2/6: 2e-3 of 0.8
    np.testing.assert_allclose(of(run, "servo.sensor.qd")[late], expected[late], rtol=0, atol=2e-2)
    # against the sampled motion itself, filtered by other means
    assert np.abs(of(run, "servo.sensor.qd")).max() < 1.05 * abs(H) * np.abs(of(run, "qd")).max() + 0.02


def test_a_converter_gives_the_nearest_step_and_an_encoder_the_last_line(tmp_path: Path) -> None:
    run = moved(
        tmp_path,
        "sensor qd = tachometer { resolution = 0.25 rad/s; }  sensor q = encoder { step = 0.5 deg; }",
        "servo.sensor.qd",
        "servo.sensor.q",
    )
    qd, q, step = of(run, "qd"), of(run, "q"), np.deg2rad(0.5)
    assert (of(run, "servo.sensor.qd") == 0.25 * np.rint(qd / 0.25)).all()
    assert (of(run, "servo.sensor.q") == step * np.floor(q / step)).all()
    assert np.ptp(of(run, "servo.sensor.qd")) > 1.0 and np.unique(of(run, "servo.sensor.q")).size > 2


@pytest.mark.slow
@pytest.mark.parametrize("ticks", [1, 2, 3])
def test_a_delay_is_whole_ticks_and_begins_with_the_first_reading(ticks: int, tmp_path: Path) -> None:
    run = moved(tmp_path, f"sensor qd = tachometer {{ delay = {ticks}; }}", "servo.sensor.qd")
    qd, seen = of(run, "qd"), of(run, "servo.sensor.qd")
    assert (seen[ticks:] == qd[:-ticks]).all() and (seen[:ticks] == qd[0]).all()


def test_noise_has_its_size_is_white_and_the_same_for_cases_that_differ_in_a_gain(tmp_path: Path) -> None:
    sweep = "sweep cases of it { vary links.bar.mass = [1, 2] kg; }\n"
    run = moved(
        tmp_path,
        "sensor qd = tachometer { noise = 0.05 rad/s; }  sensor q = tachometer { noise = 0.05 rad; }",
        "servo.sensor.qd",
        "servo.sensor.q",
        more=sweep,
    )
    noise = [of(run, "servo.sensor.qd", case) - of(run, "qd", case) for case in (0, 1)]
    np.testing.assert_allclose(noise[0], noise[1], rtol=0, atol=1e-15)
    other = of(run, "servo.sensor.q") - of(run, "q")
    n = len(noise[0])
    assert n == 1001
    # of n draws: mean within 4/sqrt(n), size within 4/sqrt(2 n), neighbours and the other sensor uncorrelated
    assert abs(noise[0].mean()) < 4 * 0.05 / np.sqrt(n) and abs(noise[0].std() / 0.05 - 1.0) < 4 / np.sqrt(2 * n)
    for first, second in ((noise[0][1:], noise[0][:-1]), (noise[0], other)):
        assert abs(np.corrcoef(first, second)[0, 1]) < 4 / np.sqrt(n)


def test_a_law_sees_what_its_sensor_reads(tmp_path: Path) -> None:
    """Steps of 50 rad/s read a slow joint as standing: the loop asks for more and more."""
    run = changed(RUN, ("[q]", "[q, qd, servo.voltage, servo.integral]"))
    blind = changed(SERVO, ("command", "sensor qd = tachometer { resolution = 50 rad/s; }  command"))
    seen, unseen = (engine.run(experiment(tmp_path, ARM, servo, run)) for servo in (SERVO, blind))
    np.testing.assert_allclose(of(unseen, "servo.integral"), 100.0 * 0.1 * unseen.time, atol=0.011)
    assert of(seen, "servo.integral")[-1] < 0.5 * of(unseen, "servo.integral")[-1]


def test_a_sensor_on_the_motors_side_is_of_a_state(tmp_path: Path) -> None:
    geared = changed(
        SERVO,
        ("rigid_gearbox", "compliant_gearbox"),
        (
            "command",
            "stiffness = 5000 N*m/rad;  "
            "sensor motor_rate = tachometer { resolution = 0.5 rad/s;  delay = 1; }  command",
        ),
    )
    run = changed(RUN, ("[q]", "[servo.motor_rate, servo.sensor.motor_rate]"), ("record = 100 Hz", "record = 1 kHz"))
    found = engine.run(experiment(tmp_path, ARM, geared, run))
    rate = of(found, "servo.motor_rate")
    assert (of(found, "servo.sensor.motor_rate")[1:] == 0.5 * np.rint(rate[:-1] / 0.5)).all() and np.ptp(rate) > 5.0


def test_a_continuous_law_sees_through_analog_sensors_alone(tmp_path: Path) -> None:
    analog = changed(SERVO, ("command", "rate = continuous;  sensor qd = low_pass { cutoff = 200 Hz; }  command"))
    run = changed(RUN, ("[q]", "[qd, servo.sensor.qd, servo.sensor.qd.filtered]"))
    found = engine.run(experiment(tmp_path, ARM, analog, run))
    assert (of(found, "servo.sensor.qd") == of(found, "servo.sensor.qd.filtered")).all()
    assert np.abs(of(found, "servo.sensor.qd") - of(found, "qd")).max() > 1e-5
    clocked = changed(analog, ("low_pass { cutoff = 200 Hz; }", "tachometer { delay = 1; }"))
    assert codes(tmp_path, ARM, clocked, RUN) == ["D106"]


def test_between_instants_a_sensor_sees_the_state_carried_forward(tmp_path: Path) -> None:
    run = moved(
        tmp_path,
        "rate = 16 kHz;  sensor qd = tachometer { filter = butterworth;  cutoff = 50 Hz; }",
        "servo.sensor.qd",
        "servo.sensor.qd.filtered",
    )
    away = np.abs(of(run, "servo.sensor.qd") - of(run, "servo.sensor.qd.filtered")).max()
    assert away == 0.0, "at an instant nothing is carried"
    assert np.isfinite(of(run, "servo.sensor.qd")).all()


SENSOR = "sensor qd = tachometer { noise = 0.1 rad/s; }"


@pytest.mark.parametrize(
    ("sensor", "said"),
    [
        (
            "sensor qdd = tachometer { }",
            """\
error[D245]: servo `drive` has no `qdd` to be sensed
 --> deck.ic:9:5
  |
9 |     sensor qdd = tachometer { } command = rate(0.1 rad/s);
  |     ^^^^^^^^^^
  = help: did you mean `qd`?
  = help: a sensor may be of: q, qd

1 error
""",
        ),
        (
            "sensor qd = tacho { }",
            """\
error[D140]: no sensor model `tacho`
 --> deck.ic:9:17
  |
9 |     sensor qd = tacho { } command = rate(0.1 rad/s);
  |                 ^^^^^
  = help: did you mean `tachometer`?
  = help: sensor models: accelerometer, encoder, gyroscope, low_pass, tachometer

1 error
""",
        ),
        (
            "sensor qd = tachometer { noise = 0.1 rad; }",
            """\
error[D061]: `noise` of sensor `qd` of servo `drive` is in rad/s, and this is in rad
""",
        ),
    ],
)
def test_what_is_wrong_with_a_sensor_is_told(sensor: str, said: str, tmp_path: Path) -> None:
    text = messages(check(tmp_path, ARM, changed(SERVO, ("command", f"{sensor} command")), RUN))
    assert text.startswith(said) if said.count("\n") == 1 else text == said


def test_what_has_no_law_or_is_on_a_bed_has_no_sensor(tmp_path: Path) -> None:
    passive = f"servo drive {{ model = passive;  {SENSOR} }}\n"
    assert codes(tmp_path, ARM, passive, RUN) == ["D246"]
    bed = changed(RUN, ("record = [q];", "record = [q]; substitute hinge { }"))
    assert codes(tmp_path, ARM, changed(SERVO, ("command", f"{SENSOR} command")), bed) == ["D246"]


def test_a_sensor_is_changed_and_taken_away_as_any_block(tmp_path: Path) -> None:
    base = changed(SERVO, ("command", f"{SENSOR} command"))
    other = base + "servo other like drive { qd { delay = 2; } }\nservo bare like drive { remove qd; }\n"
    made = experiment(tmp_path, ARM, other, changed(RUN, ("hinge = drive", "hinge = other")))
    head = "hinge.servo.sensor.qd"
    assert (made.parameters[f"{head}.noise"].value, made.parameters[f"{head}.delay"].value) == (0.1, 2.0)
    made = experiment(tmp_path, ARM, other, changed(RUN, ("hinge = drive", "hinge = bare")))
    assert made.structure.servos[0].sensors == () and f"{head}.noise" not in made.parameters
