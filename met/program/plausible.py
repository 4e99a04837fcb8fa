"""Implausible rates: a case whose motion has run away numerically has failed, though its numbers are still finite.

The measure is a case's own, made when it starts: the fastest rate with which a joint or free body begins, or `FAST`
where all begin slower. Motors, gravity and springs do not add three orders of magnitude to it, which is doubtful, and
still less six, which is a failure; a motion that diverges because of a too long step passes both within some dozen
steps. It bounds energy as well, which goes with the square of the rates. One number serves rad/s and m/s alike: the
links of an arm are some metres long.

Rates are looked at every few steps, outside of the state: no bit of a run depends on it.
"""

from __future__ import annotations

from collections.abc import Sequence

from met.plan import Schedule
from met.program import cells
from met.trace import Real, absolute, both, maximum, where
from met.trace.program import Tape

FAST = 1e3
"""rad/s, m/s: faster than a joint of an arm turns or slides, and than its payload flies off."""

DOUBTFUL, FAILED = 1e3, 1e6
"""Factors over the measure from which a rate is doubtful, and from which the case has failed."""

MEASURE, DOUBTFUL_TICK, FAILED_TICK, OF = "fast.measure", "fast.doubtful", "fast.failed", "fast.of"
OUTPUTS = (MEASURE, DOUBTFUL_TICK, FAILED_TICK, OF)
"""Outputs: the measure, rad/s (m/s); the first ticks at which a doubtful and a failed rate were seen (0: none); and the
number of the first joint or body with a doubtful rate, numbered as in the output `failure.joint`."""

SPARSE = range(32, 15, -1)
"""Candidates for the number of dynamics steps between checks; the first that divides the run's steps is used."""


def divisor(schedule: Schedule) -> int:
    """Base ticks between two checks: the last is at the run's end, where that fits."""
    steps = schedule.ticks // schedule.dynamics
    return schedule.dynamics * next((n for n in SPARSE if steps % n == 0), SPARSE[-1])


def start(tape: Tape, coordinates: Sequence[str]) -> None:
    """Write a case's measure, from the initial rates of joints and free bodies."""
    fastest: Real = FAST
    for name in coordinates:
        fastest = maximum(fastest, absolute(tape.read(f"{name}.qd")))
    tape.write(MEASURE, fastest)


def watch(tape: Tape, coordinates: Sequence[str], numbers: Sequence[int]) -> None:
    """Check the rates of these coordinates. numbers: those of their joints or bodies"""
    fastest: Real = 0.0
    fastest_number: Real = 0.0
    for name, number in zip(coordinates, numbers, strict=True):
        size = absolute(tape.read(f"{name}.qd"))
        faster = size > fastest
        fastest, fastest_number = where(faster, size, fastest), where(faster, float(number), fastest_number)
    measure = tape.read(MEASURE)
    doubtful = both(fastest >= DOUBTFUL * measure, tape.read(DOUBTFUL_TICK) == 0.0)
    cells.keep(tape, doubtful, OF, fastest_number)
    cells.keep(tape, doubtful, DOUBTFUL_TICK, tape.tick)
    failed = both(fastest >= FAILED * measure, tape.read(FAILED_TICK) == 0.0)
    cells.keep(tape, failed, FAILED_TICK, tape.tick)
