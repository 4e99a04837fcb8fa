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

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "tutorial.md").read_text(encoding="utf-8")
MISSED = ("-o ramp.h5", "-o worst.h5")
"""Ends of commands that end with 1, for a requirement is missed, as the one that compares does."""


def commands() -> Iterator[tuple[str, list[str]]]:
    """The commands of the page in order, each with the lines that are shown of what it prints."""
    for block in re.findall(r"```console\n(.*?)```", PAGE, re.DOTALL):
        for part in re.split(r"^\$ met ", block, flags=re.MULTILINE)[1:]:
            command, *lines = part.rstrip("\n").split("\n")
            yield command, lines


def follow(folder: Path) -> Iterator[tuple[str, list[str], str]]:
    """Do in this folder what the page says: each command, what the page shows of it, and what it prints."""
    found = re.search(r"<!-- pick\.ic -->\n```c\n(.*?)```", PAGE, re.DOTALL)
    mended = re.search(r"<!-- the command of joint2 -->\n```c\n(.*?)```", PAGE, re.DOTALL)
    assert found is not None and mended is not None
    deck, new = found[1], indent(mended[1], " " * 8)
    after = re.sub(r" {8}joint2 \{\n.*?\n {8}\}\n", lambda _: new, deck, count=1, flags=re.DOTALL)
    assert deck != after
    (folder / "pick.ic").write_text(deck, encoding="utf-8")
    for command, shown in commands():
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
