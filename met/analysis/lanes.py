"""Arrays in the place of numbers: a case's memory over lanes, and slopes as differences between neighbouring lanes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np

from met.trace import Real, Truth
from met.trace.program import CallPhase, Control, Every, RunPhase, Unless0, WhileAny

SMALL = 1e-6
"""Change of a position or a rate over which differences are taken, as a share of it, or of 1 rad, 1 m, 1 rad/s, 1
m/s."""

SMALL_STATE = 1e-9
"""Change of a state of a servo or sensor over which differences are taken, in its unit: some states live in
micrometres, and none of them turns the arm."""


class LaneTape:
    """A `Tape` over arrays: one number a lane, where the lanes differ. `k`, the tick, may differ too."""

    def __init__(self, base_hz: float, inputs: Mapping[str, np.ndarray], lanes: int) -> None:
        self.base_hz = base_hz
        self.inputs = dict(inputs)
        self.cells: dict[str, Any] = {}
        self.lanes = lanes
        self.k: Any = 0

    @property
    def tick(self) -> Real:
        return np.float64(self.k)

    @property
    def time(self) -> Real:
        return np.float64(self.k) / np.float64(self.base_hz)

    def read(self, name: str) -> Real:
        value: Real = self.cells.get(name, ZERO)
        return value

    def write(self, name: str, value: Any) -> None:
        self.cells[name] = value if value.__class__ is np.ndarray else np.float64(value)

    def read_mask(self, name: str) -> Truth:
        is_set: Any = self.cells.get(name, ZERO) != 0.0
        truth: Truth = is_set if isinstance(is_set, np.ndarray) else bool(is_set)  # type: ignore[assignment]
        return truth

    def write_mask(self, name: str, value: Any) -> None:
        self.cells[name] = np.where(value, 1.0, 0.0) if isinstance(value, np.ndarray) else np.float64(bool(value))

    def input(self, name: str) -> Real:
        value: Any = self.inputs[name]
        return value

    def record(self, column: int, value: Real) -> None:
        """Drop the recorded value: no rows are kept."""

    def output(self, name: str, value: Real) -> None:
        """Drop the output: no results are kept."""

    def part(self, name: str) -> AbstractContextManager[None]:
        return nullcontext()

    def lane(self, name: str) -> np.ndarray:
        """The value of a cell in each lane."""
        return np.broadcast_to(np.asarray(self.read(name), dtype=float), (self.lanes,))

    def spread(self, times: int) -> LaneTape:
        """A tape with every lane repeated that many times, side by side."""
        tape = LaneTape(self.base_hz, {}, self.lanes * times)
        tape.k = self.k
        tape.inputs = {name: np.repeat(value, times) for name, value in self.inputs.items()}
        tape.cells = {
            name: np.repeat(value, times) if isinstance(value, np.ndarray) else value
            for name, value in self.cells.items()
        }
        return tape

    def only(self, lanes: np.ndarray) -> LaneTape:
        """The tape of some lanes only; lanes: a truth for each."""
        tape = LaneTape(self.base_hz, {}, int(np.count_nonzero(lanes)))
        tape.k = self.k
        tape.inputs = {name: value[lanes] for name, value in self.inputs.items()}
        tape.cells = {
            name: value[lanes] if isinstance(value, np.ndarray) and value.ndim else value
            for name, value in self.cells.items()
        }
        return tape

    def follow(self, body: Iterable[Control]) -> None:
        """Run the body once, at the tape's tick. Loops in which payloads change hands run once; loops that repeat until
        something is decided are skipped."""
        for node in body:
            match node:
                case RunPhase(phase) | CallPhase(phase):
                    phase.body(self)
                case Every(divisor, inner):
                    if self.k % divisor == 0:
                        self.follow(inner)
                case Unless0(inner):
                    if self.k > 0:
                        self.follow(inner)
                case WhileAny(cell, _, inner):
                    if cell in ("grappling", "releasing") and np.any(self.lane(cell) != 0.0):
                        self.follow(inner)


ZERO = np.float64(0.0)


def to_both_sides(start: np.ndarray, size: np.ndarray, moved: slice = slice(None)) -> tuple[np.ndarray, np.ndarray]:
    """Each of some values moved to both sides while the others stay: [value, any], that many times as many lanes, side
    by side; and the differences of the two sides, [lane, moved].

    start, size  [value, lane];  moved: of these values those that are moved
    """
    n, lanes = start.shape
    indices, size = np.arange(n)[moved], np.broadcast_to(size, start.shape)
    points = np.empty((n, lanes, len(indices), 2))
    points[:] = start[:, :, None, None]
    columns = np.arange(len(indices))
    points[indices, :, columns, 0] += size[indices]
    points[indices, :, columns, 1] -= size[indices]
    return points.reshape(n, -1), (points[indices, :, columns, 0] - points[indices, :, columns, 1]).T


def spread_over(read: Callable[[str], Any], times: int) -> Callable[[str], Any]:
    """Wrap the reading of a cell so that each of its lanes is repeated that many times, side by side."""

    def spread(name: str) -> Any:
        value = read(name)
        return np.repeat(value, times) if isinstance(value, np.ndarray) else value

    return spread


def differences(values: Mapping[str, Any], cells: Sequence[str], sizes: np.ndarray) -> np.ndarray:
    """[lane, of, by] of values in lanes that were moved to both sides; sizes: [lane, by]."""
    lanes, n = sizes.shape
    rows = np.array([np.broadcast_to(values[name], (lanes * 2 * n,)) for name in cells])
    pairs = rows.reshape(len(cells), lanes, n, 2)
    return np.moveaxis((pairs[..., 0] - pairs[..., 1]) / sizes, 0, 1)
