"""Pages of docs as their tests follow them: files, commands, and what is shown of what the commands print.

A page names each of its files in a comment before a block, `<!-- crane.ic -->`. A command stands in a block of its own
or among others, `$ met run crane.ic`, and is followed by what it prints. A line `...` there stands for lines left out;
of a command that nothing follows, the page says nothing.

    python -m tests.docs.pages NAME ...     writes what the commands of these pages print now: read the difference
"""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from met import cli

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
VARYING = (
    (r"\([\d.]+ KiB\)", "(SIZE)"), (r"about [\d.]+ KiB", "about SIZE"), (r"[\d.]+ s of computing", "TIME of computing"),
    (r"firmware( +)[0-9a-f]{16}", r"firmware\1KEY"), (r"session \d+", "session NUMBER"),
    (r"answered in .* ms, at most .* ms", "answered in TIME"), (r"up to \S+ Hz", "up to RATE"),
    (r"(\d+ Hz) (yes|no)", r"\1 ANSWER"),
)  # fmt: skip
"""What is another in each version, on each machine or at each time, and what stands for it in a comparison."""
_BLOCK = re.compile(r"^```(?:console)?\n(\$ met (?s:.*?))^```", re.MULTILINE)
_COMMAND = re.compile(r"^\$ met (.*)\n((?:(?!\$ ).*\n)*)", re.MULTILINE)


class Page:
    """A page of docs.

    text   all of it
    files  the page's files by name, whose text stands in a block after a comment with the name
    shown  its commands in order, without `met`, each with what the page shows of what it prints
    """

    def __init__(self, name: str) -> None:
        self.path = DOCS / name
        self.text = self.path.read_text(encoding="utf-8")
        self.files = dict(re.findall(r"<!-- ([^\n]+) -->\n```\w+\n(.*?)```", self.text, re.DOTALL))
        self.shown = [each for block in _BLOCK.findall(self.text) for each in _COMMAND.findall(block)]

    def put(self, folder: Path) -> None:
        """Write the page's files into a folder, and those of pages that a comment names: `<!-- files of bed.md -->`."""
        for other in re.findall(r"<!-- files of (\S+) -->", self.text):
            Page(other).put(folder)
        for name, text in self.files.items():
            if re.fullmatch(r"\w+\.\w+", name):
                (folder / name).write_text(text, encoding="utf-8")

    def follow(self, folder: Path) -> Iterator[tuple[str, str, str]]:
        """Do what the page says in a folder: each command, what is shown, and what is printed."""
        self.put(folder)
        for command, shown in self.shown:
            yield command, shown, printed(folder, command)

    def rewritten(self, folder: Path) -> str:
        """The page with what its commands print now, where it shows all of that."""
        new = {command: said for command, _, said in self.follow(folder)}

        def put(found: re.Match[str]) -> str:
            whole = found[2] and "..." not in found[2].splitlines() and without_varying(found[2]) != without_varying(
                new[found[1]]
            )  # fmt: skip
            return f"$ met {found[1]}\n{new[found[1]]}" if whole else found[0]

        return _BLOCK.sub(lambda block: _COMMAND.sub(put, block[0]), self.text)


def printed(folder: Path, command: str, statuses: tuple[int, ...] = (cli.YES, cli.NO, cli.BAD_INPUT)) -> str:
    """What a command prints in a folder, or its errors if it prints nothing, without blanks at the ends of lines."""
    out, errors = io.StringIO(), io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
        status = cli.main(shlex.split(command))
    assert status in statuses, errors.getvalue()
    return "".join(f"{line.rstrip()}\n" for line in (out.getvalue() or errors.getvalue()).splitlines())


def without_varying(text: str) -> str:
    """A text without what differs from machine to machine, or from time to time."""
    for pattern, instead in VARYING:
        text = re.sub(pattern, instead, text)
    return text


def differs(shown: str, said: str) -> str:
    """What of the shown text was not said, in its order; empty where all was. A line `...` stands for any lines."""
    rest, joined = without_varying(said), True
    for piece in re.split(r"^(\.\.\.\n)", without_varying(shown), flags=re.MULTILINE):
        if piece == "...\n":
            joined = False
            continue
        at = 0 if joined and rest.startswith(piece) else -1 if joined else rest.find(piece)
        if at < 0:
            return piece
        rest, joined = rest[at + len(piece) :], True
    return "" if not rest or shown.endswith("...\n") else f"(also said) {rest}"


def main() -> None:
    for name in sys.argv[1:]:
        page = Page(name)
        with tempfile.TemporaryDirectory() as folder:
            page.path.write_text(page.rewritten(Path(folder)), encoding="utf-8")


if __name__ == "__main__":
    main()
