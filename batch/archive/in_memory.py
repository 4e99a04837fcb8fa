"""The group of one experiment in memory: as an xarray.Dataset, equal to the one that `batch.open` gives for an archive
of the same cases; and as a group for code that reads archives.

Making twenty variables anew takes xarray a millisecond. So the Dataset is laid out once for each number of cases, and
copied with other values.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from batch.archive import layout as archive_layout
from batch.archive.layout import Layout
from batch.archive.read import ArchiveGroup
from batch.archive.stored import Stored
from batch.archive.values import KINDS, times_of, values_of_cases, values_of_dimensions
from met.frozen import frozen
from met.plan import Experiment, keys
from met.run import Prepared, Run

if TYPE_CHECKING:
    import xarray

KEPT_LAYOUTS = 4
"""Largest number of layouts that are kept, those used last."""


@frozen
class DatasetLayout:
    """A Dataset without values. moving: its variables whose values differ from run to run."""

    layout: Layout
    template: xarray.Dataset
    moving: tuple[str, ...]


class DatasetMaker:
    """Maker of Datasets for runs of one program.

    deck      its name, as an archive's attribute has it
    prepared  the program, with any cases
    """

    def __init__(self, deck: str, prepared: Prepared) -> None:
        self._deck, self._prepared = deck, prepared
        self._id_head = keys.id_head(prepared.experiment)
        self._laid_out = lru_cache(KEPT_LAYOUTS)(self._lay_out)

    def dataset(self, experiment: Experiment, run: Run, signals: Collection[str] = ()) -> xarray.Dataset:
        """The Dataset of all cases of an experiment after their run, with these signals.

        experiment  that of `prepared`, with these cases
        """
        count = len(run.case)
        dataset_layout = self._laid_out(count, frozenset(signals))
        values = values_of_cases(experiment, dataset_layout.layout, run, self._id_head)
        if signals:
            values |= {variable.name: values[variable.source] for variable in dataset_layout.layout.role("recorded")}
            values |= {variable.name: run.signals[variable.key] for variable in dataset_layout.layout.role("signal")}
        dataset = dataset_layout.template.copy(deep=False)  # with variables of its own
        variables = dataset.variables
        for name in dataset_layout.moving:
            variables[name].data = _plain(values[name], count)
        return dataset

    def _lay_out(self, count: int, signals: frozenset[str]) -> DatasetLayout:
        """The layout of Datasets of `count` cases with these signals: their variables, with the values that no run
        changes."""
        import xarray

        prepared, experiment = self._prepared, self._prepared.experiment
        layout = archive_layout.layout(experiment, count, count if signals else 0)
        left_out = {variable.name for variable in layout.role("signal") if variable.name not in signals}
        variables = [variable for variable in layout.variables if variable.name not in left_out]
        used = {dim for variable in variables if variable.role != "dimension" for dim in variable.dims}
        variables = [variable for variable in variables if variable.role != "dimension" or variable.name in used]
        fixed = values_of_dimensions(experiment) | {"case": np.arange(count), "recorded_case": np.arange(count)}
        fixed["time"] = times_of(experiment)
        coordinates, laid = {}, {}
        for variable in variables:
            attributes = _as_opened(variable.written_attributes | variable.code_key(prepared.result_keys))
            if variable.role == "dimension":
                values = np.asarray(fixed[variable.name])
                coordinates[variable.name] = (
                    variable.dims,
                    values.astype(str) if variable.kind == "str" else values,
                    attributes,
                )
            else:
                kind = "U1" if variable.kind == "str" else KINDS[variable.kind]
                nothing = np.broadcast_to(np.zeros((), kind), [layout.sizes[dim] for dim in variable.dims])
                laid[variable.name] = variable.dims, nothing, attributes
        named = str(layout.attributes["coordinates"]).split()
        attributes = {
            "schema": archive_layout.SCHEMA,
            "schema_version": archive_layout.VERSION,
            "deck": self._deck,
            **_as_opened(layout.attributes),
            "cases_in_table": count,
            "code_key": prepared.code_key,
        }
        template = xarray.Dataset(laid, coordinates, attributes).set_coords([name for name in named if name in laid])
        return DatasetLayout(layout, template, tuple(laid))


class GroupInMemory(ArchiveGroup):
    """A group of an archive that is in no file: the variables with one value a case, without histories.

    values  by the names of the layout's variables along `case`, in the order of the cases
    """

    def __init__(self, experiment: Experiment, count: int, values: Mapping[str, Any]) -> None:
        self._experiment, self._layout = experiment, archive_layout.layout(experiment, count, 0)
        self._values = {**values_of_dimensions(experiment), **values}
        self.path = Path(experiment.name)
        self.attributes = _as_read({**self._layout.attributes, "cases_in_table": experiment.cases.count})
        self.verified = self.summary = self.summed = None
        self.step_errors = ()
        self.name, self.sweep = experiment.name, str(self.attributes.get("sweep", ""))

    @classmethod
    def of_run(cls, experiment: Experiment, run: Run) -> GroupInMemory:
        """The group of the cases of a run."""
        count = len(run.case)
        values = values_of_cases(experiment, archive_layout.layout(experiment, count, 0), run)
        return cls(experiment, count, {name: _plain(column, count) for name, column in values.items()})

    @classmethod
    def of_metrics(
        cls, experiment: Experiment, rows: np.ndarray, status: np.ndarray, metrics: Mapping[str, np.ndarray]
    ) -> GroupInMemory:
        """The group of these rows of the case table, with only their status and metrics."""
        names = {
            variable.key: variable.name for variable in archive_layout.layout(experiment, len(rows), 0).role("metric")
        }
        values = {names[name]: column for name, column in metrics.items()}
        return cls(experiment, len(rows), {"case": experiment.cases.table[rows], "status": status, **values})

    @cached_property
    def variables(self) -> dict[str, Stored]:
        return {variable.name: _stored(variable) for variable in self._layout.variables}

    def shape(self, name: str) -> tuple[int, ...]:
        return tuple(self.values(name).shape)

    def type(self, name: str) -> str:
        return str(self.values(name).dtype.str)

    def values(self, name: str) -> np.ndarray:
        return times_of(self._experiment) if name == "time" else np.asarray(self._values[name])

    def at(self, name: str, positions: Sequence[int] | np.ndarray) -> np.ndarray:
        return self.values(name)[np.asarray(positions, np.int64)]

    def stretch(self, name: str, first: int, last: int) -> np.ndarray:
        return self.values(name)[first:last]

    @property
    def count(self) -> int:
        return self._layout.sizes["case"]

    @property
    def recorded(self) -> int:
        return 0


def _stored(variable: archive_layout.Variable) -> Stored:
    attributes = _as_read(variable.attributes)
    return Stored(variable.name, variable.dims, variable.role, variable.unit, (), variable.long_name, attributes)


def _as_read(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes as in `ArchiveGroup`: arrays as lists."""
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in attributes.items()}


def _as_opened(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes as xarray gives them for an opened archive: those of coordinates are left out, and a list of one item
    is that item."""
    return {
        name: value[0] if isinstance(value, list | np.ndarray) and len(value) == 1 else value
        for name, value in attributes.items()
        if name != "coordinates"
    }


def _plain(values: Any, count: int) -> np.ndarray:
    """Values as in an opened archive: strings as arrays of letters; a value that all cases share, repeated."""
    if isinstance(values, list):
        if not any(values):
            return np.zeros(count, "U1")
        return np.array(values)
    if getattr(values, "dtype", np.dtype(float)).kind == "S":
        return np.asarray(values.astype(str))
    return np.full(count, values) if np.ndim(values) == 0 else values
