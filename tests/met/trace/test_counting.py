"""Counted loops: how often they are come to and turn, and that nothing else changes."""

from __future__ import annotations

import numpy as np

from met.backends.llvm import kernel
from met.trace import maximum, where
from met.trace.counting import counting
from met.trace.program import Every, Phase, Program, RunPhase, Tape, WhileAny


def asking() -> Program:
    """Each case asks for its own number of turns at every fourth tick; within a turn of the block, for two more."""

    def ask(t: Tape) -> None:
        t.write("left", t.input("turns"))

    def work(t: Tape) -> None:
        asks = t.read("left") > 0.0
        t.write("left", maximum(t.read("left") - 1.0, 0.0))
        t.write("done", where(asks, t.read("done") + 1.0, t.read("done")))
        t.write("inner", where(asks, 2.0, 0.0))

    def inner(t: Tape) -> None:
        t.write("inner", maximum(t.read("inner") - 1.0, 0.0))

    def end(t: Tape) -> None:
        t.output("done", t.read("done"))

    loop = WhileAny(
        "left", 9, (RunPhase(Phase("work", work)), WhileAny("inner", 9, (RunPhase(Phase("inner", inner)),)))
    )
    tick = (Every(4, (RunPhase(Phase("ask", ask)), loop)),)
    return Program(100.0, (), tick, (RunPhase(Phase("end", end)),), ("turns",), 0, ("done",))


def test_a_blocks_loops_are_counted_by_the_case_that_asks_longest_and_no_case_is_changed() -> None:
    program = asking()
    counted, (outer, inner) = counting(program)
    assert counted.outputs == ("done", outer.entries, outer.turns, inner.entries, inner.turns)
    assert [(loop.cell, loop.outer) for loop in (outer, inner)] == [("left", True), ("inner", False)]
    cases = np.array([[3.0], [5.0], [0.0]])
    _, plain = kernel.compile(program).run(cases, 9)
    _, outputs = kernel.compile(counted).run(cases, 9)
    assert np.array_equal(outputs[:, :1], plain) and plain.ravel().tolist() == [9.0, 15.0, 0.0]
    assert outputs[:, 1:].tolist() == [[3.0, 15.0, 15.0, 30.0]] * 3
