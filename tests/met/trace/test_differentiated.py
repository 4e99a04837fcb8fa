"""A differentiated program computes what the plain one does, with the same bits, and how its outputs move."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import ic
from met import backends
from met import run as engine
from met.trace import Real, floor, sin, where
from met.trace.differentiated import dependence, differentiated
from met.trace.program import CodeSection, Every, Phase, Program, RunPhase, Tape, WhileAny
from met.trace.recorder import record
from met.trace.tangents import HEAD
from tests.met.backends.marked import NAMES

DECKS = Path(ic.__file__).parent / "decks"


def never(section: CodeSection, position: int) -> bool:
    return False


def winding(inputs: tuple[str, ...] = ("x", "y")) -> Program:
    """Ten turns of x <- sin(x) + y x, halved in a loop while it is above a half; besides what moves in steps alone."""

    def start(tape: Tape) -> None:
        tape.write("x", tape.input("x"))
        tape.write("kept", tape.input("y"))
        tape.write("count", 0.0)
        tape.write_mask("large", False)

    def turn(tape: Tape) -> None:
        x = tape.read("x")
        new: Real = sin(x) + tape.input("y") * x
        tape.write("x", new)
        tape.write_mask("large", new > 0.5)
        tape.write("count", tape.read("count") + where(new > 0.5, 1.0, 0.0))

    def halve(tape: Tape) -> None:
        x = tape.read("x")
        tape.write("x", where(tape.read_mask("large"), 0.5 * x, x))
        tape.write_mask("large", False)

    def forget(tape: Tape) -> None:
        tape.write("kept", 3.0)

    def end(tape: Tape) -> None:
        tape.output("x", tape.read("x"))
        tape.output("kept", tape.read("kept"))
        tape.output("count", tape.read("count"))
        tape.output("whole", floor(tape.input("y")))

    loop = WhileAny("large", 1, (RunPhase(Phase("halve", halve)),))
    return Program(
        1.0, (RunPhase(Phase("start", start)),),
        (RunPhase(Phase("turn", turn)), loop, Every(4, (RunPhase(Phase("forget", forget)),))),
        (RunPhase(Phase("end", end)),), inputs, 0, ("x", "kept", "count", "whole"),
    )  # fmt: skip


def plain(x: complex, y: complex) -> complex:
    for _ in range(10):
        x = np.sin(x) + y * x
        x = 0.5 * x if x.real > 0.5 else x
    return x


@pytest.mark.parametrize("name", NAMES)
def test_tangents_are_those_of_a_step_in_the_imaginary_direction(name: str) -> None:
    made = differentiated(record(winding()), ("x", "y"), never)
    assert made.program.inputs == ("x", "y", "d:x", "d:y")
    cases = np.array([[0.9, 0.3, 1.0, 0.0], [0.9, 0.3, 0.0, 1.0], [0.2, 0.7, 0.5, -2.0]])
    kernel = backends.load(made, name=name)
    _, found = kernel.run(cases, 9, record=False)
    moves = dict(zip(made.program.outputs, found.T, strict=True))
    for case, (x, y, dx, dy) in enumerate(cases):
        step = 1e-30
        of = plain(complex(x, step * dx), complex(y, step * dy)).imag / step
        assert moves["d:x"][case] == pytest.approx(of, rel=1e-12)
    assert not moves["d:kept"].any()  # it moved with y, until it was set
    assert not moves["d:count"].any() and not moves["d:whole"].any()


def test_what_moves_in_steps_alone_is_told_from_what_moves() -> None:
    recording = record(winding())
    of_x, of_y = (dependence(recording, name, never) for name in ("x", "y"))
    assert of_x.moves == {"x"} and of_x.changes == {"x", "count"}
    assert of_y.moves == {"x", "kept"} and of_y.changes == {"x", "kept", "count", "whole"}


@pytest.mark.slow
@pytest.mark.parametrize("lanes", [8, 16])
def test_the_numbers_of_a_run_have_the_bits_that_they_have_without_tangents(lanes: int) -> None:
    """Of all cases of a shipped sweep, with friction that sticks; in each of the back ends that compile."""
    (made,) = ic.compile(DECKS / "two_link.ic", select=["gains"]).experiments
    prepared, rows = engine.prepare(made), np.arange(made.cases.count)
    given, ticks = engine.inputs(made, rows), made.structure.schedule.ticks
    _, expected = prepared.kernel.run(given, ticks, record=False)
    tangent = differentiated(prepared.recording, prepared.program.inputs, never)
    directions = np.hstack([given, np.random.default_rng(3).normal(size=given.shape)])
    _, found = backends.load(tangent, lanes).run(directions, ticks, record=False)
    width = expected.shape[1]
    np.testing.assert_array_equal(found[:, :width], expected)
    slopes = dict(zip(tangent.program.outputs, found.T, strict=True))
    assert np.all(slopes[HEAD + "metric:volts"] != 0.0)
