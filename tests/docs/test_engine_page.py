"""docs/engine.md shows what `met profile` prints: the same rows and words; its numbers are of one machine and day."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from met.cli import main

pytestmark = pytest.mark.slow

PAGE = (Path(__file__).parents[2] / "docs" / "engine.md").read_text(encoding="utf-8")


def words(text: str) -> list[list[str]]:
    """The lines without their numbers, units and processor, and without whether the machine code was found or made."""
    text = re.sub(r"compiled in|found in the cache in|\(\w+\)|\b(ms|s|[KM]iB)\b", "", text)
    return [re.findall(r"[a-z_;:,.']{2,}", line) for line in text.splitlines()]


@pytest.mark.parametrize(("shown", "asked"), [(0, ["panda.ic"]), (1, ["two_link.ic", "gains"])])
def test_the_page_shows_what_the_command_prints(
    shown: int, asked: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert f"    scripts/met profile {' '.join(asked)}\n" in PAGE
    assert main(["profile", *asked]) == 0
    printed = words(capsys.readouterr().out.rstrip())
    page = words(re.findall(r"```\n(.*?)\n```", PAGE, re.DOTALL)[shown])
    assert page == printed[-len(page) :]
    assert len(page) >= 9
