"""Output of `met linear`: poles, modes and margins of one case at an instant; with `--all-cases`, a row for each."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

from ic.printing.columns import columns, count, number
from met.analysis.linear.answers import Linearized, LinearQuestion, OpenLoop, Pole
from met.analysis.linear.margins import LoopMargins
from met.diagnostic import Problem

MOST_POLES = 40
"""Largest number of rows of a table of poles."""

LEAST_SHARE = 0.05
"""Share of a mode from which on a participant is named."""


def linear_lines(linearized: Linearized, cases: int = 1) -> Iterator[str]:
    """The answers in lines. cases: the number of the experiment's cases, of which this is one"""
    case = f", case #{linearized.case} of {cases}" if cases > 1 else ""
    states = count(len(linearized.states), "state")
    yield f"{linearized.experiment}{case}: linear {linearized.where}, a period of {_time(linearized.seconds)}, {states}"
    for name in linearized.held:
        yield f"  {name} {'is locked' if name in linearized.locked else 'sticks, and is held'}"
    for state in linearized.creeping:
        yield (
            f"  {state.name} creeps at {abs(state.rate):.3g} {state.unit}: the answer holds for moves slower than that"
        )
    for path in linearized.at_limit:
        yield f"  at its limit: {path}"
    yield ""
    yield "poles of the program"
    yield from _table([("z", *_HEAD)], [(_complex(pole.z), *_row(linearized, pole)) for pole in linearized.poles])
    natural = linearized.natural
    if natural:
        yield ""
        yield "natural modes, while computers hold what they hold"
        yield from _table([_HEAD], [_row(linearized, pole) for pole in natural])
    if math.isfinite(linearized.bending):
        yield f"first bending mode while computers hold their joints: {linearized.bending:.4g} Hz"
    if linearized.bandwidth > 0.0:
        way = f"from {linearized.inputs[0]} to {linearized.outputs[0]}"
        yield f"bandwidth {way}: {linearized.bandwidth:.4g} Hz"
    for loop in linearized.loops:
        yield ""
        yield from _loop_lines(loop, linearized)


_HEAD = ("Hz", "damping", "by e in", "who takes part")


def _row(linearized: Linearized, pole: Pole) -> tuple[str, ...]:
    """A row of the table of modes: frequency (Hz), damping, time to decay, and the states that take part."""
    if math.isinf(pole.hz):
        return "-", "-", "at once", _parts(linearized, pole)
    stays = pole.stays(linearized.seconds)
    way = " grows" if pole.s.real > 0.0 and not stays else ""
    return (
        f"{0.0 if stays and pole.hz * linearized.seconds < 1e-6 else pole.hz:.4g}",
        "-" if stays else f"{pole.damping:.3f}",
        "stays" if stays else _time(pole.seconds) + way,
        _parts(linearized, pole),
    )


def _parts(linearized: Linearized, pole: Pole) -> str:
    """Joints by their shares, each with its state of the largest share."""
    parts: list[str] = []
    for joint, share in linearized.by_joint(pole):
        if share < LEAST_SHARE and parts:
            break
        state = next(name for name, _ in pole.shares if linearized.joints[name] == joint)
        parts.append(f"{joint} {100.0 * share:.0f} % ({_of_joint(state, joint)})")
    return ", ".join(parts)


def _of_joint(state: str, joint: str) -> str:
    """A state's name without its joint's."""
    return state.removeprefix(joint).lstrip(".:").removeprefix("servo.")


def _table(head: Sequence[tuple[str, ...]], rows: Sequence[tuple[str, ...]]) -> Iterator[str]:
    """The table of modes, the first `MOST_POLES` of them, in lines."""
    width = len(head[0])
    if not rows:
        yield "  none: nothing moves"
        return
    yield from columns([*head, *rows[:MOST_POLES]], right=range(width - 1))
    if len(rows) > MOST_POLES:
        yield f"  and {len(rows) - MOST_POLES} more, faster: `--format json` has them all"


def _loop_lines(loop: OpenLoop, answers: Linearized) -> Iterator[str]:
    """Lines about an opened loop: whether it is stable, and its margins of gain, phase, delay and disk."""
    period, several = answers.seconds, len(loop.paths) > 1
    yield f"loops of {', '.join(loop.paths)}, all at once" if several else f"loop of {loop.paths[0]}"
    limits = ", ".join(answers.at_limit)
    if not loop.returns:
        servos = {path.rpartition(".")[0] for path in loop.paths}
        own = ", ".join(path for path in answers.at_limit if path.rpartition(".")[0] in servos)
        why = f" while at its limit: {own}" if own else ": what it would move is held, or the law is at its limit"
        yield f"  nothing comes back here{why}"
        return
    if not loop.stable:
        yield "  unstable as it is: a pole above grows" + (f", while at its limit: {limits}" if limits else "")
        return
    down, up = loop.gains
    most = no_limit(loop) if up is None else f"{up:.4g} times{_at_frequency(loop.margins, 'at_gain_up')}"
    least = "" if down is None else f"; down to {down:.4g} times{_at_frequency(loop.margins, 'at_gain_down')}"
    rows = [("gain", f"{most}{least}")]
    margins = loop.margins
    if margins is not None:
        if margins.phase is None:
            rows.append(("phase", "no limit: the loop's gain is below 1 everywhere"))
        else:
            rows.append(("phase", f"{math.degrees(margins.phase):.4g} deg{_at_frequency(margins, 'at_phase')}"))
        if margins.delay is not None:
            rows.append(
                (
                    "delay",
                    f"{_time(margins.delay)}, {margins.delay / period:.3g} periods{_at_frequency(margins, 'at_delay')}",
                )
            )
        low, high = margins.disk_gain
        both = f"{low:.3g} to {high:.3g} times the gain and {math.degrees(margins.disk_phase):.3g} deg at once"
        rows.append(("disk", f"{margins.disk:.4g}: {both}{_at_frequency(margins, 'at_disk')}"))
    elif not several:
        rows.append(("phase", f"none is told: the law ticks {loop.ticks} times a period, which is no loop of one rate"))
    yield from columns(rows)


def no_limit(loop: OpenLoop) -> str:
    """The words about a loop whose gain has no upper limit, or none within the searched range."""
    return "no limit" if loop.searched is None else f"more than {loop.searched:,.0f} times"


def _at_frequency(margins: LoopMargins | None, name: str) -> str:
    """The frequency at which a margin is, as `, at 3.2 Hz`. name: the field of `LoopMargins` that has it, rad/s"""
    w = None if margins is None else getattr(margins, name)
    return "" if w is None else f", at {w / (2.0 * math.pi):.4g} Hz"


def _time(seconds: float) -> str:
    """A duration as `4 ms` or `1.2 s`."""
    return f"{1e3 * seconds:.4g} ms" if seconds < 1.0 else f"{seconds:.4g} s"


def _complex(z: complex) -> str:
    """A pole, for its conjugate too: `0.980000 ± 0.010000i`."""
    return f"{z.real:.6f}" if z.imag == 0.0 else f"{z.real:.6f} ± {z.imag:.6f}i"


def as_data(linearized: Linearized) -> dict[str, Any]:
    """The answers for programs."""

    def pole(pole_: Pole) -> dict[str, Any]:
        """A pole for JSON: z, s (1/s), Hz, damping, and the share of each state."""
        return {
            "z": [pole_.z.real, pole_.z.imag],
            "s": [pole_.s.real, pole_.s.imag] if math.isfinite(pole_.s.real) else None,
            "hz": pole_.hz if math.isfinite(pole_.hz) else None,
            "damping": pole_.damping,
            "shares": dict(pole_.shares),
        }

    def loop(loop_: OpenLoop) -> dict[str, Any]:
        """An opened loop for JSON: stability, gains, and margins if it has any."""
        margins = loop_.margins
        answer: dict[str, Any] = {"opened": list(loop_.paths), "stable": loop_.stable, "returns": loop_.returns}
        answer |= {"gain_down": loop_.gains[0], "gain_up": loop_.gains[1], "gain_searched_to": loop_.searched}
        if margins is not None:
            answer |= {"phase": margins.phase, "delay": margins.delay, "disk": margins.disk}
            answer |= {name: getattr(margins, name) for name in ("at_gain_up", "at_gain_down", "at_phase", "at_delay")}
            answer["at_disk"] = margins.at_disk
        return answer

    return {
        "experiment": linearized.experiment,
        "case": linearized.case,
        "time": linearized.time,
        "stands": linearized.stands,
        "period": linearized.seconds,
        "states": list(linearized.states),
        "inputs": list(linearized.inputs),
        "outputs": list(linearized.outputs),
        "held": list(linearized.held),
        "locked": list(linearized.locked),
        "creeping": [{"name": state.name, "rate": state.rate} for state in linearized.creeping],
        "at_limit": list(linearized.at_limit),
        "bandwidth": linearized.bandwidth if math.isfinite(linearized.bandwidth) else None,
        "bending": linearized.bending if math.isfinite(linearized.bending) else None,
        "poles": [pole(pole_) for pole_ in linearized.poles],
        "natural": [pole(pole_) for pole_ in linearized.natural],
        "loops": [loop(loop_) for loop_ in linearized.loops],
    }


MOST_ROWS = 40
"""Number of cases that are listed, the first ones."""

Answer = Linearized | str
"""The answers of a case, or the reason why it has none."""


def answered(question: LinearQuestion) -> list[Answer]:
    """The answers of all cases. Raises Problem where the question itself is wrong."""
    answers = question.of_cases(range(question.experiment.cases.count))
    return [_why_not(answer) if isinstance(answer, Problem) else answer for answer in answers]


def _why_not(refused: Problem) -> str:
    """The reason why a case has no linear answer, without the case's name before it."""
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
        yield from _case_table(question, answers, head, partial(_of_loop, number_of))
        loops = {n: answer.loops[number_of] for n, answer in enumerate(answers) if isinstance(answer, Linearized)}
        yield from _tightest(loops)
    if not several:
        yield ""
        yield "least damped pole that swings"
        yield from _case_table(question, answers, ("damping", "Hz", "joint"), _swing)
    reasons = {case: answer for case, answer in enumerate(answers) if isinstance(answer, str)}
    if reasons:
        yield ""
        yield f"no answer in {count(len(reasons), 'case')} of {len(answers):,}"
        listed = list(reasons.items())[:MOST_ROWS]
        yield from columns([(f"#{question.experiment.cases.table[case]}", why) for case, why in listed])
        if len(reasons) > len(listed):
            yield f"  and {len(reasons) - len(listed):,} more: `--format json` has them all"


def _case_table(
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
    phases = {case: math.degrees(own.phase) for case, own in margins.items() if own.phase is not None}
    disks = {case: own.disk for case, own in margins.items()}
    tightest = []
    for text, by_case in (("gain {:.4g} times", gains), ("phase {:.4g} deg", phases), ("disk {:.4g}", disks)):
        if by_case:
            smallest, case = min((value, case) for case, value in by_case.items())
            tightest.append(f"{text.format(smallest)} in #{case}")
    if tightest and len(loops) > 1:
        yield f"  tightest: {', '.join(tightest)}"


def _swing(linearized: Linearized) -> tuple[str, ...]:
    """The cells of a case's least damped pole: damping, Hz, and the joint that swings most."""
    swings = [pole for pole in linearized.poles if pole.z.imag > 0.0]
    if not swings:
        return ("none swings",)
    worst = min(swings, key=lambda pole: pole.damping)
    return f"{worst.damping:.3f}", f"{worst.hz:.4g}", linearized.by_joint(worst)[0][0]
