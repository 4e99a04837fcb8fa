"""The cells of an arm's motion in a case's memory, and the functions by which phases read and write them."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from met.integrators.integrator import Motion
from met.trace import Real, Truth, where
from met.trace.program import Tape


def state(
    tape: Tape, joints: Sequence[str], states: Sequence[str], copy: str = "", without: Collection[str] = ()
) -> Motion:
    """The arm's state, or its copy under this prefix. without: joints whose cells are not read, but taken as 0."""
    return Motion(
        tuple(0.0 if joint in without else tape.read(f"{copy}{joint}.q") for joint in joints),
        tuple(0.0 if joint in without else tape.read(f"{copy}{joint}.qd") for joint in joints),
        tuple(tape.read(f"{copy}{name}") for name in states),
    )


def store(tape: Tape, active: Truth, joints: Sequence[str], states: Sequence[str], y: Motion, copy: str = "") -> None:
    """Write y as the state, or as its copy under this prefix, where active."""
    for joint, q, qd in zip(joints, y.q, y.qd, strict=True):
        keep(tape, active, f"{copy}{joint}.q", q)
        keep(tape, active, f"{copy}{joint}.qd", qd)
    for name, x in zip(states, y.x, strict=True):
        keep(tape, active, f"{copy}{name}", x)


def keep(tape: Tape, active: Truth, name: str, value: Real) -> None:
    """Write where active; other cases of the block keep their value."""
    tape.write(name, value if active is True else where(active, value, tape.read(name)))


def count(tape: Tape, event: Truth, name: str) -> None:
    """Increment a counter of an event where it happens."""
    keep(tape, event, name, tape.read(name) + 1.0)
