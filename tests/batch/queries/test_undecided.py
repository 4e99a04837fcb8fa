"""Requirements of times after a run's end: judged where the time has come, and warned of where it has not (D341)."""

from __future__ import annotations

from pathlib import Path

import pytest

import ic
from batch.archive.read import ArchiveFile
from batch.campaigns.campaign import prepare
from batch.campaigns.performing import perform
from batch.executors.threads import Threads
from batch.queries.warnings import campaign_warnings
from met.diagnostic import Diagnostic

DECK = """\
arm one { link b { mass = 1 kg; com = [0, 0, 0] m; inertia = [1, 1, 1] kg*m^2; }
    joint j revolute { parent = base; child = b; axis = z; } }
servo exact { model = ideal;  bandwidth = 10 1/s;  command = position(1 rad); }
run go {
    arm = one;  servos { j = exact; }  rates { dynamics = 100 Hz;  servos = 100 Hz; }  duration = 2 s;  record = [q];
    metric settle = settling_time { of = j.q;  target = 1 rad; }
    require settle < 5 s;
}
run other like go {
    metric far = settling_time { of = j.q;  target = 3 rad; }
    metric near = settling_time { of = j.q;  target = 3 rad; }
    require far < 4 s;
    require near < 1 s;
    allow D297 because "what never comes is judged";
}
run still like go { settle { within = 3 rad; } }
run meant like still { allow D341 because "it shall stay"; }
run allowed like other { allow D341 because "seen elsewhere"; }
sweep stays of still { vary j.servo.command.to = [1, 2] rad; }
sweep ways of go { vary j.servo.command.to = [1, 2, 3] rad; }
"""


def warned(folder: Path, name: str) -> list[Diagnostic]:
    (folder / "deck.ic").write_text(DECK.replace("position(1 rad)", "position(step(to = 1 rad, at = 0.1 s))"))
    assert ic.check(folder / "deck.ic").diagnostics == ()
    plan = ic.compile(folder / "deck.ic", select=[name])
    perform(prepare(plan, output=folder / "a.h5", verify="none"), executor=Threads(1))
    with ArchiveFile(folder / "a.h5") as file:
        return campaign_warnings(file.groups, {each.name: each for each in plan.experiments})


@pytest.mark.slow
def test_what_comes_within_the_run_is_judged_and_not_warned_of(tmp_path: Path) -> None:
    assert warned(tmp_path, "go") == []


@pytest.mark.slow
def test_what_has_not_come_by_the_end_is_warned_of_unless_that_is_late_enough(tmp_path: Path) -> None:
    [found] = warned(tmp_path, "other")
    assert (found.code, found.severity) == ("D341", "warning")
    assert found.message == (
        "`require far < 4 s` looks beyond this run, which ends at 2 s: `far` is not seen by then, and it may yet come"
    )
    assert found.at is not None and found.at.place.line == 12
    assert found.help == ("let the run last longer, or write an earlier limit",)
    assert warned(tmp_path, "allowed") == []


@pytest.mark.slow
def test_of_a_sweep_the_cases_in_which_it_has_not_come_are_counted(tmp_path: Path) -> None:
    [found] = warned(tmp_path, "ways")
    assert "`settle` is not seen by then in 2 of 3 cases, and it may yet come" in found.message


@pytest.mark.slow
@pytest.mark.parametrize(("name", "told"), [("still", True), ("stays", True), ("meant", False)])
def test_what_settles_without_having_left_its_band_is_told(tmp_path: Path, name: str, told: bool) -> None:
    found = [each for each in warned(tmp_path, name) if each.code != "D329"]
    assert [each.code for each in found] == ["D341"] * told
    if told:
        assert found[0].message == (
            "`require settle < 5 s` is met from the start: `settle` is 0 s, since its signal left the band at no time"
        )
        assert found[0].at is not None and found[0].at.place.line == 7
