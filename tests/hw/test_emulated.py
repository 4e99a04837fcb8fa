"""The bed in this process: over a wire the same plant makes the same bits."""

from __future__ import annotations

import math
import random

import pytest

from hw.bed import BedSample, BedState, Fault, Limits
from hw.beds import emulated
from hw.beds.emulated import EmulatedBed
from met.diagnostic import Problem
from tests.hw.conftest import LineBed, said
from tests.hw.device import Device, Shaft
from tests.hw.relay import VirtualLine

VALUES = {"i_max": 3.0, "converter_voltage": 40 / 4096, "converter_current": 6 / 4096, "converter_in": 800 / 4096}


def made(values: dict[str, float] = VALUES, **more: float) -> EmulatedBed:
    return EmulatedBed(Shaft(), emulated.scales(values), emulated.limits(values, 1e-3), **more)  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("values", [VALUES, {"i_max": 3.0}], ids=["converters", "fine"])
def test_over_a_wire_the_same_plant_makes_the_same_bits(values: dict[str, float]) -> None:
    scales, limits = emulated.scales(values), emulated.limits(values, 1e-3)
    device = Device(scales=tuple(scales.__dict__.values()), limits=tuple(limits.__dict__.values()))
    found = []
    for bed in (made(values), LineBed(lambda: VirtualLine(device, None))):
        chance = random.Random(1)
        bed.connect()
        bed.preset(rate=2.0)
        bed.arm()
        samples = [bed.exchange(chance.uniform(-12.0, 12.0), chance.uniform(-1.0, 1.0)) for _ in range(2000)]
        found.append([(s.rate, s.angle, s.tick, s.state) for s in samples if s is not None])
        bed.close()
    assert len(found[0]) == 2000 and found[0] == found[1]


def test_counts_are_the_steps_of_the_converters_and_fine_where_there_are_none() -> None:
    scales = emulated.scales(VALUES)
    assert (scales.voltage, scales.current, scales.rate) == (40 / 4096, 6 / 4096, 800 / 4096)
    fine = emulated.scales({"converter_voltage": 0.0})
    assert (fine.voltage, fine.current, fine.rate) == (2.0**-20, 2.0**-20, 2.0**-20)


def test_a_load_that_is_loaded_for_too_long_stops_it() -> None:
    limits = Limits(20.0, 3.0, 1e3, 5.0, 4e4, 6e3, 0.5)
    bed = EmulatedBed(Shaft(), emulated.scales(VALUES), limits, bears=1.0)
    bed.connect()
    bed.arm()
    samples = [bed.exchange(0.0, 0.9) for _ in range(1000)]
    assert all(sample is not None and sample.state == BedState.ARMED for sample in samples)
    ticks = 0
    sample: BedSample | None = None
    while sample is None or sample.state == BedState.ARMED:
        sample, ticks = bed.exchange(0.0, 2.0), ticks + 1
    assert sample.faults == Fault.HEAT and (bed.voltage, bed.current) == (0.0, 0.0)
    assert ticks == math.ceil(0.5 / ((round(2.0 / (6 / 4096)) * 6 / 4096) ** 2 - 1.0) * 1e3)


def test_a_plant_that_diverges_stops_it() -> None:
    bed = made()
    bed.connect()
    bed.arm()
    bed._plant.tick = lambda voltage, current: math.nan  # type: ignore[method-assign]
    sample = bed.exchange(1.0, 0.0)
    assert sample is not None and sample.faults == Fault.RATE and bed.voltage == 0.0


def test_a_whole_change_of_command_within_a_tick_is_no_fault_unless_it_is_made_one() -> None:
    bed = made()
    bed.connect()
    bed.arm()
    for way in (1.0, -1.0, 1.0):
        sample = bed.exchange(way * 60.0, way * 3.0)
        assert sample is not None and sample.state == BedState.ARMED


def test_why_it_does_not_take_limits_while_it_is_armed() -> None:
    bed = made()
    bed.connect()
    bed.arm()
    with pytest.raises(Problem) as caught:
        bed.limit({"rate": 10.0})
    assert (
        said(caught.value)
        == "error[E406]: bed `emulated` does not take tighter limits: it is armed\n = help: stop it first"
    )
