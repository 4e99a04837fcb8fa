"""What people read of errors by the step: beside metrics, in reports, and of differences."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.differences.data import as_data
from batch.differences.text import diff_lines
from batch.queries.step_errors.figures import (
    NONE,
    CaseError,
    MetricError,
    Verification,
    about,
    case_error,
    error_text,
    figures,
    of_difference,
    together,
)
from batch.queries.summary import as_json, summarise
from batch.report.contents.gathering import gather
from batch.report.html.page import page
from batch.terminal.show import verdict
from met.analysis.step_error import StepError

SWEEP = """#include <two_link.ic>
run brief like nominal { duration = 2 s; metric turn = final { of = elbow.q; } }
sweep gain of brief { vary gearbox.kp = linspace(0.010, 0.040, 6) V*s/rad; }
"""


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made(tmp_path_factory.mktemp("verified"), "a", "some")


def made(
    here: Path, name: str, verify: str, deck: str = SWEEP, run: str = "gain", given: dict[str, object] | None = None
) -> Path:
    return batch.run(
        ic.compile(text=deck, select=[run], set=given or {}), output=here / f"{name}.h5", verify=verify
    ).path


def metric(*errors: StepError | None) -> MetricError:
    cases = tuple(CaseError(n, 1.0, 1.0, 1.0, error, "" if error else "no value") for n, error in enumerate(errors))
    known = [error for error in errors if error is not None]
    worst = max(known, key=lambda error: error.error, default=StepError(math.nan, math.nan, True))
    lost = len(errors) - len(known)
    return MetricError(
        worst.error, 0, worst.order, all(e.clear for e in known), lost, "no value" if lost else "", cases
    )


CLEAR, BLURRED = StepError(1.2345e-4, 2.04, True), StepError(0.02, 0.4, False)


def test_an_error_has_two_digits_in_the_metric_s_unit() -> None:
    assert error_text(metric(CLEAR)) == "0.00012"
    assert error_text(metric(CLEAR), 1e-3) == "0.12"
    assert error_text(None) == error_text(metric(None)) == NONE
    assert error_text(metric(StepError(math.inf, math.nan, False))) == NONE


def test_the_line_beneath_says_order_what_is_unclear_and_what_is_not_known() -> None:
    found = Verification(2, 2, 0.01, {"a": metric(CLEAR, CLEAR), "b": metric(CLEAR, BLURRED), "c": metric(CLEAR, None)})
    assert about(found) == (
        "± by the step: 2 cases at half and a quarter of the step, order 2.0; order unclear in 1 of 5 numbers, where "
        "it is a rough bound: b; of c not known in 1: no value"
    )
    alone = Verification(1, 2, 0.01, {"a": metric(None)})
    assert about(alone) == "± by the step: 1 case at half and a quarter of the step; of a not known: no value"


def test_structures_are_told_of_together() -> None:
    one = Verification(2, 2, 0.01, {"a": metric(CLEAR), "b": metric(None)})
    other = Verification(3, 2, 0.01, {"a": metric(BLURRED), "b": metric(CLEAR)})
    found = together([one, None, other])
    assert found is not None and found.cases == 5
    assert (found.metrics["a"].error, found.metrics["a"].clear) == (0.02, False)
    assert (found.metrics["b"].error, found.metrics["b"].unknown) == (CLEAR.error, 1)
    assert together([None, one]) is one and together([None]) is None


@pytest.mark.slow
def test_no_sign_stands_beside_what_is_never_reached(tmp_path: Path) -> None:
    never = "#include <two_link.ic>\nrun brief like nominal { duration = 1 s; }\n"
    with ArchiveFile(made(tmp_path, "n", "some", never, "brief")) as file:
        [summary] = summarise(file)
    lines = list(verdict(summary, 100))
    [settle] = [line for line in lines if line.startswith("  settle")]
    assert "inf" in settle and "±" not in settle
    assert any("of settle not known: infinite at every step" in line for line in lines)


@pytest.mark.slow
def test_programs_read_the_same(archive: Path) -> None:
    with ArchiveFile(archive) as file:
        [summary] = summarise(file)
    told = json.loads(json.dumps(as_json(summary), allow_nan=False))["verified"]
    assert summary.verified is not None
    assert (told["cases"], told["order"], told["step"]) == (summary.verified.cases, 2, 0.04)
    turn = summary.verified.metrics["turn"]
    assert told["metrics"]["turn"]["error"] == turn.error and told["metrics"]["turn"]["case"] == turn.case


def test_a_report_has_a_column_and_a_sentence(archive: Path) -> None:
    with ArchiveFile(archive) as file:
        found = gather(file, (), "")
        verified = figures(file.groups[0])
    assert verified is not None
    [section] = found.sections
    assert section.by_step == about(verified)
    assert [row.by_step for row in section.metrics] == [
        error_text(verified.metrics[row.name]) for row in section.metrics
    ]
    html = str(page(found))
    assert html.count("± by the step</th>") == 1 and f"{about(verified)}.".replace("'", "&#x27;") in html


@pytest.mark.slow
def test_a_report_of_what_was_not_verified_says_nothing_of_it(tmp_path: Path) -> None:
    with ArchiveFile(made(tmp_path, "n", "none")) as file:
        assert "by the step" not in str(page(gather(file, (), "")))


BRIEF = "#include <two_link.ic>\nrun brief like nominal { duration = 2 s; metric turn = final { of = elbow.q; } }\n"


@pytest.mark.release
def test_a_difference_below_the_errors_says_so(tmp_path: Path) -> None:
    a = made(tmp_path, "a", "some", BRIEF, "brief")
    b = made(tmp_path, "b", "some", BRIEF, "brief", {"gearbox.kp": "0.020001 V*s/rad"})
    found = batch.diff(a, b)
    [experiment] = found.experiments
    turn = next(signal for signal in experiment.signals if signal.name == "turn")
    with ArchiveFile(a) as first, ArchiveFile(b) as second:
        errors = of_difference(figures(first.groups[0]), figures(second.groups[0]))
    assert 0.0 < turn.largest <= turn.by_step == errors["turn"]
    [note] = [note for note in experiment.notes if "by the step" in note]
    assert "`turn`" in note and note.endswith("by the step: with shorter steps the difference may be another")
    assert f"  note: {note}" in diff_lines(found)
    [told] = [each for each in as_data(found)["experiments"][0]["signals"] if each["name"] == "turn"]
    assert told["by_step"] == turn.by_step
    assert "± " in "\n".join(diff_lines(found)) and found.verdict == "different"


@pytest.mark.release
def test_a_difference_above_the_errors_is_none_of_them(tmp_path: Path) -> None:
    a = made(tmp_path, "a", "some", BRIEF, "brief")
    b = made(tmp_path, "b", "some", BRIEF, "brief", {"gearbox.kp": "0.06 V*s/rad"})
    [experiment] = batch.diff(a, b).experiments
    turn = next(signal for signal in experiment.signals if signal.name == "turn")
    assert turn.largest > turn.by_step > 0.0 and not turn.within_step_error


def test_overflow_of_a_difference_is_no_error() -> None:
    found = case_error(0, (1e308, -1e308, 1e308), 2, 0.0)
    assert found.error is None or not math.isfinite(found.error.error)
