"""`met profile`: what it prints, whole."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path

import pytest

import ic
from batch.terminal.profile import profile_lines
from ic.find import standard_decks
from met.analysis.profile import Input, RunProfile, WorkCost
from met.cli import main
from tests.batch import plans

MADE_UP = RunProfile(
    experiment="gains",
    cases=36,
    joints=2,
    lanes=32,
    vector=8,
    cpu="znver4",
    code_bytes=19442,
    pieces=18,
    cached=True,
    recording_s=0.0104,
    compiling_s=0.0057,
    blocks=2,
    steps=1500,
    ns=20.0,
    peak=50e9,
    constants=59,
    inputs=(Input("gearbox.kp", 2, 0, 2, 2), Input("links.lower.mass", 1, 1234, 3, 18)),
    parts=(
        WorkCost("servo computers", "", False, 4.0, 176.0, 96.0, 5.5),
        WorkCost("first stage", "servo physics", False, 1.0, 18.0, 14.0, 0.75),
        WorkCost("first stage", "dynamics", False, 1.0, 1411.0, 87.0, 12.25),
        WorkCost("first stage", "", False, 1.0, 24.0, 12.5, 1.0),
        WorkCost("recorder", "", False, 0.1, 0.0, 0.0, 0.04),
        WorkCost("friction decisions", "", True, 0.326, 41.8, 2.3, 0.25),
        WorkCost("friction splits", "", True, 0.0, 0.0, 0.0, 0.0),
    ),
)

SHOWN = """\
gains: 2 joints, 36 cases, modified_euler, steps of 40 ms

  a step of a case       times  operations  flops    ns  share
  servo computers            4         176     96   5.5   28 %
  first stage                1       1,453    114    14   70 %
    servo physics                       18     14  0.75    4 %
    dynamics                         1,411     87    12   61 %
  recorder                 0.1           0      0  0.04    0 %
  friction events                       42    2.3  0.25    1 %
  all parts, each alone              1,671    212    20   99 %
  the whole run                                      20  100 %

  10.6 Gflop/s, 21 % of the 50.0 Gflop/s that this core does at most; a fused multiply-add counts as two
  friction events of a block: 0.33 decisions at rest and 0 splits a step

  timed   1,500 steps of 2 blocks on one core, best of several
  block   32 cases, 8 of them in a register (znver4)
  code    19.0 KiB in 18 pieces
  made    recorded in 10.4 ms, found in the cache in 5.7 ms
  folded  59 parameters that no case varies

  varied            sets   once  kept  taken by
  gearbox.kp           2      0     2         2
  links.lower.mass     1  1,234     3        18

  sets: parameters that follow; once: operations that depend on it and are done before the first step;
  kept: numbers that these leave in a case's memory; taken by: operations of a step that take one"""

PLAIN = """
#include <two_link.ic>
servo smooth like rigid_gearbox { f_c = 0 N*m; command = rate(slow); }
run brief like nominal { servos { shoulder = smooth; elbow = smooth; } duration = 1 s; remove settle; }
"""


def test_a_profile_is_shown_in_columns() -> None:
    assert "\n".join(profile_lines(MADE_UP, plans.gains(36))) == SHOWN


@pytest.mark.slow
def test_what_a_deck_gives_is_shown_whole(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Numbers are masked, and how the code was come by; without friction there are no events."""
    Path("a.ic").write_text(PLAIN)
    assert main(["profile", "a.ic", "brief"]) == 0
    shown = re.sub(r"\d[\d,.]*", "#", capsys.readouterr().out)
    shown = re.sub(r"compiled|found in the cache", "come by", shown)
    shown = re.sub(r"\((\w*#)?\w*\)|# m?s\b|# [KM]iB", "#", shown)
    assert (
        re.sub(r" {2,}", "  ", shown)
        == """\
brief: # joints, # case, modified_euler, steps of #

  a step of a case  times  operations  flops  ns  share
  servo computers  #  #  #  #  # %
  friction modes  #  #  #  #  # %
  first stage  #  #  #  #  # %
  servo physics  #  #  #  # %
  dynamics  #  #  #  # %
  integrator  #  #  #  #  # %
  further stages  #  #  #  #  # %
  servo physics  #  #  #  # %
  dynamics  #  #  #  # %
  metrics  #  #  #  #  # %
  recorder  #  #  #  #  # %
  limits  #  #  #  #  # %
  watch  #  #  #  #  # %
  all parts, each alone  #  #  #  # %
  the whole run  #  # %

  # Gflop/s, # % of the # Gflop/s that this core does at most; a fused multiply-add counts as two
  no joint has dry friction: no events

  timed  # steps of # blocks on one core, best of several
  block  # cases, # of them in a register #
  code  # in # pieces
  made  recorded in #, come by in #
  folded  # parameters that no case varies
"""
    )


@pytest.mark.slow
def test_programs_get_json_of_every_run_asked_for(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["profile", "two_link.ic", "nominal", "gains", "--format", "json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [(each["experiment"], each["cases"]) for each in found] == [("nominal", 1), ("gains", 36)]
    assert isinstance(found[0], Mapping) and {"peak", "parts", "inputs", "flops", "share_of_peak"} <= set(found[0])


@pytest.mark.slow
def test_a_plan_file_is_measured_too(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from met.plan import file as plan_file

    plan_file.write(ic.compile("two_link.ic", select="all"), "p.json")
    assert main(["profile", "p.json", "nominal"]) == 0
    assert capsys.readouterr().out.startswith("nominal: 2 joints, 1 case, ")
    assert main(["profile", "p.json", "nominl"]) == 2
    assert capsys.readouterr().err == (
        "error[E310]: no run or sweep `nominl` in <two_link.ic>\n"
        " = help: did you mean `nominal`?\n"
        " = help: runs and sweeps of <two_link.ic>: nominal, hybrid, gains\n\n1 error\n"
    )


def test_a_bad_deck_is_told_as_everywhere(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.ic").write_text("run one { arm = nothing; }\n")
    assert main(["profile", "a.ic"]) == 2
    err = capsys.readouterr().err
    assert main(["check", "a.ic"]) == 2
    assert err == capsys.readouterr().err and err.startswith("error[D")
    assert main(["profile", "two_lnk.ic"]) == 2
    assert capsys.readouterr().err == (
        "error[D173]: no deck `two_lnk.ic`\n"
        " = help: did you mean `two_link.ic`?\n"
        f" = help: standard decks: {', '.join(standard_decks())}\n\n1 error\n"
    )
