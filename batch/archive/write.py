"""Writing an archive, some cases at a time, so that the bytes do not depend on how they were run.

All of a signal's chunks are allocated when the file is laid out, so signals only fill them in, in any order; variables
with one value a case come in order, in blocks of one size. No times are kept. The file has a temporary name in the same
folder until it is whole and on the disk.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np

from batch.archive import layout as archive_layout
from batch.archive import summarised, verified
from batch.archive.hdf5 import LIBVER, h5py, put_attributes
from batch.archive.layout import Layout, Variable
from batch.archive.sink import Sink
from batch.archive.values import KINDS, times_of, values_of_cases, values_of_dimensions
from met import backends
from met.frozen import frozen
from met.host.provenance import Revision, version
from met.plan import Experiment, Plan, recipes
from met.plan import file as plan_file
from met.plan.columns import LISTED_ROWS, CaseValues, blocks
from met.plan.uses import packages
from met.run import Run
from met.version import VERSION


@frozen
class ArchivePart:
    """One experiment of an archive. rows: of its case table, ascending; history_places: places among them of the cases
    whose histories are in the archive; single: as numbers of four bytes.

    code     key of the program (`met.run.Prepared.code_key`)
    results  keys of what metrics and signals compute beyond the state (`met.run.Prepared.result_keys`)
    until_shown  the most cases of a design point, of which the rows are those up to the one that decided what is
                 required; 0 where the rows were chosen otherwise
    summed       whether there is a summary of cases besides; then the plan keeps what long tables are computed from
    """

    experiment: Experiment
    rows: CaseValues
    history_places: np.ndarray
    single: bool = False
    code: str = ""
    results: Mapping[str, str] = field(default_factory=dict)
    until_shown: int = 0
    summed: bool = False


@frozen
class OpenGroup:
    """A part that is being written, with the variables along recorded_case, which are collected from the cases."""

    part: ArchivePart
    layout: Layout
    node: Any
    gathered: dict[str, np.ndarray]


class ArchiveWriter:
    """An archive being written: `put_cases` in order, `put_signals` in any order, then `finish`; or `abandon`, which
    leaves nothing. `case_values`, which prepares the argument of `put_cases`, writes nothing: any thread may call it
    beforehand."""

    def __init__(self, temporary: Path, plan: Plan, parts: Sequence[ArchivePart]) -> None:
        self.plan = plan
        self._sink = Sink(temporary)
        self._revision = Revision()
        self._file: Any = None
        try:
            self._file = h5py().File(self._sink, "w", libver=LIBVER, track_order=True)
            self.groups = [self._group(node, part) for node, part in zip(self._nodes(), parts, strict=True)]
            self._sink.check()
        except BaseException:
            self.abandon()
            raise

    def put_signals(self, number: int, first: int, run: Run, mask: np.ndarray | None = None) -> None:
        """Write the histories of some cases of an experiment: its recorded cases from the `first` one on. mask:
        the cases of `run` that are recorded; None: all"""
        group = self.groups[number]
        last = first + (len(run.case) if mask is None else int(mask.sum()))
        for variable in group.layout.role("signal"):
            values = run.signals[variable.key]
            group.node[variable.name][first:last] = values if mask is None else values[mask]
        self._sink.check()

    def case_values(self, number: int, run: Run) -> dict[str, Any]:
        """The variables along `case` of some cases of an experiment, by name."""
        group = self.groups[number]
        values = values_of_cases(group.part.experiment, group.layout, run)
        for name in ("cause", "warning"):  # mostly empty
            values[name] = np.array(values[name], dtype=object if any(values[name]) else "S1")
        return values

    def put_cases(self, number: int, first: int, values: Mapping[str, Any]) -> None:
        """Write the variables along `case` for the cases of an experiment from its `first` one on."""
        group = self.groups[number]
        last = first + len(values["case"])
        for variable in group.layout.variables:
            if variable.dims[0] == "case":
                _put(group.node[variable.name], first, last, values[variable.name])
        recorded = (group.part.history_places >= first) & (group.part.history_places < last)
        for name, gathered in group.gathered.items():
            own = values[name][group.part.history_places[recorded] - first]
            gathered[recorded] = own.astype(str) if own.dtype.kind == "S" else own
        self._sink.check()

    def look_back(self, number: int) -> None:
        """Read what was put of an experiment's cases, its status and its metrics, a bounded number of cases at a time.

        The values are not used; reading them only affects where HDF5 puts its own data, which keeps the bytes of
        archives unchanged.
        """
        group = self.groups[number]
        for variable_name in [*(variable.name for variable in group.layout.role("metric")), "status"]:
            stored = group.node[variable_name]
            for rows in blocks(len(stored)):
                stored[rows]

    def put_verified(self, number: int, verified_metrics: verified.Verified) -> None:
        """Write the metrics from shorter steps for some cases of an experiment, in a group of its own."""
        verified.write(self.groups[number].node, verified_metrics)
        self._sink.check()

    def put_summary(self, number: int, summary: summarised.CaseSummary) -> None:
        """Write the summary of all cases of an experiment, in a group of its own."""
        summarised.write(self.groups[number].node, summary)
        self._sink.check()

    def finish(self) -> None:
        """Write the rest, and flush the file to the disk under its temporary name, still locked."""
        for group in self.groups:
            _write_rest(group)
        self._write_provenance()
        self._file.close()
        self._sink.settle()

    @property
    def failure(self) -> OSError | None:
        """The first error of the disk, regardless of HDF5; None if there was none."""
        return self._sink.failure

    def close(self) -> None:
        """Close the file, which has got its name."""
        self._sink.close()

    def abandon(self) -> None:
        """Close and remove the file."""
        self._revision.close()
        if self._file:
            self._file.close()
        self._sink.remove()
        self._sink.close()

    def _nodes(self) -> list[Any]:
        """Make the groups of an archive: the root alone for one experiment."""
        root = self._file
        root.attrs["schema"] = archive_layout.SCHEMA  # of variable length, so that it lies near the head (`is_archive`)
        put_attributes(root, {"schema_version": archive_layout.VERSION, "deck": self.plan.deck})
        paths = archive_layout.group_names(self.plan)
        return [root if path == "/" else root.create_group(path, track_order=True) for path in paths]

    def _group(self, node: Any, part: ArchivePart) -> OpenGroup:
        """Lay out a group: every variable in its order, the signals with all their chunks."""
        layout = archive_layout.layout(part.experiment, len(part.rows), len(part.history_places), part.single)
        early = {"until_shown": part.until_shown} if part.until_shown else {}
        put_attributes(node, {**layout.attributes, **early, "code_key": part.code})
        datasets = {variable.name: _make(node, layout, variable) for variable in layout.variables}
        for variable in layout.variables:
            put_attributes(datasets[variable.name], variable.code_key(part.results))
        for variable in layout.role("dimension"):
            datasets[variable.name].make_scale(variable.name)
        for variable in layout.variables:
            if variable.role != "dimension":
                for axis, dim in enumerate(variable.dims):
                    datasets[variable.name].dims[axis].attach_scale(datasets[dim])
        gathered = {
            variable.source: np.empty(len(part.history_places), KINDS[variable.kind])
            for variable in layout.role("recorded")
        }
        return OpenGroup(part, layout, node, gathered)

    def _write_provenance(self) -> None:
        """Write the deck, the plan and the versions that made the numbers."""
        group = self._file.create_group("provenance", track_order=True)
        commit, changed = self._revision.read()
        versions = {"met": VERSION, **backends.find().libraries(), "numpy": np.__version__}
        versions |= {name: version(name) for name in packages(e.structure for e in self.plan.experiments)}
        about = {f"version_{name}": value for name, value in versions.items()}
        put_attributes(
            group, {**about, "git_commit": commit, "git_dirty": changed, "defines": " ".join(self.plan.defines)}
        )

        summed = any(group.part.summed for group in self.groups)
        tables: dict[str, tuple[Experiment, str]] = {}
        arrays: dict[str, np.ndarray] = {}
        keepers: dict[str, recipes.ArrayKeeper] = {}

        def refer(experiment: Experiment, index: int) -> Any:
            """The reference to a column of a case table in the archive's provenance: a row of a table, or a recipe."""
            name = f"cases.{experiment.name}"
            if experiment.cases.count <= (LISTED_ROWS if summed else plan_file.TABLE_ROWS):
                if name not in tables:
                    tables[name] = experiment, _table_sum(experiment)
                return {"file": name, "row": index, "sha256": tables[name][1]}
            if name not in keepers:
                keepers[name] = recipes.ArrayKeeper(lambda n, array: put(f"{name}.{n}", array))
            return recipes.encoded(plan_file.columns(experiment)[index], keepers[name].keep)

        def put(name: str, array: np.ndarray) -> dict[str, Any]:
            arrays[name] = array
            return {"file": name, "sha256": hashlib.sha256(array.tobytes()).hexdigest()}

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
        for name, (experiment, _) in tables.items():
            shape = (len(plan_file.columns(experiment)), experiment.cases.count)
            dataset = group.create_dataset(name, shape, dtype="<f8", track_order=True)
            for column, rows, values in plan_file.table_pieces(experiment):
                dataset[column, rows] = values
        for name, array in arrays.items():
            group.create_dataset(name, data=array, track_order=True)


def _table_sum(experiment: Experiment) -> str:
    """SHA-256 of a case table's numbers."""
    summed = hashlib.sha256()
    for _, _, values in plan_file.table_pieces(experiment):
        summed.update(values.tobytes())
    return summed.hexdigest()


def _put(dataset: Any, first: int, last: int, values: Any) -> None:
    """Write a stretch of a variable. Bytes are written as the strings that they encode, in a third of the time."""
    if getattr(values, "dtype", np.dtype(object)).kind != "S":
        dataset[first:last] = values
        return
    module, space = h5py(), dataset.id.get_space()
    space.select_hyperslab((first,), (last - first,))
    dataset.id.write(module.h5s.create_simple((last - first,)), space, values, module.h5t.py_create(values.dtype))


def _write_rest(group: OpenGroup) -> None:
    """Write the dimensions, and the variables that identify a case along recorded_case."""
    part, layout = group.part, group.layout
    values: dict[str, Any] = {variable.name: group.gathered[variable.source] for variable in layout.role("recorded")}
    values |= values_of_dimensions(part.experiment)
    values["time"] = times_of(part.experiment)
    values["recorded_case"] = part.experiment.cases.table[part.rows[part.history_places]]
    for variable in layout.variables:
        if variable.role != "signal" and variable.dims[0] != "case":
            group.node[variable.name][...] = values[variable.name]


def _make(group: Any, layout: Layout, variable: Variable) -> Any:
    """An empty variable with its attributes."""
    module = h5py()
    options: dict[str, Any] = {}
    chunks = layout.chunks(variable)
    if chunks is not None:
        early = module.h5p.create(module.h5p.DATASET_CREATE)
        early.set_alloc_time(module.h5d.ALLOC_TIME_EARLY)
        # checksums cost a second a gigabyte; without them, a flipped bit on a disk would go unnoticed
        options = {"chunks": chunks, "dcpl": early, "fill_time": "never", "fletcher32": True}
    dtype = module.string_dtype("utf-8") if variable.kind == "str" else np.dtype(variable.kind).newbyteorder("<")
    dataset = group.create_dataset(variable.name, layout.shape(variable), dtype=dtype, track_order=True, **options)
    put_attributes(dataset, variable.written_attributes)
    return dataset


def _text(text: str) -> str:
    """A text without null characters, which would end HDF5's strings; decks normally have none."""
    return text.replace("\0", "\N{REPLACEMENT CHARACTER}")
