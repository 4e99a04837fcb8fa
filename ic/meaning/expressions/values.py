"""Expressions to quantities: SI numbers with their dimension, each knowing where it was written.

A number may be a recorded scalar, where a sweep varies what it depends on; then what comes of it is recorded too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import cast

from ic.grammar.spell import spell
from ic.grammar.syntax import (
    Binary,
    Broken,
    Call,
    Expression,
    List,
    Name,
    Number,
    Range,
    String,
    Unary,
    Unit,
    WithUnit,
    children,
)
from ic.meaning.expressions import series
from ic.text.complaints import known_words
from met import other_units, units
from met.diagnostic import Label, Place, Problem, did_you_mean, error
from met.frozen import frozen
from met.trace import Real, Scalar, cos, maximum, minimum, sin, sqrt
from met.units import PURE, Dimension

COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")
MOST_POINTS = 100_000
BIGGEST_EXPONENT = 16

FUNCTIONS = ("sqrt", "sin", "cos", "min", "max", "linspace", "logspace")
CONSTANTS = {"pi": math.pi}


@frozen
class Value:
    """A quantity: number in SI, dimension. bare: a number written with no unit. unit: the one it was written in.

    decimal  of a bare number that is written out, its digits as written
    hertz    the exponent of the hertz in its unit; None where a factor of pi may be there to change cycles to radians
    """

    number: Real
    dimension: Dimension
    place: Place
    bare: bool = False
    unit: Unit | None = None
    decimal: str = ""
    hertz: int | None = 0


@frozen
class Values:
    """A list of quantities."""

    items: tuple[Value | Values, ...]
    place: Place
    unit: Unit | None = None


Lookup = Callable[[Name], Value | Values]


def evaluate(expression: Expression, lookup: Lookup) -> Value | Values:
    """What the expression is worth; `lookup` gives names their values. Raises Problem, placed."""
    spine: list[Binary] = []
    while isinstance(expression, Binary):  # a long sum leans to the left: no recursion along it
        spine.append(expression)
        expression = expression.left
    value = _leaf(expression, lookup)
    for node in reversed(spine):
        value = _binary(node, value, lookup)
    return value


def evaluate_number(expression: Expression, lookup: Lookup) -> Value:
    """The expression's value, which must be one number."""
    value = evaluate(expression, lookup)
    if isinstance(value, Values):
        raise Problem(error("D071", "one number is needed here, and this is a list", place_of(expression)))
    return value


def _leaf(expression: Expression, lookup: Lookup) -> Value | Values:
    match expression:
        case Number():
            return _number(expression)
        case Name():
            if expression.text in CONSTANTS:
                return Value(CONSTANTS[expression.text], PURE, expression.place, hertz=None)
            return replace(lookup(expression), place=expression.place)
        case List():
            return Values(tuple(_items(expression, lookup)), expression.place)
        case Range():
            return _range(expression, lookup)
        case WithUnit():
            return _with_unit(expression, lookup)
        case Unary():
            return _unary(expression, lookup)
        case Call():
            return _call(expression, lookup)
        case String():
            raise Problem(error("D064", "a number is needed here, not text", expression.place))
        case Broken():
            raise Problem(())
    raise AssertionError(expression)


def _number(number: Number) -> Value:
    if number.unit is None:
        hertz = None if _of_pi(number.text) else 0
        return Value(_sound(number.value, number.place), PURE, number.place, True, decimal=number.text, hertz=hertz)
    place = spanned(number.place, number.unit.place)
    return _in_unit(Value(number.value, PURE, place, decimal=number.text), number.unit)


def _of_pi(decimal: str) -> bool:
    """Whether a number is pi or 2 pi to the places that are written, rounded or cut off: `3.14`, `6.2832`."""
    places = decimal.partition(".")[2]
    if len(places) < 2 or not places.isdigit():
        return False
    return any(
        decimal in (f"{exact:.{len(places)}f}", f"{exact:.{len(places) + 5}f}"[:-5])
        for exact in (math.pi, 2.0 * math.pi)
    )


def _in_unit(value: Value, unit: Unit) -> Value:
    """A pure number in a unit, rounded once. Raises D067 where it is too large in SI, or so small that it would be
    0."""
    measure = measure_of(unit)
    made = measure.to_si(cast(float, value.number), value.decimal)  # a scalar divides and multiplies too
    sound = _sound(made, value.place, value.number)
    return Value(sound, measure.dimension, value.place, unit=unit, hertz=measure.hertz)


def measure_of(unit: Unit) -> units.Measure:
    """What a unit means. Raises D074 where a factor is no unit."""
    for word, _ in unit.factors:
        if not units.is_unit(word.text):
            raise Problem(error("D074", f"`{word.text}` is not a unit", word.place, help=other_units.remedy(word.text)))
    try:
        measure = units.measure((word.text, exponent) for word, exponent in unit.factors)
        if measure.scale == 0.0:
            raise OverflowError
    except OverflowError:
        raise Problem(error("D067", "this unit is beyond what a number can hold", unit.place)) from None
    return measure


def _with_unit(expression: WithUnit, lookup: Lookup) -> Value | Values:
    inner = _written_unit(expression.inner)
    if inner is not None:
        raise Problem(
            error(
                "D062",
                f"a unit inside brackets that have one after them, `{expression.unit.text}`",
                inner,
                also=[Label(expression.unit.place, "this one is for all the bare numbers inside")],
                help="give each number its own unit, or none of them",
            )
        )
    measure_of(expression.unit)

    def apply(value: Value | Values) -> Value | Values:
        if isinstance(value, Values):
            return Values(tuple(apply(item) for item in value.items), value.place, expression.unit)
        if value.dimension != PURE:
            raise Problem(
                error(
                    "D062",
                    f"a value in {units.text(value.dimension)} inside brackets that have a unit after them",
                    value.place,
                    also=[Label(expression.unit.place, "this unit is for pure numbers")],
                    help="leave the unit after the brackets out, and give each bare number its own",
                )
            )
        return _in_unit(value, expression.unit)

    return apply(evaluate(expression.inner, lookup))


def _written_unit(expression: Expression) -> Place | None:
    """Where a unit is written inside, None where there is none."""
    stack: list[Expression] = [expression]
    while stack:
        part = stack.pop()
        if isinstance(part, Number | WithUnit) and part.unit is not None:
            return part.unit.place
        stack.extend(reversed(children(part)))
    return None


def _unary(expression: Unary, lookup: Lookup) -> Value:
    if expression.operator == "not":
        raise Problem(error("D064", "`not` stands only in `exclude when`", expression.place))
    value = evaluate_number(expression.operand, lookup)
    place = spanned(expression.place, value.place)
    return replace(value, number=-value.number if expression.operator == "-" else value.number, place=place)


def _binary(node: Binary, left: Value | Values, lookup: Lookup) -> Value:
    operator = node.operator
    if operator in COMPARISONS or operator in ("and", "or"):
        raise Problem(
            error(
                "D064",
                f"`{operator}` is not arithmetic: a number is needed here",
                node.place,
                help="comparisons stand in `exclude when` and `require`",
            )
        )
    if isinstance(left, Values):
        raise Problem(error("D071", f"`{operator}` needs one number on its left, and this is a list", left.place))
    right = evaluate_number(node.right, lookup)
    place = spanned(left.place, right.place)
    bare = left.bare and right.bare
    if operator in ("+", "-"):
        if not units.same(left.dimension, right.dimension):
            raise Problem(
                error(
                    "D063",
                    f"`{operator}` of {_named(left)} and {_named(right)}",
                    node.place,
                    also=[Label(left.place, _named(left)), Label(right.place, _named(right))],
                    help=_made_alike(node, left, right),
                )
            )
        number = left.number + right.number if operator == "+" else left.number - right.number
        return Value(_sound(number, place), left.dimension, place, bare, left.unit, hertz=left.hertz)
    sign = 1 if operator == "*" else -1
    hertz = None if left.hertz is None or right.hertz is None else left.hertz + sign * right.hertz
    if operator == "*":
        unit = left.unit if right.dimension == PURE else right.unit if left.dimension == PURE else None
        product = _sound(left.number * right.number, place, left.number, right.number)
        return Value(product, left.dimension * right.dimension, place, bare, unit, hertz=hertz)
    if operator == "/":
        if not isinstance(right.number, Scalar) and right.number == 0.0:
            raise Problem(error("D066", "division by zero", Label(right.place, "this is zero")))
        unit = left.unit if right.dimension == PURE else None
        quotient = _sound(left.number / right.number, place, left.number)
        return Value(quotient, left.dimension / right.dimension, place, bare, unit, hertz=hertz)
    hertz = None if left.hertz is None or isinstance(right.number, Scalar) else int(left.hertz * right.number)
    return replace(_power(node, left, right), place=place, bare=bare, hertz=hertz)


def _made_alike(node: Binary, left: Value, right: Value) -> str:
    """What to write where a bare number is added to a quantity, or two quantities are."""
    of_macro = [each.macro for each in node.place.expansions]
    outside = [each for each in (node.left, node.right) if not place_of(each).expansions]
    if of_macro and (outside or any(place_of(each).expansions != node.place.expansions for each in children(node))):
        return f"`{node.operator}` comes from macro `{of_macro[0]}`: put brackets around the macro's body"
    other, bare_one, written = (right, left, node.left) if left.bare else (left, right, node.right)
    if not bare_one.bare or isinstance(bare_one.number, Scalar):
        return "both must be of one dimension"
    unit = units.text(other.dimension)
    return f"write `{written.text} {unit}`" if isinstance(written, Number) else f"write `({spell(written)}) {unit}`"


def _power(node: Binary, base: Value, exponent: Value) -> Value:
    power = exponent.number
    if exponent.dimension != PURE:
        raise Problem(
            error(
                "D068",
                f"an exponent in {units.text(exponent.dimension)}",
                exponent.place,
                help="an exponent is a pure number",
            )
        )
    if isinstance(power, Scalar):
        raise Problem(error("D068", "a varied exponent is not in this version", exponent.place))
    whole = float(power).is_integer() and abs(power) <= BIGGEST_EXPONENT
    if base.dimension == PURE:
        dimension = PURE
    elif whole:
        dimension = base.dimension ** int(power)
    else:
        raise Problem(
            error(
                "D068",
                f"a quantity in {units.text(base.dimension)} to the power {power:g}",
                node.place,
                help=f"whole exponents up to {BIGGEST_EXPONENT}; sqrt(...) for roots",
            )
        )
    if isinstance(base.number, Scalar):
        if not whole:
            raise Problem(
                error(
                    "D068",
                    f"a varied value to the power {power:g}",
                    node.place,
                    help=f"whole exponents up to {BIGGEST_EXPONENT}; sqrt(...) for roots",
                )
            )
        return Value(base.number ** int(power), dimension, base.place)
    try:
        result = float(base.number) ** (int(power) if whole else power)
    except ZeroDivisionError:
        raise Problem(error("D066", "zero to a negative power", node.place)) from None
    except OverflowError:
        raise _too_large(node.place) from None
    if isinstance(result, complex):
        raise Problem(error("D068", "a negative number to a broken power", node.place))
    return Value(_sound(result, node.place, base.number), dimension, base.place)


def _items(written: List, lookup: Lookup) -> Iterable[Value | Values]:
    """A list's items; a range or a linspace among them stands for its values."""
    for item in written.items:
        value = evaluate(item, lookup)
        inner = item.inner if isinstance(item, WithUnit) else item
        if isinstance(value, Values) and isinstance(inner, Range | Call):
            yield from value.items
        else:
            yield value


def _range(expression: Range, lookup: Lookup) -> Values:
    """`first .. last by step`: steps from the first, as far as the last."""
    first, last, step = (evaluate_number(each, lookup) for each in (expression.first, expression.last, expression.step))
    place = place_of(expression)
    for other in (last, step):
        if not units.same(first.dimension, other.dimension):
            remedy = "all three must be of one dimension"
            if first.bare and last.bare and isinstance(expression.step, Number) and expression.step.unit is not None:
                inside = f"{spell(expression.first)} .. {spell(expression.last)} by {expression.step.text}"
                remedy = f"a unit behind the brackets is for all: `({inside}) {expression.step.unit.text}`"
            raise Problem(
                error(
                    "D063",
                    f"a range from {_named(first)} to {_named(last)} by {_named(step)}",
                    expression.place,
                    also=[Label(each.place, _named(each)) for each in (first, last, step)],
                    help=remedy,
                )
            )
    if any(isinstance(value.number, Scalar) for value in (first, last, step)):
        raise Problem(
            error(
                "D121",
                "the values of a sweep depend on what the sweep varies",
                place,
                help="write numbers that stand still",
            )
        )
    a, b, by = (float(value.number) for value in (first, last, step))
    turning = measure_of(step.unit) if step.unit is not None else units.ONE
    if turning.turns and turning.dimension == step.dimension:  # a multiple of pi is no decimal: steps are of the unit
        scale = turning.scale
        low, high, stride = (float(f"{x / scale:.15g}") for x in (a, b, by))
        between = list(_steps(low, high, stride, expression, first, scale))[1:-1]
        points: Iterable[float] = (a, *(turning.to_si(x) for x in between), *((b,) if low != high else ()))
    else:
        points = _steps(a, b, by, expression, first)
    bare = first.bare and last.bare and step.bare
    made = (Value(x, first.dimension, place, bare, first.unit, hertz=first.hertz) for x in points)
    return Values(tuple(made), place, first.unit)


def _steps(a: float, b: float, step: float, expression: Range, first: Value, scale: float = 1.0) -> Iterable[float]:
    """The points of a range. scale: SI units in one of what the numbers are in."""

    def shown(number: float) -> str:
        """In the unit of the first value, where it has one of its own."""
        number *= scale
        if first.unit is None or measure_of(first.unit).dimension != first.dimension:
            return f"{number:g}"
        return f"{number / measure_of(first.unit).scale:g} {first.unit.text}"

    if step == 0.0:
        raise Problem(error("D072", "a range by steps of zero has no end", place_of(expression.step)))
    if (b - a) * step < 0.0:
        raise Problem(
            error(
                "D072",
                f"steps of {shown(step)} do not lead from {shown(a)} to {shown(b)}",
                place_of(expression.step),
                help="give the step the other sign, or change the ends about",
            )
        )
    found = series.Steps.between(a, b, step)
    if found.count > MOST_POINTS:
        raise Problem(
            error(
                "D072",
                f"a range of {min(found.count, 10**300):.3g} values",
                place_of(expression),
                help=f"up to {MOST_POINTS} are possible",
            )
        )
    if not found.meet:
        raise Problem(
            error(
                "D220",
                f"the steps do not meet the end: they reach {shown(found.last)}, and {shown(b)} "
                "is not a whole number of steps from the first",
                place_of(expression.last),
                help="end where the steps do, or `linspace(from, to, count)`, whose ends are met",
            )
        )
    return found.points


# Functions


def _call(call: Call, lookup: Lookup) -> Value | Values:
    name = call.name.text
    if name not in FUNCTIONS:
        raise Problem(
            error(
                "D069",
                f"no function `{name}`",
                call.name.place,
                help=[*did_you_mean(name, FUNCTIONS), known_words("functions", FUNCTIONS)],
            )
        )
    if call.named or call.body is not None:
        raise Problem(
            error(
                "D070",
                f"`{name}` takes its arguments in order, without names",
                call.name.place,
                help=f"write `{name}({', '.join(USAGE[name])})`",
            )
        )
    if len(call.positional) != len(USAGE[name]) and not (name in ("min", "max") and call.positional):
        count = f"{len(USAGE[name])} argument{'s' * (len(USAGE[name]) != 1)}"
        raise Problem(
            error(
                "D070",
                f"`{name}` takes {count}, not {len(call.positional)}",
                call.name.place,
                help=f"write `{name}({', '.join(USAGE[name])})`",
            )
        )
    arguments = [evaluate_number(argument, lookup) for argument in call.positional]
    if name in ("linspace", "logspace"):
        return _spaced(call, arguments)
    first = arguments[0]
    if name == "sqrt":
        return _sqrt(call, first)
    if name in ("min", "max"):
        result = first
        for other in arguments[1:]:
            if not units.same(first.dimension, other.dimension):
                raise Problem(
                    error(
                        "D063",
                        f"`{name}` of {_named(first)} and {_named(other)}",
                        other.place,
                        help="both must be of one dimension",
                    )
                )
            number = minimum(result.number, other.number) if name == "min" else maximum(result.number, other.number)
            bare = result.bare and other.bare
            result = Value(_plain(number), first.dimension, call.place, bare, first.unit, hertz=first.hertz)
        return replace(result, place=call.place)
    if first.dimension not in (PURE, Dimension(rad=1)):
        raise Problem(error("D061", f"`{name}` of {_named(first)}", first.place, help="an angle is needed, as 30 deg"))
    return Value(_plain(sin(first.number) if name == "sin" else cos(first.number)), PURE, call.place)


USAGE = {
    "sqrt": ("x",),
    "sin": ("x",),
    "cos": ("x",),
    "min": ("a", "b"),
    "max": ("a", "b"),
    "linspace": ("from", "to", "count"),
    "logspace": ("from", "to", "count"),
}


def _sqrt(call: Call, value: Value) -> Value:
    exponents = value.dimension
    if any(exponent % 2 for exponent in exponents):
        exponents = units.counted(exponents)  # beside a mass or a length a radian counts as one: sqrt(stiffness * j)
    if any(exponent % 2 for exponent in exponents):
        raise Problem(error("D068", f"the root of {_named(value)} is of no dimension", value.place))
    if not isinstance(value.number, Scalar) and value.number < 0.0:
        raise Problem(error("D066", "the root of a negative number", value.place))
    dimension = Dimension(*(exponent // 2 for exponent in exponents))
    hertz = None if value.hertz is None else value.hertz // 2
    return Value(_plain(sqrt(value.number)), dimension, call.place, hertz=hertz)


def _spaced(call: Call, arguments: list[Value]) -> Values:
    """Points from `from` to `to`, both included: evenly (of the decimal numbers as written), or by one ratio."""
    name = call.name.text
    start, end, count = arguments
    if count.dimension != PURE or isinstance(count.number, Scalar) or not float(count.number).is_integer():
        raise Problem(
            error(
                "D072",
                f"the count of a {name} is a whole number",
                count.place,
                help=f"write `{name}(from, to, count) unit`",
            )
        )
    n = int(count.number)
    if not 2 <= n <= MOST_POINTS:
        raise Problem(error("D072", f"a {name} of {n} points", count.place, help=f"2 to {MOST_POINTS} are possible"))
    if not units.same(start.dimension, end.dimension):
        raise Problem(
            error(
                "D063",
                f"a {name} from {_named(start)} to {_named(end)}",
                end.place,
                help="both must be of one dimension",
            )
        )
    if isinstance(start.number, Scalar) or isinstance(end.number, Scalar):
        raise Problem(
            error(
                "D121",
                "the values of a sweep depend on what the sweep varies",
                call.place,
                help="write numbers that stand still",
            )
        )
    a, b = float(start.number), float(end.number)
    if name == "logspace" and not a * b > 0.0:
        raise Problem(
            error(
                "D072",
                "the ends of a logspace are both above or both below zero",
                call.place,
                help=[*_not_exponents(start, end, n), "linspace(...) has no such limit"],
            )
        )
    points = series.even(a, b, n) if name == "linspace" else series.by_ratio(a, b, n)
    bare = start.bare and end.bare
    made = (Value(x, start.dimension, call.place, bare, start.unit, hertz=start.hertz) for x in points)
    return Values(tuple(made), call.place, start.unit)


def _not_exponents(start: Value, end: Value, count: int) -> list[str]:
    """The remedy where the ends of a logspace look like exponents."""
    ends = [float(cast(float, value.number)) for value in (start, end)]
    if not (start.bare and end.bare) or any(not x.is_integer() or abs(x) > 300 for x in ends):
        return []
    shown = ", ".join(f"{10.0**x:g}" for x in ends)
    return [f"it takes the ends themselves, not their exponents: `logspace({shown}, {count})`"]


# Places and numbers


def place_of(expression: Expression) -> Place:
    """The stretch that an expression takes up, as far as it is on one line."""
    match expression:
        case Number(unit=unit) if unit is not None:
            return spanned(expression.place, unit.place)
        case Unary():
            return spanned(expression.place, place_of(expression.operand))
        case Binary():
            left = expression.left
            while isinstance(left, Binary):
                left = left.left
            return spanned(place_of(left), place_of(expression.right))
        case WithUnit():
            return spanned(place_of(expression.inner), expression.unit.place)
        case Range():
            return spanned(place_of(expression.first), place_of(expression.step))
    return expression.place


def spanned(first: Place, last: Place) -> Place:
    """From the first place to the end of the last, where both are on one line and by one way there."""
    if (first.file, first.line, first.expansions) != (last.file, last.line, last.expansions):
        return first
    end = last.column + last.length
    return replace(first, length=end - first.column) if end > first.column else first


def _named(value: Value) -> str:
    return "a pure number" if value.dimension == PURE else units.text(value.dimension)


def _plain(number: Real) -> Real:
    return number if isinstance(number, Scalar) else float(number)


def _sound(number: Real, place: Place, *factors: Real) -> Real:
    """The number. Raises D067 where it is too large to be one, or is 0 although none of its factors is."""
    if isinstance(number, Scalar):
        return number
    if not math.isfinite(number):
        raise _too_large(place)
    if factors and number == 0.0 and all(not isinstance(each, Scalar) and each != 0.0 for each in factors):
        raise Problem(
            error(
                "D067",
                "this number is too small: it would become 0",
                place,
                help="the smallest is 4.9e-324, in SI units; for nothing at all write 0",
            )
        )
    return number


def _too_large(place: Place) -> Problem:
    return Problem(error("D067", "this number is too large: the largest is 1.8e308", place))
