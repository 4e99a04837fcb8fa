"""docs/search.md: its other command does what it says, and its tables are whole. Its commands: test_shown.py."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from ic.language import BLOCKS
from tests.docs.pages import Page, printed

PAGE = Page("search.md")


@pytest.mark.slow
def test_the_command_that_confirms_the_gains_is_one(tmp_path: Path) -> None:
    PAGE.put(tmp_path)
    command = re.search(r"^  met (run crane\.ic spread --set .* -o confirmed\.h5)$", PAGE.text, re.MULTILINE)
    assert command is not None
    printed(tmp_path, f"{command[1]} -q --no-picture")
    assert "32 of 32 cases reached their end" in printed(tmp_path, "show confirmed.h5")


def test_the_tables_name_every_entry() -> None:
    for kind in ("search", "tune"):
        for entry in BLOCKS[kind].entries:
            assert f"{entry.name}" in PAGE.text or entry.name == "allow", entry.name
