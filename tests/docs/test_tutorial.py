"""docs/tutorial.md: followed from the deck to the report, each command prints what the page shows."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.docs import tutorial
from tests.docs.pages import DOCS


@pytest.mark.release
def test_each_command_prints_what_is_shown(tmp_path: Path) -> None:
    for command, shown, printed in tutorial.follow(tmp_path):
        lines = iter(printed.split("\n"))
        for line in shown.splitlines():
            assert line in ("", "...") or line in lines, f"met {command}: {line}"
    assert {"pick.html", "evidence.csv"} <= {path.name for path in tmp_path.iterdir()}


def test_its_pictures_are_there_and_no_others() -> None:
    shown = set(re.findall(r"figures/(\w+\.png)", tutorial.PAGE.text))
    there = {path.name for path in (DOCS / "figures").glob("tutorial_*.png")}
    assert shown == there
    drawn = {name for command, _ in tutorial.PAGE.shown for name in re.findall(r"tutorial_\w+\.png", command)}
    assert there - drawn == {"tutorial_report.png"}
