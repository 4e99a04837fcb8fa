"""`substitute`: what it makes of a run and where its numbers come from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from ic.driver.explain import explanations_of
from met.plan import Experiment, Formula, Substitution
from met.plan.channel import channels
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
