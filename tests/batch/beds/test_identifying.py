"""`met bed identify`: a table, and a deck to include; whole messages of what is wrong."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import ic
from batch.beds.identifying import check, digits, sheet_of, widened
from hw.bed import About, Capability, Limits, Scales
from hw.beds import emulated
from hw.beds.emulated import EmulatedBed
from hw.identify import driving
from hw.identify.driving import MovesRequest
from hw.identify.fit import Estimate, FitResult
from hw.recording import records
from met import cli
from met.diagnostic import Problem
from met.plan import Experiment, Plan
from met.plan import file as plan_file
from met.plant import Plant, bed_values
from tests.hw.conftest import said

pytestmark = pytest.mark.slow

DECK = """\
#include <two_link.ic>
run wired like nominal {
    rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    substitute shoulder {
        bed = emulated(delay = 1, kt = 0.067 N*m/A, resistance = 1.8 ohm, f_c = 0.024 N*m, inertia = 7e-5 kg*m^2,
                       faults = typical);
        law = velocity_tracking;
    }
}
"""
USE = """\
#include "deck.ic"
#include "shoulder.identified.ic"
run found like wired {
    shoulder { bed { kt = shoulder_kt;  resistance = shoulder_resistance;  inertia = shoulder_inertia; } }
}
"""
TRUTH = {"kt": 0.067, "resistance": 1.8, "tau_max": 0.144, "f_c": 0.024, "f_v": 2.58e-5, "inertia": 7e-5, "f_cut": 50.0}


@pytest.fixture
def identify(met_bed: Callable[..., tuple[int, str, str]]) -> Callable[..., tuple[int, str, str]]:
    """`met bed identify deck.ic wired ...`: exit status, what was said, and what was complained of."""
    return partial(met_bed, "identify", "deck.ic", "wired")


def wired() -> Experiment:
    return ic.compile("deck.ic", select=["wired"]).experiments[0]


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: os.symlink("deck.ic", path)])
def test_what_is_no_file_in_the_place_of_the_records_is_left_there(
    identify: Callable[..., tuple[int, str, str]], make: Callable[[str], None]
) -> None:
    make("shoulder.identified.records")
    before = os.lstat("shoulder.identified.records").st_mode
    status, _, complaint = identify("--port", "emulated")
    assert status == cli.BAD_INPUT and complaint == (
        "error[E305]: cannot write shoulder.identified.records: it is not a regular file\n"
        " = help: give another name with `-o`\n"
        "\n1 error\n"
    )
    assert os.lstat("shoulder.identified.records").st_mode == before


@pytest.mark.parametrize(("place", "file"), [(".", "identified.ic"), ("/", "/identified.ic")])
def test_a_folder_is_no_place_for_the_deck(
    identify: Callable[..., tuple[int, str, str]], place: str, file: str
) -> None:
    status, _, complaint = identify("--port", "emulated", "-o", place)
    assert status == cli.BAD_INPUT and complaint == (
        f"error[E305]: cannot write {place}: it is a folder\n = help: name a file in it: `-o {file}`\n\n1 error\n"
    )


@pytest.mark.release
def test_the_deck_that_is_written_holds_the_truth_and_can_be_included(
    identify: Callable[..., tuple[int, str, str]], capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    status, out, _ = identify("--port", "emulated", "--format", "json", "--kt-load-error", "2")
    assert status == cli.YES
    data = json.loads(out)
    found = data["parameters"]
    assert all(found[name]["low"] <= value <= found[name]["high"] for name, value in TRUTH.items())
    given = found["kt_load"]
    assert (given["value"], given["data_sheet"], given["found"]) == (0.072, 0.072, False)
    assert (given["low"], given["high"]) == (pytest.approx(0.072 / 1.02), pytest.approx(0.072 * 1.02))
    assert found["inertia"]["high"] / found["inertia"]["value"] > 1.02 > found["kt"]["high"] / found["kt"]["value"]
    assert found["kt"]["data_sheet"] == 0.061
    text = (here / "shoulder.identified.ic").read_text()
    assert "\nlet shoulder_kt         = 0.06" in text and "// given, not found; 0.0706 to 0.0734\n" in text
    assert max(len(line) for line in text.splitlines()) <= 120
    assert cli.main(["check", "shoulder.identified.ic"]) == cli.main(["fmt", "--check", "shoulder.identified.ic"]) == 0
    (here / "use.ic").write_text(USE)
    assert cli.main(["check", "use.ic"]) == cli.YES
    quantity = ic.compile("use.ic", select=["found"]).experiments[0].parameters["shoulder.bed.kt"]
    assert quantity.value == pytest.approx(found["kt"]["value"], rel=1e-4)
    assert len(records.read(here / "shoulder.identified.records").rows) > 40_000


@pytest.mark.release
def test_a_scaled_bed_is_identified_as_it_is_and_its_deck_has_both_sizes(
    identify: Callable[..., tuple[int, str, str]], here: Path
) -> None:
    """The bed's motor is near what its scales make of the servo's. Written into the servo it is of the joint's size."""
    scaled = DECK.replace(
        "kt = 0.067 N*m/A", "kt = 0.033 N*m/A, tau_max = 0.072 N*m, f_v = 1e-5 N*m*s/rad, kt_load = 0.072 N*m/A"
    ).replace("        law =", "        scale { torque = 2;  voltage = 2; }\n        law =")
    Path("deck.ic").write_text(scaled)
    sheet = sheet_of(wired(), "shoulder", None)
    assert (sheet.values["kt"], sheet.values["tau_max"], sheet.values["v_max"]) == (0.0305, 0.072, 10.0)
    assert (sheet.values["inertia"], sheet.values["resistance"]) == (6.38e-5 / 2, 2.05 / 2)
    status, out, _ = identify("--port", "emulated", "--format", "json")
    assert status == cli.YES
    found = json.loads(out)["parameters"]
    for name, value in {"kt": 0.033, "resistance": 1.8, "f_c": 0.024, "inertia": 7e-5, "tau_max": 0.072}.items():
        assert found[name]["low"] <= value <= found[name]["high"], name
    text = (here / "shoulder.identified.ic").read_text()
    assert "//         scale { torque = 2;  rate = 1;  voltage = 2; }\n" in text
    use = "".join(line.removeprefix("//").strip() + "\n" for line in text.splitlines() if line.startswith("//     "))
    block, servo = use.split("servo found")
    Path("use.ic").write_text(
        f'#include "deck.ic"\n#include "shoulder.identified.ic"\nservo found {servo}'
        f"run found_run like wired {{ remove shoulder;  servos {{ shoulder = found; }}\n{block} }}\n"
    )
    assert cli.main(["check", "use.ic"]) == cli.YES
    made = ic.compile("use.ic", select=["found_run"]).experiments[0].parameters
    for name, of, scale in (("kt", "kt", 2.0), ("resistance", "resistance", 2.0), ("inertia", "j_m", 2.0)):
        assert made[f"shoulder.bed.{name}"].value == pytest.approx(found[name]["value"], rel=1e-4)
        assert made[f"shoulder.servo.{of}"].value == pytest.approx(scale * found[name]["value"], rel=1e-4)


def test_the_servo_is_the_data_sheet_and_what_is_asked_goes_before_the_deck() -> None:
    sheet = sheet_of(wired(), "shoulder", None)
    assert (sheet.values["kt"], sheet.values["inertia"], sheet.values["v_max"]) == (0.061, 6.38e-5, 20.0)
    assert sheet.values["kt_load"] == 0.072 and not sheet.has_kt_load
    asked = sheet_of(wired(), "shoulder", 0.08)
    assert asked.values["kt_load"] == 0.08 and asked.has_kt_load


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("--port", "/dev/null"),
            """\
error[E424]: joint `shoulder`: the load motor's constant, by which torques are measured, is nowhere said
 = help: `--kt-load '0.072 N*m/A'`, from its data sheet; or `bed = emulated(kt_load = ..., ...)` in the deck
""",
        ),
        (
            ("--port", "emulated", "--current", "4 A"),
            """\
error[E421]: a current of 4 A is beyond the bed's limit, 3 A
 = help: give `--current` less, or leave it out
""",
        ),
    ],
)
def test_what_is_said_of_what_is_wrong(
    identify: Callable[..., tuple[int, str, str]], words: tuple[str, ...], message: str
) -> None:
    status, _, complained = identify(*words)
    assert status == cli.BAD_INPUT and message in complained


class Driven(EmulatedBed):
    """Something else turns its shaft, where `driven`: what is read is never 0."""

    driven = False

    def exchange(self, voltage: float, current: float):  # type: ignore[no-untyped-def]
        from dataclasses import replace

        answer = super().exchange(voltage, current)
        assert answer is not None
        return replace(answer, rate=answer.rate + 4.0) if self.driven else answer


@pytest.mark.parametrize(
    ("rate", "message"),
    [
        (
            100.0,
            """\
error[E420]: bed `emulated` at 0.447 s, in move 1 (steps): the bed stopped itself: rate
 = help: look whether the load drives the shaft; lower the rate that is asked for
 = help: `--voltage`, `--current` and `--rate` make the moves smaller""",
        ),
        (
            None,
            """\
error[E422]: bed `emulated` does not come to rest before the first move, at 0 V and 0 A
 = help: look what drives its shaft, and whether its tachometer reads 0 at rest""",
        ),
    ],
)
def test_moves_that_are_cut_short(
    rate: float | None, message: str, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    of = wired()
    values = bed_values(of, "shoulder")
    limits = emulated.limits(values, 1e-3, **({} if rate is None else {"rate": rate}))
    bed = Driven(Plant(of, "shoulder", period=1e-3), emulated.scales(values), limits)
    bed.driven = rate is None
    monkeypatch.setattr(driving, "opened", lambda *_: bed)
    monkeypatch.setattr("hw.driving.process.listening", lambda: lambda: False)
    sheet = dict(sheet_of(of, "shoulder", None).values)
    asked = MovesRequest(
        plan=plan_file.dumps(Plan("", (of,))),
        row=0,
        joint="shoulder",
        port="emulated",
        records=str(here / "a.records"),
        sheet=sheet,
        rate=rate,
    )
    with pytest.raises(Problem) as caught:
        driving.run(asked)
    assert said(caught.value) == message
    assert (bed.voltage, bed.current) == (0.0, 0.0)
    assert len(records.read(here / "a.records").rows) > 400


ABOUT = About("bench", 1, "0" * 16, 1, Capability(0), 1e3, 0.02, Scales(*[1.0] * 6), Limits(*[1.0] * 7))


@pytest.mark.parametrize(
    ("settled", "message"),
    [
        (
            True,
            """\
error[E423]: bed `bench` does not do what a motor bed does: 11 of 100 rad/s, rms, are left unexplained, most in move 2
 = help: look whether voltage, current and rate have their signs and scales, and whether the servo's motor in the deck \
is the one on the bed""",
        ),
        (
            False,
            """\
error[E423]: bed `bench`: no parameters were settled on in the time that the search is given
 = help: begin nearer: the servo's motor in the deck is where it begins""",
        ),
    ],
)
def test_a_bed_that_is_no_motor_bed(settled: bool, message: str) -> None:
    found = FitResult({}, (0.0, 0.0), np.array([10.0, 12.0]), 100.0, 0.2, settled)
    with pytest.raises(Problem) as caught:
        check(found, ABOUT)
    assert said(caught.value) == message


def test_a_given_constant_that_is_not_sure_widens_what_is_measured_by_it() -> None:
    found = {name: Estimate(2.0, 2.0 / 1.01, 2.0 * 1.01, name != "kt_load") for name in (*TRUTH, "kt_load")}
    wide = widened(found, 0.05)
    assert wide["kt"] == found["kt"] and wide["f_cut"] == found["f_cut"]
    assert all(wide[name].high > 2.1 for name in ("resistance", "tau_max", "f_c", "f_v", "inertia", "kt_load"))


@pytest.mark.parametrize(("value", "half", "text"), [
    (0.0458413, 0.00005, "0.045841"), (0.04589, 0.00005, "0.045890"), (1.93312e-5, 4.8e-7, "1.933e-05"),
    (39.7914, 0.047, "39.791"), (0.072, 0.0, "0.072"),
])  # fmt: skip
def test_numbers_have_the_digits_that_are_known(value: float, half: float, text: str) -> None:
    assert digits(Estimate(value, value - half, value + half, True), value) == text
