"""A recorded program that also carries the whole Jacobian of its memory over a period: as another recorded program.

All directions share what is computed but once, the numbers themselves and what is known in closed form
(`met.trace.known`). A cell NAME has a tangent `dK:NAME` for each direction K in which it moves where it is read: which
these are is followed through the program from the period's begin, where a state moves in its own direction alone, so
the graph is as sparse as the program. Along few directions tangents in lanes of their own cost less
(`met.trace.differentiated`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from met.trace import check
from met.trace.derivative import slopes
from met.trace.fuse import fused_from
from met.trace.known import KnownTangents
from met.trace.nodes import ONE, ZERO, Node, Nodes
from met.trace.program import Every, Unless0, WhileAny, walk
from met.trace.recorder import used_cells, without_dead_stores
from met.trace.recording import Branch, CodeSection, RecordedControl, Recording, RecordSection, RunSection
from met.trace.tangents import Straight

Active = Mapping[str, frozenset[int]]
"""The directions in which cells move, by cell; one that is not there moves in none."""


def entry(state: str, direction: str) -> str:
    """The output that is d `state` at the end of the last period / d `direction` at its begin."""
    return f"d({state})/d({direction})"


def with_jacobian(recording: Recording, states: Sequence[str], ticks: int, straight: Straight) -> Recording:
    """The program with the Jacobian of each period, that of the last one as more outputs (`entry`).

    states  cells; a period begins at multiples of `ticks`, behind the first step of the program's control, which ends
            the period before
    """
    return _Carrier(recording, tuple(states), straight).carried(ticks)


class _Carrier:
    """One making of a program with a Jacobian."""

    def __init__(self, recording: Recording, states: tuple[str, ...], straight: Straight) -> None:
        self.recording, self.states, self.straight = recording, states, straight
        self.sections: list[CodeSection] = []
        of = recording.sections
        self.reads = [frozenset(x.nodes[i][1] for i in x.order if x.nodes[i][0] == "cell") for x in of]
        self.writes = [frozenset(cell for cell, _ in x.stores) for x in of]
        self._made: dict[tuple[int, tuple[tuple[str, frozenset[int]], ...]], tuple[int, Active]] = {}

    def carried(self, ticks: int) -> Recording:
        recording = self.recording
        finish, *rest = recording.tick
        at_begin: Active = {}
        while True:
            first, at_end = self.body((finish,), at_begin, () if ticks == 1 else (*rest, finish))
            period = [self.kept(at_end), self.seeded()]
            seeds: Active = {name: frozenset({number}) for number, name in enumerate(self.states)}
            if ticks > 1:
                joined = _joined(at_end, seeds)
                period[-1:] = [self.zeroed(_less(joined, seeds)), period[-1]]
                first += self.zeroed(_less(joined, at_end))
                between: list[RecordedControl] = [Branch(Every(ticks, ()), tuple(_flat(period)))]
                seeds = joined
            else:
                between = _flat(period)
            then, after = self.body(rest, seeds, (finish,) if ticks == 1 else (finish, *rest))
            joined = _joined(at_begin, after)
            if joined == at_begin:
                tick = (*first, *between, *then, *self.zeroed(_less(joined, after)))
                return self.recorded(tick)
            at_begin = joined

    def body(
        self, steps: Sequence[RecordedControl], active: Active, then: Sequence[RecordedControl]
    ) -> tuple[list[RecordedControl], Active]:
        """A body of control with tangents, and what moves after it. then: what follows it, up to the period's end."""
        made: list[RecordedControl] = []
        for place, step in enumerate(steps):
            if isinstance(step, RecordSection):
                continue
            if isinstance(step, RunSection):
                number, stored = self.section(step.section, active)
                active = {**active, **stored}
                made.append(RunSection(number))
                continue
            before, loops = active, isinstance(step.condition, WhileAny)
            later = (*steps[place + 1 :], *then)
            while True:
                inner, after = self.body(step.body, before, (*step.body, *later) if loops else later)
                joined = self.asked_for(_joined(before, after), (*step.body, *later) if loops else later)
                if joined == before or not loops:
                    break
                before = joined
            if not isinstance(step.condition, Unless0):  # before tick 0 all is 0
                made += self.zeroed(_less(joined, active))
            made.append(Branch(step.condition, (*inner, *self.zeroed(_less(joined, after)))))
            active = joined
        return made, active

    def asked_for(self, active: Active, later: Sequence[RecordedControl]) -> Active:
        """Those of these cells that are read, or are states, before they are written again."""
        return {
            cell: directions
            for cell, directions in active.items()
            if self.is_asked_for(cell, later, otherwise=cell in self.states)
        }

    def is_asked_for(self, cell: str, steps: Iterable[RecordedControl], *, otherwise: bool) -> bool:
        """True where these steps read a cell before they write it. otherwise: where they do neither."""
        for step in steps:
            if isinstance(step, RunSection):
                if cell in self.reads[step.section]:
                    return True
                if cell in self.writes[step.section]:
                    return False
            elif isinstance(step, Branch) and self.is_asked_for(cell, step.body, otherwise=False):
                return True
        return otherwise

    def section(self, number: int, active: Active) -> tuple[int, Active]:
        """The number of a section with tangents, and in which directions moves what it stores."""
        section = self.recording.sections[number]
        here = {cell: active[cell] for cell in sorted(self.reads[number]) if active.get(cell)}
        key = (number, tuple(here.items()))
        if key not in self._made:
            made, stored = _along(section, here, self.straight)
            self._made[key] = self.add(made), stored
        return self._made[key]

    def add(self, section: CodeSection) -> int:
        self.sections.append(section)
        return len(self.sections) - 1

    def stores(self, name: str, stores: Iterable[tuple[str, Node | int]]) -> list[RecordedControl]:
        """A section that stores cells, or numbers by reference."""
        graph = Nodes()
        made = tuple((cell, what if isinstance(what, int) else graph.make(*what)) for cell, what in stores)
        return [RunSection(self.add(CodeSection(name, tuple(graph.nodes), made, (), ())))] if made else []

    def zeroed(self, active: Active) -> list[RecordedControl]:
        """Tangents that are nothing on one of two ways that meet."""
        return self.stores("still", [(_of(k, cell), ZERO) for cell in sorted(active) for k in sorted(active[cell])])

    def kept(self, active: Active) -> list[RecordedControl]:
        found: list[tuple[str, Node | int]] = []
        for name in self.states:
            for k, direction in enumerate(self.states):
                moves = k in active.get(name, ())
                found.append((entry(name, direction), ("cell", _of(k, name)) if moves else ZERO))
        return self.stores("jacobian", found)

    def seeded(self) -> list[RecordedControl]:
        return self.stores("seeds", [(_of(k, name), ONE) for k, name in enumerate(self.states)])

    def recorded(self, tick: Sequence[RecordedControl]) -> Recording:
        program, names = self.recording.program, [entry(a, b) for a in self.states for b in self.states]
        graph, first = Nodes(), len(program.outputs)
        outputs = tuple((first + number, graph.make("cell", name)) for number, name in enumerate(names))
        last = CodeSection("last jacobian", tuple(graph.nodes), (), (), outputs)
        plain = {n: self.add(replace(section, records=())) for n, section in enumerate(self.recording.sections)}
        start, end = (_renumbered(body, plain) for body in (self.recording.start, self.recording.end))
        end = (*end, RunSection(self.add(last)))
        used = dict.fromkeys(_numbers((*start, *tick, *end)))
        numbers = {old: new for new, old in enumerate(used)}
        asked = {
            node.cell for node in walk((*program.start, *program.tick, *program.end)) if isinstance(node, WhileAny)
        }
        sections = without_dead_stores([self.sections[number] for number in used], asked)
        found = Recording(
            replace(program, columns=0, outputs=(*program.outputs, *names)),
            tuple(sections),
            _renumbered(start, numbers),
            _renumbered(tick, numbers),
            _renumbered(end, numbers),
            used_cells(sections, asked),
        )
        if check.wanted():
            check.check(found)
        return found


def _along(section: CodeSection, active: Active, straight: Straight) -> tuple[CodeSection, Active]:
    """A section with tangents of all that moves, its own numbers with the same bits; and in which directions moves what
    it stores."""
    graph = Nodes.of(section.nodes)
    known = KnownTangents(graph, section.known)
    stores, moves = list(section.stores), {cell: set[int]() for cell, _ in section.stores}
    for k in sorted(frozenset().union(*active.values())):
        found = slopes(graph, section.order, _leaf(graph, active, k), lambda i: straight(section, i), known)
        for cell, ref in section.stores:
            move = found.get(ref >> 1, ZERO) ^ (ref & 1)
            if move & -2 != ZERO:
                stores.append((_of(k, cell), move))
                moves[cell].add(k)
    roots = [ref for _, ref in stores]
    nodes = fused_from(graph.nodes, roots, len(section.nodes))
    made = CodeSection(section.name, tuple(nodes), tuple(stores), (), (), section.parts)
    return made, {cell: frozenset(directions) for cell, directions in moves.items()}


def _leaf(graph: Nodes, active: Active, direction: int) -> Callable[[Node], int]:
    def leaf(node: Node) -> int:
        moves = node[0] == "cell" and direction in active.get(node[1], ())
        return graph.make("cell", _of(direction, node[1])) if moves else ZERO

    return leaf


def _of(direction: int, cell: str) -> str:
    """The cell of a tangent."""
    return f"d{direction}:{cell}"


def _joined(a: Active, b: Active) -> Active:
    cells = (cell for cell in {**a, **b} if a.get(cell) or b.get(cell))
    return {cell: a.get(cell, frozenset()) | b.get(cell, frozenset()) for cell in cells}


def _less(a: Active, b: Active) -> Active:
    return {cell: left for cell, directions in a.items() if (left := directions - b.get(cell, frozenset()))}


def _flat(bodies: Iterable[list[RecordedControl]]) -> list[RecordedControl]:
    return [step for body in bodies for step in body]


def _numbers(body: Iterable[RecordedControl]) -> Iterable[int]:
    for step in body:
        if isinstance(step, Branch):
            yield from _numbers(step.body)
        else:
            yield step.section


def _renumbered(body: Iterable[RecordedControl], numbers: Mapping[int, int]) -> tuple[RecordedControl, ...]:
    return tuple(
        replace(step, body=_renumbered(step.body, numbers))
        if isinstance(step, Branch)
        else replace(step, section=numbers[step.section])
        for step in body
        if isinstance(step, Branch) or step.section in numbers
    )
