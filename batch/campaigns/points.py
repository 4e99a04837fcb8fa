"""The case table of a search as it grows: cases appended to an experiment, kept in the campaign's folder for workers.

A campaign does not resume from the file but from the shards, from which the same cases follow again.
"""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np

from batch.campaigns.tasks import CampaignSection
from met.host.files import read_regular
from met.plan import Experiment
from met.plan.columns import all_rows
from met.plan.file import array_bytes
from met.plan.searches import MOST_SEARCHED
from met.run import Prepared

NPY_HEAD_BYTES = 4096
"""Largest number of bytes before the numbers of a `.npy` file; numpy writes 128."""


def points_path(folder: Path, number: int) -> Path:
    """The file with the cases of a search, by the number of its section."""
    return folder / f"points.{number}.npy"


def write_points(folder: Path, number: int, table: np.ndarray) -> None:
    """Keep the cases of a search that were asked for so far, [case, coordinate], SI. The file is not flushed to the
    disk, since the cases follow again from the shards."""
    path = points_path(folder, number)
    temporary = path.with_name(f".{path.name}.tmp")
    temporary.write_bytes(array_bytes(np.asarray(table, "<f8")))
    temporary.replace(path)


def read_points(path: Path, experiment: Experiment) -> np.ndarray:
    """The cases in such a file. Raises OSError, and ValueError where it does not belong to this experiment."""
    width = len(experiment.cases.coordinates)
    data = read_regular(path, MOST_SEARCHED * width * np.dtype(float).itemsize + NPY_HEAD_BYTES)
    try:
        table = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    except (EOFError, TypeError, OverflowError, MemoryError) as reason:
        raise ValueError("it is no array") from reason
    if table.dtype != np.dtype("<f8") or table.ndim != 2 or table.shape[1] != width or not len(table):
        raise ValueError("it holds no cases of this search")
    return table


def with_cases(experiment: Experiment, table: np.ndarray) -> Experiment:
    """The experiment with these cases, [case, coordinate], SI."""
    coordinates = tuple(
        replace(coordinate, values=np.ascontiguousarray(column))
        for coordinate, column in zip(experiment.cases.coordinates, table.T, strict=True)
    )
    return replace(experiment, cases=replace(experiment.cases, count=len(table), coordinates=coordinates))


def grown(section: CampaignSection, table: np.ndarray) -> CampaignSection:
    """All cases of a search so far as a section, with its existing kernel."""
    return replace(section, prepared=grown_program(section.prepared, table), rows=all_rows(len(table)))


def grown_program(prepared: Prepared, table: np.ndarray) -> Prepared:
    """The program of an experiment with the cases so far."""
    return prepared.of_cases(with_cases(prepared.experiment, table))
