"""Mistakes in a sweep: whole messages."""

from __future__ import annotations

from pathlib import Path

from tests.ic.small_decks import ARM, RUN, SERVO, shown


def test_an_unknown_sweep_path(tmp_path: Path) -> None:
    deck = (ARM, SERVO, RUN, "default sweep it of hold { vary links.bra.mass = [1, 2] kg; }\n")
    assert (
        shown(tmp_path, *deck)
        == """\
error[D128]: no parameter `links.bra.mass` in this run
  --> deck.ic:18:33
   |
18 | default sweep it of hold { vary links.bra.mass = [1, 2] kg; }
   |                                 ^^^^^^^^^^^^^^
   = help: did you mean `links.bar.mass`?
"""
    )


def test_a_parameter_set_twice_in_a_sweep(tmp_path: Path) -> None:
    deck = (
        ARM,
        SERVO,
        RUN,
        "default sweep it of hold {\n    vary drive.kp = [1, 2] V*s/rad;\n    vary hinge.servo.kp = [1, 2] V*s/rad;\n}\n",
    )
    assert (
        shown(tmp_path, *deck)
        == """\
error[D123]: `drive.kp` and `hinge.servo.kp` both set `hinge.servo.kp`
  --> deck.ic:20:10
   |
20 |     vary hinge.servo.kp = [1, 2] V*s/rad;
   |          ^^^^^^^^^^^^^^
  ::: deck.ic:19:10  the first
   = help: vary one of them, or different joints
"""
    )


def test_a_sweep_over_words(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, ARM, SERVO, RUN, "default sweep it of hold { vary links.bar.mass = [light]; }\n")
        == """\
error[D122]: `links.bar.mass` cannot vary over words
  --> deck.ic:18:51
   |
18 | default sweep it of hold { vary links.bar.mass = [light]; }
   |                                                   ^^^^^
   = help: write a run for each, `like` the first, and `sweep NAME = ONE + OTHER;`
   = help: where a number is meant, define it: `let light = ...;`
"""
    )


def test_a_misspelt_value_of_a_sweep_is_no_word(tmp_path: Path) -> None:
    assert (
        shown(
            tmp_path,
            ARM,
            SERVO,
            RUN,
            "let heavy = 2 kg;\ndefault sweep it of hold { vary links.bar.mass = [heavi]; }\n",
        )
        == """\
error[D065]: no value `heavi`
  --> deck.ic:19:51
   |
19 | default sweep it of hold { vary links.bar.mass = [heavi]; }
   |                                                   ^^^^^
   = help: did you mean `heavy`?
"""
    )


def test_a_bad_case(tmp_path: Path) -> None:
    deck = (ARM, SERVO, RUN, "default sweep it of hold { vary links.bar.mass = [1000, -2, -1] g; }\n")
    assert (
        shown(tmp_path, *deck)
        == """\
error[D077]: `mass` of link `bar` must be at least 0 kg; case #1 breaks it, and 1 more
  --> deck.ic:18:33
   |
18 | default sweep it of hold { vary links.bar.mass = [1000, -2, -1] g; }
   |                                 ^^^^^^^^^^^^^^ this is -0.002 kg
   = help: case #1: links.bar.mass = -2 g
   = help: write a number of at least 0 kg (mass of the link)
"""
    )
