"""docs/tutorial.md, followed step by step; and its pictures.

python -m tests.docs.tutorial          writes docs/figures/tutorial_*.png
"""

from __future__ import annotations

import re
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import indent

from tests.docs.mended_servo import met
from tests.docs.pages import DOCS, Page

PAGE = Page("tutorial.md")
MISSED = ("-o ramp.h5", "-o worst.h5")
"""Ends of commands that end with 1, for a requirement is missed, as the one that compares does."""


def follow(folder: Path) -> Iterator[tuple[str, str, str]]:
    """Do in this folder what the page says: each command, what the page shows of it, and what it prints."""
    deck, new = PAGE.files["pick.ic"], indent(PAGE.files["the command of joint2"], " " * 8)
    after = re.sub(r" {8}joint2 \{\n.*?\n {8}\}\n", lambda _: new, deck, count=1, flags=re.DOTALL)
    assert deck != after
    (folder / "pick.ic").write_text(deck, encoding="utf-8")
    for command, shown in PAGE.shown:
        if command.endswith("-o smooth.h5"):
            (folder / "pick.ic").write_text(after, encoding="utf-8")
        status = 1 if command.endswith(MISSED) or command.startswith("diff") else 0
        yield command, shown, met(folder, *shlex.split(command), status=status)


def draw(folder: Path) -> list[Path]:
    """All pictures of the page, in `folder`; gives back their paths."""
    from tests.batch.report.browser import browser

    with TemporaryDirectory() as name, browser() as chromium:
        home = Path(name)
        for _ in follow(home):
            pass
        page = chromium.open(home / "pick.html", width=1180, height=960, scale=1.5)
        page.settle()
        written = [page.picture(folder / "tutorial_report.png", "section.evidence")]
        written += [Path(shutil.copy(path, folder)) for path in sorted(home.glob("tutorial_*.png"))]
    return written


if __name__ == "__main__":
    for path in draw(DOCS / "figures"):
        print(path)
