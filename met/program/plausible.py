"""Rates that no arm has: a case whose motion has run away numerically has failed, though its numbers are still numbers.

The measure is a case's own, made when it starts: the fastest rate with which a joint or free body begins, or `FAST`
where all begin slower. Motors, gravity and springs do not add three orders of magnitude to it, which is doubtful, and
still less six, which is a failure; what a step that is too long blows up passes both within some dozen steps. It bounds
energy as well, which goes with the square of the rates. One number serves rad/s and m/s alike: the links of an arm are
some metres long.

Rates are looked at every few steps, outside of the state: no bit of a run depends on it.
"""

from __future__ import annotations

from collections.abc import Sequence

from met.plan import Schedule
from met.program import cells
from met.trace import Real, absolute, both, maximum, where
from met.trace.program import Tape

FAST = 1e3
"""rad/s, m/s: faster than a joint of an arm turns or slides, and than what it carries flies off."""

DOUBTFUL, FAILED = 1e3, 1e6
"""Times the measure from which a rate is doubtful, and from which the case has failed."""

MEASURE, DOUBTFUL_TICK, FAILED_TICK, OF = "fast.measure", "fast.doubtful", "fast.failed", "fast.of"
OUTPUTS = (MEASURE, DOUBTFUL_TICK, FAILED_TICK, OF)
"""Outputs: the measure, rad/s (m/s); the first ticks at which a rate was seen to be doubtful, and a failure (0: none);
the number of the joint or body whose was doubtful first, as the output `failure.joint` has it."""

SPARSE = range(32, 15, -1)
"""Steps of the dynamics from one look to the next; the first that the run's last step is a multiple of."""


def divisor(schedule: Schedule) -> int:
    """Base ticks between two looks: the last is at the run's end, where that fits."""
    steps = schedule.ticks // schedule.dynamics
    return schedule.dynamics * next((n for n in SPARSE if steps % n == 0), SPARSE[-1])


def start(tape: Tape, coordinates: Sequence[str]) -> None:
    """Write a case's measure, from the rates with which joints and free bodies begin."""
    fastest: Real = FAST
    for name in coordinates:
        fastest = maximum(fastest, absolute(tape.read(f"{name}.qd")))
    tape.write(MEASURE, fastest)


def watch(tape: Tape, coordinates: Sequence[str], numbers: Sequence[int]) -> None:
    """Look at the rates of these coordinates. numbers: of the joint or body that each is of."""
    fastest: Real = 0.0
    of: Real = 0.0
    for name, number in zip(coordinates, numbers, strict=True):
        size = absolute(tape.read(f"{name}.qd"))
        faster = size > fastest
        fastest, of = where(faster, size, fastest), where(faster, float(number), of)
    measure = tape.read(MEASURE)
    doubtful = both(fastest >= DOUBTFUL * measure, tape.read(DOUBTFUL_TICK) == 0.0)
    cells.keep(tape, doubtful, OF, of)
    cells.keep(tape, doubtful, DOUBTFUL_TICK, tape.tick)
    failed = both(fastest >= FAILED * measure, tape.read(FAILED_TICK) == 0.0)
    cells.keep(tape, failed, FAILED_TICK, tape.tick)
