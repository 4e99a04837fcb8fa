"""Columns of a case table that are computed give what an array of all of them holds."""

from __future__ import annotations

import itertools
import zlib
from pathlib import Path

import numpy as np
import pytest

import ic
from met.diagnostic import Problem
from met.plan import Plan, columns, drawing, keys, recipes
from met.plan import file as plan_file
from met.plan.columns import RowBits, SweptRows
from met.unit_parser import parse_unit

DECK = """
#include <two_link.ic>
run short like nominal { duration = 1 s; }
"""
SWEEPS = {
    "product": """vary gearbox.kp = linspace(0.01, 0.03, 150) V*s/rad;
        vary links.upper.mass = linspace(40, 60, 200) kg;
        exclude when gearbox.kp > 0.02 V*s/rad and links.upper.mass > 50 kg;""",
    "structures": """vary integrator = [modified_euler, rk4]; vary gearbox.kp = linspace(0.01, 0.03, 110) V*s/rad;
        vary links.upper.mass = linspace(40, 60, 111) kg;
        exclude when integrator == rk4 and links.upper.mass > 58.1 kg;""",
    "drawn": """sample random(20000) { gearbox.kp = uniform(0.01, 0.03) V*s/rad;
        links.upper.mass = truncated(50, 3, 40, 60) kg; initial.elbow.q = normal(10, 3) deg; } seed = 5;""",
    "hypercube": "sample lhs(12000) { gearbox.kp = uniform(0.01, 0.03) V*s/rad; }",
}


def compiled(sweep: str) -> Plan:
    return ic.compile(text=f"{DECK} sweep them of short {{ {SWEEPS[sweep]} }}", select=["them"])


def listed(plan: Plan) -> list[list[np.ndarray]]:
    return [[np.asarray(column) for column in plan_file.columns(each)] for each in plan.experiments]


def alike(one: list[list[np.ndarray]], two: list[list[np.ndarray]]) -> bool:
    first, second = ([[each.tobytes() for each in group] for group in groups] for groups in (one, two))
    return first == second


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_rows_of_a_product_have_the_values_that_counting_through_it_gives(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sizes = tuple(int(size) for size in rng.integers(1, 7, 4))
    chosen = tuple(
        None if rng.random() < 0.6 else np.sort(rng.choice(size, int(rng.integers(1, size + 1)), replace=False))
        for size in sizes
    )
    wanted = [
        row
        for row in itertools.product(*map(range, sizes))
        if all(of is None or row[axis] in of for axis, of in enumerate(chosen))
    ]
    rows = SweptRows(sizes, chosen)
    if seed % 2:
        kept = rng.random(len(wanted)) < 0.5
        kept[0] = True
        rows, wanted = rows.only(RowBits.of(kept)), [row for row, stays in zip(wanted, kept, strict=True) if stays]
    assert rows.count == len(wanted)
    for some in (np.arange(rows.count), rng.permutation(rows.count)):
        numbers = [int(np.ravel_multi_index(wanted[row], sizes)) for row in some]
        assert rows.number(some).tolist() == numbers
        for axis in range(4):
            assert rows.index(axis, some).tolist() == [wanted[row][axis] for row in some]
    for axis in range(4):
        assert rows.present(axis).tolist() == sorted({row[axis] for row in wanted})
        column = columns.AxisColumn(rows, axis, rng.random(sizes[axis]))
        array = np.asarray(column)
        assert columns.ends(column) == (int(np.argmin(array)), int(np.argmax(array)))
        assert columns.different(column).tolist() == np.unique(array).tolist()


def test_bits_of_rows_are_counted_over_more_than_a_block() -> None:
    rng = np.random.default_rng(0)
    flags = rng.random(200_000) < 0.3
    bits, rows = RowBits.of(flags), np.flatnonzero(flags)
    some = rng.integers(0, len(rows), 500)
    assert bits.set == len(rows)
    assert bits.select(some).tolist() == rows[some].tolist()
    some = rng.integers(0, len(flags), 500)
    assert bits.rank(some).tolist() == (np.cumsum(flags) - flags)[some].tolist()


@pytest.mark.slow
@pytest.mark.parametrize("unit", ["kg", "deg", "rpm", "mm", "V*s/rad", "%", "km"])
def test_numbers_are_rounded_in_a_unit_as_one_by_one(unit: str) -> None:
    rng, measure = np.random.default_rng(1), parse_unit(unit)
    odd = [0.0, -0.0, 1e300, 1e-310, np.inf, 1e12, 999999999999.5, 0.5, 1e-5, 99999999999.95, 1e11 - 0.05]
    for numbers in (rng.random(2000), np.exp(30.0 * rng.normal(size=2000)), rng.integers(1, 10**6, 2000) / 8, odd):
        numbers = np.asarray(numbers)
        wanted = np.array([measure.to_si(float(f"{number:.12g}")) for number in numbers])
        with np.errstate(all="ignore"):
            assert drawing.rounded(numbers, measure).tobytes() == wanted.tobytes()


def test_points_of_a_stream_are_those_of_the_generator_from_its_beginning() -> None:
    key = [7, zlib.crc32(b"gearbox.kp") << 32 | 2]
    whole = np.random.Generator(np.random.Philox(key=key)).random(10_000)
    for first, last in ((0, 10), (1, 5), (3, 4), (4, 9), (4097, 9000), (9998, 10_000)):
        assert drawing.points(7, "gearbox.kp", 2, first, last).tolist() == whole[first:last].tolist()


@pytest.mark.slow
def test_any_draws_are_had_in_any_order() -> None:
    column = drawing.DrawnColumn(300_000, 3, "a", 1, "normal", (1.0, 0.1), "kg")
    rows = np.random.default_rng(0).integers(0, len(column), 300)
    assert column[rows].tolist() == [column[int(row)] for row in rows]
    array = np.asarray(column)
    assert column[rows].tolist() == array[rows].tolist()
    assert columns.ends(column) == (int(np.argmin(array)), int(np.argmax(array)))


@pytest.mark.release
@pytest.mark.parametrize("sweep", SWEEPS)
def test_a_long_sweep_has_the_values_keys_and_plan_of_a_listed_one(sweep: str, monkeypatch: pytest.MonkeyPatch) -> None:
    computed = compiled(sweep)
    assert all(isinstance(c.values, columns.ComputedColumn) for e in computed.experiments for c in e.cases.coordinates)
    monkeypatch.setattr(columns, "LISTED_ROWS", 1_000_000)
    arrays = compiled(sweep)
    assert all(isinstance(c.values, np.ndarray) for e in arrays.experiments for c in e.cases.coordinates)
    assert alike(listed(computed), listed(arrays))
    assert plan_file.dumps(computed) == plan_file.dumps(arrays)
    rows = np.array([0, 5, 9000])
    for one, two in zip(computed.experiments, arrays.experiments, strict=True):
        assert keys.case_ids(one, rows) == keys.case_ids(two, rows)
        assert one.cases.table[rows].tolist() == two.cases.table[rows].tolist()


@pytest.mark.slow
@pytest.mark.parametrize("sweep", SWEEPS)
def test_what_a_table_is_computed_from_comes_back_from_a_plan(sweep: str, tmp_path: Path) -> None:
    plan = compiled(sweep)
    plan_file.write(plan, tmp_path / "p.json", computed=True)
    back = plan_file.read(tmp_path / "p.json")
    assert alike(listed(plan), listed(back))
    assert '"version":2' in (tmp_path / "p.json").read_text(encoding="utf-8")
    plan_file.write(back, tmp_path / "again.json", computed=True)
    again = (tmp_path / "again.json").read_text(encoding="utf-8").replace("again.", "p.")
    assert again == (tmp_path / "p.json").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("was", "now"),
    [
        ('"axis":0', '"axis":7'),
        ('"sizes":[150,', '"sizes":[15,'),
        ('"sizes":[150,', '"sizes":[99999999999,'),
        ('"sizes":[150,200,1]', '"sizes":[150,200]'),
        ('"kept":{', '"kept":7,"other":{'),
    ],
)
def test_a_plan_whose_table_cannot_be_computed_is_damaged(was: str, now: str, tmp_path: Path) -> None:
    plan_file.write(compiled("product"), tmp_path / "p.json", computed=True)
    text = (tmp_path / "p.json").read_text(encoding="utf-8")
    assert was in text
    (tmp_path / "p.json").write_text(text.replace(was, now), encoding="utf-8")
    with pytest.raises(Problem) as caught:
        plan_file.read(tmp_path / "p.json")
    assert [each.code for each in caught.value.diagnostics] == ["E302"]


DRAWN = {"seed": 1, "path": "a", "sample": 1, "count": 9, "distribution": "uniform", "arguments": [0, 1], "unit": "kg"}
ROWS = {"sizes": [8], "chosen": [None], "kept": None}


@pytest.mark.parametrize("data", [
    DRAWN | {"distribution": "loguniform", "arguments": [0, 2]},
    DRAWN | {"distribution": "loguniform", "arguments": [-1, 2]},
    DRAWN | {"distribution": "truncated", "arguments": [1, 0, 2, 1]},
    DRAWN | {"distribution": "normal", "arguments": [1, 0]},
    DRAWN | {"arguments": [2, 1]},
    DRAWN | {"arguments": [0, float("inf")]},
    DRAWN | {"count": 10**9},
    {"positions": ROWS, "among": 0},
    {"positions": ROWS, "among": []},
    {"positions": ROWS, "among": {"bits": {"file": "x"}, "count": 16}},
])  # fmt: skip
def test_a_forged_column_is_refused(data: dict[str, object]) -> None:
    reader = recipes.RecipeReader(lambda where: np.zeros(1, np.uint8))
    with pytest.raises((ValueError, LookupError, TypeError)):
        reader.column(data)
    assert len(reader.column(DRAWN)) == 9
