"""Conversion of parameter values in Python to SI: numbers, texts with units, quantities; one, or one for each case."""

from __future__ import annotations

import math
import os
import reprlib
from collections.abc import Iterable, Mapping
from numbers import Integral, Real
from typing import Any

import numpy as np

from batch.notebook.quantities import number
from ic.printing.columns import size as size_text
from met.diagnostic import Problem, error
from met.host.files import memory

BELOW = 2**32
"""Upper bound of numbers of repeats, as in a plan (met/plan/check.py)."""


def short_repr(argument: Any) -> str:
    """A value in a message, shortened."""
    try:
        return reprlib.repr(argument)
    except ValueError:  # Python prints no whole number of more than 4,300 digits
        return f"<{type(argument).__name__}>"


def whole(argument: Any, name: str, *, least: int) -> int:
    """An argument that is a whole number. Raises Problem E431."""
    if not isinstance(argument, Integral) or isinstance(argument, bool) or not least <= int(argument) < BELOW:
        message = f"`{name}` is a whole number, at least {least} and below 2^32, and not {short_repr(argument)}"
        raise Problem(error("E431", message, help=f"write `{name}={max(least, 1)}`, or leave it out"))
    return int(argument)


def texts(argument: Any, name: str, code: str, example: str, kinds: Any = str) -> tuple[Any, ...]:
    """An argument that is one text or a list of texts, but not a set, which has no order. Raises Problem of this
    code."""
    if isinstance(argument, np.ndarray):
        argument = argument.tolist()
    if isinstance(argument, kinds):
        return (argument,)
    if isinstance(argument, Iterable) and not isinstance(argument, set | frozenset | Mapping):
        listed = tuple(argument)
        if all(isinstance(entry, kinds) for entry in listed):
            return listed
    message = f"`{name}` is one text or a list of texts, and not {short_repr(argument)}"
    raise Problem(error(code, message, help=f"write `{name}={example}`"))


def text_or_none(argument: Any, name: str, kinds: Any = str) -> Any:
    """An argument that is a text, or None. Raises Problem E431."""
    if argument is not None and not isinstance(argument, kinds):
        raise Problem(
            error("E431", f"`{name}` is a text, and not {short_repr(argument)}", help=f'write `{name}="..."`')
        )
    return argument


def settings(argument: Any) -> tuple[str, ...]:
    """The argument `set`, each entry as `PATH=VALUE`. Raises Problem E431."""
    example = '{"duration": "5 s"}'
    if not isinstance(argument, Mapping):
        return texts(argument, "set", "E431", example)
    return tuple(f"{path}={argument[path]}" for path in texts(list(argument), "set", "E431", example))


PATHS = (str, os.PathLike)
"""Types of the path of a file or folder."""


def values_in_si(argument: Any, path: str, unit: str) -> np.ndarray:
    """The values given for a path in its SI unit: an array without dimensions for one, with one dimension for many.

    argument  a real finite number, which is in SI; a text with a unit, "25 kg"; what has `magnitude` and `units`, as
              pint's quantities do, or an xarray.DataArray with the attribute `units`; or a list or array of these

    Raises Problem E386 for a unit or a text that is wrong, E430 for a list inside a list, E431 for all else.
    """
    magnitude, units = measured(argument)
    items = magnitude if isinstance(magnitude, list | tuple | range) else None
    if items is None and hasattr(magnitude, "__array__"):
        array = np.asanyarray(magnitude)
        if array.ndim > 1:
            raise Problem(
                error("E430", f"`{path}` has {array.ndim} dimensions", help="one value a case: `.ravel()` lists them")
            )
        plain = array.dtype.kind in "iuf" and not isinstance(array, np.ma.MaskedArray) and np.isfinite(array).all()
        if array.ndim and plain and (units is None or number(f"1 {units}", path, unit) == 1.0):
            return array.astype(np.float64)
        items = list(array) if array.ndim else None
    if items is None:
        return np.array(_in_si(magnitude, units, path, unit, f"`{path}`"))
    values = [
        _in_si(entry, units, path, unit, f"value {number_in_list} of `{path}`")
        for number_in_list, entry in enumerate(items)
    ]
    return np.array(values, dtype=np.float64)


def real(argument: Any) -> float | None:
    """A finite real number, in Python or in an array without dimensions; None for anything else: truth values, masked
    or complex values, those with a unit, and numbers too large for 64 bits."""
    if not isinstance(argument, float):
        argument, units = measured(argument)
        if hasattr(argument, "__array__"):
            argument = np.asanyarray(argument).tolist()
        if units is not None or isinstance(argument, bool) or not isinstance(argument, Real):
            return None
    try:
        converted = float(argument)
    except OverflowError:
        return None
    return converted if math.isfinite(converted) else None


def columns(values_of: Mapping[str, np.ndarray], *, product: bool) -> tuple[dict[str, np.ndarray], int]:
    """A column for each path, one value a case, and the number of cases.

    product  False: several lists go in step, so all have one length; True: each value of one with each of the others,
             the last fastest, as the axes of a sweep

    Raises Problem E430 where lengths differ, a list is empty, or a product has no room in memory.
    """
    lists = {path: values for path, values in values_of.items() if values.ndim}
    for path, values in lists.items():
        if not len(values):
            raise Problem(error("E430", f"`{path}` has no value", help="one at least, or leave it out"))
    if product:
        check_room(math.prod(map(len, lists.values())), len(values_of))
        grid = np.meshgrid(*lists.values(), indexing="ij")
        lists = {path: values.reshape(-1) for path, values in zip(lists, grid, strict=True)}
    sizes = {path: len(values) for path, values in lists.items()}
    count = next(iter(sizes.values()), 1)
    other = next((path for path, size in sizes.items() if size != count), None)
    if other is not None:
        first = next(iter(sizes))
        raise Problem(
            error(
                "E430",
                f"`{first}` has {count} values, and `{other}` {sizes[other]}",
                help=["lists go in step, a case for each of their values", "`product=True` runs each with each"],
            )
        )
    return {
        path: lists[path] if path in lists else np.full(count, float(values)) for path, values in values_of.items()
    }, count


def check_room(count: int, numbers: int) -> None:
    """Raise Problem E430 where so many cases with so many numbers do not fit in memory."""
    needed = 8 * count * numbers
    if needed > memory():
        message = f"{count:,} cases take {size_text(needed)} of memory"
        raise Problem(error("E430", message, help="run fewer at once, or `batch.run` a sweep into an archive"))


def _in_si(argument: Any, units: str | None, path: str, unit: str, where: str) -> float:
    """One value in the SI unit of its path. units: those of the list that it is in; where: its name in a message."""
    if isinstance(argument, str) and units is None:
        in_si: float | None = number(str(argument), path, unit)
    else:
        magnitude, own = (argument, None) if units is not None else measured(argument)
        if isinstance(magnitude, list | tuple | range) or (isinstance(magnitude, np.ndarray) and magnitude.ndim):
            raise Problem(
                error("E430", f"`{path}` has a list inside a list", help="one value a case: a list of numbers")
            )
        in_si, units = real(magnitude), own if units is None else units
        if in_si is not None and units is not None:
            in_si = number(f"{in_si!r} {units}", path, unit)
    if in_si is None or not math.isfinite(in_si):
        helps = 'a value is a number in SI, a text such as "25 kg", a quantity with its unit, or a list of these'
        raise Problem(error("E431", f"{where} is not a finite number: {short_repr(argument)}", help=helps))
    return in_si


def measured(argument: Any) -> tuple[Any, str | None]:
    """The magnitude of a quantity, and its unit in MET's notation; the unit is None where it has none."""
    units = getattr(argument, "units", None)
    if units is not None and hasattr(argument, "magnitude"):
        try:
            text = format(units, "~C")  # pint's short names
        except (TypeError, ValueError):
            text = str(units)
        return argument.magnitude, text.replace("**", "^").replace(" ", "") or "1"
    attributes = getattr(argument, "attrs", None)
    if isinstance(attributes, Mapping) and hasattr(argument, "values"):
        return argument.values, str(attributes["units"]) if "units" in attributes else None
    return argument, None
