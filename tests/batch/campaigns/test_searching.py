"""A search is a campaign with generations: the same bytes and the same answer, whoever runs it and however often it was
killed."""

from __future__ import annotations

import json
import math
import random
import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.campaigns import performing, searching, tasks
from batch.campaigns.campaign import Wires, prepare
from batch.campaigns.folder import Folder
from batch.queries.search_answers import SearchAnswer
from met.cli import main
from met.diagnostic import Problem
from met.plan import Plan
from met.plan import file as plan_file
from met.searches.answer import Answer
from tests.batch import whole
from tests.batch.slider import FAR, MASS, swing

AT_MOST, TUNED = 160, 300

# far is least where k = m pi^2.
RUN = swing(
    "integrator = rk4;",
    "metric far = final { of = slide.q; }",
    "metric off = final { of = abs(slide.q); }",
    "metric top = max { of = slide.qd; }",
    "require far > -0.05 m;",
    "require top < 1 m/s;",
)
DECK = f"""{RUN}\
search back of swing {{
    minimise far;
    environment.held.stiffness = between(5, 79) N/m;
    at_most = {AT_MOST};
}}
search wild of swing {{
    minimise far;
    environment.held.stiffness = logbetween(1, 1e9) N/m;
    at_most = 64;
}}
sweep loads of swing {{ vary links.block.mass = [2, 1, 1.5, 3, 2.5] kg; }}
tune still of swing {{
    choose environment.held.stiffness = between(2, 9) N/m;
    against loads;
    minimise off;
    at_most = {TUNED};
}}
"""


@dataclass(frozen=True)
class Said:
    """The answer of a search with one parameter, whose value reads back to the bit."""

    found: Answer
    position: int
    exact: str


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the deck, its plan, and the archive of a serial run of a search and a tuning."""
    folder = tmp_path_factory.mktemp("searches")
    (folder / "d.ic").write_text(DECK)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        plan = ic.compile("d.ic", select=["back", "still"])
        plan_file.write(plan, "p.json")
        batch.run(plan, output="undisturbed.h5", threads=1)
    return folder


@pytest.fixture
def plan(place: Path) -> Plan:
    return plan_file.read(place / "p.json")


@pytest.fixture
def undisturbed(place: Path) -> bytes:
    return (place / "undisturbed.h5").read_bytes()


def answers(path: Path) -> dict[str, Said]:
    found = {}
    with ArchiveFile(path) as file:
        for group in file.groups:
            each = SearchAnswer.of(group)
            assert each is not None
            [chosen] = each.values()
            found[group.name] = Said(each.best, each.position, chosen.text)
    return found


def cases_of(archive: Path, number: int = 0) -> int:
    """Cases of a search, by number, that have a shard."""
    tasks = Folder(Path(f"{archive}.campaign")).named_tasks(number)
    return max((task.last for task in tasks), default=0)


# What it finds


@pytest.mark.slow
def test_the_least_value_is_where_the_closed_form_has_it(place: Path) -> None:
    found = answers(place / "undisturbed.h5")["back"].found
    assert found.value == pytest.approx(-FAR, abs=1e-6)
    with ArchiveFile(place / "undisturbed.h5") as file:
        stiffness = file.groups[0].values("environment.held.stiffness")[found.case]
    assert stiffness == pytest.approx(MASS * math.pi**2, rel=1e-2)


@pytest.mark.slow
def test_every_case_of_it_obeys_the_closed_form(place: Path) -> None:
    data = batch.open(place / "undisturbed.h5")["back"]
    stiffness = data["environment.held.stiffness"].values
    assert data["far"].values == pytest.approx(FAR * np.cos(np.sqrt(stiffness / MASS)), abs=1e-8)


@pytest.mark.slow
def test_a_tuning_is_held_against_the_worst_of_its_plants(place: Path) -> None:
    """The lightest load and the heaviest are equally far from the middle where sqrt(k) (1 + 1/sqrt(3)) = pi."""
    answer = answers(place / "undisturbed.h5")["still"].found
    data = batch.open(place / "undisturbed.h5")["still"]
    assert answer.confirmed and answer.serves and answer.tried == 5
    assert sorted(data["links.block.mass"].values[list(answer.cases)].tolist()) == [1.0, 1.5, 2.0, 2.5, 3.0]
    phase = math.pi / (1.0 + 1.0 / math.sqrt(3.0))
    assert answer.value == pytest.approx(FAR * abs(math.cos(phase)), rel=1e-2)
    assert data["environment.held.stiffness"].values[answer.case] == pytest.approx(phase**2, rel=1e-2)
    assert data["links.block.mass"].values[answer.case] in (1.0, 3.0)
    assert answer.ends == ()
    assert answer.rooms[0].text == "far > -0.05 m"


@pytest.mark.slow
def test_a_tuning_says_how_far_it_went_along_slopes_and_comes_nearer_than_without(
    place: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "d.ic").write_text(DECK.replace("against loads;", "against loads;  gradients = off;"))
    assert main(["run", "d.ic", "still", "--no-picture", "-o", "off.h5"]) == 0
    assert "slopes" not in capsys.readouterr().out
    with ArchiveFile(place / "undisturbed.h5") as file:
        answer = SearchAnswer.of(next(group for group in file.groups if group.name == "still"))
        assert answer is not None and answer.as_data()["without_slopes"] is None
        count = answer.as_data()["along_slopes"]
        assert count > 20 and f"  {count} of them along exact slopes of the metrics" in answer.lines()
    phase = math.pi / (1.0 + 1.0 / math.sqrt(3.0))
    least = FAR * abs(math.cos(phase))
    near, far = (answers(path)["still"].found for path in (place / "undisturbed.h5", here / "off.h5"))
    assert near.value == pytest.approx(least, rel=1e-5) and far.value > 1.001 * least


@pytest.mark.slow
def test_a_tuning_of_what_has_no_slopes_says_why(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A share of samples moves in steps alone."""
    metric = "metric off = share_of_time { of = slide.q < 0 m; }"
    (here / "d.ic").write_text(DECK.replace("metric off = final { of = abs(slide.q); }", metric))
    main(["run", "d.ic", "still", "--no-picture", "-o", "s.h5"])
    said = capsys.readouterr().out
    assert "\n  no slopes to go by: `off`: it moves in steps alone, of a sample or of a count\n" in said


@pytest.mark.slow
def test_a_tuning_that_finds_nothing_says_so_of_what_was_tried_and_that_its_cases_are_spent(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    slow = DECK.replace("far > -0.05 m", "far > 1 m").replace(f"at_most = {TUNED}", "at_most = 60")
    (here / "d.ic").write_text(slow)
    assert main(["run", "d.ic", "still", "--no-picture", "-o", "s.h5"]) == 1
    said = capsys.readouterr().out
    tried = len(np.unique(batch.open(here / "s.h5")["environment.held.stiffness"].values))
    assert f"none of the {tried} candidates tried is found to meet all that is required; nearest: " in said
    assert "\n  its cases are spent, of 60 at most; a larger `at_most` goes on\n" in said


@pytest.mark.slow
def test_a_case_that_fails_hurts_most(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "d.ic").write_text(DECK)
    assert main(["run", "d.ic", "wild", "--no-picture", "-o", "w.h5"]) == 1
    said = capsys.readouterr().out
    answer = answers(here / "w.h5")["wild"]
    assert answer.found.failed and not answer.found.serves
    data = batch.open(here / "w.h5")
    failed = int((data["status"] != 0).sum())
    assert 0 < failed < data.sizes["case"]
    where = f"case #{answer.position} with environment.held.stiffness = {answer.exact}"
    _, _, told = said.partition(f"the worst of search `wild`: {where} fails\n")
    cause, _, rest = told.partition(f"  {failed} of {data.sizes['case']} cases in ")
    assert rest and " ".join(cause.split()) == str(data["cause"].values[answer.found.case])
    assert f"run it again: met run w.h5 --case '#{answer.position}'\n" in said


# However it is run


@pytest.mark.release
@pytest.mark.parametrize(
    "way",
    [{"threads": 2}, {"processes": 2}, pytest.param({"dask": "local"}, marks=pytest.mark.slow)],
    ids=["threads", "processes", "dask"],
)
def test_whoever_runs_it_gives_the_same_bytes(here: Path, plan: Plan, undisturbed: bytes, way: dict[str, Any]) -> None:
    assert batch.run(plan, output="a.h5", **way).path.read_bytes() == undisturbed


@pytest.mark.slow
def test_tasks_of_any_size_give_the_same_bytes(
    here: Path, plan: Plan, undisturbed: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tasks, "MOST_CASES", 5)
    assert batch.run(plan, output="a.h5").path.read_bytes() == undisturbed


@pytest.mark.release
@pytest.mark.parametrize("after", [1, 4, 9])
def test_what_was_interrupted_goes_on_to_the_same_bytes(
    here: Path, plan: Plan, undisturbed: bytes, monkeypatch: pytest.MonkeyPatch, after: int
) -> None:
    monkeypatch.setattr(performing, "WORTH_SECONDS", 0.0)
    with pytest.raises(KeyboardInterrupt) as stopped:
        batch.run(plan, output="a.h5", executor=whole.Watched(after=after))
    kept = cases_of(here / "a.h5")
    assert str(stopped.value) == f"{kept:,} cases are kept in a.h5.campaign; the same command goes on"
    rest = whole.Watched()
    again = batch.run(plan, output="a.h5", executor=rest)
    assert again.path.read_bytes() == undisturbed and again.notes[0] == f"goes on: {kept:,} cases are done"
    assert min(task.first for task in rest.tasks if task.section == 0) == kept, "what is done is not run again"
    assert whole.beside_it(here / "a.h5") == ["a.h5", "a.h5.run.json"]
    assert batch.run(plan, output="a.h5").path.read_bytes() == undisturbed, "it is whole, and nothing is run"


@pytest.mark.release
@pytest.mark.parametrize("way", [("--threads", "2"), ("--processes", "2")], ids=lambda way: way[0])
def test_what_is_killed_at_ten_generations_goes_on_to_the_same_bytes(
    here: Path, place: Path, undisturbed: bytes, way: tuple[str, str]
) -> None:
    words = ["run", str(place / "p.json"), "-o", "a.h5", "--no-picture", *way]
    draws = random.Random(7)
    for at in sorted(draws.sample(range(1, AT_MOST - 30), 10)):
        with whole.started(words, here, {"batch.campaigns.tasks.MOST_CASES": 8}) as process:
            whole.until(lambda at=at: cases_of(here / "a.h5") >= at, process)
            process.kill()
    assert whole.met(words, here).returncode == 1  # the search found what misses a requirement
    assert (here / "a.h5").read_bytes() == undisturbed


@pytest.mark.slow
def test_a_shard_that_is_damaged_is_made_again(
    here: Path, plan: Plan, undisturbed: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(performing, "WORTH_SECONDS", 0.0)
    with pytest.raises(KeyboardInterrupt):
        batch.run(plan, output="a.h5", executor=whole.Watched(after=5))
    folder = Folder(here / "a.h5.campaign")
    (folder.shards / folder.named_tasks(0)[1].name).write_bytes(b"MET shard 1\n")
    again = batch.run(plan, output="a.h5")
    assert again.path.read_bytes() == undisturbed
    assert [note for note in again.notes if "is cut short" in note]


@pytest.mark.slow
def test_another_search_is_no_part_of_it(here: Path, place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its first generation is the same; what comes after is not."""
    monkeypatch.setattr(performing, "WORTH_SECONDS", 0.0)
    for old, new in (("minimise far", "maximise top"), ("minimise far", "maximise far")):
        (here / "d.ic").write_text(DECK)
        with pytest.raises(KeyboardInterrupt):
            batch.run(ic.compile("d.ic", select=["back"]), output="a.h5", executor=whole.Watched(after=2))
        (here / "d.ic").write_text(DECK.replace(old, new))
        with pytest.raises(Problem) as refused:
            batch.run(ic.compile("d.ic", select=["back"]), output="a.h5")
        [said] = refused.value.diagnostics
        assert said.code == "E353" and "cases of another campaign, and is left as it is" in said.message
        batch.run(ic.compile("d.ic", select=["back"]), output="a.h5", fresh=True)
        (here / "a.h5").unlink()
        (here / "a.h5.run.json").unlink()


@pytest.mark.slow
def test_a_tuning_with_another_limit_is_no_part_of_it(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its cases are worth more or less by the limits, so others follow; of a search they are what they were."""
    monkeypatch.setattr(performing, "WORTH_SECONDS", 0.0)
    for name in ("still", "back"):
        (here / "d.ic").write_text(DECK)
        with pytest.raises(KeyboardInterrupt):
            batch.run(ic.compile("d.ic", select=[name]), output=f"{name}.h5", executor=whole.Watched(after=3))
        (here / "d.ic").write_text(DECK.replace("top < 1 m/s", "top < 2 m/s"))
        if name == "back":
            assert batch.run(ic.compile("d.ic", select=[name]), output="back.h5").notes[0].startswith("goes on: ")
            continue
        with pytest.raises(Problem) as refused:
            batch.run(ic.compile("d.ic", select=[name]), output="still.h5")
        [said] = refused.value.diagnostics
        assert said.code == "E353"
        assert "requirements: top < 1 m/s -> top < 2 m/s" in " ".join(said.help)


# What is in the archive


@pytest.mark.slow
def test_generations_stand_beside_the_cases(place: Path) -> None:
    data = batch.open(place / "undisturbed.h5")
    for name, at_most in (("back", AT_MOST), ("still", TUNED)):
        found = data[name]
        generation = found["generation"].values
        assert "generation" in found.coords and (np.diff(generation) >= 0).all()
        assert set(generation) == set(range(generation[-1] + 1))
        assert found.sizes["case"] <= at_most
    assert {name: value for name, value in data["still"].attrs.items() if name.startswith("search")} == {
        "search": "tune", "search_of": "swing", "search_goal": "minimise off", "search_at_most": TUNED,
        "search_seed": 0, "search_margin": 0.05, "search_against": "loads", "search_plants": 5, "search_drawn_with": 0,
        "search_along_slopes": 34, "search_without_slopes": "", "search_least_margin": 0.3, "search_steers": 0,
        "search_starts": '[{"first": 0, "best": 123}, {"first": 189, "best": 278}, {"first": 283, "best": -1}]',
        "search_judged": '[{"case": 121, "margins": null, "why_not": "no law closes a loop over the arm"}]',
    }  # fmt: skip
    assert "search_along_slopes" not in data["back"].attrs
    chosen = data["back"]["environment.held.stiffness"].attrs
    assert (chosen["low"], chosen["high"], chosen["steps"]) == (5.0, 79.0, "equal")


def test_the_history_of_the_answer_alone_is_kept(place: Path) -> None:
    with ArchiveFile(place / "undisturbed.h5") as file:
        for group in file.groups:
            answer = SearchAnswer.of(group)
            assert answer is not None
            assert group.recorded_positions.tolist() == [answer.best.case]


@pytest.mark.slow
@pytest.mark.parametrize(("histories", "kept"), [("all", None), ("none", 0), ("worst:2:top", 2)])
def test_other_histories_are_kept_where_they_are_asked_for(here: Path, plan: Plan, histories: str, kept: int) -> None:
    done = batch.run(plan, output="a.h5", experiments=["back"], histories=histories)
    with ArchiveFile(done.path) as file:
        [group] = file.groups
        assert group.recorded == (group.count if kept is None else kept)


@pytest.mark.release
def test_its_cases_are_run_again_to_the_same_bits(here: Path, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    archive = str(place / "undisturbed.h5")
    position = answers(place / "undisturbed.h5")["back"].position
    assert main(["run", archive, "--case", f"#{position}", "--no-picture"]) == 1
    assert f"the same bits as in {archive}" in capsys.readouterr().out
    assert main(["run", archive, "--all", "--no-picture", "-o", "again.h5"]) == 1
    assert f"the same bits as in {archive}" in capsys.readouterr().out
    assert (here / "again.h5").read_bytes() == (place / "undisturbed.h5").read_bytes()
    assert main(["diff", archive, "again.h5"]) == 0


@pytest.mark.release
def test_every_reader_of_archives_reads_it(here: Path, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    archive = str(place / "undisturbed.h5")
    for words in (
        "show {}", "show {} --where 'far < 0 m'", "show {} --evidence --run still",
        "best {} --run still", "report {} -o r.html", "plot {} --run back -o p.png",
        "export {} --run back --to csv -o e.csv", "show {} --format json", "status {}",
    ):  # fmt: skip
        assert main(shlex.split(words.format(shlex.quote(archive)))) in (0, 1), words
        assert "Traceback" not in capsys.readouterr().err


def test_some_of_its_cases_are_no_search(here: Path, place: Path) -> None:
    (here / "d.ic").write_text(DECK)
    done = batch.run(ic.compile("d.ic", select=["back"]), output="a.h5", cases=[0, 3])
    with ArchiveFile(done.path) as file:
        assert file.groups[0].count == 2 and SearchAnswer.of(file.groups[0]) is None


# What is said


@pytest.mark.slow
def test_it_is_said_beforehand_and_afterwards(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "d.ic").write_text(DECK)
    assert main(["run", "d.ic", "still", "--no-picture"]) == 0, "its answer meets all, whatever was tried on the way"
    said = capsys.readouterr().out
    assert said.startswith(
        f"still: at most {TUNED} cases, 1 s in 200 steps of 5 ms, rk4\n"
        "  minimise off by environment.held.stiffness, against 5 cases of loads\n"
        "  histories of its answer: q\n"
        "writing d.still.h5, at most about "
    )
    answer = answers(here / "d.still.h5")["still"]
    assert f"\nuse environment.held.stiffness = {answer.exact}\n" in said
    assert " in the worst of 5 cases of loads; " in said
    assert "\nnothing was drawn in loads, so that no other draws confirm it; run it:\n  met run d.ic loads " in said
    assert f"  met run d.ic loads --set 'environment.held.stiffness={answer.exact}' -o chosen.h5\n" in said
    assert "demonstrated" not in said
    assert main(["show", "d.still.h5"]) == 0
    assert f"\nuse environment.held.stiffness = {answer.exact}" in capsys.readouterr().out
    assert main(["run", "d.ic", "still", "--format", "json"]) == 0
    told = json.loads(capsys.readouterr().out)["experiments"][0]["answer"]
    assert told["serves"] and told["tried"] == told["against"] == 5 and told["case"] == answer.position


@pytest.mark.slow
def test_a_search_of_one_case_has_an_answer(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "d.ic").write_text(DECK.replace(f"at_most = {AT_MOST};", "at_most = 1;"))
    assert main(["run", "d.ic", "back", "--no-picture", "-q"]) == 0
    capsys.readouterr()
    assert main(["best", "d.back.h5"]) == 0
    said = capsys.readouterr().out
    assert (
        said.startswith("the worst of search `back`: far = ")
        and "\n  the least far of 1 case in 1 generation\n" in said
    )


def test_a_case_behind_the_first_generation_is_one_of_its_archive(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "d.ic").write_text(DECK)
    assert main(["run", "d.ic", "back", "--case", "#150"]) == 2
    assert capsys.readouterr().err == (
        "error[E311]: no case `#150`\n"
        " = help: each case of the search `back` follows from those before: run one again from its archive: "
        "`met run ARCHIVE.h5 --case '#150'`\n"
        "\n1 error\n"
    )
    assert main(["run", "d.ic", "back", "loads", "--case", "#150"]) == 2
    said = capsys.readouterr().err
    assert "`back` follows" in said and " = help: `loads` has #0 to #4\n" in said


def test_progress_tells_the_best_so_far(here: Path, plan: Plan) -> None:
    class Heard:
        def __init__(self) -> None:
            self.more: list[str] = []

        def begin(self, name: str, cases: int, done: int, failed: int, workers: str) -> None: ...

        def advance(self, done: int, failed: int, more: str = "") -> None:
            self.more.append(more)

        def end(self) -> None: ...

    heard = Heard()
    batch.run(plan, output="a.h5", experiments=["back"], progress=heard)
    told = list(dict.fromkeys(filter(None, heard.more)))
    assert told[-1] == "worst far -0.1 m, misses far > -0.05 m"
    values = [float(each.split()[2]) for each in told]
    assert values == sorted(values, reverse=True)


# What is refused


def test_jobs_with_fixed_shares_are_refused(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "d.ic").write_text(DECK)
    assert main(["submit", "d.ic", "back", "--slurm"]) == 2
    assert capsys.readouterr().err == (
        "error[E358]: jobs have shares that are fixed beforehand, and a search asks for cases as it goes\n"
        " = help: `met run --dask` runs it on workers, which may be jobs of SLURM: docs/cluster.md\n\n1 error\n"
    )


def test_a_search_is_not_driven_on_beds(plan: Plan) -> None:
    with pytest.raises(Problem) as refused:
        prepare(plan, output="a.h5", wires=Wires(0))
    assert [each.code for each in refused.value.diagnostics] == ["E313"]


def test_a_plan_whose_cases_are_not_those_that_it_begins_with_is_refused(here: Path, plan: Plan) -> None:
    experiment = plan.experiments[0]
    [coordinate] = experiment.cases.coordinates
    values = np.asarray(coordinate.values).copy()
    values[2] += 1.0
    cases = replace(experiment.cases, coordinates=(replace(coordinate, values=values),))
    with pytest.raises(Problem) as refused:
        batch.run(replace(plan, experiments=(replace(experiment, cases=cases),)), output="a.h5")
    [said] = refused.value.diagnostics
    assert said.code == "E302"
    assert said.message == "the cases of `back` in this plan are not those that it begins with"


def test_results_that_cannot_be_read_back_stop_it(here: Path, plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(searching, "_held", lambda driver, section, first, last, tell: ([], [(first, last)]))
    with pytest.raises(Problem) as stopped:
        batch.run(plan, output="a.h5", experiments=["back"])
    assert "what is computed of back cannot be read back from" in stopped.value.diagnostics[0].message


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("search", "guess"), ("search_goal", "minimise nothing"), ("search_goal", "far"), ("search_at_most", 0),
        ("search_at_most", "many"), ("search_plants", -1), ("search_margin", 1.5), ("search_seed", -1),
        ("search_least_margin", 2.0), ("search_judged", "["), ("search_judged", '[{"case": 9999, "margins": null}]'),
        ("search_judged", '[{"case": 0, "margins": 7}]'), ("search_judged", "[" * 100_000),
        ("search_at_most", 20), ("search_plants", 4), ("search_plants", 10_000), ("search_against", ""),
        ("search", "search"),
    ],
)  # fmt: skip
def test_an_archive_that_says_of_a_search_what_none_is_is_no_archive(
    here: Path, undisturbed: bytes, name: str, value: object
) -> None:

    (here / "a.h5").write_bytes(undisturbed)
    with h5py.File(here / "a.h5", "r+") as file:
        file["still"].attrs[name] = value
    with pytest.raises(Problem) as refused, ArchiveFile(here / "a.h5") as file:
        [SearchAnswer.of(group) for group in file.groups]
    assert [each.code for each in refused.value.diagnostics] == ["E302"]


COORDINATE = "environment.held.stiffness"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "at", "value"),
    [
        (COORDINATE, 3, math.nan), (COORDINATE, 3, math.inf), (COORDINATE, 0, 1.99), (COORDINATE, -1, 9.01),
        ("generation", 0, 1), ("generation", -1, 0), ("generation", -1, 1 << 62), ("generation", 1, -1),
    ],
)  # fmt: skip
def test_an_archive_whose_cases_no_search_asks_for_is_no_archive(
    here: Path, undisturbed: bytes, name: str, at: int, value: float
) -> None:

    (here / "a.h5").write_bytes(undisturbed)
    with h5py.File(here / "a.h5", "r+") as file:
        file["still"][name][at] = value
    with pytest.raises(Problem) as refused, ArchiveFile(here / "a.h5") as file:
        [SearchAnswer.of(group) for group in file.groups]
    assert [each.code for each in refused.value.diagnostics] == ["E302"]


@pytest.mark.slow
@pytest.mark.parametrize(("low", "high"), [(0.0, 9.0), (-1.0, 9.0), (-9.0, 0.0), (math.nan, 9.0), (2.0, math.inf)])
def test_ends_without_a_ratio_are_none_of_equal_ratios(here: Path, undisturbed: bytes, low: float, high: float) -> None:

    (here / "a.h5").write_bytes(undisturbed)
    with h5py.File(here / "a.h5", "r+") as file:
        file["still"][COORDINATE].attrs.update({"low": low, "high": high, "steps": "ratios"})
    with pytest.raises(Problem) as refused, ArchiveFile(here / "a.h5") as file:
        [SearchAnswer.of(group) for group in file.groups]
    assert [each.code for each in refused.value.diagnostics] == ["E302"]
