"""docs/webassembly.md: its deck is compiled, its script runs under node, and both print what the page shows."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from met.backends.wasm.module import KERNEL_JS
from tests.docs.pages import Page, differs

PAGE = Page("webassembly.md").text


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the page's files, in which its commands were run."""
    for command, shown, said in Page("webassembly.md").follow(tmp_path):
        assert not shown or not differs(shown, said), f"met {command}"
    return tmp_path


@pytest.mark.slow
def test_the_tables_name_all_that_the_file_holds(folder: Path) -> None:
    told = json.loads((folder / "gentle.json").read_text())
    tables = PAGE.split("| key | is |\n")[1:]
    for table, keys in zip(tables, (told, told["kernel"]), strict=True):
        rows = re.findall(r"^\| (`[^|]*) \|", table.split("\n\n")[0], re.MULTILINE)
        assert {name for row in rows for name in re.findall(r"`(\w+)`", row)} == set(keys)


@pytest.mark.node
def test_the_script_prints_what_the_page_shows(folder: Path) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node; on Debian or Ubuntu: apt-get install nodejs")
    shutil.copy(KERNEL_JS, folder)
    said = subprocess.run([node, "run.js"], cwd=folder, capture_output=True, text=True, check=True).stdout
    answer = re.search(r"```text\n(.*?)```", PAGE, re.DOTALL)
    assert answer is not None and said == answer[1]
