"""`substitute`: what it makes of a run, where its numbers come from, and whole messages of what is wrong with it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

import met.substitution
from ic.driver.explain import explanations_of
from met.plan import Experiment, Formula, Substitution
from met.plan.channel import channels
from met.servos import rigid_gearbox
from met.substitution import BEDS
from tests.ic.small_decks import changed, check, experiment, messages

ARM = """\
arm chain {
    link a { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link b { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link c { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link d { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link e { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    joint one   revolute  { parent = base;  child = a;  axis = z; }
    joint two   prismatic { parent = a;  child = b;  axis = z; }
    joint three revolute  { parent = b;  child = c;  axis = z; }
    joint free  revolute  { parent = c;  child = d;  axis = z; }
    joint mount fixed     { parent = d;  child = e; }
}
"""
SERVOS = """\
servo drive {
    model = rigid_gearbox;
    ratio = 100; kp = 0.1 V*s/rad; ki = 1 V/rad; v_max = 24 V; resistance = 1 ohm; kt = 0.05 N*m/A;
    tau_max = 1 N*m; j_m = 1e-4 kg*m^2;
    command = rate(0.1 rad/s);
}
servo screw  like drive { ratio = 0.1 cycle/mm; command = rate(0.1 m/s); }
servo follow { model = ideal; bandwidth = 30 s^-1; command = rate(0.1 rad/s); }
"""
RUN = """\
run base_run {
    arm = chain;
    servos { one = drive; two = screw; three = follow; }
    rates { dynamics = 500 Hz; servos = 1 kHz; record = 100 Hz; }
    duration = 1 s;
    record = [q];
}
"""
HYBRID = """\
run hybrid like base_run {
    substitute one {
        bed = emulated(faults = typical, kt = 0.065 N*m/A, twice = 0 N*m);
        law = torque_balance(band = 0.4 rad/s);
    }
}
"""
DECK = ARM + SERVOS + RUN


def compiled(folder: Path, more: str, select: str = "hybrid") -> Experiment:
    return experiment(folder, DECK, more, select=[select])


def shown(folder: Path, more: str) -> str:
    """What is said of a run with these lines besides, without the counting line; line 1 is theirs."""
    run = f"run it like base_run {{ {more} }}\n"
    return messages(check(folder, run, DECK, select=["it"])).rpartition("\n\n")[0] + "\n"


def said(folder: Path, more: str) -> str:
    """What is said of definitions besides, without the counting line; line 1 is theirs."""
    return messages(check(folder, more + "\n", DECK, select="all")).rpartition("\n\n")[0] + "\n"


# What it makes


def test_bed_and_law_of_a_joint_and_the_place_that_wrote_them(tmp_path: Path) -> None:
    hybrid = compiled(tmp_path, HYBRID)
    (use,) = hybrid.structure.substitutions
    assert (use.joint, use.bed, use.law) == ("one", "emulated", "torque_balance")
    assert use.place is not None and use.place.line == len(DECK.splitlines()) + 2
    assert hybrid.parameters["one.law.band"].value == 0.4
    assert {path for path in hybrid.parameters if path.startswith("one.law.")} == {"one.law.band"}
    declared = {f"one.bed.{parameter.name}" for parameter in BEDS[0].parameters} - {"one.bed.faults"}
    assert {path for path in hybrid.parameters if path.startswith("one.bed.")} == declared


@pytest.mark.slow
def test_bed_and_law_that_are_left_out_are_the_defaults(tmp_path: Path) -> None:
    for block in (
        "{}",
        "{ bed = emulated; law = velocity_tracking; }",
        "{ bed { i_max = 3 A; } law { gain = 30 %; } }",
    ):
        hybrid = compiled(tmp_path, f"run hybrid like base_run {{ substitute one {block} }}")
        (use,) = hybrid.structure.substitutions
        assert replace(use, place=None) == Substitution("one", "emulated", "velocity_tracking")
        assert (hybrid.parameters["one.bed.i_max"].value, hybrid.parameters["one.law.gain"].value) == (3.0, 0.3)


@pytest.mark.slow
def test_joints_stand_in_the_arms_order(tmp_path: Path) -> None:
    hybrid = compiled(tmp_path, "run hybrid like base_run { substitute two {} substitute one {} }")
    assert [use.joint for use in hybrid.structure.substitutions] == ["one", "two"]


def test_a_parameter_of_the_motor_that_is_not_written_is_the_servos_origin_and_all(tmp_path: Path) -> None:
    own = changed(RUN, ("one = drive;", "one = drive { f_c = 0.02 N*m; }"))
    hybrid = experiment(tmp_path, ARM, SERVOS, own, HYBRID, select=["hybrid"])
    for name, of in (("f_c", "f_c"), ("resistance", "resistance"), ("inertia", "j_m"), ("f_v", "f_v")):
        mine, servos = hybrid.parameters[f"one.bed.{name}"], hybrid.parameters[f"one.servo.{of}"]
        assert mine == replace(servos, origin=replace(servos.origin, note=f"that of `one.servo.{of}`"))
    assert hybrid.parameters["one.bed.f_c"].value == 0.02
    assert hybrid.parameters["one.bed.kt"].value == 0.065 and hybrid.parameters["one.servo.kt"].value == 0.05


@pytest.mark.slow
def test_the_word_of_the_faults_sizes_those_that_are_not_written(tmp_path: Path) -> None:
    preset = BEDS[0].presets["typical"]
    hybrid = compiled(tmp_path, HYBRID)
    place = next(line for line in HYBRID.splitlines() if "typical" in line).index("typical") + 1
    for name, value in preset.items():
        found = hybrid.parameters[f"one.bed.{name}"]
        assert found.value == (0.0 if name == "twice" else value)
        if name != "twice":
            assert found.origin.kind == "deck" and found.origin.note == "by `faults`"
            assert found.origin.place is not None and found.origin.place.column == place
    none = compiled(tmp_path, HYBRID.replace("typical", "none"))
    assert {none.parameters[f"one.bed.{name}"].value for name in preset} == {0.0}


def test_an_expression_may_name_what_a_servo_writes(tmp_path: Path) -> None:
    hybrid = compiled(tmp_path, HYBRID.replace("0.065 N*m/A", "drive.kt * 1.07"))
    assert hybrid.parameters["one.bed.kt"].value == pytest.approx(0.0535, rel=1e-15)  # two roundings


@pytest.mark.slow
def test_a_run_that_is_like_another_changes_its_block_by_joint_and_key(tmp_path: Path) -> None:
    like = "run again like hybrid { one { bed { kt = 0.06 N*m/A; } law = torque_balance; } substitute two { law = torque_balance; } }"
    again = compiled(tmp_path, HYBRID + like, "again")
    assert [use.joint for use in again.structure.substitutions] == ["one", "two"]
    kt = again.parameters["one.bed.kt"]
    assert kt.value == 0.06 and [place.line for place in kt.origin.overrides] == [len(DECK.splitlines()) + 3]
    assert again.parameters["one.bed.tachometer"].value == BEDS[0].presets["typical"]["tachometer"]
    assert again.parameters["one.law.band"].value == 0.5  # `law = ...` replaces it whole
    removed = compiled(tmp_path, HYBRID + "run again like hybrid { remove one; }", "again")
    assert removed.structure.substitutions == () and "one.bed.kt" not in removed.parameters


@pytest.mark.slow
def test_channels_of_a_joint_on_a_bed_tick_with_its_servo(tmp_path: Path) -> None:
    more = changed(HYBRID, ("torque_balance(", "velocity_tracking("))
    hybrid = compiled(tmp_path, more.replace("    }\n}", "    }\n    record = [one.bed.shaft_rate, law.rate]; }"))
    assert [recorded.channels for recorded in hybrid.structure.record] == [("one.bed.shaft_rate",), ("one.law.rate",)]
    found = {
        path: channel for path, channel in channels(hybrid.structure).items() if ".bed." in path or ".law." in path
    }
    assert {path: channel.unit for path, channel in found.items()} == {
        **{f"one.bed.{memory.name}": memory.unit for memory in BEDS[0].memory},
        "one.bed.drive_voltage": "V",
        "one.bed.load_current": "A",
        "one.law.torque": "N*m",
        "one.law.rate": "rad/s",
        "one.law.unknown_torque": "N*m",
        "one.law.reference_rate": "rad/s",
    }
    assert {channel.divisor for channel in found.values()} == {hybrid.structure.servos[0].divisor} == {1}
    bare = channels(compiled(tmp_path, HYBRID).structure)
    assert "one.law.rate" in bare and "one.law.unknown_torque" not in bare
    measured = compiled(tmp_path, "run hybrid like base_run { substitute one { law = measured_acceleration; } }")
    assert channels(measured.structure)["one.law.acceleration"].unit == "rad/s^2"


@pytest.mark.slow
def test_the_step_need_not_be_short_for_a_motor_that_is_on_a_bed(tmp_path: Path) -> None:
    fast = ("kt = 0.05 N*m/A", "kt = 1 N*m/A")  # and too slow for its command, at any voltage that it has
    alone = check(tmp_path, ARM, changed(SERVOS, fast), RUN)
    assert [diagnostic.code for diagnostic in alone.diagnostics] == ["D104"]  # once of the one rate
    both = changed(HYBRID, ("    substitute", "    substitute two { law = torque_balance; }\n    substitute"))
    told = check(tmp_path, ARM, changed(SERVOS, fast), RUN, both, select=["hybrid"]).diagnostics
    assert [diagnostic.code for diagnostic in told] == ["D297", "D321"]  # the law on the bed, and not the step


# Sweeps


def replayed(swept: Experiment, path: str) -> list[float]:
    value = swept.parameters[path].value
    assert isinstance(value, Formula), path
    columns = {coordinate.path: coordinate.values for coordinate in swept.cases.coordinates}
    return [float(x) for x in swept.formulas.replay(columns)[value.output]]


@pytest.mark.slow
def test_what_a_sweep_varies_of_a_servo_its_bed_follows_unless_it_has_its_own(tmp_path: Path) -> None:
    more = HYBRID + "sweep s of hybrid { vary drive.resistance = [1, 2] ohm; vary drive.kt = [0.04, 0.05] N*m/A; }"
    swept = compiled(tmp_path, more, "s")
    assert replayed(swept, "one.bed.resistance") == replayed(swept, "one.servo.resistance") == [1.0, 1.0, 2.0, 2.0]
    assert swept.parameters["one.bed.kt"].value == 0.065
    resistance, kt = swept.cases.coordinates
    assert resistance.sets == ("one.servo.resistance", "two.servo.resistance", "one.bed.resistance")
    assert kt.sets == ("one.servo.kt", "two.servo.kt")


@pytest.mark.slow
def test_a_sweep_varies_the_motor_on_the_bed_alone(tmp_path: Path) -> None:
    more = (
        HYBRID
        + """\
sweep s of hybrid {
    vary one.bed.kt      = [0.04, 0.05] N*m/A;
    vary one.bed.inertia = [1, 2] kg*mm^2;
    vary one.bed.once    = [0, 1] mN*m;
    vary one.law.band    = [0.1, 0.2] rad/s;
    exclude when one.bed.kt < one.servo.kt and one.law.band > 0.15 rad/s;
}
"""
    )
    swept = compiled(tmp_path, more, "s")
    assert swept.cases.count == 16 - 4
    assert swept.parameters["one.servo.kt"].value == 0.05 and swept.parameters["one.servo.j_m"].value == 1e-4
    assert [coordinate.sets for coordinate in swept.cases.coordinates] == [
        ("one.bed.kt",),
        ("one.bed.inertia",),
        ("one.bed.once",),
        ("one.law.band",),
    ]
    assert swept.parameters["one.bed.inertia"].origin.kind == "case"
    assert swept.parameters["one.bed.inertia"].origin.note == ""


def test_explain_tells_what_was_written_and_what_is_the_servos(tmp_path: Path) -> None:
    made = check(tmp_path, DECK, HYBRID, select=["hybrid"])
    (kt,), (resistance,), (once,) = (
        list(explanations_of(made, f"one.bed.{name}")) for name in ("kt", "resistance", "once")
    )
    assert (kt.value, kt.written, kt.origin, kt.note) == (0.065, "0.065 N*m/A", "deck", "")
    assert (resistance.written, resistance.note) == ("1 ohm", "that of `one.servo.resistance`")
    assert (once.written, once.note, once.doc) == (
        "typical",
        "by `faults`",
        "amplitude of the misalignment torque with one period per turn",
    )


# What is wrong with one


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
