"""The kernel split at the wire: with the bed outside, stepped by hand, a run is what it is with the bed inside."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import ic
from met.backends.llvm import kernel
from met.program import build
from met.run import prepare, run
from met.substitution import emulated
from met.substitution.bed import Wire

pytestmark = pytest.mark.slow

DECK = """
#include <two_link.ic>
run wired like nominal {{
    rates {{ dynamics = {dynamics} Hz;  servos = 500 Hz;  record = {record} Hz; }}  duration = 0.6 s;
    remove settle;  remove volts;  record = [q, qd, shoulder.bed.shaft_rate];
    substitute shoulder {{ bed = emulated(converter_in = 0.02 rad/s, delay = {delay}); }}
}}
"""


@pytest.mark.release
@pytest.mark.parametrize("dynamics", [500, 250])
@pytest.mark.parametrize(("late", "delay"), [(0, 0), (0, 1), (1, 1), (1, 2)])
def test_a_bed_outside_the_kernel_makes_the_same_run_as_the_emulated_one_inside(
    dynamics: int, late: int, delay: int
) -> None:
    """late: the delay of one tick is the kernel's, or the wire's."""
    experiment = ic.compile(
        text=DECK.format(dynamics=dynamics, record=dynamics, delay=delay), select=["wired"]
    ).experiments[0]
    inside = run(prepare(experiment))

    split = build(experiment, wire=True, late=late)
    assert split.inputs == ("wire:shoulder.rate",)
    block = kernel.compile(split).block(np.zeros((1, 1)))
    told = {name: split.outputs.index(f"wire:shoulder.{name}") for name in ("voltage", "current")}
    values = {
        name.removeprefix("shoulder.bed."): quantity.value
        for name, quantity in experiment.parameters.items()
        if name.startswith("shoulder.bed.")
    }
    p = SimpleNamespace(**values)
    held = SimpleNamespace(shaft_rate=0.0, shaft_angle=0.0, filtered=0.0, filtered_slope=0.0)
    rows, shaft, waiting = [], [], [Wire(0.0, 0.0)] * late
    step = experiment.structure.schedule.dynamics
    for k in range(experiment.structure.schedule.ticks + 1):
        if k:
            waiting.append(Wire(block.outputs[told["voltage"], 0], block.outputs[told["current"], 0]))
            held = SimpleNamespace(**emulated.advance(p, held, waiting.pop(0), 1.0 / 500.0, lambda name: 0.0))
        block.inputs[0, :] = emulated.BED.read(p, held)
        at = block.recorded(k, k)
        if k % step == 0:
            rows.append(at[0, 0, :5])
            shaft.append(held.shaft_rate)
    assert np.abs(inside.signals["qd"][0, -1]).min() > 0.001
    # exponentials and sines of the platform's library outside, MET's inside: last places
    assert np.isnan(np.array(rows)[:, 4]).all()  # the shaft itself: nobody knows it of a bed at a wire
    assert np.array(rows)[:, :2] == pytest.approx(inside.signals["q"][0], abs=1e-12)
    assert np.array(rows)[:, 2:4] == pytest.approx(inside.signals["qd"][0], abs=1e-11)
    assert np.array(shaft) == pytest.approx(inside.signals["shoulder.bed.shaft_rate"][0], abs=1e-11)
