"""Cases under way side by side, and their periods linearised at once: numbers are columns, of a row a case.

The operations are those that one case by itself has (`flow`), rounded alike: a case has the same bits in any company.
What is out of the ordinary in a case (an event, a kink that its memory stands on, a loop that it leaves at another
turn) is no matter of this file: such a case is noted, and is to be looked at by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any

import numpy as np

from met.analysis.linear.flow import HANDS_OVER, Flow
from met.analysis.linear.period import PeriodProgram
from met.trace.nodes import OPERANDS, TRUTHS, Node
from met.trace.primitives import ARRAYS
from met.trace.recording import Branch
from met.trace.tangents import PRODUCTS, TangentSection

EVENTS = frozenset({"crossing", *HANDS_OVER})
"""Loops that have a turn where something happens across which there is no derivative, by the cell that they go by."""

SETTLED = 1e-12
"""Share of its numbers by which a turn of a loop changes them once they have settled."""


class FlowAbreast(Flow):
    """The memories of several cases under way, cells by name: a float that all have, or a column [case, 1]; tangents of
    those that move, [direction] or [case, direction].

    unusual  [case]: True of one that is to be looked at by itself; its numbers mean nothing from there on
    """

    def __init__(
        self, program: PeriodProgram, inputs: Mapping[str, Any], cells: Mapping[str, Any], tick: int, count: int
    ) -> None:
        super().__init__(program, inputs, cells, tick)
        self.count = count
        self.unusual = np.zeros(count, dtype=bool)
        self._settles = False

    def begin(self) -> None:
        """The start of a run, in which what goes round until it has settled goes no farther than that."""
        self._settles = True
        super().begin()
        self._settles = False

    def begin_as(self, begun: Mapping[str, Any]) -> None:
        """The start of cases of which one has begun as these cells say, with all that loops have settled: of the others
        what differs from case to case."""
        self._follow(step for step in self.program.recording.start if not isinstance(step, Branch))
        self.cells = dict(begun) | {name: each for name, each in self.cells.items() if np.ndim(each)}

    def run(self, number: int) -> None:
        """One section, of all cases."""
        section = self.program.sections[number]
        with np.errstate(all="ignore"):
            of = values_abreast(section, self._leaf, self.opposite.get(self._runs, frozenset()))
            cells = [(cell, of(ref)) for cell, ref in section.stores]
            tangents = [(cell, of(ref)) for cell, ref in section.tangents]
            if self.tangents:
                for kink in section.kinks:
                    self.unusual |= self._of_each(of(kink.sides[0]) == of(kink.sides[1])) & self._any(of(kink.move))
        for cell, value in cells:
            self.cells[cell] = value
            self.tangents.pop(cell, None)
        self.tangents.update({cell: move for cell, move in tangents if np.any(move != 0.0)})
        if self._recording:
            self.row_tangents.update({column: of(ref) for column, ref in section.record_tangents})
        self._runs += 1

    def _of_each(self, truth: Any) -> np.ndarray:
        """A truth of each case, [case]."""
        return np.broadcast_to(truth, (self.count, 1))[:, 0]

    def _any(self, move: Any) -> np.ndarray:
        """True of each case in which a tangent is not 0 in every direction, [case]."""
        return np.broadcast_to(np.any(np.atleast_1d(move) != 0.0, axis=-1), (self.count,))

    def _loop(self, step: Branch) -> None:
        condition: Any = step.condition
        for _ in range(condition.at_most):
            goes = self._of_each(self.cells.get(condition.cell, 0.0) != 0.0)
            if self.tangents and condition.cell in EVENTS:
                self.unusual |= goes
            usual = goes[~self.unusual]
            if not usual.any():
                break
            self.unusual |= ~goes
            before = dict(self.cells) if self._settles else {}
            self._follow(step.body)
            if before and all(_near(value, before.get(name)) for name, value in self.cells.items()):
                break


def values_abreast(
    section: TangentSection, leaf: Callable[[Node], Any], opposite: Collection[int] = ()
) -> Callable[[int], Any]:
    """The worth of each reference of a section, as `met.trace.tangents.values` has it, where numbers may be columns."""
    nodes = section.nodes
    found: list[Any] = [None] * len(nodes)
    for i in section.order:
        node = nodes[i]
        op, count = node[0], OPERANDS[node[0]]
        if count == 0:
            found[i] = node[1] if op == "const" else False if op == "false" else leaf(node)
            continue
        operands, several = [], False
        for ref in node[1 : 1 + count]:
            value = found[ref >> 1]
            if ref & 1:
                value = _not(value) if nodes[ref >> 1][0] in TRUTHS else -value
            several = several or value.__class__ is np.ndarray
            operands.append(value)
        # what all have alike is chosen by for all: an arm of it may be a column
        of_columns = op != "fma" and (several if op != "where" else operands[0].__class__ is np.ndarray)
        value = (ARRAYS if of_columns else PRODUCTS)[op](*operands, *node[1 + count :])
        if i in opposite:
            value = _not(value) if op in TRUTHS else -value
        found[i] = value

    def value_of(ref: int) -> Any:
        return -found[ref >> 1] if ref & 1 else found[ref >> 1]

    return value_of


def _not(truth: Any) -> Any:
    return np.logical_not(truth) if truth.__class__ is np.ndarray else not truth


def _near(value: Any, before: Any) -> bool:
    return value is before or (before is not None and bool(np.all(abs(value - before) <= SETTLED * abs(value))))
