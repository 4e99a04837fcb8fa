"""The lines that an editor shows above runs: cases, the time that they take, and what the last archive says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import batch
import ic
from batch.queries.last_run import last_runs
from tests.ic.editor.client import Editor, uri

DECK = """\
#include <two_link.ic>
run brief like nominal {
    duration = 2 s;
    remove settle;
    remove volts;
    metric fast = peak { of = elbow.qd; };
    require fast < 10 rad/s;
    require quick: fast  <  1e-9 rad/s; allow D340 because "one is met";
}
sweep pair of brief { vary gearbox.kp = [0.02, 0.03] V*s/rad; }
"""


@pytest.fixture
def deck(tmp_path: Path) -> Path:
    path = tmp_path / "arm.ic"
    path.write_text(DECK)
    return path


def shown(editor: Editor, deck: Path) -> list[tuple[int, str, Any]]:
    found = editor.ask("textDocument/codeLens", {"textDocument": {"uri": uri(deck)}})
    return [
        (each["range"]["start"]["line"], each["command"]["title"], each["command"].get("arguments")) for each in found
    ]


@pytest.mark.release
def test_lenses_say_cases_and_what_the_last_run_said_of_each_requirement(deck: Path) -> None:
    with Editor(deck.parent) as editor:
        editor.open(deck)
        assert editor.of(deck) == []
        run = [["run", str(deck), "brief"]]
        sweep = [["run", str(deck), "pair"]]
        assert shown(editor, deck) == [(1, "1 case", None), (1, "run", run), (9, "2 cases", None), (9, "run", sweep)]
        archive = deck.with_name("arm.pair.h5")
        batch.run(ic.compile(deck, select=["pair", "brief"]), output=archive)
        found = shown(editor, deck)
        assert [each for each in found if each[1].startswith("last run")] == [
            (6, "last run: met by 1 of 1", None),
            (7, "last run: met by 0 of 1", None),
        ]
        assert (1, "show", [["show", str(archive)]]) in found
        assert (9, "view", [["view", str(archive), "pair"]]) in found
        assert next(each[1] for each in found if each[0] == 9).startswith("2 cases, about ")
        assert editor.end() == 0


@pytest.mark.slow
def test_what_is_no_archive_or_of_another_deck_is_left_out(deck: Path) -> None:
    deck.with_name("arm.h5").write_bytes(b"no archive")
    deck.with_name("arm.bad.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    deck.with_name("arm.folder.h5").mkdir()
    assert last_runs(str(deck)) == {}
    other = deck.with_name("arm_two.ic")
    other.write_text(DECK)
    batch.run(ic.compile(other, select=["brief"]), output=deck.with_name("arm_two.h5"))
    assert last_runs(str(deck)) == {}
    assert set(last_runs(str(other))) == {"brief"}
