"""The same archive, to the byte, however its cases were cut into tasks and whoever ran them; and the same bits of a
case, whatever is run or kept beside it."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.campaigns import drive, performing, tasks
from met import cli
from met.plan import Experiment, Plan
from met.plan import file as plan_file
from tests.batch import plans, whole

# Four sweeps: plain, of two structures, of a motor bed with noise that is common, and with noise of each case.
DECK = """
#include <two_link.ic>

run brief like nominal { duration = 1 s; }
run bench like hybrid  { duration = 1 s; }

sweep gain  of brief { vary gearbox.kp = linspace(0.010, 0.040, 40) V*s/rad; }
sweep way   of brief { vary integrator = [modified_euler, rk4];  vary gearbox.ki = linspace(0.06, 0.25, 9) V/rad; }
sweep noise of bench { vary shoulder.bed.kt = [0.058, 0.061, 0.064] N*m/A;  repeat 3; }
sweep own   of bench { vary shoulder.bed.kt = [0.058, 0.061, 0.064] N*m/A;  repeat 3;  seeds = independent;  seed = 5; }
"""
NAMES = ("gain", "way", "noise", "own")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the deck, its plan, and the archive of a serial run in one piece."""
    folder = tmp_path_factory.mktemp("decks")
    (folder / "d.ic").write_text(DECK)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        found = ic.compile("d.ic", select=NAMES)
        plan_file.write(found, "p.json")
        batch.run(found, output="undisturbed.h5", threads=1)
    return folder


@pytest.fixture
def plan(place: Path) -> Plan:
    return plan_file.read(place / "p.json")


@pytest.fixture
def undisturbed(place: Path) -> bytes:
    return (place / "undisturbed.h5").read_bytes()


def small_tasks(patch: pytest.MonkeyPatch, cases: int) -> None:
    """Tasks of so many cases at most, whatever suits a kernel."""
    patch.setattr(tasks, "MOST_CASES", cases)
    patch.setattr(tasks, "GRANULE", 1)
    patch.setattr(drive, "GRANULE", 1)


# However it is run


@pytest.mark.release
@pytest.mark.parametrize("threads", [1, 2])
def test_threads(here: Path, plan: Plan, undisturbed: bytes, threads: int) -> None:
    assert batch.run(plan, output="a.h5", threads=threads).path.read_bytes() == undisturbed


@pytest.mark.slow
@pytest.mark.parametrize("processes", [1, 2, 3, 4])
def test_processes(here: Path, plan: Plan, undisturbed: bytes, processes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    small_tasks(monkeypatch, 5)
    assert batch.run(plan, output="a.h5", processes=processes).path.read_bytes() == undisturbed


@pytest.mark.release
@pytest.mark.parametrize("cases", [1, 7, 33])
def test_tasks_of_any_size(
    here: Path, plan: Plan, undisturbed: bytes, cases: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    small_tasks(monkeypatch, cases)
    executor = whole.Watched()
    assert batch.run(plan, output="a.h5", executor=executor).path.read_bytes() == undisturbed
    assert max(task.cases for task in executor.tasks) == min(cases, 40)


@pytest.mark.release
@pytest.mark.parametrize("cases", [5, 32])
def test_tasks_of_so_many_bytes(
    here: Path, plan: Plan, undisturbed: bytes, cases: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tasks, "MOST_BYTES", cases * plan.experiments[0].structure.history_bytes)
    executor = whole.Watched()
    assert batch.run(plan, output="a.h5", executor=executor).path.read_bytes() == undisturbed
    assert max(task.cases for task in executor.tasks if task.section == 0) == cases


@pytest.mark.release
def test_blocks_that_are_merged_decide_nothing_but_where_text_lies(
    here: Path, plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Blocks of cases are cut at fixed places, whatever the tasks were; so a shard may end within one."""
    from batch.campaigns import merge

    found = []
    for cases in (3, 4, 40):
        with monkeypatch.context() as patch:
            patch.setattr(merge, "BLOCK", 10)
            small_tasks(patch, cases)
            found.append(batch.run(plan, output=f"{cases}.h5", threads=1).path.read_bytes())
    assert found[0] == found[1] == found[2]


@pytest.mark.release
@pytest.mark.parametrize("sizes", [(7, 4), (1, 40)])
def test_interrupted_and_gone_on_with_tasks_of_another_size(
    here: Path, plan: Plan, undisturbed: bytes, sizes: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each time with all of the shards that there were before: they overlap."""
    monkeypatch.setattr(performing, "WORTH_SECONDS", 0.0)
    shards = whole.folder_of(Path("a.h5")).shards
    Path("aside").mkdir()
    for size in sizes:
        small_tasks(monkeypatch, size)
        with pytest.raises(KeyboardInterrupt):
            batch.run(plan, output="a.h5", executor=whole.Watched(after=4), fresh=True)
        for path in shards.iterdir():
            path.rename(Path("aside", path.name))
    for path in Path("aside").iterdir():
        path.rename(shards / path.name)
    small_tasks(monkeypatch, 6)
    assert whole.run_twice(Path("a.h5"))
    assert batch.run(plan, output="a.h5", threads=1).path.read_bytes() == undisturbed


@pytest.mark.release
def test_a_deck_and_its_plan_file(
    place: Path, tmp_path: Path, undisturbed: bytes, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(place)
    for source, names in (("d.ic", NAMES), ("p.json", ())):
        output = tmp_path / f"{source}.h5"
        cli.main(["run", source, *names, "-o", str(output), "--no-picture", "-q"])
        assert output.read_bytes() == undisturbed
    assert "error" not in capsys.readouterr().err


@pytest.mark.release
def test_whole_processes(place: Path, tmp_path: Path, undisturbed: bytes) -> None:
    for number, words in enumerate((["--threads", "2"], ["--processes", "2"], ["--processes", "1", "--threads", "2"])):
        output = tmp_path / f"{number}.h5"
        ended = whole.met(["run", "p.json", "-o", str(output), "--no-picture", *words], place)
        assert not re.search("error|Traceback", ended.stderr), ended.stderr  # it is warned of what its run cannot show
        assert output.read_bytes() == undisturbed


@pytest.mark.release
@pytest.mark.parametrize(
    ("histories", "single"),
    [(("every:3",), True), (("worst:3:volts", "#3"), False), (("failed", "every:11"), False), (("none",), False)],
)
def test_histories_of_some_cases(
    here: Path, plan: Plan, histories: tuple[str, ...], single: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of the second pass, too: in one piece, in small ones, and interrupted in the midst of it."""
    options: dict[str, Any] = {"histories": histories, "float32": single, "experiments": ["gain", "own"]}
    before = batch.run(plan, output="whole.h5", threads=2, **options).path.read_bytes()
    small_tasks(monkeypatch, 4)
    executor = whole.Watched()
    assert batch.run(plan, output="small.h5", executor=executor, **options).path.read_bytes() == before
    monkeypatch.setattr(performing, "WORTH_SECONDS", 0.0)
    with pytest.raises(KeyboardInterrupt):
        batch.run(plan, output="again.h5", executor=whole.Watched(after=len(executor.tasks) - 1), **options)
    small_tasks(monkeypatch, 3)
    assert batch.run(plan, output="again.h5", threads=1, **options).path.read_bytes() == before


# More cases change no old one


def bits(values: np.ndarray) -> np.ndarray:
    return values.view(f"i{values.itemsize}") if values.dtype.kind == "f" else values


def by_key(path: Path) -> dict[tuple[str, str], dict[str, np.ndarray]]:
    """Of every case of an archive that has all histories, by its experiment and case_key: metrics, signals, the end."""
    out = {}
    with ArchiveFile(path) as file:
        for group in file.groups:
            names = [v.name for role in ("metric", "signal", "coordinate") for v in group.role(role)]
            names += ["status", "cause", "n_valid", "seed", "repeat"]
            read = {name: group.values(name) for name in names if name in group.variables}
            assert group.recorded == group.count
            for position, key in enumerate(group.values("case_key")):
                out[group.name, key] = {name: values[position] for name, values in read.items()}
    return out


GAIN = "vary gearbox.kp = [0.010, 0.020, 0.030] V*s/rad;"
KI = "vary gearbox.ki = [0.1, 0.2] V/rad;"
KT = "vary shoulder.bed.kt = [0.058, 0.064] N*m/A;"
EXTENSIONS = {
    "more values, at the end": ("brief", GAIN, GAIN.replace("0.030]", "0.030, 0.040]")),
    "more values, between": ("brief", GAIN, GAIN.replace("0.020", "0.015, 0.020, 0.025")),
    "values in another order": ("brief", GAIN, GAIN.replace("0.010, 0.020", "0.020, 0.010")),
    "more values of a second axis": (
        "brief",
        f"{GAIN} {KI}",
        f"{GAIN} {KI.replace('0.1, ', '0.1, 0.15, ')}",
    ),
    "axes the other way round": (
        "brief",
        f"{GAIN} {KI}",
        f"{KI} {GAIN}",
    ),
    "fewer left out": (
        "brief",
        f"{GAIN} exclude when gearbox.kp < 0.012 V*s/rad;",
        f"{GAIN} exclude when gearbox.kp < 0.002 V*s/rad;",
    ),
    "another structure": (
        "brief",
        f"{GAIN} vary integrator = [modified_euler, rk4];",
        f"{GAIN} vary integrator = [midpoint, modified_euler, rk4];",
    ),
    "more repeats, common noise": ("bench", f"{KT} repeat 2;", f"{KT} repeat 5;"),
    "more repeats, own noise": (
        "bench",
        f"{KT} repeat 2; seeds = independent;",
        f"{KT} repeat 5; seeds = independent;",
    ),
    "more values, own noise": (
        "bench",
        f"{KT} repeat 2; seeds = independent;",
        f"{KT.replace('0.064', '0.061, 0.064')} repeat 2; seeds = independent;",
    ),
    "more samples at random": (
        "brief",
        "sample random(5) { gearbox.kp = uniform(0.01, 0.04) V*s/rad; }",
        "sample random(9) { gearbox.kp = uniform(0.01, 0.04) V*s/rad; }",
    ),
    "more samples of Sobol's": (
        "brief",
        "sample sobol(4) { gearbox.kp = uniform(0.01, 0.04) V*s/rad; }",
        "sample sobol(16) { gearbox.kp = uniform(0.01, 0.04) V*s/rad; }",
    ),
}


def extended(run: str, entries: str) -> Path:
    """The archive of a sweep with these entries."""
    duration = "run brief like nominal { duration = 1 s; }\nrun bench like hybrid { duration = 1 s; }\n"
    Path("d.ic").write_text(f"#include <two_link.ic>\n{duration}sweep it of {run} {{ {entries} }}\n")
    return batch.run(ic.compile("d.ic", select=["it"]), output=f"{len(list(Path('.').iterdir()))}.h5").path


@pytest.mark.release
@pytest.mark.parametrize("what", EXTENSIONS)
def test_more_cases_change_no_old_one(here: Path, what: str) -> None:
    run, before, after = EXTENSIONS[what]
    old, new = by_key(extended(run, before)), by_key(extended(run, after))
    assert old.keys() <= new.keys()
    assert len(new) > len(old) or what in ("values in another order", "axes the other way round")
    for key, values in old.items():
        assert values.keys() == new[key].keys()
        for name, value in values.items():
            assert np.array_equal(bits(np.asarray(value)), bits(np.asarray(new[key][name]))), (key, name)


@pytest.mark.slow
def test_noise_is_noise(here: Path) -> None:
    """Else the tests above would compare silence."""
    found = by_key(extended("bench", f"{KT} repeat 3;"))
    assert len({case["q"].tobytes() for case in found.values()}) == 6


# What is kept


@pytest.fixture(scope="module")
def kept_whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The archive of a sweep with all histories."""
    return batch.run(plans.plan(sweep()), output=tmp_path_factory.mktemp("whole") / "a.h5", histories="all").path


def sweep(comparison: str = "<") -> Experiment:
    """Some settle and some do not; the second requirement may be a lower limit."""
    experiment = plans.gains(60, ticks=280)
    first, second = experiment.requirements
    second = replace(second, comparison=comparison, text=f"volts {comparison} 5 V")
    return replace(experiment, requirements=(first, second))


def opened(path: Path) -> ArchiveGroup:
    return ArchiveFile(path).groups[0]


def worst(path: Path, metric: str, count: int, lower: bool = False) -> list[int]:
    """By the definition, written anew: the largest, or the smallest where a lower limit is set; the first of equals."""
    values = opened(path).values(metric)
    return sorted(sorted(range(len(values)), key=lambda case: ((1 if lower else -1) * values[case], case))[:count])


def check_kept(path: Path, kept: list[int], full: Path, single: bool = False) -> None:
    """That these cases have their histories, all cases their metrics, and both to the bit."""
    some, everything = opened(path), opened(full)
    assert some.values("case").tolist() == everything.values("case").tolist()
    assert (some.values("recorded_case").tolist() if kept else some.recorded) == (kept or 0)
    for variable in everything.role("metric"):
        assert np.array_equal(bits(some.values(variable.name)), bits(everything.values(variable.name)))
    for variable in everything.role("signal") if kept else ():
        expected = everything.values(variable.name)[kept].astype(np.float32 if single else np.float64)
        found = some.values(variable.name)
        assert found.dtype == expected.dtype
        assert np.array_equal(bits(found), bits(expected)), variable.name
    if kept:
        for name in ("case_id", "gearbox.kp"):
            assert some.values(f"recorded.{name}").tolist() == everything.values(name)[kept].tolist()


@pytest.mark.parametrize("single", [False, True], ids=["float64", "float32"])
class TestWhatIsKept:
    @pytest.mark.release
    @pytest.mark.parametrize("every", [7, 60])
    def test_every_so_many(self, here: Path, kept_whole: Path, every: int, single: bool) -> None:
        path = batch.run(plans.plan(sweep()), output="a.h5", histories=f"every:{every}", float32=single).path
        check_kept(path, list(range(0, 60, every)), kept_whole, single)

    @pytest.mark.release
    @pytest.mark.parametrize(("metric", "count"), [("settle", 5), ("volts", 5), ("volts", 100)])
    def test_the_worst(self, here: Path, kept_whole: Path, metric: str, count: int, single: bool) -> None:
        path = batch.run(plans.plan(sweep()), output="a.h5", histories=f"worst:{count}:{metric}", float32=single).path
        check_kept(path, worst(kept_whole, metric, count), kept_whole, single)

    @pytest.mark.slow
    def test_the_worst_of_a_lower_limit_are_the_smallest(self, here: Path, kept_whole: Path, single: bool) -> None:
        path = batch.run(plans.plan(sweep(">")), output="a.h5", histories="worst:4:volts", float32=single).path
        check_kept(path, worst(kept_whole, "volts", 4, lower=True), kept_whole, single)

    @pytest.mark.slow
    def test_the_worst_without_a_metric_are_by_the_first(self, here: Path, kept_whole: Path, single: bool) -> None:
        path = batch.run(plans.plan(sweep()), output="a.h5", histories="worst:3", float32=single).path
        check_kept(path, worst(kept_whole, "settle", 3), kept_whole, single)

    @pytest.mark.slow
    def test_named_ones(self, here: Path, kept_whole: Path, single: bool) -> None:
        name = opened(kept_whole).values("case_id")[17]
        path = batch.run(plans.plan(sweep()), output="a.h5", histories=["#3", name[:9]], float32=single).path
        check_kept(path, [3, 17], kept_whole, single)

    @pytest.mark.slow
    def test_several_rules_together(self, here: Path, kept_whole: Path, single: bool) -> None:
        rules = ["every:20", "worst:2:volts", "#3", "failed"]
        path = batch.run(plans.plan(sweep()), output="a.h5", histories=rules, float32=single).path
        check_kept(path, sorted({0, 20, 40, 3, *worst(kept_whole, "volts", 2)}), kept_whole, single)

    @pytest.mark.release
    def test_all_and_none(self, here: Path, kept_whole: Path, single: bool) -> None:
        for histories, kept in (("all", list(range(60))), ("none", [])):
            path = batch.run(plans.plan(sweep()), output=f"{histories}.h5", histories=histories, float32=single).path
            check_kept(path, kept, kept_whole, single)

    @pytest.mark.slow
    def test_none_that_failed(self, here: Path, kept_whole: Path, single: bool) -> None:
        path = batch.run(plans.plan(sweep()), output="a.h5", histories="failed", float32=single).path
        check_kept(path, [], kept_whole, single)

    @pytest.mark.slow
    def test_those_that_failed(self, here: Path, single: bool) -> None:
        """A rate whose square is too large is no number after some steps; what came before is kept."""
        Path("d.ic").write_text(
            "#include <two_link.ic>\n"
            "run free like nominal { servos { shoulder = loose;  elbow = loose; }  duration = 1 s;  remove volts;\n"
            "    remove settle;  record = [q, qd];  initial { elbow.q = 0.5 rad; }\n"
            "    environment { velocity_products = on; }  metric end = final { of = elbow.q; } }\n"
            "#include <servos/passive.ic>\n"
            "servo loose like passive { damping = 0 N*m*s/rad; }\n"
            "sweep it of free { vary initial.shoulder.qd = [0.1, 1e60, 0.2, 0.3, 1e100] rad/s; }\n"
        )
        found = ic.compile("d.ic", select=["it"])
        full = batch.run(found, output="full.h5", histories="all").path
        failed = np.flatnonzero(opened(full).values("status")).tolist()
        assert failed == [1, 4]
        path = batch.run(found, output="a.h5", histories="failed", float32=single).path
        group, everything = opened(path), opened(full)
        assert group.values("recorded_case").tolist() == failed
        for name in ("q", "qd"):
            with np.errstate(over="ignore"):
                expected = everything.values(name)[failed].astype(np.float32 if single else np.float64)
            assert np.array_equal(group.values(name), expected, equal_nan=True)
            assert np.isnan(expected).any()
