"""Editions of the deck language: a file's own, what units and names are in each, and units that a deck declares."""

from __future__ import annotations

import random
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import ic
from ic.meaning.definitions.resolve import Definitions
from ic.meaning.expressions.names import Names
from ic.meaning.expressions.quantity import Value
from ic.read import read
from ic.text.complaints import Complaints
from ic.text.edition import EDITIONS, edition_of
from met import units
from met.diagnostic import Problem
from met.plan import file as plan_file
from met.plan.keys import inputs, structure_key
from tests.ic.decktext import Desk
from tests.ic.grammar.test_loops import same
from tests.oracles.random_deck import in_edition_2, random_deck


def value(folder: Path, text: str, name: str = "it", **others: str) -> Value:
    """The value of a deck's `let`. others: files beside it."""
    for other, included in others.items():
        (folder / f"{other}.ic").write_text(included, encoding="utf-8")
    (folder / "deck.ic").write_text(text, encoding="utf-8")
    definitions = Definitions(read(folder / "deck.ic", [], []), Complaints())
    found = Names(definitions, {}).evaluate(definitions.lets[name].value)
    assert isinstance(found, Value)
    return found


@pytest.mark.parametrize(("text", "edition"), [
    ("", 1),
    ("let a = 2;", 1),
    ("deck 1;", 1),
    ("deck 2;\nlet a = 2;", 2),
    ("// deck 1;\n\n/* deck\n1; */ deck 2;", 2),
    ("deck\n  2 ;", 2),
    ("deck 2", 2),
    ("deck_2;", 1),
    ("deck 2.0;", 1),
    ("deck = 2;", 1),
    ("#pragma once\ndeck 2;", 1),
    ("let a = 1;\ndeck 2;", 1),
])  # fmt: skip
def test_the_first_line_behind_comments_says_the_edition(text: str, edition: int) -> None:
    assert edition_of(text) == edition


def test_the_line_is_found_where_a_backslash_joins_it(desk: Desk) -> None:
    assert same(desk, "// a \\\n comment\nde\\\nck 2\\\n;\nlet m = 3 kg;\n", "deck 2; let m = 3 kg;")


@pytest.mark.parametrize("edition", EDITIONS)
def test_a_deck_that_says_its_edition_has_the_tree_of_one_that_does_not(edition: int, desk: Desk) -> None:
    text = "let reach = 2 m/s^2 * 3;\nservo s { kp = 3 (N*m)/A;  rate = 15 1/s; }\n"
    assert same(desk, f"// one\ndeck {edition};\n{text}", text)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in units.ALL_UNITS if name.isalpha()])
def test_in_edition_2_every_name_of_a_unit_may_name_a_value(name: str, tmp_path: Path) -> None:
    text = f"deck 2;\nlet {name} = 3;\nlet twice = 2 * {name};\nlet power = {name}^2 / {name};\nlet both = 4 {name};\n"
    assert value(tmp_path, text, "twice").number == 6.0
    assert value(tmp_path, text, "power").number == 3.0
    unit = units.ALL_UNITS[name].measure
    both = value(tmp_path, text, "both")
    assert (both.number, both.dimension) == (unit.to_si(4, "4"), unit.dimension)


def test_in_edition_1_they_may_not(tmp_path: Path) -> None:
    with pytest.raises(Problem, match="`h` is the unit hour, so it cannot name a value"):
        value(tmp_path, "deck 1;\nlet h = 3;\nlet it = h;\n")


def test_each_file_has_its_own_edition(tmp_path: Path) -> None:
    first = "let rev = 3;\nlet old = 2 N*rev;\n"
    unit = units.measure([("N", 1), ("rev", 1)])
    found = value(tmp_path, 'deck 2;\n#include "b.ic"\nlet it = 2 N*rev;\n', b=first)
    assert (found.number, found.dimension) == (unit.to_si(2, "2"), unit.dimension)
    assert value(tmp_path, 'deck 2;\n#include "b.ic"\nlet it = 2 N*rev;\n', "old", b=first).number == 6.0
    second = "deck 2;\nlet h = 2 m;\nlet new = 3 h;\n"
    assert value(tmp_path, '#include "b.ic"\nlet it = 1 h;\n', "new", b=second).number == 10800.0
    with pytest.raises(Problem, match="`h` is the unit hour, and stands here without a number"):
        value(tmp_path, '#include "b.ic"\nlet it = 2 * h;\n', b=second)


def test_what_a_macro_makes_is_read_as_the_file_that_wrote_it(tmp_path: Path) -> None:
    macros = "#define OLD(x) let x = 3; let by_old = 2 N*rev;\n"
    with pytest.raises(Problem, match="`rev` is a unit here"):
        value(tmp_path, 'deck 2;\n#include "b.ic"\nlet rev = 2;\nlet it = 2 N*rev;\n', b=macros)
    assert value(tmp_path, 'deck 2;\n#include "b.ic"\nOLD(rev)\nlet it = 1;\n', "by_old", b=macros).number == 6.0


def test_a_function_behind_a_unit_is_called(tmp_path: Path) -> None:
    assert value(tmp_path, "let it = 2 kg * min(3, 4);\n").number == 6.0
    assert value(tmp_path, "let it = 3 rad/min;\n").number == 0.05


def test_the_command_line_is_read_as_the_deck_is(tmp_path: Path) -> None:
    text = "deck 2;\nunit stone = 6.25 kg;\nlet h = 2 kg;\nlet it = 1 kg;\nlet m = 3 kg;\n" + RUN
    (tmp_path / "deck.ic").write_text(text, encoding="utf-8")
    plan = ic.compile(tmp_path / "deck.ic", set={"it": "h + m + 1 stone"})
    assert plan.experiments[0].parameters["links.bar.mass"].value == 11.25
    plan = ic.compile(tmp_path / "deck.ic", defines=["MASS=m"])
    assert plan.experiments[0].parameters["links.bar.mass"].value == 3.0


RUN = """\
#ifndef MASS
#define MASS it
#endif
arm a { link bar { mass = MASS;  shape = rod(length = 1 m, along = x); }
        joint j revolute { parent = base;  child = bar;  axis = z; } }
run r { arm = a;  rates { dynamics = 1 kHz; }  duration = 1 s;  record = [q]; }
"""


def test_a_plan_keeps_the_editions_of_its_files_and_nothing_else_of_them() -> None:
    made = []
    for edition in ("", "deck 1;", "deck 2;"):
        made.append(ic.compile(text=f"{edition}\nlet it = 1 kg;\n{RUN}"))
    assert [plan.sources[0].edition for plan in made] == [1, 1, 2]
    assert made[0].experiments == made[1].experiments == made[2].experiments
    texts = [plan_file.dumps(plan) for plan in made]
    assert ['"edition"' in text for text in texts] == [False, False, True]
    assert plan_file.loads(texts[2]).sources[0].edition == 2


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_random_decks_have_the_same_parameters_with_names_of_units_and_units_of_their_own(seed: int) -> None:
    old = random_deck(seed)
    new = in_edition_2(old, seed)
    assert "\nlet " in new and "\nunit " in new
    before, after = (ic.compile(text=text, select="all").experiments for text in (old, new))
    for one, other in zip(before, after, strict=True):
        assert {path: (each.value, each.unit) for path, each in one.parameters.items()} == {
            path: (each.value, each.unit) for path, each in other.parameters.items()
        }
        assert structure_key(one.structure, inputs(one)) == structure_key(other.structure, inputs(other))


@pytest.mark.parametrize(("size", "number", "unit"), [
    ("7.061552e-3 N*m", 7.061552e-3, "N*m"),
    ("(360/4096) deg", 0.0015339807878856412, "rad"),
    ("1 rev / 4096", 0.0015339807878856412, "rad"),
    ("(2*pi) rad", 6.283185307179586, "rad"),
    ("0.1", 0.1, "1"),
    ("3 inner^2", 27.0, "m^2"),
])  # fmt: skip
def test_a_deck_declares_units_in_any_order(size: str, number: float, unit: str, tmp_path: Path) -> None:
    text = f"deck 2;\nlet it = 1 mine;\nunit mine = {size};\nunit inner = 3 m;\nlet more = [1, 2] mine^2/mine;\n"
    found = value(tmp_path, text)
    assert (found.number, units.text(found.dimension)) == (number, unit)


@pytest.mark.slow
def test_a_declared_unit_is_as_exact_as_one_of_the_language(tmp_path: Path) -> None:
    pick = random.Random(24)
    for _ in range(200):
        size, count = (round(pick.uniform(0.001, 1000), pick.randint(0, 6)) for _ in range(2))
        text = f"deck 2;\nunit mine = {size} mm;\nlet it = {count} mine;\n"
        assert value(tmp_path, text).number == float(Fraction(str(size)) * Fraction(str(count)) / 1000)


@pytest.mark.slow
def test_a_hostile_declaration_ends_in_a_message(tmp_path: Path) -> None:
    grown = "".join(f"unit u{n} = 1 u{n + 1}^9;\n" for n in range(60))
    for text in (f"{grown}unit u60 = 1e9 m;\n", "".join(f"unit u{n} = 2 u{n + 1};\n" for n in range(3000)),
                 "unit z = 0e999999999 m;\n", "unit z = 1e-300 m / 1e300;\n", "unit z = 1 m / 0;\n"):  # fmt: skip
        with pytest.raises(Problem, match=r"unit|number"):
            value(tmp_path, f"deck 2;\n{text}let it = 1;\n")


def test_a_plan_is_in_units_of_the_language_where_a_deck_varies_a_value_in_one_of_its_own() -> None:
    text = f"""deck 2;
unit stone = 6.25 kg;
let it = 1 kg;
{RUN}
sweep listed of r {{ vary links.bar.mass = [1, 2] stone; }}
sweep ranged of r {{ vary links.bar.mass = 1 .. 3 by 0.5 stone; }}
sweep drawn of r {{ sample random(4) {{ links.bar.mass = uniform(1, 2) stone; }} }}
sweep spread of r {{ sample lhs(4) {{ it = uniform(1 stone, 2 stone); }} }}
run measured like r {{ metric top = max {{ of = j.q; }} }}
search worst of measured {{ maximise top; links.bar.mass = between(1, 2) stone; at_most = 40; }}
"""
    plan = plan_file.loads(plan_file.dumps(ic.compile(text=text, select="all")))
    found = {each.name: each for each in plan.experiments}
    for name in ("listed", "ranged", "drawn", "spread", "worst"):
        assert [each.unit for each in found[name].cases.coordinates] == ["kg"]
        values = np.asarray(found[name].cases.coordinates[0].values)
        assert (values >= 6.25).all() and (values <= 18.75).all()
    assert np.asarray(found["listed"].cases.coordinates[0].values).tolist() == [6.25, 12.5]
