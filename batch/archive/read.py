"""Reading an archive without xarray: fast to start, for `met show`, `met plot` and readers of single values."""

from __future__ import annotations

import errno
import hashlib
import shlex
from binascii import unhexlify
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from batch.archive import plain, sound, summarised, verified
from batch.archive.hdf5 import SIGNATURE, h5py
from batch.archive.layout import SCHEMA, VERSION
from batch.archive.rows import row_of
from batch.archive.stored import Stored, Unlike
from met.diagnostic import Problem, error
from met.distinct import distinct
from met.host.files import open_regular
from met.host.sources import ARCHIVES
from met.plan import Plan
from met.plan.columns import are_among, blocks


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turn every error of HDF5 and h5py over damaged bytes into Problem E302."""
    try:
        yield
    except (OSError, LookupError, ValueError, TypeError, AttributeError, RuntimeError, ArithmeticError) as reason:
        raise Problem(_damaged(path, str(reason) if isinstance(reason, Unlike) else "")) from reason


FEW = 100
"""Largest number of values that are read one by one."""


class ArchiveGroup:
    """One experiment of an archive. Raises Problem E302 where the file does not match the format."""

    def __init__(self, node: Any, path: Path) -> None:
        self._node, self.path = node, path
        with reading(path):
            self.attributes: dict[str, Any] = {name: _plain(value) for name, value in node.attrs.items()}
            sound.check(self)
            self.verified = verified.read(node, self)
            self.step_errors = tuple(verified.read_limits(self))
            self.summary = summarised.read(node, self)
        self.summed: summarised.CaseSummary | None = None
        """The summary of all cases, once computed from their rows (batch/queries/tallies.py)."""
        self.name: str = self.attributes["experiment"]
        self.sweep: str = str(self.attributes.get("sweep", ""))

    @property
    def allowed(self) -> tuple[str, ...]:
        """Warnings that were allowed, a line each: `D105, because the report's own rates`."""
        return tuple(filter(None, str(self.attributes.get("allowed", "")).split("\n")))

    def allows(self, code: str) -> bool:
        """Return True if a warning with this code was allowed."""
        return any(allowance.startswith(f"{code},") for allowance in self.allowed)

    @cached_property
    def variables(self) -> dict[str, Stored]:
        """All variables, in the file's order."""
        with reading(self.path):
            return {name: _stored(name, node) for name, node in self._node.items() if isinstance(node, h5py().Dataset)}

    @property
    def single(self) -> bool:
        """True if histories are kept in single precision."""
        with reading(self.path):
            return any(self._node[variable.name].dtype.itemsize == 4 for variable in self.role("signal"))

    def role(self, role: str) -> tuple[Stored, ...]:
        return tuple(variable for variable in self.variables.values() if variable.role == role)

    def shape(self, name: str) -> tuple[int, ...]:
        """Sizes of a variable along its dimensions."""
        return tuple(self._node[name].shape)

    def type(self, name: str) -> str:
        """A variable's type in numpy's notation: `<f8`; `|O` for strings."""
        return str(self._node[name].dtype.str)

    def values(self, name: str) -> np.ndarray:
        """All of a variable; strings as an array of str."""
        with reading(self.path):
            return np.asarray(_decoding(self._node[name])[...])

    def at(self, name: str, positions: Sequence[int] | np.ndarray) -> np.ndarray:
        """A variable in the cases at these positions, in their order; if they are few of many, each is read alone."""
        if len(positions) > FEW:
            return self.values(name)[positions]
        with reading(self.path):
            dataset = self._node[name]
            read = _decoding(dataset)
            kind = dataset.dtype if read is dataset else object
            return np.array([read[int(position)] for position in positions], dtype=kind)

    def stretch(self, name: str, first: int, last: int) -> np.ndarray:
        """A variable in the cases at positions `first` to `last` (exclusive); strings as an array of str."""
        with reading(self.path):
            return np.asarray(_decoding(self._node[name])[first:last])

    def digests(self, name: str, first: int, last: int) -> np.ndarray:
        """Digests of some cases as whole numbers of 64 bits."""
        with reading(self.path):
            words = np.asarray(self._node[name][first:last]).astype("S")
            try:
                numbers = np.frombuffer(unhexlify(words.tobytes()), ">u8")
            except ValueError:
                numbers = np.empty(0)
            if len(numbers) != len(words):
                raise Unlike(f"variable `{name}` is not of digests")
            return numbers.astype(np.uint64)

    def signal(self, name: str, position: int) -> np.ndarray:
        """History of one signal in the case at this position, which must have one: (time,), then joints, then
        components."""
        with reading(self.path):
            return np.asarray(self._node[name][int(np.searchsorted(self.recorded_positions, position))])

    def histories(self, name: str, places: np.ndarray) -> np.ndarray:
        """One signal in the recorded cases at these places along recorded_case, in their order: (case, time), then
        joints, then components. Neighbours are read at once."""
        with reading(self.path):
            dataset = self._node[name]
            ends = [0, *(np.flatnonzero(np.diff(places) != 1) + 1).tolist(), len(places)]
            parts = [dataset[places[first] : places[last - 1] + 1] for first, last in pairwise(ends)]
            return np.asarray(parts[0] if len(parts) == 1 else np.concatenate(parts))

    @cached_property
    def recorded_positions(self) -> np.ndarray:
        """Positions of the cases whose histories are in the archive, ascending."""
        if not self.recorded:
            return np.empty(0, np.int64)
        return np.searchsorted(self.values("case"), self.values("recorded_case"))

    def recorded_position(self, wanted: str) -> int:
        """Position of a case, named as for `find_case`, whose history is in the archive. Raises Problem E328 for
        another."""
        position = self.find_case(wanted)
        if position not in self.recorded_positions:
            case = self.values("case")[position]
            helps = (
                f"`met run {shlex.quote(str(self.path))} --case '#{case}'` runs it again, to the same bits, into "
                "an archive of its own"
            )
            raise Problem(error("E328", f"no history of case #{case} of `{self.name}` was kept", help=helps))
        return position

    def joints(self, variable: Stored) -> tuple[str, ...]:
        """Names along a signal's joint dimension; none where it has no such dimension."""
        return self._along(variable.dims[2:3]) if variable.of_joints else ()

    def components(self, variable: Stored) -> tuple[str, ...]:
        """Names of a signal's components; none for a signal that is not a vector."""
        return self._along(variable.dims[3:4] if variable.of_joints else variable.dims[2:3])

    def _along(self, dims: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(map(str, self.values(dims[0]))) if dims else ()

    @property
    def count(self) -> int:
        return int(self._node["case"].shape[0])

    @property
    def run(self) -> int:
        """The number of cases that were run: those of a summary, or all that have a row."""
        return self.count if self.summary is None else self.summary.cases

    @property
    def recorded(self) -> int:
        """The number of cases whose histories are kept."""
        return int(self._node["recorded_case"].shape[0]) if "recorded_case" in self._node else 0

    def coordinates_of(self, position: int) -> dict[str, tuple[float, str]]:
        """The varied parameters of the case at this position in the deck's units: path -> (value, unit)."""
        out = {}
        for variable in self.role("coordinate"):
            scale = float(variable.attributes.get("deck_scale", 1.0))
            unit = str(variable.attributes.get("deck_unit", variable.unit))
            out[variable.path] = (float(self.values(variable.name)[position]) / scale, unit)
        return out

    def position_of(self, case: int) -> int:
        """The position in this group of a case, by its position in the case table; the case must be there."""
        with reading(self.path):
            return bisect_left(range(self.count), case, key=lambda place: int(self._node["case"][place]))

    def find_case(self, wanted: str) -> int:
        """The position in this group of a case: `#7`, its row in the case table, or the beginning of its case_id."""
        row = row_of(wanted)
        ids = self.values("case_id") if row is None else np.empty(0)
        again = ""
        if self.summary is not None and row is not None and row < self.run:
            command = f"met run {shlex.quote(str(self.path))} --case '#{row}'"
            again = f"rows of few cases are kept: `{command}` runs it again"
        return int(found_cases(wanted, self.values("case"), ids, self.name, again)[0])


def found_cases(wanted: str, rows: np.ndarray, ids: np.ndarray, name: str, remedy: str = "") -> np.ndarray:
    """The places, among cases of `name`, of the case with this row, `#7`, or beginning of a case_id: one, unless
    several have this row. ids: not read for a row; remedy: a further remedy where the case is missing. Raises Problem
    E321, E322."""
    row = row_of(wanted)
    if row is not None:
        places = np.flatnonzero(rows == row)
    else:
        places = np.flatnonzero([case_id.startswith(wanted) for case_id in ids])
    if len(places) == 0:
        helps = [_cases_here(distinct(rows)), *([remedy] if remedy else [])]
        raise Problem(error("E321", f"no case `{wanted}` in `{name}`", help=helps))
    if row is None and len(places) > 1:
        some = ", ".join(ids[places[:4]]) + (" ..." if len(places) > 4 else "")
        raise Problem(error("E322", f"case `{wanted}` may be any of {len(places)}: {some}", help="give more of its id"))
    return places


def _cases_here(rows: np.ndarray) -> str:
    """The text that says which cases an archive has: all of a table, or some of it."""
    if not len(rows):
        return "there is no case here"
    if len(rows) == 1:
        return f"the only case here is #{rows[0]}"
    if rows[-1] - rows[0] == len(rows) - 1:
        return f"cases here: #{rows[0]} to #{rows[-1]}; or the beginning of a case_id"
    some = ", ".join(f"#{row}" for row in rows[:8]) + (f" ... #{rows[-1]}" if len(rows) > 8 else "")
    return f"cases here: {some}; or the beginning of a case_id"


class ArchiveFile:
    """An open archive, to be used in a `with`. Raises Problem E301 (no such file), E302 (no archive), E303 (newer)."""

    def __init__(self, path: str | Path) -> None:
        """Open the file, and check its signature, references, schema and groups before any value is given out."""
        self.path = Path(path)
        self._arithmetic = np.errstate(over="ignore", invalid="ignore")
        check_signature(self.path)
        with reading(self.path):
            self._file = h5py().File(self.path, "r")
        try:
            with reading(self.path):
                plain.check(self._file, self.path)
                attributes = {name: _plain(value) for name, value in self._file.attrs.items()}
                self._check(attributes)
                self.deck: str = attributes["deck"]
                self.groups: tuple[ArchiveGroup, ...] = self._groups()
        except BaseException:
            self._file.close()
            raise

    def _check(self, attributes: dict[str, Any]) -> None:
        """Check that the file is an archive that this MET can read. Raises Problem E302, E303, or Unlike."""
        if attributes.get("schema") != SCHEMA:
            raise Problem(error("E302", f"{self.path} is an HDF5 file, but no archive of MET"))
        version = attributes.get("schema_version")
        if type(version) is not int or version < 1:
            raise Unlike("it has no schema version")
        if version > VERSION:
            message = f"{self.path} was written by a newer MET: schema {version}, known here is {VERSION}"
            raise Problem(error("E303", message, help="update MET; xarray can open the file meanwhile"))
        if not isinstance(attributes.get("deck"), str):
            raise Unlike("it does not name its deck")
        if not isinstance(self._file.get("provenance"), h5py().Group):
            raise Unlike("it does not say where it comes from")

    def __enter__(self) -> ArchiveFile:
        """Open the archive. Its numbers may be as large as doubles are: overflows give infinity without a warning."""
        self._arithmetic.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self._arithmetic.__exit__(None, None, None)
        self._file.close()

    def _groups(self) -> tuple[ArchiveGroup, ...]:
        """The experiments, in the plan's order."""
        if "experiment" in self._file.attrs:
            return (ArchiveGroup(self._file, self.path),)
        nodes = [node for node in self._file.values() if node.name != "/provenance"]
        if not nodes:
            raise Unlike("it holds no run and no sweep")
        groups = tuple(ArchiveGroup(node, self.path) for node in nodes)
        if len({group.name for group in groups}) < len(groups):
            raise Unlike("it holds two runs of one name")
        return groups

    def need_every_row(self, what: str) -> None:
        """Refuse an operation that needs all cases where an archive keeps only a summary of them. Raises Problem
        E330."""
        for group in self.groups:
            if group.summary is not None:
                message = f"{what} needs a row a case, and {self.path} keeps a summary of `{group.name}`"
                helps = (
                    "`met run DECK --rows all` keeps a row a case, and `--rows worst:N:METRIC` a summary with the rows "
                    "of the N cases that are worst in METRIC",
                    f"`met show {shlex.quote(str(self.path))}` says what the summary holds, and `--evidence` the "
                    "table of requirements",
                )
                raise Problem(error("E330", message, help=helps))

    @property
    def provenance(self) -> dict[str, Any]:
        """Versions, git commit, whether MET's source was changed, and defines."""
        with reading(self.path):
            return {name: _plain(value) for name, value in self._file["provenance"].attrs.items()}

    def sources(self) -> dict[str, str]:
        """The deck's files as they were read, by name."""
        with reading(self.path):
            node = self._file["provenance"]
            if "source" not in node:
                return {}
            names, texts = node["source"].asstr()[...], node["source_text"].asstr()[...]
            if names.ndim != 1 or names.shape != texts.shape:
                raise Unlike("its sources are not a text each")
            return dict(zip(names.tolist(), texts.tolist(), strict=True))

    def plan(self, *, as_written: bool = False) -> Plan:
        """The whole plan that was run. as_written: for display only (met.plan.file.loads)"""
        from met.plan import file as plan_file
        from met.plan.codec import Damaged

        def find(reference: dict[str, Any]) -> np.ndarray:
            array = np.asarray(node[reference["file"]][...])
            if hashlib.sha256(array.tobytes()).hexdigest() != reference["sha256"]:
                raise Damaged("", "its case table is not the one it was written with (SHA-256 differs)")
            return array

        with reading(self.path):
            node = self._file["provenance"]
            text, fetch = node["plan"].asstr()[()], plan_file.fetcher(find)
            plan = plan_file.loads(text, str(self.path), fetch, as_written=as_written)
            self._check_plan(plan)
            return plan

    def _check_plan(self, plan: Plan) -> None:
        """Check that the plan matches the groups: the same experiments, cases and varied parameters."""
        known = {experiment.name: experiment for experiment in plan.experiments}
        if len(known) != len(plan.experiments) or known.keys() != {group.name for group in self.groups}:
            raise Unlike("its plan is of other runs than it holds")
        for group in self.groups:
            cases = known[group.name].cases
            varied = {coordinate.path for coordinate in cases.coordinates}
            if varied != {variable.path for variable in group.role("coordinate")}:
                raise Unlike(f"the plan of `{group.name}` varies something else")
            stretches = (group.stretch("case", piece.start, piece.stop) for piece in blocks(group.count))
            if not all(are_among(cases.table, numbers).all() for numbers in stretches):
                raise Unlike(f"the plan of `{group.name}` has not its cases")


WRITTEN = "archives are written by `met run DECK`"
IN_A_FILE = "an archive is read from a file: save it as NAME.h5 first"


def check_signature(path: Path) -> None:
    """Refuse a file that is not an HDF5 file at all, with a clear message."""
    try:
        with open_regular(path) as file:
            begins = file.read(len(SIGNATURE))
    except OSError as reason:
        why = (reason.strerror or str(reason)).lower()
        deck = f"`met run {path}` writes one" if path.suffix == ".ic" else WRITTEN
        helps: str | tuple[()] = IN_A_FILE if reason.errno == errno.EINVAL else ()
        if isinstance(reason, FileNotFoundError):
            helps = deck
        elif isinstance(reason, IsADirectoryError):
            inside = sorted(
                inside_path.name
                for inside_path in path.iterdir()
                if inside_path.suffix in ARCHIVES and inside_path.name.isprintable()
            )
            helps = f"archives in it: {', '.join(inside[:8])}" if inside else "there is no archive in it"
        raise Problem(error("E301", f"cannot read the archive {path}: {why}", help=helps)) from reason
    if begins != SIGNATURE:
        helps = f"`met run {path}` runs a deck into one" if path.suffix == ".ic" else WRITTEN
        raise Problem(error("E302", f"{path} is no archive of MET: it is not an HDF5 file", help=helps))


HEAD_BYTES = 4096
"""The schema's name is the first text that is written: it lies this near the head of the file."""


def is_archive(path: Path) -> bool:
    """True if a file is an archive of MET, sound or damaged, which may be overwritten.

    HDF5 does not open it, since it may hang on a damaged file.
    """
    with open_regular(path) as file:
        head = file.read(HEAD_BYTES)
    return head.startswith(SIGNATURE) and SCHEMA.encode() in head


def _damaged(path: Path, why: str = "") -> Any:
    helps = "an archive that MET writes has its name only when it is whole: was this one copied in part?"
    return error("E302", f"the archive {path} is damaged" + (f": {why}" if why else ""), help=helps)


def _stored(name: str, node: Any) -> Stored:
    """A variable of a group as it is described in the file. Raises Unlike where its role is no word."""
    attributes = {key: _plain(node.attrs[key]) for key in node.attrs if key not in INTERNAL}
    if node.is_scale:
        dims: tuple[str, ...] = (name,)
    else:
        dims = tuple(axis[0].name.rpartition("/")[2] if len(axis) else "" for axis in node.dims)
    by_joint = attributes.pop("units_by_joint", ())
    role = attributes.pop("role", "")
    if not isinstance(role, str):
        raise Unlike(f"variable `{name}` has a role that is no word")
    by_joint = by_joint if isinstance(by_joint, list) else [by_joint] if by_joint else []
    return Stored(
        name,
        dims,
        role,
        str(attributes.pop("units", "")),
        tuple(map(str, by_joint)),
        str(attributes.pop("long_name", "")),
        attributes,
    )


def _decoding(dataset: Any) -> Any:
    """A dataset to read values from: one of strings gives them as an array of str."""
    return dataset if h5py().check_string_dtype(dataset.dtype) is None else dataset.asstr()


INTERNAL = frozenset({"DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME", "_Netcdf4Dimid", "_Netcdf4Coordinates"})


def _plain(value: Any) -> Any:
    """An attribute as Python's own type."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return [_plain(part) for part in value.tolist()]
    if isinstance(value, h5py().Empty):
        return ""
    return value
