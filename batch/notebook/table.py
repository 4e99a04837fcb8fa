"""The cases of Datasets: their archive, their dimension, their varied parameters, and their names."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from batch.archive.read import ArchiveFile, ArchiveGroup
from met.diagnostic import Problem, did_you_mean, error

SOURCE = "source"
"""The key under which xarray keeps the name of the file in the encoding of what it has opened."""


def file_of(data: xarray.Dataset | xarray.DataTree) -> Path:
    """The file that was opened. Raises Problem E389 where it is not known any more, as after `where` and `merge`."""
    root = data.root if isinstance(data, xarray.DataTree) else data
    known = [root.encoding.get(SOURCE), *(array.encoding.get(SOURCE) for array in data.variables.values())]
    for source_path in known:
        if isinstance(source_path, str | os.PathLike):
            return Path(source_path)
    helps = '`data.encoding["source"] = "FILE.h5"` says it'
    raise Problem(error("E389", "it is not known from which archive these numbers are", help=helps))


@contextmanager
def experiment(path: Path, data: xarray.Dataset) -> Iterator[tuple[ArchiveFile, ArchiveGroup]]:
    """The open archive, and the group in it that a Dataset is of. Raises Problem E301-E303, E389."""
    name = name_of(data)
    if not name:
        raise Problem(error("E389", "this Dataset is of no archive: it has no attribute `experiment`"))
    with ArchiveFile(path) as file:
        yield file, _group(file, data)


def _group(file: ArchiveFile, data: xarray.Dataset) -> ArchiveGroup:
    """The group that a Dataset is of. Raises Problem E389."""
    group = next((group for group in file.groups if group.name == name_of(data)), None)
    if group is None or group.attributes.get("code_key") != data.attrs.get("code_key"):
        raise _changed(file.path)
    return group


@contextmanager
def archive(path: Path, parts: Mapping[str, xarray.Dataset]) -> Iterator[ArchiveFile]:
    """The open archive of these Datasets, which all have to be in it. Raises Problem E301-E303, E389."""
    with experiment(path, next(iter(parts.values()))) as (file, _):
        for data in parts.values():
            group = _group(file, data)
            if {CASE, RECORDED} & set(data.coords):
                places(group, path, data, cases_of(data))
        yield file


def places(group: ArchiveGroup, path: Path, data: xarray.Dataset, cases: np.ndarray) -> np.ndarray:
    """Positions in the archive of cases of a Dataset. Raises Problem E389 where they are other cases there."""
    case_places = positions(group.values(CASE), cases)
    if case_places is None:
        raise _changed(path)
    for dim, name in ((CASE, "case_id"), (RECORDED, f"{PREFIX}case_id")):
        if name in data.variables and data[name].dims == data[dim].dims:
            own, ids = np.atleast_1d(data[dim].values), np.atleast_1d(data[name].values)
            theirs = dict(zip(cases.tolist(), group.at("case_id", case_places).tolist(), strict=True))
            mine = zip(own.tolist(), ids.astype(str).tolist(), strict=True)
            if any(theirs.get(case, case_id) != case_id for case, case_id in mine):
                raise _changed(path)
    return case_places


def _changed(path: Path) -> Problem:
    helps = "open it again: `batch.open(...)`"
    return Problem(error("E389", f"{path} is another archive than the one that was opened", help=helps))


CASE, RECORDED = "case", "recorded_case"
REPEAT = "repeat"
PREFIX = "recorded."
"""Beginning of the names of variables that are repeated along recorded_case."""

NO_HISTORIES = "no signals of these cases were kept: `met run ... --histories all` keeps them"

MOST_NAMES = 12
"""Largest number of existing names that are listed where a name is unknown."""


def dimension(data: xarray.Dataset) -> str:
    """The dimension of a Dataset's cases: recorded_case where only signals are left. Raises Problem E385."""
    for name in (CASE, RECORDED):
        if name in data.dims:
            return name
    raise Problem(error("E385", "this Dataset has no dimension of cases", help="one case was taken out of it, or none"))


def cases_of(data: xarray.Dataset) -> np.ndarray:
    """Positions in the case table of a Dataset's cases, also of a single one that was taken out. Raises Problem
    E385."""
    known = next((name for name in (CASE, RECORDED) if name in data.coords), None)
    return np.atleast_1d(data[known or dimension(data)].values)


def path_of(name: str, attributes: Mapping[str, Any]) -> str:
    """The path in the deck of a varied quantity; for any other variable, its name."""
    if attributes.get("role") == "recorded":
        name = name.removeprefix(PREFIX)
    return str(attributes.get("path", name))


def case_variables(data: xarray.Dataset, dim: str) -> dict[str, xarray.DataArray]:
    """Variables with one value a case, by path; also by the variable's name where that is another. `case` is its
    position."""
    out = {CASE: data[dim]}
    for name in map(str, data.variables):
        if data[name].dims == (dim,):
            attributes = data[name].attrs
            own = name.removeprefix(PREFIX) if attributes.get("role") == "recorded" else name
            out.setdefault(own, data[name])
            out.setdefault(path_of(name, attributes), data[name])
    return out


def varied(data: xarray.Dataset, dim: str) -> dict[str, xarray.DataArray]:
    """Varied parameters, by path, along a dimension of cases, in the deck's order: choices, parameters, repeats."""
    if dim == RECORDED and CASE in data.dims:
        places = positions(data[CASE].values, data[RECORDED].values)
        if places is not None:
            cases = varied(data, CASE)
            return {path: array.isel({CASE: places}).rename({CASE: RECORDED}) for path, array in cases.items()}
    roles = ("choice", "coordinate", "recorded")
    by_path = {
        path_of(name, data[name].attrs): data[name]
        for name in map(str, data.variables)
        if data[name].dims == (dim,) and data[name].attrs.get("role") in roles and name != f"{PREFIX}case_id"
    }
    repeated = data.variables.get(REPEAT)
    if repeated is not None and repeated.dims == (dim,) and repeated.values.any():
        by_path[REPEAT] = data[REPEAT]
    return by_path


def positions(values: np.ndarray, wanted: np.ndarray) -> np.ndarray | None:
    """The places of wanted values among rising ones; None where one is not there."""
    places = np.searchsorted(values, wanted)
    if len(values) == 0 or (places == len(values)).any():
        return None if len(wanted) else places
    return places if (values[places] == wanted).all() else None


def name_of(data: xarray.Dataset | xarray.DataTree) -> str:
    """The name of the run, sweep or structure that a Dataset is of; "" where it does not say."""
    return str(data.attrs.get("experiment", ""))


def run_name(data: xarray.Dataset) -> str:
    """The name of the run or sweep by which a user asks for it."""
    return str(data.attrs.get("sweep") or name_of(data))


def unknown_name(parts: Sequence[xarray.Dataset], name: str, what: str, known: Iterable[str]) -> Problem:
    """The error E385: nothing here has the name asked for. what: `no link`, `nothing`"""
    names = list(dict.fromkeys(known))
    some = ", ".join(names[:MOST_NAMES]) + (" ..." if len(names) > MOST_NAMES else "")
    helps = [*did_you_mean(name, names), f"there are: {some}" if names else "there are none"]
    if any(name in data.dims for data in parts):
        helps.insert(0, f"`{name}` is a dimension: `data.sel({name}=...)`")
    if not any(RECORDED in data.coords for data in parts):
        helps.append(NO_HISTORIES)
    where = ", ".join(dict.fromkeys(f"`{run_name(data)}`" for data in parts if run_name(data)))
    return Problem(error("E385", f"{what} `{name}`" + (f" in {where}" if where else ""), help=helps))
