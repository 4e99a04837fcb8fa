"""Counts of a program's loops: the same program with counters in every `WhileAny`.

A loop runs for a whole block of cases as long as one of them needs it, so its counters are a block's: all cases of a
block count alike, and the results of cases do not change.
"""

from __future__ import annotations

from dataclasses import replace

from met.frozen import frozen
from met.trace.graph import Real
from met.trace.program import Control, Every, Phase, Program, RunPhase, Tape, Unless0, WhileAny


@frozen
class CountedLoop:
    """A loop of a program: the cell that controls it, and the outputs that count it.

    entries   times that it was come to and ran at all
    turns     times that its body ran
    outer     whether it stands in no other loop
    """

    cell: str
    entries: str
    turns: str
    outer: bool


def counting(program: Program) -> tuple[Program, tuple[CountedLoop, ...]]:
    """The program with two more outputs for each loop, and its loops in order of control (start, tick, end)."""
    loops: list[CountedLoop] = []

    def counted(body: tuple[Control, ...], outer: bool) -> tuple[Control, ...]:
        """The control with a counter in each loop. outer: whether it is in no loop itself"""
        steps: list[Control] = []
        for node in body:
            if isinstance(node, WhileAny):
                number = len(loops)
                loop = CountedLoop(node.cell, f"loop.{number}.entries", f"loop.{number}.turns", outer)
                loops.append(loop)
                inner = counted(node.body, False)
                steps += [RunPhase(_come_to(loop)), WhileAny(node.cell, node.at_most, (RunPhase(_turn(loop)), *inner))]
            elif isinstance(node, (Every, Unless0)):
                steps.append(replace(node, body=counted(node.body, outer)))
            else:
                steps.append(node)
        return tuple(steps)

    start, tick = counted(program.start, True), counted(program.tick, True)
    names = tuple(name for loop in loops for name in (loop.entries, loop.turns))
    end = (*program.end, RunPhase(_giving(names)))
    return replace(program, start=start, tick=tick, end=end, outputs=(*program.outputs, *names)), tuple(loops)


def _come_to(loop: CountedLoop) -> Phase:
    """The phase that notes that a loop is come to."""

    def body(tape: Tape) -> None:
        tape.write(f"{loop.entries}.fresh", 1.0)

    return Phase(f"come to {loop.cell}", body)


def _turn(loop: CountedLoop) -> Phase:
    """The phase that counts a turn of a loop, and its entry at the first one."""

    def body(tape: Tape) -> None:
        fresh: Real = tape.read(f"{loop.entries}.fresh")
        tape.write(loop.entries, tape.read(loop.entries) + fresh)
        tape.write(loop.turns, tape.read(loop.turns) + 1.0)
        tape.write(f"{loop.entries}.fresh", 0.0)

    return Phase(f"turn of {loop.cell}", body)


def _giving(names: tuple[str, ...]) -> Phase:
    """The phase that gives out these counts."""

    def body(tape: Tape) -> None:
        for name in names:
            tape.output(name, tape.read(name))

    return Phase("count", body)
