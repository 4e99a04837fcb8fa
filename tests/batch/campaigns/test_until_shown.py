"""Cases are run until what is required is decided, and no more: the same ones, however they were run."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.campaigns import drive, performing, tasks, until_shown
from batch.campaigns.campaign import prepare, values_sections
from batch.campaigns.changes import changes
from batch.campaigns.folder import Folder
from batch.queries.evidence import SOME_OF_THE_TABLE, EvidenceRow, evidence
from batch.terminal.progress import status
from met.cli import main
from met.diagnostic import Problem
from met.plan import Plan
from met.plan import file as plan_file
from met.run import LOST
from met.statistics.sequential import evidence_against, evidence_for, lower_bound, percentile_rank
from tests.batch import whole
from tests.batch.door import ARM

GAINS = [0.02, 0.03, 0.033, 0.036, 0.045]
MOST = 300
SETTLE, VOLTS = (
    "late < 4 s in 95 % of cases with 90 % confidence",
    "percentile(volts, 80 %) < 5.35 V with 95 % confidence",
)
DECK = """
#include <two_link.ic>
run spread like nominal {
    rates { dynamics = 200 Hz;  servos = 100 Hz;  record = 5 Hz; }
    duration = 8 s;
    record = [qd];
    remove settle;
    metric late = settling_time { of = shoulder.qd;  target = slow;  band = 2 %; }
    require SETTLE;
    require VOLTS;
}
sweep built of spread {
    vary gearbox.kp = GAINS V*s/rad;
    sample random(COUNT) {
        gearbox.kt       = normal(0.1, 0.003) N*m/A;
        links.lower.mass = uniform(15, 40) kg;
    }
    MORE
}
"""
UNTIL = f"until_shown, at_most = {MOST}"


def deck(folder: Path, count: str = UNTIL, more: str = "", gains: list[float] = GAINS) -> Path:
    path = folder / "d.ic"
    text = DECK.replace("SETTLE", SETTLE).replace("VOLTS", VOLTS).replace("GAINS", str(gains))
    path.write_text(text.replace("COUNT", count).replace("MORE", more), encoding="utf-8")
    return path


def read(folder: Path, **options: Any) -> Plan:
    return ic.compile(deck(folder, **options), select=["built"])


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the plan, its archive, and the archive of all cases that could have been drawn."""
    folder = tmp_path_factory.mktemp("until")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        plan_file.write(read(folder), folder / "p.json")
        batch.run(plan_file.read("p.json"), output="a.h5", threads=1)
        batch.run(read(folder, count=str(MOST)), output="all.h5", threads=1, histories="none")
    return folder


@pytest.fixture
def plan(place: Path) -> Plan:
    return plan_file.read(place / "p.json")


@pytest.fixture
def undisturbed(place: Path) -> bytes:
    return (place / "a.h5").read_bytes()


def rows_of(path: Path) -> list[EvidenceRow]:
    with ArchiveFile(path) as file:
        return evidence(file.groups[0])


def first_look(missed: np.ndarray, share: float, confidence: float) -> int:
    """The number of cases after which the evidence itself decides; more than there are where it does not."""
    count, so_far, wanted = np.arange(1, len(missed) + 1), np.cumsum(missed), -math.log1p(-confidence)
    said = [evidence(count, so_far, share) >= wanted for evidence in (evidence_for, evidence_against)]
    either = said[0] | said[1]
    return int(either.argmax()) + 1 if either.any() else len(missed) + 1


# Where it stops


@pytest.mark.slow
def test_each_design_point_stops_after_the_first_case_at_which_all_is_decided(place: Path) -> None:
    drawn, kept = batch.open(place / "all.h5"), batch.open(place / "a.h5")
    stops = {}
    for number, gain in enumerate(GAINS):
        here = drawn["gearbox.kp"].values == gain
        settle, volts = drawn["late"].values[here], drawn["volts"].values[here]
        looks = first_look(~(settle < 4.0), 0.95, 0.9), first_look(~(volts < 5.35), 0.8, 0.95)
        stops[gain] = min(max(looks), MOST)
        there = kept["gearbox.kp"].values == gain
        assert kept["case"].values[there].tolist() == [number * MOST + k for k in range(stops[gain])]
        assert (kept["late"].values[there] == settle[: stops[gain]]).all()
        assert (kept["case_id"].values[there] == drawn["case_id"].values[here][: stops[gain]]).all()
    assert len(set(stops.values())) >= 4 and stops[0.033] == MOST, "the design points stop at different cases"


@pytest.mark.slow
def test_verdicts_are_those_of_the_sequential_test(place: Path) -> None:
    rows = {(row.requirement.text, row.chosen["gearbox.kp"]): row for row in rows_of(place / "a.h5")}
    found = {gain: rows[SETTLE, f"{gain} V·s/rad"] for gain in GAINS}
    assert [row.verdict for row in found.values()] == ["demonstrated"] * 2 + ["not shown"] + ["refuted"] * 2
    assert all(row.sequential and row.verdict != "not shown" for (text, _), row in rows.items() if text == VOLTS)
    for row in rows.values():
        assert row.lower is not None and row.upper is not None and row.requirement.share is not None
        wanted = {"demonstrated": row.lower >= row.requirement.share, "refuted": row.upper < row.requirement.share}
        assert wanted.get(row.verdict, row.lower < row.requirement.share <= row.upper)
        assert row.decided is None if row.verdict == "not shown" else row.decided is not None
        if row.bound is not None and row.verdict == "demonstrated":
            assert row.bound < row.requirement.limit
    last, early = found[0.033], rows[VOLTS, "0.02 V·s/rad"]
    assert last.cases == MOST and last.more > 0 and last.decided is None
    misses = last.missed
    assert evidence_for(np.array(MOST + last.more), np.array(misses), 0.95) >= math.log(10.0)
    assert evidence_for(np.array(MOST + last.more - 1), np.array(misses), 0.95) < math.log(10.0)
    assert last.lower == lower_bound(MOST, misses, 0.9)
    settle = np.sort(batch.open(place / "a.h5")["late"].values[np.add(range(MOST), 53 + stop_of(place, 0.03))])
    assert last.bound == settle[percentile_rank(MOST, 0.95, 0.9) - 1]
    assert early.decided is not None and early.decided < early.cases


def stop_of(folder: Path, gain: float) -> int:
    return int((batch.open(folder / "a.h5")["gearbox.kp"].values == gain).sum())


@pytest.mark.slow
def test_more_cases_at_most_change_none_of_those_that_are_run(place: Path, here: Path) -> None:
    longer = batch.run(read(here, count="until_shown, at_most = 450", gains=[0.03, 0.045]), output="b.h5").open()
    shorter = batch.open(place / "a.h5")
    for gain in (0.03, 0.045):
        for name in ("case_id", "late", "volts"):
            one, other = (each[name].values[each["gearbox.kp"].values == gain] for each in (longer, shorter))
            assert (one == other).all()


@pytest.mark.slow
def test_what_excludes_a_draw_leaves_the_next_ones_in_order(here: Path) -> None:
    more = "exclude when links.lower.mass > 30 kg and gearbox.kp < 0.025 V*s/rad;"
    found = batch.run(read(here, more=more, gains=[0.02, 0.03]), output="a.h5").open()
    drawn = read(here, more=more, gains=[0.02, 0.03]).experiments[0].cases.coordinates
    kp, mass = (each.values for each in drawn if each.path in ("gearbox.kp", "links.lower.mass"))
    for gain in (0.02, 0.03):
        here_kept = found["links.lower.mass"].values[found["gearbox.kp"].values == gain]
        assert (here_kept == mass[kp == gain][: len(here_kept)]).all()
        late, volts = (found[name].values[found["gearbox.kp"].values == gain] for name in ("late", "volts"))
        assert len(late) == max(first_look(~(late < 4.0), 0.95, 0.9), first_look(~(volts < 5.35), 0.8, 0.95))
    assert (mass[kp == 0.02] <= 30.0).all() and (mass[kp == 0.03] > 30.0).any()


def test_a_case_that_was_lost_misses_every_requirement(plan: Plan, here: Path) -> None:
    campaign = prepare(plan, output=here / "a.h5")
    section = values_sections(campaign)[0]
    folder = Folder(here / "a.h5.campaign")
    folder.shards.mkdir(parents=True)
    stops = []
    for lost in (0, 20):
        for task in (tasks.Task(0, 0, 20), tasks.Task(0, 20, 80), *(tasks.Task(0, k, k + 1) for k in range(lost))):
            there = folder.shards / task.name
            if task.cases == 1:
                tasks.write_shard(there, tasks.not_run(section, task, LOST, "its worker died, 3 times"))
            else:
                tasks.carry_out(section, task, folder.shards)
        if lost:
            (folder.shards / tasks.Task(0, 0, 20).name).unlink()
        points = until_shown.StoppingPoints(section)
        points.read(folder)
        stops.append(points.places_up_to_stops())
        assert points.decided == 1
    assert len(stops[0]) > len(stops[1]), "20 lost cases refute what 53 would demonstrate"


FAILING = (
    ARM
    + """
run open {
    arm = door;  initial { grip.q = 0.5 rad; }
    rates { dynamics = 100 Hz;  record = 20 Hz; }
    duration = 1 s;  record = [];
    metric end = final { of = hinge.q; }
    require end < 1e6 rad in 95 % of cases with 90 % confidence;
}
sweep pushes of open {
    sample random(until_shown, at_most = 200) { initial.hinge.qd = uniform(0.1, 0.9) rad/s; }
}
"""
)


@pytest.mark.slow
def test_failures_beyond_the_stop_do_not_count(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (here / "f.ic").write_text(FAILING, encoding="utf-8")
    plan = ic.compile("f.ic", select=["pushes"])
    [experiment] = plan.experiments
    [push] = experiment.cases.coordinates
    push.values[2::3] = 1e120 * np.arange(1.0, 67.0)  # too much for its square
    found = batch.run(plan, output="a.h5")
    [row] = rows_of(found.path)
    failed = found.summaries[0].failed
    assert row.verdict == "refuted" and 0 < failed == row.missed < row.decided == row.cases < 16
    for name, first in (("b.h5", 1), ("c.h5", 10**6)):
        monkeypatch.setattr(until_shown, "FIRST_CASES", first)
        assert batch.run(plan, output=name, max_failures=failed).path.read_bytes() == found.path.read_bytes()
        with pytest.raises(Problem, match=f"{failed} cases failed, more than the {failed - 1} allowed"):
            batch.run(plan, output=f"{first}.h5", max_failures=failed - 1)


# However it is run


SLOW = pytest.mark.slow


@pytest.mark.slow
@pytest.mark.parametrize(
    "way",
    [{"threads": 2}, pytest.param({"processes": 2}, marks=SLOW), pytest.param({"dask": "local"}, marks=SLOW)],
    ids=["threads", "processes", "dask"],
)
def test_whoever_runs_it_gives_the_same_bytes(here: Path, plan: Plan, undisturbed: bytes, way: dict[str, Any]) -> None:
    assert batch.run(plan, output="a.h5", **way).path.read_bytes() == undisturbed


@pytest.mark.slow
@pytest.mark.parametrize(
    ("first", "growth", "task"),
    [
        pytest.param(1, 1000, 1 << 18, marks=SLOW),
        pytest.param(64, 3, 7, marks=SLOW),
        (10**6, 1, 1 << 18),
    ],
)
def test_batches_and_tasks_of_any_size_give_the_same_bytes(
    here: Path, plan: Plan, undisturbed: bytes, monkeypatch: pytest.MonkeyPatch, first: int, growth: int, task: int
) -> None:
    monkeypatch.setattr(until_shown, "FIRST_CASES", first)
    monkeypatch.setattr(until_shown, "GROWTH", growth)
    monkeypatch.setattr(tasks, "MOST_CASES", task)
    if task < 32:
        for module in (tasks, drive, until_shown):
            monkeypatch.setattr(module, "GRANULE", 1)
    executor = whole.Watched()
    assert batch.run(plan, output="a.h5", executor=executor).path.read_bytes() == undisturbed
    assert sum(task.cases for task in executor.tasks) >= len(batch.open("a.h5")["case"])


@pytest.mark.slow
@pytest.mark.parametrize("after", [pytest.param(1, marks=SLOW), 3, pytest.param(6, marks=SLOW)])
def test_what_was_interrupted_goes_on_to_the_same_bytes(
    here: Path, plan: Plan, undisturbed: bytes, monkeypatch: pytest.MonkeyPatch, after: int
) -> None:
    monkeypatch.setattr(performing, "WORTH_SECONDS", 0.0)
    monkeypatch.setattr(tasks, "MOST_CASES", 64)
    with pytest.raises(KeyboardInterrupt) as stopped:
        batch.run(plan, output="a.h5", executor=whole.Watched(after=after))
    kept = whole.done(here / "a.h5", MOST * len(GAINS))
    assert str(stopped.value) == f"{kept:,} cases are kept in a.h5.campaign; the same command goes on"
    monkeypatch.setattr(until_shown, "FIRST_CASES", 96)
    rest = whole.Watched()
    again = batch.run(plan, output="a.h5", executor=rest)
    assert again.path.read_bytes() == undisturbed and again.notes[0] == f"goes on: {kept:,} cases are done"
    assert whole.beside_it(here / "a.h5") == ["a.h5", "a.h5.run.json"]
    assert batch.run(plan, output="a.h5").path.read_bytes() == undisturbed, "it is whole, and nothing is run"


SEVERAL = """
run bare like spread { record = []; }
sweep plain of bare { vary gearbox.kp = [0.021, 0.031] V*s/rad; }
sweep ways of spread {
    vary integrator = [modified_euler, rk4];
    vary gearbox.kp = [0.02, 0.04] V*s/rad;
    sample random(until_shown, at_most = 200) { gearbox.kt = normal(0.1, 0.003) N*m/A; }
}
sweep several = plain + built + ways;
"""


@pytest.mark.release
def test_sweeps_beside_it_and_structures_of_it_give_the_same_bytes_with_histories_of_some(here: Path) -> None:
    path = deck(here, gains=[0.02, 0.036])
    path.write_text(path.read_text(encoding="utf-8") + SEVERAL, encoding="utf-8")
    several, asked = ic.compile(path, select=["several"]), ["every:40", "worst:2:late"]
    one = batch.run(several, output="a.h5", threads=1, histories=asked)
    other = batch.run(several, output="b.h5", processes=2, histories=asked)
    assert one.path.read_bytes() == other.path.read_bytes()
    with ArchiveFile(one.path) as file:
        until = {group.name.partition(".")[2]: group.attributes.get("until_shown") for group in file.groups}
        counts = [group.count for group in file.groups]
        recorded = [group.recorded for group in file.groups]
    assert list(until.values()) == [None, MOST, 200, 200], until
    assert counts[0] == 2 and all(2 * 16 < count < 400 for count in counts[1:])
    assert recorded[0] == 0 and all(0 < kept < count for kept, count in zip(recorded[1:], counts[1:], strict=True))


@pytest.mark.release
def test_what_was_killed_goes_on_to_the_same_bytes(here: Path, place: Path, undisturbed: bytes) -> None:
    words = ["run", str(place / "p.json"), "-o", "a.h5", "--no-picture", "--processes", "2"]
    settings = {"batch.campaigns.tasks.MOST_CASES": 32, "batch.campaigns.until_shown.FIRST_CASES": 32}
    with whole.started(words, here, settings) as process:
        whole.until(lambda: whole.done(here / "a.h5", MOST * len(GAINS)) >= 96, process)
        process.kill()
    assert whole.done(here / "a.h5", MOST * len(GAINS)) >= 96
    assert whole.met(words, here).returncode == 1  # something is refuted
    assert (here / "a.h5").read_bytes() == undisturbed


@pytest.mark.slow
def test_a_shard_that_is_damaged_between_two_looks_is_made_again(
    here: Path, plan: Plan, undisturbed: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole_one, spoilt = until_shown.without_dropped, []

    def spoil(folder: Folder, *others: Any) -> Any:
        if not spoilt:
            spoilt.append(folder.named_tasks(0)[0])
            (folder.shards / spoilt[0].name).write_bytes(b"MET shard 1\n")
        return whole_one(folder, *others)

    monkeypatch.setattr(performing, "without_dropped", spoil)
    done = batch.run(plan, output="a.h5")
    assert done.path.read_bytes() == undisturbed
    assert [note for note in done.notes if "is cut short" in note] and spoilt


# What is kept of it


@pytest.mark.slow
def test_histories_and_shorter_steps_are_of_cases_that_are_kept(place: Path, here: Path, plan: Plan) -> None:
    few = batch.run(plan, output="a.h5", histories=["every:50", "worst:2:late", "#1"], verify="some")
    kept = few.open()
    assert set(kept["recorded_case"].values) <= set(kept["case"].values)
    worst = kept["case"].values[np.argsort(-kept["late"].values, kind="stable")[:2]]
    assert {0, 1, 50, *worst.tolist()} <= set(kept["recorded_case"].values.tolist())
    with ArchiveFile(few.path) as file, ArchiveFile(place / "a.h5") as all_of_it:
        verified = file.groups[0].verified
        assert verified is not None and set(verified.cases.tolist()) <= set(kept["case"].values.tolist())
        case = int(worst[0])
        one, other = (
            group.signal("qd", int(np.flatnonzero(group.values("case") == case)[0]))
            for group in (file.groups[0], all_of_it.groups[0])
        )
        assert (one == other).all()


@pytest.mark.slow
def test_the_history_of_a_case_that_is_dropped_is_told_of(here: Path, plan: Plan) -> None:
    told = batch.run(plan, output="a.h5", histories=["#0", "#299"])
    assert "no history of case #299 is kept: what is required was decided without it" in told.notes
    assert told.open()["recorded_case"].values.tolist() == [0]


@pytest.mark.release
def test_cases_are_run_again_with_the_same_bits(
    place: Path, here: Path, undisturbed: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", str(place / "a.h5"), "--case", f"#{MOST + 3}", "--no-picture"]) == 0
    said = capsys.readouterr().out
    assert "the same bits as in" in said and SOME_OF_THE_TABLE in said
    assert main(["run", str(place / "a.h5"), "--all", "--no-picture", "-o", "b.h5"]) == 1
    assert (here / "b.h5").read_bytes() == undisturbed


@pytest.mark.slow
def test_cases_that_a_user_chooses_are_all_run_and_give_no_confidence(here: Path, plan: Plan) -> None:
    some = batch.run(plan, output="a.h5", cases=list(range(60)))
    assert len(some.open()["case"]) == 60
    assert {row.why for row in rows_of(some.path)} == {SOME_OF_THE_TABLE}


def test_a_plan_with_cases_that_show_nothing_is_damaged(here: Path, plan: Plan) -> None:
    [experiment] = plan.experiments
    for broken, said in [
        (replace(experiment, requirements=()), "no requirement has a confidence, so nothing is to be shown"),
        (
            replace(experiment, cases=replace(experiment.cases, repeats=np.zeros(experiment.cases.count))),
            "drawn by one",
        ),
        (replace(experiment, cases=replace(experiment.cases, until_shown=-1)), "until_shown"),
    ]:
        plan_file.write(replace(plan, experiments=(broken,)), here / "b.json")
        with pytest.raises(Problem, match=said):
            plan_file.read(here / "b.json")


# What is said


@pytest.mark.slow
def test_it_is_said_beforehand_and_afterwards_everywhere(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    deck(here)
    assert main(["cases", "d.ic", "built"]) == 0
    said = capsys.readouterr().out
    assert said.startswith(f"built: at most {MOST * len(GAINS):,} cases")
    stops = f"stops at 53 cases for each design point if none misses; at most {MOST}"
    assert f"  cases for a confidence: {stops}\n" in said
    assert main(["run", "d.ic", "built", "-o", "a.h5", "--no-picture"]) == 1
    said = capsys.readouterr().out
    assert f"built: at most 1,500 cases, 8 s in 1,600 steps of 5 ms, modified_euler\n  {stops}\n" in said
    shown = "demonstrated  53 of 53 cases meet it: at least 95.06 % of all do; in 95 % of all it is at most"
    assert said.count(shown) == 1 and "(sequential test)\n" in said and "(sequential test, decided after " in said
    assert main(["show", "a.h5"]) == 0
    again = capsys.readouterr().out
    assert shown in again and f"cases of at most {MOST * len(GAINS):,}, 8 s" in again
    assert main(["show", "a.h5", "--format", "json"]) == 0
    rows = json.loads(capsys.readouterr().out)["experiments"][0]["requirements"][0]["evidence"]
    assert [(row["sequential"], row["decided"]) for row in rows][:3:2] == [(True, 53), (True, None)]
    assert main(["report", "a.h5", "-o", "a.html"]) == 0
    page = (here / "a.html").read_text(encoding="utf-8")
    assert "sequential test: the bounds hold although it was looked at after every case" in page
    assert "of at most 1,500" in page


@pytest.mark.slow
def test_a_difference_pairs_what_both_have_and_says_how_they_were_chosen(
    place: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    batch.run(read(here, gains=[0.03, 0.034]), output="b.h5")
    assert main(["diff", str(place / "a.h5"), "b.h5"]) == 1
    said = capsys.readouterr().out
    assert f"built: {stop_of(place, 0.03)} cases in both" in said
    assert "note: cases were run until it was shown what is required: chances are those of a fixed number" in said


def test_who_finds_an_archive_of_other_requirements_is_told_what_they_were(here: Path, plan: Plan) -> None:
    [experiment] = plan.experiments

    def with_(number: int, **other: Any) -> Plan:
        wanted = [replace(each, **other) if n == number else each for n, each in enumerate(experiment.requirements)]
        return replace(plan, experiments=(replace(experiment, requirements=tuple(wanted)),))

    assert changes(plan, plan) == []
    assert changes(plan, with_(0, limit=4.1)) == [f"{SETTLE}: with another limit, share or confidence"]
    assert changes(plan, with_(0, confidence=0.95)) == [f"{SETTLE}: with another limit, share or confidence"]
    assert changes(plan, with_(1, text="volts < 6 V in 80 % of cases with 95 % confidence")) == [
        f"{VOLTS} is not to be shown any more",
        "volts < 6 V in 80 % of cases with 95 % confidence is to be shown now",
    ]
    fixed = replace(plan, experiments=(replace(experiment, cases=replace(experiment.cases, until_shown=0)),))
    assert changes(plan, fixed) == ["all cases are run"]
    assert changes(fixed, plan) == ["cases are run until it is shown what is required"]


def test_a_status_tells_of_cases_and_design_points(
    here: Path, plan: Plan, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(performing, "WORTH_SECONDS", 0.0)
    monkeypatch.setattr("batch.campaigns.status.WRITE_SECONDS", 0.0)
    monkeypatch.setattr(tasks, "MOST_CASES", 64)
    with pytest.raises(KeyboardInterrupt):
        batch.run(plan, output="a.h5", executor=whole.Watched(after=8))
    assert main(["status", "a.h5"]) == 1
    said = capsys.readouterr().out
    kept = whole.done(here / "a.h5", MOST * len(GAINS))
    assert said.startswith(f"a.h5.campaign: {kept:,} of at most 1,500 cases are done\n")
    assert "of 5 design points decided" in said


def test_a_status_line_of_cases_whose_number_is_not_known() -> None:
    said = status("built", 250, 0, 2.0, bar=True, more="3 of 5 design points decided")
    assert said == "built  250 cases, 3 of 5 design points decided  125 cases/s"


def test_jobs_with_fixed_shares_are_refused(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    deck(here)
    assert main(["submit", "--slurm", "d.ic", "built"]) == 2
    assert capsys.readouterr().err == (
        "error[E358]: jobs have shares that are fixed beforehand, and `until_shown` runs cases until something is "
        "shown\n"
        " = help: `met run --dask` runs it on workers, which may be jobs of SLURM: docs/cluster.md\n"
        " = help: or draw a number of cases: `sample random(N) { ... }`\n\n1 error\n"
    )
    assert list(here.glob("*.campaign")) == []
