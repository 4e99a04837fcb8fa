"""Cases carried side by side, and their periods linearised together: numbers are columns with a row for each case.

The operations and their rounding are those of a single case (`flow`), so that a case has the same bits in any company.
A case with an event on the way is noted, and has to be linearised alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from met.analysis.linear.flow import HANDS_OVER, Flow
from met.analysis.linear.period import PeriodProgram
from met.trace.nodes import OPERANDS, TRUTHS, Node
from met.trace.primitives import ARRAYS
from met.trace.program import Branch
from met.trace.tangents import PRODUCTS, TangentSection

Key = TypeVar("Key")

EVENTS = frozenset({"crossing", *HANDS_OVER})
"""Loops that run where something happens across which there is no derivative, by the cell that counts them."""

SETTLED = 1e-12
"""Relative change of its numbers by which a settled loop still moves in a turn."""

MOST_ABREAST = 64
"""Largest number of cases carried side by side: more hardly save time, and take more memory."""


class FlowAbreast(Flow):
    """The memories of several cases under way, cells by name: a float that all have, or a column [case, 1]; tangents of
    those that move, [direction] or [case, direction].

    unusual   [case]: True of one that is to be looked at by itself; its numbers mean nothing from there on
    on_kink   [case]: True of one that stands on a kink on the way;  kinks: by the number of the section in the order of
              the period, nodes of kinks with the cases that stand on them, [case, 1]
    opposite  nodes, as `kinks` has them, that take the other side
    """

    def __init__(
        self, program: PeriodProgram, inputs: Mapping[str, Any], cells: Mapping[str, Any], tick: int, count: int
    ) -> None:
        super().__init__(program, inputs, cells, tick)
        self.count, self.shape = count, (count,)
        self.unusual, self.on_kink = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
        self.kinks: dict[int, dict[int, np.ndarray]] = {}
        self.sections_run: list[int] = []
        self._going = np.ones(count, dtype=bool)
        self._settles = False

    @classmethod
    def of(cls, flows: Sequence[Flow]) -> FlowAbreast:
        """Carry flows (memories of cases) of one program at one tick side by side, without their tangents."""
        inputs, cells = _joined([flow.inputs for flow in flows]), _joined([flow.cells for flow in flows])
        return cls(flows[0].program, inputs, cells, flows[0].tick, len(flows))

    def case(self, place: int) -> Flow:
        """A single case, without its tangents."""
        inputs, cells = ({n: of_case(x, place) for n, x in some.items()} for some in (self.inputs, self.cells))
        return Flow(self.program, inputs, cells, self.tick)

    def begin_settled(self) -> None:
        """Run the start of the program; a loop that repeats until it has settled stops at `SETTLED`."""
        self._settles = True
        self.begin()
        self._settles = False

    def begin_as(self, begun: Mapping[str, Any]) -> None:
        """Start the cases from the cells of one that has begun, with all loops settled; only numbers that differ
        between cases are computed."""
        self._follow(step for step in self.program.recording.start if not isinstance(step, Branch))
        self.cells = dict(begun) | {name: column for name, column in self.cells.items() if np.ndim(column)}

    def run(self, number: int) -> None:
        """Run one section of the program for all cases side by side, with tangents, and note the cases on its kinks.
        number: of the section"""
        section, moves = self.program.sections[number], bool(self.tangents)
        with np.errstate(all="ignore"):
            value_of = values_abreast(section, self._leaf, self.opposite.get(self._runs, {}), plain=not moves)
            cells = [(cell, value_of(ref)) for cell, ref in section.stores]
            tangents = [(cell, value_of(ref)) for cell, ref in section.tangents] if moves else []
            for kink in section.kinks if moves else ():
                self._note(
                    kink.nodes,
                    self._of_each(value_of(kink.sides[0]) == value_of(kink.sides[1])) & self._any(value_of(kink.move)),
                )
        self._store(section, value_of, cells, tangents)
        self.sections_run.append(number)
        self._runs += 1

    def _note(self, nodes: Sequence[int], stands: np.ndarray) -> None:
        """Note the cases that stand on a kink, [case]."""
        stands = stands & self._going & ~self.unusual
        if stands.any():
            self.on_kink |= stands
            kinks = self.kinks.setdefault(self._runs, {})
            kinks |= {node: stands[:, None] | kinks.get(node, False) for node in nodes}

    def refuse(self, truth: Any, what: Callable[[], str]) -> None:
        """Note the cases of which this is true as unusual."""
        self.unusual |= self._of_each(truth)

    def modes(self) -> dict[str, Any]:
        """Modes of everything that may have dry friction, as columns or numbers; 1 where a case has no friction
        there."""
        modes = {}
        for sticking in self.program.builder.step.sticking:
            has, mode = sticking.level is not None or self.rubs(sticking) != 0.0, self.mode(sticking)
            modes[sticking.name] = np.where(has, mode, 1.0) if np.ndim(has) else mode if has else 1.0
        return modes

    def _of_each(self, truth: Any) -> np.ndarray:
        """A truth for each case, [case]."""
        return np.broadcast_to(truth, (self.count, 1))[:, 0]

    def _any(self, move: Any) -> np.ndarray:
        """True of each case in which a tangent is not 0 in every direction, [case]."""
        return np.broadcast_to(np.any(np.atleast_1d(move) != 0.0, axis=-1), (self.count,))

    def _loop(self, step: Branch) -> None:
        """Follow a loop's body in all cases whose condition cell is not 0, until it is 0 in all or the loop's largest
        number of turns is done. A case that enters a loop of an event is marked `unusual`."""
        condition: Any = step.condition
        outer = self._going
        for _ in range(condition.at_most):
            goes = self._of_each(self.cells.get(condition.cell, 0.0) != 0.0) & outer & ~self.unusual
            if self.tangents and condition.cell in EVENTS:
                self.unusual |= goes
                break
            if not goes.any():
                break
            cells, tangents, self._going = dict(self.cells), dict(self.tangents), goes
            self._follow(step.body)
            if not goes.all():
                self._stay(cells, tangents, goes[:, None])
            if self._settles and all(_near(value, cells.get(name)) for name, value in self.cells.items()):
                break
        self._going = outer

    def _stay(self, cells: Mapping[str, Any], tangents: Mapping[str, Any], goes: np.ndarray) -> None:
        """Keep the former memory of the cases that do not repeat the loop. goes: [case, 1]"""
        memory: tuple[tuple[Any, Mapping[str, Any]], ...] = ((self.cells, cells), (self.tangents, tangents))
        for now, before in memory:
            for name in now.keys() | before.keys():
                new, old = now.get(name, 0.0), before.get(name, 0.0)
                if new is not old:
                    now[name] = np.where(goes, new, old)


def together(flows: Sequence[Flow], go: Callable[[Flow], object]) -> list[Flow]:
    """The flows (memories of cases at one tick), after an action that needs no tangents was done on all of them side by
    side."""
    flows_after = []
    for first in range(0, len(flows), MOST_ABREAST):
        moved = side_by_side(flows[first : first + MOST_ABREAST])
        go(moved)
        flows_after += [moved.case(k) for k in range(moved.count)] if isinstance(moved, FlowAbreast) else [moved]
    return flows_after


def side_by_side(flows: Sequence[Flow]) -> Flow:
    """The flows of one program at one tick, side by side and without their tangents; a single flow is copied, which
    takes least time."""
    return flows[0].copy(tangents=False) if len(flows) == 1 else FlowAbreast.of(flows)


def alike(keys: Iterable[Key]) -> Iterator[tuple[Key, list[int]]]:
    """Each key with the positions that have it, in groups of at most `MOST_ABREAST`, which are computed together."""
    places = dict[Key, list[int]]()
    for place, key in enumerate(keys):
        places.setdefault(key, []).append(place)
    for key, key_places in places.items():
        yield from (
            (key, key_places[first : first + MOST_ABREAST]) for first in range(0, len(key_places), MOST_ABREAST)
        )


def of_case(value: Any, place: int) -> float:
    """The number of one case, from a number that all share or from a column."""
    return float(value[place, 0]) if np.ndim(value) else float(value)


def _joined(several: Sequence[Mapping[str, float]]) -> dict[str, Any]:
    """Numbers of cases by name: a float where all have the same bits, else a column."""
    names = list(dict.fromkeys(name for numbers in several for name in numbers))
    table = np.array([[numbers.get(name, 0.0) for name in names] for numbers in several], dtype=np.float64)
    bits = table.view(np.int64)
    alike = np.all(bits == bits[0], axis=0).tolist()
    return {name: float(table[0, k]) if alike[k] else table[:, k : k + 1].copy() for k, name in enumerate(names)}


def values_abreast(
    section: TangentSection, leaf: Callable[[Node], Any], opposite: Mapping[int, np.ndarray], *, plain: bool
) -> Callable[[int], Any]:
    """The value of each reference of a section, as from `met.trace.tangents.values`, for cases side by side: numbers
    may be columns [case, 1]."""
    nodes = section.nodes
    node_values: list[Any] = [None] * len(nodes)
    done: Mapping[int, list[int]] = {} if plain else section.last_uses  # tangents of many cases are large
    for i in section.plain_order if plain else section.order:
        node = nodes[i]
        op, count = node[0], OPERANDS[node[0]]
        if count == 0:
            node_values[i] = node[1] if op == "const" else False if op == "false" else leaf(node)
            continue
        operands, several = [], False
        for ref in node[1 : 1 + count]:
            value = node_values[ref >> 1]
            if ref & 1:
                value = _not(value) if nodes[ref >> 1][0] in TRUTHS else -value
            several = several or value.__class__ is np.ndarray
            operands.append(value)
        # a condition shared by all cases selects for all: its arm may be a column
        of_columns = op != "fma" and (several if op != "where" else operands[0].__class__ is np.ndarray)
        value = (ARRAYS if of_columns else PRODUCTS)[op](*operands, *node[1 + count :])
        if i in opposite:
            value = np.where(opposite[i], _not(value) if op in TRUTHS else -value, value)
        node_values[i] = value
        for k in done.get(i, ()):
            node_values[k] = None

    def value_of(ref: int) -> Any:
        return -node_values[ref >> 1] if ref & 1 else node_values[ref >> 1]

    return value_of


def _not(truth: Any) -> Any:
    return np.logical_not(truth) if truth.__class__ is np.ndarray else not truth


def _near(value: Any, before: Any) -> bool:
    return value is before or (before is not None and bool(np.all(abs(value - before) <= SETTLED * abs(value))))
