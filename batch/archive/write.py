"""Writing an archive, some cases at a time, so that the bytes do not depend on how they were run.

All of a signal's chunks are allocated when the file is laid out, so signals only fill them in, in any order; what is
one value a case comes in order, in blocks of one size. No times are kept. The file has a temporary name in the same
folder until it is whole and on the disk.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from batch.archive import layout as archive_layout
from batch.archive import verified
from batch.archive.hdf5 import LIBVER, h5py
from batch.archive.layout import AT_LIMIT, EXCESS, EXTREME_AT, GRAPPLE, Layout, Variable
from batch.archive.provenance import Revision, version
from batch.archive.searched import GENERATION
from batch.archive.sink import Sink
from met import backends
from met.frozen import frozen
from met.plan import Experiment, Plan, keys, recipes
from met.plan import file as plan_file
from met.plan.columns import CaseValues
from met.plan.swept import blocks
from met.plan.uses import packages

if TYPE_CHECKING:
    from met.run import Run

KINDS = {"float64": np.float64, "float32": np.float32, "int64": np.int64, "int8": np.int8, "str": object}


@frozen
class ArchivePart:
    """One experiment of an archive. rows: of its case table, rising; kept: places among them of the cases whose
    histories are here; single: as numbers of four bytes.

    code     key of the program (`met.run.Prepared.code_key`)
    results  keys of what metrics and signals compute beyond the state (`met.run.Prepared.result_keys`)
    until_shown  the most cases of a design point, of which the rows are those up to the one that decided what is
                 required; 0 where the rows were chosen otherwise
    """

    experiment: Experiment
    rows: CaseValues
    kept: np.ndarray
    single: bool = False
    code: str = ""
    results: Mapping[str, str] = field(default_factory=dict)
    until_shown: int = 0


@frozen
class OpenGroup:
    """A part on its way into the file, and the variables along recorded_case, which are gathered from the cases."""

    part: ArchivePart
    layout: Layout
    node: Any
    gathered: dict[str, np.ndarray]


class ArchiveWriter:
    """An archive being written: `put_cases` in order, `put_signals` in any, then `finish`; or `abandon`, which leaves
    nothing."""

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

    def put_signals(self, number: int, first: int, run: Run, kept: np.ndarray | None = None) -> None:
        """The histories of some cases of an experiment: of its recorded cases from the `first` one on. kept: a mask of
        those of `run` that are recorded; None: all."""
        group = self.groups[number]
        last = first + (len(run.case) if kept is None else int(kept.sum()))
        for variable in group.layout.role("signal"):
            values = run.signals[variable.key]
            group.node[variable.name][first:last] = values if kept is None else values[kept]
        self._sink.check()

    def put_cases(self, number: int, first: int, run: Run) -> None:
        """Write the variables along `case` for the cases of an experiment from its `first` one on."""
        group = self.groups[number]
        values = _values(group, run)
        for variable in group.layout.variables:
            if variable.dims[0] == "case":
                group.node[variable.name][first : first + len(run.case)] = values[variable.name]
        here = (group.part.kept >= first) & (group.part.kept < first + len(run.case))
        for name, gathered in group.gathered.items():
            gathered[here] = values[name][group.part.kept[here] - first]
        self._sink.check()

    def look_back(self, number: int) -> None:
        """Read what was put of an experiment's cases, its status and its metrics, a bounded number of cases at a time.

        Nothing comes of it but where HDF5 puts what it keeps for itself, which archives have always had after this.
        """
        group = self.groups[number]
        for each in [*(each.name for each in group.layout.role("metric")), "status"]:
            stored = group.node[each]
            for rows in blocks(len(stored)):
                stored[rows]

    def put_verified(self, number: int, found: verified.Verified) -> None:
        """Write the metrics that shorter steps gave for some cases of an experiment, in a group of its own."""
        verified.write(self.groups[number].node, found)
        self._sink.check()

    def finish(self) -> None:
        """Write what is left, and see the file safely on the disk under its temporary name, still locked."""
        for group in self.groups:
            _write_rest(group)
        self._write_provenance()
        self._file.close()
        self._sink.settle()

    @property
    def failure(self) -> OSError | None:
        """The first error of the disk, whatever HDF5 made of it; None for none."""
        return self._sink.failure

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

    def _nodes(self) -> list[Any]:
        root = self._file
        root.attrs["schema"] = archive_layout.SCHEMA
        root.attrs["schema_version"] = archive_layout.VERSION
        root.attrs["deck"] = self.plan.deck
        paths = archive_layout.group_names(self.plan)
        return [root if path == "/" else root.create_group(path, track_order=True) for path in paths]

    def _group(self, node: Any, part: ArchivePart) -> OpenGroup:
        """Lay a group out: every variable in its order, the signals with all their chunks."""
        layout = archive_layout.layout(part.experiment, len(part.rows), len(part.kept), part.single)
        early = {"until_shown": part.until_shown} if part.until_shown else {}
        for name, value in {**layout.attributes, **early, "code_key": part.code}.items():
            node.attrs[name] = value
        made = {variable.name: _make(node, layout, variable) for variable in layout.variables}
        for variable in layout.variables:
            kind = {"metric": "metrics", "signal": "record"}.get(variable.role)
            key = part.results.get(f"{kind}.{variable.key}")
            if key is not None:
                made[variable.name].attrs["code_key"] = key
        for variable in layout.role("dimension"):
            made[variable.name].make_scale(variable.name)
        for variable in layout.variables:
            if variable.role != "dimension":
                for axis, dim in enumerate(variable.dims):
                    made[variable.name].dims[axis].attach_scale(made[dim])
        gathered = {
            variable.source: np.empty(len(part.kept), KINDS[variable.kind]) for variable in layout.role("recorded")
        }
        return OpenGroup(part, layout, node, gathered)

    def _write_provenance(self) -> None:
        """The deck, the plan and the versions that made the numbers."""
        group = self._file.create_group("provenance", track_order=True)
        commit, changed = self._revision.read()
        versions = {"met": _met_version(), **backends.find().libraries(), "numpy": np.__version__}
        versions |= {name: version(name) for name in packages(e.structure for e in self.plan.experiments)}
        for name, value in versions.items():
            group.attrs[f"version_{name}"] = value
        group.attrs["git_commit"] = commit
        group.attrs["git_dirty"] = changed
        group.attrs["defines"] = " ".join(self.plan.defines)

        tables: dict[str, tuple[Experiment, str]] = {}
        arrays: dict[str, np.ndarray] = {}
        keepers: dict[str, recipes.ArrayKeeper] = {}

        def refer(experiment: Experiment, index: int) -> Any:
            name = f"cases.{experiment.name}"
            if experiment.cases.count <= plan_file.TABLE_ROWS:
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


def _values(group: OpenGroup, run: Run) -> dict[str, Any]:
    """Everything that is one value a case, of some cases, by the variable's name."""
    experiment, rows = group.part.experiment, run.case
    names = keys.case_keys(experiment, rows)
    values: dict[str, Any] = {
        "case": experiment.cases.table[rows],
        "case_key": names,
        "case_id": keys.case_ids(experiment, rows, names),
        "seed": keys.case_seeds(experiment, rows),
        "repeat": 0 if experiment.cases.repeats is None else experiment.cases.repeats[rows],
        **({} if experiment.search is None else {GENERATION: experiment.search.generation_of(rows)}),
        "status": run.status,
        "cause": run.cause,
        "warning": run.warning,
        "n_valid": run.n_valid,
        "bed_limited": run.limited,
        **{f"friction_{name}": count for name, count in run.events.items()},
        **{variable.name: run.coordinates[variable.key] for variable in group.layout.role("coordinate")},
        **{variable.name: run.metrics[variable.key] for variable in group.layout.role("metric")},
        **{AT_LIMIT + path: share for path, share in run.at_limit.items()},
        **{EXCESS + path: most for path, most in run.excess.items()},
        **{EXTREME_AT + metric: number for metric, number in run.extreme_at.items()},
        **{GRAPPLE + of: figure for of, figure in run.grapples.items()},
    }
    for role in ("limit", "excess", "extreme", "grapple"):  # by the name that is free
        values |= {variable.name: values[variable.key] for variable in group.layout.role(role)}
    for choice, variable in zip(experiment.cases.choices, group.layout.role("choice"), strict=True):
        values[variable.name] = [choice.value] * len(rows)
    for name in ("case_id", "case_key", "cause", "warning"):
        values[name] = np.array(values[name], dtype=object)
    met = np.empty((len(rows), len(experiment.requirements)), np.int8)
    for index, requirement in enumerate(experiment.requirements):
        unknown = (run.status != 0) | np.isnan(run.metrics[requirement.metric])
        met[:, index] = np.where(unknown, -1, run.met[requirement.text])
    values["met"] = met
    return values


def _write_rest(group: OpenGroup) -> None:
    """Write the dimensions, and the variables that identify a case along recorded_case."""
    part, layout = group.part, group.layout
    schedule = part.experiment.structure.schedule
    values: dict[str, Any] = {variable.name: group.gathered[variable.source] for variable in layout.role("recorded")}
    values["requirement"] = np.array([r.text for r in part.experiment.requirements], dtype=object)
    values["recorded_case"] = part.experiment.cases.table[part.rows[part.kept]]
    values["time"] = np.arange(schedule.rows) * schedule.record / schedule.base_hz
    for dimensions in (archive_layout.joint_dimensions, archive_layout.component_dimensions):
        values |= {dim: np.array(names, dtype=object) for names, dim in dimensions(part.experiment).items()}
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
