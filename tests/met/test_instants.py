"""A time that is computed, such as `0.1 s*3`, means the instant that it is rounded from, for all that waits for one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.instants import has_come
from met.run import Run
from tests.ic.small_decks import ARM, SERVO, experiment

RUN = """\
run it {
    arm = swing;  servos { hinge = drive; }
    environment { push = wrench { link = bar;  moment = [0, 0, 2] N*m; }  ENVIRONMENT }
    rates { dynamics = 1 kHz;  servos = 100 Hz;  record = 1 kHz; }
    duration = 0.5 s;  record = [q, qd, tau];
}
"""
IDEAL = "servo drive { model = ideal;  bandwidth = 30 s^-1;  command = COMMAND; }\n"
LOCKED = "servo drive { model = locked;  release = WHEN; }\n"


def ran(folder: Path, servo: str, environment: str, when: str) -> Run:
    deck = [
        part.replace("ENVIRONMENT", environment).replace("COMMAND", "rate(0.1 rad/s)").replace("WHEN", when)
        for part in (ARM, servo, RUN)
    ]
    return engine.run(experiment(folder, *deck))


@pytest.mark.release
@pytest.mark.parametrize(("servo", "environment"), [
    (LOCKED, ""),
    (IDEAL.replace("COMMAND", "rate(step(to = 0.2 rad/s, at = WHEN))"), ""),
    (SERVO, "fault = runaway { joint = hinge;  from = WHEN; }"),
    (SERVO, "fault = runaway { joint = hinge;  until = WHEN; }"),
    (SERVO, "fault = dead_sensor { joint = hinge;  of = qd;  from = WHEN; }"),
    (IDEAL, "fault = free_swinging { joint = hinge;  from = WHEN; }"),
    (IDEAL, "fault = free_swinging { joint = hinge;  until = WHEN; }"),
])  # fmt: skip
@pytest.mark.parametrize("computed", ["(0.1 + 0.2) s", "0.1 s*3"])
def test_what_waits_for_a_computed_time_begins_with_its_instant(
    servo: str, environment: str, computed: str, tmp_path: Path
) -> None:
    assert 0.1 + 0.2 > 0.3 and 0.1 * 3 > 0.3, "a rounding late"
    run, exact = ran(tmp_path, servo, environment, computed), ran(tmp_path, servo, environment, "0.3 s")
    never = ran(tmp_path, servo, environment, "5 s")
    for name in exact.signals:
        np.testing.assert_array_equal(run.signals[name], exact.signals[name])
    assert any((exact.signals[name] != never.signals[name]).any() for name in exact.signals)


def test_a_time_that_is_later_is_not_forgiven() -> None:
    assert has_come(0.3, 0.1 + 0.2) and has_come(0.3, 0.3) and has_come(0.0, 0.0)
    assert not has_come(0.3, 0.3 + 1e-9) and not has_come(1e9, float("inf")) and not has_come(0.0, 1e-300)
