"""Mistakes in `substitute`: whole messages."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

import met.substitution
from met.servos import rigid_gearbox
from met.substitution import BEDS
from tests.ic.meaning.control.test_substitution import DECK, HYBRID, said, shown
from tests.ic.small_decks import check

MISTAKES = {
    "no joint of this name": (
        "substitute onne {}",
        """\
error[D144]: no joint `onne` in arm `chain`
 --> deck.ic:1:24
  |
1 | run it like base_run { substitute onne {} }
  |                        ^^^^^^^^^^^^^^^
  = help: did you mean `one`?
  = help: joints: one, two, three, free
""",
    ),
    "a fixed joint": (
        "substitute mount {}",
        """\
error[D145]: joint `mount` is fixed, so it has no motor
 --> deck.ic:1:24
  |
1 | run it like base_run { substitute mount {} }
  |                        ^^^^^^^^^^^^^^^^
 ::: deck.ic:12:5  fixed here
  = help: leave it out, or make the joint revolute or prismatic
""",
    ),
    "a joint without a servo": (
        "substitute free {}",
        """\
error[D175]: joint `free` has no servo, so it has no motor that a bed could take the place of
 --> deck.ic:1:24
  |
1 | run it like base_run { substitute free {} }
  |                        ^^^^^^^^^^^^^^^
  = help: give it one: `servos { free = SERVO; }`
  = help: joints whose servos have a motor: one, two
""",
    ),
    "a servo without a motor": (
        "substitute three {}",
        """\
error[D176]: servo `follow` (ideal) of joint `three` has no motor that a bed could take the place of
 --> deck.ic:1:24
  |
1 | run it like base_run { substitute three {} }
  |                        ^^^^^^^^^^^^^^^^
 ::: deck.ic:24:40  its servo
  = help: servo models that have a motor: rigid_gearbox
""",
    ),
    "two laws in one run": (
        "substitute one { law = bare; }  substitute two { law = torque_balance(band = 1 rad/s); }",
        """\
error[D177]: joint `two` has the law `torque_balance`, and joint `one` has `bare`
 --> deck.ic:1:79
  |
1 | run it like base_run { substitute one { law = bare; }  substitute two { law = torque_balance(band = 1 rad/s); } }
  |                                                                               ^^^^^^^^^^^^^^
 ::: deck.ic:1:47  `bare`
  = help: all substituted joints of a run are solved together, by one law: write the same for each
  = help: or substitute them in two runs
""",
    ),
    "servos that do not tick together": (
        "servos { two { rate = 500 Hz; } }  substitute one {}  substitute two {}",
        """\
error[D178]: the servo of joint `two` ticks at 500 Hz, and that of joint `one`, whose motor is on a bed too, at 1000 Hz
 --> deck.ic:1:78
  |
1 | run it like base_run { servos { two { rate = 500 Hz; } }  substitute one {}  substitute two {} }
  |                                                                              ^^^^^^^^^^^^^^
 ::: deck.ic:1:59  1000 Hz
  = help: all substituted joints of a run are solved together: give their servos the same `rate`
  = help: or substitute them in two runs
""",
    ),
    "a servo that ticks too seldom for a bed": (
        "servos { one { rate = 5 Hz; } }  substitute one {}",
        """\
error[D367]: the servo of joint `one` ticks at 5 Hz, too seldom for a motor on a bed
 --> deck.ic:1:57
  |
1 | run it like base_run { servos { one { rate = 5 Hz; } }  substitute one {} }
  |                                                         ^^^^^^^^^^^^^^
  = help: give it 10 Hz or more: between two ticks the shaft goes on with what it was told last
""",
    ),
    "the block of a joint that is not substituted": (
        "one { law = bare; }",
        """\
error[D109]: nothing named `one` in run `it` to change
 --> deck.ic:1:24
  |
1 | run it like base_run { one { law = bare; } }
  |                        ^^^
  = help: `substitute one { ... }` would put this joint's motor on a bed
""",
    ),
    "a drive with a rate loop does not run away": (
        "substitute one { bed = rate_drive(); } environment { bolt = runaway(joint = one); }",
        """\
error[D368]: `bolt` replaces the voltage of joint `one`, and `rate_drive` sends a rate
 --> deck.ic:1:77
  |
1 | run it like base_run { substitute one { bed = rate_drive(); } environment { bolt = runaway(joint = one); } }
  |                                                                             ^^^^
 ::: deck.ic:1:24  on a bed
  = help: leave it out: what the drive does with its rate is the drive's
""",
    ),
    "unknown models": (
        "substitute one { bed = emulatd; law = bar; }",
        """\
error[D140]: no bed model `emulatd`
 --> deck.ic:1:47
  |
1 | run it like base_run { substitute one { bed = emulatd; law = bar; } }
  |                                               ^^^^^^^
  = help: did you mean `emulated`?
  = help: bed models: emulated, rate_drive, torque_drive

error[D140]: no law model `bar`
 --> deck.ic:1:62
  |
1 | run it like base_run { substitute one { bed = emulatd; law = bar; } }
  |                                                              ^^^
  = help: did you mean `bare`?
  = help: law models: bare, measured_acceleration, torque_balance, torque_balance_observer, velocity_tracking
""",
    ),
    "unknown keys": (
        "substitute one { bedd = emulated; law = bare(band = 1 rad/s); }",
        """\
error[D141]: `substitute one` has no `bedd`
 --> deck.ic:1:41
  |
1 | run it like base_run { substitute one { bedd = emulated; law = bare(band = 1 rad/s); } }
  |                                         ^^^^
  = help: did you mean `bed`?
  = help: it has: bed, law, scale

error[D141]: law `bare` of joint `one` has no `band`
 --> deck.ic:1:69
  |
1 | run it like base_run { substitute one { bedd = emulated; law = bare(band = 1 rad/s); } }
  |                                                                     ^^^^
  = help: it has: none
""",
    ),
    "an unknown parameter a wrong unit and a number out of range": (
        "substitute one { bed = emulated(ktt = 3, kt = 1 N*m, i_max = -3 A); }",
        """\
error[D141]: bed `emulated` of joint `one` has no `ktt`
 --> deck.ic:1:56
  |
1 | run it like base_run { substitute one { bed = emulated(ktt = 3, kt = 1 N*m, i_max = -3 A); } }
  |                                                        ^^^
  = help: did you mean `kt`?
  = help: it has: kt, resistance, tau_max, f_c, f_v, inertia, kt_load, i_max, f_cut, delay, faults, unevenness, lobes, once, twice, tachometer, converter_in, converter_voltage, converter_current

error[D061]: `kt` of bed `emulated` of joint `one` is in N*m/A, and this is in N*m
 --> deck.ic:1:70
  |
1 | run it like base_run { substitute one { bed = emulated(ktt = 3, kt = 1 N*m, i_max = -3 A); } }
  |                                                                      ^^^^^
  = help: write it in N*m/A

error[D077]: `i_max` of bed `emulated` of joint `one` must be above 0 A
 --> deck.ic:1:85
  |
1 | run it like base_run { substitute one { bed = emulated(ktt = 3, kt = 1 N*m, i_max = -3 A); } }
  |                                                                                     ^^^^ this is -3 A
  = help: write a number above 0 A (largest current of the load motor's amplifier)
""",
    ),
    "a word of faults that there is not": (
        "substitute one { bed = emulated(faults = typicl); }",
        """\
error[D076]: `faults` of bed `emulated` of joint `one` cannot be `typicl`
 --> deck.ic:1:65
  |
1 | run it like base_run { substitute one { bed = emulated(faults = typicl); } }
  |                                                                 ^^^^^^
  = help: did you mean `typical`?
  = help: one of: none, typical
""",
    ),
    "a value without a name": (
        "substitute one { law = torque_balance(0.5); }",
        """\
error[D153]: `torque_balance` takes its values by name
 --> deck.ic:1:62
  |
1 | run it like base_run { substitute one { law = torque_balance(0.5); } }
  |                                                              ^^^
  = help: write `torque_balance(band = ...)`
""",
    ),
}

"""What a run substitutes, and what is said of it."""


@pytest.mark.parametrize(("more", "message"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_this_message(tmp_path: Path, more: str, message: str) -> None:
    assert shown(tmp_path, more) == message


def test_nothing_is_said_of_the_channels_of_a_joint_that_is_not_there(tmp_path: Path) -> None:
    more = "substitute onne {}  record = [bed.shaft_rate, onne.law.rate];  metric m = max { of = onne.bed.shaft_rate; }"
    deck = f"run it like base_run {{ {more} }}"
    assert [diagnostic.code for diagnostic in check(tmp_path, DECK, deck, select=["it"]).diagnostics] == ["D144"]


def test_one_joint_and_a_block(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, "substitute one two {}")
        == """\
error[D179]: `substitute` takes the name of one joint, and a block
 --> deck.ic:1:39
  |
1 | run it like base_run { substitute one two {} }
  |                                       ^^^
  = help: write `substitute JOINT { bed = BED(...);  law = LAW(...); }`
"""
    )
    assert "D179" in shown(tmp_path, "substitute one = emulated;")


def test_no_joint_and_no_block(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, "substitute { bed = emulated; }")
        == """\
error[D109]: nothing named `substitute` in run `it` to change
 --> deck.ic:1:24
  |
1 | run it like base_run { substitute { bed = emulated; } }
  |                        ^^^^^^^^^^
  = help: `substitute JOINT { ... }`, in a run, puts a joint's motor on a bed
"""
    )
    assert (
        shown(tmp_path, "substitute one;")
        == """\
error[D110]: `substitute` in a run
 --> deck.ic:1:24
  |
1 | run it like base_run { substitute one; }
  |                        ^^^^^^^^^^
  = help: `substitute JOINT { ... }`, in a run, puts a joint's motor on a bed
"""
    )


def test_a_drive_with_a_rate_loop_and_a_command_without_a_rate(tmp_path: Path) -> None:
    said = shown(tmp_path, "servos { one { command = torque(2 N*m); } } substitute one { bed = rate_drive(); }")
    assert (
        said
        == """\
error[D368]: `rate_drive` tells the drive of joint `one` a rate, and the joint's command is a torque
 --> deck.ic:1:91
  |
1 | run it like base_run { servos { one { command = torque(2 N*m); } } substitute one { bed = rate_drive(); } }
  |                                                                                           ^^^^^^^^^^
 ::: deck.ic:24:14  its servo
  = help: command it by a rate or a position
  = help: or another bed: `emulated` sends a voltage, `torque_drive` sends a torque
"""
    )


def test_a_drive_with_a_rate_loop_and_a_servo_without_one(tmp_path: Path) -> None:
    own = rigid_gearbox.SERVO.rate_loop
    object.__setattr__(rigid_gearbox.SERVO, "rate_loop", None)
    try:
        said = shown(tmp_path, "substitute one { bed = rate_drive(); }")
    finally:
        object.__setattr__(rigid_gearbox.SERVO, "rate_loop", own)
    assert (
        said
        == """\
error[D368]: `rate_drive` tells the drive of joint `one` a rate, and servo `drive` (rigid_gearbox) has no rate loop \
that could be the drive's
 --> deck.ic:1:47
  |
1 | run it like base_run { substitute one { bed = rate_drive(); } }
  |                                               ^^^^^^^^^^
 ::: deck.ic:24:14  its servo
  = help: servo models that have one: none
  = help: or another bed: `emulated` sends a voltage, `torque_drive` sends a torque
"""
    )


def test_a_number_that_must_be_whole(tmp_path: Path, whole_delay: None) -> None:
    assert (
        shown(tmp_path, "substitute one { bed = emulated(delay = 1.5); }")
        == """\
error[D077]: `delay` of bed `emulated` of joint `one` must be whole and at least 0 and at most 3
 --> deck.ic:1:64
  |
1 | run it like base_run { substitute one { bed = emulated(delay = 1.5); } }
  |                                                                ^^^ this is 1.5
  = help: write a whole number of at least 0 and at most 3 (ticks)
"""
    )


@pytest.fixture
def whole_delay(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A bed whose delay is declared to be whole."""
    bed = BEDS[0]
    parameters = tuple(replace(p, whole=True, doc="ticks") if p.name == "delay" else p for p in bed.parameters)
    monkeypatch.setattr(met.substitution, "BEDS", (replace(bed, parameters=parameters),))
    yield


def test_a_servo_that_failed_is_told_of_alone(tmp_path: Path) -> None:
    for more, code in (
        ("substitute one {}  servos { one { kt = 3; } }", "D060"),
        ("substitute one {}  servos { one = drve; }  record = [bed.shaft_rate];", "D041"),
    ):
        made = check(tmp_path, DECK, f"run it like base_run {{ {more} }}", select=["it"])
        assert [diagnostic.code for diagnostic in made.diagnostics] == [code]


def test_what_a_servo_cannot_be_in_a_sweep_is_told_once(tmp_path: Path) -> None:
    more = HYBRID + "sweep s of hybrid { vary one.servo.resistance = [-1, 1] ohm; }"
    assert [d.message for d in check(tmp_path, DECK, more, select=["s"]).diagnostics] == [
        "`resistance` of servo `drive` must be above 0 ohm; case #0 breaks it"
    ]


def test_what_cannot_vary(tmp_path: Path) -> None:
    more = """\
run a like base_run { substitute one {} }
sweep s of a {
    vary one.bed.faults = [1, 2];
    vary one.law.model = [1, 2];
    vary one.bed.ktt = [1, 2];
}
"""
    assert (
        said(tmp_path, more)
        == """\
error[D122]: `one.bed.faults` cannot vary
 --> deck.ic:3:10
  |
3 |     vary one.bed.faults = [1, 2];
  |          ^^^^^^^^^^^^^^
  = help: it is a word: vary it over words

error[D122]: `one.law.model` cannot vary
 --> deck.ic:4:10
  |
4 |     vary one.law.model = [1, 2];
  |          ^^^^^^^^^^^^^
  = help: it decides the program: vary `one.law` over models

error[D128]: no parameter `one.bed.ktt` in this run
 --> deck.ic:5:10
  |
5 |     vary one.bed.ktt = [1, 2];
  |          ^^^^^^^^^^^
  = help: did you mean `one.bed.kt`?
"""
    )


def test_twice_in_a_run_and_its_base(tmp_path: Path) -> None:
    assert (
        said(tmp_path, "run a like base_run { substitute one {} } run b like a { substitute one {} }")
        == """\
error[D053]: substitute `one` is in run `a` already
 --> deck.ic:1:58
  |
1 | run a like base_run { substitute one {} } run b like a { substitute one {} }
  |                                                          ^^^^^^^^^^^^^^
 ::: deck.ic:1:23  here
  = help: leave out the word `substitute` to change it
  = help: `remove one;` first, to put another in its place
"""
    )


BELONGS = "  = help: `substitute JOINT { ... }`, in a run, puts a joint's motor on a bed\n"


@pytest.mark.parametrize(
    ("more", "first", "last"),
    [
        (
            "substitute one {}",
            "error[D045]: no kind of definition `substitute`",
            "kinds: arm, servo, run, sweep, search, tune",
        ),
        (
            "arm b like chain { substitute one {} }",
            "error[D082]: no `substitute` in an arm",
            "an arm holds links and joints",
        ),
        (
            "servo c like drive { substitute one {} }",
            "error[D141]: no `substitute` in servo `c`",
            "it has: ratio, kp, ki, v_max, k_position, resistance, kt, tau_max, j_m, f_c, f_v, friction, f_s, rate_s, sigma_0, sigma_1, model, command, rate",
        ),
        (
            "sweep s of base_run { substitute one {} }",
            "error[D136]: no `substitute one` in a sweep",
            "a sweep has: vary, zip, from, sample, repeat, exclude when, allow, seed, seeds",
        ),
    ],
)
def test_outside_of_a_run(more: str, first: str, last: str, tmp_path: Path) -> None:
    at = more.index("substitute")
    marked = "^" * len("substitute" if at == 0 else "substitute one")
    assert said(tmp_path, more) == (
        f"{first}\n --> deck.ic:1:{at + 1}\n  |\n1 | {more}\n  | {' ' * at}{marked}\n{BELONGS}  = help: {last}\n"
    )
