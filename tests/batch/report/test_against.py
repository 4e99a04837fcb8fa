"""A report against another archive says all that `met diff` says, and each number of it is that of the right case."""

from __future__ import annotations

import math
import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import batch
from batch.archive.read import ArchiveFile
from batch.differences.text import diff_lines
from batch.queries.pool import CaseColumn
from batch.report import report
from batch.report.contents import against as sides
from batch.report.contents.gathering import gather
from batch.report.contents.parts import Report
from batch.report.html.page import page
from met import cli
from met.plan import Experiment
from met.run import Run
from tests.batch import plans
from tests.batch.differences.planted import order, two
from tests.batch.report import archives
from tests.batch.report.test_page import Parsed, hostile

CASES = 60
GONE = (17, 18)
MIXED = [each for each in order(3, CASES) if each not in GONE]


def plant(run: Run, place: dict[int, int]) -> None:
    """Case 12 breaks off; 7 and 14 have more volts and other rates; 5 has another position, by 1e-9 rad."""
    if 12 in place:
        case = place[12]
        run.status[case], run.cause[case], run.n_valid[case] = 1, "t = 0.8 s: joint elbow: it broke", 20
        for values in run.signals.values():
            values[case, 20:] = math.nan
        for metric in run.metrics.values():
            metric[case] = math.nan
    for number in (7, 14):
        if number in place:
            run.signals["qd"][place[number], 20:, 0] += 1e-3 * number
            run.metrics["volts"][place[number]] -= 0.1 * number
            run.met["volts < 5 V"][place[number]] = run.metrics["volts"][place[number]] < 5.0
    if 5 in place:
        run.signals["q"][place[5], 20:, 0] += 1e-9


@pytest.fixture
def planted(here: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    """Archives a.h5 and b.h5, of which b has the changes, and the cases in another order."""
    two(monkeypatch, here, MIXED, plant, cases=CASES)
    return Path("a.h5"), Path("b.h5")


def gathered(before: Path, now: Path, tolerances: str | tuple[str, ...] = (), names: tuple[str, ...] = ()) -> Report:
    found = sides.rename_archives(batch.diff(before, now, tolerances=tolerances), *sides.display_names(before, now))
    with ArchiveFile(now) as file, ArchiveFile(before) as other:
        return gather(file, names, against=sides.ComparedArchive(other, found))


def words(source: str) -> str:
    """What is read in a page."""
    texts = (text for tag, text in Parsed(source).texts if tag not in ("script", "style"))
    return re.sub(r"\s+", " ", " ".join(texts))


def squeezed(text: str) -> str:
    return re.sub(r"\s+", "", text).lower()


class TestTheVerdict:
    @pytest.mark.slow
    def test_counts_the_cases_by_how_they_differ(self, planted: tuple[Path, Path]) -> None:
        verdict = gathered(*planted, "q=1e-6rad").verdicts[-1]
        assert (verdict.kind, verdict.about) == ("comparison", "Against a.h5")
        assert (verdict.word, verdict.ok) == ("different", False)
        assert [(part.word, part.count) for part in verdict.parts] == [
            ("identical", CASES - 2 - 4),
            ("equivalent", 1),
            ("different", 3),
            ("only before", 2),
        ]

    @pytest.mark.slow
    def test_says_which_cases_meet_a_requirement_now_and_which_no_longer(self, planted: tuple[Path, Path]) -> None:
        verdict = gathered(*planted).verdicts[-1]
        settle, volts = verdict.flows
        number = MIXED.index
        assert (settle.met, settle.gained, settle.lost) == (
            "met by 56, now by 55 of 58",
            "",
            f"#{number(12)}",
        )
        assert (volts.met, volts.gained, volts.lost) == (
            "met by 0, now by 1 of 58",
            f"#{number(14)}",
            "",
        )
        assert verdict.figure == (0, 1, 58)
        ends = verdict.ends
        assert ends is not None and (ends.met, ends.gained, ends.lost) == (
            "by 58, now by 57 of 58",
            "",
            f"#{number(12)}",
        )

    @pytest.mark.release
    def test_has_improvements_and_regressions_apart(self, planted: tuple[Path, Path]) -> None:
        found = gathered(*planted)
        settle, volts = found.verdicts[-1].flows
        assert (settle.better, settle.worse, volts.worse) == (None, None, None)
        assert volts.better is not None and (volts.better.cases, volts.better.case) == (2, MIXED.index(14))
        with ArchiveFile(planted[0]) as file:
            was = float(file.groups[0].values("volts")[14])
        assert (volts.better.before, volts.better.now) == (f"{was:.3f}", f"{was - 1.4:.3f}")
        back = gathered(*reversed(planted)).verdicts[-1].flows[1]
        assert back.better is None and back.worse is not None and back.worse.cases == 2
        said = words(page(found))
        better, worse = said.split(" Improvements ")[1].split(" Regressions ")
        assert f"volts < 5 V #{MIXED.index(14)} 2 #{MIXED.index(14)} {volts.better.before} → " in better
        assert f"settle < 10 s #{MIXED.index(12)} – – reaches its end #{MIXED.index(12)}" in worse

    @pytest.mark.slow
    def test_calls_neither_better_nor_worse_what_is_allowed(self, planted: tuple[Path, Path]) -> None:
        volts = gathered(*planted, "volts=1V").verdicts[-1].flows[1]
        assert volts.better is not None and volts.better.cases == 1  # by 1.4 V; the other's 0.7 V are allowed

    @pytest.mark.slow
    def test_of_an_archive_and_itself_is_identical(self, planted: tuple[Path, Path]) -> None:
        found = gathered(planted[0], planted[0])
        verdict = found.verdicts[-1]
        assert (verdict.word, verdict.ok, verdict.headline) == ("identical", True, "To the bit")
        assert [(part.word, part.count) for part in verdict.parts] == [("identical", CASES)]
        [section] = found.sections
        assert section.changes[0].worst == () and section.changes[0].word == "identical"

    @pytest.mark.slow
    def test_of_what_has_nothing_in_common_says_so(self, here: Path, engine: None) -> None:
        one = archives.made(here / "a.h5", plans.nominal(), plans.gains(3))
        other = archives.made(here / "b.h5", plans.nominal("swing"), plans.gains(4, name="loads"))
        found = gathered(one, other)
        verdict = found.verdicts[-1]
        assert (verdict.word, verdict.headline) == ("incomparable", "The two have no case in common")
        assert [(part.word, part.count) for part in verdict.parts] == [("only before", 4), ("only now", 5)]
        assert found.changes is not None
        assert found.changes.alone == (
            "`nominal` is only in a.h5",
            "`gains` is only in a.h5",
            "`swing` is only in b.h5",
            "`loads` is only in b.h5",
        )
        assert "The two have no case in common." in words(page(found))


class TestThePage:
    def all_told(self, before: Path, now: Path, tolerances: str | tuple[str, ...] = ()) -> None:
        """Every piece of every line of `met diff` is on the page."""
        source = squeezed(words(page(gathered(before, now, tolerances))))
        *lines, last = diff_lines(batch.diff(before, now, tolerances=tolerances))
        for line in lines:
            said = re.sub(r"^(a|b)  |^  require |\bnan\b|:$", "", line).strip()
            for piece in re.split(r"\s{2,}|: |; |,? now\b", said):
                assert squeezed(piece.replace("`", "")) in source, line  # the page sets these as a program's text
        word, rest = re.split("[,;:]", last, maxsplit=1)
        assert squeezed(word) in source and squeezed(rest.replace("`", "")) in source

    @pytest.mark.release
    def test_says_all_that_met_diff_says(self, planted: tuple[Path, Path]) -> None:
        self.all_told(*planted)
        self.all_told(*planted, "q=1e-6rad,qd=1rad/s,rel=1e-3,time=1ms")
        self.all_told(*reversed(planted))
        self.all_told(planted[0], planted[0])

    @pytest.mark.release
    def test_says_it_of_several_structures_and_runs(self, here: Path) -> None:
        batch.run(archives.compiled(here, "ways", "brief"), output="a.h5")
        deck = archives.DECK.replace("0.03]", "0.04]").replace("duration = 4 s", "duration = 5 s")
        batch.run(archives.compiled(here, "ways", deck=deck), output="b.h5")
        self.all_told(Path("a.h5"), Path("b.h5"))
        self.all_told(Path("b.h5"), Path("a.h5"))

    @pytest.mark.slow
    def test_says_what_the_deck_allows(self, here: Path) -> None:
        deck = archives.DECK.replace("duration = 4 s;", "duration = 4 s; tolerances { qd = 1e-6 rad/s; rel = 1e-9; }")
        batch.run(archives.compiled(here, "brief", deck=deck), output="a.h5")
        [only] = gathered(Path("a.h5"), Path("a.h5"), "qd=1e-3rad/s").sections[0].changes
        deck_says, command_says = only.allowed
        assert deck_says.startswith("the deck of a.h5 allows rel ") and command_says.startswith("--tol allows qd ")

    @pytest.mark.release
    def test_of_other_seeds_has_distributions(self, here: Path, engine: None) -> None:
        one = plans.gains(40)
        archives.made(here / "a.h5", one)
        archives.made(here / "b.h5", replace(one, cases=replace(one.cases, seed=8)))
        self.all_told(Path("a.h5"), Path("b.h5"))
        assert gathered(Path("a.h5"), Path("b.h5")).sections[0].changes[0].samples

    @pytest.mark.slow
    def test_shows_the_lines_of_the_decks_that_differ(self, here: Path) -> None:
        deck = archives.DECK
        for name, text in (("a.h5", deck), ("b.h5", deck.replace("duration = 4 s;", "duration = 4.04 s;"))):
            batch.run(archives.compiled(here, "brief", deck=text), output=name)
        found = gathered(Path("a.h5"), Path("b.h5"))
        assert found.changes is not None
        [changed] = found.changes.decks
        assert changed.summary.endswith("bench.ic: 1 line new, 1 gone") and changed.left == 0
        source = page(found)
        assert '<li class="gone"><code>-run brief like nominal { duration = 4 s; }</code></li>' in source
        assert '<li class="new"><code>+run brief like nominal { duration = 4.04 s; }</code></li>' in source

    @pytest.mark.slow
    def test_of_many_changes_folds_away_the_later_ones(self, here: Path, engine: None) -> None:
        one = plans.nominal()
        archives.made(here / "a.h5", one)
        heavier = {
            path: replace(q, value=q.value + 1.0) for path, q in one.parameters.items() if isinstance(q.value, float)
        }
        archives.made(here / "b.h5", replace(one, parameters=heavier))
        found = gathered(Path("a.h5"), Path("b.h5"))
        assert found.changes is not None
        [made] = [each for each in found.changes.origins if each.about == "Parameters and models"]
        assert len(made.lines) > 20
        text = words(page(found))
        assert f"and {len(made.lines) - 12} more" in text
        assert text.index("Against") < text.index("Parameters and models:") < text.index("Improvements")

    @pytest.mark.slow
    def test_says_where_there_is_no_text_of_a_deck_as_markup(self, planted: tuple[Path, Path]) -> None:
        found = gathered(*planted, "q=1e-6rad")
        usual, wild = Parsed(page(found)), Parsed(page(hostile(found)))
        assert {tag for tag, _ in wild.elements} <= {tag for tag, _ in usual.elements}
        assert page(hostile(found)).count("</script>") == 2

    @pytest.mark.release
    def test_has_the_same_bytes_for_the_same_archives(self, planted: tuple[Path, Path]) -> None:
        one, other = (report(planted[1], name, against=planted[0]).read_bytes() for name in ("1.html", "2.html"))
        assert one == other

    @pytest.mark.slow
    def test_is_that_of_the_archive_alone_without_another(self, planted: tuple[Path, Path]) -> None:
        source = report(planted[1], "1.html").read_text(encoding="utf-8")
        assert "What changed" not in source and '"against":null' in source

    @pytest.mark.slow
    def test_begins_with_what_changed_and_how_to_run_both_again(self, planted: tuple[Path, Path]) -> None:
        found = gathered(*planted)
        source = page(found)
        changed, verdict = (source.index(f'<section id="{part}"') for part in ("changed", "verdict"))
        assert changed < source.index('class="verdict against"') < verdict
        assert found.again == ("met run b.h5 --all", "met run a.h5 --all")
        assert [source[changed:verdict].count(f"<code>{each}</code>") for each in found.again] == [1, 1]
        assert "Run it again:" not in source

    @pytest.mark.slow
    def test_of_one_run_of_several_is_of_it_alone(self, here: Path, engine: None) -> None:
        archives.made(here / "a.h5", plans.nominal(), plans.gains(3))
        archives.made(here / "b.h5", plans.nominal(), plans.gains(4))
        found = gathered(Path("a.h5"), Path("b.h5"), names=("nominal",))
        assert found.verdicts[-1].word == "identical" and len(found.sections) == 1
        [only] = found.sections[0].changes
        assert only.heading == "nominal: 1 case in both, identical"

    @pytest.mark.release
    def test_has_commands_that_run_both_again(self, here: Path) -> None:
        batch.run(archives.compiled(here, "ways", "brief"), output="a.h5")
        deck = archives.DECK.replace("duration = 4 s", "duration = 5 s")
        batch.run(archives.compiled(here, "ways", "brief", deck=deck), output="b.h5")
        worst = gathered(Path("a.h5"), Path("b.h5")).sections[0].changes[1].worst[0]
        for number, command in zip("ab", worst.commands, strict=True):
            assert command == f"met run {number}.h5 ways.rk4 --case '#{worst.case}'"
            assert cli.main([*shlex.split(command)[1:], "-q", "--no-picture"]) == cli.YES


class TestThePoints:
    def columns(self, found: Report) -> dict[str, CaseColumn]:
        overview = found.sections[0].overview
        assert overview is not None
        return {column.key: column for column in overview.columns}

    @pytest.mark.slow
    def test_know_what_each_case_was_before(self, planted: tuple[Path, Path]) -> None:
        columns = self.columns(gathered(*planted))
        with ArchiveFile(planted[0]) as file:
            was = file.groups[0].values("volts")
        before = columns["metric:volts"].before
        assert before is not None and before.tolist() == was[MIXED].tolist()
        change = columns["change:metric:volts"].values
        expected = np.zeros(len(MIXED))
        expected[[MIXED.index(7), MIXED.index(14)]] = -0.7, -1.4
        expected[MIXED.index(12)] = np.nan
        assert change == pytest.approx(expected, nan_ok=True)

    @pytest.mark.slow
    def test_have_no_change_where_both_are_infinite(self, planted: tuple[Path, Path]) -> None:
        columns = self.columns(gathered(*planted))
        assert columns["metric:settle"].values[MIXED.index(0)] == math.inf
        assert columns["change:metric:settle"].values[MIXED.index(0)] == 0.0

    @pytest.mark.slow
    def test_say_how_each_case_compares(self, planted: tuple[Path, Path]) -> None:
        columns = self.columns(gathered(*planted, "q=1e-6rad"))
        compared, outcome = columns["choice:compared"], columns["choice:outcome"]
        said = {case: compared.words[int(compared.values[MIXED.index(case)])] for case in (3, 5, 7, 12)}
        assert said == {3: "identical", 5: "equivalent", 7: "different", 12: "different"}
        assert outcome.words[int(outcome.values[MIXED.index(14)])] == "meets all, and did not"

    @pytest.mark.release
    def test_of_a_case_that_is_new_have_nothing_before(self, planted: tuple[Path, Path]) -> None:
        columns = self.columns(gathered(planted[1], planted[0]))
        assert np.flatnonzero(np.isnan(columns["metric:volts"].before)).tolist() == [12, *GONE]  # type: ignore[arg-type]
        compared = columns["choice:compared"]
        assert np.flatnonzero(compared.values == compared.words.index("only now")).tolist() == list(GONE)

    @pytest.mark.slow
    def test_are_of_the_same_unit_or_not_compared(self, here: Path, engine: None) -> None:
        one = plans.gains(4)
        archives.made(here / "a.h5", one)
        use = replace(one.structure.metrics[1], of="shoulder.tau")
        other = replace(one, structure=replace(one.structure, metrics=(one.structure.metrics[0], use)), requirements=())
        archives.made(here / "b.h5", other)
        columns = self.columns(gathered(Path("a.h5"), Path("b.h5")))
        assert columns["metric:volts"].before is None and "change:metric:volts" not in columns
        assert columns["metric:settle"].before is not None

    @pytest.mark.slow
    def test_of_a_grid_make_a_map_of_the_change(
        self, here: Path, engine: None, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        one = archives.grid([0.01, 0.02, 0.03], [20.0, 21.0])
        archives.made(here / "a.h5", one)

        def more(*args: object, **options: object) -> Run:
            found: Run = plans.answer(*args, **options)  # type: ignore[arg-type]
            found.metrics["volts"] += 0.5
            return found

        monkeypatch.setattr("met.run.run", more)
        archives.made(here / "b.h5", one)
        overview = gathered(Path("a.h5"), Path("b.h5")).sections[0].overview
        assert overview is not None
        assert overview.maps[0].values["change:metric:volts"] == pytest.approx(np.full((2, 3), 0.5))

    @pytest.mark.release
    def test_of_many_keep_those_that_changed_most(
        self, planted: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from batch.report.contents import overview

        monkeypatch.setattr(overview, "MOST_POINTS", 30)
        monkeypatch.setattr(overview, "KEPT", 3)
        drawn = gathered(*planted).sections[0].overview
        assert drawn is not None and len(drawn.cases) <= 30
        assert {MIXED.index(case) for case in (5, 7, 12, 14)} <= set(drawn.cases.tolist())


class TestTheSignals:
    @pytest.mark.release
    def test_that_changed_most_come_first_and_then_the_worst(self, planted: tuple[Path, Path]) -> None:
        found = gathered(*planted).sections[0].signals
        assert found is not None and found.most[:1] == (MIXED.index(12),) == found.first_cases
        assert found.worst == MIXED.index(12) and found.middle is None
        assert len(found.histories) == len(MIXED)

    @pytest.mark.slow
    def test_are_there_twice_and_their_difference_too(self, planted: tuple[Path, Path]) -> None:
        found = gathered(*planted).sections[0].signals
        assert found is not None
        [mine] = [each for each in found.histories if each.case == MIXED.index(14)]
        assert mine.before is not None and mine.change is not None
        with ArchiveFile(planted[0]) as file:
            assert mine.before.values[1] == pytest.approx(file.groups[0].signal("qd", 14), abs=0.0)
        assert mine.change.values[1][20:, 0] == pytest.approx(0.014) and not mine.change.values[1][:20].any()
        assert found.clocks[mine.change.clock].tolist() == found.clocks[mine.clock].tolist()

    @pytest.mark.slow
    def test_of_another_rate_are_compared_at_common_instants(self, here: Path, engine: None) -> None:
        archives.made(here / "a.h5", archives_of(2))
        archives.made(here / "b.h5", archives_of(3))
        found = gathered(Path("a.h5"), Path("b.h5")).sections[0].signals
        assert found is not None
        mine = found.histories[0]
        assert mine.before is not None and mine.change is not None
        now, was, both = (found.clocks[each.clock] for each in (mine, mine.before, mine.change))
        assert np.isin(np.round(both, 9), np.round(now, 9)).all() and np.isin(np.round(both, 9), np.round(was, 9)).all()
        assert len(both) == len(mine.change.values[0]) < len(was)

    @pytest.mark.slow
    def test_of_a_case_that_is_new_are_alone(self, planted: tuple[Path, Path]) -> None:
        found = gathered(planted[1], planted[0]).sections[0].signals
        assert found is not None
        alone = [each.case for each in found.histories if each.before is None]
        assert sorted(alone) == list(GONE)

    @pytest.mark.slow
    def test_that_the_other_archive_has_of_other_joints_are_left_out(self, here: Path, engine: None) -> None:
        one = plans.gains(3)
        archives.made(here / "a.h5", replace(one, structure=replace(one.structure, record=one.structure.record[:2])))
        archives.made(here / "b.h5", one)
        found = gathered(Path("a.h5"), Path("b.h5")).sections[0].signals
        assert found is not None and found.histories[0].before is not None
        assert sorted(found.histories[0].values) == [0, 1, 2, 3] and sorted(found.histories[0].before.values) == [0, 1]


def archives_of(record: int) -> Experiment:
    """A sweep of which every so many ticks are recorded."""
    one = plans.gains(3, ticks=240)
    return replace(one, structure=replace(one.structure, schedule=replace(one.structure.schedule, record=record)))


class TestNames:
    @pytest.mark.parametrize(
        ("before", "now", "said"),
        [
            ("before.h5", "after.h5", ("before.h5", "after.h5")),
            ("/x/before.h5", "y/after.h5", ("before.h5", "after.h5")),
            ("/x/v1/a.h5", "/x/v2/a.h5", ("v1/a.h5", "v2/a.h5")),
            ("/x/v1/out/a.h5", "/x/v2/out/a.h5", ("v1/out/a.h5", "v2/out/a.h5")),
            ("/x/a.h5", "/x/a.h5", ("a.h5", "a.h5")),
        ],
    )
    def test_tell_the_two_apart(self, before: str, now: str, said: tuple[str, str]) -> None:
        assert sides.display_names(Path(before), Path(now)) == said

    @pytest.mark.slow
    def test_stand_in_all_that_is_said(self, here: Path, engine: None) -> None:
        for folder in ("v1", "v2"):
            (here / folder).mkdir()
        one = plans.gains(3)
        archives.made(here / "v1" / "a.h5", one, histories="none")
        archives.made(here / "v2" / "a.h5", one)
        source = report(here / "v2" / "a.h5", against=here / "v1" / "a.h5").read_text(encoding="utf-8")
        assert str(here) not in source
        assert "histories of 3 cases are in v2/a.h5 alone, and are not compared" in words(source)
        assert "only in v2/a.h5" in words(source)


class TestTheCommand:
    @pytest.mark.release
    @pytest.mark.parametrize("swap", [False, True])
    def test_ends_well_when_the_page_is_written(
        self, planted: tuple[Path, Path], swap: bool, capsys: pytest.CaptureFixture[str]
    ) -> None:
        before, now = map(str, reversed(planted) if swap else planted)
        assert cli.main(["report", now, "--against", before, "--tol", "q=1e-6rad", "--tol", "rel=1e-9"]) == cli.YES
        size = Path(now).with_suffix(".html").stat().st_size
        assert capsys.readouterr().out == f"{Path(now).with_suffix('.html')}  ({size / 1024:.0f} KiB)\n"

    def refused(self, capsys: pytest.CaptureFixture[str], *args: str) -> str:
        assert cli.main(["report", *args]) == cli.BAD_INPUT
        return capsys.readouterr().err.removesuffix("\n1 error\n")

    @pytest.mark.slow
    def test_refuses_a_tolerance_without_another_archive(
        self, planted: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
    ) -> None:
        said = self.refused(capsys, "b.h5", "--tol", "rel=1e-9")
        assert "--tol is for a comparison: `--against BEFORE.h5` names the other archive" in said
        with pytest.raises(ValueError, match=r"^tolerances are for a comparison: against which archive\?$"):
            report("b.h5", tolerances="rel=1e-9")

    @pytest.mark.slow
    def test_refuses_what_met_diff_refuses(
        self, planted: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert self.refused(capsys, "b.h5", "--against", "c.h5") == (
            "error[E301]: cannot read the archive c.h5: no such file or directory\n"
            " = help: archives are written by `met run DECK`\n"
        )
        said = self.refused(capsys, "b.h5", "--against", "a.h5", "--tol", "settle=1kg")
        assert said.startswith("error[E360]: tolerance of `settle` is in `kg`, and ")
        assert self.refused(capsys, "b.h5", "--against", "a.h5", "--run", "gain").startswith("error[E325]: no run or")
        assert not Path("b.html").exists()


@pytest.mark.slow
def test_says_which_cases_meet_a_requirement_whose_limit_is_another(here: Path) -> None:
    for name, limit in (("a.h5", "5 s"), ("b.h5", "1 us")):
        brief = "run brief like nominal { "
        deck = archives.DECK.replace(brief, f"{brief}require settle < {limit}; ")
        batch.run(archives.compiled(here, "brief", deck=deck), output=name)
    found = gathered(Path("a.h5"), Path("b.h5"))
    verdict = found.verdicts[-1]
    flow = next(each for each in verdict.flows if "before" in each.text)
    assert (flow.text, flow.met, flow.gained, flow.lost) == (
        "settle < 1 us (before: settle < 5 s)",
        "met by 1, now by 0 of 1",
        "",
        "#0",
    )
    assert verdict.headline.startswith("Requirements differ: settle < 5 s -> settle < 1 us (1 of 1 cases no longer")
    assert verdict.headline in words(page(found))


@pytest.mark.release
def test_a_structure_says_how_many_met_all_before(here: Path) -> None:
    batch.run(archives.compiled(here, "ways"), output="a.h5")
    deck = archives.DECK.replace("run brief like nominal { ", "run brief like nominal { require settle < 2.2 s; ")
    batch.run(archives.compiled(here, "ways", deck=deck), output="b.h5")
    table = gathered(Path("a.h5"), Path("b.h5")).sections[0].structures
    assert table is not None and table.heads[:4] == ("integrator", "cases", "meet all", "before")
    assert [row[3] for row in table.rows] == ["3 (100 %)", "3 (100 %)"]
    assert all(row[2] != "3 (100 %)" for row in table.rows)
