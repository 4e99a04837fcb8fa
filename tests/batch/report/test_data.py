"""What goes into a report is what the archive holds: verdict, worst cases, points, maps, signals, margins."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import batch
from batch.archive.read import ArchiveFile
from batch.queries import cases
from batch.queries.best import Designs
from batch.queries.best_answer import BestAnswer
from batch.queries.grids import column_levels
from batch.queries.pool import ENDED, CaseColumn, Pool, pools
from batch.report.contents import histories, overview, stability
from batch.report.contents.against import ComparedArchive
from batch.report.contents.designs import design_map
from batch.report.contents.gathering import gather
from batch.report.contents.histories import thin, thin_clock
from batch.report.contents.overview import _steps as round_steps
from batch.report.contents.overview import ruler
from batch.report.contents.parts import OutcomeCount, Report
from batch.report.html.payload import _column
from met.analysis.margin import margins
from tests.batch import plans
from tests.batch.report import archives


def gathered(path: Path, *names: str, title: str = "") -> Report:
    with ArchiveFile(path) as file:
        return gather(file, names, title)


@pytest.fixture
def sweep(here: Path, engine: None) -> Path:
    return archives.made(here / "a.h5", plans.gains(20))


class TestTheVerdict:
    @pytest.mark.slow
    def test_counts_the_cases_that_meet_all_that_is_required(self, sweep: Path) -> None:
        [verdict] = gathered(sweep).verdicts
        assert (verdict.ok, verdict.headline) == (False, "0 of 20 cases meet every requirement")
        assert verdict.parts == (OutcomeCount("missed", 20),)
        first, second = verdict.demands
        assert (first.text, first.met, first.missed, first.cases) == ("settle < 10 s", 19, 1, 20)
        assert (first.furthest, first.case) == ("∞ s", 0)
        assert (second.text, second.met, second.missed, second.furthest) == ("volts < 5 V", 0, 20, "6.849 V")

    @pytest.mark.slow
    def test_has_failures_by_cause_with_their_cases(
        self, here: Path, engine: None, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        archives.failing(monkeypatch, 1, 2, 5)
        [verdict] = gathered(archives.made(here / "a.h5", plans.gains(8))).verdicts
        [failing] = verdict.failing
        assert (failing.status, failing.count, failing.cases, failing.first) == ("failed", 3, "#1-#2, #5", 1)
        assert failing.cause == "t = 0.2 s: joint elbow: D is not above 0 kg m^2, so qdd is undefined."
        assert sum(part.count for part in verdict.parts) == 8
        assert verdict.good == 0
        assert verdict.demands[0].unknown == 3

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("limit", "said"), [(10.0, "The case meets its requirement"), (0.001, "The case does not meet its requirement")]
    )
    def test_of_one_case_is_in_the_singular(self, here: Path, engine: None, limit: float, said: str) -> None:
        one = plans.nominal()
        one = replace(one, requirements=(replace(one.requirements[0], text=f"settle < {limit} s", limit=limit),))
        assert gathered(archives.made(here / "a.h5", one)).verdicts[0].headline == said

    @pytest.mark.slow
    def test_without_requirements_is_that_all_ran(self, here: Path, engine: None) -> None:
        found = gathered(archives.made(here / "a.h5", replace(plans.gains(3), requirements=())))
        assert found.verdicts[0].ok and found.verdicts[0].headline == "All 3 cases reached their end"

    @pytest.mark.slow
    def test_of_several_runs_is_one_each_in_their_order(self, here: Path, engine: None) -> None:
        found = gathered(archives.made(here / "a.h5", plans.nominal(), plans.gains(3)))
        assert [verdict.about for verdict in found.verdicts] == ["nominal", "gains"]
        assert [section.name for section in found.sections] == ["nominal", "gains"]


class TestTheDesignToUse:
    @pytest.mark.slow
    def test_is_what_met_best_says(self, here: Path, engine: None) -> None:
        one = archives.grid([0.01, 0.02, 0.03, 0.04, 0.05], [20.0, 21.0, 22.0, 23.0])
        one = replace(one, requirements=tuple(replace(each, limit=20.0) for each in one.requirements))
        path = archives.made(here / "a.h5", one)
        found = gathered(path).sections[0].designs
        with ArchiveFile(path) as file:
            answer = BestAnswer(Designs(pools(file.groups)[0]), (), (), deck="two_link.ic", name="gains", seed=7)
            assert found is not None and answer.best is not None
            assert found.headline.lower() == answer.headline.lower() and found.why.lower() == answer.why.lower()
            assert found.command.startswith("met run two_link.ic gains -D FAST=1 --set 'gearbox.kp=")

    @pytest.mark.slow
    def test_has_a_map_where_two_are_chosen(self, here: Path, engine: None) -> None:
        one = archives.grid([0.01, 0.02, 0.03, 0.04, 0.05], [20.0, 21.0, 22.0, 23.0])
        one = replace(one, requirements=tuple(replace(each, limit=20.0) for each in one.requirements))
        with ArchiveFile(archives.made(here / "a.h5", one)) as file:
            designs = Designs(pools(file.groups)[0], choose=["links.lower.mass"])
            best = int(designs.order()[0])
            found = design_map(designs, best)
            assert found is not None and designs.steps is not None and found.steps.shape == (4, 5)
            assert found.steps[found.best] == designs.steps[best] == designs.steps.max()
            assert (found.steps > 0).sum() == designs.good.sum() == 16
            assert design_map(Designs(pools(file.groups)[0]), 0) is None

    @pytest.mark.slow
    def test_is_not_asked_of_a_run_or_where_nothing_is_required(self, here: Path, engine: None) -> None:
        assert gathered(archives.made(here / "a.h5", plans.nominal())).sections[0].designs is None
        bare = replace(plans.gains(4), requirements=())
        assert gathered(archives.made(here / "b.h5", bare)).sections[0].designs is None

    @pytest.mark.slow
    def test_where_none_is_good_those_that_come_nearest_are_shown(self, sweep: Path) -> None:
        found = gathered(sweep).sections[0].designs
        assert found is not None and found.map is None and found.command == ""
        assert found.headline == "None of 20 designs meets all requirements"
        assert [row[0] for row in found.table.rows] == 3 * ["misses volts < 5 V"]


class TestWorstCases:
    @pytest.mark.slow
    def test_come_in_the_order_of_met_show(self, here: Path, engine: None, monkeypatch: pytest.MonkeyPatch) -> None:
        archives.failing(monkeypatch, 3, 17)
        path = archives.made(here / "a.h5", plans.gains(40))
        with ArchiveFile(path) as file:
            listed = [row["row"] for row in cases.rows_json(file.groups[0])]
        worst = gathered(path).sections[0].worst
        assert worst is not None and list(worst.cases) == listed
        assert listed[:2] == [3, 17]

    @pytest.mark.slow
    def test_have_the_command_that_runs_them_again(self, sweep: Path) -> None:
        worst = gathered(sweep).sections[0].worst
        assert worst is not None and worst.cases[0] == 0
        assert worst.commands[0] == "met run a.h5 --case '#0'"
        assert worst.table.rows[0][:2] == ("#0", worst.table.rows[0][1])
        assert (0, 4) in worst.table.marked

    @pytest.mark.slow
    def test_name_their_sweep_where_there_are_several(self, here: Path, engine: None) -> None:
        found = gathered(archives.made(here / "it is.h5", plans.nominal(), plans.gains(3)))
        worst = found.sections[1].worst
        assert worst is not None and worst.commands[0].startswith("met run 'it is.h5' gains --case '#")

    @pytest.mark.release
    def test_are_run_again_by_that_command(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        import shlex

        from met import cli

        monkeypatch.chdir(tmp_path)
        batch.run(archives.compiled(tmp_path, "nominal", "ways"), output="both.h5")
        worst = gathered(Path("both.h5")).sections[1].worst
        assert worst is not None
        assert cli.main([*shlex.split(worst.commands[0])[1:], "-q", "--no-picture"]) == cli.YES
        with ArchiveFile(f"both.case{worst.cases[0]}.h5") as file:
            assert file.groups[0].values("case").tolist() == [worst.cases[0]]


class TestBestCases:
    @pytest.mark.slow
    def test_are_those_with_most_margin(self, here: Path, engine: None) -> None:
        one = plans.gains(20)
        one = replace(one, requirements=tuple(replace(each, limit=7.0) for each in one.requirements))
        path = archives.made(here / "a.h5", one)
        section = gathered(path).sections[0]
        assert section.best is not None and section.best.title == "Best cases"
        with ArchiveFile(path) as file:
            settle, volts = (file.groups[0].values(name) for name in ("settle", "volts"))
        margin = 1.0 - np.maximum(settle, volts) / 7.0
        assert list(section.best.cases) == np.argsort(-margin, kind="stable")[:5].tolist()
        assert section.best.more == f"{int((margin > 0).sum()) - 5} more cases meet all."
        assert section.best.table.marked == frozenset()

    @pytest.mark.slow
    def test_are_not_told_apart_where_none_is_good_or_few_are_there(self, here: Path, sweep: Path) -> None:
        assert gathered(sweep).sections[0].best is None
        assert gathered(archives.made(here / "b.h5", plans.gains(5))).sections[0].best is None


class TestThePoints:
    @pytest.mark.slow
    def test_are_all_cases_of_few(self, sweep: Path) -> None:
        found = gathered(sweep).sections[0].overview
        assert found is not None and found.cases.tolist() == list(range(20)) and found.note == ""
        assert found.start == ("parameter:gearbox.kp", "metric:volts", "parameter:links.lower.mass")
        [settle] = [column for column in found.columns if column.label == "settle"]
        assert [(limit.text, limit.value, limit.sense) for limit in settle.limits] == [("settle < 10 s", 10.0, "<")]

    @pytest.mark.slow
    def test_of_many_keep_the_extremes_and_the_worst(
        self, here: Path, engine: None, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(overview, "MOST_POINTS", 300)
        archives.failing(monkeypatch, 777)
        with ArchiveFile(archives.made(here / "a.h5", plans.gains(3000), histories="none")) as file:
            [pool] = pools(file.groups)
            found = overview.overview(pool)
        assert found is not None and len(found.cases) <= 300
        assert f"{len(found.cases)} of 3,000 cases are drawn." in found.note
        drawn = set(found.cases.tolist())
        assert 777 in drawn and set(pool.worst_first[:200].tolist()) <= drawn
        for column in pool.metrics():
            finite = np.where(np.isfinite(column.values), column.values, np.nan)
            assert {int(np.nanargmin(finite)), int(np.nanargmax(finite))} <= drawn

    def test_have_one_for_each_dot_that_any_case_lies_on(self) -> None:
        rng = np.random.default_rng(1)
        x, y = rng.random(5000), rng.random(5000) ** 9
        x[7], y[7], y[8], y[9] = 0.5, 40.0, np.inf, np.nan
        rank = rng.permutation(5000)
        kept = overview._on_dots(x, y, rank, 20, 30)
        assert {7, 8, 9} <= set(kept.tolist())
        cells = overview._strips(x, 20) * 100 + overview._strips(y, 30)
        assert sorted(cells[kept]) == sorted(set(cells.tolist()))
        assert all(rank[place] == rank[cells == cells[place]].min() for place in kept)

    @pytest.mark.slow
    def test_say_why_a_case_failed(self, here: Path, engine: None, monkeypatch: pytest.MonkeyPatch) -> None:
        archives.failing(monkeypatch, 2, cause="it broke")
        found = gathered(archives.made(here / "a.h5", plans.gains(5))).sections[0].overview
        assert found is not None and found.causes == {2: "it broke"}
        assert [ENDED[each] for each in found.ended] == ["missed", "missed", "failed", "missed", "missed"]


class TestMaps:
    @pytest.mark.slow
    def test_hold_the_worst_case_of_each_cell(self, here: Path, engine: None) -> None:
        one = archives.grid([0.02, 0.01, 0.03], [20.0, 21.0])
        found = gathered(archives.made(here / "a.h5", one)).sections[0].overview
        assert found is not None
        [map_] = found.maps
        assert (map_.x, map_.x_levels) == ("parameter:gearbox.kp", ("0.01", "0.02", "0.03"))
        assert (map_.y, map_.y_levels) == ("parameter:links.lower.mass", ("20000", "21000"))
        assert map_.counts.tolist() == [[1, 1, 1], [1, 1, 1]]
        assert map_.cases["metric:settle"].tolist() == [[2, 0, 4], [3, 1, 5]]
        assert np.isinf(map_.values["metric:settle"][:, 0]).all()
        assert map_.missed["metric:settle"].tolist() == [[1, 0, 0], [1, 0, 0]]

    @pytest.mark.slow
    def test_are_not_made_of_parameters_that_go_in_step(self, here: Path, engine: None) -> None:
        one = plans.gains(3)
        found = gathered(archives.made(here / "a.h5", one)).sections[0].overview
        assert found is not None and found.maps == ()

    @pytest.mark.slow
    def test_share_cells_where_there_are_many_values(self, here: Path, engine: None) -> None:
        one = archives.grid(np.linspace(0.01, 0.04, 100).tolist(), [20.0, 21.0, 22.0])
        found = gathered(archives.made(here / "a.h5", one, histories="none")).sections[0].overview
        assert found is not None
        [map_] = found.maps
        assert map_.counts.shape == (3, 48) and map_.counts.sum() == 300

    @pytest.mark.parametrize("power", range(-6, 6))
    def test_of_a_stretch_of_exactly_five_steps_are_five_steps(self, power: int) -> None:
        for low in np.linspace(0.0, 3.0, 61) * 10.0**power:
            for width in (1.0, 2.0, 5.0):
                assert 5 <= len(round_steps(low, low + width * 10.0**power)) <= 13

    def test_of_many_values_have_round_numbers_where_these_lie(self) -> None:
        steps = ruler(column_levels(np.linspace(0.0, 70.0, 71)))
        assert len(steps.edges) == 49 and (steps.edges[0], steps.edges[-1]) == (0.0, 1.0)
        assert [text for _, text in steps.ticks[0]] == ["0", "10", "20", "30", "40", "50", "60", "70"]
        assert [at for at, _ in steps.ticks[0]] == pytest.approx([(x + 0.5) / 71 for x in range(0, 71, 10)])
        factors = ruler(column_levels(np.geomspace(0.01, 100.0, 81)))
        assert [text for _, text in factors.ticks[0]] == [
            "0.01",
            "0.02",
            "0.05",
            "0.1",
            "0.2",
            "0.5",
            "1",
            "2",
            "5",
            "10",
            "20",
            "50",
            "100",
        ]
        assert {text: at for at, text in factors.ticks[0]}["1"] == pytest.approx(0.5)
        few = ruler(column_levels(np.array([1.0, 10.0, 100.0])))
        assert [text for _, text in few.ticks[0]] == ["1", "10", "100"]
        assert [at for at, _ in few.ticks[0]] == pytest.approx([1 / 6, 1 / 2, 5 / 6])


def test_colours_of_a_logarithmic_sweep_are_logarithmic() -> None:
    kp = CaseColumn("parameter:kp", "kp", "", "parameter", np.geomspace(1e-3, 1e-1, 9), log=True)
    assert _column(kp)["reach"] == {
        "low": pytest.approx(1e-3),
        "high": pytest.approx(1e-1),
        "log": True,
        "below": 0,
        "above": 0,
        "least": pytest.approx(1e-3),
        "most": pytest.approx(1e-1),
    }
    assert not _column(replace(kp, values=np.linspace(1e-3, 1e-1, 9), log=False))["reach"]["log"]


class TestSignals:
    @pytest.mark.slow
    def test_are_of_the_worst_cases_and_of_the_middle_one(self, sweep: Path) -> None:
        found = gathered(sweep).sections[0].signals
        assert found is not None and len(found.histories) == 20 and found.notes == ()
        assert found.histories[0].case == 0 and found.first_cases == (0, found.histories[1].case, found.middle)
        assert [(panel.name, [line.label for line in panel.lines]) for panel in found.panels] == [
            ("q", ["shoulder", "elbow"]),
            ("qd", ["shoulder", "elbow"]),
            ("tau", ["shoulder", "elbow"]),
            ("shoulder.servo.voltage", [""]),
        ]
        with ArchiveFile(sweep) as file:
            assert found.histories[0].values[1] == pytest.approx(file.groups[0].signal("qd", 0), nan_ok=True)

    @pytest.mark.slow
    def test_that_are_too_many_are_of_fewer_cases_and_that_is_said(self, sweep: Path) -> None:
        with ArchiveFile(sweep) as file:
            [pool] = pools(file.groups)
            found = histories.signals(pool, values=6 * 7 * 51)
        assert found is not None and len(found.histories) == 6
        assert found.middle in {each.case for each in found.histories}
        assert found.notes == ("Signals of the worst of 20 recorded cases are in this page, 6 of them.",)

    @pytest.mark.slow
    def test_that_are_long_are_thinned_and_that_is_said(self, here: Path, engine: None) -> None:
        path = archives.made(here / "a.h5", plans.gains(4, ticks=80_000))
        with ArchiveFile(path) as file:
            [pool] = pools(file.groups)
            found = histories.signals(pool)
            whole = file.groups[0].signal("tau", 0)
        assert found is not None
        thinned = found.histories[[each.case for each in found.histories].index(0)].values[2]
        assert len(found.clocks[0]) == len(thinned) <= histories.MOST_POINTS
        assert (thinned.min(), thinned.max()) == (whole.min(), whole.max())
        assert found.notes == (
            "Lines have the smallest and the largest value of every 11 rows, 4,000 points at most: no peak is lost, "
            "and its time is true to that stretch.",
        )

    def test_keep_every_peak_when_thinned(self) -> None:
        values = np.zeros((100_003, 2))
        values[54_321, 0], values[12_345, 1] = 1.0, -1.0
        values[60_000:, 1] = np.nan
        out = thin(values, 4000)
        assert len(out) == len(thin_clock(np.arange(100_003.0), 4000)) <= 4000
        assert out[:, 0].max() == 1.0 and np.nanmin(out[:, 1]) == -1.0
        at = np.arange(100_003.0)[out[:, 0].argmax() // 2 * 51]
        assert at <= 54_321 < at + 51
        assert np.isnan(out[-1, 1]) and np.isfinite(out[: 2 * (60_000 // 51), 1]).all()

    def test_keep_the_order_of_the_extremes(self) -> None:
        values = np.array([[0.0], [5.0], [1.0], [-5.0], [2.0], [7.0], [1.0], [-2.0]])
        assert thin(values, 4).ravel().tolist() == [5.0, -5.0, 7.0, -2.0]

    def test_of_few_rows_are_as_they_are(self) -> None:
        values = np.array([[0.0], [np.inf], [2.0]])
        assert thin(values, 10)[[0, 2]].tolist() == [[0.0], [2.0]] and np.isnan(thin(values, 10)[1])

    @pytest.mark.slow
    def test_that_were_not_kept_are_told_of(self, here: Path, engine: None) -> None:
        section = gathered(archives.made(here / "a.h5", plans.gains(3), histories="none")).sections[0]
        assert section.signals is None
        assert section.no_signals == (
            "No histories were kept. The commands of the table above run a case again, with its signals."
        )

    @pytest.mark.slow
    def test_have_the_command_over_what_should_follow_it(self, tmp_path: Path) -> None:
        deck = "#include <two_link.ic>\nrun short like nominal { duration = 1 s; record += [servo.command]; }\n"
        batch.run(archives.compiled(tmp_path, "short", deck=deck), output=tmp_path / "a.h5")
        found = gathered(tmp_path / "a.h5").sections[0].signals
        assert found is not None and "servo.command" not in [panel.name for panel in found.panels]
        [qd] = [panel for panel in found.panels if panel.name == "qd"]
        assert [(line.label, line.command) for line in qd.lines] == [
            ("shoulder", False),
            ("elbow", False),
            ("shoulder", True),
            ("elbow", True),
        ]
        assert found.histories[0].values[found.panels.index(qd)][:, 2:] == pytest.approx(0.03)

    @pytest.mark.slow
    def test_are_in_the_deck_s_units(self, tmp_path: Path) -> None:
        deck = """#include <two_link.ic>
            run short like nominal {
                duration = 0.2 s;  record += [servo.command];
                initial { shoulder.q = 30 deg;  elbow.q = -20 deg;  qd = 3 deg/s; }
            }
        """
        batch.run(archives.compiled(tmp_path, "short", deck=deck), output=tmp_path / "a.h5")
        found = gathered(tmp_path / "a.h5").sections[0].signals
        assert found is not None
        assert [(panel.name, panel.unit) for panel in found.panels][:2] == [("q", "deg"), ("qd", "deg/s")]
        assert found.histories[0].values[0][0] == pytest.approx([30.0, -20.0])
        assert found.histories[0].values[1][0] == pytest.approx([3.0, 3.0, *[np.rad2deg(0.03)] * 2])

    @pytest.mark.release
    def test_of_another_archive_are_in_the_same_units(self, tmp_path: Path) -> None:
        deck = "#include <two_link.ic>\nrun short like nominal { duration = 0.2 s;  initial { q = %s; } }\n"
        for name, start in (("a", "0.5 rad"), ("b", "30 deg")):
            plan = archives.compiled(tmp_path, "short", deck=deck % start)
            batch.run(plan, output=tmp_path / f"{name}.h5")
        with ArchiveFile(tmp_path / "b.h5") as file, ArchiveFile(tmp_path / "a.h5") as other:
            before = ComparedArchive(other, batch.diff(tmp_path / "a.h5", tmp_path / "b.h5"))
            found = gather(file, against=before).sections[0].signals
        assert found is not None and found.panels[0].unit == "deg"
        [mine] = found.histories
        assert mine.before is not None and mine.change is not None
        assert mine.before.values[0][0, 0] == pytest.approx(np.rad2deg(0.5))
        assert mine.change.values[0][0, 0] == pytest.approx(30.0 - np.rad2deg(0.5))


class TestStructures:
    @pytest.mark.slow
    def test_are_one_section_with_a_row_each(self, tmp_path: Path) -> None:
        batch.run(archives.compiled(tmp_path, "ways"), output=tmp_path / "a.h5")
        found = gathered(tmp_path / "a.h5")
        [section] = found.sections
        assert section.name == "ways" and section.structures is not None
        assert section.lede.startswith("6 cases in 2 structures, 4 s each. Arm two_link, modified_euler, rk4 at 25 Hz")
        assert section.structures.heads[:3] == ("integrator", "cases", "meet all")
        assert [row[:2] for row in section.structures.rows] == [("modified_euler", "3"), ("rk4", "3")]
        assert section.overview is not None and section.overview.cases.tolist() == [0, 1, 2, 3, 4, 5]
        [choice] = [column for column in section.overview.columns if column.role == "choice"]
        assert (choice.words, choice.values.tolist()) == (("modified_euler", "rk4"), [0, 0, 0, 1, 1, 1])
        [integrator] = [row for row in section.parameters if row.path == "integrator" and row.value == "rk4"]
        assert integrator.among == ("ways.rk4",)

    @pytest.mark.slow
    def test_parameters_name_the_line_that_wrote_them(self, tmp_path: Path) -> None:
        batch.run(archives.compiled(tmp_path, "ways"), output=tmp_path / "a.h5")
        [section] = gathered(tmp_path / "a.h5").sections
        rows = {row.path: row for row in section.parameters}
        kp = rows["shoulder.servo.kp"]
        assert (kp.value, kp.unit, kp.origin) == ("0.01 … 0.03", "V·s/rad", "varied")
        assert kp.spot is not None and kp.spot.file.endswith("bench.ic")
        lines = archives.DECK.split("\n")
        assert "vary gearbox.kp" in lines[kp.spot.line - 1]
        assert [spot.file for spot in kp.overrides] == ["<servos/rigid_gearbox.ic>"]
        assert rows["links.upper.mass"].value == "40" and rows["shoulder.servo.k_position"].origin == "default"


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep with the shoulder's motor on a bed."""
    folder = tmp_path_factory.mktemp("bed")
    batch.run(archives.compiled(folder, "loads"), output=folder / "a.h5")
    return folder / "a.h5"


class TestStability:
    @pytest.mark.slow
    def test_is_what_met_margin_says(self, bench: Path) -> None:
        found = gathered(bench).sections[0].stability
        assert found is not None
        with ArchiveFile(bench) as file:
            said = margins(file.plan().experiments[0])
        [bed] = found.beds
        assert found.cases.tolist() == [0, 1, 2, 3, 4, 5]
        assert bed.r.tolist() == [one.together for (one,) in said]
        assert bed.limit.tolist() == [one.limit for (one,) in said]
        assert not bed.ok and bed.margin == "none: unstable" and bed.delay == "0, 2"
        assert np.isnan(bed.lower).all() and not found.spans and bed.stable_at == "2.05"
        bad = [one.case for (one,) in said if not one.stable]
        assert bed.unstable.tolist() == [place in bad for place in range(6)]
        assert found.unstable == (f"shoulder: not stable in {len(bad)} of 6 cases: #3, #5",) and bad == [3, 5]

    @pytest.mark.slow
    def test_tells_from_where_where_an_arm_may_be_too_light(self, tmp_path: Path) -> None:
        deck = (
            archives.DECK
            + """
            run stiff like there { shoulder { bed = emulated;  law = measured_acceleration; } duration = 0.1 s; }
            sweep light of stiff { vary gearbox.kp = [0.02, 1] V*s/rad;  vary gearbox.ratio = [1570, 5000]; }
        """
        )
        batch.run(archives.compiled(tmp_path, "light", deck=deck), output=tmp_path / "a.h5")
        found = gathered(tmp_path / "a.h5").sections[0].stability
        assert found is not None and found.spans
        [bed] = found.beds
        assert bed.unstable.tolist() == [False, False, False, True] and not bed.ok
        assert np.isnan(bed.lower[:2]).all() and bed.lower[2:] == pytest.approx([0.181, 0.181], rel=0.01)
        assert bed.stable_at == "0.182 to 4.01" and bed.margin == "none: unstable, too light"

    @pytest.mark.slow
    def test_of_many_cases_is_of_some_and_that_is_said(self, bench: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(stability, "MOST_CASES", 3)
        monkeypatch.setattr(stability, "MOST_LOOPS", 1)
        found = gathered(bench).sections[0].stability
        assert found is not None and found.cases.tolist() == [0, 2, 4]
        assert found.note == "Computed for 3 of 6 cases, spread over all."

    @pytest.mark.slow
    def test_is_not_there_without_a_bed(self, sweep: Path) -> None:
        assert gathered(sweep).sections[0].stability is None


@pytest.mark.slow
def test_a_plan_that_cannot_be_read_here_leaves_the_rest(sweep: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from met.diagnostic import Problem, error

    def refuse(self: ArchiveFile, *, as_written: bool = False) -> None:
        raise Problem(error("E999", "no model `mine` here"))

    monkeypatch.setattr(ArchiveFile, "plan", refuse)
    [section] = gathered(sweep).sections
    assert section.trouble == "no model `mine` here" and section.parameters == ()
    assert section.overview is not None and section.signals is not None


@pytest.mark.slow
def test_a_pool_of_groups_is_in_the_order_of_the_case_table(tmp_path: Path) -> None:
    batch.run(archives.compiled(tmp_path, "ways"), output=tmp_path / "a.h5")
    with ArchiveFile(tmp_path / "a.h5") as file:
        pool = Pool("ways", file.groups[::-1])
        assert pool.cases.tolist() == list(range(6)) and pool.group_of.tolist() == [1, 1, 1, 0, 0, 0]
        whole = batch.open(tmp_path / "a.h5")
        for number, group in enumerate(file.groups[::-1]):
            mine = pool.gathered("settle")[pool.group_of == number]
            assert mine.tolist() == whole[group.name]["settle"].values.tolist()
