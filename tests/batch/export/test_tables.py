"""CSV and Parquet hold the bits of the archive, and say what they are of."""

from __future__ import annotations

import csv
import json
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import batch
from batch.archive.read import ArchiveFile
from batch.export import export
from batch.export import parquet as module
from met import run as engine
from met.diagnostic import Problem
from tests.batch import plans
from tests.batch.export.decks import CHAIN, made, said


def table(path: Path) -> tuple[list[str], list[str], list[list[str]]]:
    """Comment lines, heads and rows of a CSV file."""
    lines = path.read_text("utf-8").splitlines()
    comments = [line for line in lines if line.startswith("#")]
    heads, *rows = csv.reader(lines[len(comments) :])
    return comments, heads, rows


@pytest.mark.usefixtures("engine")
def test_a_case_is_a_row_an_instant_and_a_column_a_number(here: Path) -> None:
    batch.run(plans.plan(), output="a.h5")
    done = export("a.h5", "a.csv")
    comments, heads, rows = table(done.path)
    assert (done.cases, done.rows, done.layout) == (1, 51, None)
    assert comments == ["# MET 0.1.0: nominal of two_link.ic", "# units: s,rad,rad,rad/s,rad/s,N*m,N*m,V"]
    assert heads == ["time", "shoulder.q", "elbow.q", "shoulder.qd", "elbow.qd", "shoulder.tau", "elbow.tau",
                     "shoulder.servo.voltage"]  # fmt: skip
    with ArchiveFile("a.h5") as file:
        group = file.groups[0]
        kept = [group.values("time")[:, None], *(group.signal(name, 0) for name in ("q", "qd", "tau"))]
        kept.append(group.signal("shoulder.servo.voltage", 0)[:, None])
        np.testing.assert_array_equal(np.array(rows, float), np.hstack(kept))


@pytest.mark.usefixtures("engine")
def test_several_cases_are_under_one_another_with_their_numbers(here: Path) -> None:
    batch.run(plans.plan(plans.gains(5)), output="a.h5")
    comments, heads, rows = table(export("a.h5", "a.csv", signals=["elbow.qd"]).path)
    assert (comments[1], heads) == ("# units: 1,s,rad/s", ["case", "time", "elbow.qd"])
    assert [row[0] for row in rows] == [str(case) for case in range(5) for _ in range(51)]
    _, _, some = table(export("a.h5", "b.csv", signals=["elbow.qd"], cases=["#3", "#1"]).path)
    assert some == rows[3 * 51 : 4 * 51] + rows[51 : 2 * 51]


@pytest.mark.usefixtures("engine")
def test_cases_of_several_runs_say_their_run(here: Path) -> None:
    batch.run(plans.plan(plans.nominal(), plans.gains(2)), output="a.h5")
    _, heads, rows = table(export("a.h5", "a.csv", runs=["gains", "nominal"], signals=["elbow.q"]).path)
    assert heads == ["run", "case", "time", "elbow.q"]
    assert [row[:2] for row in rows[::51]] == [["gains", "0"], ["gains", "1"], ["nominal", "0"]]


def test_a_case_that_failed_has_its_rows_before_that(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plans.answering(monkeypatch)
    monkeypatch.setattr(engine, "run", partial(plans.answer, fails=frozenset({1})))
    batch.run(plans.plan(plans.gains(3)), output="a.h5")
    _, _, rows = table(export("a.h5", "a.csv").path)
    assert [sum(row[0] == case for row in rows) for case in "012"] == [51, 5, 51]


@pytest.mark.usefixtures("engine")
def test_numbers_of_four_bytes_are_as_short_as_they_are(here: Path) -> None:
    batch.run(plans.plan(), output="a.h5", float32=True)
    _, _, rows = table(export("a.h5", "a.csv", signals=["qd"]).path)
    with ArchiveFile("a.h5") as file:
        kept = file.groups[0].signal("qd", 0)
    assert kept.dtype == np.float32
    np.testing.assert_array_equal(np.array([row[1:] for row in rows], np.float32), kept)
    assert max(len(text) for row in rows for text in row[1:]) < 16


def test_a_structure_leaves_empty_what_only_another_has(tmp_path: Path) -> None:
    archive = made(tmp_path, "links", CHAIN)
    _, heads, rows = table(export(archive, tmp_path / "a.csv").path)
    assert heads == ["case", "time", "one.q", "one.qd", "two.q", "two.qd"]
    assert {row[0]: (row[4] == "", row[5] == "") for row in rows} == {
        "0": (True, True), "1": (True, True), "2": (False, False), "3": (False, False)
    }  # fmt: skip
    _, heads, rows = table(export(archive, tmp_path / "b.csv", signals=["two.q"]).path)
    assert (heads, sorted({row[0] for row in rows})) == (["case", "time", "two.q"], ["2", "3"])
    with pytest.raises(Problem, match="E324"):
        export(archive, tmp_path / "c.csv", signals=["two.q"], cases=["#0"])


@pytest.mark.usefixtures("engine")
def test_a_name_of_a_deck_stays_in_its_line(here: Path) -> None:
    from dataclasses import replace

    batch.run(replace(plans.plan(), deck="two\nlink, x.ic"), output="a.h5")
    comments, heads, _ = table(export("a.h5", "a.csv").path)
    assert (comments[0], heads[0]) == ("# MET 0.1.0: nominal of two link, x.ic", "time")


# Parquet


@pytest.mark.usefixtures("engine")
def test_a_parquet_file_holds_the_same_with_units_and_what_is_varied(here: Path) -> None:
    from pyarrow import parquet

    batch.run(plans.plan(plans.gains(3)), output="a.h5")
    assert export("a.h5", "a.parquet").rows == 153
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
        "archive": "a.h5", "deck": "two_link.ic", "runs": ["gains"], "met": "0.1.0", "provenance": provenance
    }  # fmt: skip


def test_a_parquet_file_of_several_structures_has_nulls_and_their_choices(tmp_path: Path) -> None:
    from pyarrow import parquet

    found = parquet.read_table(export(made(tmp_path, "links", CHAIN), tmp_path / "a.parquet").path)
    assert found.column_names == ["run", "case", "macro LINKS", "links.first.mass", "time", "one.q", "one.qd",
                                  "two.q", "two.qd"]  # fmt: skip
    assert found["two.q"].null_count == 12 == found["case"].to_pylist().count(0) * 2
    assert set(zip(found["case"].to_pylist(), found["macro LINKS"].to_pylist(), strict=True)) == {
        (0, "1"), (1, "1"), (2, "2"), (3, "2")
    }  # fmt: skip


@pytest.mark.usefixtures("engine")
def test_many_cases_are_gathered_into_row_groups(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pyarrow import parquet

    monkeypatch.setattr(module, "GROUP_ROWS", 100)
    batch.run(plans.plan(plans.gains(5)), output="a.h5", float32=True)
    export("a.h5", "a.parquet")
    file = parquet.ParquetFile("a.parquet")
    assert [file.metadata.row_group(n).num_rows for n in range(file.num_row_groups)] == [102, 102, 51]
    assert str(file.schema_arrow.field("elbow.q").type) == "float"
    file.close()


@pytest.mark.usefixtures("engine")
def test_without_pyarrow_it_is_said_where_it_comes_from(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    batch.run(plans.plan(), output="a.h5")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(Problem) as caught:
        export("a.h5", "a.parquet")
    assert said(caught.value) == (
        "error[E373]: Parquet files are written by pyarrow, which is not here\n"
        " = help: `pip install pyarrow`, or `pip install 'met-arm[parquet]'`\n"
        " = help: `-o FILE.csv` writes the same as text\n"
        "\n1 error\n"
    )
    assert sorted(path.name for path in here.iterdir()) == ["a.h5", "a.h5.run.json"]
