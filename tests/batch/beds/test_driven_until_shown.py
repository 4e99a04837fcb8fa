"""On motor beds no case is driven beyond the one that decides what is required."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import batch
import ic
from batch.beds.executor import OnBeds
from batch.campaigns.tasks import Task

DECK = """\
#include <two_link.ic>
run brief like nominal {
    rates    { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    duration = 0.2 s;
    record   = [q];
    remove settle;
    remove volts;
    substitute shoulder { bed = emulated(faults = typical);  law = velocity_tracking; }
    metric top = max { of = shoulder.qd; }
    require top < 10 rad/s in 60 % of cases with 60 % confidence;
}
sweep few of brief {
    seeds = independent;
    sample random(until_shown, at_most = 20) { links.lower.mass = uniform(15, 40) kg; }
}
"""


@pytest.mark.release
def test_each_case_is_looked_at_before_the_next_is_driven(
    met_bed: Callable[..., tuple[int, str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    driven, submit = list[Task](), OnBeds.submit
    monkeypatch.setattr(OnBeds, "submit", lambda self, task: (driven.append(task), submit(self, task))[1])
    status, said, _ = met_bed("run", "deck.ic", "few", "--port", "emulated", "-o", "bench.h5", "--no-picture")
    assert status == 0 and "demonstrated  3 of 3 cases meet it" in said and "(sequential test)" in said
    assert [(task.first, task.last) for task in driven] == [(0, 1), (1, 2), (2, 3)]
    batch.run(ic.compile("deck.ic", select=["few"]), output="sim.h5")
    assert batch.diff("sim.h5", "bench.h5").verdict == "identical"
