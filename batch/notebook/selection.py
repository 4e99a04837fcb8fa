"""Selection of cases by their varied values, with units; by their places and ids; by how they ended."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray

from batch.archive.read import found_cases
from batch.notebook.quantities import in_deck_unit, number, same_units
from batch.notebook.table import (
    CASE,
    PREFIX,
    RECORDED,
    case_variables,
    dimension,
    name_of,
    run_name,
    unknown_name,
    varied,
)
from met.diagnostic import Problem, did_you_mean, error
from met.distinct import distinct

CLOSE = 1e-9
"""Relative tolerance within which a typed number equals one of the archive. The engine's rounding is 1e-16."""

ZERO = 1e-14
"""The tolerance for 0, relative to the largest of the values: -1 + 10 * 0.1 is 0 only up to rounding."""

RUN, FAILED, MET, MISSED = "run", "failed", "met", "missed"
"""Words for selecting cases besides names of variables: the run or sweep; True for those that did not reach their end,
that met every requirement, that missed one."""

NEAREST = 2
"""Number of nearest values that a message names where none is the wanted one."""

Parts = Mapping[str, xarray.Dataset]
"""Datasets of an archive, by path."""


def selected(parts: Parts, wanted: Mapping[str, Any]) -> dict[str, xarray.Dataset]:
    """Keep the cases that match, by name of a variable or path in the deck.

    A name is of numbers (a number, a text with a unit, a list of these, or a slice, both ends in it), of words (one,
    or a list), or one of the words above. A Dataset without such cases is left out, unless it is the only one. One
    case asked for by its name is no dimension any more. Raises Problem E321, E322, E325, E385-E387.
    """
    if RUN in wanted and not any(RUN in data.variables for data in parts.values()):
        parts = _of_runs(parts, wanted[RUN])
        wanted = {name: value for name, value in wanted.items() if name != RUN}
    dims = {path: dimension(data) for path, data in parts.items()}
    known = {path: case_variables(data, dims[path]) for path, data in parts.items()}
    masks = {path: np.ones(data.sizes[dims[path]], bool) for path, data in parts.items()}
    for name, value in wanted.items():
        for path, mask in _masks(parts, dims, known, name, value).items():
            masks[path] &= mask
    left = {path: _cut(data, dims[path], masks[path]) for path, data in parts.items()}
    if len(left) > 1:
        left = {path: data for path, data in left.items() if masks[path].any()} or left
    return {path: _alone(data, wanted[CASE]) for path, data in left.items()} if _is_one_case(wanted) else left


def _masks(
    parts: Parts, dims: Mapping[str, str], known: Mapping[str, Mapping[str, xarray.DataArray]], name: str, value: Any
) -> dict[str, np.ndarray]:
    """For each Dataset, a mask of the cases that match one condition."""
    if name == CASE and not isinstance(value, slice):
        return _named(parts, dims, value)
    variables_named = {path: variables[name] for path, variables in known.items() if name in variables}
    if name == MET or (name in (FAILED, MISSED) and not variables_named):
        return {path: _ended(data, dims[path], name, value) for path, data in parts.items()}
    out = {path: np.zeros(data.sizes[dims[path]], bool) for path, data in parts.items()}
    if not variables_named:
        names = [known_name for path, data in parts.items() for known_name in _names(data, dims[path])]
        raise unknown_name(list(parts.values()), name, "no parameter or metric", names)
    same_units(variables_named, name)
    arrays = list(variables_named.values())
    values = np.concatenate([array.values for array in arrays])
    if arrays[0].dtype.kind in "iuf":
        chosen = _numbers(values.astype(np.float64), value, name, arrays[0].attrs)
    else:
        chosen = _words(values.astype(str), value, name)
    ends = np.cumsum([len(array) for array in arrays])[:-1]
    return out | dict(zip(variables_named, np.split(chosen, ends), strict=True))


def _names(data: xarray.Dataset, dim: str) -> list[str]:
    """The usual names for selecting cases."""
    metrics = [str(name) for name in data if data[name].attrs.get("role") == "metric"] if dim == CASE else []
    return [*varied(data, dim), *metrics, CASE, *((FAILED, MET, MISSED) if dim == CASE else ())]


def _numbers(values: np.ndarray, wanted: Any, name: str, attributes: Mapping[str, Any]) -> np.ndarray:
    """A mask of the cases whose value is one of those wanted, or in a range of them. Raises Problem E386, E387."""
    unit = str(attributes.get("units", ""))
    if isinstance(wanted, slice):
        if wanted.step is not None:
            raise Problem(error("E386", f"`{name}`: a range of values has no step", help="`slice(first, last)`"))
        out = np.ones(len(values), bool)
        for bound_wanted, sign in ((wanted.start, 1.0), (wanted.stop, -1.0)):
            if bound_wanted is not None:
                bound = number(bound_wanted, name, unit)
                slack = CLOSE * abs(bound) if bound else ZERO * _largest(values)
                slack = slack if np.isfinite(bound) else 0.0
                out &= sign * values >= sign * bound - slack
        return out
    out = np.zeros(len(values), bool)
    for wanted_value in _listed(wanted):
        value = number(wanted_value, name, unit)
        matching = np.isclose(values, value, rtol=CLOSE, atol=0.0 if value else ZERO * _largest(values))
        if not matching.any():
            raise _no_such(values, value, wanted_value, name, attributes)
        out |= matching
    return out


def _words(values: np.ndarray, wanted: Any, name: str) -> np.ndarray:
    """True of each case that has one of the wanted words, [case]. Raises Problem E386 for a range, E387 for a word that
    none has."""
    if isinstance(wanted, slice):
        raise Problem(error("E386", f"`{name}` is a word: it has no range", help="write a list of words"))
    out = np.zeros(len(values), bool)
    for word in (str(_item(word_wanted)) for word_wanted in _listed(wanted)):
        matching = values == word
        if not matching.any():
            words = list(dict.fromkeys(values.tolist()))
            helps = [*did_you_mean(word, words), f"there are: {', '.join(words)}"]
            raise Problem(error("E387", f"no case has `{name}` = {word}", help=helps))
        out |= matching
    return out


def _largest(values: np.ndarray) -> float:
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))


def _no_such(values: np.ndarray, value: float, wanted_value: Any, name: str, attributes: Mapping[str, Any]) -> Problem:
    """The error E387, with the nearest values to the one that no case has."""
    finite = distinct(values[np.isfinite(values)])
    nearest = np.sort(finite[np.argsort(np.abs(finite - value), kind="stable")[:NEAREST]])
    unit, deck_word = (str(attributes.get(key, "")) for key in ("units", "deck_unit"))
    texts = in_deck_unit(nearest, attributes)
    helps = [f"nearest are: {', '.join(repr(text).replace(chr(39), chr(34)) for text in texts)}"] if texts else []
    if not isinstance(wanted_value, str) and deck_word not in ("", unit):
        helps.append(f"a number alone is in {unit or '1'}, as the values here are")
    value_text = wanted_value if isinstance(wanted_value, str) else f"{value:g} {unit}".removesuffix(" 1").rstrip()
    return Problem(error("E387", f"no case has `{name}` = {value_text}", help=helps))


def _named(parts: Parts, dims: Mapping[str, str], wanted: Any) -> dict[str, np.ndarray]:
    """For each Dataset, a mask of the cases with these names, as `--case` takes them, or these positions."""
    rows = {path: data[dims[path]].values for path, data in parts.items()}
    ids = [_ids(data, dims[path]) for path, data in parts.items()]
    every, every_id = np.concatenate(list(rows.values())), np.concatenate(ids)
    out = np.zeros(len(every), bool)
    where = ", ".join(dict.fromkeys(map(run_name, parts.values())))
    for case_wanted in map(_item, _listed(wanted)):
        case_wanted = (
            int(case_wanted) if isinstance(case_wanted, float) and case_wanted.is_integer() else case_wanted
        )  # as idxmin gives positions
        text = (
            f"#{int(case_wanted)}"
            if isinstance(case_wanted, int | np.integer) and not isinstance(case_wanted, bool)
            else case_wanted
        )
        if not isinstance(text, str):
            helps = 'a position, 7; "#7"; or the beginning of a case_id'
            raise Problem(error("E386", f"`{CASE}` = {case_wanted!r} names no case", help=helps))
        out[found_cases(text, every, every_id, where)] = True
    return dict(zip(rows, np.split(out, np.cumsum([len(row) for row in rows.values()])[:-1]), strict=True))


def _ids(data: xarray.Dataset, dim: str) -> np.ndarray:
    name = "case_id" if dim == CASE else f"{PREFIX}case_id"
    known = name in data.variables and data[name].dims == (dim,)
    return data[name].values.astype(str) if known else np.full(data.sizes[dim], "")


def _ended(data: xarray.Dataset, dim: str, name: str, wanted: Any) -> np.ndarray:
    """True for each case that ended in this way. Raises Problem E385, E386."""
    if not isinstance(wanted, bool | np.bool_):
        raise Problem(error("E386", f"`{name}` = {wanted!r}: it is True or False"))
    needed = "status" if name == FAILED else "met"
    if needed not in data.variables or dim not in data[needed].dims:
        helps = "a run that requires nothing has none" if needed == "met" else ()
        message = f"how cases ended is not in this Dataset: it lacks the variable `{needed}`"
        raise Problem(error("E385", message, help=helps))
    if name == FAILED:
        return np.asarray((data["status"].values != 0) == wanted)
    outcomes = data["met"].transpose(dim, ...).values.reshape(data.sizes[dim], -1)
    ended_so = (outcomes == 1).all(axis=1) if name == MET else (outcomes == 0).any(axis=1)
    return np.asarray(ended_so == wanted)


def _of_runs(parts: Parts, wanted: Any) -> dict[str, xarray.Dataset]:
    """The Datasets of these runs and sweeps. Raises Problem E325."""
    names = _listed(wanted)
    for name in names:
        if all(name not in (name_of(data), run_name(data)) for data in parts.values()):
            known = ", ".join(dict.fromkeys(map(run_name, parts.values())))
            raise Problem(error("E325", f"no run or sweep `{name}` here", help=f"there are: {known}"))
    return {path: data for path, data in parts.items() if {name_of(data), run_name(data)} & set(names)}


def _cut(data: xarray.Dataset, dim: str, mask: np.ndarray) -> xarray.Dataset:
    """A Dataset of these cases only, with their histories."""
    keep: dict[Hashable, Any] = {dim: np.flatnonzero(mask)}
    if dim == CASE and RECORDED in data.dims:
        keep[RECORDED] = np.flatnonzero(np.isin(data[RECORDED].values, data[CASE].values[mask]))
    return data.isel(keep)


def _is_one_case(wanted: Mapping[str, Any]) -> bool:
    """True if one case is asked for by its name."""
    return CASE in wanted and not isinstance(wanted[CASE], slice) and _single(wanted[CASE])


def _alone(data: xarray.Dataset, name: Any) -> xarray.Dataset:
    """The Dataset of a single case, without a dimension of cases; without signals where it has none."""
    dim = dimension(data)
    if data.sizes[dim] != 1:
        raise Problem(error("E387", f"case {name!r} is none of those that are chosen by the other values"))
    if data.sizes.get(RECORDED) == 0:
        data = data.drop_dims(RECORDED)
    return data.isel({dim: 0 for dim in (CASE, RECORDED) if dim in data.dims})


def _listed(wanted: Any) -> Sequence[Any]:
    every = [wanted] if _single(wanted) else list(wanted)
    return [element.item() if isinstance(element, np.ndarray) and element.ndim == 0 else element for element in every]


def _item(element: Any) -> Any:
    """The value in an array of no dimensions, and anything else unchanged."""
    return element.item() if isinstance(element, xarray.DataArray) and element.ndim == 0 else element


def _single(wanted: Any) -> bool:
    return isinstance(wanted, str) or np.ndim(wanted) == 0
