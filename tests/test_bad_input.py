"""A user's mistakes, as the README promises them: one placed message each, exit status 2, and nothing written."""

from __future__ import annotations

from pathlib import Path

import pytest

from met import cli

# ruff: noqa: E501 - messages are as wide as they are

DECK = """\
#include <servos/rigid_gearbox.ic>
arm one {
    link bar { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link tip { mass = 1 kg; shape = rod(length = 1 m, along = x); }
    joint pivot revolute { parent = base; child = bar; axis = z; }
    joint wrist revolute { parent = bar; child = tip; axis = z; at = [1, 0, 0] m; }
}
servo drive like rigid_gearbox { command = rate(0.1 rad/s); }
run swing {
    arm = one;
    servos { pivot = drive; wrist = drive; }
    rates { dynamics = 1 kHz; servos = 500 Hz; record = 100 Hz; }
    duration = 1 s;
    record = [q];
}
"""

MISTAKES = {
    "an unknown key": (
        "mass = 1 kg;",
        "mass = 1 kg; colour = 3;",
        """\
error[D141]: link `tip` has no `colour`
 --> deck.ic:4:29
  |
4 |     link tip { mass = 1 kg; colour = 3; shape = rod(length = 1 m, along = x); }
  |                             ^^^^^^
  = help: it has: mass, shape, com, inertia, mesh, lumped

1 error
""",
    ),
    "a wrong unit": (
        "duration = 1 s",
        "duration = 1 m",
        """\
error[D061]: `duration` of run `swing` is in s, and this is in m
  --> deck.ic:13:16
   |
13 |     duration = 1 m;
   |                ^^^
   = help: write it in s, ms, us, min, h or ns

1 error
""",
    ),
    "a missing include": (
        "<servos/rigid_gearbox.ic>",
        "<servos/rigid_gearbos.ic>",
        """\
error[D005]: cannot find <servos/rigid_gearbos.ic>
 --> deck.ic:1:10
  |
1 | #include <servos/rigid_gearbos.ic>
  |          ^^^^^^^^^^^^^^^^^^^^^^^^^
  = help: did you mean `servos/rigid_gearbox.ic`?
  = help: looked in the standard library

1 error
""",
    ),
    "a macro named like a unit": (
        "arm one {",
        "#define N 6\narm one {",
        """\
error[D011]: a macro cannot be called `N`: that is the unit newton
 --> deck.ic:2:9
  |
2 | #define N 6
  |         ^
  = help: it would replace the unit in every quantity after it: `2 N` would lose its unit

1 error
""",
    ),
    "wrong arguments of a macro": (
        "arm one {",
        "#define LINK(NAME, MASS) link NAME { mass = MASS; shape = sphere(radius = 1 m); }\narm one {\n    LINK(odd)",
        """\
error[D012]: macro `LINK` takes 2 arguments, but 1 is given
 --> deck.ic:4:5
  |
4 |     LINK(odd)
  |     ^^^^^^^^^
 ::: deck.ic:2:9  `LINK` is defined here

1 error
""",
    ),
    "a loop of joints": (
        "parent = base; child = bar",
        "parent = tip; child = bar",
        """\
error[D086]: these joints make a loop, which hangs on no base: bar -> tip -> bar
 --> deck.ic:5:5
  |
5 |     joint pivot revolute { parent = tip; child = bar; axis = z; }
  |     ^^^^^^^^^^^^^^^^^^^^ joint `pivot` closes it
 ::: deck.ic:6:5  joint `wrist`
  = help: one of them should have `parent = base;`

1 error
""",
    ),
    "a negative mass": (
        "mass = 2 kg",
        "mass = -2 kg",
        """\
error[D077]: `mass` of link `bar` must be at least 0 kg
 --> deck.ic:3:23
  |
3 |     link bar { mass = -2 kg; shape = rod(length = 1 m, along = x); }
  |                       ^^^^^ this is -2 kg
  = help: write a number of at least 0 kg (mass of the link)

1 error
""",
    ),
    "rates that do not divide": (
        "servos = 500 Hz",
        "servos = 300 Hz",
        """\
error[D100]: `servos` at 300 Hz does not divide the base rate, 1000 Hz
  --> deck.ic:12:40
   |
12 |     rates { dynamics = 1 kHz; servos = 300 Hz; record = 100 Hz; }
   |                                        ^^^^^^ 1000/300 = 3.333
  ::: deck.ic:12:24  base rate set here: the fastest, `dynamics`
   = help: nearest that fit: 333.333 Hz, written (1000/3) Hz, 250 Hz (1000/4)
   = help: or a base rate that all divide: `base = 3000 Hz;` in `rates`

1 error
""",
    ),
    "a servo on no joint": (
        "wrist = drive",
        "wirst = drive",
        """\
error[D144]: no joint `wirst` in arm `one`
  --> deck.ic:11:29
   |
11 |     servos { pivot = drive; wirst = drive; }
   |                             ^^^^^
   = help: did you mean `wrist`?
   = help: joints: pivot, wrist

1 error
""",
    ),
    "a table with a hole": (
        "rate(0.1 rad/s)",
        "rate(table(times = [0, 1, 2] s, values = [0, 1] rad/s))",
        """\
error[D154]: `values` of `table` has 2 numbers, and `times` 3
 --> deck.ic:8:85
  |
8 | servo drive like rigid_gearbox { command = rate(table(times = [0, 1, 2] s, values = [0, 1] rad/s)); }
  |                                                                                     ^^^^^^^^^^^^
 ::: deck.ic:8:63  `times`
  = help: they go together, one to one

1 error
""",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize(("right", "wrong", "said"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_one_placed_message_and_nothing_is_written(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    right: str,
    wrong: str,
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert right in DECK
    Path("deck.ic").write_text(DECK.replace(right, wrong, 1))
    assert cli.main(["run", "deck.ic"]) == 2
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("", said)
    assert [path.name for path in tmp_path.iterdir()] == ["deck.ic"]


def test_an_output_that_cannot_be_written_is_told_before_anything_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("deck.ic").write_text(DECK)
    assert cli.main(["run", "deck.ic", "-o", "nowhere/deck.h5"]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert (
        printed.err
        == """\
error[E305]: cannot write nowhere/deck.h5: nowhere does not exist
 = help: make it first: `mkdir -p nowhere`

1 error
"""
    )
    assert [path.name for path in tmp_path.iterdir()] == ["deck.ic"]


@pytest.mark.slow
def test_the_deck_without_a_mistake_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("deck.ic").write_text(DECK)
    assert cli.main(["run", "deck.ic", "--no-picture", "-q"]) == 0
    assert Path("deck.h5").is_file()


def test_a_misspelt_deck_is_told_with_the_one_that_was_meant(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(["run", "two_lnk.ic"]) == 2
    assert (
        capsys.readouterr().err
        == """\
error[D173]: no deck `two_lnk.ic`
 = help: did you mean `two_link.ic`?
 = help: standard decks: ets_vii.ic, free_flyer.ic, manutec_r3.ic, manutec_r3_one_axis.ic, panda.ic, puma_560.ic, shuttle_arm.ic, shuttle_booms.ic, soft_capture.ic, stanford_arm.ic, station_arm.ic, two_link.ic

1 error
"""
    )
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_deck_is_found_in_a_folder_of_includes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("decks").mkdir()
    Path("decks/mine.ic").write_text(DECK)
    assert cli.main(["check", "mine.ic", "-I", "decks"]) == 0
    assert cli.main(["run", "mine.ic", "-I", "decks", "--no-picture", "-q"]) == 0
