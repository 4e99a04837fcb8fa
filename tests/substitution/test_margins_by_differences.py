"""Margins of beds as linear answers, against what they were when the loop was taken round by differences.

`margins_by_differences.json` has each loop's lower end and limit, and the largest pole of a tick at four r, as
`met margin` found them before: by differences of the functions that run bed, servo and law, over a tape of its own,
with no graph, no tangents and no program. Those ends were found to 0.5 %, so they lie 0.25 % from the true ones at
most; the new ones 0.05 %.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from met.analysis.linear.margins import STABLE
from met.analysis.margin import BedExperiment, margins
from tests.substitution.named_loops import Sweep, named, sweeps

BEFORE = json.loads(Path(__file__).with_name("margins_by_differences.json").read_text(encoding="utf-8"))
RATIOS = (0.5, 1.2, 5.0, 200.0)
QUICK = ("measured_acceleration at 100 Hz", "velocity_tracking at 1000 Hz, kp = 1", "velocity_tracking at 1000 Hz")

UNUSED = {"measured_acceleration at 1000 Hz, torque, delay 0": "the integral, which a torque command does not use"}
"""Loops whose poles by differences have one that stays, 1, of a number that acts on nothing: what it is."""


def test_all_of_them_are_compared() -> None:
    names = [f"{name}, delay {delay}" for name, _, _, delays, _, _ in sweeps() for delay in delays]
    assert names == list(BEFORE) and len(names) >= 68


@pytest.mark.release
@pytest.mark.parametrize(
    "sweep",
    [pytest.param(each, id=each[0], marks=() if each[0] in QUICK else pytest.mark.slow) for each in sweeps()],
)
def test_a_margin_is_what_it_was_by_differences(sweep: Sweep) -> None:
    names, experiment = named(sweep)
    beds = BedExperiment(experiment)
    for case, (name, (one,)) in enumerate(zip(names, margins(experiment), strict=True)):
        lower, limit, largest = BEFORE[name]
        assert one.lower == pytest.approx(lower, rel=3e-3, abs=0.0)
        assert (one.limit is None) == (limit is None)
        if limit is not None:
            assert one.limit == pytest.approx(limit, rel=3e-3, abs=0.0)
        (motor,) = beds.motors(beds.begun(case))
        loop = beds.loop("shoulder", case, motor)
        found = [max(1.0, size) if name in UNUSED else size for size in loop.radii(RATIOS).tolist()]
        assert found == pytest.approx(largest, rel=2e-7)
        ends = [(one.lower, 1.0), (one.limit, -1.0)]
        for end, stable_side in [(end, side) for end, side in ends if end]:
            inside, outside = loop.radii([end * (1.0 + side * 1e-3) for side in (stable_side, -stable_side)])
            assert inside <= 1.0 + STABLE < outside, name
