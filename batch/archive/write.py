"""Writing an archive, batch by batch, so that the bytes do not depend on the batches.

All of a signal's chunks are allocated when the file is laid out, so batches only fill them in; what is one value a
case is gathered in memory and written at the end. No times are kept. The file has a temporary name in the same folder
until it is whole and on the disk.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from batch.archive import layout as archive_layout
from batch.archive.hdf5 import LIBVER, h5py
from batch.archive.layout import Layout, Variable
from batch.archive.provenance import Revision, version
from batch.archive.sink import Sink
from met import keys, plan_file
from met.plan import Experiment, Plan

if TYPE_CHECKING:
    from met.run import Run


@dataclass
class Section:
    """One experiment on its way into the file. values: what is one value a case, by the variable's name."""

    experiment: Experiment
    rows: np.ndarray
    recorded: bool
    layout: Layout
    group: Any
    signals: Mapping[str, Any]
    values: dict[str, np.ndarray] = field(default_factory=dict)


class Writer:
    """An archive being written. Call `put` for every batch, then `finish`; or `abandon`, which leaves nothing."""

    def __init__(self, temporary: Path, plan: Plan, parts: Sequence[tuple[Experiment, np.ndarray, bool]]) -> None:
        self.plan = plan
        self._sink = Sink(temporary)
        self._revision = Revision()
        self._file: Any = None
        try:
            self._file = h5py().File(self._sink, "w", libver=LIBVER, track_order=True)
            self.sections = [self._section(group, part) for group, part in zip(self._groups(), parts, strict=True)]
            self._sink.check()
        except BaseException:
            self.abandon()
            raise

    def put(self, section: int, first: int, run: Run) -> None:
        """Take a batch: `run` holds the cases of `section` from its `first` one on."""
        target = self.sections[section]
        cases = slice(first, first + len(run.case))
        for name, dataset in target.signals.items():
            dataset[cases] = run.signals[name]
        given: dict[str, Any] = {
            "status": run.status, "cause": run.cause, "n_valid": run.n_valid,
            **{f"friction_{name}": count for name, count in run.events.items()},
        }  # fmt: skip
        if target.experiment.structure.substitutions:
            given["bed_limited"] = run.limited
        for variable in target.layout.role("coordinate"):
            given[variable.name] = run.coordinates[variable.key]
        for variable in target.layout.role("metric"):
            given[variable.name] = run.metrics[variable.key]
        for name, values in given.items():
            target.values[name][cases] = values
        for index, requirement in enumerate(target.experiment.requirements):
            unknown = (run.status != 0) | np.isnan(run.metrics[requirement.metric])
            target.values["met"][cases, index] = np.where(unknown, -1, run.met[requirement.text])
        self._sink.check()

    def finish(self) -> None:
        """Write what is left, and see the file safely on the disk under its temporary name, still locked."""
        for section in self.sections:
            self._write_cases(section)
        self._write_provenance()
        self._file.close()
        self._sink.settle()

    def close(self) -> None:
        """Let go of the file, which has its name by now."""
        self._sink.close()

    def abandon(self) -> None:
        """Close and remove the file."""
        self._revision.close()
        if self._file:
            self._file.close()
        self._sink.remove()
        self._sink.close()

    def _groups(self) -> list[Any]:
        root = self._file
        root.attrs["schema"] = archive_layout.SCHEMA
        root.attrs["schema_version"] = archive_layout.VERSION
        root.attrs["deck"] = self.plan.deck
        paths = archive_layout.group_names(self.plan)
        return [root if path == "/" else root.create_group(path, track_order=True) for path in paths]

    def _section(self, group: Any, part: tuple[Experiment, np.ndarray, bool]) -> Section:
        """Lay a group out: every variable in its order, the signals with all their chunks."""
        experiment, rows, recorded = part
        layout = archive_layout.layout(experiment, len(rows), recorded)
        for name, value in layout.attributes.items():
            group.attrs[name] = value
        made = {variable.name: _make(group, layout, variable) for variable in layout.variables}
        for variable in layout.role("dimension"):
            made[variable.name].make_scale(variable.name)
        for variable in layout.variables:
            if variable.role != "dimension":
                for axis, dim in enumerate(variable.dims):
                    made[variable.name].dims[axis].attach_scale(made[dim])
        signals = {variable.key: made[variable.name] for variable in layout.role("signal")}
        section = Section(experiment, rows, recorded, layout, group, signals)
        kinds = {"float64": np.float64, "int64": np.int64, "int8": np.int8, "str": object}
        for variable in layout.variables:
            if variable.role not in ("signal", "dimension"):
                section.values[variable.name] = np.zeros(layout.shape(variable), kinds[variable.kind])
        return section

    def _write_cases(self, section: Section) -> None:
        """Everything that is not a signal."""
        experiment, values = section.experiment, section.values
        schedule = experiment.structure.schedule
        values["case_id"][:] = keys.case_ids(experiment, section.rows)
        values["case_key"][:] = keys.case_keys(experiment, section.rows)
        values["seed"][:] = keys.case_seeds(experiment, section.rows)
        if experiment.cases.repeats is not None:
            values["repeat"][:] = experiment.cases.repeats[section.rows]
        for choice, variable in zip(experiment.cases.choices, section.layout.role("choice"), strict=True):
            values[variable.name][:] = choice.value
        values["case"] = experiment.cases.table[section.rows]
        values["requirement"] = np.array([r.text for r in experiment.requirements], dtype=object)
        for variable in section.layout.role("recorded"):
            values[variable.name] = values[variable.source]
        if section.recorded:
            values["recorded_case"] = values["case"]
            values["time"] = np.arange(schedule.rows) * schedule.record / schedule.base_hz
            for along in (archive_layout.joint_dimensions(experiment), archive_layout.component_dimensions(experiment)):
                for names, dim in along.items():
                    values[dim] = np.array(names, dtype=object)
        for variable in section.layout.variables:
            if variable.role != "signal":
                section.group[variable.name][...] = values[variable.name]

    def _write_provenance(self) -> None:
        """The deck, the plan and the versions that made the numbers."""
        group = self._file.create_group("provenance", track_order=True)
        commit, changed = self._revision.read()
        versions = {"met": _met_version(), "llvmlite": version("llvmlite"), "numpy": np.__version__}
        for name, value in versions.items():
            group.attrs[f"version_{name}"] = value
        group.attrs["git_commit"] = commit
        group.attrs["git_dirty"] = changed
        group.attrs["defines"] = " ".join(self.plan.defines)

        tables: dict[str, np.ndarray] = {}

        def refer(experiment: Experiment, index: int) -> dict[str, Any]:
            name = f"cases.{experiment.name}"
            table = tables.setdefault(name, plan_file.table(experiment))
            return {"file": name, "row": index, "sha256": hashlib.sha256(table.tobytes()).hexdigest()}

        text = h5py().string_dtype("utf-8")
        sources = {"source": "name", "source_text": "text", "source_sha256": "sha256"}
        count = len(self.plan.sources)
        if count:
            for name, attribute in sources.items():
                dataset = group.create_dataset(name, (count,), dtype=text, track_order=True)
                dataset[...] = np.array(
                    [_text(getattr(source, attribute)) for source in self.plan.sources], dtype=object
                )
            group["source"].make_scale("source")
            for name in list(sources)[1:]:
                group[name].dims[0].attach_scale(group["source"])
        group.create_dataset("plan", data=_text(plan_file.dumps(self.plan, refer)), dtype=text, track_order=True)
        for name, table in tables.items():
            group.create_dataset(name, data=table, track_order=True)


def _make(group: Any, layout: Layout, variable: Variable) -> Any:
    """An empty variable with its attributes."""
    module = h5py()
    options: dict[str, Any] = {}
    chunks = layout.chunks(variable)
    if chunks is not None:
        early = module.h5p.create(module.h5p.DATASET_CREATE)
        early.set_alloc_time(module.h5d.ALLOC_TIME_EARLY)
        # checksums cost a second a gigabyte; without them, a flipped bit on a disk would be a result
        options = {"chunks": chunks, "dcpl": early, "fill_time": "never", "fletcher32": True}
    dtype = module.string_dtype("utf-8") if variable.kind == "str" else np.dtype(variable.kind).newbyteorder("<")
    dataset = group.create_dataset(variable.name, layout.shape(variable), dtype=dtype, track_order=True, **options)
    attributes = {"long_name": variable.long_name, "role": variable.role, **variable.attributes}
    if variable.unit:
        attributes = {"units": variable.unit, **attributes}
    for name, value in attributes.items():
        dataset.attrs[name] = value
    return dataset


def _text(text: str) -> str:
    """HDF5's strings end at a null character; a deck has none unless somebody put it there."""
    return text.replace("\0", "\N{REPLACEMENT CHARACTER}")


def _met_version() -> str:
    from met.version import VERSION

    return VERSION
