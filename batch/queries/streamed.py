"""The summary of all cases of a run or sweep: the one in its archive, or one made from its rows block by block, where
they are too many for memory."""

from __future__ import annotations

import numpy as np

from batch.archive.read import ArchiveGroup
from batch.archive.stored import Stored
from batch.archive.summarised import CaseSummary
from batch.queries.requirements import group_requirements, requirement_texts
from batch.queries.tallies import MOST_POINTS, CaseBlock, CaseTallies, PointNumbers, TooManyPoints
from met.plan.columns import blocks

MANY = 4_000_000
"""Number of rows of a run or sweep from which they are processed in blocks: with fewer, medians and an order of all are
worth half a gigabyte of memory."""

STREAMED = "streamed"
"""The word of a summary that is not stored in an archive."""


def is_streamed(group: ArchiveGroup) -> bool:
    """True where a group has a row for each case, and too many for memory."""
    return group.summary is None and group.count > MANY and not group.attributes.get("until_shown")


def summed_up(group: ArchiveGroup) -> CaseSummary | None:
    """The summary of all cases; None where their rows fit in memory, or counts alone do not suffice: for cases that
    stop by their results, and with very many design points."""
    if group.summary is None and group.summed is None and is_streamed(group):
        group.summed = _of_rows(group)
    return group.summary or group.summed


def _of_rows(group: ArchiveGroup) -> CaseSummary | None:
    """The summary of a group's rows, read in blocks; None for an older archive, or too many design points."""
    required = group_requirements(group)
    if len(required) < len(requirement_texts(group)):  # an older archive, which lacks parts of some
        return None
    coordinates = group.role("coordinate")
    repeats = any(group.stretch("repeat", p.start, p.stop).any() for p in blocks(group.count) if _repeats(group))
    drawn = any(variable.attributes.get("design") for variable in coordinates) or repeats
    chosen = [coordinate for coordinate in coordinates if not coordinate.attributes.get("design")] if drawn else []
    try:
        sizes = _sizes(group, chosen)
        points = PointNumbers()
        tallies = CaseTallies([variable.name for variable in group.role("metric")], required, sizes)
        for piece in blocks(group.count):
            tallies.add(_block(group, piece, chosen, points))
    except TooManyPoints:
        return None
    values = tallies.values(
        lambda place: int(group.at("case", [place])[0]),
        {name: name for name in tallies.metrics},
        [variable.name for variable in chosen],
        points,
    )
    return CaseSummary(group.count, tallies.limited, STREAMED, drawn, values)


def _repeats(group: ArchiveGroup) -> bool:
    return "repeat" in group.variables


def _sizes(group: ArchiveGroup, chosen: list[Stored]) -> list[int]:
    """The number of cases of each design point."""
    if not chosen:
        return [group.count]
    points, sizes = PointNumbers(), np.zeros(MOST_POINTS, np.int64)
    for piece in blocks(group.count):
        sizes += np.bincount(_points(group, piece, chosen, points), minlength=len(sizes))
    return sizes[: len(points.values)].tolist()


def _points(group: ArchiveGroup, piece: slice, chosen: list[Stored], points: PointNumbers) -> np.ndarray:
    stretches = [group.stretch(variable.name, piece.start, piece.stop) for variable in chosen]
    return points.of(stretches, piece.stop - piece.start)


def _block(group: ArchiveGroup, piece: slice, chosen: list[Stored], points: PointNumbers) -> CaseBlock:
    """The outcomes and metrics of a stretch of a group's rows, with the design point of each."""

    def read(name: str) -> np.ndarray:
        return group.stretch(name, piece.start, piece.stop)

    count = piece.stop - piece.start
    return CaseBlock(
        np.arange(piece.start, piece.stop),
        read("status"),
        read("cause").tolist(),
        read("warning").tolist() if "warning" in group.variables else [""] * count,
        {variable.name: read(variable.name) for variable in group.role("metric")},
        read("met") if "met" in group.variables else np.zeros((count, 0), np.int8),
        _points(group, piece, chosen, points),
        int(np.count_nonzero(read("bed_limited"))) if "bed_limited" in group.variables else 0,
    )
