"""Output of `met linear`: poles, natural modes, and margins of loops, of one case at an instant."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from ic.printing.columns import columns, count
from met.analysis.linear.answers import Linearized, OpenLoop, Pole
from met.analysis.linear.margins import LoopMargins

MOST_POLES = 40
"""Largest number of rows of a table of poles."""

LEAST_SHARE = 0.05
"""Share of a mode from which on a participant is named."""


def linear_lines(found: Linearized, cases: int = 1) -> Iterator[str]:
    """The answers in lines. cases: the number of the experiment's cases, of which this is one"""
    case = f", case #{found.case} of {cases}" if cases > 1 else ""
    states = count(len(found.states), "state")
    yield f"{found.experiment}{case}: linear {found.where}, a period of {_time(found.seconds)}, {states}"
    for name in found.held:
        yield f"  {name} {'is locked' if name in found.locked else 'sticks, and is held'}"
    for each in found.creeping:
        yield f"  {each.name} creeps at {abs(each.rate):.3g} {each.unit}: the answer holds for moves slower than that"
    for path in found.at_limit:
        yield f"  at its limit: {path}"
    yield ""
    yield "poles of the program"
    yield from _table([("z", *_HEAD)], [(_complex(pole.z), *_row(found, pole)) for pole in found.poles])
    natural = found.natural
    if natural:
        yield ""
        yield "natural modes, while computers hold what they hold"
        yield from _table([_HEAD], [_row(found, each) for each in natural])
    for loop in found.loops:
        yield ""
        yield from _loop_lines(loop, found)


_HEAD = ("Hz", "damping", "by e in", "who takes part")


def _row(found: Linearized, pole: Pole) -> tuple[str, ...]:
    if math.isinf(pole.hz):
        return "-", "-", "at once", _parts(found, pole)
    stays = pole.stays(found.seconds)
    way = " grows" if pole.s.real > 0.0 and not stays else ""
    return (
        f"{0.0 if stays and pole.hz * found.seconds < 1e-6 else pole.hz:.4g}",
        "-" if stays else f"{pole.damping:.3f}",
        "stays" if stays else _time(pole.seconds) + way,
        _parts(found, pole),
    )


def _parts(found: Linearized, pole: Pole) -> str:
    """Joints by their shares, each with its state of the largest share."""
    told: list[str] = []
    for joint, share in found.by_joint(pole):
        if share < LEAST_SHARE and told:
            break
        state = next(name for name, _ in pole.shares if found.joints[name] == joint)
        told.append(f"{joint} {100.0 * share:.0f} % ({_of_joint(state, joint)})")
    return ", ".join(told)


def _of_joint(state: str, joint: str) -> str:
    """A state's name without its joint's."""
    return state.removeprefix(joint).lstrip(".:").removeprefix("servo.")


def _table(head: Sequence[tuple[str, ...]], rows: Sequence[tuple[str, ...]]) -> Iterator[str]:
    width = len(head[0])
    if not rows:
        yield "  none: nothing moves"
        return
    yield from columns([*head, *rows[:MOST_POLES]], right=range(width - 1))
    if len(rows) > MOST_POLES:
        yield f"  and {len(rows) - MOST_POLES} more, faster: `--format json` has them all"


def _loop_lines(loop: OpenLoop, answers: Linearized) -> Iterator[str]:
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
    most = no_limit(loop) if up is None else f"{up:.4g} times{_at(loop.margins, 'at_gain_up')}"
    least = "" if down is None else f"; down to {down:.4g} times{_at(loop.margins, 'at_gain_down')}"
    rows = [("gain", f"{most}{least}")]
    found = loop.margins
    if found is not None:
        if found.phase is None:
            rows.append(("phase", "no limit: the loop's gain is below 1 everywhere"))
        else:
            rows.append(("phase", f"{math.degrees(found.phase):.4g} deg{_at(found, 'at_phase')}"))
        if found.delay is not None:
            rows.append(("delay", f"{_time(found.delay)}, {found.delay / period:.3g} periods{_at(found, 'at_delay')}"))
        low, high = found.disk_gain
        both = f"{low:.3g} to {high:.3g} times the gain and {math.degrees(found.disk_phase):.3g} deg at once"
        rows.append(("disk", f"{found.disk:.4g}: {both}{_at(found, 'at_disk')}"))
    elif not several:
        rows.append(("phase", f"none is told: the law ticks {loop.ticks} times a period, which is no loop of one rate"))
    yield from columns(rows)


def no_limit(loop: OpenLoop) -> str:
    """The words about a loop whose gain has no upper limit, or none within the searched range."""
    return "no limit" if loop.searched is None else f"more than {loop.searched:,.0f} times"


def _at(found: LoopMargins | None, name: str) -> str:
    w = None if found is None else getattr(found, name)
    return "" if w is None else f", at {w / (2.0 * math.pi):.4g} Hz"


def _time(seconds: float) -> str:
    return f"{1e3 * seconds:.4g} ms" if seconds < 1.0 else f"{seconds:.4g} s"


def _complex(z: complex) -> str:
    return f"{z.real:.6f}" if z.imag == 0.0 else f"{z.real:.6f} ± {z.imag:.6f}i"


def as_data(found: Linearized) -> dict[str, Any]:
    """The answers for programs."""

    def pole(each: Pole) -> dict[str, Any]:
        return {
            "z": [each.z.real, each.z.imag],
            "s": [each.s.real, each.s.imag] if math.isfinite(each.s.real) else None,
            "hz": each.hz if math.isfinite(each.hz) else None,
            "damping": each.damping,
            "shares": dict(each.shares),
        }

    def loop(each: OpenLoop) -> dict[str, Any]:
        found = each.margins
        told: dict[str, Any] = {"opened": list(each.paths), "stable": each.stable, "returns": each.returns}
        told |= {"gain_down": each.gains[0], "gain_up": each.gains[1], "gain_searched_to": each.searched}
        if found is not None:
            told |= {"phase": found.phase, "delay": found.delay, "disk": found.disk}
            told |= {name: getattr(found, name) for name in ("at_gain_up", "at_gain_down", "at_phase", "at_delay")}
            told["at_disk"] = found.at_disk
        return told

    return {
        "experiment": found.experiment,
        "case": found.case,
        "time": found.time,
        "stands": found.stands,
        "period": found.seconds,
        "states": list(found.states),
        "inputs": list(found.inputs),
        "outputs": list(found.outputs),
        "held": list(found.held),
        "locked": list(found.locked),
        "creeping": [{"name": each.name, "rate": each.rate} for each in found.creeping],
        "at_limit": list(found.at_limit),
        "poles": [pole(each) for each in found.poles],
        "natural": [pole(each) for each in found.natural],
        "loops": [loop(each) for each in found.loops],
    }
