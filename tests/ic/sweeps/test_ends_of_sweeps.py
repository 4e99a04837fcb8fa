"""The ends of a range, a linspace and a logspace are what a deck writes, to the last bit; and the count is exact."""

from __future__ import annotations

import random
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import pytest

from ic.grammar.syntax import Setting
from ic.meaning.definitions.resolve import Definitions
from ic.meaning.expressions.names import Names
from ic.meaning.expressions.quantity import ValueList
from ic.read import read
from ic.text.complaints import Complaints
from met import units

UNITS = ("deg", "rad", "mm", "cm", "km", "ms", "us", "rpm", "arcsec", "%", "Hz", "kg", "min", "cycle")
COUNT = 60


def exact(written: str, unit: str) -> float:
    """The nearest double of a decimal number in a unit."""
    return units.UNITS[unit].measure.to_si(float(written), written)


def lists(folder: Path, written: list[str]) -> list[tuple[float, ...]]:
    """The values of each list, in SI."""
    deck = folder / "deck.ic"
    deck.write_text("".join(f"let x{n} = {text};\n" for n, text in enumerate(written)), encoding="utf-8")
    syntax = read(deck)
    names = Names(Definitions(syntax, Complaints()), {})
    found = []
    for let in syntax.entries:
        assert not isinstance(let, Setting)
        values = names.evaluate(let.value)  # type: ignore[union-attr]
        assert isinstance(values, ValueList)
        found.append(tuple(float(each.number) for each in values.items))  # type: ignore[union-attr, arg-type]
    return found


@pytest.mark.release
@pytest.mark.parametrize("seed", range(3))
def test_random_lists_end_where_they_are_written_to_the_last_bit(tmp_path: Path, seed: int) -> None:
    rng = random.Random(seed)
    cases = []
    for _ in range(COUNT):
        places, unit, count = rng.randint(0, 4), rng.choice(UNITS), rng.randint(1, 400)
        step = Decimal(rng.randint(1, 999)).scaleb(-places)
        first = Decimal(rng.randint(1, 99999)).scaleb(-places)
        cases.append((first, first + count * step, step, unit, count + 1))
    ranges = lists(tmp_path, [f"({a:f} .. {b:f} by {c:f}) {u}" for a, b, c, u, _ in cases])
    own = lists(tmp_path, [f"({a:f} {u} .. {b:f} {u} by {c:f} {u})" for a, b, c, u, _ in cases])
    even = lists(tmp_path, [f"linspace({a:f}, {b:f}, {n}) {u}" for a, b, _, u, n in cases])
    ratio = lists(tmp_path, [f"logspace({a:f} {u}, {b:f} {u}, {n})" for a, b, _, u, n in cases])
    for (a, b, c, unit, n), *found in zip(cases, ranges, own, even, ratio, strict=True):
        told = f"seed {seed}: {a} .. {b} by {c} {unit}"
        for values in found:
            assert (len(values), values[0], values[-1]) == (n, exact(f"{a:f}", unit), exact(f"{b:f}", unit)), told
        for k, value in enumerate(found[0]):  # a range in one unit is decimal throughout
            number = Fraction(a) + k * Fraction(c)
            assert value == pytest.approx(exact(f"{Decimal(number.numerator) / number.denominator:f}", unit), rel=4e-16)


@pytest.mark.slow
@pytest.mark.parametrize(("written", "count", "last"), [
    ("(0 deg .. 90 deg by 0.1 deg)", 901, "90 deg"), ("(0 .. 90 by 0.1) deg", 901, "90 deg"),
    ("(0 .. 360 by 0.01) deg", 36001, "360 deg"), ("(1 ms .. 1 s by 1 ms)", 1000, "1 s"),
    ("(-0.3 .. 0.3 by 0.1) m", 7, "0.3 m"), ("(90 .. -90 by -0.3) deg", 601, "-90 deg"),
    ("(0 deg .. 1 cycle by 1 arcmin)", 21601, "1 cycle"),
])  # fmt: skip
def test_the_count_of_a_range_is_exact(tmp_path: Path, written: str, count: int, last: str) -> None:
    (found,) = lists(tmp_path, [written])
    number, unit = last.split()
    assert len(found) == count
    assert found[-1] == (-1 if number[0] == "-" else 1) * exact(number.lstrip("-"), unit)
