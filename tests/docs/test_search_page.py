"""docs/search.md: its deck is run, and what is printed is what the page shows.

`python -m tests.docs.test_search_page` writes what is printed anew: read the difference.
"""

from __future__ import annotations

import re
import shlex
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from ic.language import BLOCKS
from tests.docs.mended_servo import met

FILE = Path(__file__).parents[2] / "docs" / "search.md"
PAGE = FILE.read_text(encoding="utf-8")
BLOCK = re.compile(r"^```console\n((?:\$ met .*\n)+)((?s:.*?))```", re.MULTILINE)


def printed(folder: Path) -> Iterator[tuple[str, str]]:
    """Each block's commands, and what the last of them prints."""
    deck = re.search(r"<!-- crane\.ic -->\n```c\n(.*?)```", PAGE, re.DOTALL)
    assert deck is not None
    (folder / "crane.ic").write_text(deck[1], encoding="utf-8")
    for block in BLOCK.finditer(PAGE):
        said = ""
        for command in block[1].splitlines():
            said = met(folder, *shlex.split(command.removeprefix("$ met ")), status=None)
        yield block[1], said


@pytest.mark.slow
def test_the_page_shows_what_is_printed(tmp_path: Path) -> None:
    shown = [block[2] for block in BLOCK.finditer(PAGE)]
    assert [said for _, said in printed(tmp_path)] == shown and len(shown) == 2


@pytest.mark.slow
def test_the_command_that_confirms_the_gains_is_one(tmp_path: Path) -> None:
    deck = re.search(r"<!-- crane\.ic -->\n```c\n(.*?)```", PAGE, re.DOTALL)
    command = re.search(r"^  (met run crane\.ic spread --set .* -o confirmed\.h5)$", PAGE, re.MULTILINE)
    assert deck is not None and command is not None
    (tmp_path / "crane.ic").write_text(deck[1], encoding="utf-8")
    met(tmp_path, *shlex.split(command[1])[1:], "-q", "--no-picture", status=None)
    said = met(tmp_path, "show", "confirmed.h5", "--no-plots", status=0)
    assert "32 of 32 cases reached their end" in said


def test_the_tables_name_every_entry() -> None:
    for kind in ("search", "tune"):
        for entry in BLOCKS[kind].entries:
            assert f"{entry.name}" in PAGE or entry.name == "allow", entry.name


def main() -> None:
    """Write what the commands print into the page."""
    with tempfile.TemporaryDirectory() as folder:
        said = dict(printed(Path(folder)))
    made = BLOCK.sub(lambda block: f"```console\n{block[1]}{said[block[1]]}```", PAGE)
    FILE.write_text(made, encoding="utf-8")
    print(f"wrote {FILE}")


if __name__ == "__main__":
    main()
