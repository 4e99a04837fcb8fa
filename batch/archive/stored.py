"""The unchecked contents of an archive: a variable as it is stored, and the interface of a group of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

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
