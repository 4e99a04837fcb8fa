"""docs/bench.md: its commands print what it shows. `python -m tests.docs.test_bench_page` writes that anew."""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import shlex
import tempfile
from pathlib import Path

import pytest

from hw.motor_parts import parts_list
from met import cli

FILE = Path(__file__).parents[2] / "docs" / "bench.md"
PAGE = FILE.read_text(encoding="utf-8")
SUBSTITUTION = FILE.with_name("substitution.md").read_text(encoding="utf-8")
"""The page that has the crane's deck."""
_SHOWN = re.compile(r"^```\n\$ met (.*)\n((?:(?!```).*\n)*)```", re.MULTILINE)


def said(command: str, folder: Path) -> str:
    for name, text in re.findall(r"<!-- (\S+) -->\n```\w+\n(.*?)```", PAGE + SUBSTITUTION, re.DOTALL):
        (folder / name).write_text(text, encoding="utf-8")
    out = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(out):
        assert cli.main(shlex.split(command)) in (cli.YES, cli.NO)
    return "".join(f"{line.rstrip()}\n" for line in out.getvalue().splitlines())


@pytest.mark.slow
@pytest.mark.parametrize(("command", "shown"), _SHOWN.findall(PAGE), ids=lambda each: each.split("\n")[0][:40])
def test_what_it_shows_is_what_is_said(command: str, shown: str, tmp_path: Path) -> None:
    if shown == "...\n":
        [found] = json.loads(said(command, tmp_path))
        assert [(each["part"], each["fits"]) for each in found["parts"]] == [("shelf", True)]
    else:
        assert shown == said(command, tmp_path)


def test_it_lists_what_a_bench_needs_besides_motors_as_the_file_of_parts_does() -> None:
    rows = re.findall(r"^\| `(\S+)` \| (.*?) \|", PAGE.split("## What else to order")[1], re.MULTILINE)
    others = parts_list().others
    assert {name for name, _ in rows} == set(others)
    assert all(others[name].kind in what for name, what in rows)


def rewritten(page: str) -> str:
    """The page with what its commands print now."""

    def put(found: re.Match[str]) -> str:
        if found[2] == "...\n":
            return found[0]
        with tempfile.TemporaryDirectory() as folder:
            return f"```\n$ met {found[1]}\n{said(found[1], Path(folder))}```"

    return _SHOWN.sub(put, page)


if __name__ == "__main__":
    os.environ.setdefault("COLUMNS", "100")
    FILE.write_text(rewritten(PAGE), encoding="utf-8")
