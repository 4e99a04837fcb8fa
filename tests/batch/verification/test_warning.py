"""Warnings of what the step decides: each whole, with case, metric, place and the step that would do."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.queries.step_errors.warning import warnings
from batch.queries.summary import as_json, summarise
from batch.queries.warnings import campaign_warnings
from batch.terminal.running import run_and_tell
from batch.terminal.show import show
from met.diagnostic import Diagnostic
from met.plan import Plan

DECK = """#include <two_link.ic>
run brief like nominal {
    duration = 3 s;
    metric turn = final { of = elbow.q; }
    require turn < 0.0721 rad;
}
sweep gain of brief { vary gearbox.kp = [0.02, 0.021, 0.03] V*s/rad; }
"""


def planned(here: Path, text: str = DECK, run: str = "brief") -> Plan:
    deck = here / "d.ic"
    deck.write_text(text)
    return ic.compile(deck, select=[run])


def warned(path: Path, plan: Plan | None = None) -> list[Diagnostic]:
    with ArchiveFile(path) as file:
        experiments = {} if plan is None else {each.name: each for each in plan.experiments}
        return campaign_warnings(file.groups, experiments)


def changed(path: Path, change: Callable[[h5py.Group], None]) -> Path:
    with h5py.File(path, "r+") as file:
        change(file["verification"])
    return path


@pytest.mark.slow
def test_a_margin_below_the_error(tmp_path: Path) -> None:
    plan = planned(tmp_path)
    path = batch.run(plan, output=tmp_path / "a.h5", verify="some").path
    [found] = warned(path, plan)
    assert (found.code, found.severity) == ("D310", "warning")
    assert found.message == (
        "the step decides whether `turn < 0.0721 rad` is met: "
        "`turn` of case #0 is 0.07208 rad ± 0.00015 rad by the step"
    )
    assert found.at is not None and (found.at.place.line, found.at.place.column) == (5, 5)
    assert found.help == (
        "`rates { dynamics = 100 Hz; }` would do, for an error below the 2.364e-05 rad that are left",
    )


@pytest.mark.slow
def test_one_that_the_run_allows_is_not_given(tmp_path: Path) -> None:
    plan = planned(tmp_path, DECK.replace("0.0721 rad;", '0.0721 rad; allow D310 because "the limit is soft";'))
    given = ic.check(tmp_path / "d.ic").diagnostics
    assert "D333" not in [each.code for each in given], "only the run itself shows whether it is needed"
    path = batch.run(plan, output=tmp_path / "a.h5", verify="some").path
    assert warned(path, plan) == warned(path) == []
    with ArchiveFile(path) as file:
        assert file.groups[0].allows("D310") and not file.groups[0].allows("D311")
        assert "D310, because the limit is soft" in show(file)


@pytest.mark.release
def test_the_step_that_is_named_would_do(tmp_path: Path) -> None:
    """At the rate that the warning names, there is none, and the metric is nearer to the truth than the margin was."""
    refined = DECK.replace("duration", "rates { dynamics = 100 Hz; servos = 100 Hz; record = 25 Hz; } duration")
    coarse = batch.run(planned(tmp_path), output=tmp_path / "a.h5", verify="none").path
    path = batch.run(planned(tmp_path, refined), output=tmp_path / "b.h5", verify="some").path
    assert warned(path) == []
    with ArchiveFile(coarse) as first, ArchiveFile(path) as second:
        a, b = (float(file.groups[0].values("turn")[0]) for file in (first, second))
        known = file_error(second)
    assert 0.0 < known < abs(0.0721 - b) and abs(a - b) < 4e-4


def file_error(file: ArchiveFile) -> float:
    [summary] = summarise(file)
    assert summary.verified is not None
    return summary.verified.metrics["turn"].error


@pytest.mark.slow
def test_a_limit_that_is_far_warns_of_nothing(tmp_path: Path) -> None:
    plan = planned(tmp_path, DECK.replace("0.0721", "0.09"))
    assert warned(batch.run(plan, output=tmp_path / "a.h5", verify="some").path, plan) == []


@pytest.mark.slow
def test_what_is_turned_round_by_another_step_is_told_of_the_worst_case(tmp_path: Path) -> None:
    plan = planned(tmp_path, DECK.replace("0.0721", "0.09"), "gain")
    path = batch.run(plan, output=tmp_path / "a.h5", verify="all").path

    def never(node: h5py.Group) -> None:
        column = list(node["verified_metric"].asstr()).index("settle")
        node["half"][1:, column] = math.inf

    [found] = warned(changed(path, never), plan)
    assert found.code == "D310"
    assert found.message == (
        "the step decides whether `settle < 10 s` is met: "
        "`settle` of case #1 is 2.28 s at the step, infinite at half of it"
    )
    assert found.help == (
        "it is not known which step would do; `rates { dynamics = 100 Hz; }` shows more of it",
        "so it is in 2 of the 3 verified cases",
    )


@pytest.mark.slow
def test_a_metric_that_changes_with_the_step_and_not_as_the_integrator_does(tmp_path: Path) -> None:
    plan = planned(tmp_path, DECK.replace("    require turn < 0.0721 rad;\n", ""))
    path = batch.run(plan, output=tmp_path / "a.h5", verify="some").path

    def grows(node: h5py.Group) -> None:
        column = list(node["verified_metric"].asstr()).index("turn")
        node["half"][0, column], node["quarter"][0, column] = 0.0715, 0.07

    assert warned(path, plan) == []
    [found] = warned(changed(path, grows), plan)
    assert (found.code, found.severity) == ("D311", "warning")
    assert found.message == (
        "`turn` of case #0 depends on the step: it is 0.07208 rad, 0.0715 rad at half of the step, and 0.07 rad at a "
        "quarter"
    )
    assert found.at is not None and found.at.place.line == 4
    assert found.help == ("it is not known which step would do; `rates { dynamics = 100 Hz; }` shows more of it",)


@pytest.mark.slow
def test_what_lies_between_samples_is_no_change_with_the_step(tmp_path: Path) -> None:
    """Where the three values are the same, nothing depends on the step; a requirement within it is undecided."""
    for required, codes in (("", []), ("    require turn < 0.09 rad;\n", ["D310"])):
        plan = planned(tmp_path, DECK.replace("    require turn < 0.0721 rad;\n", required))
        path = batch.run(plan, output=tmp_path / f"{len(required)}.h5", verify="some").path

        def misses(node: h5py.Group) -> None:
            node["missed"][0, list(node["verified_metric"].asstr()).index("turn")] = 0.02

        assert warned(path, plan) == []
        assert [found.code for found in warned(changed(path, misses), plan)] == codes


@pytest.mark.slow
def test_a_large_change_is_told_although_the_integrator_explains_it(tmp_path: Path) -> None:
    plan = planned(tmp_path, DECK.replace("    require turn < 0.0721 rad;\n", ""))
    path = batch.run(plan, output=tmp_path / "a.h5", verify="some").path

    def falls(size: float) -> Callable[[h5py.Group], None]:
        def change(node: h5py.Group) -> None:
            column = list(node["verified_metric"].asstr()).index("turn")
            node["half"][0, column], node["quarter"][0, column] = 0.07208 + size, 0.07208 + 1.25 * size

        return change

    assert warned(changed(path, falls(0.003)), plan) == []  # an error of 5.5 %
    [found] = warned(changed(path, falls(0.006)), plan)
    assert found.code == "D311" and "0.07808 rad at half of the step, and 0.07958 rad at a quarter" in found.message
    assert found.help == ("`rates { dynamics = 100 Hz; }` would do, for an error below 1 %",)


@pytest.mark.slow
@pytest.mark.parametrize(("share", "said", "rate"), [("half", "half", 50), ("quarter", "a quarter", 100)])
def test_a_case_that_fails_with_a_shorter_step(tmp_path: Path, share: str, said: str, rate: int) -> None:
    plan = planned(tmp_path, DECK.replace("0.0721", "0.09"), "gain")
    path = batch.run(plan, output=tmp_path / "a.h5", verify="all").path

    def fails(node: h5py.Group) -> None:
        node[share][1:] = math.nan

    [found] = warned(changed(path, fails), plan)
    assert (found.code, found.severity) == ("D312", "warning")
    assert found.message == f"case #1 reaches its end at the step of 40 ms, and does not at {said} of it"
    assert found.at is not None and found.at.place.line == 7
    assert found.help == (
        f"`rates {{ dynamics = {rate} Hz; }}` shows why it fails",
        "so it is in 2 of the 3 verified cases",
    )


@pytest.mark.slow
def test_a_case_that_fails_with_a_shorter_step_is_none_of_the_campaign_s_failures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from batch.campaigns.verification import verifying
    from met import run as engine

    runs = engine.run

    def fails(experiment: object, *args: object, **options: object) -> object:
        found = runs(experiment, *args, **options)  # type: ignore[arg-type]
        for values in found.metrics.values():
            values[:] = math.nan
        return found

    monkeypatch.setattr(verifying.engine, "run", fails)
    archive = batch.run(planned(tmp_path), output=tmp_path / "a.h5", verify="some")
    assert archive.ok and archive.summaries[0].failed == 0
    assert [each.code for each in warned(archive.path)] == ["D312"]


@pytest.mark.slow
def test_people_and_programs_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    planned(tmp_path)
    assert run_and_tell("d.ic", ("brief",), verify="some", no_picture=True)
    said = capsys.readouterr()
    assert "warning[D310]: the step decides" in said.err and " --> d.ic:5:5\n" in said.err
    assert "D310" not in said.out
    assert run_and_tell("d.ic", ("brief",), verify="some", no_picture=True, quiet=True)
    assert "D310" not in capsys.readouterr().err
    with ArchiveFile(tmp_path / "d.brief.h5") as file:
        lines = show(file)
        [summary] = summarise(file)
        assert warnings(file.groups[0]) == list(summary.warnings)
    assert "  warning[D310]: the step decides whether `turn < 0.0721 rad` is met" in lines
    assert [each["code"] for each in json.loads(json.dumps(as_json(summary)))["warnings"]] == ["D310"]
    assert run_and_tell("d.ic", ("brief",), verify="none", no_picture=True, fresh=True)
    assert "D310" not in capsys.readouterr().err
