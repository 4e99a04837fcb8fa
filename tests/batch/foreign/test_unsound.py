"""Archives that are not as MET writes them are told in a message, whoever reads them: never a defect of MET."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.batch.foreign.archives import changed, met, readers
from tests.batch.foreign.mutations import tried

SWEEP = "masses.rk4"

Change = Callable[[Any], None]


def put(name: str, place: int, value: Any) -> Change:
    def change(file: Any) -> None:
        file[name][place] = value

    return change


def said(name: str, attribute: str, value: Any) -> Change:
    def change(file: Any) -> None:
        file[name].attrs[attribute] = value

    return change


def moved(old: str, new: str) -> Change:
    def change(file: Any) -> None:
        file.move(old, new)

    return change


def whole_numbers(file: Any) -> None:
    """A metric of integers."""
    before = dict(file["open/end"].attrs)
    del file["open/end"]
    file["open/end"] = np.array([1])
    for name in ("units", "long_name", "role", "deck_unit", "deck_scale"):
        file["open/end"].attrs[name] = before[name]
    file["open/end"].dims[0].attach_scale(file["open/case"])


UNSOUND: dict[str, tuple[Change, str]] = {
    "cases unsorted": (put(f"{SWEEP}/case", 0, 4), "its cases do not rise"),
    "a case twice": (put(f"{SWEEP}/case", 0, 3), "its cases do not rise"),
    "a case below 0": (put(f"{SWEEP}/case", 0, -1), "its cases do not rise"),
    "a status of 99": (put(f"{SWEEP}/status", 1, 99), "variable `status` has a value that it cannot have"),
    "a requirement of 7": (put(f"{SWEEP}/met", 1, 7), "variable `met` has a value that it cannot have"),
    "a time not a number": (put("open/time", 1, np.nan), "its times do not rise"),
    "a time of 1.7e308": (put("open/time", 4, 1.7e308), "its times do not rise"),
    "a time twice": (put("open/time", 1, 0.0), "its times do not rise"),
    "more rows than times": (put("open/n_valid", 0, 6), "variable `n_valid` is not of its times"),
    "rows below 0": (put("open/n_valid", 0, -1), "variable `n_valid` is not of its times"),
    "a history of no case": (put("open/recorded_case", 0, 5), "its recorded cases are none of its cases"),
    "a joint twice": (put("open/joint", 0, "grip"), "variable `joint` does not name each"),
    "no duration": (said("open", "duration_s", float("nan")), "attribute `duration_s` is nan"),
    "a rate of nothing": (said("open", "record_hz", 0.0), "attribute `record_hz` is 0.0"),
    "no scale": (said("open/end", "deck_scale", 0.0), "variable `end` has no scale"),
    "a scale in words": (said("open/end", "deck_scale", "deg"), "variable `end` has no scale"),
    "a key that is a number": (said("open/end", "code_key", 99.0), "variable `end` has a key that is no word"),
    "limits of others": (said("open/requirement", "limit", [1.0, 2.0]),
                         "attribute `limit` of `requirement` is not of each"),
    "a metric of integers": (whole_numbers, "variable `end` is of another type"),
    "a run twice": (said(SWEEP, "experiment", "open"), "it holds two runs of one name"),
}  # fmt: skip


@pytest.mark.release
@pytest.mark.parametrize("name", UNSOUND)
def test_what_no_run_gives_is_told(name: str, archive: Path, tmp_path: Path) -> None:
    change, why = UNSOUND[name]
    with changed(archive, tmp_path) as (copy, file):
        change(file)
    assert met("show", str(copy)).text == (
        f"error[E302]: the archive {copy} is damaged: {why}\n"
        " = help: an archive that MET writes has its name only when it is whole: was this one copied in part?\n"
        "\n1 error\n"
    )


@pytest.mark.slow
@pytest.mark.parametrize("command", ["run --case", "show --case", "report", "export mcap"])
def test_a_group_under_another_name_than_in_the_plan_is_told(command: str, archive: Path, tmp_path: Path) -> None:
    with changed(archive, tmp_path) as (copy, file):
        file["open"].attrs["experiment"] = "shut"
    answer = met(*readers(copy, tmp_path)[command])
    assert answer.status == (0 if command in ("show --case", "report") else 2)
    if answer.status:
        assert f"the archive {copy} is damaged: its plan is of other runs than it holds" in answer.text


def test_a_name_longer_than_the_terminal_is_wide_is_shown(
    archive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    long = "masses." + "very_" * 30 + "long"
    with changed(archive, tmp_path) as (copy, file):
        file[SWEEP].attrs["experiment"] = long
    answer = met("show", str(copy), "--run", long)
    assert answer.status == 0
    about = "3 cases, 0.2 s, rk4 at 100 Hz, recorded at 20 Hz, arm door, velocity products on"
    assert f"\n{long}\n    {about}\n" in answer.text


@pytest.mark.release
@pytest.mark.parametrize("value", [1.7e308, -1.7e308, 5e-324, float("inf"), float("nan")])
def test_any_number_may_be_in_a_signal(value: float, archive: Path, tmp_path: Path) -> None:
    with changed(archive, tmp_path) as (copy, file):
        file["open/q"][0, 1:3, 0] = value, -value
        file["open/qd"][...] = value
        file["open/end"][0] = value
    for name in ("show", "diff", "report", "plot", "export csv"):
        assert met(*readers(copy, tmp_path, archive)[name]).status in (0, 1), name


def test_times_beyond_those_of_an_mcap_file_are_told(single: Path, tmp_path: Path) -> None:
    with changed(single, tmp_path) as (copy, file):
        file["time"][...] = np.arange(len(file["time"])) * 1e14
    said = met("export", str(copy), "-o", str(tmp_path / "a.mcap"))
    assert said.status == 2 and not (tmp_path / "a.mcap").exists()
    assert said.text == (
        "error[E376]: `open` ends at 4e+14 s: times of an MCAP file are below 9.22e+09 s\n"
        " = help: `-o FILE.csv` has times of any length\n"
        "\n1 error\n"
    )


@pytest.mark.release
@pytest.mark.parametrize("seed", range(8))
def test_an_archive_with_something_else_in_it_is_read_or_told(
    seed: int, archive: Path, single: Path, tmp_path: Path
) -> None:
    assert tried((archive, single)[seed % 2], tmp_path, seed, most=3) == []


@pytest.mark.release
def test_so_are_many_of_them(archive: Path, single: Path, tmp_path: Path) -> None:
    for seed in range(100, 130):
        assert tried((archive, single)[seed % 2], tmp_path, seed, most=4) == []


def test_a_truncated_archive_is_told_wherever_it_ends(single: Path, tmp_path: Path) -> None:
    data = single.read_bytes()
    copy = tmp_path / "given.h5"
    for part in range(1, 20):
        copy.write_bytes(data[: len(data) * part // 20])
        answer = met("show", str(copy))
        assert answer.status == 2 and f"error[E302]: the archive {copy} is damaged" in answer.text


@pytest.mark.slow
def test_bits_turned_over_are_read_or_told(single: Path, tmp_path: Path) -> None:
    copy = tmp_path / "given.h5"
    chance = np.random.default_rng(3)
    for _ in range(30):
        data = bytearray(single.read_bytes())
        for at in chance.integers(8, len(data), 4).tolist():
            data[at] ^= 1 << int(chance.integers(8))
        copy.write_bytes(data)
        assert met("show", str(copy)).status in (0, 1, 2)
