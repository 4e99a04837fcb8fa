"""Reading an archive without xarray: fast to start, for `met show`, `met plot` and whoever needs single values."""

from __future__ import annotations

import hashlib
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from batch.archive.hdf5 import SIGNATURE, h5py
from batch.archive.layout import SCHEMA, VERSION
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.plan import Plan


@frozen
class Stored:
    """One variable as it lies in the file."""

    name: str
    dims: tuple[str, ...]
    role: str
    unit: str
    units_by_joint: tuple[str, ...]
    long_name: str
    attributes: dict[str, Any]


class Group:
    """One experiment of an archive."""

    def __init__(self, node: Any) -> None:
        self._node = node
        self.attributes: dict[str, Any] = {name: _plain(value) for name, value in node.attrs.items()}
        self.name: str = str(self.attributes["experiment"])

    @cached_property
    def variables(self) -> dict[str, Stored]:
        """All variables, in the file's order."""
        return {name: _stored(name, node) for name, node in self._node.items() if isinstance(node, h5py().Dataset)}

    def role(self, role: str) -> tuple[Stored, ...]:
        return tuple(variable for variable in self.variables.values() if variable.role == role)

    def values(self, name: str) -> np.ndarray:
        """All of a variable; strings as an array of str."""
        dataset = self._node[name]
        if h5py().check_string_dtype(dataset.dtype) is not None:
            return np.asarray(dataset.asstr()[...], dtype=object)
        return np.asarray(dataset[...])

    def signal(self, name: str, position: int) -> np.ndarray:
        """History of one signal in the recorded case at this position: (time,) or (time, joint)."""
        return np.asarray(self._node[name][position])

    def joints(self, variable: Stored) -> tuple[str, ...]:
        """Names along a signal's joint dimension; none where it has no such dimension."""
        return tuple(self.values(variable.dims[2])) if len(variable.dims) > 2 else ()

    @property
    def count(self) -> int:
        return int(self._node["case"].shape[0])

    @property
    def recorded(self) -> int:
        """How many cases have their histories here."""
        return int(self._node["recorded_case"].shape[0]) if "recorded_case" in self._node else 0

    def coordinates_of(self, position: int) -> dict[str, tuple[float, str]]:
        """The varied parameters of the case at this position as the deck writes them: path -> (value, unit)."""
        out = {}
        for variable in self.role("coordinate"):
            scale = float(variable.attributes.get("deck_scale", 1.0))
            unit = str(variable.attributes.get("deck_unit", variable.unit))
            out[variable.name] = (float(self._node[variable.name][position]) / scale, unit)
        return out

    def find_case(self, wanted: str) -> int:
        """Position in this group of a case: `#7`, its row in the case table, or the beginning of its case_id."""
        if wanted.startswith("#") and wanted[1:].isdigit():
            found = np.flatnonzero(self.values("case") == int(wanted[1:]))
        else:
            found = np.flatnonzero([case_id.startswith(wanted) for case_id in self.values("case_id")])
        if len(found) == 1:
            return int(found[0])
        if len(found) == 0:
            rows = self.values("case")
            helps = f"cases here: #{rows[0]} to #{rows[-1]}, {len(rows)} of them; or the beginning of a case_id"
            raise Problem(error("E321", f"no case `{wanted}` in `{self.name}`", help=helps))
        some = ", ".join(self.values("case_id")[found[:4]])
        raise Problem(
            error("E322", f"case `{wanted}` may be any of {len(found)}: {some} ...", help="give more of its id")
        )


class ArchiveFile:
    """An open archive; use it in a `with`. Raises Problem E301 (no such file), E302 (no archive), E303 (newer)."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        check_signature(self.path)
        try:
            self._file = h5py().File(self.path, "r")
            attributes = {name: _plain(value) for name, value in self._file.attrs.items()}
        except OSError as reason:
            helps = "an archive that MET writes has its name only when it is whole: was this one copied in part?"
            raise Problem(error("E302", f"the archive {path} is damaged", help=helps)) from reason
        if attributes.get("schema") != SCHEMA:
            self._file.close()
            raise Problem(error("E302", f"{path} is an HDF5 file, but no archive of MET"))
        if attributes["schema_version"] > VERSION:
            self._file.close()
            message = (
                f"{path} was written by a newer MET: schema {attributes['schema_version']}, known here is {VERSION}"
            )
            raise Problem(error("E303", message, help="update MET; xarray can open the file meanwhile"))
        self.deck = str(attributes["deck"])

    def __enter__(self) -> ArchiveFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """The experiments, in the plan's order."""
        if "experiment" in self._file.attrs:
            return (Group(self._file),)
        return tuple(Group(node) for node in self._file.values() if "experiment" in node.attrs)

    @property
    def provenance(self) -> dict[str, Any]:
        """Versions, git commit and whether MET's source was changed, defines."""
        return {name: _plain(value) for name, value in self._file["provenance"].attrs.items()}

    def sources(self) -> dict[str, str]:
        """The deck's files as they were read, by name."""
        node = self._file["provenance"]
        if "source" not in node:
            return {}
        names, texts = node["source"].asstr()[...], node["source_text"].asstr()[...]
        return dict(zip(names.tolist(), texts.tolist(), strict=True))

    def plan(self) -> Plan:
        """The plan that was run, whole."""
        from met import plan_file
        from met.plan_codec import Damaged

        node = self._file["provenance"]

        def fetch(reference: dict[str, Any]) -> np.ndarray:
            table = np.asarray(node[reference["file"]][...], dtype="<f8")
            if hashlib.sha256(table.tobytes()).hexdigest() != reference["sha256"]:
                raise Damaged("", "its case table is not the one it was written with (SHA-256 differs)")
            return np.asarray(table[reference["row"]])

        return plan_file.loads(node["plan"].asstr()[()], str(self.path), fetch)


def check_signature(path: Path) -> None:
    """Refuse kindly what is no HDF5 file at all."""
    try:
        with path.open("rb") as file:
            begins = file.read(len(SIGNATURE))
    except OSError as reason:
        why = (reason.strerror or str(reason)).lower()
        helps = "archives are written by `met run DECK`" if isinstance(reason, FileNotFoundError) else ()
        raise Problem(error("E301", f"cannot read the archive {path}: {why}", help=helps)) from reason
    if begins != SIGNATURE:
        raise Problem(error("E302", f"{path} is no archive of MET: it is not an HDF5 file"))


def is_archive(path: Path) -> bool:
    """Whether a file is an archive of MET: one that may be written over."""
    try:
        with ArchiveFile(path):
            return True
    except Problem:
        return False


def _stored(name: str, node: Any) -> Stored:
    attributes = {key: _plain(node.attrs[key]) for key in node.attrs if key not in INTERNAL}
    if node.is_scale:
        dims: tuple[str, ...] = (name,)
    else:
        dims = tuple(axis[0].name.rpartition("/")[2] if len(axis) else "" for axis in node.dims)
    by_joint = attributes.pop("units_by_joint", ())
    return Stored(
        name, dims, str(attributes.pop("role", "")), str(attributes.pop("units", "")), tuple(by_joint),
        str(attributes.pop("long_name", "")), attributes,
    )  # fmt: skip


INTERNAL = frozenset({"DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME", "_Netcdf4Dimid", "_Netcdf4Coordinates"})


def _plain(value: Any) -> Any:
    """An attribute as Python's own type."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return [_plain(part) for part in value.tolist()]
    return value
