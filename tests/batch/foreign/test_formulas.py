"""A CSV file of somebody else's archive runs nothing in a spreadsheet, and its names can be read back."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from batch.archive.read import ArchiveFile
from batch.export.csv import BEGINS, safe_word
from tests.batch.foreign.archives import changed, met

EVIL = ("=1+2", "+cmd|' /C calc'!A0", "-2+3", "@SUM(1)", "'=1")


@pytest.mark.release
@pytest.mark.parametrize("name", EVIL)
def test_a_name_that_is_a_formula_gets_an_apostrophe_before_it(name: str, archive: Path, here: Path) -> None:
    with changed(archive, here) as (copy, file):
        for run in ("open", "masses.rk4"):
            file[run]["joint"][0] = name
            file[run]["q"].attrs["units"] = f"{name},\n{name}"
        file.move("open/qd", f"open/{name.replace('/', '')}")
        file["open"].attrs["experiment"] = name
        file.attrs["deck"] = f"a,{name}\n=evil"
    words = ("export", str(copy), "-o", "out.csv", "--run", name, "--run", "masses", "--case", "#0")
    assert met(*words).status == 0
    with open("out.csv", encoding="utf-8", newline="") as text:
        rows = list(csv.reader(text))
    numbers = rows[3:]
    for row in rows[:3]:
        assert not [cell for cell in row if cell[:1] in tuple(BEGINS)], row
    assert [row[0][:1] for row in rows[:3]] == ["#", "#", "r"]
    assert {row[0] for row in numbers} == {f"'{name}", "masses"}
    read_back = [cell.removeprefix("'") for cell in rows[2]]
    assert f"{name}.q" in read_back
    time = rows[2].index("time")
    times = [float(row[time]) for row in numbers if row[0] == f"'{name}"]
    with ArchiveFile(copy) as opened:
        np.testing.assert_array_equal(times, opened.groups[0].values("time"))


@pytest.mark.slow
def test_numbers_below_0_stay_numbers(archive: Path, here: Path) -> None:
    with changed(archive, here) as (copy, file):
        file["open/q"][...] = -1.5
    assert met("export", str(copy), "-o", "out.csv", "--run", "open").status == 0
    rows = list(csv.reader(Path("out.csv").read_text(encoding="utf-8").splitlines()))
    assert rows[3][1] == "-1.5"


def test_taking_an_apostrophe_away_gives_every_name_again() -> None:
    for name in ("", "q", "shoulder.q", "'q", "''q", "=1", "-", "%", "1/s", *EVIL):
        cell = safe_word(name)
        assert (cell[1:] if cell[:1] == "'" else cell) == name
        assert cell[:1] not in tuple(BEGINS)
    assert [safe_word(name) for name in ("q", "shoulder.q", "rad/s", "1", "%")] == [
        "q",
        "shoulder.q",
        "rad/s",
        "1",
        "%",
    ]
