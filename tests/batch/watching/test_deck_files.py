"""When a deck that is watched counts as changed: whenever its bytes are others, however an editor writes them."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path

import pytest

from batch.watching.following import DeckFiles, path_of
from ic.text.files import LIBRARY
from ic.text.lexer import COMMAND_LINE


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> DeckFiles:
    """A deck that was read, with a file that it includes and two that are not of this folder."""
    monkeypatch.chdir(tmp_path)
    for name in ("deck.ic", "part.ic"):
        Path(name).write_text("let a = 1;\n")
    found = DeckFiles(Path("deck.ic"))
    begun = found.begin()
    os.utime("part.ic", (1.0, 1.0))
    assert not found.watch_files(("deck.ic", "part.ic", "<two_link.ic>", COMMAND_LINE), begun)
    return found


def test_every_file_of_the_deck_is_watched_and_nothing_else(files: DeckFiles) -> None:
    assert files.paths == (Path("deck.ic"), Path("part.ic"), LIBRARY / "two_link.ic")
    assert path_of("<servos/rigid_gearbox.ic>").is_file()
    assert not files.changed()
    Path("other.ic").write_text("let b = 1;\n")
    assert not files.changed()


def test_a_file_that_is_written_over_has_changed_once(files: DeckFiles) -> None:
    Path("part.ic").write_text("let a = 2;\n")
    assert files.changed() and not files.changed()


def test_a_file_that_another_takes_the_place_of_has_changed(files: DeckFiles) -> None:
    about = os.stat("deck.ic")
    Path("new").write_text("let a = 3;\n")  # as long, and as old
    os.utime("new", ns=(about.st_atime_ns, about.st_mtime_ns))
    os.rename("new", "deck.ic")
    assert files.changed() and not files.changed()


def test_a_file_that_is_saved_as_it_was_has_not_changed(files: DeckFiles) -> None:
    os.utime("deck.ic")
    Path("new").write_text("let a = 1;\n")
    os.rename("new", "part.ic")
    assert not files.changed()


def test_a_file_that_goes_and_comes_back_has_changed_each_time(files: DeckFiles) -> None:
    os.rename("part.ic", "away")
    assert files.changed() and not files.changed()
    os.rename("away", "part.ic")
    assert files.changed() and not files.changed()


def test_a_file_that_is_looked_for_is_noticed_where_it_may_come(files: DeckFiles) -> None:
    assert not files.changed(around=True)
    Path("looked_for.ic").write_text("")
    assert files.changed(around=True) and not files.changed(around=True)


def test_what_changes_while_a_deck_is_read_is_read_again(files: DeckFiles) -> None:
    begun = files.begin()
    Path("deck.ic").write_text("let a = 4;\n")
    assert not files.watch_files(("deck.ic",), begun) and files.changed()
    begun = files.begin()
    time.sleep(0.05)  # clocks of files have ticks
    Path("new_part.ic").write_text("let c = 1;\n")
    assert files.watch_files(("deck.ic", "new_part.ic"), begun)
    assert files.paths == (Path("deck.ic"), Path("new_part.ic"))


def test_it_waits_until_a_file_is_written(files: DeckFiles) -> None:
    def write() -> None:
        with open("deck.ic", "w") as file:
            for _ in range(8):
                file.write("let a = 1;\n")
                file.flush()
                time.sleep(0.005)

    writer = threading.Timer(0.05, write)
    writer.start()
    files.wait()
    assert Path("deck.ic").read_text() == 8 * "let a = 1;\n"
    writer.join()


def test_it_waits_no_longer_when_something_else_has_happened(files: DeckFiles) -> None:
    files.wait(until=lambda: True)


def test_a_file_that_is_looked_for_in_another_folder_is_noticed_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MET_DECK_PATH", "shared")
    for folder in ("parts", "shared/servos", "elsewhere"):
        Path(folder).mkdir(parents=True)
    Path("deck.ic").write_text('#include "parts/a.ic"\n#include <servos/b.ic>\n#include "not/yet/c.ic"\n"\0/d"\n')
    files = DeckFiles(Path("deck.ic"))
    assert not files.watch_files(("deck.ic",), files.begin())
    assert not files.changed(around=True)
    for name in ("parts/a.ic", "shared/servos/b.ic", "shared/e.ic", "not/yet/c.ic"):
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text("let b = 1;\n")
        assert files.changed(around=True) and not files.changed(around=True), name
    Path("elsewhere/f.ic").write_text("let b = 1;\n")
    assert not files.changed(around=True)


@pytest.mark.parametrize("kind", ["sparse", "pipe", "device", "folder"])
def test_a_deck_in_whose_place_something_else_is_put_is_watched_on(files: DeckFiles, kind: str) -> None:
    """A file of 3 GiB is not read, only looked at; what is no file is not read at all."""
    os.unlink("part.ic")
    if kind == "sparse":
        with open("part.ic", "wb") as large:
            large.truncate(3 << 30)
    elif kind == "pipe":
        os.mkfifo("part.ic")
    elif kind == "device":
        os.symlink("/dev/zero", "part.ic")
    else:
        os.mkdir("part.ic")
    assert files.changed() and not files.changed()
    if kind == "sparse":
        os.truncate("part.ic", (3 << 30) + 1)
        assert files.changed() and not files.changed()
    if kind == "folder":
        os.rmdir("part.ic")
    else:
        os.unlink("part.ic")
    Path("part.ic").write_text("let a = 2;\n")
    assert files.changed() and not files.changed()
