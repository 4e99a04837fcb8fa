"""Mistakes in CSV files of trajectories: whole messages."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from ic.meaning.definitions.csv_files import read_csv
from met.diagnostic import Problem
from met.host.files import memory
from tests.ic.meaning.control.trajectories import MOVES, servo, shown
from tests.ic.small_decks import ARM, RUN, changed, check, messages


def mistake(
    what: str, text: str | bytes, message: str, course: str = 'trajectory(file = "moves.csv")'
) -> tuple[str, str | bytes, str, str]:
    return what, text, course, message


MISTAKES = [  # what, the file's text, the command's course, what is said
    mistake(
        "a column without a unit",
        MOVES.replace("hinge [deg]", "hinge"),
        """\
error[D193]: column `hinge` has no unit
 --> moves.csv:1:11
  |
1 | time [s], hinge, other [rad]
  |           ^^^^^
 ::: deck.ic:9:42  read here for joint `hinge`
  = help: write `hinge [deg]` or `hinge [rad]`
  = help: other units of this kind: mrad, arcmin, arcsec, cycle, rev
""",
    ),
    mistake(
        "a unit that is none",
        MOVES.replace("[deg]", "[degree]"),
        """\
error[D193]: `degree` is not a unit
 --> moves.csv:1:11
  |
1 | time [s], hinge [degree], other [rad]
  |           ^^^^^^^^^^^^^^
 ::: deck.ic:9:42  read here for joint `hinge`
  = help: did you mean `hinge [deg]`?
""",
    ),
    mistake(
        "a unit that is none and like none",
        MOVES.replace("[deg]", "[lots]"),
        """\
error[D193]: `lots` is not a unit
 --> moves.csv:1:11
  |
1 | time [s], hinge [lots], other [rad]
  |           ^^^^^^^^^^^^
 ::: deck.ic:9:42  read here for joint `hinge`
  = help: write `hinge [deg]` or `hinge [rad]`, with numbers in that unit
  = help: other units of this kind: mrad, arcmin, arcsec, cycle, rev
""",
    ),
    mistake(
        "a unit of another dimension",
        MOVES.replace("[deg]", "[mm]"),
        """\
error[D193]: column `hinge` is in m, and rad is needed
 --> moves.csv:1:11
  |
1 | time [s], hinge [mm], other [rad]
  |           ^^^^^^^^^^
 ::: deck.ic:9:42  read here for joint `hinge`
  = help: write `hinge [deg]` or `hinge [rad]`, with numbers in that unit
  = help: other units of this kind: mrad, arcmin, arcsec, cycle, rev
""",
    ),
    mistake(
        "a unit of time that does not exist",
        MOVES.replace("[s]", "[ps]"),
        """\
error[D193]: `ps` is not a unit
 --> moves.csv:1:1
  |
1 | time [ps], hinge [deg], other [rad]
  | ^^^^^^^^^
 ::: deck.ic:9:42  read here
  = help: write `time [s]`, with numbers in that unit
  = help: other units of this kind: ms, us, min, h, ns
""",
    ),
    mistake(
        "a unit in Unicode",
        MOVES.replace("[s]", "[\N{MICRO SIGN}s]"),
        """\
error[D193]: `\N{MICRO SIGN}s` is not a unit
 --> moves.csv:1:1
  |
1 | time [\N{MICRO SIGN}s], hinge [deg], other [rad]
  | ^^^^^^^^^
 ::: deck.ic:9:42  read here
  = help: did you mean `time [us]`?
""",
    ),
    mistake(
        "a pure number",
        MOVES.replace("[deg]", "[1]"),
        """\
error[D193]: column `hinge` is a pure number, and rad is needed
 --> moves.csv:1:11
  |
1 | time [s], hinge [1], other [rad]
  |           ^^^^^^^^^
 ::: deck.ic:9:42  read here for joint `hinge`
  = help: write `hinge [deg]` or `hinge [rad]`, with numbers in that unit
  = help: other units of this kind: mrad, arcmin, arcsec, cycle, rev
""",
    ),
    mistake(
        "a unit of the times",
        MOVES.replace("[s]", "[rad]"),
        """\
error[D193]: column `time` is in rad, and s is needed
 --> moves.csv:1:1
  |
1 | time [rad], hinge [deg], other [rad]
  | ^^^^^^^^^^
 ::: deck.ic:9:42  read here
  = help: write `time [s]`, with numbers in that unit
  = help: other units of this kind: ms, us, min, h, ns
""",
    ),
    mistake(
        "no column of the joint's name",
        MOVES.replace("hinge", "hinges"),
        """\
error[D192]: `moves.csv` has no column `hinge`
 --> deck.ic:9:42
  |
9 |     command = position(trajectory(file = "moves.csv"));
  |                                          ^^^^^^^^^^^
 ::: moves.csv:1:1  its first line
  = help: did you mean `hinges`?
  = help: columns: time, hinges, other
  = help: that of the joint's name is taken, unless `column = "NAME"` names another
""",
    ),
    mistake(
        "no column of the name that is written",
        MOVES,
        """\
error[D192]: `moves.csv` has no column `elbow`
 --> deck.ic:9:64
  |
9 |     command = position(trajectory(file = "moves.csv", column = "elbow"));
  |                                                                ^^^^^^^
 ::: moves.csv:1:1  its first line
  = help: columns: time, hinge, other
""",
        'trajectory(file = "moves.csv", column = "elbow")',
    ),
    mistake(
        "no times",
        MOVES.replace("time", "when"),
        """\
error[D192]: `moves.csv` has no column `time`
 --> deck.ic:9:42
  |
9 |     command = position(trajectory(file = "moves.csv"));
  |                                          ^^^^^^^^^^^
 ::: moves.csv:1:1  its first line
  = help: columns: when, hinge, other
  = help: the times of the rows stand in a column `time [s]`
""",
    ),
    mistake(
        "not a number",
        MOVES.replace("30", "nan"),
        """\
error[D194]: `nan` is not a number
 --> moves.csv:3:11
  |
3 | 0.5,      nan,          2
  |           ^^^
 ::: moves.csv:1:11  column `hinge`
  = help: a number is written as 12.5 or -1e-3, with a point and without a unit
""",
    ),
    mistake(
        "an empty cell",
        MOVES.replace("30,", "   ,"),
        """\
error[D194]: there is no number here
 --> moves.csv:3:5
  |
3 | 0.5,         ,          2
  |     ^
 ::: moves.csv:1:11  column `hinge`
  = help: a number is written as 12.5 or -1e-3, with a point and without a unit
""",
    ),
    mistake(
        "a number that is too large",
        MOVES.replace("30", "1e999"),
        """\
error[D194]: this number is too large: the largest is 1.8e308
 --> moves.csv:3:11
  |
3 | 0.5,      1e999,          2
  |           ^^^^^
 ::: moves.csv:1:11  column `hinge`
  = help: a number is written as 12.5 or -1e-3, with a point and without a unit
""",
    ),
    mistake(
        "a number that would become nothing",
        MOVES.replace("30", "4.9e-324"),
        """\
error[D194]: this number is too small: it would become 0
 --> moves.csv:3:11
  |
3 | 0.5,      4.9e-324,          2
  |           ^^^^^^^^
 ::: moves.csv:1:11  column `hinge`
  = help: a number is written as 12.5 or -1e-3, with a point and without a unit
""",
    ),
    mistake(
        "brackets without a unit",
        MOVES.replace("hinge [deg]", "hinge []"),
        """\
error[D193]: column `hinge` has no unit
 --> moves.csv:1:11
  |
1 | time [s], hinge [], other [rad]
  |           ^^^^^^^^
 ::: deck.ic:9:42  read here for joint `hinge`
  = help: write `hinge [deg]` or `hinge [rad]`
  = help: other units of this kind: mrad, arcmin, arcsec, cycle, rev
""",
    ),
    mistake(
        "a unit in round brackets",
        MOVES.replace("hinge [deg]", "hinge (deg)"),
        """\
error[D192]: `moves.csv` has no column `hinge`
 --> deck.ic:9:42
  |
9 |     command = position(trajectory(file = "moves.csv"));
  |                                          ^^^^^^^^^^^
 ::: moves.csv:1:1  its first line
  = help: a unit stands in square brackets: write `hinge [deg]`
  = help: columns: time, hinge (deg), other
  = help: that of the joint's name is taken, unless `column = "NAME"` names another
""",
    ),
    mistake(
        "no line that names the columns",
        "0, 0\n1, 1\n",
        """\
error[D191]: the first line names no columns: it holds numbers
 --> moves.csv:1:1
  |
1 | 0, 0
  | ^^^^
  = help: put a line above them, as in `time [s], shoulder [deg]`
""",
    ),
    mistake(
        "a column with a name that is a book",
        MOVES.replace("other", 50 * "o"),
        f"""\
error[D192]: `moves.csv` has no column `knee`
 --> deck.ic:9:64
  |
9 |     command = position(trajectory(file = "moves.csv", column = "knee"));
  |                                                                ^^^^^^
 ::: moves.csv:1:1  its first line
  = help: columns: time, hinge, {40 * "o"}...
""",
        'trajectory(file = "moves.csv", column = "knee")',
    ),
    mistake(
        "times that fall",
        MOVES.replace("0.5,", "1.5,"),
        """\
error[D195]: times of a file rise, and 1 s follows 1.5 s
 --> moves.csv:4:1
  |
4 | 1,        45,          -3e-1
  | ^
 ::: moves.csv:3:1  the row before
  = help: sort the rows; for a jump, two times close together
""",
    ),
    mistake(
        "times that stand still",
        MOVES.replace("0.5,", "1,  "),
        """\
error[D195]: times of a file rise, and 1 s follows 1 s
 --> moves.csv:4:1
  |
4 | 1,        45,          -3e-1
  | ^
 ::: moves.csv:3:1  the row before
  = help: sort the rows; for a jump, two times close together
""",
    ),
    mistake(
        "no rows",
        MOVES.splitlines()[0],
        """\
error[D196]: `moves.csv` has no rows
 --> moves.csv:1:1
  |
1 | time [s], hinge [deg], other [rad]
  | ^^^^^^^^
 ::: deck.ic:9:42  read here
  = help: a trajectory has 2 at least; `table` takes a single point
""",
    ),
    mistake(
        "one row",
        "\n".join(MOVES.splitlines()[:2]),
        """\
error[D196]: `moves.csv` has 1 row
 --> moves.csv:1:1
  |
1 | time [s], hinge [deg], other [rad]
  | ^^^^^^^^
 ::: deck.ic:9:42  read here
  = help: a trajectory has 2 at least; `table` takes a single point
""",
    ),
    mistake(
        "a row that is too short",
        MOVES.replace("30,          2", "30"),
        """\
error[D197]: this row has 2 cells, and the first line names 3 columns
 --> moves.csv:3:1
  |
3 | 0.5,      30
  | ^^^^^^^^^^^^
 ::: moves.csv:1:1  the columns
  = help: commas part the cells, and a number has a decimal point
""",
    ),
    mistake(
        "a decimal comma",
        MOVES.replace("30", "12,5"),
        """\
error[D197]: this row has 4 cells, and the first line names 3 columns
 --> moves.csv:3:1
  |
3 | 0.5,      12,5,          2
  | ^^^^^^^^^^^^^^^^^^^^^^^^^^
 ::: moves.csv:1:1  the columns
  = help: commas part the cells, and a number has a decimal point
""",
    ),
    mistake(
        "an empty file",
        "",
        """\
error[D191]: `moves.csv` is empty
 --> moves.csv:1:1
  |
1 |
  | ^
  = help: its first line names the columns, as in `time [s], shoulder [deg]`
""",
    ),
    mistake(
        "not UTF-8",
        MOVES.replace("other", "\xf6ther").encode("latin-1"),
        """\
error[D002]: `moves.csv` is not UTF-8: byte 0xf6
 --> moves.csv:1:24
  |
1 | time [s], hinge [deg], �ther [rad]
  |                        ^
  = help: save the file as UTF-8
""",
    ),
    mistake(
        "UTF-16",
        MOVES.encode("utf-16"),
        """\
error[D002]: `moves.csv` is UTF-16, but CSV files are UTF-8
 --> deck.ic:9:42
  |
9 |     command = position(trajectory(file = "moves.csv"));
  |                                          ^^^^^^^^^^^
  = help: save it as UTF-8
""",
    ),
    mistake(
        "semicolons",
        MOVES.replace(",", ";"),
        """\
error[D191]: `time [s]; hinge [deg]; other [rad]` does not name a column
 --> moves.csv:1:1
  |
1 | time [s]; hinge [deg]; other [rad]
  | ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
  = help: commas part the columns, as in `time [s], shoulder [deg]`
""",
    ),
    mistake(
        "a column that is there twice",
        MOVES.replace("other", "hinge"),
        """\
error[D198]: column `hinge` is there twice
 --> moves.csv:1:24
  |
1 | time [s], hinge [deg], hinge [rad]
  |                        ^^^^^^^^^^^
 ::: moves.csv:1:11  first
  = help: give one of them another name
""",
    ),
    mistake(
        "a column with a unit and no name",
        MOVES.replace("hinge ", ""),
        """\
error[D191]: `[deg]` does not name a column
 --> moves.csv:1:11
  |
1 | time [s], [deg], other [rad]
  |           ^^^^^
  = help: write the unit in square brackets behind the name, as in `shoulder [deg]`
""",
    ),
    mistake(
        "a column without a name",
        MOVES.replace("hinge [deg]", ""),
        """\
error[D191]: a column without a name
 --> moves.csv:1:10
  |
1 | time [s], , other [rad]
  |          ^
  = help: write the unit in square brackets behind the name, as in `shoulder [deg]`
""",
    ),
]


@pytest.mark.slow
@pytest.mark.parametrize(("text", "course", "message"), [m[1:] for m in MISTAKES], ids=[m[0] for m in MISTAKES])
def test_a_mistake_is_told_where_it_is(tmp_path: Path, text: str | bytes, course: str, message: str) -> None:
    assert shown(tmp_path, text, course) == message


@pytest.mark.slow
def test_a_unit_of_the_decks_own_is_none_in_a_file(tmp_path: Path) -> None:
    (tmp_path / "loads.csv").write_text("link, mass [turn], com [cycle]\nbar, 2, 1\n")
    deck = 'deck 2;\nunit turn = 360 deg;\nlet loads = csv("loads.csv");\nlet heavy = loads.bar.mass;\n'
    assert (
        messages(check(tmp_path, deck))
        == """\
error[D193]: `turn` is not a unit
 --> loads.csv:1:7
  |
1 | link, mass [turn], com [cycle]
  |       ^^^^^^^^^^^
  = help: CSV files have the units of the language alone: write the numbers in one of these

1 error
"""
    )


def test_a_comma_between_quotes_parts_no_cells(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text('\ufeffname,"mass, dry [kg]",note\nbar," 2.5 ","1,000"\n"a ""b"", c",3,",;"\nx,4,5"\n')
    table = read_csv(str(path))
    assert [(each.name, each.unit) for each in table.columns] == [("name", None), ("mass, dry", "kg"), ("note", None)]
    assert [[table.cell(column, row).text for column in table.columns] for row in range(3)] == [
        ["bar", "2.5", "1,000"], ['a ""b"", c', "3", ",;"], ["x", "4", '5"']
    ]  # fmt: skip
    assert (table.cell(table.columns[2], 0).place.column, table.cell(table.columns[1], 1).place.column) == (14, 14)
    with pytest.raises(Problem) as caught:
        table.quantities(table.columns[2])
    assert caught.value.diagnostics[0].message == "`1,000` is not a number"


@pytest.mark.slow
def test_a_file_may_have_as_many_rows_as_memory_holds(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("time [s], hinge [rad]\n" + "".join(f"{i},0.123456789012345678\n" for i in range(650_000)))
    table = read_csv(str(path))
    assert path.stat().st_size > 16 << 20 and table.quantity(table.cell(table.columns[0], 649_999))[0] == 649_999.0


@pytest.mark.parametrize(("named", "message"), [
    (".", "error[D001]: `DIR` is a directory, not a CSV file"),
    ("/dev/zero", "error[D001]: `/dev/zero` is not a regular file"),
    ("large.csv", f"error[D018]: `DIR/large.csv` has 4096.0 GiB; a CSV file has at most {memory() >> 20} MiB"),
])  # fmt: skip
def test_what_is_no_file_of_text_is_not_read(tmp_path: Path, named: str, message: str) -> None:
    with open(tmp_path / "large.csv", "wb") as stream:
        stream.truncate(1 << 42)  # it takes no room on the disk
    said = messages(check(tmp_path, ARM, servo(f'trajectory(file = "{named}")'), RUN)).replace(str(tmp_path), "DIR")
    assert said.splitlines()[:2] == [message, " --> deck.ic:9:42"]


def test_one_mistake_of_a_file_is_told_once_however_many_joints_read_it(tmp_path: Path) -> None:
    arm = changed(
        ARM,
        (
            "axis = z; }",
            "axis = z; }\n    link tip { mass = 1 kg; shape = sphere(radius = 1 cm); }\n"
            "    joint other revolute { parent = bar; child = tip; axis = x; }",
        ),
    )
    (tmp_path / "moves.csv").write_text(MOVES.replace("0.5,", "1.5,"))
    said = check(tmp_path, arm, servo(), changed(RUN, ("hinge = drive;", "hinge = drive; other = drive;")))
    assert [d.code for d in said.diagnostics] == ["D195"]


@pytest.mark.release
def test_a_broken_file_is_told_with_a_place_whatever_is_wrong_with_it(tmp_path: Path) -> None:
    pick = random.Random(190)
    odd = b'0123456789.,;[]"#\n\r\t -+eE\xff\x00am/^*'
    told_codes = set()
    for _ in range(150):
        text = bytearray(MOVES.encode())
        for _ in range(pick.randint(1, 6)):
            at = pick.randrange(len(text))
            text[at : at + pick.randint(0, 3)] = bytes(pick.choices(odd, k=pick.randint(0, 2)))
        (tmp_path / "moves.csv").write_bytes(bytes(text))
        compiled = check(tmp_path, ARM, servo(), RUN)
        assert all(diagnostic.at is not None for diagnostic in compiled.diagnostics)
        assert (compiled.plan is None) == bool(compiled.diagnostics)
        told_codes |= {diagnostic.code for diagnostic in compiled.diagnostics}
    assert {"D002", "D191", "D192", "D194", "D197"} <= told_codes


@pytest.mark.parametrize(
    "head", ["a" + 60_000 * " " + "b [ " + 60_000 * " " + "x", 100_000 * "[ ", "a [" + 100_000 * " "]
)
def test_a_first_line_of_spaces_is_read_as_soon_as_another(tmp_path: Path, head: str) -> None:
    """No pattern tries each way of cutting them: that took minutes."""
    said = shown(tmp_path, head + "\n1\n")
    assert said.startswith("error[D191]: `") and " does not name a column\n --> moves.csv:1:1\n" in said


def test_units_may_stand_in_a_line_above_the_head(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text('# MET: nominal\n# units: s,deg,1\ntime,"hinge",on\n0,180,1\n', encoding="utf-8")
    assert [each.unit for each in read_csv(str(path)).columns] == ["s", "deg", "1"]
    path.write_text("# units: s,deg\ntime [ms],hinge [rad]\n0,180\n", encoding="utf-8")
    assert [each.unit for each in read_csv(str(path)).columns] == ["ms", "rad"]
    path.write_text("time,hinge\n# units: s,deg\n0,180\n", encoding="utf-8")
    assert [each.unit for each in read_csv(str(path)).columns] == [None, None]
