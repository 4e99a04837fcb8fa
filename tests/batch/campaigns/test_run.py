"""Running campaigns: which cases, how much of them is kept, and that a case is itself in any company."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import batch
from batch.campaigns import campaign, tasks
from batch.campaigns.performing import perform
from batch.executors.threads import Threads
from met.diagnostic import Problem
from met.plan import keys
from tests.batch import plans
from tests.batch.refusals import refused


@pytest.mark.usefixtures("engine")
class TestWhichCases:
    def test_a_position_an_id_and_a_row_name_the_same_case(self, here: Path) -> None:
        plan = plans.plan(plans.gains(9))
        case_id = keys.case_ids(plans.gains(9))[4]
        for case in (4, "#4", case_id, case_id[:6]):
            rows = campaign.prepare(plan, cases=[case]).parts[0].rows
            assert list(rows) == [4]

    def test_several_cases_are_run_in_the_order_of_the_table(self, here: Path) -> None:
        parts = campaign.prepare(plans.plan(plans.gains(9)), cases=["#7", 2, "#7"]).parts
        assert list(parts[0].rows) == [2, 7]

    def test_a_position_is_taken_in_every_experiment(self, here: Path) -> None:
        parts = campaign.prepare(plans.plan(plans.nominal(), plans.gains(3)), cases=["#0"]).parts
        assert [list(part.rows) for part in parts] == [[0], [0]]

    def test_an_id_runs_only_the_experiment_it_is_in(self, here: Path) -> None:
        case_id = keys.case_ids(plans.gains(3))[2]
        parts = campaign.prepare(plans.plan(plans.nominal(), plans.gains(3)), cases=[case_id]).parts
        assert [(part.experiment.name, list(part.rows)) for part in parts] == [("gains", [2])]

    def test_no_such_case(self, here: Path) -> None:
        with pytest.raises(Problem) as caught:
            campaign.prepare(plans.plan(plans.gains(9)), cases=["#9"])
        assert refused(caught) == (
            "error[E311]: no case `#9`\n"
            " = help: `gains` has #0 to #8\n"
            " = help: `met cases DECK` lists them\n"
            "\n1 error\n"
        )

    def test_an_id_of_several_cases(self, here: Path) -> None:
        ids = keys.case_ids(plans.gains(40))
        twice = next(i[0] for i in ids if sum(other[0] == i[0] for other in ids) == 2)
        rows = [row for row, case_id in enumerate(ids) if case_id[0] == twice]
        with pytest.raises(Problem) as caught:
            campaign.prepare(plans.plan(plans.gains(40)), cases=[twice])
        expected = f"case `{twice}` may be any of 2: #{rows[0]} of `gains`, #{rows[1]} of `gains`"
        assert caught.value.diagnostics[0].message == expected

    def test_no_such_run(self, here: Path) -> None:
        with pytest.raises(Problem) as caught:
            campaign.prepare(plans.plan(plans.nominal(), plans.gains()), experiments=["gain"])
        assert refused(caught) == (
            "error[E310]: no run or sweep `gain` in two_link.ic\n"
            " = help: did you mean `gains`?\n"
            " = help: runs and sweeps of two_link.ic: nominal, gains\n"
            "\n1 error\n"
        )


@pytest.mark.usefixtures("engine")
class TestWhatIsKept:
    def test_all_histories_of_a_small_campaign(self, here: Path) -> None:
        made = campaign.prepare(plans.plan(plans.gains(20)))
        assert made.parts[0].all_recorded
        assert made.notes == ()

    def test_metrics_only_beyond_a_gigabyte_and_it_is_said_before(self, here: Path) -> None:
        # 2 s at 25 Hz, 7 columns: 2.8 kB a case
        made = campaign.prepare(plans.plan(plans.gains(400_000)))
        assert not made.parts[0].recorded
        assert made.notes == (
            "histories would take 1.3 GiB, over 1.0 GiB: metrics only are kept (`--histories all` keeps them; any case "
            "can be run again alone: `--case '#0'`)",
        )

    @pytest.mark.slow
    def test_what_is_asked_for(self, here: Path) -> None:
        assert campaign.prepare(plans.plan(plans.gains(400_000)), histories="all").parts[0].recorded
        archive = batch.run(plans.plan(plans.gains(5)), output="a.h5", histories="none")
        with archive.open() as data:
            assert "q" not in data and "recorded_case" not in data.sizes
            assert np.isfinite(data.volts).all()

    def test_memory_is_bounded_by_batches(self, here: Path) -> None:
        [section] = campaign.values_sections(campaign.prepare(plans.plan(plans.gains(400_000)), histories="all"))
        assert section.most * section.prepared.experiment.structure.history_bytes <= tasks.MOST_BYTES
        assert section.most % 32 == 0

    def test_the_size_said_is_about_the_size_written(self, here: Path) -> None:
        made = campaign.prepare(plans.plan(plans.gains(500)))
        perform(made, executor=Threads())
        assert 0.7 < made.bytes / made.output.stat().st_size < 1.3  # strings and chunk indices are estimates


@pytest.mark.parametrize("case", ["#²", "#" + "9" * 5000, "#99999999999999999999", "#-1", "#"])
def test_odd_positions_are_no_cases(here: Path, case: str) -> None:
    with pytest.raises(Problem) as caught:
        campaign.prepare(plans.plan(plans.gains(3)), cases=[case])
    assert caught.value.diagnostics[0].code == "E311"


class TestTheRealEngine:
    """The plan made by hand, run by the engine: what was faked above is what the engine gives."""

    @pytest.mark.slow
    def test_bits_do_not_depend_on_the_batch(self, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        plan = plans.plan(plans.gains(9))
        found = []
        for cases in (9, 2):
            monkeypatch.setattr(tasks, "MOST_BYTES", cases * plans.gains(1).structure.history_bytes)
            found.append(batch.run(plan, output="a.h5", fresh=True).path.read_bytes())
        assert found[0] == found[1]

    @pytest.mark.slow
    @pytest.mark.parametrize("name", ["failure", "friction.splits", "metrics.kp", "q"])
    def test_a_coordinate_and_a_metric_of_the_engines_own_names(self, here: Path, name: str) -> None:

        from met import run
        from tests.batch.archive.test_archive import renamed

        experiment = renamed(plans.gains(3), "gearbox.kp", name)
        uses = (replace(experiment.structure.metrics[0], name="kp"),)
        structure = replace(experiment.structure, metrics=uses)
        parameters = {p.replace("metrics.settle.", "metrics.kp."): q for p, q in experiment.parameters.items()}
        experiment = replace(experiment, structure=structure, parameters=parameters, requirements=())
        found, plain = run.run(experiment), run.run(plans.gains(3))
        np.testing.assert_array_equal(found.coordinates[name], plain.coordinates["gearbox.kp"])
        np.testing.assert_array_equal(found.metrics["kp"], plain.metrics["settle"])
        assert not found.status.any()

    @pytest.mark.release
    def test_a_case_run_alone_is_the_case_of_the_sweep(self, here: Path) -> None:
        plan = plans.plan(plans.gains(9))
        with (
            batch.run(plan, output="all.h5").open() as whole,
            batch.run(plan, output="one.h5", cases=["#5"]).open() as one,
        ):
            np.testing.assert_array_equal(one.qd.values[0], whole.qd.values[5])
            assert one.case_id.values[0] == whole.case_id.values[5]
