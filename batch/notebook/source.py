"""The archive of a Dataset's numbers, for data that the Dataset itself does not hold."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import xarray

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.notebook.table import CASE, PREFIX, RECORDED, cases_of, name_of, positions
from met.diagnostic import Problem, error

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
