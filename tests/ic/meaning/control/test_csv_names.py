"""Mistakes in a command that names a CSV file: whole messages."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.meaning.control.test_csv_files import mistake
from tests.ic.meaning.control.trajectories import MOVES, shown

MISTAKES = [  # what, the file's text, the command's course, what is said
    mistake(
        "a command about a file",
        MOVES,
        """\
error[D151]: a command is about a value or a course in time, and this is text
 --> deck.ic:9:24
  |
9 |     command = position("moves.csv");
  |                        ^^^^^^^^^^^
  = help: write `position(trajectory(...))` for a column of a CSV file
""",
        '"moves.csv"',
    ),
    mistake(
        "the name of a course alone",
        MOVES,
        """\
error[D075]: `trajectory` has no `file`
 --> deck.ic:9:24
  |
9 |     command = position(trajectory);
  |                        ^^^^^^^^^^
  = help: write `file = "NAME.csv"`
""",
        "trajectory",
    ),
    mistake(
        "a word in quotes",
        MOVES,
        """\
error[D076]: `interpolation` of `trajectory` is a word, without quotes
 --> deck.ic:9:64
  |
9 |     command = position(trajectory("moves.csv", interpolation = "cubic"));
  |                                                                ^^^^^^^
  = help: one of: linear, cubic
""",
        'trajectory("moves.csv", interpolation = "cubic")',
    ),
    mistake(
        "a file's name without quotes",
        MOVES,
        """\
error[D076]: `file` of `trajectory` is the name of a file, in quotes
 --> deck.ic:9:42
  |
9 |     command = position(trajectory(file = moves));
  |                                          ^^^^^
  = help: write `file = "moves"`
""",
        "trajectory(file = moves)",
    ),
    mistake(
        "a file's name alone without quotes",
        MOVES,
        """\
error[D076]: `file` of `trajectory` is the name of a file, in quotes
 --> deck.ic:9:35
  |
9 |     command = position(trajectory(moves.csv));
  |                                   ^^^^^^^^^
  = help: write `file = "moves.csv"`
""",
        "trajectory(moves.csv)",
    ),
    mistake(
        "no file",
        MOVES,
        """\
error[D075]: `trajectory` has no `file`
 --> deck.ic:9:24
  |
9 |     command = position(trajectory(interpolation = cubic));
  |                        ^^^^^^^^^^
  = help: write `file = "NAME.csv"`
""",
        "trajectory(interpolation = cubic)",
    ),
    mistake(
        "two files",
        MOVES,
        """\
error[D153]: `trajectory` takes its values by name
 --> deck.ic:9:35
  |
9 |     command = position(trajectory("moves.csv", "others.csv"));
  |                                   ^^^^^^^^^^^
  = help: write `trajectory(file = ..., column = ..., interpolation = ..., begin = ...)`
""",
        'trajectory("moves.csv", "others.csv")',
    ),
    mistake(
        "a file that is written twice",
        MOVES,
        """\
error[D040]: `file` is written twice
 --> deck.ic:9:48
  |
9 |     command = position(trajectory("moves.csv", file = "others.csv"));
  |                                                ^^^^ again
 ::: deck.ic:9:35  first
  = help: remove one of the two
""",
        'trajectory("moves.csv", file = "others.csv")',
    ),
    mistake(
        "a column that is a number",
        MOVES,
        """\
error[D076]: `column` of `trajectory` is the name of a column, in quotes
 --> deck.ic:9:64
  |
9 |     command = position(trajectory(file = "moves.csv", column = 3));
  |                                                                ^
  = help: write `column = "NAME"`
""",
        'trajectory(file = "moves.csv", column = 3)',
    ),
    mistake(
        "a list that the file has",
        MOVES,
        """\
error[D141]: `trajectory` has no `times`
 --> deck.ic:9:55
  |
9 |     command = position(trajectory(file = "moves.csv", times = [1, 2] s));
  |                                                       ^^^^^
  = help: it has: file, column, interpolation, begin
""",
        'trajectory(file = "moves.csv", times = [1, 2] s)',
    ),
]


def test_no_such_file(tmp_path: Path) -> None:
    (tmp_path / "moves.csv").write_text(MOVES)
    said = shown(tmp_path, None, 'trajectory(file = "move.csv")')
    assert (
        said.replace(str(tmp_path), "DIR")
        == """\
error[D190]: cannot find "move.csv"
 --> deck.ic:9:42
  |
9 |     command = position(trajectory(file = "move.csv"));
  |                                          ^^^^^^^^^^
  = help: did you mean `moves.csv`?
  = help: looked in `DIR`, the standard library
"""
    )


def test_a_link_to_nowhere_is_not_what_was_meant(tmp_path: Path) -> None:
    (tmp_path / "moves.csv").symlink_to(tmp_path / "gone.csv")
    assert (
        shown(tmp_path, None).replace(str(tmp_path), "DIR")
        == """\
error[D190]: cannot find "moves.csv"
 --> deck.ic:9:42
  |
9 |     command = position(trajectory(file = "moves.csv"));
  |                                          ^^^^^^^^^^^
  = help: looked in `DIR`, the standard library
"""
    )


@pytest.mark.slow
@pytest.mark.parametrize(("text", "course", "message"), [m[1:] for m in MISTAKES], ids=[m[0] for m in MISTAKES])
def test_a_mistake_is_told_where_it_is(tmp_path: Path, text: str | bytes, course: str, message: str) -> None:
    assert shown(tmp_path, text, course) == message
