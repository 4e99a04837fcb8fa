"""Expressions to quantities: arithmetic, units, functions, lists."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace

from ic.grammar.syntax import (
    Binary,
    Broken,
    Call,
    Expression,
    Indexed,
    List,
    Name,
    Number,
    Range,
    String,
    Unary,
    WithUnit,
    children,
    parts_of,
    place_of,
    spanned,
    spell,
)
from ic.meaning.definitions.row_tables import CSV, is_row_table
from ic.meaning.definitions.row_tables import USAGE as USAGE_OF_TABLES
from ic.meaning.expressions.quantity import (
    Value,
    ValueList,
    as_float,
    ceiling,
    in_unit,
    in_words,
    indexed,
    list_arithmetic,
    measure_of,
    nearest_whole,
    representable,
    signed,
    too_large,
)
from ic.meaning.expressions.ranges import range_of, spaced
from ic.text.complaints import known_words
from met import units
from met.diagnostic import Help, Label, Place, Problem, did_you_mean, error, write
from met.plan.drawing import ARGUMENTS
from met.trace import (
    Real,
    Scalar,
    absolute,
    acos,
    asin,
    atan,
    atan2,
    cos,
    exp,
    floor,
    log,
    maximum,
    minimum,
    sign,
    sin,
    sqrt,
    tan,
    tanh,
)
from met.units import PURE, Dimension

COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")
BIGGEST_EXPONENT = 16

RESERVED = ("sqrt", "sin", "cos", "min", "max", "linspace", "logspace")
"""Functions whose names may not name a `let`; names of the others may, in decks that are older than they are."""

FUNCTIONS = (
    *RESERVED,
    "abs",
    "tan",
    "asin",
    "acos",
    "atan",
    "atan2",
    "exp",
    "log",
    "tanh",
    "floor",
    "ceil",
    "round",
    "sign",
)

_SAMPLED = "a value is drawn in a sample: `sample lhs(200) {{ PATH = {}(...); }}`, in a sweep"
_CHOSEN = "a range is chosen from in a `tune` or a `search`; a sweep has `linspace(FROM, TO, COUNT)`"
DRAWN = {**{name: _SAMPLED.format(name) for name in ARGUMENTS}, **dict.fromkeys(("between", "logbetween"), _CHOSEN)}
"""The remedies for words that draw or choose a value, and are no functions."""

CONSTANTS = {"pi": math.pi}

_OF_ANGLE = {"sin": sin, "cos": cos, "tan": tan}
_TO_ANGLE = {"asin": asin, "acos": acos, "atan": atan}
_OF_NUMBER = {"exp": exp, "log": log, "tanh": tanh}
_TO_WHOLE = {"floor": floor, "ceil": ceiling, "round": nearest_whole}


Lookup = Callable[[Name], Value | ValueList]


def evaluate(expression: Expression, lookup: Lookup) -> Value | ValueList:
    """The value of an expression; `lookup` gives names their values. Raises Problem, placed."""
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
    if isinstance(value, ValueList):
        raise Problem(error("D071", "one number is needed here, and this is a list", place_of(expression)))
    return value


def _leaf(expression: Expression, lookup: Lookup) -> Value | ValueList:
    """The value of an expression that is no operator, call or number with a unit."""
    match expression:
        case Number():
            return _number(expression)
        case Name():
            if expression.text in CONSTANTS:
                return Value(CONSTANTS[expression.text], PURE, expression.place, hertz=None)
            return replace(lookup(expression), place=expression.place)
        case Indexed():
            return indexed(expression, evaluate(expression.name, lookup), evaluate_number(expression.index, lookup))
        case List():
            return ValueList(tuple(_items(expression, lookup)), expression.place)
        case Range():
            parts = (expression.first, expression.last, expression.step)
            first, last, step = (evaluate_number(part, lookup) for part in parts)
            written = expression.step
            if isinstance(written, Number) and written.unit and first.bare and last.bare and step.dimension != PURE:
                # the unit at the end applies to all, as in `0 .. 90 by 5 deg`
                bare = replace(expression, step=replace(written, unit=None))
                return _with_unit(WithUnit(bare, written.unit, written.unit.place), lookup)
            return range_of(expression, first, last, step)
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
    """The value of a written number, in SI. One without a unit that is a multiple of pi may turn Hz into rad/s, so its
    power of Hz is not known (None)."""
    if number.unit is None:
        hertz = None if _of_pi(number.text) else 0
        return Value(
            representable(number.value, number.place), PURE, number.place, True, decimal=number.text, hertz=hertz
        )
    place = spanned(number.place, number.unit.place)
    return in_unit(Value(number.value, PURE, place, decimal=number.text), number.unit)


def _of_pi(decimal: str) -> bool:
    """Return True if a number is pi or 2 pi to its written places, rounded or cut off: `3.14`, `6.2832`."""
    places = decimal.partition(".")[2]
    if len(places) < 2 or not places.isdigit():
        return False
    return any(
        decimal in (f"{exact:.{len(places)}f}", f"{exact:.{len(places) + 5}f}"[:-5])
        for exact in (math.pi, 2.0 * math.pi)
    )


def _with_unit(expression: WithUnit, lookup: Lookup) -> Value | ValueList:
    """The value of an expression, all of whose bare numbers have the unit after it."""
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

    def apply(value: Value | ValueList) -> Value | ValueList:
        """A bare value, or a list of such, in the unit behind the brackets. Raises Problem D062 for a value that has a
        unit."""
        if isinstance(value, ValueList):
            return ValueList(tuple(apply(item) for item in value.items), value.place, expression.unit)
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
        return in_unit(value, expression.unit)

    return apply(evaluate(expression.inner, lookup))


def _written_unit(expression: Expression) -> Place | None:
    """The place of the first unit inside an expression; None where there is none."""
    units_inside = (part.unit for part in parts_of(expression) if isinstance(part, Number | WithUnit))
    return next((unit.place for unit in units_inside if unit is not None), None)


def _unary(expression: Unary, lookup: Lookup) -> Value | ValueList:
    """The value behind a sign. Raises Problem D064 for `not`."""
    if expression.operator == "not":
        raise Problem(error("D064", "`not` stands only in `exclude when`", expression.place))
    value = evaluate(expression.operand, lookup)
    place = spanned(expression.place, value.place)
    if isinstance(value, ValueList):
        return signed(expression.operator, value, place)
    return replace(value, number=-value.number if expression.operator == "-" else value.number, place=place)


def _binary(node: Binary, left: Value | ValueList, lookup: Lookup) -> Value | ValueList:
    """The value of arithmetic on two values or lists. Raises Problem D064 for a comparison."""
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
    right = evaluate(node.right, lookup)
    if isinstance(left, ValueList) or isinstance(right, ValueList):
        return list_arithmetic(node, left, right, _of_numbers)
    return _of_numbers(node, left, right)


def _of_numbers(node: Binary, left: Value, right: Value) -> Value:
    """The value of an operator on two numbers. Raises Problem D063 where their dimensions do not fit."""
    operator = node.operator
    place = spanned(left.place, right.place)
    bare = left.bare and right.bare
    if operator in ("+", "-"):
        if not units.same(left.dimension, right.dimension):
            raise Problem(
                error(
                    "D063",
                    f"`{operator}` of {in_words(left)} and {in_words(right)}",
                    node.place,
                    also=[Label(left.place, in_words(left)), Label(right.place, in_words(right))],
                    help=_made_alike(node, left, right),
                )
            )
        number = left.number + right.number if operator == "+" else left.number - right.number
        return Value(representable(number, place), left.dimension, place, bare, left.unit, hertz=left.hertz)
    sign = 1 if operator == "*" else -1
    hertz = None if left.hertz is None or right.hertz is None else left.hertz + sign * right.hertz
    if operator == "*":
        unit = left.unit if right.dimension == PURE else right.unit if left.dimension == PURE else None
        product = representable(left.number * right.number, place, left.number, right.number)
        return Value(product, left.dimension * right.dimension, place, bare, unit, hertz=hertz)
    if operator == "/":
        if not isinstance(right.number, Scalar) and right.number == 0.0:
            raise Problem(error("D066", "division by zero", Label(right.place, "this is zero")))
        unit = left.unit if right.dimension == PURE else None
        quotient = representable(left.number / right.number, place, left.number)
        return Value(quotient, left.dimension / right.dimension, place, bare, unit, hertz=hertz)
    hertz = None if left.hertz is None or isinstance(right.number, Scalar) else int(left.hertz * right.number)
    return replace(_power(node, left, right), place=place, bare=bare, hertz=hertz)


def _made_alike(node: Binary, left: Value, right: Value) -> Help:
    """The remedy where a bare number is added to a quantity, or two dimensions are."""
    of_macro = [macro.macro for macro in node.place.macros]
    outside = [side for side in (node.left, node.right) if not place_of(side).macros]
    if of_macro and (outside or any(place_of(child).expansions != node.place.expansions for child in children(node))):
        return Help(f"`{node.operator}` comes from macro `{of_macro[0]}`: put brackets around the macro's body")
    other, bare_one, written = (right, left, node.left) if left.bare else (left, right, node.right)
    if not bare_one.bare or isinstance(bare_one.number, Scalar):
        return Help("both must be of one dimension")
    unit = units.text(other.dimension)
    old = spell(written)
    return write(f"{old} {unit}" if isinstance(written, Number) else f"({old}) {unit}", old=old, at=place_of(written))


def _power(node: Binary, base: Value, exponent: Value) -> Value:
    """The value of a power. Raises Problem D068 where the exponent has a dimension, or gives none."""
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
        raise too_large(node.place) from None
    if isinstance(result, complex):
        raise Problem(error("D068", "a negative number to a broken power", node.place))
    return Value(representable(result, node.place, base.number), dimension, base.place)


def _items(written: List, lookup: Lookup) -> Iterable[Value | ValueList]:
    """A list's items, with ranges and linspaces replaced by their values."""
    for item in written.items:
        value = evaluate(item, lookup)
        inner = item.inner if isinstance(item, WithUnit) else item
        if isinstance(value, ValueList) and isinstance(inner, Range | Call):
            yield from value.items
        else:
            yield value


# Functions


def _call(call: Call, lookup: Lookup) -> Value | ValueList:
    """The value of a function's call. Raises Problem D069 for an unknown function."""
    name = call.name.text
    if is_row_table(call):
        message = f"`{CSV}(...)` is a table of values, and no value"
        usage = [USAGE_OF_TABLES, "a value of it is `NAME.ROW.COLUMN`"]
        raise Problem(error("D381", message, call.name.place, help=usage))
    if name not in FUNCTIONS:
        raise Problem(
            error(
                "D069",
                f"no function `{name}`",
                call.name.place,
                help=[DRAWN[name]]
                if name in DRAWN
                else [*did_you_mean(name, FUNCTIONS), known_words("functions", FUNCTIONS)],
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
        return spaced(call, *arguments)
    first = arguments[0]
    for other in arguments[1:]:
        if not units.same(first.dimension, other.dimension):
            message = f"`{name}` of {in_words(first)} and {in_words(other)}"
            raise Problem(error("D063", message, other.place, help="both must be of one dimension"))
    if name == "sqrt":
        return _sqrt(call, first)
    if name in ("min", "max"):
        result = first
        for other in arguments[1:]:
            number = minimum(result.number, other.number) if name == "min" else maximum(result.number, other.number)
            bare = result.bare and other.bare
            result = Value(as_float(number), first.dimension, call.place, bare, first.unit, hertz=first.hertz)
        return replace(result, place=call.place)
    if name == "abs":
        return replace(first, number=as_float(absolute(first.number)), place=call.place, decimal="")
    if name == "sign":
        return Value(as_float(sign(first.number)), PURE, call.place)
    if name == "atan2":
        return Value(as_float(atan2(first.number, arguments[1].number)), Dimension(rad=1), call.place)
    if name in _OF_ANGLE:
        if first.dimension not in (PURE, Dimension(rad=1)):
            raise Problem(
                error("D061", f"`{name}` of {in_words(first)}", first.place, help="an angle is needed, as 30 deg")
            )
        return Value(_number_of(call, _OF_ANGLE[name](first.number)), PURE, call.place)
    if first.dimension != PURE:
        helps = "a pure number is needed: divide by a quantity of the same unit"
        if name in _TO_WHOLE:
            helps = f"divide by the step that is meant, and multiply with it: `{name}(x / (1 mm)) * 1 mm`"
        raise Problem(error("D061", f"`{name}` of {in_words(first)}", first.place, help=helps))
    if name in _TO_ANGLE:
        return Value(_number_of(call, _TO_ANGLE[name](first.number)), Dimension(rad=1), call.place)
    if name in _TO_WHOLE:
        return Value(as_float(_TO_WHOLE[name](first.number)), PURE, call.place)
    return Value(_number_of(call, _OF_NUMBER[name](first.number)), PURE, call.place)


def _number_of(call: Call, number: Real) -> Real:
    """A function's result. Raises D066 where it is undefined for the argument, D067 where it is too large."""
    if not isinstance(number, Scalar) and math.isnan(number):
        raise Problem(error("D066", f"`{call.name.text}` of this number is none", place_of(call.positional[0])))
    return representable(as_float(number), call.place)


USAGE = {
    "sqrt": ("x",),
    "sin": ("x",),
    "cos": ("x",),
    "min": ("a", "b"),
    "max": ("a", "b"),
    "linspace": ("from", "to", "count"),
    "logspace": ("from", "to", "count"),
    "abs": ("x",),
    "tan": ("x",),
    "asin": ("x",),
    "acos": ("x",),
    "atan": ("x",),
    "atan2": ("y", "x"),
    "exp": ("x",),
    "log": ("x",),
    "tanh": ("x",),
    "floor": ("x",),
    "ceil": ("x",),
    "round": ("x",),
    "sign": ("x",),
    CSV: ('"FILE.csv"',),
}


def _sqrt(call: Call, value: Value) -> Value:
    """The root of a value, with half its dimension. Raises Problem D066 for a negative number, D068 where the dimension
    has no half."""
    exponents = value.dimension
    if any(exponent % 2 for exponent in exponents):
        exponents = units.counted(exponents)  # beside a mass or a length a radian counts as one: sqrt(stiffness * j)
    if any(exponent % 2 for exponent in exponents):
        raise Problem(error("D068", f"the root of {in_words(value)} is of no dimension", value.place))
    if not isinstance(value.number, Scalar) and value.number < 0.0:
        raise Problem(error("D066", "the root of a negative number", value.place))
    dimension = Dimension(*(exponent // 2 for exponent in exponents))
    hertz = None if value.hertz is None else value.hertz // 2
    return Value(as_float(sqrt(value.number)), dimension, call.place, hertz=hertz)
