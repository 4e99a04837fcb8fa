"""Output of `met linear --all-cases`: a row for each case of a sweep, and the tightest one for each loop."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial

from batch.terminal.linear import no_limit
from ic.printing.columns import columns, count, number
from met.analysis.linear.answers import Linearized, LinearQuestion, OpenLoop
from met.diagnostic import Problem

MOST_ROWS = 40
"""Number of cases that are listed, the first ones."""

Answer = Linearized | str
"""The answers of a case, or the reason why it has none."""


def answered(question: LinearQuestion) -> list[Answer]:
    """The answers of all cases. Raises Problem where the question itself is wrong."""
    answers = question.of_cases(range(question.experiment.cases.count))
    return [_why_not(answer) if isinstance(answer, Problem) else answer for answer in answers]


def _why_not(refused: Problem) -> str:
    message = refused.diagnostics[0].message
    return message.partition(": ")[2] or message


def case_lines(question: LinearQuestion, answers: Sequence[Answer]) -> Iterator[str]:
    """The rows in lines: a table for each opened loop; without loops, the least damped pole of each case."""
    name, cases = question.experiment.name, count(len(answers), "case")
    where = "where it stands still" if question.stands else f"at t = {question.at:.6g} s"
    yield f"{name}: linear {where}, {cases}"
    several = [(path,) for path in question.opened] + ([question.opened] if len(question.opened) > 1 else [])
    for number_of, paths in enumerate(several):
        yield ""
        yield f"loop of {paths[0]}" if len(paths) == 1 else f"loops of {', '.join(paths)}, all at once"
        head = ("gain", "phase", "delay", "disk") if len(paths) == 1 else ("gain",)
        yield from _table(question, answers, head, partial(_of_loop, number_of))
        loops = {n: answer.loops[number_of] for n, answer in enumerate(answers) if isinstance(answer, Linearized)}
        yield from _tightest(loops)
    if not several:
        yield ""
        yield "least damped pole that swings"
        yield from _table(question, answers, ("damping", "Hz", "joint"), _swing)
    reasons = {case: answer for case, answer in enumerate(answers) if isinstance(answer, str)}
    if reasons:
        yield ""
        yield f"no answer in {count(len(reasons), 'case')} of {len(answers):,}"
        listed = list(reasons.items())[:MOST_ROWS]
        yield from columns([(f"#{question.experiment.cases.table[case]}", why) for case, why in listed])
        if len(reasons) > len(listed):
            yield f"  and {len(reasons) - len(listed):,} more: `--format json` has them all"


def _table(
    question: LinearQuestion,
    answers: Sequence[Answer],
    head: tuple[str, ...],
    cells: Callable[[Linearized], tuple[str, ...]],
) -> Iterator[str]:
    """A table of cases with what is varied, and the cells of each answer."""
    varied = question.experiment.cases.coordinates
    heads = [
        f"{coordinate.path} ({coordinate.unit})" if coordinate.unit not in ("", "1") else coordinate.path
        for coordinate in varied
    ]
    rows = [("case", *heads, *head)]
    for case, answer in enumerate(answers[:MOST_ROWS]):
        values = (number(float(coordinate.values[case]) / coordinate.scale) for coordinate in varied)
        cell_texts = cells(answer) if isinstance(answer, Linearized) else ("no answer",)
        rows.append((f"#{question.experiment.cases.table[case]}", *values, *cell_texts))
    yield from columns(rows, right=range(1, 1 + len(varied)))
    if len(answers) > MOST_ROWS:
        yield f"  and {len(answers) - MOST_ROWS} more: `--format json` has them all"


def _of_loop(place: int, linearized: Linearized) -> tuple[str, ...]:
    """The cells of a case's loop at this place among the requested ones."""
    loop = linearized.loops[place]
    if not loop.returns:
        return ("nothing comes back",)
    if not loop.stable:
        return ("unstable",)
    gain = no_limit(loop) if loop.gains[1] is None else f"{loop.gains[1]:.4g}"
    own = loop.margins
    if own is None:
        return (gain,)
    phase = "no limit" if own.phase is None else f"{math.degrees(own.phase):.4g} deg"
    delay = "no limit" if own.delay is None else f"{1e3 * own.delay:.4g} ms"
    return gain, phase, delay, f"{own.disk:.4g}"


def _tightest(loops: dict[int, OpenLoop]) -> Iterator[str]:
    """The cases with the smallest value of each margin."""
    unstable = [case for case, loop in loops.items() if loop.unstable]
    if unstable:
        some = ", ".join(f"#{case}" for case in unstable[:5]) + (" ..." if len(unstable) > 5 else "")
        yield f"  unstable in {len(unstable)} of {len(loops)} cases: {some}"
    gains = {
        case: loop.gains[1]
        for case, loop in loops.items()
        if loop.returns and loop.stable and loop.gains[1] is not None
    }
    margins = {case: loop.margins for case, loop in loops.items() if loop.margins is not None and loop.returns}
    phases = {case: loop_margins.phase for case, loop_margins in margins.items() if loop_margins.phase is not None}
    tightest = []
    if gains:
        case = min(gains, key=lambda case_number: gains[case_number] or math.inf)
        tightest.append(f"gain {gains[case]:.4g} times in #{case}")
    if phases:
        case = min(phases, key=lambda case_number: phases[case_number] or math.inf)
        tightest.append(f"phase {math.degrees(phases[case] or 0.0):.4g} deg in #{case}")
    if margins:
        case = min(margins, key=lambda case_number: margins[case_number].disk)
        tightest.append(f"disk {margins[case].disk:.4g} in #{case}")
    if tightest and len(loops) > 1:
        yield f"  tightest: {', '.join(tightest)}"


def _swing(linearized: Linearized) -> tuple[str, ...]:
    swings = [pole for pole in linearized.poles if pole.z.imag > 0.0]
    if not swings:
        return ("none swings",)
    worst = min(swings, key=lambda pole: pole.damping)
    return f"{worst.damping:.3f}", f"{worst.hz:.4g}", linearized.by_joint(worst)[0][0]
