"""Recordings that are none are refused, and so are cells that nothing writes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from met.backends.llvm.pieces import check as check_pieces
from met.backends.llvm.pieces import cut
from met.trace import where
from met.trace.check import check
from met.trace.program import CodeSection, Phase, Program, Recording, RunPhase, Tape, WhileAny
from met.trace.recorder import record


def recording() -> Recording:
    def body(tape: Tape) -> None:
        x = tape.read("x")
        tape.write("x", where(x < tape.input("most"), x * 2.0 + 1.0, x))

    tick = (RunPhase(Phase("body", body)),)
    end = (RunPhase(Phase("end", lambda tape: tape.output("x", tape.read("x")))),)
    return record(Program(1.0, (), tick, end, ("most",), 0, ("x",)))


def with_node(i: int, node: tuple[Any, ...]) -> Callable[[CodeSection], CodeSection]:
    return lambda section: replace(section, nodes=(*section.nodes[:i], node, *section.nodes[i + 1 :]))


def place(section: CodeSection, op: str) -> int:
    return next(i for i in section.order if section.nodes[i][0] == op)


def test_a_recording_is_one() -> None:
    check(recording())


@pytest.mark.parametrize(
    ("op", "node", "message"),
    [
        ("fma", ("fmaa", 0, 2, 0), "'fmaa', which is no operation"),
        ("fma", ("fma", 0, 2), "`fma` has 3 operands"),
        ("fma", ("fma", 0, 2, 10**6), "takes 1000000, which is no node before it"),
        ("fma", ("fma", 0, 2, 4), "takes node 2, `false`, for what it is not"),
        ("where", ("where", 2, 0, 2), "takes node 1, `const`, for what it is not"),
        ("cell", ("cell", "y"), "reads the cell 'y', which there is not"),
        ("input", ("input", "least"), "reads the input 'least', which there is not"),
        ("cell", ("cell",), "`cell` has 0 operands"),
    ],
)
def test_a_node_that_is_none_is_refused(op: str, node: tuple[Any, ...], message: str) -> None:
    whole = recording()
    section = whole.sections[0]
    changed = with_node(place(section, op), node)(section)
    with pytest.raises(ValueError, match=message):
        check(replace(whole, sections=(changed, *whole.sections[1:])))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"stores": (("y", 0),)}, "it sets the cell 'y', which there is not"),
        ({"stores": (("x", 4),)}, "the cell 'x' is set to a truth"),
        ({"stores": (("x", 0), ("x", 2))}, "it sets a cell twice"),
        ({"records": ((0, 0),)}, "it sets the column 0, which there is not"),
        ({"outputs": ((1, 0),)}, "it sets the output 1, which there is not"),
    ],
)
def test_a_result_that_is_none_is_refused(changes: dict[str, Any], message: str) -> None:
    whole = recording()
    with pytest.raises(ValueError, match=message):
        check(replace(whole, sections=(replace(whole.sections[0], **changes), *whole.sections[1:])))


def long_section() -> CodeSection:
    def body(tape: Tape) -> None:
        x = [tape.read(f"x{i}") for i in range(6)]
        for n in range(200):
            x[n % 6] = x[n % 6] * x[(n + 1) % 6] + 0.5 * x[(n + 2) % 6]
        for i in range(6):
            tape.write(f"x{i}", x[i])

    end = (RunPhase(Phase("end", lambda tape: tape.output("x0", tape.read("x0")))),)
    return record(Program(1.0, (), (RunPhase(Phase("body", body)),), end, (), 0, ("x0",))).sections[0]


def test_pieces_that_are_not_the_section_are_refused() -> None:
    section = long_section()
    check_pieces(section, cut(section, 100, 30, 60))
    pieces = cut(section, 100, 30, 60)
    pieces[1].body.pop()
    with pytest.raises(ValueError, match="once and in order"):
        check_pieces(section, pieces)
    pieces = cut(section, 100, 30, 60)
    pieces[0].keep.clear()
    with pytest.raises(ValueError, match="which it does not have"):
        check_pieces(section, pieces)
    pieces = cut(section, 100, 30, 60)
    pieces[-1].tail.clear()
    for piece in pieces:
        piece.stores.clear()
    with pytest.raises(ValueError, match="do not store"):
        check_pieces(section, pieces)


def test_a_cell_that_nothing_writes_is_refused_when_it_is_recorded() -> None:
    end = (RunPhase(Phase("end", lambda tape: tape.output("x", tape.read("mispelt")))),)
    with pytest.raises(ValueError, match="'end' reads the cell 'mispelt', which nothing writes"):
        record(Program(1.0, (), (), end, (), 0, ("x",)))
    record(Program(1.0, (), (), end, (), 0, ("x",), counters=("mispelt",)))
    loop = (WhileAny("on", 1, (RunPhase(Phase("body", lambda tape: tape.write("x", 1.0))),)),)
    end = (RunPhase(Phase("end", lambda tape: tape.output("x", tape.read("x")))),)
    with pytest.raises(ValueError, match="a loop goes by the cell 'on', which nothing writes"):
        record(Program(1.0, (), loop, end, (), 0, ("x",)))
