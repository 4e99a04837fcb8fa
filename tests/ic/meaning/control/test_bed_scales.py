"""`scale` in a `substitute`: what it makes of the bed's motor, what is said of it, and whole messages of wrong ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from met import cli
from met.plan import Experiment, Formula
from met.substitution.bed_scale import BedScale
from tests.ic.small_decks import ARM, RUN, SERVO, check, experiment, messages

DECK = ARM + SERVO + RUN


def scaled(folder: Path, scale: str, bed: str = "emulated") -> Experiment:
    more = f"run it like hold {{ substitute hinge {{ bed = {bed};  scale {{ {scale} }} }} }}\n"
    return experiment(folder, DECK, more, select=["it"])


def said(folder: Path, more: str, select: str = "it") -> str:
    """What is said of the deck with these lines before, without the counting line."""
    return messages(check(folder, more + "\n", DECK, select=[select])).rpartition("\n\n")[0] + "\n"


def said_of(folder: Path, scale: str) -> str:
    return said(folder, f"run it like hold {{ substitute hinge {{ {scale} }} }}")


def test_what_is_the_servo_s_is_over_its_scale(tmp_path: Path) -> None:
    made = scaled(tmp_path, "torque = 25;  rate = 2;  voltage = 10;")
    (use,) = made.structure.substitutions
    assert use.scaled
    scale = BedScale(25.0, 2.0, 10.0)
    for name, of in (("kt", "kt"), ("resistance", "resistance"), ("tau_max", "tau_max"), ("f_c", "f_c"), ("f_v", "f_v"),
                     ("inertia", "j_m")):  # fmt: skip
        found, servos = made.parameters[f"hinge.bed.{name}"], made.parameters[f"hinge.servo.{of}"]
        assert found.value == servos.value / scale.of(found.unit), name
        assert (found.origin.kind, found.origin.note) == ("derived", f"that of `hinge.servo.{of}` over its scale")
        assert found.origin.place == servos.origin.place
    assert made.parameters["hinge.bed.kt_load"].value == 0.072, "no servo's: the bed's own"


def test_what_is_written_of_the_bed_is_the_bed_s(tmp_path: Path) -> None:
    made = scaled(tmp_path, "torque = 25;", "emulated(kt = 0.03 N*m/A, inertia = 1e-5 kg*m^2)")
    assert made.parameters["hinge.bed.kt"].value == 0.03
    assert made.parameters["hinge.bed.inertia"].value == 1e-5
    assert made.parameters["hinge.bed.tau_max"].value == 1.0 / 25.0
    scales = {path: each.value for path, each in made.parameters.items() if ".scale." in path}
    assert scales == {"hinge.bed.scale.torque": 25.0, "hinge.bed.scale.rate": 1.0, "hinge.bed.scale.voltage": 1.0}


def test_without_a_scale_nothing_of_it_is_in_the_plan(tmp_path: Path) -> None:
    made = experiment(tmp_path, DECK, "run it like hold { substitute hinge { } }\n", select=["it"])
    assert not made.structure.substitutions[0].scaled
    assert not [path for path in made.parameters if "scale" in path]


@pytest.mark.slow
def test_a_scale_is_taken_over_changed_and_removed_as_any_block(tmp_path: Path) -> None:
    base = "run base_run like hold { substitute hinge { scale { torque = 25;  rate = 2; } } }\n"
    changed = base + "run it like base_run { hinge { scale { rate = 5; } } }\n"
    made = experiment(tmp_path, DECK, changed, select=["it"])
    values = [made.parameters[f"hinge.bed.scale.{name}"].value for name in ("torque", "rate")]
    assert values == [25.0, 5.0]
    removed = base + "run it like base_run { hinge { remove scale; } }\n"
    assert not experiment(tmp_path, DECK, removed, select=["it"]).structure.substitutions[0].scaled


@pytest.mark.slow
def test_a_sweep_varies_scales_and_what_follows_from_them(tmp_path: Path) -> None:
    more = (
        "run it like hold { substitute hinge { scale { rate = 2; } } }\n"
        "sweep sizes of it { vary hinge.bed.scale.torque = [10, 20];  vary drive.tau_max = [1, 2] N*m; }\n"
    )
    made = experiment(tmp_path, DECK, more, select=["sizes"])
    strongest, torque = (made.parameters[f"hinge.bed.{name}"].value for name in ("tau_max", "scale.torque"))
    assert isinstance(strongest, Formula) and isinstance(torque, Formula)
    assert made.column(strongest)[:].tolist() == [0.1, 0.2, 0.05, 0.1]
    assert made.column(torque)[:].tolist() == [10.0, 10.0, 20.0, 20.0]


@pytest.mark.slow
def test_set_and_with_reach_a_scale(tmp_path: Path) -> None:
    more = "run it like hold { substitute hinge { scale { } }  with hinge.bed.scale.torque = 4; }\n"
    made = experiment(tmp_path, DECK, more, select=["it"])
    assert made.parameters["hinge.bed.tau_max"].value == 0.25


MESSAGES = {
    "scale { torque = 0; }": """\
error[D077]: `torque` of the scale of joint `hinge`'s bed must be above 0
 --> deck.ic:1:56
  |
1 | run it like hold { substitute hinge { scale { torque = 0; } } }
  |                                                        ^ this is 0
  = help: write a number above 0 (torque of the joint's motor divided by that of the bed's motor)
""",
    "scale { rate = -2; }": """\
error[D077]: `rate` of the scale of joint `hinge`'s bed must be above 0
 --> deck.ic:1:54
  |
1 | run it like hold { substitute hinge { scale { rate = -2; } } }
  |                                                      ^^ this is -2
  = help: write a number above 0 (rate of the joint's motor divided by that of the bed's motor)
""",
    "scale { torque = 25 N*m; }": """\
error[D061]: `torque` of the scale of joint `hinge`'s bed is a pure number, and this is in N*m
 --> deck.ic:1:56
  |
1 | run it like hold { substitute hinge { scale { torque = 25 N*m; } } }
  |                                                        ^^^^^^
  = help: leave the unit out; `%` is the only unit of a pure number
""",
    "scale { rate = 2 Hz; }": """\
error[D061]: `rate` of the scale of joint `hinge`'s bed is a pure number, and this is in 1/s
 --> deck.ic:1:54
  |
1 | run it like hold { substitute hinge { scale { rate = 2 Hz; } } }
  |                                                      ^^^^
  = help: leave the unit out; `%` is the only unit of a pure number
""",
    "scale { current = 2; }": """\
error[D141]: the scale of joint `hinge`'s bed has no `current`
 --> deck.ic:1:47
  |
1 | run it like hold { substitute hinge { scale { current = 2; } } }
  |                                               ^^^^^^^
  = help: it has: torque, rate, voltage, inertia
""",
    "scale = 25;": """\
error[D111]: `scale` is a block, not a value
 --> deck.ic:1:39
  |
1 | run it like hold { substitute hinge { scale = 25; } }
  |                                       ^^^^^
  = help: write `scale { ... }`
""",
    "scale { torque = 25;  rate = 2;  inertia = 25; }": """\
error[D365]: `inertia` of the scale of joint `hinge`'s bed is not that of its torque and rate
 --> deck.ic:1:82
  |
1 | run it like hold { substitute hinge { scale { torque = 25;  rate = 2;  inertia = 25; } } }
  |                                                                                  ^^ it is 25/2 = 12.5
  = help: leave it out: with one time for both, inertia is torque over rate
""",
    "scale { torque = [1, 2]; }": """\
error[D071]: `torque` of the scale of joint `hinge`'s bed is one number, and this is a list
 --> deck.ic:1:56
  |
1 | run it like hold { substitute hinge { scale { torque = [1, 2]; } } }
  |                                                        ^^^^^^
  = help: write one number: these are 2
""",
    "scaled { torque = 25; }": """\
error[D141]: `substitute hinge` has no `scaled`
 --> deck.ic:1:39
  |
1 | run it like hold { substitute hinge { scaled { torque = 25; } } }
  |                                       ^^^^^^
  = help: did you mean `scale`?
  = help: it has: bed, law, scale
""",
}


@pytest.mark.parametrize("scale", MESSAGES)
def test_what_is_wrong_with_a_scale_is_said_whole(tmp_path: Path, scale: str) -> None:
    assert said_of(tmp_path, scale) == MESSAGES[scale]


def test_an_inertia_that_only_some_cases_have_is_refused_with_the_first_that_has_not(tmp_path: Path) -> None:
    more = (
        "run it like hold { substitute hinge { scale { rate = 2;  inertia = 5; } } }\n"
        "sweep sizes of it { vary hinge.bed.scale.torque = [10, 20]; }"
    )
    assert (
        said(tmp_path, more, "sizes")
        == """\
error[D365]: `inertia` of the scale of joint `hinge`'s bed is not that of its torque and rate; case #1 breaks it
 --> deck.ic:1:68
  |
1 | run it like hold { substitute hinge { scale { rate = 2;  inertia = 5; } } }
  |                                                                    ^ it is 20/2 = 10
  = help: case #1: hinge.bed.scale.torque = 20
  = help: leave it out: with one time for both, inertia is torque over rate
"""
    )


def test_an_inertia_that_is_varied_is_held_against_the_others(tmp_path: Path) -> None:
    more = (
        "run it like hold { substitute hinge { scale { torque = 5;  inertia = 5; } } }\n"
        "sweep sizes of it { vary hinge.bed.scale.inertia = [5, 6]; }"
    )
    assert (
        said(tmp_path, more, "sizes")
        == """\
error[D365]: `inertia` of the scale of joint `hinge`'s bed is not that of its torque and rate; case #1 breaks it
 --> deck.ic:1:70
  |
1 | run it like hold { substitute hinge { scale { torque = 5;  inertia = 5; } } }
  |                                                                      ^ it is 5/1 = 5
  = help: case #1: hinge.bed.scale.inertia = 6
  = help: leave it out: with one time for both, inertia is torque over rate
"""
    )


def test_a_scale_of_a_bed_that_has_none_cannot_be_varied(tmp_path: Path) -> None:
    more = "run it like hold { substitute hinge { } }\nsweep sizes of it { vary hinge.bed.scale.torque = [5, 6]; }"
    assert (
        said(tmp_path, more, "sizes")
        == """\
error[D128]: no parameter `hinge.bed.scale.torque` in this run
 --> deck.ic:2:26
  |
2 | sweep sizes of it { vary hinge.bed.scale.torque = [5, 6]; }
  |                          ^^^^^^^^^^^^^^^^^^^^^^
  = help: its bed has no scale: `scale { }` in `substitute hinge` gives it one
"""
    )


@pytest.mark.slow
def test_a_motor_that_is_at_its_limit_before_the_joint_s_is_warned_of(tmp_path: Path) -> None:
    more = "run it like hold { substitute hinge { bed = emulated(tau_max = 0.03 N*m);  scale { torque = 25; } } }"
    assert (
        said(tmp_path, more)
        == """\
warning[D366]: the bed's motor of joint `hinge` gives 0.03 N*m at most, which stands for 0.75 N*m, and the joint's motor gives 1 N*m
 --> deck.ic:1:64
  |
1 | run it like hold { substitute hinge { bed = emulated(tau_max = 0.03 N*m);  scale { torque = 25; } } }
  |                                                                ^^^^^^^^
  = help: beyond that torque the run is one of a weaker motor; where it stays below, nothing is lost
  = help: a stronger motor on the bed, or `torque = 33.3333;` in its `scale`, by which inertias grow too
"""
    )
    assert said(tmp_path, more.replace("0.03", "0.04")) == "\n"
    assert said(tmp_path, more.replace(" } } }", ' } }  allow D366 because "it stays below"; }')) == "\n"


@pytest.mark.slow
def test_a_swept_motor_is_warned_of_with_its_case(tmp_path: Path) -> None:
    more = (
        "run it like hold { substitute hinge { bed = emulated(tau_max = 0.04 N*m);  scale { torque = 25; } } }\n"
        "sweep motors of it { vary hinge.bed.tau_max = [0.05, 0.03] N*m; }"
    )
    assert "D366" in said(tmp_path, more, "motors")
    assert "in case #1" in said(tmp_path, more, "motors")


@pytest.mark.slow
def test_explain_and_plan_tell_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    more = "default run it like hold { substitute hinge { scale { torque = 25;  rate = 2; } } }\n"
    Path("a.ic").write_text(DECK + more, encoding="utf-8")
    assert cli.main(["plan", "a.ic"]) == 0
    assert (
        """
On a bed: the motor of hinge; what is not told here is the servo's, or the default
  hinge  bed    emulated
         law    velocity_tracking
         scale                     torque = 25, rate = 2, voltage = 1; the servo's is over it
"""
        in capsys.readouterr().out
    )
    assert cli.main(["explain", "a.ic", "hinge.bed.scale.torque"]) == 0
    assert (
        capsys.readouterr().out
        == """\
hinge.bed.scale.torque = 25
  torque of the joint's motor divided by that of the bed's motor (scale)
  --> a.ic:18:64
   |
18 | default run it like hold { substitute hinge { scale { torque = 25;  rate = 2; } } }
   |                                                                ^^ written here
"""
    )
