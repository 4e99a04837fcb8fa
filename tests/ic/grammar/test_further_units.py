"""Units that came after decks were written: units behind a number or a unit, and names of a deck's own come first."""

from __future__ import annotations

from pathlib import Path

import pytest

from ic.meaning.definitions.resolve import Definitions
from ic.meaning.expressions.names import Names
from ic.meaning.expressions.quantity import Value
from ic.read import read
from ic.text.complaints import Complaints
from met import units


def value(folder: Path, text: str, name: str = "it") -> Value:
    """The value of a deck's `let`."""
    (folder / "deck.ic").write_text(text, encoding="utf-8")
    definitions = Definitions(read(folder / "deck.ic", [], []), Complaints())
    found = Names(definitions, {}).evaluate(definitions.lets[name].value)
    assert isinstance(found, Value)
    return found


@pytest.mark.parametrize(("written", "number", "unit"), [
    ("3 MPa", 3e6, "Pa"),
    ("5MHz", 5e6, "1/s"),
    ("2.5 ns", 2.5e-9, "s"),
    ("1 inch", 0.0254, "m"),
    ("(1/2) ft", 0.1524, "m"),
    ("2 lbf*ft", 2 * 1.3558179483314004, "N*m"),
    ("1 lbf/inch^2", 6894.757293168361, "Pa"),
    ("30 rev/min", 3.141592653589793, "rad/s"),
    ("1 (N*m)/rev", 0.15915494309189535, "N*m/rad"),
])  # fmt: skip
def test_they_are_units_behind_a_number(written: str, number: float, unit: str, tmp_path: Path) -> None:
    found = value(tmp_path, f"let it = {written};")
    assert found.number == pytest.approx(number, rel=1e-15)
    assert units.text(found.dimension) == unit


@pytest.mark.parametrize("name", units.FURTHER_UNITS)
def test_a_deck_that_calls_a_value_so_means_what_it_meant(name: str, tmp_path: Path) -> None:
    text = f"let {name} = 3;\nlet it = 2 N*{name};\nlet other = 8 m / {name} * 3;\nlet same = ({name} + 1) * {name};\n"
    assert (value(tmp_path, text).number, units.text(value(tmp_path, text).dimension)) == (6.0, "N")
    assert value(tmp_path, text, "other").number == 8.0
    assert value(tmp_path, text, "same").number == 12.0


@pytest.mark.parametrize("name", units.FURTHER_UNITS)
def test_macros_and_their_parameters_may_be_called_so(name: str, tmp_path: Path) -> None:
    text = f"#define {name} 3\n#define TWICE({name}) 2 * {name}\nlet it = 2 * {name} + TWICE(5);\n"
    assert value(tmp_path, text).number == 16.0


def test_a_name_on_the_next_line_is_no_unit(tmp_path: Path) -> None:
    text = "let it = [1, 2]\n;\nlet ft\n= 3;\n"
    assert value(tmp_path, text, "ft").number == 3.0
