"""A bed's parameters found from guided moves: the truth is in the intervals that are stated."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

import ic
from hw.bed import About, BedSample, Capability, Limits
from hw.beds import emulated
from hw.beds.emulated import EmulatedBed
from hw.driving import loop
from hw.driving.pace import pace
from hw.identify.driving import MovesRequest, peaks
from hw.identify.fit import FitResult, fitted
from hw.identify.moves import MoveGuide, Peaks, groups, guided
from hw.identify.series import Series, series
from hw.recording import records
from met.diagnostic import Problem
from met.plan import Experiment
from met.plant import Plant, bed_values
from tests.hw.conftest import said

pytestmark = pytest.mark.slow

UNITS = {
    "kt": "N*m/A",
    "resistance": "ohm",
    "tau_max": "N*m",
    "f_c": "N*m",
    "f_v": "N*m*s/rad",
    "inertia": "kg*m^2",
    "kt_load": "N*m/A",
    "f_cut": "Hz",
}
SHEET = {
    "kt": 0.061,
    "resistance": 2.05,
    "tau_max": 0.144,
    "f_c": 0.0205,
    "f_v": 2.58e-5,
    "inertia": 6.38e-5,
    "kt_load": 0.072,
    "f_cut": 50.0,
}
TOLD = [name for name in UNITS if name != "kt_load"]

DECK = """\
#include <two_link.ic>
run wired like nominal {{
    rates {{ dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }}
    substitute shoulder {{ bed = emulated(delay = 1, {values}, faults = {faults});  law = velocity_tracking; }}
}}
"""


def hidden(seed: int) -> dict[str, float]:
    """Parameters within 30 % of the data sheet's."""
    chance = np.random.default_rng(seed)
    return {name: value * float(chance.uniform(0.7, 1.3)) for name, value in SHEET.items()}


def experiment(truth: Mapping[str, float], faults: str) -> Experiment:
    values = ", ".join(f"{name} = {value!r} {UNITS[name]}" for name, value in truth.items())
    return ic.compile(text=DECK.format(values=values, faults=faults), select=["wired"]).experiments[0]


class OwnTime(EmulatedBed):
    """Answers with what it reads as a command comes, as a bed with a time of its own; but for each 50th exchange."""

    asked = 0

    def exchange(self, voltage: float, current: float) -> BedSample | None:
        self.asked += 1
        answer = self.read()
        super().exchange(voltage, current)
        return None if self.asked % 50 == 0 else answer


class Measuring(EmulatedBed):
    """Measures the drive motor's current, to 5 mA rms. values: of the bed"""

    values: Mapping[str, float]
    volts = 0.0

    def connect(self) -> About:
        about = super().connect()
        self._chance = np.random.default_rng(1)
        return replace(about, capabilities=about.capabilities | Capability.DRIVE_CURRENT)

    def read(self) -> BedSample:
        return self._measured(super().read())

    def arm(self) -> BedSample:
        return self._measured(super().arm())

    def exchange(self, voltage: float, current: float) -> BedSample | None:
        answer = super().exchange(voltage, current)
        self.volts = voltage
        return None if answer is None else self._measured(answer)

    def _measured(self, sample: BedSample) -> BedSample:
        p = self.values
        torque = p["kt"] / p["resistance"] * (self.volts - p["kt"] * self._plant.shaft_rate)  # type: ignore[attr-defined]
        torque = min(max(torque, -p["tau_max"]), p["tau_max"])
        return replace(sample, drive_current=torque / p["kt"] + 0.005 * float(self._chance.normal()))


def moved(
    of: Experiment, seed: int, kind: type[EmulatedBed] = EmulatedBed, voltage: float = 20.0
) -> tuple[Series, list[int], list[tuple[float, float, float]]]:
    """What came of the moves; their groups; told V, A and read rad/s at each exchange."""
    values = bed_values(of, "shoulder")
    bed = kind(Plant(of, "shoulder", period=1e-3), emulated.scales(values), emulated.limits(values, 1e-3))
    if isinstance(bed, Measuring):
        bed.values = values
    about = bed.connect()
    bed.preset(seed=seed)
    moves = guided(186.0 if voltage == 20.0 else 60.0)
    guide = MoveGuide(moves, Peaks(voltage, 2.0, 500.0), 1e-3, (4e4, 6e3))
    out: list[bytes] = []
    loop.drive(
        [bed],
        guide,
        pace(1000.0),
        guide.exchanges,
        out.append,
        lock_step=True,
        stop_requested=lambda: guide.done or guide.stuck,
    )
    assert guide.done
    rows = np.frombuffer(b"".join(out), records.LAYOUT)
    found = series(rows, about, guide.began, lock_step=kind is not OwnTime)
    return found, groups(moves), list(zip(rows["voltage"], rows["current"], rows["rate"], strict=True))


def outside(found: FitResult, truth: Mapping[str, float]) -> list[str]:
    """Parameters whose interval the truth is not in."""
    return [
        name for name, each in found.parameters.items() if each.is_fitted and not each.low <= truth[name] <= each.high
    ]


def identified(seed: int, faults: str) -> tuple[FitResult, dict[str, float]]:
    truth = hidden(seed)
    what, its, _ = moved(experiment(truth, faults), seed)
    return fitted(what, its, {**SHEET, "kt_load": truth["kt_load"]}), truth


@pytest.mark.parametrize("faults", ["none", "typical"])
def test_hidden_parameters_are_found_and_sure_to_a_percent_or_so(faults: str) -> None:
    found, truth = identified(3, faults)
    assert found.settled and [name for name, each in found.parameters.items() if each.is_fitted] == TOLD
    assert outside(found, truth) == []
    for name in TOLD:
        each = found.parameters[name]
        assert math.log(each.high / each.value) < (0.08 if name == "f_v" else 0.01), name


def missed(seeds: int, faults: str) -> dict[str, int]:
    """In how many of so many seeds the truth is outside of its interval, by parameter."""
    out = dict.fromkeys(TOLD, 0)
    for seed in range(seeds):
        for name in outside(*identified(seed, faults)):
            out[name] += 1
    return out


@pytest.mark.release
@pytest.mark.parametrize("faults", ["none", "typical"])
def test_the_truth_is_in_its_interval(faults: str) -> None:
    """Of 100 seeds it is in 90 at least: `python -m tests.hw.test_identify` counts them, in half an hour."""
    assert not any(missed(3, faults).values())


@pytest.mark.release
def test_moves_keep_within_their_peaks_and_slews_and_end_at_rest() -> None:
    _, _, told = moved(experiment(hidden(1), "typical"), 1)
    volts, amperes, rates = np.array(told).T
    assert np.abs(volts).max() <= 20.0 and np.abs(amperes).max() <= 2.0
    assert np.abs(np.diff(volts)).max() <= 40.0 + 1e-9 and np.abs(np.diff(amperes)).max() <= 6.0 + 1e-9
    assert np.abs(volts).max() > 19.0 and np.abs(amperes).max() > 1.5 and np.abs(rates).max() > 150.0
    assert not volts[-50:].any() and not amperes[-50:].any() and np.abs(rates[-50:]).max() < 2.0
    assert len(told) < 70_000


@pytest.mark.release
def test_a_bed_with_a_time_of_its_own_holds_what_it_is_told_until_the_next() -> None:
    truth = hidden(3)
    what, its, _ = moved(experiment(truth, "none"), 3, OwnTime)
    found = fitted(what, its, {**SHEET, "kt_load": truth["kt_load"]})
    assert outside(found, truth) == [] and float((found.residual**2).mean() ** 0.5) < 1e-3


@pytest.mark.release
def test_drive_current_that_is_measured_gives_the_load_motors_constant_too() -> None:
    truth = hidden(4)
    what, its, _ = moved(experiment(truth, "typical"), 4, Measuring)
    found = fitted(what, its, SHEET)
    assert [name for name, each in found.parameters.items() if each.is_fitted] == list(UNITS)
    assert outside(found, truth) == []


@pytest.mark.release
def test_friction_and_back_emf_are_not_told_apart_where_the_drive_never_reaches_its_limit() -> None:
    truth = {**SHEET, "kt": 0.065, "f_c": 0.018}
    what, its, _ = moved(experiment(truth, "none"), 1, voltage=4.0)
    found = fitted(what, its, SHEET)
    assert [name for name, each in found.parameters.items() if not each.is_fitted] == ["tau_max", "f_v", "kt_load"]
    assert found.parameters["f_v"].value == pytest.approx(SHEET["f_v"], rel=1e-12)
    assert outside(found, truth) == []


LIMITS = Limits(60.0, 3.0, 1000.0, 5.0, 1e5, 1e4, 9.0)
ASKED = MovesRequest(plan="", row=0, joint="", port="", records="", sheet=SHEET)


def test_peaks_are_of_the_bed_and_the_servo() -> None:
    most, top = peaks(LIMITS, {**SHEET, "v_max": 20.0}, ASKED)
    assert most == Peaks(20.0, 2.0, 800.0)
    assert top == pytest.approx(0.75 * (20.0 - 0.144 * 2.05 / 0.061) / 0.061)
    assert peaks(replace(LIMITS, voltage=12.0, current=1.0, rate=100.0), SHEET, ASKED)[0] == Peaks(12.0, 0.8, 80.0)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (
            {"voltage": 61.0},
            """\
error[E421]: a voltage of 61 V is beyond the bed's limit, 60 V
 = help: give `--voltage` less, or leave it out""",
        ),
        (
            {"voltage": 1.0},
            """\
error[E421]: 1 V is too little for the moves: the shaft's friction takes 0.689 V
 = help: `--voltage`, or the bed's own limit, of 2.76 V at least""",
        ),
    ],
)
def test_what_the_moves_cannot_be(more: dict[str, float], message: str) -> None:
    with pytest.raises(Problem) as caught:
        peaks(LIMITS, SHEET, replace(ASKED, **more))
    assert said(caught.value) == message


if __name__ == "__main__":
    for faults in ("none", "typical"):
        with tempfile.TemporaryDirectory() as name:
            print(faults, {each: f"{100 - count} of 100" for each, count in missed(100, faults).items()})
