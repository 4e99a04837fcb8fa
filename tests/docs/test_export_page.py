"""docs/export.md: its commands run, and what they write is as the page says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from met import cli
from tests.batch.export.decks import Mcap
from tests.docs.pages import Page, printed

PAGE = Page("export.md").text


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the page's deck was run and exported."""
    where = tmp_path_factory.mktemp("page")
    Page("export.md").put(where)
    for command, _ in Page("export.md").shown:
        printed(where, command, (cli.YES,))
    return where


@pytest.mark.slow
@pytest.mark.oracle
def test_the_commands_write_what_they_name(folder: Path) -> None:
    written = {path.name for path in folder.iterdir() if path.name.startswith("lengths")}
    assert written == {"lengths.mcap", "lengths.layout.json", "lengths.csv", "lengths.qd.csv", "lengths.parquet"}


@pytest.mark.oracle
def test_the_topics_of_the_table_are_in_the_file(folder: Path) -> None:
    read = Mcap(folder / "lengths.mcap")
    table = PAGE[PAGE.index("| topic | is |") : PAGE.index("A channel's metadata")]
    named = {name for cell in re.findall(r"^\| (.*?) \|", table, re.MULTILINE) for name in re.findall(r"`(.*?)`", cell)}
    named -= {"/reaction/force"}  # not recorded in this run
    assert {topic.replace("/case2", "") for topic in read.topics()} >= named
    assert {topic.partition("/")[0] for topic in read.entities("/case0/scene")} == {"case0"}


@pytest.mark.oracle
def test_the_tables_begin_as_they_are_shown(folder: Path) -> None:
    shown = re.findall(r"```text\n(.*?)\n```", PAGE, re.DOTALL)
    for name, text in zip(("lengths.csv", "lengths.qd.csv"), shown, strict=True):
        assert (folder / name).read_text(encoding="utf-8").startswith(text), name


def test_the_options_are_those_of_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["export", "--help"]) == cli.YES
    told = set(re.findall(r"--[a-z-]+", capsys.readouterr().out))
    named = set(re.findall(r"^\| `(--[a-z-]+)", PAGE, re.MULTILINE)) | {"--metrics"}
    assert named <= told and told - named == {"--output", "--to", "--format", "--quiet", "--verbose", "--help"}
