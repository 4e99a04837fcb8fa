"""A deck's bed at the wire, in this process and over a line: a run is to the bit what the kernel makes of it inside."""

from __future__ import annotations

import numpy as np
import pytest

import ic
from hw.bed import BedDriver
from hw.beds import emulated
from hw.beds.emulated import EmulatedBed
from met.backends.llvm import kernel
from met.plan import Experiment
from met.plant import Plant as DeckPlant
from met.program import build
from met.run import prepare, run
from tests.hw.conftest import LineBed
from tests.hw.device import Device
from tests.hw.relay import VirtualLine

DECK = """
#include <two_link.ic>
run bench like hybrid {{
    rates {{ dynamics = 1 kHz;  servos = 1 kHz;  record = 1 kHz; }}  duration = {duration} s;
    {scale} remove settle;  record = [q, qd, shoulder.bed.shaft_rate, shoulder.bed.load_current];
}}
"""


class Plant(DeckPlant):
    """Whose tachometer the model does not watch."""

    def push(self, rate: float, voltage: float, current: float) -> float:
        return 0.0


def stepped(experiment: Experiment, bed: BedDriver) -> list[tuple[float, float, float]]:
    """Rate read, voltage and current told, at each tick of the kernel with its wire open."""
    program = build(experiment, wire=True)
    block = kernel.compile(program).block(np.zeros((1, len(program.inputs))))
    rate = program.inputs.index("wire:shoulder.rate")
    voltage, current = (program.outputs.index(f"wire:shoulder.{name}") for name in ("voltage", "current"))
    bed.connect()
    sample = bed.preset()
    bed.arm()
    rows = []
    for tick in range(experiment.structure.schedule.ticks + 1):
        if tick:
            answer = bed.exchange(rows[-1][1], rows[-1][2])
            assert answer is not None
            sample = answer
        block.inputs[rate, :] = sample.rate
        block.step(tick, tick)
        rows.append((sample.rate, float(block.outputs[voltage, 0]), float(block.outputs[current, 0])))
    return rows


SCALED = "shoulder { scale { torque = 4;  rate = 1.5;  voltage = 2; } }"


@pytest.mark.release
@pytest.mark.parametrize(("duration", "scale"), [(2, ""), pytest.param(20, "", marks=pytest.mark.slow), (2, SCALED)])
def test_a_run_is_the_same_to_the_bit_inside_the_kernel_in_process_and_over_a_line(duration: int, scale: str) -> None:
    experiment = ic.compile(text=DECK.format(duration=duration, scale=scale), select=["bench"]).experiments[0]
    values = {
        path.removeprefix("shoulder.bed."): quantity.value
        for path, quantity in experiment.parameters.items()
        if path.startswith("shoulder.bed.")
    }
    plant = Plant(experiment, "shoulder")
    scales, limits = emulated.scales(values), emulated.limits(values, plant.period)
    assert scales.voltage == values["converter_voltage"] > 0.0
    device = Device(
        plant=Plant(experiment, "shoulder"),
        tick_hz=1000.0,
        capabilities=0,  # type: ignore[arg-type]
        scales=tuple(scales.__dict__.values()),
        limits=tuple(limits.__dict__.values()),
    )
    here = stepped(experiment, EmulatedBed(plant, scales, limits))
    assert stepped(experiment, LineBed(lambda: VirtualLine(device, None))) == here
    inside = run(prepare(experiment))
    assert [row[2] for row in here] == inside.signals["shoulder.bed.load_current"][0].tolist()
    assert plant.shaft_rate == inside.signals["shoulder.bed.shaft_rate"][0, -1]
    assert max(abs(row[0]) for row in here) > 1.0
