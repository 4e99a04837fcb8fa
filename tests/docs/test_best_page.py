"""docs/best.md: the gains that it chooses do by themselves what it says. Its commands: test_shown.py."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from met import cli
from tests.docs.pages import Page, printed


@pytest.mark.slow
def test_the_chosen_gains_give_the_same_numbers_by_themselves(tmp_path: Path) -> None:
    page = Page("best.md")
    page.put(tmp_path)
    command = re.search(r"So `met (run crane\.ic gains --set .*?)` runs", page.text, re.DOTALL)
    assert command is not None
    printed(tmp_path, f"{command[1]} -q --no-picture", (cli.YES,))
    said = printed(tmp_path, "show chosen.h5")
    assert "3 cases" in said and "require settle < 5 s  met by 3 of 3 (100 %)" in said
