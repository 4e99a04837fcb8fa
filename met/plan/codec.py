"""Conversion between the dataclasses of a plan and plain JSON data, by the types of their fields.

Encoding leaves out fields that equal their default; decoding checks every value against its type and says where in
the document it is wrong (`experiments[0].structure.joints[2].kind`).
"""

from __future__ import annotations

import dataclasses
import math
import types
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np

from met.plan import Formula, Quantity
from met.plan.columns import CaseValues
from met.trace.graph import Formulas

Fetch = Callable[[dict[str, Any]], CaseValues]

NOT_FINITE = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}


class Damaged(Exception):
    """A document that does not match its types: the place and the reason."""

    def __init__(self, where: str, why: str) -> None:
        super().__init__(f"{where}: {why}" if where else why)


@cache
def fields(cls: type) -> tuple[tuple[str, Any, Any], ...]:
    """Name, type and default (or MISSING) of every field of a dataclass."""
    hints = get_type_hints(cls)
    out = []
    for field in dataclasses.fields(cls):
        factory = field.default_factory
        default = factory() if factory is not dataclasses.MISSING else field.default
        out.append((field.name, hints[field.name], default))
    return tuple(out)


def encode(hint: Any, value: Any) -> Any:
    """Plain JSON data of a value of this type."""
    if hint is Any:
        return [encode(Any, part) for part in value] if isinstance(value, list | tuple) else value
    if hint is float:
        number = float(value)
        return number if math.isfinite(number) else repr(number)
    if hint is np.ndarray:
        return [encode(float, number) for number in value.tolist()]
    if dataclasses.is_dataclass(hint):
        return _encode_fields(hint, value)
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is tuple:
        parts = [arguments[0]] * len(value) if arguments[1:] == (...,) else arguments
        return [encode(part, item) for part, item in zip(parts, value, strict=True)]
    if origin is Mapping:
        return {str(key): encode(arguments[1], item) for key, item in value.items()}
    if origin in (Union, types.UnionType):
        return None if value is None else encode(_chosen(arguments), value)
    if hint is int:
        return int(value)
    return value


def _encode_fields(cls: Any, value: Any) -> dict[str, Any]:
    """The fields of a dataclass for JSON, without those that have their default."""
    out = {}
    for name, hint, default in fields(cls):
        part = getattr(value, name)
        if default is not dataclasses.MISSING and not isinstance(part, np.ndarray) and part == default:
            continue
        out[name] = _encode_quantity(part) if cls is Quantity and name == "value" else encode(hint, part)
    return out


def _encode_quantity(value: Any) -> Any:
    """The value of a parameter for JSON: a number, a list, a word or a formula's number."""
    if isinstance(value, Formula):
        return {"formula": int(value.output)}
    if isinstance(value, str):
        return {"word": value}
    if isinstance(value, list | tuple):
        return [encode(float, number) for number in value]
    return encode(float, value)


def _chosen(arguments: tuple[Any, ...]) -> Any:
    """The type of an optional field besides None; for a column of a case table, that of an array."""
    return next(argument for argument in arguments if argument is not type(None))


def decode(hint: Any, data: Any, where: str = "", fetch: Fetch | None = None) -> Any:
    """The value of this type behind plain JSON data. Raises Damaged."""
    if hint is Any:
        return tuple(decode(Any, part, where) for part in data) if isinstance(data, list) else data
    if hint is float:
        return _number(data, where)
    if hint is np.ndarray:
        return _array(data, where, fetch)
    if dataclasses.is_dataclass(hint):
        return _decode_fields(hint, data, where, fetch)
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is tuple:
        _expect(isinstance(data, list), where, "a list")
        whole = arguments[1:] == (...,)
        _expect(whole or len(data) == len(arguments), where, f"a list of {len(arguments)}")
        parts = [arguments[0]] * len(data) if whole else arguments
        pairs = enumerate(zip(parts, data, strict=True))
        return tuple(decode(part, item, f"{where}[{index}]", fetch) for index, (part, item) in pairs)
    if origin is Mapping:
        _expect(isinstance(data, dict), where, "an object")
        return {key: decode(arguments[1], item, f"{where}.{key}".lstrip("."), fetch) for key, item in data.items()}
    if origin in (Union, types.UnionType):
        optional = type(None) in arguments
        return None if data is None and optional else decode(_chosen(arguments), data, where, fetch)
    if origin is Literal:
        _expect(data in arguments, where, "one of " + ", ".join(map(str, arguments)))
        return data
    _expect(type(data) is hint, where, {str: "a word", int: "a whole number", bool: "true or false"}[hint])
    return data


def _decode_fields(cls: Any, data: Any, where: str, fetch: Fetch | None) -> Any:
    """A dataclass from an object's fields. Raises Damaged for an unknown or missing one."""
    _expect(isinstance(data, dict), where, "an object")
    known = fields(cls)
    for key in data:
        if all(key != name for name, _, _ in known):
            raise Damaged(where, f"`{key}` is not known")
    values = {}
    for name, hint, default in known:
        path = f"{where}.{name}".lstrip(".")
        if name in data:
            value = data[name]
            quantity = cls is Quantity and name == "value"
            values[name] = _quantity(value, path) if quantity else decode(hint, value, path, fetch)
        elif default is dataclasses.MISSING:
            raise Damaged(where, f"`{name}` is missing")
    if cls is Formulas:
        _check_formulas(values, where)
    return cls(**values)


def _quantity(data: Any, where: str) -> Any:
    """The value of a parameter from JSON: a number, a list, a word or a formula's number. Raises Damaged."""
    if isinstance(data, dict):
        if set(data) == {"formula"} and type(data["formula"]) is int:
            return Formula(data["formula"])
        if set(data) == {"word"} and isinstance(data["word"], str):
            return data["word"]
        raise Damaged(where, "it should be a number, a list, a word or a formula")
    if isinstance(data, list):
        return tuple(_number(item, where) for item in data)
    return _number(data, where)


def _check_formulas(values: dict[str, Any], where: str) -> None:
    """Check that references in formulas point to earlier nodes, since formulas are replayed."""
    from met.trace.nodes import OPERANDS, TRUTHS

    nodes = values.get("nodes", ())
    truths: list[bool] = []
    for position, node in enumerate(nodes):
        count = OPERANDS.get(node[0]) if isinstance(node, tuple) and node and isinstance(node[0], str) else None
        if count is None or len(node) <= count or node[0] in ("cell", "tick", "time"):
            raise Damaged(f"{where}.nodes[{position}]", "it is not a formula's node")
        references, rest = node[1 : 1 + count], node[1 + count :]
        pointing = all(type(ref) is int and 0 <= ref >> 1 < position for ref in references)
        wanted = {"and": (True, True), "where": (True, False, False)}.get(node[0], (False,) * count)
        if not pointing or tuple(truths[ref >> 1] for ref in references) != wanted or not _is_rest(node[0], rest):
            raise Damaged(f"{where}.nodes[{position}]", "it is not a formula's node")
        truths.append(node[0] in TRUTHS)
    if any(not 0 <= ref >> 1 < len(nodes) for ref in values.get("outputs", ())):
        raise Damaged(f"{where}.outputs", "a reference points nowhere")


def _is_rest(op: str, rest: tuple[Any, ...]) -> bool:
    """True for valid data after a node's operands: a constant's number, an input's name, a bit's place, or a table."""
    if op == "const":
        return len(rest) == 1 and _is_number(rest[0])
    if op == "input":
        return len(rest) == 1 and isinstance(rest[0], str)
    if op in ("bit", "flip"):
        return len(rest) == 1 and type(rest[0]) is int and 0 <= rest[0] < 64
    if op == "philox":
        return len(rest) == 1 and type(rest[0]) is int and 0 <= rest[0] < 4
    if op == "gather":
        return len(rest) == 1 and isinstance(rest[0], tuple) and len(rest[0]) > 0 and all(map(_is_number, rest[0]))
    return not rest


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) or (isinstance(value, str) and value in NOT_FINITE)


def _number(data: Any, where: str) -> float:
    """A number from JSON; `inf`, `-inf` and `nan` are words there. Raises Damaged."""
    if isinstance(data, str) and data in NOT_FINITE:
        return NOT_FINITE[data]
    _expect(type(data) in (int, float), where, "a number")
    try:
        return float(data)
    except OverflowError:
        raise Damaged(where, "the number is too large") from None


def _array(data: Any, where: str, fetch: Fetch | None) -> CaseValues:
    """An array from JSON, or by a reference to where it is kept. Raises Damaged."""
    if isinstance(data, dict):
        if fetch is None:
            raise Damaged(where, "its values are kept elsewhere")
        return fetch(data)
    _expect(isinstance(data, list), where, "a list of numbers")
    return np.array([_number(item, where) for item in data], dtype=np.float64)


def _expect(truth: bool, where: str, what: str) -> None:
    if not truth:
        raise Damaged(where, f"it should be {what}")
