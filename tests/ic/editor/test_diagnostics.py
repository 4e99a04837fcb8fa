"""Diagnostics in an editor, while a deck is written, are those that `met check` prints of it."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from ic.editor.checker_process import CheckerProcess
from ic.editor.checks import DeckChecks, OpenText
from ic.editor.positions import path_of
from met.host import interpreter
from met.messages.programs import JSON_VERSION
from tests.ic.editor.client import Editor, uri

GOOD = "#include <two_link.ic>\nrun more like nominal { duration = 5 s; }\n"
BAD = GOOD.replace("5 s", "5")
BARE = "`duration` of run `more` is in s, and this is a bare number"


def printed(folder: Path, name: str) -> Any:
    """The diagnostics that `met check` prints of a deck, as JSON."""
    words = [*interpreter.command("met.cli", "check"), name, "--format", "json"]
    done = subprocess.run(words, cwd=folder, env=interpreter.environment(), capture_output=True, text=True)
    found = json.loads(done.stdout)
    assert found["version"] == JSON_VERSION
    return found["diagnostics"]


def messages(found: list[Any]) -> list[str]:
    return [each["message"] for each in found]


def related(found: Any) -> list[str]:
    return [each["message"] for each in found["relatedInformation"]]


@pytest.mark.slow
def test_a_mistake_is_shown_in_the_words_of_met_check_until_it_is_mended(tmp_path: Path, editor: Editor) -> None:
    deck = tmp_path / "arm.ic"
    deck.write_text(BAD)
    editor.open(deck)
    (found,) = editor.of(deck)
    (wanted,) = printed(tmp_path, "arm.ic")
    assert (found["code"], found["message"], found["severity"]) == (wanted["code"], wanted["message"], 1)
    assert found["source"] == "met"
    assert related(found) == [f"help: {text}" for text in wanted["help"]]
    line, first = wanted["shown"]["line"] - 1, wanted["shown"]["column"] - 1
    assert found["range"] == {
        "start": {"line": line, "character": first},
        "end": {"line": line, "character": first + wanted["shown"]["length"]},
    }
    version = editor.change(deck, GOOD)
    assert editor.of(deck) == []
    assert editor.versions[uri(deck)] == version
    assert deck.read_text() == BAD, "what is checked is what the editor has, not the file"


def test_columns_are_counted_in_the_units_of_the_protocol(tmp_path: Path, editor: Editor) -> None:
    deck = tmp_path / "arm.ic"
    text = GOOD.replace("{ dur", "{ /* \U0001f9be é */ dur").replace("5 s", "5")
    editor.open(deck, text)
    (found,) = editor.of(deck)
    line = text.split("\n")[1]
    assert found["range"]["start"]["character"] == len(line[: line.index("5;")].encode("utf-16-le")) // 2


def test_a_mistake_of_an_included_file_is_shown_there_with_what_includes_it(tmp_path: Path, editor: Editor) -> None:
    deck, part = tmp_path / "arm.ic", tmp_path / "part.ic"
    part.write_text("run more like nominal { duration = 5; }\n")
    deck.write_text('#include <two_link.ic>\n#include "part.ic"\n')
    editor.open(deck)
    assert editor.of(deck) == []
    (found,) = editor.of(part)
    assert found["message"] == BARE
    assert related(found) == ["help: write `5 s`", "note: included from here"]
    where = found["relatedInformation"][1]["location"]
    assert where["uri"] == uri(deck) and where["range"]["start"] == {"line": 1, "character": 0}
    editor.close(deck)
    assert editor.of(part) == []


def test_an_included_file_counts_as_the_editor_has_it_and_is_no_deck_of_its_own(tmp_path: Path, editor: Editor) -> None:
    deck, part = tmp_path / "arm.ic", tmp_path / "part.ic"
    part.write_text("run more like nominal { duration = 5 s; }\n")
    deck.write_text('#include <two_link.ic>\n#include "part.ic"\n')
    editor.open(part)
    assert messages(editor.of(part)) == ["no run `nominal`"]  # alone it is a deck
    editor.open(deck)
    assert editor.of(part) == [] and editor.of(deck) == []
    editor.change(part, "run more like nominal { duration = 5; }\n")
    assert messages(editor.of(part)) == [BARE] and editor.of(deck) == []
    editor.change(part, "run more like nominal { duration = 6 s; }\n")
    assert editor.of(part) == []
    editor.change(part, "run more like nominal { duration = 5; }\n")
    editor.close(part)  # and nothing of it was saved
    assert editor.of(part) == []


def test_a_file_that_is_nowhere_but_in_the_editor_is_found_by_an_include(tmp_path: Path, editor: Editor) -> None:
    deck, part = tmp_path / "arm.ic", tmp_path / "part.ic"
    editor.open(deck, '#include <two_link.ic>\n#include "part.ic"\n')
    assert messages(editor.of(deck)) == ['cannot find "part.ic"']
    editor.open(part, "run more like nominal { duration = 5 s; }\n")
    assert editor.of(deck) == [] and editor.of(part) == []


def test_a_table_that_a_deck_names_counts_as_the_editor_has_it(tmp_path: Path, editor: Editor) -> None:
    deck, table = tmp_path / "arm.ic", tmp_path / "cases.csv"
    table.write_text("links.upper.mass [kg]\n40\n50\n")
    editor.open(deck, '#include <two_link.ic>\nsweep measured of nominal { from "cases.csv"; }\n')
    assert editor.of(deck) == []
    editor.open(table, "links.upper.mass [kg]\n40\n5O\n")
    assert messages(editor.of(table)) == ["`5O` is not a number"]
    assert editor.diagnostics[uri(table)][0]["range"]["start"] == {"line": 2, "character": 0}
    editor.close(deck)
    assert editor.of(table) == [], "a table alone is no deck"
    editor.close(table)
    assert editor.of(table) == [] and editor.of(deck) == []


def test_a_mistake_in_a_macro_is_shown_where_it_is_used_with_the_way_there(tmp_path: Path, editor: Editor) -> None:
    deck = tmp_path / "arm.ic"
    text = "#include <two_link.ic>\n#define LONG duration = 5;\nrun more like nominal { LONG }\n"
    deck.write_text(text)
    editor.open(deck)
    (found,) = editor.of(deck)
    assert found["range"]["start"] == {"line": 2, "character": 24}
    assert "written here, in macro LONG" in related(found)
    assert "note: in expansion of macro LONG" in related(found)


@pytest.mark.release
def test_an_editor_that_shows_nothing_related_has_the_help_in_the_message(tmp_path: Path) -> None:
    deck = tmp_path / "arm.ic"
    for given in ({"related": False}, {"options": {"helpInMessage": True}}):
        with Editor(tmp_path, **given) as editor:  # type: ignore[arg-type]
            editor.open(deck, BAD)
            (found,) = editor.of(deck)
            assert found["message"] == f"{BARE}\nhelp: write `5 s`"
            assert not found.get("relatedInformation")


@pytest.mark.slow
def test_folders_and_macros_are_taken_from_the_command_line_and_from_the_editor(tmp_path: Path) -> None:
    (tmp_path / "one").mkdir()
    (tmp_path / "two").mkdir()
    (tmp_path / "one" / "a.ic").write_text("run a like nominal { duration = FIRST * 1 s; }\n")
    (tmp_path / "two" / "b.ic").write_text("run b like nominal { duration = SECOND * 1 s; }\n")
    options = {"includeDirs": ["two"], "defines": ["SECOND=2"], "colour": "red"}
    with Editor(tmp_path, "-I", "one", "-D", "FIRST=1", "--stdio", options=options) as editor:
        deck = tmp_path / "arm.ic"
        editor.open(deck, "#include <two_link.ic>\n#include <a.ic>\n#include <b.ic>\n")
        assert editor.of(deck) == []
        assert editor.shown == ["met lsp: no option `colour`; there are: includeDirs, defines, helpInMessage"]


def test_a_text_that_was_never_saved_is_checked(tmp_path: Path, editor: Editor) -> None:
    document = {"uri": "untitled:Untitled-1", "languageId": "met", "version": 1, "text": BAD}
    editor.tell("textDocument/didOpen", {"textDocument": document})
    editor.settle()
    assert messages(editor.diagnostics["untitled:Untitled-1"]) == [BARE]
    editor.tell("textDocument/didClose", {"textDocument": {"uri": "untitled:Untitled-1"}})
    editor.settle()


STRANGE = ["file:///a%00b/x.ic", "file:///", "file:", "", "file:///proc/self", "http://[", "\0", "\ud800",
           "file:///\ud800.ic", "file:///\udcff", "file:///" + "a" * 5000, "file:///<a>", "untitled:\0"]  # fmt: skip


def test_an_address_of_no_file_has_no_path() -> None:
    assert [path_of(each) for each in ("file:///%00", "file:///\ud800", "http://[", "", "untitled:\0")] == [None] * 5
    assert path_of("file:///a%20b/../c.ic") == "/c.ic"


@pytest.mark.parametrize("address", ["file:///%00", *(pytest.param(each, marks=pytest.mark.slow) for each in STRANGE)])
def test_a_text_at_any_address_is_checked_and_ends_no_checks(tmp_path: Path, editor: Editor, address: str) -> None:
    document = {"uri": address, "languageId": "met", "version": 1, "text": "run b {}"}
    editor.tell("textDocument/didOpen", {"textDocument": document})
    editor.settle()
    assert editor.logged == []
    about = {"textDocument": {"uri": address}, "position": {"line": 0, "character": 3}}
    for method in ("hover", "definition", "foldingRange", "documentSymbol", "codeLens", "semanticTokens/full"):
        editor.ask(f"textDocument/{method}", about)
    editor.ask("textDocument/formatting", {**about, "options": {"tabSize": 4, "insertSpaces": True}})
    editor.tell("textDocument/didClose", {"textDocument": {"uri": address}})
    deck = tmp_path / "arm.ic"
    editor.open(deck, "run b {")
    assert [each["code"] for each in editor.of(deck)] == ["D022"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a\0b.ic", "\ud800.ic", "..", "/dev/zero", "/proc/kmsg", "a" * 5000])
@pytest.mark.parametrize("written", ['#include "{}"\n', 'use "{}" as b;\n'])
def test_a_file_that_cannot_be_is_a_mistake_of_the_deck(
    tmp_path: Path, editor: Editor, name: str, written: str
) -> None:
    deck = tmp_path / "arm.ic"
    editor.open(deck, written.format(name))
    assert editor.of(deck) and editor.logged == []
    editor.about("textDocument/definition", deck, 0, 6)


def test_a_defect_in_the_choice_of_what_to_check_does_not_end_the_checks(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []

    async def changes() -> None:
        checks = DeckChecks(CheckerProcess(), lambda _: None, told.append, lambda: None)
        worker, fails = asyncio.create_task(checks.work()), [ValueError("on purpose"), None, None]

        def next_or_fail() -> None:
            if (fault := fails.pop(0)) is not None:
                raise fault

        monkeypatch.setattr(checks, "_next", next_or_fail)
        for _ in range(2):
            checks.open(OpenText("untitled:1", "", 1))
            await asyncio.sleep(0)
            await checks.rest()
        assert not worker.done() and fails == [None]
        worker.cancel()

    asyncio.run(changes())
    assert len(told) == 1 and "ValueError: on purpose" in told[0]


def test_what_is_outdated_is_never_told(tmp_path: Path, editor: Editor) -> None:
    deck = tmp_path / "arm.ic"
    editor.open(deck, GOOD)
    editor.settle()
    for n in range(30):
        editor.change(deck, BAD if n % 2 == 0 else GOOD)
    assert editor.of(deck) == []
    told = [each["version"] for each in editor.published if each["uri"] == uri(deck)]
    assert told == sorted(told)
    editor.change(deck, BAD)
    assert messages(editor.of(deck)) == [BARE]


def checker_of(editor: Editor) -> int:
    """The process that checks for a server."""
    children = Path(f"/proc/{editor.pid}/task/{editor.pid}/children").read_text().split()
    return int(children[0])


@pytest.mark.slow
def test_a_checker_that_dies_is_told_in_the_log_and_started_again(tmp_path: Path, editor: Editor) -> None:
    deck = tmp_path / "arm.ic"
    editor.open(deck, BAD)
    assert messages(editor.of(deck)) == [BARE]
    os.kill(checker_of(editor), signal.SIGKILL)
    editor.change(deck, GOOD)
    editor.settle()
    editor.change(deck, BAD)
    editor.settle()
    editor.change(deck, GOOD)
    assert editor.of(deck) == []


@pytest.mark.slow
def test_a_server_that_is_begun_twice_goes_on_checking(tmp_path: Path) -> None:
    decks = [tmp_path / "a.ic", tmp_path / "b.ic"]
    with Editor(tmp_path) as editor:
        editor.open(decks[0], GOOD)
        editor.ask("initialize", {"processId": None, "rootUri": None, "capabilities": {}})
        for deck in decks:
            editor.open(deck, BAD)
            assert len(editor.of(deck)) == 1
        assert editor.end() == 0


@pytest.mark.release
def test_a_crash_in_a_check_is_told_in_the_log_and_the_server_lives_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "sitecustomize.py").write_text(
        "import met.diagnostic\n"
        "import met.messages.edits as edits\n"
        "said = edits.edits\n"
        "def crash(diagnostic, sources):\n"
        "    if any('CRASH' in text for text in sources.values()):\n"
        "        raise RuntimeError('on purpose')\n"
        "    return said(diagnostic, sources)\n"
        "edits.edits = crash\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(broken))
    deck = tmp_path / "arm.ic"
    with Editor(tmp_path) as editor:
        editor.open(deck, BAD)
        assert messages(editor.of(deck)) == [BARE]
        editor.change(deck, BAD + "// CRASH\n")
        editor.settle()
        (told,) = editor.logged
        assert "this is a defect of MET, not of what you gave it" in told and "RuntimeError: on purpose" in told
        editor.change(deck, GOOD)
        assert editor.of(deck) == []


@pytest.mark.release
def test_met_lsp_without_pygls_says_how_to_install_it(tmp_path: Path) -> None:
    hidden = "u.find_spec = lambda name, *more: None if name == 'pygls' else find(name, *more)\n"
    hidden = f"import importlib.util as u\nfind = u.find_spec\n{hidden}"
    (tmp_path / "sitecustomize.py").write_text(hidden)
    environment = {**interpreter.environment()}
    environment["PYTHONPATH"] = os.pathsep.join([str(tmp_path), environment["PYTHONPATH"]])
    done = subprocess.run(
        interpreter.command("met.cli", "lsp"), env=environment, capture_output=True, text=True, stdin=subprocess.DEVNULL
    )
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr == (
        "error[E345]: `met lsp` speaks to editors by pygls, which is not here\n"
        f" = help: `{sys.executable} -m pip install pygls` brings it to the Python that runs MET\n"
        " = help: MET's extra `editor` names it\n\n1 error\n"
    )
