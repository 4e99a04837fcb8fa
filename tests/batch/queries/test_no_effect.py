"""Axes of a sweep that change no metric are warned of once the cases are run, and others are not."""

from __future__ import annotations

from pathlib import Path

import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.queries.warnings import campaign_warnings

DECK = """deck 2;
arm a {
    link b { mass = 1 kg;  shape = box(size = [0.2, 0.1, 0.1] m); }
    joint j revolute { parent = base;  child = b;  axis = z; }
}
servo s { model = ideal;  bandwidth = 20 1/s;  command = position(ramp(to = 1 rad, over = 0.5 s)); }
run r {
    arm = a;  servos { j = s; }  rates { dynamics = 100 Hz;  servos = 100 Hz; }  duration = 1 s;
    record = [];  metric over = overshoot { of = j.q;  target = 1 rad; }  metric last = final { of = j.q; }
}
"""
MASS, COM, BANDWIDTH = "links.b.mass", "links.b.com.x", "s.bandwidth"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("varied", "idle"),
    [
        ("vary links.b.mass = [1, 2, 3] kg;  vary s.bandwidth = [10, 20] 1/s;", [MASS]),
        ("zip { links.b.mass = [1, 2] kg;  links.b.com.x = [1, 2] cm; }", [MASS, COM]),
        ("zip { links.b.mass = [1, 2] kg;  s.bandwidth = [10, 20] 1/s; }", []),
        ("sample lhs(4) { links.b.mass = uniform(1, 2) kg;  links.b.com.x = uniform(1, 2) cm; }", [MASS, COM]),
        ("sample lhs(4) { links.b.mass = uniform(1, 2) kg;  s.bandwidth = uniform(10, 20) 1/s; }", []),
        ("vary links.b.mass = [1, 2] kg;  exclude when links.b.mass > 1.5 kg;", []),
        ('vary links.b.mass = [1, 2] kg;  allow D329 because "it is shown so";', []),
    ],
)
def test_axes_that_change_no_metric_are_told(tmp_path: Path, varied: str, idle: list[str]) -> None:
    path = tmp_path / "deck.ic"
    allowed = varied.partition("allow")[2]
    text = DECK.replace("record = [];", f"allow{allowed} record = [];") if allowed else DECK
    seed = "seed = 1;  " if "sample" in varied else ""
    path.write_text(f"{text}default sweep w of r {{ {seed}{varied.partition('allow')[0]} }}\n")
    plan = ic.compile(path)
    with ArchiveFile(batch.run(plan, output=tmp_path / "a.h5", verify="none").path) as file:
        found = campaign_warnings(file.groups, {each.name: each for each in plan.experiments})
    assert [each.code for each in found] == ["D329"] * bool(idle)
    if idle:
        (told,) = found
        assert told.message.startswith(f"`{idle[0]}` changes no metric of any case: at its ")
        assert told.message.endswith("all else the same, the 2 metrics are the same to 9 digits")
        assert told.help[1:] == ((f"the same of `{idle[1]}`",) if idle[1:] else ())
        assert told.at is not None and told.at.place.file == str(path)


SWING = """deck 2;
let along = 0 m;
arm a {
    link b { mass = 1 kg;  com = [0.11 m + along, 0.03 m + 2*along, 3*along];  inertia = [0.01, 0.02, 0.03] kg*m^2; }
    joint j revolute { parent = base;  child = b;  axis = [1, 2, 3]; }
}
run r {
    arm = a;  initial { j.q = 1 rad; }  environment { gravity = [0, -9.81, 0] m/s^2; }
    rates { dynamics = 100 Hz; }  duration = 1 s;  record = [];  metric last = final { of = j.q; }
}
default sweep w of r { vary along = [0, 0.1, 0.7] m; }
"""
"""A deck whose sweep moves a centre of mass along the joint's axis: the motion stays, but for rounding."""
LATE = "metric late = settling_time { of = j.q;  target = 99 rad;  band = 1 %; }"


@pytest.mark.slow
@pytest.mark.parametrize("more", ["", LATE])
def test_a_change_by_rounding_is_none_and_of_a_metric_without_a_value_nothing_is_said(
    tmp_path: Path, more: str
) -> None:
    plan = ic.compile(text=SWING.replace("metric last", f"{more}  metric last"))
    with ArchiveFile(batch.run(plan, output=tmp_path / "a.h5", verify="none").path) as file:
        found = campaign_warnings(file.groups, {each.name: each for each in plan.experiments})
        last = next(
            file.groups[0].values(each.name) for each in file.groups[0].role("metric") if each.name.endswith("last")
        )
    assert 0.0 < abs(last - last[0]).max() < 1e-12
    assert [each.code for each in found if each.code == "D329"] == ["D329"] * (not more)
