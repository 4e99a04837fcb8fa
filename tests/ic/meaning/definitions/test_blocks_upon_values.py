"""Blocks written upon what an entry has: refused upon a number or a word, taken upon a name with entries of its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, experiment, messages

BASES = (
    ARM,
    changed(SERVO, ("ratio = 100;", "ratio = 100; rate = continuous; friction = coulomb;")),
    changed(RUN, ("servos = 1 kHz", "servos = continuous")).replace(
        "record = [q];",
        "record = [q]; initial { servos = balanced; } environment { velocity_products = on; }"
        " payload box { on = bar; mass = heavy; shape = sphere(radius = 0.1 m); }",
    ),
    "let heavy = 1 kg;\n",
)


def upon(deck: str) -> tuple[str, ...]:
    return (*BASES, deck)


ARM_LIKE = "arm other like swing {{ {} }} run it like hold {{ arm = other; }}\n"
SERVO_LIKE = "servo other like drive {{ {} }} run it like hold {{ servos {{ hinge = other; }} }}\n"
RUN_LIKE = "run it like hold {{ {} }}\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("definition", "body", "name"),
    [
        (ARM_LIKE, "hinge { axis { x = 1; } }", "axis"),
        (ARM_LIKE, "hinge { axis { } }", "axis"),
        (ARM_LIKE, "hinge { parent { x = 1; } }", "parent"),
        (ARM_LIKE, "hinge { child { x = 1; } }", "child"),
        (ARM_LIKE, "bar { shape { along { x = 1; } } }", "along"),
        (SERVO_LIKE, "rate { x = 1; }", "rate"),
        (SERVO_LIKE, "friction { x = 1; }", "friction"),
        (RUN_LIKE, "servos { hinge { rate { x = 1; } } }", "rate"),
        (RUN_LIKE, "servos { hinge { kp { x = 1; } } }", "kp"),
        (RUN_LIKE, "rates { servos { x = 1; } }", "servos"),
        (RUN_LIKE, "initial { servos { x = 1; } }", "servos"),
        (RUN_LIKE, "environment { velocity_products { x = 1; } }", "velocity_products"),
        (RUN_LIKE, "box { on { x = 1; } }", "on"),
        (RUN_LIKE, "box { mass { x = 1; } }", "mass"),
        (RUN_LIKE, "duration { x = 1; }", "duration"),
    ],
)
def test_a_block_upon_a_number_or_a_word_is_refused_where_it_is_written(
    tmp_path: Path, definition: str, body: str, name: str
) -> None:
    text = definition.format(body)
    compiled = check(tmp_path, *upon(text), select="all")
    (told,) = compiled.diagnostics
    assert (told.code, told.message) == ("D054", f"`{name}` is a value, not a block")
    assert told.help == (f"write `{name} = ...;`",)
    lines = "".join(BASES).count("\n")
    assert told.at is not None
    place = told.at.place
    assert (place.line, place.column) == (lines + 1, text.index(f"{name} {{", text.index(body)) + 1)
    (base,) = told.also
    assert base.text == "written here" and base.place.line <= lines


def test_a_definition_that_no_run_uses_is_looked_at_too(tmp_path: Path) -> None:
    assert codes(tmp_path, *upon("servo other like drive { rate { x = 1; } }")) == ["D054"]
    assert codes(tmp_path, *upon("servo other like drive { command { x = 1; } }")) == ["D054"]
    assert codes(tmp_path, *upon("servo other like drive { friction { x = 1; } }")) == ["D054"]


def test_the_whole_message_shows_the_block_and_what_it_is_written_upon(tmp_path: Path) -> None:
    run = "run it like hold { servos { hinge { kp { x = 1; } } } }"
    assert messages(check(tmp_path, ARM, SERVO, RUN, run, select="all")).startswith(
        """\
error[D054]: `kp` is a value, not a block
  --> deck.ic:18:37
   |
18 | run it like hold { servos { hinge { kp { x = 1; } } } }
   |                                     ^^
  ::: deck.ic:7:18  written here
   = help: write `kp = ...;`
"""
    )


def test_a_block_upon_a_name_with_entries_of_its_own_changes_these(tmp_path: Path) -> None:
    run = "run it like hold { servos { hinge { kp = 2 V*s/rad; } } }"
    assert experiment(tmp_path, ARM, SERVO, RUN, run, select=["it"]).parameters["hinge.servo.kp"].value == 2.0
    run = "arm other like swing { bar { shape { length = 2 m; } } } run it like hold { arm = other; }"
    found = experiment(tmp_path, ARM, SERVO, RUN, run, select=["it"])
    assert found.parameters["links.bar.inertia.zz"].value == pytest.approx(2.0 * 4.0 / 12.0)


@pytest.mark.parametrize(
    ("body", "code"),
    [
        ("arm { }", "D112"),
        ("base { }", "D250"),
        ("integrator { }", "D143"),
        ("end { of { } }", "D125"),
    ],
)
def test_others_that_take_no_block_are_told_at_the_block(tmp_path: Path, body: str, code: str) -> None:
    more = "base = fixed; integrator = rk4; metric end = final { of = hinge.q; } duration ="
    compiled = check(
        tmp_path, ARM, SERVO, changed(RUN, ("duration =", more)), f"run it like hold {{ {body} }}", select="all"
    )
    (told,) = compiled.diagnostics
    assert told.code == code and told.at is not None and told.at.place.line == 18


def test_a_function_takes_no_names_as_an_entry_s_value_either(tmp_path: Path) -> None:
    servo = changed(SERVO, ("kp = 0.1 V*s/rad", "kp = max(0.1 V*s/rad, other = 9 V*s/rad)"))
    assert codes(tmp_path, ARM, servo, RUN) == ["D070"]
