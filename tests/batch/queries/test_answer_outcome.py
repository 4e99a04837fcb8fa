"""The requirements of searches and tunings are judged in the cases of their answer, wherever a verdict is said."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.queries.answer_outcome import AnswerOutcome, answer_outcome
from batch.queries.evidence import evidence
from batch.queries.evidence_table import requirement_evidence
from batch.queries.search_answers import SearchAnswer
from batch.queries.summary import summary_of
from batch.report import report
from met.cli import main
from tests.batch.slider import swing

# far = 0.1 m cos(t sqrt(k/m)) after t = 1 s, and top = 0.1 m sqrt(k/m) from half a turn on.
RUN = swing(
    "integrator = rk4;",
    "metric far = final { of = slide.q; }",
    "metric off = final { of = abs(slide.q); }",
    "metric top = max { of = slide.qd; }",
    "require far > -0.05 m in 95 % of cases with 60 % confidence;",
    "require far > -0.05 m;",
    "require top < 1 m/s;",
)
DECK = (
    RUN
    + """\
sweep loads of swing { sample random(5) { links.block.mass = uniform(1, 3) kg; } }
tune still of swing {
    choose environment.held.stiffness = between(2, 9) N/m;  against loads;  minimise off;  at_most = 120;
}
tune poor of swing {
    choose environment.held.stiffness = between(18, 25) N/m;  against loads;  minimise off;  at_most = 60;
}
tune alone of swing { choose environment.held.stiffness = between(2, 9) N/m;  minimise off;  at_most = 60; }
search back of swing { minimise far;  environment.held.stiffness = between(5, 79) N/m;  at_most = 60; }
search quick of swing { maximise top;  environment.held.stiffness = between(5, 78) N/m;  at_most = 60; }
search calm of swing { maximise off;  environment.held.stiffness = between(2, 5) N/m;  at_most = 60; }
"""
)
NAMES = ("still", "poor", "alone", "back", "quick", "calm")


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("answers")
    (folder / "d.ic").write_text(DECK, encoding="utf-8")
    return batch.run(ic.compile(folder / "d.ic", select=NAMES), output=folder / "a.h5", threads=1).path


def group_of(file: ArchiveFile, name: str) -> tuple[ArchiveGroup, SearchAnswer, AnswerOutcome]:
    group = next(each for each in file.groups if each.name == name)
    answer = SearchAnswer.of(group)
    assert answer is not None
    return group, answer, answer_outcome(answer)


@pytest.mark.release
def test_a_tuning_is_judged_in_the_cases_of_its_sweep(archive: Path) -> None:
    with ArchiveFile(archive) as file:
        group, answer, outcome = group_of(file, "still")
        cases, far = list(answer.best.cases), group.values("far")
        assert outcome.ok and outcome.headline == "The answer meets all requirements in all 5 cases of loads"
        [first, second] = outcome.requirements
        worst = cases[int(np.argmin(far[cases]))]
        assert (first.text, first.met, first.missed, first.case) == ("far > -0.05 m", 5, 0, group.values("case")[worst])
        assert (
            first.outcome_with_value.startswith("met in all 5 cases of loads; worst ") and second.text == "top < 1 m/s"
        )


@pytest.mark.slow
def test_a_tuning_says_which_requirement_it_misses_and_in_which_case(archive: Path) -> None:
    with ArchiveFile(archive) as file:
        group, answer, outcome = group_of(file, "poor")
        missed = [case for case in answer.best.cases if not group.values("far")[case] > -0.05]
        assert missed and not outcome.ok and not summary_of(group).ok
        worst = min(missed, key=lambda case: group.values("far")[case])
        where = f"case #{worst}" if len(missed) == 1 else f"{len(missed)} cases"
        assert outcome.headline == f"The answer misses far > -0.05 m in {where} of loads"
        [first, _] = outcome.requirements
        assert first.outcome_with_value.startswith(f"missed in {len(missed)} of 5 cases of loads; worst ")
        assert first.outcome_with_value.endswith(f", case #{worst}")


@pytest.mark.slow
def test_a_tuning_without_a_sweep_is_judged_in_its_case(archive: Path) -> None:
    with ArchiveFile(archive) as file:
        _, answer, outcome = group_of(file, "alone")
        assert outcome.headline == "The answer meets all requirements"
        assert re.fullmatch(rf"met; worst .* m, case #{answer.position}", outcome.requirements[0].outcome_with_value)


@pytest.mark.slow
def test_a_search_is_judged_in_the_worst_case_that_it_found(archive: Path) -> None:
    with ArchiveFile(archive) as file:
        _, answer, outcome = group_of(file, "back")
        assert not outcome.ok
        assert outcome.headline == f"The worst case found, #{answer.position}, misses far > -0.05 m"
        assert (
            outcome.requirements[0].outcome_with_value
            == f"missed in the worst case found: -0.1 m, case #{answer.position}"
        )
        _, answer, outcome = group_of(file, "calm")
        assert outcome.ok and outcome.headline == f"The worst case found, #{answer.position}, meets all requirements"


@pytest.mark.slow
def test_a_search_says_what_another_case_misses(archive: Path) -> None:
    """The quickest case swings a whole turn, and those of half a turn are far back."""
    with ArchiveFile(archive) as file:
        group, answer, outcome = group_of(file, "quick")
        assert not outcome.ok and not summary_of(group).ok
        least = int(np.argmin(group.values("far")))
        assert outcome.headline == (
            f"The worst case found, #{answer.position}, meets all requirements, "
            "but another that was tried misses far > -0.05 m"
        )
        assert outcome.requirements[0].outcome_with_value.endswith(f", case #{least}")
        assert "; but missed in another: " in outcome.requirements[0].outcome_with_value
        assert outcome.requirements[0].elsewhere and not outcome.requirements[1].elsewhere


@pytest.mark.release
@pytest.mark.parametrize("name", NAMES)
def test_a_requirement_over_a_share_is_asked_of_each_case_and_stands_once(archive: Path, name: str) -> None:
    with ArchiveFile(archive) as file:
        group, answer, _ = group_of(file, name)
        summary = summary_of(group)
        assert [each.text for each in summary.requirements] == ["far > -0.05 m", "top < 1 m/s"]
        assert not any(each.evidence for each in summary.requirements) and not evidence(group)
        assert {each.met + each.missed for each in summary.requirements} == {len(answer.best.cases)}
        rows = requirement_evidence([group], "a.h5")
        assert [row.requirement for row in rows] == ["far > -0.05 m", "top < 1 m/s"]
        for row in rows:
            assert row.cases == len(answer.best.cases) and row.share is None and row.confidence is None
            assert row.at_least is None and row.at_most is None and row.at == "" and not row.test


@pytest.mark.slow
def test_some_cases_of_a_tuning_are_held_without_a_confidence_too(archive: Path, tmp_path: Path) -> None:
    plan = ic.compile(archive.parent / "d.ic", select=["still"])
    part = batch.run(plan, output=tmp_path / "b.h5", cases=[0, 1, 2]).path
    with ArchiveFile(part) as file:
        assert SearchAnswer.of(file.groups[0]) is None and not evidence(file.groups[0])
        rows = requirement_evidence(file.groups, "b.h5")
        assert all(row.at_least is None and row.share is None and row.cases == 3 for row in rows)


@pytest.mark.release
@pytest.mark.parametrize(("name", "word", "said"), [
    ("still", "Requirements met", "The answer meets all requirements in all 5 cases of loads."),
    ("poor", "Requirements not met", "The answer misses far &gt; -0.05 m in "),
    ("calm", "No miss found", "The worst case found, #"),
    ("back", "A miss was found", "misses far &gt; -0.05 m."),
])  # fmt: skip
def test_a_report_opens_with_the_answer_and_has_no_share(
    archive: Path, tmp_path: Path, name: str, word: str, said: str
) -> None:
    page = report(archive, tmp_path / "r.html", experiments=[name]).read_text(encoding="utf-8")
    opens = page[page.index('id="verdict"', page.index("<main")) :].partition("</section>")[0]
    assert word in opens and said in opens
    assert f"verdict {'yes' if word in ('Requirements met', 'No miss found') else 'no'}" in opens
    assert 'class="share"' not in opens and "yield" not in opens and 'class="bar"' not in opens
    assert opens.count("far &gt; -0.05 m</code>") == 1
    assert "<h2>Evidence</h2>" not in page and "demonstrated" not in page.partition("<script")[0]


@pytest.mark.slow
def test_the_terminal_says_the_requirements_of_the_answer(archive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", str(archive), "--run", "still"]) == 0
    said = capsys.readouterr().out
    assert "\n  The answer meets all requirements in all 5 cases of loads.\n" in said
    assert "  require far > -0.05 m  met in all 5 cases of loads; worst " in said
    assert said.count("  require ") == 2 and "confidence" not in said and "met by " not in said
    assert main(["show", str(archive), "--run", "still", "--evidence"]) == 0
    said = capsys.readouterr().out
    assert "\nstill: its answer, 5 cases of 1" in said and "0 of 5" in said and "confidence" not in said


@pytest.mark.slow
def test_programs_are_told_the_requirements_of_the_answer(archive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", str(archive), "--run", "still", "--format", "json"]) == 0
    [told] = json.loads(capsys.readouterr().out)["experiments"]
    assert told["ok"] and [each["met"] for each in told["requirements"]] == [5, 5]
    assert told["requirements"][0]["said"].startswith("met in all 5 cases of loads")
    assert [row["cases"] for row in told["evidence"]] == [5, 5]


@pytest.mark.release
def test_notebooks_say_the_requirements_of_the_answer(archive: Path) -> None:
    data = batch.open(archive)["still"]
    said = str(data.met)
    assert "\n  The answer meets all requirements in all 5 cases of loads\n" in said
    assert "\n  require far > -0.05 m: met in all 5 cases of loads; worst " in said
    assert "met by" not in said
    assert data.met.evidence()["cases"].tolist() == [5, 5]


@pytest.mark.slow
def test_the_exit_status_of_a_run_is_that_of_its_answers(archive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    deck = str(archive.parent / "d.ic")
    output = ["-o", str(archive.parent / "run.h5"), "--no-picture", "--fresh"]
    assert main(["run", deck, "still", *output]) == 0
    assert main(["run", deck, "quick", *output]) == 1
    assert capsys.readouterr().out.endswith("exit 1: not met everywhere: far > -0.05 m\n")
    assert main(["run", deck, "poor", *output]) == 1
    assert capsys.readouterr().out.endswith("exit 1: `poor` found nothing that meets all\n")


@pytest.mark.slow
def test_what_a_search_depends_on_is_no_question_to_its_cases(
    archive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sensitivity", str(archive), "--run", "still"]) == 2
    assert capsys.readouterr().err == (
        "error[E361]: the cases of `still` were chosen by its search, and are no sample of what may be\n"
        " = help: a sweep draws one: `sweep NAME of RUN { sample random(1000) { PATH = uniform(LOW, HIGH) UNIT; } }`\n"
        "\n1 error\n"
    )
    page = report(archive, tmp_path / "r.html", experiments=["still"]).read_text(encoding="utf-8")
    assert "Which parameters matter" not in page
