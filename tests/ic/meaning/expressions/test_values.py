"""Expressions to quantities: units, bare numbers, lists, functions, and what numbers cannot do."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import pytest

from ic.grammar.syntax import Name, Word
from ic.meaning.definitions.resolve import Definitions
from ic.meaning.expressions.names import Names
from ic.meaning.expressions.quantity import Value, ValueList
from ic.read import read
from ic.text.complaints import Complaints
from met import units
from met.diagnostic import Place, Problem
from met.unit_parser import parse_unit

SOMEWHERE = Place("test", 1, 1)


def value(folder: Path, expression: str, before: str = "") -> Value | ValueList:
    """What `let it = <expression>;` is worth."""
    path = folder / "deck.ic"
    path.write_text(f"{before}\nlet it = {expression};\n", encoding="utf-8")
    complaints = Complaints()
    names = Names(Definitions(read(path), complaints), {})
    assert not complaints.errors
    return names.find(Name((Word("it", SOMEWHERE),), SOMEWHERE))


def number(folder: Path, expression: str, before: str = "") -> float:
    found = value(folder, expression, before)
    assert isinstance(found, Value)
    return float(found.number)


def numbers(folder: Path, expression: str, before: str = "") -> list[float]:
    found = value(folder, expression, before)
    assert isinstance(found, ValueList)
    return [float(item.number) for item in found.items if isinstance(item, Value)]


def code(folder: Path, expression: str, before: str = "") -> str:
    with pytest.raises(Problem) as caught:
        value(folder, expression, before)
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.at is not None
    return diagnostic.code


@pytest.mark.parametrize(
    ("expression", "si", "dimension"),
    [
        ("36 mm", 0.036, "m"),
        ("60 rpm", 2 * math.pi, "rad/s"),
        ("90 deg", math.pi / 2, "rad"),
        ("2 %", 0.02, "1"),
        ("1/2 m", 0.5, "1/m"),  # a unit binds tightest: 1/(2 m)
        ("2 m^2", 2.0, "m^2"),  # and so does its exponent
        ("(2 m)^2", 4.0, "m^2"),
        ("0.061 N*m/A", 0.061, "N*m/A"),
        ("(1 + 2) m", 3.0, "m"),
        ("-3 kg + 5000 g", 2.0, "kg"),
        ("3 m / 2 s", 1.5, "m/s"),
        ("sqrt(9 m^2)", 3.0, "m"),
        ("sin(30 deg)", 0.5, "1"),
        ("cos(pi)", -1.0, "1"),
        ("max(1 m, 30 cm)", 1.0, "m"),
        ("min(1 m, 30 cm)", 0.3, "m"),
        ("2^0.5", math.sqrt(2.0), "1"),
    ],
)
def test_an_expression_is_worth(tmp_path: Path, expression: str, si: float, dimension: str) -> None:
    found = value(tmp_path, expression)
    assert isinstance(found, Value)
    assert found.number == pytest.approx(si, rel=1e-15)  # one rounding of the unit's size, one of the operation
    assert units.text(found.dimension) == dimension


def test_a_unit_after_brackets_is_for_all_bare_numbers_inside(tmp_path: Path) -> None:
    assert numbers(tmp_path, "[1, 2, 3] mm") == [0.001, 0.002, 0.003]
    assert numbers(tmp_path, "linspace(1, 2, 3) km") == [1000.0, 1500.0, 2000.0]


def test_linspace_has_the_decimals_that_one_would_write(tmp_path: Path) -> None:
    assert numbers(tmp_path, "linspace(0.010, 0.040, 7)") == [0.01, 0.015, 0.02, 0.025, 0.03, 0.035, 0.04]


def test_a_range_of_degrees_has_the_angles_that_one_would_write(tmp_path: Path) -> None:
    written = [number(tmp_path, f"{tenths / 10} deg") for tenths in range(31)]
    assert numbers(tmp_path, "0 deg .. 3 deg by 0.1 deg") == written


@pytest.mark.parametrize(("written", "message"), [
    ("1 km .. 0 km by 100 m", "steps of 0.1 km do not lead from 1 km to 0 km"),
    ("1 .. 0 by 0.1", "steps of 0.1 do not lead from 1 to 0"),
    ("3 deg .. 0 deg by 1 deg", "steps of 1 deg do not lead from 3 deg to 0 deg"),
])  # fmt: skip
def test_steps_that_lead_elsewhere_are_told_in_the_unit_of_the_first(
    tmp_path: Path, written: str, message: str
) -> None:
    with pytest.raises(Problem) as caught:
        numbers(tmp_path, written)
    assert caught.value.diagnostics[0].message == message


def test_logspace_goes_by_one_ratio_and_keeps_its_ends(tmp_path: Path) -> None:
    assert numbers(tmp_path, "logspace(0.1, 10, 3) Hz") == [0.1, 1.0, 10.0]
    assert numbers(tmp_path, "logspace(0.025, 0.1, 3)") == [0.025, 0.05, 0.1]
    assert numbers(tmp_path, "logspace(-1, -1000, 4)") == [-1.0, -10.0, -100.0, -1000.0]
    ratio = numbers(tmp_path, "logspace(0.2, 7, 50)")
    exact = [0.2 * 35 ** (i / 49) for i in range(50)]
    assert ratio == pytest.approx(exact, rel=1e-15) and all(a < b for a, b in itertools.pairwise(ratio))


@pytest.mark.parametrize("written", ["logspace(10 deg, 90 deg, 3)", "linspace(10 deg, 50 deg, 3)", "[10, 30, 90] deg"])
def test_values_between_ends_in_degrees_are_those_of_the_degrees(tmp_path: Path, written: str) -> None:
    assert numbers(tmp_path, written)[1] == parse_unit("deg").to_si(30.0)


def test_the_count_of_a_linspace_takes_no_unit_from_behind_its_brackets(tmp_path: Path) -> None:
    assert len(numbers(tmp_path, "linspace(0, 1, 5) m")) == 5
    assert code(tmp_path, "linspace(0 m, 1 m, 5 m)") == "D072"


@pytest.mark.parametrize("expression", ["[1 m, 2] mm", "(1 m + 2) mm", "linspace(1 m, 2, 3) m", "[[1] m, 2] m"])
def test_a_unit_inside_brackets_with_one_after_is_refused(tmp_path: Path, expression: str) -> None:
    assert code(tmp_path, expression) == "D062"


def test_a_name_with_a_dimension_inside_brackets_with_a_unit_is_refused(tmp_path: Path) -> None:
    assert code(tmp_path, "[a, 2] m", "let a = 1 m;") == "D062"
    assert number(tmp_path, "(a * 2) m", "let a = 3;") == 6.0


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("1 m + 1", "D063"),
        ("1 m + 1 s", "D063"),
        ("1 Hz + 1 rad/s", "D063"),
        ("max(1 m, 1 s)", "D063"),
        ("1 / 0", "D066"),
        ("0^-1", "D066"),
        ("sqrt(-1)", "D066"),
        ("1e200 * 1e200", "D067"),
        ("10^400", "D067"),
        ("1e308 km", "D067"),
        ("(2 m)^0.5", "D068"),
        ("(-2)^0.5", "D068"),
        ("sqrt(2 m)", "D068"),
        ("2^(1 s)", "D068"),
        ("tangent(1)", "D069"),
        ("sqrt(1, 2)", "D070"),
        ("sin(x = 1)", "D070"),
        ("sin(2 m)", "D061"),
        ("[1, 2] + 1", "D071"),
        ("abs([1, 2])", "D071"),
        ("1 + [2]", "D071"),
        ("linspace(0, 1, 1)", "D072"),
        ("linspace(0, 1, 2.5)", "D072"),
        ("linspace(0, 1, 1e9)", "D072"),
        ("logspace(-1, 1, 3)", "D072"),
        ("logspace(0, 1, 3)", "D072"),
        ("nothing", "D065"),
        ("1 < 2", "D064"),
        ("not 1", "D064"),
        ('"text"', "D064"),
    ],
)
def test_what_numbers_cannot_do_is_told_with_its_place(tmp_path: Path, expression: str, expected: str) -> None:
    assert code(tmp_path, expression) == expected


def test_lets_stand_in_any_order(tmp_path: Path) -> None:
    assert number(tmp_path, "a * 2", "let a = b + 1 m; let b = 2 m;") == 6.0


def test_a_let_that_needs_itself_is_told_once_with_the_way_round(tmp_path: Path) -> None:
    path = tmp_path / "deck.ic"
    path.write_text("let a = b; let b = c; let c = a;", encoding="utf-8")
    complaints = Complaints()
    for problem in Names(Definitions(read(path), complaints), {}).check_lets():
        complaints.add(*problem.diagnostics)
    (diagnostic,) = complaints.all
    assert diagnostic.code == "D073"
    assert diagnostic.message == "`a` needs itself: `a` needs `b` needs `c` needs `a`"


@pytest.mark.slow
def test_a_long_chain_of_lets_written_backwards_ends_in_a_diagnostic(tmp_path: Path) -> None:
    chain = "".join(f"let a{n} = a{n + 1} + 1;\n" for n in range(3000)) + "let a3000 = 0;"
    assert code(tmp_path, "a0", chain) == "D073"


@pytest.mark.slow
def test_a_long_chain_of_lets_written_forwards_is_fine(tmp_path: Path) -> None:
    path = tmp_path / "deck.ic"
    path.write_text("let a0 = 0;" + "".join(f"let a{n + 1} = a{n} + 1;\n" for n in range(3000)), encoding="utf-8")
    complaints = Complaints()
    names = Names(Definitions(read(path), complaints), {})
    assert names.check_lets() == []
    last = names.find(Name((Word("a3000", SOMEWHERE),), SOMEWHERE))
    assert isinstance(last, Value) and last.number == 3000.0


def test_an_expression_may_name_what_a_servo_definition_writes(tmp_path: Path) -> None:
    assert number(tmp_path, "drive.kp / 2", "servo drive { kp = 4 V*s/rad; }") == 2.0
    assert code(tmp_path, "drive.kq", "servo drive { kp = 4 V*s/rad; }") == "D065"


@pytest.mark.parametrize("name", ["m", "deg", "pi", "sqrt"])
def test_no_let_may_bear_the_name_of_a_unit_or_function(tmp_path: Path, name: str) -> None:
    path = tmp_path / "deck.ic"
    path.write_text(f"let {name} = 3;", encoding="utf-8")
    try:
        definitions = Definitions(read(path), Complaints())
    except Problem:
        return  # the parser knows units too
    assert [problem.diagnostics[0].code for problem in Names(definitions, {}).check_lets()] == ["D079"]


@pytest.mark.parametrize("written", [
    "64.1 km", "(64.1) km", "+64.1 km", "[64.1] km", "[64.1 km]", "(64.1 .. 64.1 by 1) km", "linspace(64.1, 65, 2) km",
    "[linspace(64.1, 65, 2)] km", "min(64.1, 65) km", "(64 + 0.1) km", "(half * 2) km", "64.10000000000000000 km",
])  # fmt: skip
def test_a_number_in_a_unit_is_rounded_once_however_the_unit_comes_to_it(tmp_path: Path, written: str) -> None:
    found = value(tmp_path, written, "let half = 32.05;")
    assert (found.items[0] if isinstance(found, ValueList) else found).number == 64100.0  # type: ignore[union-attr]


def test_a_number_below_zero_in_a_unit_is_rounded_once_too(tmp_path: Path) -> None:
    assert numbers(tmp_path, "[-64.1, -(64.1)] km") == [-64100.0, -64100.0]
    assert number(tmp_path, "(-0.7) ms") == -0.0007


@pytest.mark.parametrize("written", [
    "4.9e-324 mm", "(4.9e-324) mm", "[1, 4.9e-324] mm", "-4.9e-324 mm", "1e-200 m * 1e-200 m", "1e-200 m / 1e200 s",
    "(1e-200 m)^2",
])  # fmt: skip
def test_a_number_that_would_become_nothing_is_refused(tmp_path: Path, written: str) -> None:
    assert code(tmp_path, written) == "D067"


def test_nothing_in_a_unit_is_nothing(tmp_path: Path) -> None:
    assert numbers(tmp_path, "[0, -0, 0e-999999999, 0 * 1e-300] mm") == [0.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize(("written", "instead"), [
    ("logspace(-2, 1, 20)", "logspace(0.01, 10, 20)"), ("logspace(0, 3, 4)", "logspace(1, 1000, 4)"),
    ("logspace(-2, 0, 3)", "logspace(0.01, 1, 3)"),
])  # fmt: skip
def test_a_logspace_of_exponents_is_told_its_ends(tmp_path: Path, written: str, instead: str) -> None:
    with pytest.raises(Problem) as caught:
        value(tmp_path, f"{written} kg")
    assert caught.value.diagnostics[0].help[0] == f"it takes the ends themselves, not their exponents: `{instead}`"
    assert numbers(tmp_path, f"{instead} kg")


def test_a_logspace_with_units_or_broken_ends_has_no_exponents(tmp_path: Path) -> None:
    for written in ("logspace(-2 kg, 1 kg, 20)", "logspace(-0.5, 1, 20) kg"):
        with pytest.raises(Problem) as caught:
            value(tmp_path, written)
        assert caught.value.diagnostics[0].help == ("linspace(...) has no such limit",)
