"""The data of a page for running cases again."""

from __future__ import annotations

from typing import Any

import numpy as np

from batch.arms.drawn import DrawnArm
from met.frozen import frozen


@frozen
class SimulatedStructure:
    """A structure whose cases the page can run again.

    code, description  its module, and what is known of it (`batch.modules.description.described`)
    same_code          whether it is the code that the archive was made with
    cases              numbers of those that it can be run for;  inputs: theirs, (case, input);  status: in the archive
    metrics            what the archive has of them, by the variable's name, in the order of the module's metrics
    before             what the other archive has of these cases, numbered as here, where one is compared with;  None
                       without
    panels             for each panel of `Signals` the module's column of each line, -1 where there is none
    arm                as the page draws it
    """

    code: bytes
    description: dict[str, Any]
    same_code: bool
    cases: np.ndarray
    inputs: np.ndarray
    metrics: tuple[tuple[str, np.ndarray], ...]
    status: np.ndarray
    panels: tuple[tuple[int, ...], ...]
    arm: DrawnArm
    before: SimulatedStructure | None = None


@frozen
class PageSimulation:
    """The structures whose cases a page can run again. notes: text about omitted ones"""

    structures: tuple[SimulatedStructure, ...]
    notes: tuple[str, ...]
