"""docs/webassembly.md: its deck is compiled, its script runs under node, and both print what the page shows."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from met import cli
from met.backends.wasm.module import KERNEL_JS

PAGE = (Path(__file__).parents[2] / "docs" / "webassembly.md").read_text(encoding="utf-8")


def shown(name: str) -> str:
    """The block that stands under a file's name."""
    found = re.search(rf"<!-- {re.escape(name)} -->\n```\w+\n(.*?)```", PAGE, re.DOTALL)
    assert found is not None, name
    return found[1]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Path:
    """A folder with the page's deck, in which its command was run."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "quick.ic").write_text(shown("quick.ic"), encoding="utf-8")
    consoles = re.findall(r"```console\n(.*?)```", PAGE, re.DOTALL)
    assert len(consoles) == 2
    for console in consoles:
        said = [line for line in console.splitlines(keepends=True) if not line.startswith("$")]
        for command in re.findall(r"^\$ met (.*)", console, re.MULTILINE):
            assert cli.main(command.split()) == 0
        assert re.sub(r"\([\d.]+ KiB\)", "(SIZE)", capsys.readouterr().out) == "".join(said)
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
    (folder / "run.js").write_text(shown("run.js"), encoding="utf-8")
    shutil.copy(KERNEL_JS, folder)
    said = subprocess.run([node, "run.js"], capture_output=True, text=True, check=True).stdout
    answer = re.search(r"```text\n(.*?)```", PAGE, re.DOTALL)
    assert answer is not None and said == answer[1]
