"""docs/best.md: its deck is run, and what is printed is what the page shows."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from tests.docs.mended_servo import met

PAGE = (Path(__file__).parents[2] / "docs" / "best.md").read_text()


@pytest.mark.slow
def test_the_page_shows_what_is_printed(tmp_path: Path) -> None:
    deck = re.search(r"<!-- crane\.ic -->\n```c\n(.*?)```", PAGE, re.DOTALL)
    assert deck is not None
    (tmp_path / "crane.ic").write_text(deck[1])
    met(tmp_path, "run", "crane.ic", "gains", "--histories", "none", "-q", "--no-picture", status=1)
    shown = re.findall(r"^\$ met ((?:best|show) .*)\n((?:\.\.\.\n)?)((?s:.*?))```", PAGE, re.MULTILINE)
    assert len(shown) == 4
    for command, cut, text in shown:
        said = met(tmp_path, *shlex.split(command), status=0)
        said = "\n".join(each.rstrip() for each in said.split("\n"))  # a page has no blanks at the ends of lines
        assert said.endswith(text.lstrip("\n")) if cut else said == text, command


@pytest.mark.slow
def test_the_chosen_gains_give_the_same_numbers_by_themselves(tmp_path: Path) -> None:
    deck = re.search(r"<!-- crane\.ic -->\n```c\n(.*?)```", PAGE, re.DOTALL)
    command = re.search(r"So `(met run crane\.ic gains --set .*?)` runs", PAGE, re.DOTALL)
    assert deck is not None and command is not None
    (tmp_path / "crane.ic").write_text(deck[1])
    met(tmp_path, *shlex.split(command[1])[1:], "-q", "--no-picture", status=0)
    said = met(tmp_path, "show", "chosen.h5", "--no-plots", status=0)
    assert "3 cases" in said and "require settle < 5 s  met by 3 of 3 (100 %)" in said
