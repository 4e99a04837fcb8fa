"""docs/editors: the grammar is made of the language's tables, and an engine colours decks with it as they are meant."""

from __future__ import annotations

import json
import plistlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import textmate

import ic
from met import cli

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "editors"
DECKS = sorted((Path(ic.__file__).parent / "decks").rglob("*.ic"))
GRAMMAR: dict[str, Any] = json.loads((FOLDER / "met.tmLanguage.json").read_text(encoding="utf-8"))


def test_the_files_are_up_to_date() -> None:
    for name, text in textmate.texts().items():
        assert (FOLDER / name).read_bytes() == text, "write them anew: .venv/bin/python scripts/textmate.py"
    assert plistlib.loads((FOLDER / "met.tmLanguage").read_bytes()) == GRAMMAR


def patterns(part: Any) -> Iterator[dict[str, Any]]:
    if isinstance(part, dict):
        yield part
        for inside in part.values():
            yield from patterns(inside)
    elif isinstance(part, list):
        for inside in part:
            yield from patterns(inside)


def test_every_name_that_is_included_is_there_and_every_expression_can_be_read() -> None:
    for part in patterns(GRAMMAR):
        if "include" in part:
            assert part["include"].removeprefix("#") in GRAMMAR["repository"]
        for key in ("match", "begin", "end"):
            if key in part:
                groups = re.compile(part[key]).groups
                captures = part.get("captures", {}) if key == "match" else part.get("beginCaptures", {})
                assert key == "end" or {int(number) for number in captures} <= set(range(groups + 1))


def test_the_editors_files_name_what_lies_beside_them() -> None:
    package = json.loads((FOLDER / "package.json").read_text(encoding="utf-8"))["contributes"]
    (grammar,), (language,) = package["grammars"], package["languages"]
    assert (FOLDER / grammar["path"]).is_file() and (FOLDER / language["configuration"]).is_file()
    assert grammar["scopeName"] == GRAMMAR["scopeName"] == textmate.SCOPE
    assert language["extensions"] == [f".{ending}" for ending in GRAMMAR["fileTypes"]] and grammar["language"] == "met"
    assert json.loads((FOLDER / "language-configuration.json").read_text(encoding="utf-8"))["comments"]


def test_the_problem_matcher_reads_what_met_check_prints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.ic").write_text("#include <two_link.ic>\nlet a = 1 k;\n")
    assert cli.main(["check", "a.ic"]) == 2
    package = json.loads((FOLDER / "package.json").read_text(encoding="utf-8"))
    head, place = package["contributes"]["problemMatchers"][0]["pattern"]
    lines = capsys.readouterr().err.splitlines()
    first = next(i for i, line in enumerate(lines) if re.match(head["regexp"], line))
    told, where = re.match(head["regexp"], lines[first]), re.match(place["regexp"], lines[first + 1])
    assert told is not None and where is not None
    assert (told[head["severity"]], told[head["code"]]) == ("error", "D028")
    assert [where[place[key]] for key in ("file", "line", "column")] == ["a.ic", "2", "11"]


def test_the_page_names_commands_and_files_that_there_are() -> None:
    text = (ROOT / "docs" / "editors.md").read_text(encoding="utf-8")
    for path in re.findall(r"(?:docs/editors|scripts/)[\w./]*", text):
        assert (ROOT / path.rstrip(".")).exists(), path
    used = {line.split()[1] for line in text.splitlines() if line.startswith("    met ")}
    assert used == {"check", "fmt", "new"} and used <= set(cli.met.list_commands(None))  # type: ignore[arg-type]


@pytest.mark.slow
def test_the_hooks_before_a_commit_are_commands_of_met_and_those_that_the_page_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hooks = (ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8")
    entries = dict(
        zip(re.findall(r"^- id: (.*)$", hooks, re.M), re.findall(r"^  entry: (.*)$", hooks, re.M), strict=True)
    )
    page = (ROOT / "docs" / "editors.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^ +- id: (\S+)$", page, re.M)) == set(entries) == {"met-check", "met-fmt"}
    monkeypatch.chdir(tmp_path)
    for name, text in (("good.ic", "#include <two_link.ic>\n"), ("bad.ic", "arm one { link\n")):
        Path(name).write_text(text)
    for entry in entries.values():
        program, *arguments = entry.split()
        assert program == "met"
        assert cli.main([*arguments, "good.ic", "good.ic"]) == cli.YES
        assert cli.main([*arguments, "good.ic", "bad.ic"]) == cli.BAD_INPUT
    assert set(re.findall(r"^  files: (.*)$", hooks, re.M)) == {r"\.ic$"}
