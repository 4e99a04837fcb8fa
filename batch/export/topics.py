"""The names of an MCAP file's topics and of its root frame, and the signals that have a topic."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from batch.export.picking import ExportedCase, SignalColumn
from batch.export.poses import PosedArm


def root(arms: Sequence[PosedArm]) -> str:
    """The name of the root frame: the first of these names that no link has."""
    taken = {arm.prefix + name for arm in arms for name in arm.poses}
    names = itertools.chain(("world", "base", "ground"), (f"world_{number}" for number in itertools.count(2)))
    return next(name for name in names if name not in taken)


def topic(arm: PosedArm, name: str) -> str:
    """The topic of a signal, where dots would be taken for fields: `/case7/elbow/servo/voltage`."""
    return f"/{arm.prefix}{name.replace('.', '/')}"


def signals(case: ExportedCase) -> dict[str, list[SignalColumn]]:
    """The columns of a case, by signal."""
    out: dict[str, list[SignalColumn]] = {}
    for column in case.columns:
        out.setdefault(column.variable, []).append(column)
    return out
