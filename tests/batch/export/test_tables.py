"""CSV and Parquet hold the bits of the archive, and say what they are of."""

from __future__ import annotations

import csv
import json
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import batch
from batch.archive.read import ArchiveFile
from batch.export import Exported, export, summary
from batch.export import parquet as module
from batch.export.csv import _column
from batch.export.tables import TableColumn
from met import run as engine
from met.diagnostic import Problem
from met.unit_parser import parse_unit
from tests.batch import plans
from tests.batch.export.decks import CHAIN, made, said


def table(path: Path) -> tuple[list[str], list[str], list[list[str]]]:
    """Comment lines, heads and rows of a CSV file."""
    lines = path.read_text("utf-8").splitlines()
    comments = [line for line in lines if line.startswith("#")]
    heads, *rows = csv.reader(lines[len(comments) :])
    return comments, heads, rows


@pytest.mark.slow
@pytest.mark.usefixtures("engine")
def test_a_case_is_a_row_an_instant_and_a_column_a_number(here: Path) -> None:
    batch.run(plans.plan(), output="a.h5")
    done = export("a.h5", "a.csv")
    comments, heads, rows = table(done.path)
    assert (done.cases, done.rows, done.layout) == (1, 51, None)
    assert comments == ["# MET 0.1.0: nominal of two_link.ic", "# units: s,rad,rad,rad/s,rad/s,N*m,N*m,V"]
    assert heads == [
        "time",
        "shoulder.q",
        "elbow.q",
        "shoulder.qd",
        "elbow.qd",
        "shoulder.tau",
        "elbow.tau",
        "shoulder.servo.voltage",
    ]
    with ArchiveFile("a.h5") as file:
        group = file.groups[0]
        kept = [group.values("time")[:, None], *(group.signal(name, 0) for name in ("q", "qd", "tau"))]
        kept.append(group.signal("shoulder.servo.voltage", 0)[:, None])
        np.testing.assert_array_equal(np.array(rows, float), np.hstack(kept))


@pytest.mark.slow
@pytest.mark.usefixtures("engine")
def test_several_cases_are_under_one_another_with_their_numbers(here: Path) -> None:
    batch.run(plans.plan(plans.gains(5)), output="a.h5")
    comments, heads, rows = table(export("a.h5", "a.csv", signals=["elbow.qd"]).path)
    assert comments[1] == "# units: 1,V*s/rad,kg,s,rad/s"
    assert heads == ["case", "gearbox.kp", "links.lower.mass", "time", "elbow.qd"]
    assert [row[0] for row in rows] == [str(case) for case in range(5) for _ in range(51)]
    _, _, some = table(export("a.h5", "b.csv", signals=["elbow.qd"], cases=["#3", "#1"]).path)
    assert some == rows[3 * 51 : 4 * 51] + rows[51 : 2 * 51]


@pytest.mark.slow
@pytest.mark.usefixtures("engine")
def test_cases_of_several_runs_say_their_run(here: Path) -> None:
    batch.run(plans.plan(plans.nominal(), plans.gains(2)), output="a.h5")
    _, heads, rows = table(export("a.h5", "a.csv", runs=["gains", "nominal"], signals=["elbow.q"]).path)
    assert heads == ["run", "case", "gearbox.kp", "links.lower.mass", "time", "elbow.q"]
    assert [row[:3] for row in rows[::51]] == [["gains", "0", "0.01"], ["gains", "1", "0.04"], ["nominal", "0", ""]]


@pytest.mark.slow
def test_a_case_that_failed_has_its_rows_before_that(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plans.answering(monkeypatch)
    monkeypatch.setattr(engine, "run", partial(plans.answer, fails=frozenset({1})))
    batch.run(plans.plan(plans.gains(3)), output="a.h5")
    _, _, rows = table(export("a.h5", "a.csv", table="histories").path)
    assert [sum(row[0] == case for row in rows) for case in "012"] == [51, 5, 51]


@pytest.mark.slow
@pytest.mark.usefixtures("engine")
def test_numbers_of_four_bytes_are_as_short_as_they_are(here: Path) -> None:
    batch.run(plans.plan(), output="a.h5", float32=True)
    _, _, rows = table(export("a.h5", "a.csv", signals=["qd"]).path)
    with ArchiveFile("a.h5") as file:
        kept = file.groups[0].signal("qd", 0)
    assert kept.dtype == np.float32
    np.testing.assert_array_equal(np.array([row[1:] for row in rows], np.float32), kept)
    assert max(len(text) for row in rows for text in row[1:]) < 16


@pytest.mark.slow
def test_a_structure_leaves_empty_what_only_another_has(tmp_path: Path) -> None:
    archive = made(tmp_path, "links", CHAIN)
    _, heads, rows = table(export(archive, tmp_path / "a.csv", table="histories").path)
    assert heads == ["case", "macro LINKS", "links.first.mass", "time", "one.q", "one.qd", "two.q", "two.qd"]
    assert {row[0]: (row[6] == "", row[7] == "") for row in rows} == {
        "0": (True, True),
        "1": (True, True),
        "2": (False, False),
        "3": (False, False),
    }
    _, heads, rows = table(export(archive, tmp_path / "b.csv", signals=["two.q"]).path)
    assert (heads, sorted({row[0] for row in rows})) == (
        ["case", "macro LINKS", "links.first.mass", "time", "two.q"],
        ["2", "3"],
    )
    with pytest.raises(Problem, match="E324"):
        export(archive, tmp_path / "c.csv", signals=["two.q"], cases=["#0"])


@pytest.mark.slow
@pytest.mark.usefixtures("engine")
def test_a_name_of_a_deck_stays_in_its_line(here: Path) -> None:
    from dataclasses import replace

    batch.run(replace(plans.plan(), deck="two\nlink, x.ic"), output="a.h5")
    comments, heads, _ = table(export("a.h5", "a.csv").path)
    assert (comments[0], heads[0]) == ("# MET 0.1.0: nominal of two link, x.ic", "time")


# Parquet


@pytest.mark.oracle
@pytest.mark.usefixtures("engine")
def test_a_parquet_file_holds_the_same_with_units_and_what_is_varied(here: Path) -> None:
    from pyarrow import parquet

    batch.run(plans.plan(plans.gains(3)), output="a.h5")
    assert export("a.h5", "a.parquet", table="histories").rows == 153
    found = parquet.read_table("a.parquet")
    assert found.column_names[:5] == ["run", "case", "gearbox.kp", "links.lower.mass", "time"]
    with ArchiveFile("a.h5") as file:
        group = file.groups[0]
        for case in range(3):
            rows = found.slice(51 * case, 51)
            assert set(rows["case"].to_pylist()) == {case} and set(rows["run"].to_pylist()) == {"gains"}
            assert set(rows["gearbox.kp"].to_pylist()) == {float(group.values("gearbox.kp")[case])}
            kept = group.signal("qd", case)
            np.testing.assert_array_equal(rows["shoulder.qd"].to_numpy(), kept[:, 0])
            np.testing.assert_array_equal(rows["elbow.qd"].to_numpy(), kept[:, 1])
        provenance = file.provenance
    told = {name: found.schema.field(name).metadata for name in ("time", "elbow.qd", "links.lower.mass")}
    assert told == {
        "time": {b"unit": b"s", b"about": b"time"},
        "elbow.qd": {b"unit": b"rad/s", b"about": b"joint rate"},
        "links.lower.mass": {b"unit": b"kg", b"about": b"varied: links.lower.mass"},
    }
    assert json.loads(found.schema.metadata[b"met.export"]) == {
        "archive": "a.h5",
        "deck": "two_link.ic",
        "runs": ["gains"],
        "met": "0.1.0",
        "provenance": provenance,
    }


@pytest.mark.oracle
def test_a_parquet_file_of_several_structures_has_nulls_and_their_choices(tmp_path: Path) -> None:
    from pyarrow import parquet

    found = parquet.read_table(export(made(tmp_path, "links", CHAIN), tmp_path / "a.parquet", table="histories").path)
    assert found.column_names == [
        "run",
        "case",
        "macro LINKS",
        "links.first.mass",
        "time",
        "one.q",
        "one.qd",
        "two.q",
        "two.qd",
    ]
    assert found["two.q"].null_count == 12 == found["case"].to_pylist().count(0) * 2
    assert set(zip(found["case"].to_pylist(), found["macro LINKS"].to_pylist(), strict=True)) == {
        (0, "1"),
        (1, "1"),
        (2, "2"),
        (3, "2"),
    }


@pytest.mark.oracle
@pytest.mark.usefixtures("engine")
def test_many_cases_are_gathered_into_row_groups(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pyarrow import parquet

    monkeypatch.setattr(module, "GROUP_ROWS", 100)
    batch.run(plans.plan(plans.gains(5)), output="a.h5", float32=True)
    export("a.h5", "a.parquet", table="histories")
    file = parquet.ParquetFile("a.parquet")
    assert [file.metadata.row_group(n).num_rows for n in range(file.num_row_groups)] == [102, 102, 51]
    assert str(file.schema_arrow.field("elbow.q").type) == "float"
    file.close()


@pytest.mark.slow
@pytest.mark.usefixtures("engine")
def test_without_pyarrow_it_is_said_where_it_comes_from(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    batch.run(plans.plan(), output="a.h5")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(Problem) as caught:
        export("a.h5", "a.parquet")
    assert said(caught.value) == (
        "error[E373]: Parquet files are written by pyarrow, which is not here\n"
        f" = help: `{sys.executable} -m pip install pyarrow` brings it to the Python that runs MET\n"
        " = help: `-o FILE.csv` writes the same as text\n"
        "\n1 error\n"
    )
    assert sorted(path.name for path in here.iterdir()) == ["a.h5", "a.h5.run.json"]


def test_says_how_many_rows_of_one_case() -> None:
    assert summary(Exported(Path("a.csv"), None, 1, 501, "histories")) == ": histories of 1 case, 501 rows"
    assert summary(Exported(Path("a.csv"), None, 3, 1503, "histories")) == ": histories of 3 cases, 1,503 rows"


# A row a case


AT_LIMITS = [f"at_limit.{joint}.servo.{name}" for joint in ("shoulder", "elbow") for name in ("v_max", "tau_max")]


def test_a_case_id_that_reads_as_a_number_stays_a_word() -> None:
    field = TableColumn("case_id", "", "", "str", "case_id")
    ids = ["0751325775669632", "93556390810e0238", "948a9b4a612000ce", "12e45e6789012345"]
    assert _column(field, ids) == ["'0751325775669632", "'93556390810e0238", *ids[2:]]
    assert _column(TableColumn("macro LINKS", "", "", "str", "LINKS"), ["3"]) == ["3"]


@pytest.mark.slow
@pytest.mark.usefixtures("engine")
def test_of_a_sweep_a_row_is_a_case_with_what_is_varied_and_its_metrics(here: Path) -> None:
    batch.run(plans.plan(plans.gains(5)), output="a.h5", histories="none")
    done = export("a.h5", "a.csv")
    comments, heads, rows = table(done.path)
    assert (done.cases, done.rows, done.table) == (5, 5, "metrics")
    assert comments == ["# MET 0.1.0: gains of two_link.ic", "# units: 1,,V*s/rad,kg,,s,V,1,1,1,1,,"]
    assert heads == [
        "case",
        "case_id",
        "gearbox.kp",
        "links.lower.mass",
        "status",
        "settle",
        "volts",
        *AT_LIMITS,
        "require settle < 10 s",
        "require volts < 5 V",
    ]
    with ArchiveFile("a.h5") as file:
        group = file.groups[0]
        for column, name in ((2, "gearbox.kp"), (3, "links.lower.mass"), (5, "settle"), (6, "volts")):
            np.testing.assert_array_equal([float(row[column]) for row in rows], group.values(name))
        assert [row[1] for row in rows] == [str(each) for each in group.values("case_id")]
        met = [{1: "met", 0: "missed", -1: ""}[int(each)] for each in group.values("met")[:, 0]]
    assert [row[7 + len(AT_LIMITS)] for row in rows] == met
    _, _, some = table(export("a.h5", "b.csv", cases=["#3", "#1"], table="metrics").path)
    assert some == [rows[3], rows[1]]


@pytest.mark.slow
@pytest.mark.usefixtures("engine")
def test_of_a_run_a_row_is_an_instant_unless_metrics_are_asked_for(here: Path) -> None:
    batch.run(plans.plan(), output="a.h5")
    assert export("a.h5", "a.csv").table == "histories"
    _, heads, rows = table(export("a.h5", "b.csv", table="metrics").path)
    heads_of_metrics = ["settle", "volts", *AT_LIMITS, "require settle < 10 s"]
    assert heads == ["case", "case_id", "status", *heads_of_metrics] and len(rows) == 1


@pytest.mark.slow
def test_a_case_that_failed_says_why(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plans.answering(monkeypatch)
    monkeypatch.setattr(engine, "run", partial(plans.answer, fails=frozenset({1})))
    batch.run(plans.plan(plans.gains(3)), output="a.h5")
    _, heads, rows = table(export("a.h5", "a.csv").path)
    assert heads[-1] == "cause"
    assert [row[4] for row in rows] == ["done", "failed", "done"]
    assert [bool(row[-1]) for row in rows] == [False, True, False] and rows[1][5] == "nan"


@pytest.mark.slow
@pytest.mark.parametrize("form", ["csv", pytest.param("parquet", marks=pytest.mark.oracle)])
def test_structures_and_runs_are_under_one_another(tmp_path: Path, form: str) -> None:
    found = export(made(tmp_path, "links", CHAIN), tmp_path / f"a.{form}").path
    if form == "csv":
        _, heads, rows = table(found)
    else:
        from pyarrow import parquet

        read = parquet.read_table(found)
        heads, rows = read.column_names, [list(map(str, row.values())) for row in read.to_pylist()]
        assert read.schema.field("links.first.mass").metadata[b"unit"] == b"kg"
    assert heads[:4] == ["case", "case_id", "macro LINKS", "links.first.mass"]
    assert [(row[0], row[2]) for row in rows] == [("0", "1"), ("1", "1"), ("2", "2"), ("3", "2")]


@pytest.mark.slow
@pytest.mark.usefixtures("engine")
def test_metrics_and_what_is_varied_may_be_in_the_deck_s_units(here: Path) -> None:
    from dataclasses import replace

    sweep = plans.gains(3)
    kp, mass = sweep.cases.coordinates
    grams = replace(mass, unit="g", scale=1e-3)
    batch.run(plans.plan(replace(sweep, cases=replace(sweep.cases, coordinates=(kp, grams)))), output="a.h5")
    si, deck = (table(export("a.h5", f"{units}.csv", units=units).path) for units in ("si", "deck"))
    assert (si[0][1].split(",")[3], deck[0][1].split(",")[3]) == ("kg", "g")
    assert [parse_unit("g").to_si(float(row[3]), row[3]) for row in deck[2]] == [float(row[3]) for row in si[2]]
    comments, _, rows = table(export("a.h5", "h.csv", units="deck", signals=["elbow.q"]).path)
    assert comments[1] == "# units: 1,V*s/rad,g,s,rad" and rows[0][2] == deck[2][0][3]


@pytest.mark.slow
@pytest.mark.usefixtures("engine")
@pytest.mark.parametrize(
    ("options", "message", "helps"),
    [
        (
            {"output": "a.mcap", "table": "metrics"},
            "a.mcap would hold histories: an MCAP file is no table of metrics",
            "`-o FILE.csv` writes one; in an MCAP file they are in `/result`",
        ),
        (
            {"output": "a.mcap", "units": "deck"},
            "a.mcap would be in SI: an MCAP file has no other units",
            "`-o FILE.csv` can be in the deck's",
        ),
        (
            {"output": "a.csv", "table": "metrics", "signals": ["q"]},
            "signals are histories: a table of metrics has no `q`",
            "leave out `--metrics`, or `--signals`",
        ),
    ],
)
def test_what_a_table_cannot_be_is_told(here: Path, options: dict[str, Any], message: str, helps: str) -> None:
    batch.run(plans.plan(plans.gains(2)), output="a.h5")
    with pytest.raises(Problem) as caught:
        export("a.h5", **options)
    assert said(caught.value) == f"error[E376]: {message}\n = help: {helps}\n\n1 error\n"
