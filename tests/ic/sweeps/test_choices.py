"""Sweeps over structure: servos, integrators, rates, laws, words, macros; one experiment for each structure."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met.plan import Experiment, keys
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, messages

OTHERS = """\
servo brisk like drive { kp = 0.3 V*s/rad; }
servo plain { model = ideal; bandwidth = 5 1/s; command = rate(0.1 rad/s); }
"""


def groups(folder: Path, body: str, *more: str, run: str = RUN) -> tuple[Experiment, ...]:
    parts = (ARM, SERVO, OTHERS, run, *more, f"sweep it of hold {{ {body} }}\n")
    compiled = check(folder, *parts, select=["it"])
    assert compiled.plan is not None, messages(compiled)
    return compiled.plan.experiments


def told_of(folder: Path, body: str, *more: str, run: str = RUN) -> str:
    return messages(check(folder, ARM, SERVO, OTHERS, run, *more, f"sweep it of hold {{ {body} }}\n", select=["it"]))


def choices(found: tuple[Experiment, ...]) -> list[dict[str, str]]:
    return [{choice.path: choice.value for choice in each.cases.choices} for each in found]


def test_an_integrator_may_vary(tmp_path: Path) -> None:
    found = groups(tmp_path, "vary integrator = [rk4, midpoint]; vary drive.kp = [1, 2, 3] V*s/rad;")
    assert [(each.name, each.sweep, each.name_in_deck) for each in found] == [
        ("it.rk4", "it", "it"),
        ("it.midpoint", "it", "it"),
    ]
    assert [each.structure.integrator for each in found] == ["rk4", "midpoint"]
    assert [each.cases.count for each in found] == [3, 3]
    assert [each.cases.table.tolist() for each in found] == [[0, 1, 2], [3, 4, 5]]


def test_the_product_keeps_its_order_whatever_is_chosen_where(tmp_path: Path) -> None:
    found = groups(tmp_path, "vary drive.kp = [1, 2, 3] V*s/rad; vary integrator = [rk4, midpoint];")
    assert [each.cases.table.tolist() for each in found] == [[0, 2, 4], [1, 3, 5]]


def test_one_joints_servo_may_vary(tmp_path: Path) -> None:
    found = groups(tmp_path, "vary hinge.servo = [drive, plain];")
    assert [each.structure.servos[0].model for each in found] == ["rigid_gearbox", "ideal"]
    assert choices(found) == [{"hinge.servo": "drive"}, {"hinge.servo": "plain"}]


def test_choices_of_one_model_with_other_numbers_are_apart(tmp_path: Path) -> None:
    servos = "[drive, drive { kp = 0.2 V*s/rad; }, drive { remove ki;  ki = 2 V/rad; }]"
    found = groups(tmp_path, f"vary hinge.servo = {servos};")
    assert [each.name for each in found] == ["it.drive-1", "it.drive-2", "it.drive-3"]
    assert [each["hinge.servo"] for each in choices(found)] == [
        "drive",
        "drive { kp = 0.2 V*s/rad; }",
        "drive { remove ki; ki = 2 V/rad; }",
    ]


def test_rates_and_the_duration_may_vary(tmp_path: Path) -> None:
    body = "vary rates.dynamics = [1, 2] kHz; vary duration = (1 .. 3 by 1) s;"
    found = groups(tmp_path, body)
    steps = [
        (each.structure.schedule.base_hz / each.structure.schedule.dynamics, each.structure.schedule.duration)
        for each in found
    ]
    assert steps == [(1000.0, 1.0), (1000.0, 2.0), (1000.0, 3.0), (2000.0, 1.0), (2000.0, 2.0), (2000.0, 3.0)]
    assert choices(found)[1] == {"rates.dynamics": "1 kHz", "duration": "2 s"}
    assert found[1].name == "it.1_kHz-2_s"


def test_a_definitions_rate_reaches_all_its_uses(tmp_path: Path) -> None:
    found = groups(tmp_path, "vary drive.rate = [250, 500] Hz;")
    assert [each.structure.servos[0].divisor for each in found] == [4, 2]


def test_a_definitions_command_may_vary(tmp_path: Path) -> None:
    found = groups(
        tmp_path, "vary drive.command = [rate(0.1 rad/s), rate(sine(amplitude = 1 rad/s, frequency = 1 Hz))];"
    )
    assert [each.structure.servos[0].command.model for each in found if each.structure.servos[0].command] == [
        "constant",
        "sine",
    ]
    body = "vary hinge.servo.command = [rate(0.1 rad/s), rate(sine(amplitude = 1 rad/s, frequency = 1 Hz))];"
    assert [each.structure.servos for each in groups(tmp_path, body)] == [each.structure.servos for each in found]


def test_words_of_a_model_may_vary(tmp_path: Path) -> None:
    pushed = changed(
        RUN, ("duration", "environment { push = wrench { link = bar; force = [0, 1, 0] N; } }\n    duration")
    )
    found = groups(tmp_path, "vary environment.push.axes = [world, link];", run=pushed)
    assert [each.parameters["environment.push.axes"].value for each in found] == ["world", "link"]
    found = groups(tmp_path, "vary environment.velocity_products = [on, off]; vary drive.kp = [1, 2] V*s/rad;")
    assert [each.structure.velocity_products for each in found] == [True, False]


@pytest.mark.slow
def test_a_bed_and_its_law_may_vary(tmp_path: Path) -> None:
    on_bed = changed(
        RUN, ("duration", "substitute hinge { bed = emulated(faults = typical); law = torque_balance; }\n    duration")
    )
    found = groups(tmp_path, "vary hinge.law = [torque_balance, velocity_tracking];", run=on_bed)
    assert [each.structure.substitutions[0].law for each in found] == ["torque_balance", "velocity_tracking"]
    found = groups(tmp_path, "vary hinge.bed.faults = [typical, none];", run=on_bed)
    assert len({each.parameters["hinge.bed.tachometer"].value for each in found}) == 2


def test_a_run_with_a_choice_is_the_run_that_one_would_write(tmp_path: Path) -> None:
    found = groups(tmp_path, "zip { hinge.servo = [drive, brisk]; integrator = [rk4, midpoint]; }")
    by_hand = "run other like hold { integrator = midpoint; servos { hinge = brisk; } }"
    compiled = check(tmp_path, ARM, SERVO, OTHERS, RUN, by_hand, select=["other"])
    assert compiled.plan is not None
    other = compiled.plan.experiments[0]
    assert keys.structure_key(found[1].structure) == keys.structure_key(other.structure)
    assert {path: q.value for path, q in found[1].parameters.items()} == {
        p: q.value for p, q in other.parameters.items()
    }


def test_choices_may_be_excluded(tmp_path: Path) -> None:
    body = (
        "vary integrator = [rk4, midpoint]; vary rates.dynamics = [1, 2] kHz; vary drive.kp = [1, 2] V*s/rad;"
        "exclude when integrator == rk4 and drive.kp > 1.5 V*s/rad;"
        "exclude when midpoint == integrator and rates.dynamics > 1.5 kHz;"
    )
    found = groups(tmp_path, body)
    assert choices(found) == [
        {"integrator": "rk4", "rates.dynamics": "1 kHz"},
        {"integrator": "rk4", "rates.dynamics": "2 kHz"},
        {"integrator": "midpoint", "rates.dynamics": "1 kHz"},
    ]
    assert [each.cases.table.tolist() for each in found] == [[0], [1], [2, 3]]


def test_cases_of_unlike_structure_have_unlike_names(tmp_path: Path) -> None:
    found = groups(tmp_path, "vary integrator = [rk4, midpoint]; vary drive.kp = [1, 2] V*s/rad;")
    assert len({key for each in found for key in keys.case_keys(each)}) == 4
    assert len({name for each in found for name in keys.case_ids(each)}) == 4


def test_a_coordinate_that_some_structure_does_not_have_is_told_with_the_choice(tmp_path: Path) -> None:
    body = "vary hinge.servo = [drive, plain]; vary drive.kp = [1, 2] V*s/rad;"
    assert (
        told_of(tmp_path, body)
        == """\
error[D137]: `drive.kp` changes nothing in this run
  --> deck.ic:20:60
   |
20 | sweep it of hold { vary hinge.servo = [drive, plain]; vary drive.kp = [1, 2] V*s/rad; }
   |                                                            ^^^^^^^^
  ::: deck.ic:7:18  written here
  ::: deck.ic:20:47  where `hinge.servo` is `plain`
   = help: every use overrides it, or the run does not use it; vary it where it is overridden

1 error
"""
    )


def test_a_choice_that_is_none_is_told(tmp_path: Path) -> None:
    same = "servo twin like drive { kp = 0.1 V*s/rad; }\n"
    assert "error[D137]: `hinge.servo` changes nothing in this run" in told_of(
        tmp_path, "vary hinge.servo = [drive, twin];", same
    )


def test_what_is_wrong_with_a_choice_is_placed_at_it(tmp_path: Path) -> None:
    assert (
        told_of(tmp_path, "vary integrator = [rk4, rk5];")
        == """\
error[D140]: no integrator model `rk5`
  --> deck.ic:20:44
   |
20 | sweep it of hold { vary integrator = [rk4, rk5]; }
   |                                            ^^^
   = help: did you mean `rk4`?
   = help: integrator models: midpoint, modified_euler, rk4, semi_implicit_euler

1 error
"""
    )


@pytest.mark.parametrize(("body", "code"), [
    ("vary hinge.servo = [drive, drove];", "D041"),
    ("vary swing.servo = [drive, plain];", "D144"),
    ("vary arm = [swing, swinger];", "D041"),
    ("vary rates.dynamics = [1, 2];", "D060"),
    ("vary rates.dynamic = [1, 2] Hz;", "D116"),
    ("vary hinge.servo = [drive, brisk]; vary hinge.servo.command = [rate(1 rad/s), rate(2 rad/s)];", "D123"),
    ("vary drive.command.kind = [a, b];", "D122"),
    ("exclude when integrator > rk4; vary integrator = [rk4, midpoint];", "D130"),
    ("vary environment.velocity_products = [on, of];", "D076"),
    ("vary rates.dynamics = linspace(1, 300, 300) Hz;", "D229"),
])  # fmt: skip
def test_choices_that_cannot_be(tmp_path: Path, body: str, code: str) -> None:
    assert codes(tmp_path, ARM, SERVO, OTHERS, RUN, f"sweep it of hold {{ {body} }}", select=["it"]) == [code]


# Macros

LOADED = """\
#ifndef PAYLOAD
#define PAYLOAD 5
#endif
""" + changed(ARM, ("mass = 2 kg", "mass = (2 + PAYLOAD) * 1 kg"))


def loaded(folder: Path, body: str, defines: tuple[str, ...] = ()) -> tuple[Experiment, ...]:
    compiled = check(
        folder, LOADED, SERVO, OTHERS, RUN, f"sweep it of hold {{ {body} }}\n", select=["it"], defines=defines
    )
    assert compiled.plan is not None, messages(compiled)
    return compiled.plan.experiments


@pytest.mark.parametrize("defines", [(), ("PAYLOAD=7",)])
def test_a_macro_may_vary(tmp_path: Path, defines: tuple[str, ...]) -> None:
    found = loaded(tmp_path, "vary macro PAYLOAD = [0, 5, 10]; vary drive.kp = [1, 2] V*s/rad;", defines)
    assert [each.parameters["links.bar.mass"].value for each in found] == [2.0, 7.0, 12.0]
    assert choices(found) == [{"macro PAYLOAD": text} for text in ("0", "5", "10")]
    assert [each.name for each in found] == ["it.0", "it.5", "it.10"]
    assert [each.cases.table.tolist() for each in found] == [[0, 1], [2, 3], [4, 5]]


def test_a_macro_that_turns_blocks_on_may_vary(tmp_path: Path) -> None:
    arm = changed(
        ARM,
        (
            "    joint hinge",
            "#if HEAVY\n    link ball { mass = 1 kg; shape = sphere(radius = 1 cm); }\n"
            "    joint weld fixed { parent = bar; child = ball; at = [1, 0, 0] m; }\n#endif\n    joint hinge",
        ),
    )
    compiled = check(
        tmp_path,
        "#ifndef HEAVY\n#define HEAVY 0\n#endif\n",
        arm,
        SERVO,
        RUN,
        "sweep it of hold { zip { macro HEAVY = [0, 1]; drive.kp = [1, 2] V*s/rad; } }",
        select=["it"],
    )
    assert compiled.plan is not None, messages(compiled)
    assert [len(each.structure.links) for each in compiled.plan.experiments] == [1, 2]
    assert [each.cases.coordinates[0].values.tolist() for each in compiled.plan.experiments] == [[1.0], [2.0]]


def test_a_macro_that_changes_nothing_is_told(tmp_path: Path) -> None:
    text = messages(
        check(tmp_path, LOADED, SERVO, RUN, "sweep it of hold { vary macro PAYLAOD = [0, 1]; }", select=["it"])
    )
    assert (
        text
        == """\
error[D137]: `macro PAYLAOD` changes nothing in this run
  --> deck.ic:21:31
   |
21 | sweep it of hold { vary macro PAYLAOD = [0, 1]; }
   |                               ^^^^^^^
   = help: the run is the same with each of its values: does an `#if` ask for `PAYLAOD`?

1 error
"""
    )


def test_a_mistake_with_a_macros_value_is_told_with_it(tmp_path: Path) -> None:
    text = messages(
        check(tmp_path, LOADED, SERVO, RUN, "sweep it of hold { vary macro PAYLOAD = [0, -3]; }", select=["it"])
    )
    assert "where `macro PAYLOAD` is `-3`" in text
    assert "`mass` of link `bar` must be" in text


def test_a_macro_that_the_deck_defines_for_good_cannot_vary(tmp_path: Path) -> None:
    deck = changed(LOADED, ("#ifndef PAYLOAD\n", ""), ("#endif\n", ""))
    found = codes(tmp_path, deck, SERVO, RUN, "sweep it of hold { vary macro PAYLOAD = [0, 1]; }", select=["it"])
    assert found == ["D010"]


def test_what_a_macros_value_makes_is_what_the_command_line_makes(tmp_path: Path) -> None:
    (found,) = (each for each in loaded(tmp_path, "vary macro PAYLOAD = [0, 3];") if each.name == "it.3")
    compiled = check(tmp_path, LOADED, SERVO, RUN, select=["hold"], defines=("PAYLOAD=3",))
    assert compiled.plan is not None
    by_hand = compiled.plan.experiments[0]
    assert {path: q.value for path, q in found.parameters.items()} == {
        p: q.value for p, q in by_hand.parameters.items()
    }
    assert keys.structure_key(found.structure) == keys.structure_key(by_hand.structure)


@pytest.mark.slow
def test_a_table_of_a_million_cases_of_two_structures_is_parted_at_once(tmp_path: Path) -> None:
    gains = "vary drive.kp = linspace(1, 2, 1000) V*s/rad;", "vary drive.ki = linspace(1, 2, 1000) V/rad;"
    body = f"{gains[0]} vary integrator = [rk4, midpoint]; {gains[1]}"
    first, second = groups(tmp_path, body)
    assert (first.cases.count, second.cases.count) == (1_000_000, 1_000_000)
    assert np.all(np.diff(first.cases.table) > 0)
    assert first.cases.table[1000] == 2000
