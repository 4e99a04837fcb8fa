"""Numbers with units in a user's notation, `"20 kN*m/rad"`, and variables in other units."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import xarray

from batch.notebook.table import path_of
from met import units
from met.diagnostic import Problem, error
from met.unit_parser import parse_unit

QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*")
"""A number and its unit."""


def number(amount: Any, name: str, unit: str) -> float:
    """A value given for a variable, in the variable's unit: a number is taken directly, a text has its own unit. Raises
    Problem E386."""
    if isinstance(amount, xarray.DataArray) and amount.ndim == 0 and amount.dtype.kind in "iuf":
        own, own_unit = _measure(unit, name), str(amount.attrs.get("units", unit))
        measure = _measure(own_unit, name)
        if not units.same(measure.dimension, own.dimension):
            raise _wrong(f"`{name}` = {amount.item()!r} is in {own_unit or '1'}; it is in {unit or '1'}")
        return float(amount) if measure.scale == own.scale else float(amount) * measure.scale / own.scale
    if isinstance(amount, int | float | np.integer | np.floating) and not isinstance(amount, bool):
        return float(amount)
    example = f'such as "0.5{"" if unit in ("", "1") else f" {unit}"}"'
    if not isinstance(amount, str):
        raise _wrong(f"`{name}` = {amount!r}: it must be a number", f"write a number, or a text {example}")
    match_ = QUANTITY.fullmatch(amount)
    if match_ is None:
        raise _wrong(f"`{name}` = {amount!r} cannot be read", f"write a number and its unit, {example}")
    measure, own = _measure(match_[2], name), _measure(unit, name)
    if not units.same(measure.dimension, own.dimension):
        which = f"is in {match_[2]}" if match_[2] else "has no unit"
        raise _wrong(f"`{name}` = {amount!r} {which}; it is in {unit or '1'}", f"write one {example}")
    value = measure.to_si(float(match_[1]))
    return value if own.scale == 1.0 else value / own.scale


def same_units(arrays: Mapping[str, xarray.DataArray], name: str) -> None:
    """Raise Problem E386 where a variable has different units in two Datasets."""
    own = {path: str(array.attrs.get("units", "")) for path, array in arrays.items()}
    if len(set(own.values())) > 1:
        some = {unit: path.lstrip("/") for path, unit in reversed(own.items())}
        units_text = " and in ".join(f"{unit or '1'} in `{path}`" for unit, path in reversed(some.items()))
        raise _wrong(f"`{name}` is in {units_text}", f"ask one of them: `data[{next(reversed(some.values()))!r}].met`")


def in_units(data: xarray.Dataset, wanted: Mapping[str, str] | None) -> xarray.Dataset:
    """Variables in these units; None: parameters and metrics in the deck's units. Repeated variables along
    recorded_case follow. Raises Problem E386."""
    changed: dict[Any, xarray.Variable] = {}
    for name, unit in (deck_units(data) if wanted is None else wanted).items():
        changed |= {variable: _converted(data[variable].variable, name, unit) for variable in named(data, name)}
    coordinates = {name: variable for name, variable in changed.items() if name in data.coords}
    others = {name: variable for name, variable in changed.items() if name not in data.coords}
    return data.assign_coords(coordinates).assign(others)


def named(data: xarray.Dataset, name: str) -> list[Any]:
    """The variables with a name, or with a path in the deck."""
    return [
        variable
        for variable, array in data.variables.items()
        if name in (variable, path_of(str(variable), array.attrs))
    ]


def deck_units(data: xarray.Dataset) -> dict[str, str]:
    """The units in which the deck writes parameters and metrics, by the names of their variables."""
    return {
        str(name): str(array.attrs["deck_unit"])
        for name, array in data.variables.items()
        if "deck_unit" in array.attrs and _known(str(array.attrs["deck_unit"]))
    }


def in_deck_unit(values: Iterable[float], attributes: Mapping[str, Any]) -> list[str]:
    """Values of a variable in the deck's notation, to ten digits, which `number` reads back."""
    unit, deck_word = str(attributes.get("units", "")), str(attributes.get("deck_unit", attributes.get("units", "")))
    if not _known(unit) or not _known(deck_word):
        unit = deck_word = ""
    scale = parse_unit(deck_word or "1").scale / parse_unit(unit or "1").scale
    return [f"{value / scale:.10g}{'' if deck_word in ('', '1') else f' {deck_word}'}" for value in values]


def _converted(variable: xarray.Variable, name: str, unit: str) -> xarray.Variable:
    """A variable in another unit, which its attributes then say."""
    if "units_by_joint" in variable.attrs:
        own = dict.fromkeys(map(str, variable.attrs["units_by_joint"]))
        raise _wrong(f"`{name}` has units of its own at each joint: {', '.join(own)}")
    before, after = _measure(str(variable.attrs.get("units", "")), name), _measure(unit, name)
    if not units.same(before.dimension, after.dimension) or variable.dtype.kind not in "iuf":
        raise _wrong(f"`{name}` cannot be in {unit}; it is in {variable.attrs.get('units') or '1'}")
    scaled = variable.to_base_variable() * before.scale / after.scale
    scaled.attrs = {**variable.attrs, "units": unit}
    return scaled


def _known(unit: str) -> bool:
    try:
        parse_unit(unit or "1")
    except ValueError:
        return False
    return True


def _measure(unit: str, name: str) -> units.Measure:
    try:
        return parse_unit(unit or "1")
    except ValueError as reason:
        raise _wrong(f"`{name}`: {reason}", "units are those of decks: `met doc units`") from None


def _wrong(message: str, *helps: str) -> Problem:
    return Problem(error("E386", message, help=helps))
