"""Orientations for records and metrics: of the two unit quaternions of a rotation, the one without a jump.

The first that is asked for has w >= 0; each one after it has the sign by which it lies nearer the one before. A record
compares a row with the row before it, a metric an instant with the instant before it, each in cells of its own, so that
a metric changes no row. The signs depend on the case alone, not on cases beside it.
"""

from __future__ import annotations

from met.plan.channel import WXYZ, Channel
from met.program.observe import Observed
from met.trace import Real, where
from met.trace.program import Tape
from met.vectors import Quaternion, dot

INSTANT, ROW = "instant:", "row:"
"""Prefixes of the cells that hold the last quaternion seen, at an instant and in a row. They start as zeros, which are
as near to one sign as to the other: so the first quaternion keeps w >= 0."""


def vector(channel: Channel) -> str:
    """The orientation that a channel is a component of; "" of any other channel."""
    return channel.path.rpartition(".")[0] if channel.components == WXYZ else ""


def values(tape: Tape, arm: Observed, channels: list[Channel], last: str) -> dict[str, Real]:
    """Derived channels at this instant, by path. last: INSTANT or ROW, for the part that asks."""
    by_path = {channel.path: arm.value(channel) for channel in channels if not vector(channel)}
    for name in dict.fromkeys(map(vector, channels)):
        by_path |= _components(name, nearest(tape, name, arm.orientation(name), last)) if name else {}
    return {channel.path: by_path[channel.path] for channel in channels}


def held(tape: Tape, channels: list[Channel]) -> dict[str, Real]:
    """Orientations in a row between instants, or beside a metric that watches them: those of the last instant."""
    by_path: dict[str, Real] = {}
    for name in dict.fromkeys(filter(None, map(vector, channels))):
        seen = tuple(tape.read(cell) for cell in _cells(name, INSTANT))
        by_path |= _components(name, nearest(tape, name, seen, ROW))  # type: ignore[arg-type]
    return by_path


def nearest(tape: Tape, name: str, q: Quaternion, last: str) -> Quaternion:
    """The one of q and -q that is nearer the last one; it becomes the last one."""
    near = dot(q, [tape.read(cell) for cell in _cells(name, last)])
    sign = where(near < 0.0, -1.0, 1.0)
    w, x, y, z = (sign * part for part in q)
    for cell, part in zip(_cells(name, last), (w, x, y, z), strict=True):
        tape.write(cell, part)
    return w, x, y, z


def _components(name: str, q: Quaternion) -> dict[str, Real]:
    return {f"{name}.{part}": value for part, value in zip(WXYZ, q, strict=True)}


def _cells(name: str, last: str) -> list[str]:
    return [f"{last}{name}.{part}" for part in WXYZ]
