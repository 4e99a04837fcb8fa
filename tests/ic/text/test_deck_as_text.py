"""A deck that is given as text, in no file."""

from __future__ import annotations

from pathlib import Path

import pytest

import ic
from met.diagnostic import Problem

OWN = "#include <two_link.ic>\nrun brisk like nominal { duration = 2 s; }\n"


def test_it_means_what_the_same_deck_in_a_file_means(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("deck").write_text(OWN, encoding="utf-8")
    assert ic.compile(text=OWN, select="brisk") == ic.compile("deck", select="brisk")


def test_its_includes_are_found_in_the_current_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.ic").write_text(OWN, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    plan = ic.compile(text='#include "mine.ic"\nrun slow like brisk { duration = 3 s; }', select="slow")
    assert [source.name for source in plan.sources][:2] == ["deck", "mine.ic"]
    monkeypatch.chdir("/")
    with pytest.raises(Problem, match="D005"):
        ic.compile(text='#include "mine.ic"')
    assert ic.compile(text='#include "mine.ic"', include_dirs=[tmp_path], select="brisk").experiments


def test_it_is_read_again_with_a_macro_that_a_sweep_varies() -> None:
    text = "#ifndef LONG\n#define LONG 2\n#endif\n#include <two_link.ic>\n"
    text += "run brisk like nominal { duration = LONG * 1 s; }\nsweep both of brisk { vary macro LONG = [1, 2]; }\n"
    plan = ic.compile(text=text, select="both")
    assert [each.structure.schedule.duration for each in plan.experiments] == [1.0, 2.0]


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        (OWN + "run x like brusk {}", "D041", "no run `brusk`"),
        (OWN + "\0", "D002", "`deck` is not text: it holds the byte 0x00"),
        (OWN + "\ud800", "D002", "`deck` is not UTF-8: byte 0xed"),
        ("//" + "x" * (2 << 20), "D018", "`deck` has 2.0 MiB; a deck's file has at most 2 MiB"),
    ],
)
def test_what_is_wrong_is_placed_in_the_text(text: str, code: str, message: str) -> None:
    found = ic.check(text=text).diagnostics[0]
    assert (found.code, found.message) == (code, message)
    if code != "D018":
        assert found.at is not None and found.at.place.file == "deck" and found.at.place.line == 3


def test_there_is_a_path_or_a_text() -> None:
    with pytest.raises(TypeError, match="a deck is given by its path or by its text"):
        ic.compile()
    with pytest.raises(TypeError, match="a deck is given by its path or by its text"):
        ic.check("two_link.ic", text=OWN)
