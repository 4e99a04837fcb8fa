"""Values of parameters as Python gives them, in SI: numbers, texts with units, quantities; one, or one a case."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from batch.notebook.quantities import number
from met.diagnostic import Problem, error


def values_in_si(given: Any, path: str, unit: str) -> np.ndarray:
    """The values given for a path in its SI unit: an array without dimensions for one, with one dimension for many.

    given  a number, which is in SI; a text with a unit, "25 kg"; what has `magnitude` and `units`, as pint's quantities
           do, or an xarray.DataArray with the attribute `units`; or a list or array of these

    Raises Problem E386, E430.
    """
    if isinstance(given, str):
        return np.array(number(given, path, unit))
    magnitude, units = _measured(given)
    if units is not None:
        found = np.asarray(magnitude, dtype=np.float64)
        scale = number(f"1 {units}", path, unit)
        if found.ndim == 0:
            return np.array(number(f"{float(found)!r} {units}", path, unit))
        if scale == 1.0:
            return _flat(found, path)
        return np.array([number(f"{value!r} {units}", path, unit) for value in _flat(found, path).tolist()])
    if isinstance(given, np.ndarray | list | tuple | range) or hasattr(given, "__array__"):
        items = given if isinstance(given, list | tuple) else np.asarray(given)
        if isinstance(items, np.ndarray) and items.dtype.kind in "iuf":
            return _finite(_flat(items.astype(np.float64), path), path)
        if all(type(each) in (float, int) for each in items):
            return _finite(np.array(items, dtype=np.float64), path)
        parts = [values_in_si(each, path, unit) for each in items]
        if any(part.ndim for part in parts):
            raise Problem(
                error("E430", f"`{path}` has a list inside a list", help="one value a case: a list of numbers")
            )
        return np.array(parts)
    return _finite(np.array(number(given, path, unit)), path)


def columns(given: Mapping[str, np.ndarray], *, product: bool) -> tuple[dict[str, np.ndarray], int]:
    """A column for each path, one value a case, and how many cases that makes.

    product  False: several lists go in step, so all have one length; True: each value of one with each of the others,
             the last fastest, as the axes of a sweep

    Raises Problem E430 where lengths differ, or a list is empty.
    """
    lists = {path: values for path, values in given.items() if values.ndim}
    for path, values in lists.items():
        if not len(values):
            raise Problem(error("E430", f"`{path}` has no value", help="one at least, or leave it out"))
    if product:
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
        path: lists[path] if path in lists else np.full(count, float(values)) for path, values in given.items()
    }, count


def _measured(given: Any) -> tuple[Any, str | None]:
    """The magnitude of a quantity, and its unit as MET reads one; the unit is None where it is no quantity."""
    units = getattr(given, "units", None)
    if units is not None and hasattr(given, "magnitude"):
        try:
            text = format(units, "~C")  # pint's short names
        except (TypeError, ValueError):
            text = str(units)
        return given.magnitude, text.replace("**", "^").replace(" ", "") or "1"
    attributes = getattr(given, "attrs", None)
    if isinstance(attributes, Mapping) and "units" in attributes and hasattr(given, "values"):
        return given.values, str(attributes["units"])
    return None, None


def _flat(values: np.ndarray, path: str) -> np.ndarray:
    if values.ndim > 1:
        raise Problem(
            error("E430", f"`{path}` has {values.ndim} dimensions", help="one value a case: `.ravel()` lists them")
        )
    return _finite(values, path)


def _finite(values: np.ndarray, path: str) -> np.ndarray:
    if not np.isfinite(values).all():
        at = int(np.flatnonzero(~np.isfinite(np.atleast_1d(values)))[0])
        where = f"value {at} of `{path}`" if values.ndim else f"`{path}`"
        raise Problem(error("E431", f"{where} is not a finite number: {float(np.atleast_1d(values)[at])}"))
    return values
