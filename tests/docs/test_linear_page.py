"""docs/linear.md: its deck is run, and what is printed is what the page shows."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "linear.md").read_text(encoding="utf-8")


def said(folder: Path, command: str) -> str:
    """What a command of the page prints, on both streams."""
    words = [sys.executable, "-m", "met.cli", *shlex.split(command)]
    return subprocess.run(
        words, cwd=folder, env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "HOME": str(folder)}, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    ).stdout  # fmt: skip


def without_size(text: str) -> str:
    """A text without the size of an archive, in which the commit of MET stands."""
    return re.sub(r"\(\d+ KiB\)", "(SIZE)", text)


@pytest.mark.slow
def test_the_page_shows_what_is_printed(tmp_path: Path) -> None:
    decks = re.findall(r"<!-- (\w+\.ic) -->\n```c\n(.*?)```", PAGE, re.DOTALL)
    for name, text in decks:
        (tmp_path / name).write_text(text)
    consoles = re.findall(r"```console\n(.*?)```", PAGE, re.DOTALL)
    assert [name for name, _ in decks] == ["hand.ic", "firm.ic", "up.ic"] and len(consoles) == 11
    for console in consoles:
        lines = console.splitlines(keepends=True)
        commands = [line.removeprefix("$ met ") for line in lines if line.startswith("$ met ")]
        printed = [said(tmp_path, command) for command in commands]
        shown = "".join(line for line in lines if not line.startswith("$ met "))
        if "--picture" in commands[-1]:
            assert (tmp_path / commands[-1].split()[-1]).stat().st_size > 10_000
        else:
            assert without_size(printed[-1]) == without_size(shown)


@pytest.mark.slow
def test_the_lines_of_python_run(tmp_path: Path) -> None:
    deck = re.search(r"<!-- hand\.ic -->\n```c\n(.*?)```", PAGE, re.DOTALL)
    assert deck is not None
    (tmp_path / "hand.ic").write_text(deck[1])
    names: dict[str, Any] = {}
    for lines in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
        text = lines.replace('"hand.ic"', repr(str(tmp_path / "hand.ic")))
        exec("\n".join(line for line in text.splitlines() if "state_space" not in line), names)
    assert "answer" in names
    shake = names["found"].slope.sel(metric="shake", number="more").values
    assert [f"{slope:.1e}" for slope in shake] == ["2.5e-05", "1.3e-05"]
