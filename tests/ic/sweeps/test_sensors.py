"""A sensor's words, and the sensor itself, may vary and be set, as words of servos may."""

from __future__ import annotations

from pathlib import Path

import pytest

from met.plan import Experiment
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, messages

NOISY = changed(SERVO, ("command", "sensor qd = tachometer { noise = 0.1 rad/s; }\n    command"))
FILTERED = changed(NOISY, ("noise = 0.1 rad/s;", "filter = butterworth;  cutoff = 20 Hz;  noise = 0.1 rad/s;"))
OWN = changed(RUN, ("hinge = drive;", "hinge = drive { sensor qd = encoder { step = 0.1 rad; } }"))


def groups(folder: Path, body: str, servo: str = NOISY, run: str = RUN) -> tuple[Experiment, ...]:
    compiled = check(folder, ARM, servo, run, f"sweep it of hold {{ {body} }}\n", select=["it"])
    assert compiled.plan is not None, messages(compiled)
    return compiled.plan.experiments


def models_of(found: tuple[Experiment, ...]) -> list[list[str]]:
    return [[f"{each.of} {each.model}" for each in one.structure.servos[0].sensors] for one in found]


@pytest.mark.parametrize("path", ["hinge.servo.sensor.qd", "drive.sensor.qd"])
def test_a_sensor_may_vary_over_models_however_they_are_written(path: str, tmp_path: Path) -> None:
    written = "[tachometer { delay = 1; }, tachometer { delay = 2; }, low_pass(cutoff = 20 Hz)]"
    found = groups(tmp_path, f"vary {path} = {written};")
    assert models_of(found) == [["qd tachometer"], ["qd tachometer"], ["qd low_pass"]]
    assert [each.parameters["hinge.servo.sensor.qd.delay"].value for each in found[:2]] == [1.0, 2.0]
    assert [choice.value for each in found for choice in each.cases.choices] == [
        "tachometer { delay = 1; }",
        "tachometer { delay = 2; }",
        "low_pass(cutoff = 20 Hz)",
    ]


def test_so_may_one_that_the_use_writes_and_one_that_nobody_does(tmp_path: Path) -> None:
    body = "vary hinge.servo.sensor.qd = [tachometer { delay = 1; }, low_pass { cutoff = 20 Hz; }];"
    assert models_of(groups(tmp_path, body, NOISY, changed(OWN, ("step = 0.1 rad;", "step = 0.1 rad/s;")))) == [
        ["qd tachometer"],
        ["qd low_pass"],
    ]
    assert models_of(groups(tmp_path, body, SERVO)) == [["qd tachometer"], ["qd low_pass"]]


@pytest.mark.parametrize("path", ["hinge.servo.sensor.qd.filter", "drive.sensor.qd.filter"])
def test_a_word_of_a_sensor_may_vary(path: str, tmp_path: Path) -> None:
    (filtered,) = groups(tmp_path, f"vary {path} = [butterworth];  vary drive.kp = [0.1, 0.2] V*s/rad;", FILTERED)
    assert filtered.structure.servos[0].sensors[0].words == (("filter", "butterworth"),)
    (plain,) = groups(tmp_path, f"vary {path} = [none];  vary drive.sensor.qd.noise = [0.1, 0.2] rad/s;")
    assert plain.structure.servos[0].sensors[0].words == () and plain.cases.count == 2


@pytest.mark.parametrize(("setting", "model", "words"), [
    ("hinge.servo.sensor.qd=low_pass(cutoff = 20 Hz)", "low_pass", ()),
    ("drive.sensor.qd=low_pass(cutoff = 20 Hz)", "low_pass", ()),
    ("hinge.servo.sensor.qd.filter=butterworth", "tachometer", (("filter", "butterworth"),)),
    ("drive.sensor.qd.filter=butterworth", "tachometer", (("filter", "butterworth"),)),
    ("drive.sensor.qd.noise=1 rad/s", "tachometer", (("filter", "butterworth"),)),
])  # fmt: skip
def test_both_may_be_set(setting: str, model: str, words: tuple[tuple[str, str], ...], tmp_path: Path) -> None:
    compiled = check(tmp_path, ARM, FILTERED, RUN, set=[setting])
    assert compiled.plan is not None, messages(compiled)
    (sensor,) = compiled.plan.experiments[0].structure.servos[0].sensors
    assert (sensor.model, sensor.words) == (model, words)


def test_a_sensor_that_the_servo_cannot_have_is_told_at_the_path(tmp_path: Path) -> None:
    compiled = check(tmp_path, ARM, NOISY, RUN, set=["hinge.servo.sensor.motor_rate=low_pass(cutoff = 2 Hz)"])
    (diagnostic,) = compiled.diagnostics
    assert (diagnostic.code, diagnostic.help) == ("D245", ("a sensor may be of: q, qd",))


def test_repeats_without_noise_say_that_a_sensor_has_it(tmp_path: Path) -> None:
    (diagnostic,) = check(tmp_path, ARM, SERVO, RUN, "sweep it of hold { repeat 2; }\n", select=["it"]).diagnostics
    assert diagnostic.code == "D230" and diagnostic.help[1] == (
        "a sensor may be noisy: `sensor qd = tachometer { noise = 0.1 rad/s; }` in a servo"
    )
    assert codes(tmp_path, ARM, NOISY, RUN, "sweep it of hold { repeat 2; }\n", select=["it"]) == []
