"""The unchecked contents of an archive: a variable as it is stored, and the interface of a group of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from batch.archive.hdf5 import h5py, put_attributes
from met.frozen import frozen


class Unlike(ValueError):
    """Raised where an archive lacks a part that all archives have; the message names it."""


@frozen
class Stored:
    """One variable as it is stored in the file."""

    name: str
    dims: tuple[str, ...]
    role: str
    unit: str
    units_by_joint: tuple[str, ...]
    long_name: str
    attributes: dict[str, Any]

    @property
    def path(self) -> str:
        """A coordinate's path in the deck, which is its name unless that was taken."""
        return str(self.attributes.get("path", self.name))

    @property
    def springs(self) -> tuple[str, ...]:
        """The joints of a signal at which booms bend, which are drawn only where they are asked for."""
        return tuple(str(joint) for joint in np.atleast_1d(self.attributes.get("springs", ())))

    @property
    def of_joints(self) -> bool:
        """True if a signal's third dimension holds joints."""
        return any(dim == "joint" or dim.startswith("joint_of_") for dim in self.dims[2:3])


class StoredGroup(Protocol):
    """One experiment's group of an archive, before it is fully checked: `batch.archive.read.ArchiveGroup` is one."""

    attributes: dict[str, Any]

    @property
    def variables(self) -> Mapping[str, Stored]:
        """All variables, in the file's order."""

    def role(self, role: str) -> tuple[Stored, ...]:
        """The variables with this role: `coordinate`, `metric`, `signal` ..."""

    def shape(self, name: str) -> tuple[int, ...]:
        """Sizes of a variable along its dimensions."""

    def type(self, name: str) -> str:
        """A variable's type in numpy's notation: `<f8`; `|O` for strings."""

    def values(self, name: str) -> np.ndarray:
        """All of a variable; strings as an array of str."""

    def stretch(self, name: str, first: int, last: int) -> np.ndarray:
        """A variable in the cases at positions `first` to `last` (exclusive)."""


COUNT, NUMBER, WORDS = "<i8", "<f8", "|O"
"""Types of variables in numpy's notation."""

Declared = Mapping[str, tuple[tuple[str, ...], str, str]]
"""Dimensions, type and meaning of each variable, by its name. A dimension is a variable of one dimension: itself."""


def write(node: Any, declared: Declared, values: Mapping[str, np.ndarray]) -> None:
    """Write the variables into a group of an open file, their dimensions as scales."""
    scales = dimensions(declared)
    for name, (_, kind, words) in declared.items():
        dtype = h5py().string_dtype("utf-8") if kind == WORDS else kind
        dataset = node.create_dataset(name, data=values[name], dtype=dtype, track_order=True)
        put_attributes(dataset, {"long_name": words})
    for name in scales:
        node[name].make_scale(name)
    for name, (dims, _, _) in declared.items():
        if name not in scales:
            for axis, dim in enumerate(dims):
                node[name].dims[axis].attach_scale(node[dim])


def read(node: Any, declared: Declared, group: str) -> dict[str, np.ndarray]:
    """The variables of a group, checked against the declaration; `group` is its name, for messages. Raises Unlike."""
    values = {name: _values(node, name, declared, group) for name in declared}
    sizes = {dim: len(values[dim]) for dim in dimensions(declared)}
    for name, (dims, _, _) in declared.items():
        if values[name].shape != tuple(sizes[dim] for dim in dims):
            raise Unlike(f"variable `{group}/{name}` is not of the size of its dimensions")
    return values


def dimensions(declared: Declared) -> Sequence[str]:
    """The names of the variables that are dimensions, in the order of declaration."""
    return [name for name, (dims, _, _) in declared.items() if dims == (name,)]


def _values(node: Any, name: str, declared: Declared, group: str) -> np.ndarray:
    """The values of a declared variable of a group. Raises Unlike where it is missing or of another type or size."""
    dims, kind, _ = declared[name]
    dataset = node.get(name)
    if not isinstance(dataset, h5py().Dataset) or str(dataset.dtype.str) != kind:
        raise Unlike(f"variable `{group}/{name}` is missing or of another type")
    if len(dataset.shape) != len(dims):
        raise Unlike(f"variable `{group}/{name}` is not of the size of its dimensions")
    if kind == WORDS:
        if h5py().check_string_dtype(dataset.dtype) is None:
            raise Unlike(f"variable `{group}/{name}` is missing or of another type")
        return np.asarray(dataset.asstr()[...], dtype=object)
    return np.asarray(dataset[...])
