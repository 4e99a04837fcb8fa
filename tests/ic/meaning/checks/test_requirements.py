"""Requirements that say nothing are warned of: decided before the run, or about what the run cannot show."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from met import models
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, shown

METRICS = """\
    metric most   = peak { of = hinge.qd; }
    metric end    = final { of = hinge.qd; }
    metric settle = settling_time { of = hinge.qd; target = 0.1 rad/s; }
    metric over   = overshoot { of = hinge.qd; target = 0.1 rad/s; }
"""


def requiring(text: str) -> str:
    """The run with metrics, and with this before its end."""
    return changed(RUN, ("[q];\n", f"[q];\n{METRICS}    {text}\n"))


def test_a_limit_where_the_metric_never_is(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, ARM, SERVO, requiring("require most >= 0 rad/s;"))
        == """\
warning[D340]: `require most >= 0 rad/s` cannot be missed: a metric `peak` is never below 0
  --> deck.ic:21:5
   |
21 |     require most >= 0 rad/s;
   |     ^^^^^^^
   = help: write a limit that it may pass, or leave it out
"""
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("require most < 0 rad/s;", ["D340"]),
        ("require most <= -1 rad/s;", ["D340"]),
        ("require most > -1 rad/s;", ["D340"]),
        ("require most <= 0 rad/s;", []),
        ("require most > 0 rad/s;", []),
        ("require end > -1 rad/s; require end < 0 rad/s;", []),
        ("require end > 1 rad/s; require end < 0 rad/s;", ["D340"]),
        ("require end >= 1 rad/s; require end <= 1 rad/s;", []),
        ("require end >= 1 rad/s; require end < 1 rad/s;", ["D340"]),
        ("require settle < 1 s;", []),
        ("require settle < 1.1 s;", []),
        ("require over < 2 %;", []),
    ],
)
def test_what_is_told(tmp_path: Path, text: str, expected: list[str]) -> None:
    assert codes(tmp_path, ARM, SERVO, requiring(text)) == expected


VOLTS = "metric volts = peak { of = hinge.servo.voltage; } metric low = min { of = *.servo.voltage; } "
EFFORT = "metric effort = peak { of = hinge.tau; } "
OFF = "metric off = rms { of = 2 * abs(hinge.servo.voltage) - hinge.servo.voltage; } "
"""Channels that the amplifier keeps within 24 V, and an expression that it keeps within -24 V and 72 V."""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (VOLTS + "require volts <= 24 V;", "missed: `volts` is never above 24 by `hinge.servo.v_max`"),
        (VOLTS + "require volts < 24 V;", ""),
        (VOLTS + "require volts > 24 V;", "met: `volts` is never above 24 by `hinge.servo.v_max`"),
        (VOLTS + "require volts >= 24 V;", ""),
        (VOLTS + "require volts >= 0 V;", "missed: a metric `peak` is never below 0"),
        (VOLTS + "require low > -30 V;", "missed: `low` is never below -24 by `hinge.servo.v_max`"),
        (VOLTS + "require low < -30 V;", "met: `low` is never below -24 by `hinge.servo.v_max`"),
        (OFF + "require off < 73 V;", "missed: `off` is never above 72 by `hinge.servo.v_max`"),
        (OFF + "require off < 72 V;", ""),
        ("metric room = max { of = hinge.servo.voltage * hinge.qd; } require room < 1e9 V*rad/s;", ""),
        ("require always(abs(hinge.servo.voltage) < 25 V);", "missed: "),
        (EFFORT + "require effort < 101 N*m;", "missed: `effort` is never above 100 by `hinge.servo.ratio`, "),
        (EFFORT + "require effort < 100 N*m;", ""),
    ],
)
def test_a_limit_beyond_what_a_servo_can_give(tmp_path: Path, text: str, said: str) -> None:
    found = check(tmp_path, ARM, SERVO, requiring(text)).diagnostics
    assert [each.code for each in found] == ["D340"] * bool(said)
    assert all(f" cannot be {said}" in each.message for each in found)


def test_friction_that_grows_with_the_rate_leaves_a_torque_unbounded(tmp_path: Path) -> None:
    run = requiring(EFFORT + "require effort < 103 N*m;")
    for friction, expected in (("f_c = 0.02 N*m", ["D340"]), ("f_c = 0.05 N*m", []), ("f_v = 1e-5 N*m*s/rad", [])):
        assert codes(tmp_path, ARM, changed(SERVO, ("j_m =", f"{friction}; j_m =")), run) == expected


def test_a_limit_on_a_joint_that_is_locked(tmp_path: Path) -> None:
    locked = "servo drive { model = locked; }\n"
    start = (
        "[q];\n",
        "[q];\n    initial { hinge.q = 0.2 rad; } metric way = peak { of = hinge.q; }\n    require way < 1 rad;\n",
    )
    [found] = check(tmp_path, ARM, locked, changed(RUN, start)).diagnostics
    assert found.message == "`require way < 1 rad` cannot be missed: `way` is never above 0.2 by `hinge.servo`"
    freed = locked.replace("locked;", "locked; release = 0.5 s;")
    assert codes(tmp_path, ARM, freed, changed(RUN, start)) == []


def test_a_requirement_beside_a_tighter_one(tmp_path: Path) -> None:
    """What was found: a run `like` another loosened a limit, and the old one still held."""
    run = requiring("require end < 1 rad/s;")
    loose = "run loose like hold { require end < 2 rad/s; }\n"
    assert (
        shown(tmp_path, ARM, SERVO, run, loose)
        == """\
warning[D340]: `require end < 2 rad/s` decides nothing: `require end < 1 rad/s` is tighter
  --> deck.ic:23:23
   |
23 | run loose like hold { require end < 2 rad/s; }
   |                       ^^^^^^^
  ::: deck.ic:21:5  the tighter one
   = help: leave one of them out
   = help: one with a name, `require NAME: ...;`, is replaced by one of the same name in a run `like` this
"""
    )
    named = (("require end", "require bound: end"),)
    assert codes(tmp_path, ARM, SERVO, changed(run, *named), changed(loose, *named), select="all") == []
    grades = "require end < 1 rad/s; require grade: end < 2 rad/s; require end < 0.5 rad/s in 90 % of cases;"
    assert codes(tmp_path, ARM, SERVO, requiring(grades)) == []


def test_a_metric_that_begins_on_its_target(tmp_path: Path) -> None:
    run = changed(requiring("require over < 2 %;"), ("duration", "initial { hinge.qd = 0.1 rad/s; }\n    duration"))
    assert (
        shown(tmp_path, ARM, SERVO, run)
        == """\
warning[D341]: `require over < 2 %` cannot be told from this run: `over` is no number, for it begins on its target
  --> deck.ic:22:5
   |
22 |     require over < 2 %;
   |     ^^^^^^^
   = help: let `hinge.qd` begin elsewhere, or choose another metric
"""
    )


WINDOWED = ("max", "min", "peak", "rms")


@pytest.mark.parametrize("name", ["peak", "rms", "overshoot", "settling_time", "final", "min", "max"])
def test_a_metric_is_never_below_its_bound_and_no_number_where_it_says_so(name: str) -> None:
    metric = models.find_own("metric")[name]
    p = SimpleNamespace(target=-0.5, band=0.02, after=0.0, within=math.inf if name in WINDOWED else 0.0)
    for first in (-2.0, -0.5, 0.0, 1.0):
        held = SimpleNamespace(**{each.name: each.start for each in metric.memory})
        for k, x in enumerate(np.array((first, 0.3, -1.0))):
            held = SimpleNamespace(**{**vars(held), **metric.update(p, held, x, 0.1 * k, 0.1 * min(k, 1))})
        with np.errstate(all="ignore"):
            found = float(metric.result(p, held, np.float64(0.2)))
        why = metric.undefined(p, first) if metric.undefined is not None else ""
        assert math.isnan(found) == bool(why)
        assert math.isnan(found) or found >= metric.least
