"""docs/editions.md: its decks compile, and its table says what is so."""

from __future__ import annotations

import re

import pytest

import ic
from ic.grammar.declared_units import TAKEN
from met.units import measure
from tests.docs.pages import Page

PAGE = Page("editions.md").text
DECKS = {name: text for name, text in Page("editions.md").files.items() if name.endswith(".ic")}


@pytest.mark.parametrize("name", DECKS)
def test_its_decks_have_no_mistake_and_no_warning(name: str) -> None:
    compiled = ic.check(text=DECKS[name])
    assert compiled.plan is not None and compiled.diagnostics == ()


def test_the_motor_has_the_numbers_that_its_units_say() -> None:
    (step,) = ic.compile(text=DECKS["motor.ic"], select="all").experiments
    assert step.parameters["turn.servo.tau_max"].value == 20 * 7.061552e-3
    assert step.parameters["turn.servo.command.to"].value == pytest.approx(
        512 * 2 * 3.141592653589793 / 4096, rel=1e-15
    )
    assert step.requirements[0].limit == measure([("rpm", 1)]).to_si(3000, "3000")


@pytest.mark.parametrize(("entry", "first", "second"), [
    ("let h = 2 m;", "D026", ""),
    ("for m in 1 .. 3 { let a_{m} = m; }", "D026", ""),
    ("let rev = 3; let it = 2 kg*rev;", "D392", "D393"),
    ("let it = 1/2 m;", "D392", "D393"),
    ("let it = pi/180 deg;", "D392", "D393"),
    ("unit ozin = 7.061552e-3 N*m;", "D394", ""),
    ("let rev = 3; let it = (2 kg) * rev;", "", ""),
    ("let it = [1/(2 m)];", "", ""),
    ("let it = (1/2) m;", "", ""),
])  # fmt: skip
def test_what_the_table_shows_is_so(entry: str, first: str, second: str) -> None:
    run = (
        "arm a { link b { mass = 1 kg; shape = sphere(radius = 0.1 m); } joint j revolute { parent = base; child = b; "
    )
    run += "axis = z; } } run r { arm = a; rates { dynamics = 1 kHz; } duration = 1 s; record = [q]; }"
    for edition, code in ((1, first), (2, second)):
        found = ic.check(text=f"deck {edition};\n{entry}\n{run}").diagnostics
        assert [each.code for each in found][:1] == [code] * bool(code), edition


def test_words_that_follow_numbers_are_no_units() -> None:
    for word in re.findall(r"`(\w+)`", PAGE.split("which follows numbers:")[1].partition(". CSV")[0]):
        assert word in TAKEN
