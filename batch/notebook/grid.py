"""Cases unfolded into a block: a dimension for each parameter that is varied."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
import xarray

from batch.notebook.quantities import in_deck_unit, same_units
from batch.notebook.table import CASE, RECORDED, REPEAT, name_of, run_name, unknown_name, varied
from met.diagnostic import Problem, error
from met.distinct import distinct
from met.frozen import frozen

EMPTIEST, SMALL = 100, 1_000_000
"""Largest number of places in a block for each case, and a number of places that is always allowed."""


@frozen
class GridAxis:
    """A dimension of the block. values: its labels; codes: the place along it of each case; beside: parameters that
    are varied in step with it, by path, with a value a label."""

    path: str
    values: np.ndarray
    codes: np.ndarray
    beside: Mapping[str, np.ndarray]


def to_grid(parts: Sequence[xarray.Dataset], names: Sequence[str]) -> xarray.Dataset:
    """Variables along cases, unfolded over the varied parameters; none: all metrics. Parameters that vary in step share
    a dimension, and one that is the same in all cases is a coordinate without one. Places without a case are
    not-a-number. Raises Problem E385, E388."""
    sweeps = list(dict.fromkeys(run_name(data) for data in parts))
    if len(sweeps) > 1:
        helps = f"of one of them: `data.met.sel(run={sweeps[0]!r}).met.grid(...)`"
        raise Problem(error("E388", f"these are the cases of several: {', '.join(sweeps)}", help=helps))
    known = [str(variable) for data in parts for variable in data if {CASE, RECORDED} & set(data[variable].dims)]
    if not names:
        names = list(dict.fromkeys(str(n) for data in parts for n in data if data[n].attrs.get("role") == "metric"))
    dims: dict[str, str] = {}
    for name in names or [""]:
        having = [data for data in parts if name in data]
        if not having or not {CASE, RECORDED} & set(having[0][name].dims):
            raise unknown_name(parts, name, "no variable of cases", known)
        dims[name] = CASE if CASE in having[0][name].dims else RECORDED
        if dims[name] == RECORDED and len(parts) > 1:
            helps = "of one structure: `data[NAME].met.grid(...)`"
            message = f"`{name}` is a signal, which each structure has at times of its own"
            raise Problem(error("E388", message, help=helps))
        if dims[name] != dims[names[0]]:
            message = f"one of `{names[0]}` and `{name}` is a signal, which only some cases may have"
            raise Problem(error("E388", message, help="a block of each: `data.met.grid(...)` twice"))
    inner = {str(dim) for data in parts for name in dims if name in data for dim in data[name].dims}
    for name in dims:
        same_units({name_of(data): data[name] for data in parts if name in data}, name)
    return xarray.Dataset(
        {name: _block([data for data in parts if dim in data.dims], name, dim, inner) for name, dim in dims.items()}
    )


def _block(parts: Sequence[xarray.Dataset], name: str, dim: str, inner: Collection[str]) -> xarray.DataArray:
    """The block of one variable. inner: dimensions of the variables; a parameter of such a name gets a word before it,
    as in an archive"""
    count = sum(data.sizes[dim] for data in parts)
    if not count:
        raise Problem(error("E388", f"there are no cases of which `{name}` could be"))
    columns = {
        f"coordinates.{path}" if path in inner else path: column for path, column in _columns(parts, dim).items()
    }
    axes, alike = _axes(columns)
    shape = tuple(len(axis.values) for axis in axes)
    if np.prod(shape, dtype=float) > max(SMALL, EMPTIEST * count):
        sizes_text = " x ".join(f"{size} of {axis.path}" for size, axis in zip(shape, axes, strict=True))
        helps = "samples are points: plot them over `data[PATH]`, or choose fewer by `data.met.sel(...)`"
        raise Problem(error("E388", f"{count:,} cases are no block of {sizes_text}", help=helps))
    places = np.ravel_multi_index([axis.codes for axis in axes], shape) if axes else np.zeros(count, np.int64)
    _each_once(parts, dim, places, columns)
    having = [data[name].transpose(dim, ...) for data in parts if name in data and data.sizes[dim]]
    inside = having[0].isel({dim: 0}, drop=True)
    has_name = np.concatenate([np.full(data.sizes[dim], name in data) for data in parts])
    values = np.concatenate([array.values for array in having])
    cells = int(np.prod(shape, dtype=np.int64))
    if len(values) < cells:
        values = values.astype(object if values.dtype.kind not in "iubf" else np.result_type(values.dtype, np.float32))
    block = np.full((cells, *values.shape[1:]), np.nan if len(values) < cells else values[:1], dtype=values.dtype)
    block[places[has_name]] = values
    attributes = {path: column.attrs for path, column in columns.items()}
    labels: dict[str, Any] = {axis.path: (axis.path, axis.values, attributes[axis.path]) for axis in axes}
    beside = {path: (axis.path, values, attributes[path]) for axis in axes for path, values in axis.beside.items()}
    single = {path: ((), value, attributes[path]) for path, value in alike.items()}
    own = {
        str(coordinate): array
        for coordinate, array in inside.coords.items()
        if set(array.dims) and coordinate not in columns
    }
    return xarray.DataArray(
        block.reshape((*shape, *values.shape[1:])),
        dims=(*(axis.path for axis in axes), *inside.dims),
        coords={**labels, **beside, **single, **own},
        attrs=having[0].attrs,
    )


def _columns(parts: Sequence[xarray.Dataset], dim: str) -> dict[str, xarray.DataArray]:
    """Varied parameters, by path, over all cases; one that a structure lacks is not-a-number there, or an empty
    word."""
    tables = [varied(data, dim) for data in parts]
    out = {}
    for path in dict.fromkeys(path for table in tables for path in table):
        first = next(table[path] for table in tables if path in table)
        lacking = np.nan if first.dtype.kind in "iuf" else ""
        pieces = [
            np.full(data.sizes[dim], lacking) if held is None else held.values
            for data, held in zip(
                parts, (_held(*held_and_table, path) for held_and_table in zip(parts, tables, strict=True)), strict=True
            )
        ]
        values = np.concatenate([piece if first.dtype.kind in "iuf" else piece.astype(str) for piece in pieces])
        out[path] = xarray.DataArray(values, dims=(dim,), attrs=first.attrs)
    return out


def _held(data: xarray.Dataset, table: Mapping[str, xarray.DataArray], path: str) -> xarray.DataArray | None:
    """A varied parameter of one Dataset, or the only repeat where nothing is repeated; None where it has neither."""
    return data[path] if path not in table and path == REPEAT and path in data.variables else table.get(path)


def _axes(columns: Mapping[str, xarray.DataArray]) -> tuple[list[GridAxis], dict[str, Any]]:
    """The dimensions, in the deck's order; and by path the values that all cases share."""
    axes: list[GridAxis] = []
    alike: dict[str, Any] = {}
    for path, column in columns.items():
        values, codes = _labels(column.values)
        if len(values) < 2:
            alike[path] = values[0]
            continue
        beside: dict[str, np.ndarray] = {}
        within: list[int] = []
        for number, axis in enumerate(axes):
            mine, yours = np.divmod(distinct(axis.codes * len(values) + codes), len(values))
            if len(mine) == len(axis.values):  # it follows from the other
                axes[number] = GridAxis(axis.path, axis.values, axis.codes, {**axis.beside, path: values[yours]})
                break
            if len(mine) == len(values):  # the other follows from it
                order = mine[np.argsort(yours)]
                beside |= {axis.path: axis.values[order], **{k: v[order] for k, v in axis.beside.items()}}
                within.append(number)
        else:
            axes.insert(within[0] if within else len(axes), GridAxis(path, values, codes, beside))
            axes = [axis for number, axis in enumerate(axes) if number - 1 not in within]
    return axes, alike


def _labels(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The distinct values, numbers ascending, words in their order of appearance; and the index of each value among
    them."""
    labels, first, codes = np.unique(values, return_index=True, return_inverse=True)
    if values.dtype.kind in "iuf":
        return labels, codes
    order = np.argsort(first)
    return labels[order], np.argsort(order)[codes]


def _each_once(
    parts: Sequence[xarray.Dataset], dim: str, places: np.ndarray, columns: Mapping[str, xarray.DataArray]
) -> None:
    """Raise Problem E388 where two cases are at one place."""
    order = np.argsort(places, kind="stable")
    twice = np.flatnonzero(np.diff(places[order]) == 0)
    if not len(twice):
        return
    place_a, other = order[twice[0]], order[twice[0] + 1]
    rows = np.concatenate([data[dim].values for data in parts])
    at_parameters = [
        f"{path} = {in_deck_unit([column.values[place_a]], column.attrs)[0]}"
        if column.dtype.kind in "iuf"
        else f"{path} = {column.values[place_a]}"
        for path, column in columns.items()
    ]
    where = f"are both at {', '.join(at_parameters)}" if at_parameters else "differ in nothing that is varied here"
    helps = "choose some by `data.met.sel(...)`, one of them by `data.met.sel(case=[...])`"
    raise Problem(error("E388", f"cases #{rows[place_a]} and #{rows[other]} {where}", help=helps))
