"""docs/notebooks.md: what it shows is what Python says."""

from __future__ import annotations

import doctest
import re
from pathlib import Path

import pytest

from batch.notebook.accessor import DatasetAccessor
from met import cli
from tests.docs.pages import Page, printed

PAGE = Page("notebooks.md").text


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the page's deck was run."""
    where = tmp_path_factory.mktemp("page")
    Page("notebooks.md").put(where)
    [command] = re.findall(r"^After `met (run .*)`:$", PAGE, re.MULTILINE)
    printed(where, f"{command} -q --no-picture", (cli.NO,))  # not all cases meet both requirements
    return where


@pytest.mark.slow
def test_the_page_shows_what_is_said(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    session = "\n".join(re.findall(r"```pycon\n(.*?)```", PAGE, re.DOTALL))
    test = doctest.DocTestParser().get_doctest(session, {}, "notebooks.md", "notebooks.md", 0)
    told: list[str] = []
    result = doctest.DocTestRunner(verbose=False).run(test, out=told.append)
    assert result.attempted > 12 and not result.failed, "".join(told)


def test_everything_there_is_is_on_the_page() -> None:
    there = {name for name in dir(DatasetAccessor) if not name.startswith("_")}
    assert there == {name for name in there if f"`data.met.{name}" in PAGE or f"data.met.{name}(" in PAGE}
