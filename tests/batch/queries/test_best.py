"""Which design of a sweep to use: against the definition on random grids, and on a deck that is run."""

from __future__ import annotations

import json
import shlex
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import batch
from batch.archive.read import ArchiveFile
from batch.queries.best import Designs
from batch.queries.pool import CaseColumn, Pool, pools
from met.cli import main
from met.diagnostic import Problem
from met.unit_parser import parse_unit, written

DECK = """
#include <two_link.ic>
run arm like nominal {
    rates { dynamics = 100 Hz; servos = 100 Hz; record = 10 Hz; }
    record = [];
    duration = 6 s;
    metric past = overshoot { of = shoulder.qd; target = slow; }
    REQUIRED
}
sweep grid of arm {
    vary gearbox.kp = linspace(0.010, 0.034, 5) V*s/rad;
    vary gearbox.ki = linspace(0.06, 0.26, 5) V/rad;
    vary links.lower.mass = [15, 30] kg;
}
sweep drawn of arm {
    seed = 4;
    vary gearbox.ki = [0.1, 0.125] V/rad;
    sample random(20) { gearbox.kt = uniform(0.055, 0.065) N*m/A; }
}
"""
BOTH = """
    remove settle;
    metric settle = settling_time { of = shoulder.qd; target = slow; band = 2 %; }
    require settle < 2 s;
    require past < 4 %;
"""


def ran(folder: Path, sweep: str = "grid", required: str = BOTH) -> Path:
    (folder / "arm.ic").write_text(DECK.replace("REQUIRED", required), encoding="utf-8")
    out = folder / f"{sweep}.h5"
    main(["run", str(folder / "arm.ic"), sweep, "-o", str(out), "-q", "--histories", "none"])
    return out


def made(values: dict[str, np.ndarray], met: np.ndarray, drawn: tuple[str, ...] = (), **metrics: np.ndarray) -> Pool:
    """A pool of cases that were not run: what varies, and whether each meets the one requirement."""
    columns = tuple(CaseColumn(f"parameter:{name}", name, "", "parameter", each) for name, each in values.items())
    variables = [
        SimpleNamespace(path=name, name=name, unit="1", attributes={"design": "random"} if name in drawn else {})
        for name in values
    ]
    of_metrics = [SimpleNamespace(path=name, name=name, unit="1", attributes={}) for name in metrics]
    pool: Any = SimpleNamespace(
        name="grid",
        columns=columns,
        count=len(met),
        groups=(),
        requirements=("x < 1",),
        outcomes=met.astype(np.int8)[:, None],
        variables=lambda role: variables if role == "coordinate" else of_metrics,
        gathered=lambda name: {**values, **metrics}[name],
    )
    return pool


@pytest.mark.parametrize("seed", range(8))
def test_cells_to_the_border_are_counted_to_the_nearest_that_is_not_known_to_be_good(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(2, 8, rng.integers(1, 4)))
    there = rng.random(shape) < 0.95
    good = there & (rng.random(shape) < 0.9)
    cells = np.argwhere(there)
    order = rng.permutation(len(cells))
    cells = cells[order]
    designs = Designs(made({f"p{k}": 1.5 * cells[:, k] for k in range(len(shape))}, good[tuple(cells.T)]))

    def border(cell: tuple[int, ...]) -> int:
        for distance in range(max(shape) + 1):
            around = product(*(range(at - distance, at + distance + 1) for at in cell))
            if any(any(not 0 <= at < n for at, n in zip(c, shape, strict=True)) or not good[c] for c in around):
                return distance
        raise AssertionError

    if designs.steps is None:
        assert len(cells) <= 0.5 * good.size
        return
    wanted = [border(tuple(cells[first].tolist())) for first in designs.first]
    assert designs.steps.tolist() == wanted


def test_a_design_is_good_if_it_is_in_all_of_its_cases() -> None:
    kp, load = (each.ravel() for each in np.meshgrid([1.0, 2.0, 3.0], [10.0, 20.0], indexing="ij"))
    met = np.array([1, 1, 1, 0, 1, 1], bool)
    assert Designs(made({"kp": kp, "load": load}, met), ["load"]).good.tolist() == [True, False, True]
    assert Designs(made({"kp": kp, "load": load}, met, drawn=("load",))).good.tolist() == [True, False, True]
    assert Designs(made({"kp": kp, "load": load}, met)).good.tolist() == met.tolist()


def test_a_payload_and_what_is_drawn_are_borne_unless_they_are_chosen() -> None:
    kp, load = (each.ravel() for each in np.meshgrid([1.0, 2.0, 3.0], [10.0, 20.0], indexing="ij"))
    pool = made({"kp": kp, "payloads.load.mass": load}, np.ones(6, bool))
    assert [column.label for column in Designs(pool).against] == ["payloads.load.mass"] and Designs(pool).count == 3
    chosen = Designs(pool, choose=["payloads.load.mass"])
    assert chosen.against == () and chosen.count == 6
    drawn = made({"kp": kp, "load": load}, np.ones(6, bool), drawn=("load",))
    assert Designs(drawn).count == 3 and Designs(drawn, choose=["load"]).count == 6


def test_what_goes_in_step_is_one_axis() -> None:
    values = np.arange(4.0)
    designs = Designs(made({"a": values, "b": 10.0 - values, "c": values**2}, np.ones(4, bool)))
    assert [[column.label for column in axis.columns] for axis in designs.axes] == [["a", "b", "c"]]
    assert designs.steps is not None and designs.steps.tolist() == [1, 2, 2, 1]


def test_the_worst_case_decides_between_designs() -> None:
    kp, load = (each.ravel() for each in np.meshgrid([1.0, 2.0, 3.0], [10.0, 20.0], indexing="ij"))
    late = np.array([1.0, 9.0, 4.0, 5.0, np.nan, 1.0])
    designs = Designs(made({"kp": kp, "load": load}, np.ones(6, bool), late=late), ["load"])
    assert designs.order([designs.goal("late")]).tolist() == [1, 0, 2]
    assert designs.order([designs.goal("late:largest")]).tolist() == [1, 0, 2]
    assert designs.order([designs.goal("2 * late - kp")])[0] == 1


@pytest.mark.release
def test_of_a_margin_the_largest_is_meant_whatever_its_name(tmp_path: Path) -> None:
    """Of metrics that differ in their models alone, which say what they are."""
    deck = DECK.replace("REQUIRED", """
        remove settle;
        metric slow_by = always { of = shoulder.qd < 0.02 rad/s;  after = 3 s; }
        metric reach = max { of = shoulder.qd; }
        metric share = share_of_time { of = shoulder.qd < 0.02 rad/s; }
        linear loop { at = 5 s;  open = shoulder.servo.voltage; }
        metric disk = disk_margin { of = loop; }
        metric decay = decay_time { of = loop; }
    """)  # fmt: skip
    (tmp_path / "arm.ic").write_text(deck, encoding="utf-8")
    main(["run", str(tmp_path / "arm.ic"), "grid", "-o", str(tmp_path / "g.h5"), "-q", "--histories", "none"])
    with ArchiveFile(tmp_path / "g.h5") as file:
        designs = Designs(pools(file.groups)[0])
        meant = {name: designs.goal(name).largest for name in ("slow_by", "reach", "share", "disk", "decay", "past")}
        assert meant == {"slow_by": True, "reach": False, "share": False, "disk": True, "decay": False, "past": False}
        assert not designs.goal("disk:smallest").largest and designs.goal("reach:largest").largest
        assert not designs.goal("2 * disk").largest, "an expression is what it says"
        first = designs.order([designs.goal("disk")])[0]
        assert designs.worst(designs.goal("disk").values, largest=True)[first] == pytest.approx(
            max(designs.worst(designs.goal("disk").values, largest=True))
        )


@pytest.mark.parametrize("seed", range(4))
def test_the_front_has_those_that_none_is_better_than(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.integers(0, 12, (2, 60)).astype(float)
    good = rng.random(60) < 0.8
    designs = Designs(made({"n": np.arange(60.0)}, good, a=a, b=b))
    found = designs.front([designs.goal("a"), designs.goal("b:largest")])

    def beaten(i: int) -> bool:
        return any(good[j] and a[j] <= a[i] and b[j] >= b[i] and (a[j] < a[i] or b[j] > b[i]) for j in range(60))

    front = {(a[i], b[i]) for i in range(60) if good[i] and not beaten(i)}
    assert {(a[i], b[i]) for i in found} == front and len(found) == len(front)
    assert (np.diff(a[found]) > 0).all()


def test_what_is_infinite_is_the_best_where_the_largest_is_wanted() -> None:
    a, b = np.array([1.0, 2.0, np.inf, np.nan]), np.array([3.0, 4.0, np.inf, np.nan])
    designs = Designs(made({"n": np.arange(4.0)}, np.ones(4, bool), a=a, b=b))
    assert designs.front([designs.goal("a:largest"), designs.goal("b:largest")]).tolist() == [2]
    assert designs.front([designs.goal("a"), designs.goal("b:largest")]).tolist() == [0, 1]


def test_a_value_is_written_in_as_few_digits_as_give_it_again() -> None:
    assert written(0.33, "V*s/rad") == "0.33 V*s/rad" and written(20.0, "kg") == "20 kg" and written(3.0, "1") == "3"
    assert written(parse_unit("deg").to_si(0.1), "deg") == "0.1 deg" and written(0.05, "%") == "5 %"
    rng = np.random.default_rng(2)
    for unit in ("deg", "rpm", "ms", "g", "km", "%", "V*s/rad"):
        measure = parse_unit(unit)
        for value in rng.lognormal(0.0, 8.0, 50).tolist():
            text = written(value, unit).split()[0]
            si = measure.to_si(float(text), text)
            assert si == value or abs(si - value) <= 2.0**-52 * value, (unit, value)


@pytest.mark.release
def test_the_command_that_is_printed_gives_the_same_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    archive = ran(tmp_path)
    monkeypatch.chdir(tmp_path)
    capsys.readouterr()
    assert main(["best", str(archive), "--format", "json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["over"] == ["links.lower.mass"] and told["designs"] == 25
    words = shlex.split(told["command"])
    assert main([*words[1:], "-o", "again.h5", "-q"]) == 0
    grid, again = batch.open(archive), batch.open("again.h5")
    kp, ki = (float(told["best"]["chosen"][path].split()[0]) for path in ("gearbox.kp", "gearbox.ki"))
    here = (grid["gearbox.kp"].values == kp) & (grid["gearbox.ki"].values == ki)
    assert here.sum() == 2 == again.sizes["case"]
    for metric in ("settle", "past"):
        np.testing.assert_array_equal(grid[metric].values[here], again[metric].values)
        assert told["best"]["worst"][metric] == again[metric].values.max()


@pytest.mark.slow
def test_the_answer_names_gains_their_border_and_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    archive = ran(tmp_path)
    capsys.readouterr()
    assert main(["best", str(archive), "--front", "settle", "--front", "past"]) == 0
    said = capsys.readouterr().out.splitlines()
    with ArchiveFile(archive) as file:
        [pool] = pools(file.groups)
        designs = Designs(pool, ["links.lower.mass"])
        assert designs.steps is not None
        best = int(designs.order()[0])
    assert designs.steps[best] == designs.steps.max()
    assert said[0].startswith("use gearbox.kp = ") and " V*s/rad, gearbox.ki = " in said[0]
    text = " ".join(line.strip() for line in said[1:3])
    assert text.startswith("it meets all 2 requirements in both of its cases (links.lower.mass 15 .. 30 kg), ")
    assert f", {designs.steps[best]} cell" in text and text.endswith(f" So do {designs.good.sum()} of 25 designs.")
    assert any(line.startswith("run it: met run ") for line in said)
    assert "settle against past: no good design is better in one and as good in the other" in said


@pytest.mark.slow
def test_where_none_is_good_those_that_come_nearest_are_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    archive = ran(tmp_path, required="require past < 0.0001 %; require past > 50 %;")
    capsys.readouterr()
    assert main(["best", str(archive), "--choose", "links.lower.mass"]) == 1
    said = capsys.readouterr().out
    assert said.startswith("none of 50 designs meets all requirements\n") and "those that come nearest:" in said


@pytest.mark.slow
def test_a_pick_by_drawn_cases_is_not_called_demonstrated(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    archive = ran(tmp_path, "drawn", "require past < 40 % in 90 % of cases with 90 % confidence;")
    capsys.readouterr()
    assert main(["best", str(archive)]) == 0
    said = capsys.readouterr().out
    assert "it was picked out of 2 by these very cases, so its numbers flatter it" in said
    assert "--set seed=5 -o confirmed.h5" in said and "demonstrated" not in said


@pytest.mark.release
@pytest.mark.parametrize(("command", "said"), [
    (["--over", "links.lowr.mass"], """\
error[E394]: no varied parameter `links.lowr.mass` in `grid`
 = help: did you mean `links.lower.mass`?
 = help: varied: gearbox.kp, gearbox.ki, links.lower.mass

1 error
"""),
    (["--over", "gearbox.kp", "--over", "gearbox.ki", "--over", "links.lower.mass"], """\
error[E395]: `grid` has no designs to choose among: it must bear gearbox.kp, gearbox.ki, links.lower.mass
 = help: `vary PATH = [...];` in a sweep chooses values
 = help: `--choose PATH` says that one of these is chosen

1 error
"""),
    (["--by", "setle"], """\
error[D065]: no metric or varied parameter `setle`
 --> <command line>:1:1
  |
1 | setle
  | ^^^^^
  = help: did you mean `settle`?
  = help: here: volts, past, settle, gearbox.kp, gearbox.ki, links.lower.mass

1 error
"""),
])  # fmt: skip
def test_mistakes(command: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    archive = ran(tmp_path)
    capsys.readouterr()
    assert main(["best", str(archive), *command]) == 2
    assert capsys.readouterr().err == said


@pytest.mark.slow
def test_a_sweep_that_requires_nothing_needs_a_goal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    archive = ran(tmp_path, required="remove settle;")
    capsys.readouterr()
    assert main(["best", str(archive)]) == 2
    assert (
        capsys.readouterr().err
        == """\
error[E396]: nothing says which design of `grid` is better
 = help: `--by METRIC`: volts, past

1 error
"""
    )
    assert main(["best", str(archive), "--by", "past", "--over", "links.lower.mass"]) == 0
    said = capsys.readouterr().out
    with ArchiveFile(archive) as file:
        designs = Designs(pools(file.groups)[0], ["links.lower.mass"])
        worst = designs.worst(designs.goal("past").values, largest=True)
        assert worst[designs.order([designs.goal("past")])[0]] == worst.min()
    assert "  it reaches the end in both of its cases (links.lower.mass 15 .. 30 kg)" in said


@pytest.mark.release
def test_parts_of_a_sum_choose_what_is_theirs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    parts = """
sweep some of arm { vary gearbox.kp = linspace(0.010, 0.034, 4) V*s/rad; }
sweep more of arm { vary gearbox.ki = linspace(0.06, 0.26, 4) V/rad; }
sweep sum = some + more;
"""
    (tmp_path / "arm.ic").write_text(DECK.replace("REQUIRED", "require past < 40 %;") + parts, encoding="utf-8")
    out = tmp_path / "sum.h5"
    main(["run", str(tmp_path / "arm.ic"), "sum", "-o", str(out), "-q", "--histories", "none"])
    capsys.readouterr()
    assert main(["best", str(out)]) == 0
    said = capsys.readouterr().out
    assert "of 8 designs." in said and "nan" not in said and "border" not in said
    assert main(["report", str(out), "-o", str(tmp_path / "a.html"), "-q"]) == 0


@pytest.mark.release
def test_a_command_repeats_macros_and_what_was_set(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    macro = "#ifndef LIMIT\n#define LIMIT 40\n#endif\nrun arm"
    deck = DECK.replace("REQUIRED", "require past < LIMIT %;").replace("run arm", macro, 1)
    deck += "sweep limits of arm { vary macro LIMIT = [30, 40]; vary gearbox.ki = [0.1, 0.125] V/rad; }\n"
    (tmp_path / "arm.ic").write_text(deck, encoding="utf-8")
    for words, wanted in (
        (["grid", "-D", "LIMIT=60"], "-D LIMIT=60 --set"),
        (["grid", "--set", "links.upper.mass=41 kg"], " grid --set 'links.upper.mass=41 kg' --set "),
    ):
        out = tmp_path / "a.h5"
        command = ["run", str(tmp_path / "arm.ic"), *words, "-o", str(out), "-q", "--histories", "none", "--fresh"]
        assert main(command) in (0, 1)
        capsys.readouterr()
        assert main(["best", str(out)]) == 0
        assert wanted in capsys.readouterr().out


def test_choices_alone_of_which_one_is_excluded() -> None:
    pool = made({"a": np.array([0.0, 0.0, 1.0]), "b": np.array([0.0, 1.0, 0.0])}, np.array([True, True, True]))
    for column in pool.columns:
        object.__setattr__(column, "role", "choice")
    designs = Designs(pool)
    assert designs.steps is not None and designs.steps.tolist() == [1, 1, 1]


def test_some_of_what_is_drawn_is_not_chosen() -> None:
    values = {"a": np.arange(4.0), "b": np.array([3.0, 1.0, 2.0, 0.0])}
    with pytest.raises(Problem, match="`a` is drawn, and each of its values comes with one of `b`"):
        Designs(made(values, np.ones(4, bool), drawn=("a", "b")), choose=["a"])


@pytest.mark.slow
def test_a_single_run_has_no_designs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    archive = ran(tmp_path, "arm")
    capsys.readouterr()
    assert main(["best", str(archive)]) == 2
    assert capsys.readouterr().err.startswith("error[E395]: ")


def test_what_varies_in_no_case_is_no_design() -> None:
    with pytest.raises(Problem, match="E395"):
        Designs(made({"a": np.zeros(3)}, np.ones(3, bool)))


@pytest.mark.release
@pytest.mark.parametrize(
    ("start", "limit", "label"),
    [
        ("[0, 1e300]", "10 rad", "fails in 1 of 2 cases"),
        ("[0, 1e300]", "-10 rad", "fails in 1 of 2 cases, misses far < -10 rad"),
        ("[1e299, 1e300]", "10 rad", "fails in 2 of 2 cases"),
    ],
)
def test_designs_that_fail_are_said_to_fail_and_why(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], start: str, limit: str, label: str
) -> None:
    text = DECK.replace("REQUIRED", f"remove settle;  metric far = max {{ of = shoulder.q; }}  require far < {limit};")
    text = text.replace("duration = 6 s", "duration = 0.2 s")
    sweep = (
        f"sweep falls of arm {{ vary gearbox.kp = [0.02, 0.03] V*s/rad;  vary initial.shoulder.qd = {start} rad/s; }}"
    )
    (tmp_path / "arm.ic").write_text(text + sweep)
    out = tmp_path / "falls.h5"
    main(["run", str(tmp_path / "arm.ic"), "falls", "-o", str(out), "-q", "--histories", "none"])
    capsys.readouterr()
    assert main(["best", str(out)]) == 1
    said = capsys.readouterr().out
    assert said.count(f"  {label}  ") == 2
    with ArchiveFile(out) as file:
        (pool,) = pools(file.groups)
        failed = np.flatnonzero(pool.status != 0)
        cause = pool.texts("cause", failed)[0]
    _, _, why = said.partition(f"\n\n{len(failed)} of 4 cases failed:\n")
    assert " ".join(why.split()).startswith(f"{len(failed)} cases {cause} (#{failed[0]})")
