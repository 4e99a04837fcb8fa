"""docs/bench.md names the parts that the file of parts has. Its commands: test_shown.py."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from hw.motor_parts import parts_list
from tests.docs.pages import Page, printed

PAGE = Page("bench.md")


@pytest.mark.slow
def test_the_load_motor_of_ones_own_fits(tmp_path: Path) -> None:
    PAGE.put(tmp_path)
    [command] = (command for command, _ in PAGE.shown if "--format json" in command)
    [found] = json.loads(printed(tmp_path, command))
    assert [(each["part"], each["fits"]) for each in found["parts"]] == [("shelf", True)]


def test_it_lists_what_a_bench_needs_besides_motors_as_the_file_of_parts_does() -> None:
    rows = re.findall(r"^\| `(\S+)` \| (.*?) \|", PAGE.text.split("## What else to order")[1], re.MULTILINE)
    others = parts_list().others
    assert {name for name, _ in rows} == set(others)
    assert all(others[name].kind in what for name, what in rows)
