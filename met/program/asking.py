"""Runs of an integrator's `advance` up to its first unanswered question, or to its end.

A question is a call of `slope`. `advance` runs anew for each piece of the program, so it must ask the same questions
every time. Exceptions that it catches do not matter: once a question is open, everything that it does is ignored.
"""

from __future__ import annotations

from collections.abc import Sequence

from met.diagnostic import Problem, error
from met.frozen import frozen
from met.integrators.integrator import Integrator, Motion, Slope
from met.program.cells import Passing, answer
from met.trace import Graph, Real, Scalar


@frozen
class Question:
    """The question of an integrator for the slope at `state`, at the share `share` of its step."""

    share: Real
    state: Motion


def advance_with(integrator: Integrator, settled: Sequence[Slope], h: Real, y: Motion, k1: Slope) -> Motion | Question:
    """The state at the end of a step of h s from y, or the first question beyond the answers `settled`.

    Raises Problem E213 where `advance` raises anything, E214 where its result is not a state of the arm.
    """
    questions: list[Question] = []

    def slope(c: Real, state: Motion) -> Slope:
        """The slope at a stage, as asked by the integrator: the known answer, or _Unanswered raised where there is none
        yet. c: the stage's time as a share of the step"""
        if not isinstance(c, (float, int, Scalar)):
            raise TypeError(f"slope(c, y) was given a {type(c).__name__} for the share of the step")
        wrong = _wrong(state, y)
        if wrong:
            raise TypeError(f"slope(c, y) was given {wrong}")
        questions.append(Question(c, state))
        if len(questions) > len(settled):
            raise _Unanswered
        return settled[len(questions) - 1]

    try:
        end = answer(f"integrator `{integrator.name}`", integrator.advance, slope, h, y, k1)
    except (_Unanswered, Problem):
        if len(questions) <= len(settled):
            raise
    if len(questions) > len(settled):
        return questions[len(settled)]
    if len(questions) < len(settled):
        raise changed_count(integrator)
    wrong = _wrong(end, y)
    if wrong:
        message = f"integrator `{integrator.name}`: `advance` gives back {wrong}"
        raise Problem(error("E214", message, help="give back a state with all parts of the one it was given"))
    return end


def question_count(integrator: Integrator, joints: int, states: int, h: float) -> int:
    """The number of slopes that the integrator asks for in a step of h s, without the first stage's."""
    graph = Graph()

    def numbers(name: str, count: int) -> tuple[Scalar, ...]:
        return tuple(graph.input(f"{name}{i}") for i in range(count))

    def motion(name: str) -> Motion:
        return Motion(numbers(f"{name}.q", joints), numbers(f"{name}.qd", joints), numbers(f"{name}.x", states))

    y = motion("y")
    answers: list[Slope] = []
    k = motion("k0")
    k1 = Slope(y.qd, k.qd, k.x)
    while isinstance(advance_with(integrator, answers, h, y, k1), Question):
        k = motion(f"k{len(answers) + 1}")
        answers.append(Slope(k.q, k.qd, k.x))
        if len(answers) > MOST:
            raise changed_count(integrator)
    return len(answers)


MOST = 100
"""Largest number of slopes that an integrator may ask for: one that asks for more each time would never end."""


def changed_count(integrator: Integrator) -> Problem:
    """The error that an integrator asked for another number of slopes than before."""
    message = f"integrator `{integrator.name}`: `advance` asks for more slopes at one time than at another"
    return Problem(
        error(
            "E214",
            message,
            help=(
                f"ask for the same number, at most {MOST}, whatever the step's length is, and whether it is known",
                "keep nothing from call to call: `advance` is called once for each slope that it asks for, and more",
            ),
        )
    )


def _wrong(y: object, like: Motion) -> str:
    """The reason why a value is no state like this one, in words; empty where it is one."""
    if not isinstance(y, Motion):
        return f"a {type(y).__name__}, not a Motion"
    sizes, wanted = ([len(part) for part in (m.q, m.qd, m.x)] for m in (y, like))
    if sizes == wanted:
        return ""
    shapes = [f"{a} positions, {b} rates and {c} other states" for a, b, c in (sizes, wanted)]
    return f"a Motion of {shapes[0]}; the arm has {shapes[1]}"


class _Unanswered(Passing):
    """Raised for a question without an answer. It is not an Exception, so that a model that catches those does not
    catch it."""
