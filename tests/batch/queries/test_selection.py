"""Some of the cases: by a condition, those that meet all, the worst over what varies."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import batch
from batch.archive.read import ArchiveFile
from batch.queries.expressions import CaseExpressions
from batch.queries.ordering import CaseSelection
from batch.queries.pool import Pool
from batch.terminal.show import as_json, show
from met.cli import main
from met.diagnostic import Problem
from tests.batch import plans

pytestmark = pytest.mark.usefixtures("engine")


@pytest.fixture
def sweep(here: Path) -> Iterator[ArchiveFile]:
    batch.run(plans.plan(plans.gains(20)), output="a.h5")
    with ArchiveFile("a.h5") as file:
        yield file


@pytest.fixture
def pool(sweep: ArchiveFile) -> Pool:
    return Pool("gains", sweep.groups)


@pytest.mark.slow
@pytest.mark.parametrize(("condition", "holds"), [
    ("settle < 4 s", lambda v: v["settle"] < 4.0),
    ("settle < 4000 ms and gearbox.kp > 0.02 V*s/rad", lambda v: (v["settle"] < 4.0) & (v["gearbox.kp"] > 0.02)),
    ("not (settle < 4 s) or links.lower.mass == 20100 g",
     lambda v: ~(v["settle"] < 4.0) | (v["links.lower.mass"] == 20.1)),
    ("volts / (1 V) - settle / (1 s) > 2", lambda v: v["volts"] - v["settle"] > 2.0),
    ("max(volts, 5.5 V) > 5.5 V", lambda v: v["volts"] > 5.5),
    ("settle != settle", lambda v: np.zeros(20, bool)),
])  # fmt: skip
def test_a_condition_holds_in_the_cases_that_numpy_says(condition: str, holds, pool: Pool) -> None:  # type: ignore[no-untyped-def]
    values = {name: pool.gathered(name) for name in ("settle", "volts", "gearbox.kp", "links.lower.mass")}
    assert CaseExpressions(pool).holds(condition).tolist() == holds(values).tolist()


def test_what_has_no_value_holds_in_no_comparison(pool: Pool) -> None:
    late = pool.gathered("settle")
    root = "sqrt(settle / (1 s) - 4)"
    assert CaseExpressions(pool).holds(f"{root} >= 0").tolist() == (late >= 4.0).tolist()
    assert CaseExpressions(pool).holds(f"{root} != 7").tolist() == (late >= 4.0).tolist()


def test_of_cases_that_differ_in_one_thing_alone_the_worst_is_kept(pool: Pool) -> None:
    found = CaseSelection(over=("gearbox.kp",)).places(pool)
    mass, rank = pool.gathered("links.lower.mass"), np.argsort(pool.worst_first)
    assert sorted(mass[found]) == sorted(set(mass))
    assert all(rank[place] == rank[mass == mass[place]].min() for place in found)


def test_of_those_that_are_asked_for_the_worst(pool: Pool) -> None:
    some = CaseSelection(where="settle < 4 s").places(pool)
    found = CaseSelection(where="settle < 4 s", over=("gearbox.kp",)).places(pool)
    assert set(found) < set(some) and len(found) == len(set(pool.gathered("links.lower.mass")[some]))


@pytest.mark.slow
def test_the_worst_must_meet_all_and_not_the_best(pool: Pool) -> None:
    worst = CaseSelection(over=("gearbox.kp",)).places(pool)
    met = (pool.outcomes == 1).all(axis=1)
    assert CaseSelection(over=("gearbox.kp",), met=True).places(pool).tolist() == worst[met[worst]].tolist()


@pytest.mark.slow
def test_those_that_meet_all(pool: Pool) -> None:
    assert CaseSelection(met=True).places(pool).tolist() == np.flatnonzero((pool.outcomes == 1).all(axis=1)).tolist()


@pytest.mark.slow
def test_the_table_has_these_cases_alone(sweep: ArchiveFile) -> None:
    some = CaseSelection(where="settle < 3 s")
    lines = show(sweep, some=some).splitlines()
    [said] = [line for line in lines if "where" in line]
    rows = [line for line in lines if line.strip().startswith("#")]
    assert said == f"{len(rows)} of 20 cases: where settle < 3 s" and 0 < len(rows) < 20
    data = json.loads(as_json(sweep, some=some))
    assert len(data["experiments"][0]["case_table"]) == len(rows)
    assert all(row["metrics"]["settle"] < 3.0 for row in data["experiments"][0]["case_table"])


@pytest.mark.slow
def test_where_there_is_none_it_is_said(sweep: ArchiveFile) -> None:
    lines = show(sweep, some=CaseSelection(where="settle < 0 s")).splitlines()
    assert "0 of 20 cases: where settle < 0 s" in lines and not any("#" in line for line in lines)


@pytest.mark.slow
@pytest.mark.parametrize(("condition", "said"), [
    ("settle < 4 kg", """\
error[D063]: `<` of s and kg
 --> <command line>:1:8
  |
1 | settle < 4 kg
  |        ^
 ::: <command line>:1:1  s
 ::: <command line>:1:10  kg
  = help: both must be of one dimension

1 error
"""),
    ("settle < 4", """\
error[D063]: `<` of s and a pure number
 --> <command line>:1:8
  |
1 | settle < 4
  |        ^
 ::: <command line>:1:1  s
 ::: <command line>:1:10  a pure number
  = help: write `4 s`

1 error
"""),
    ("settle", """\
error[D130]: a comparison is needed here
 --> <command line>:1:1
  |
1 | settle
  | ^^^^^^
  = help: such as `gearbox.kp > 0.03 V*s/rad`, joined by `and`, `or`, `not`

1 error
"""),
    ("settle < 4 s }", """\
error[D020]: expected the end of the line, found `}`
 --> <command line>:1:14
  |
1 | settle < 4 s }
  |              ^

1 error
"""),
    ("settel < 4 s", """\
error[D065]: no metric or varied parameter `settel`
 --> <command line>:1:1
  |
1 | settel < 4 s
  | ^^^^^^
  = help: did you mean `settle`?
  = help: here: settle, volts, gearbox.kp, links.lower.mass

1 error
"""),
])  # fmt: skip
def test_a_condition_that_is_none_is_shown_with_its_place(
    condition: str, said: str, sweep: ArchiveFile, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["show", "a.h5", "--where", condition]) == 2
    assert capsys.readouterr().err == said


@pytest.mark.slow
def test_a_condition_is_not_for_one_case(sweep: ArchiveFile, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", "a.h5", "--where", "settle < 4 s", "--case", "#1"]) == 2
    assert "--where, --met and --over are of many cases, and --case of one" in capsys.readouterr().err
    with pytest.raises(Problem, match="E394"):
        CaseSelection(over=("volts",)).places(Pool("gains", sweep.groups))
