"""The loop that drives beds: wait, exchange, compute, at every period of the wire.

    t_0       the beds are armed; their first sample
    t_e       what was computed from sample e - 1 is told; sample e is answered; it is computed what to tell next

A bed with a time of its own is spoken to at t_e = t_0 + e * period, so that what is computed from a sample is held one
period later. A bed in lock-step advances by a period with each exchange, as fast as it can.

The same loop looks at beds that are not armed, to measure how well it keeps its time: it reads them and tells them
nothing. It then goes on through whatever would end a run, for that is what is to be counted.

Whatever ends the loop, every bed is told to stop before it returns or raises.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

from hw.bed import BedDriver, BedSample, BedState, Fault
from hw.driving.pace import MISSED, Pace
from hw.recording import records
from hw.refusals import interlocked
from met.frozen import frozen

SPIN = 60e-6
"""Time before an exchange, s, at which the host wakes to watch the clock: a process that sleeps wakes some 50 us
late. Not longer, for the system throttles a process that only watches clocks."""


class Compute(Protocol):
    """The computing of commands between two exchanges with the beds."""

    def __call__(self, e: int, rates: Sequence[float], commands: list[list[float]]) -> None:
        """Compute the commands after exchange `e`: [voltage V, current A] of each bed, changed in place. rates: rad/s,
        one a bed."""


@frozen
class LoopEnd:
    """The end of a loop.

    exchanges  number that were done and answered by all beds, the first sample counted
    why        the reason of an early end, in words; "" where it did not end early
    bed        the number of the bed on which it ended; -1 for none
    faults     that this bed had latched
    """

    exchanges: int
    why: str = ""
    bed: int = -1
    faults: Fault = Fault(0)


Put = Callable[[bytes], None]
"""Takes a record, as bytes (hw/recording/records.py)."""


def drive(
    beds: Sequence[BedDriver],
    compute: Compute,
    pace: Pace,
    exchanges: int,
    put: Put,
    *,
    lock_step: bool,
    stop_requested: Callable[[], bool] = lambda: False,
    armed: bool = True,
) -> LoopEnd:
    """Arm the beds, drive them through `exchanges` exchanges after the first sample, and stop them.

    lock_step      whether they have no time of their own
    armed          False: they are only read. Where the host is as far behind as would end a run, or a bed as silent,
                   it leaves out the periods that are gone, and goes on
    stop_requested  looked at before each exchange
    """
    silent = -1
    try:
        ended = _driven(beds, compute, pace, exchanges, put, lock_step, stop_requested, armed)
        silent = ended.bed
        return ended
    finally:
        for _, bed in sorted(
            enumerate(beds), key=lambda numbered_bed: numbered_bed[0] == silent
        ):  # the others need not wait for it
            bed.stop()


def _driven(
    beds: Sequence[BedDriver],
    compute: Compute,
    pace: Pace,
    exchanges: int,
    put: Put,
    lock_step: bool,
    stop_requested: Callable[[], bool],
    armed: bool,
) -> LoopEnd:
    """Run the loop over beds that are armed, or only read, and record each of their samples; returns after how many
    exchanges it ended, and why where that was before the last.

    compute  takes the number of the exchange, the rates read (rad/s) and the list of commands, which it changes
    pace     of the exchanges;  put: takes a packed record
    """
    clock, packed = time.perf_counter_ns, records.packed
    period = round(pace.period * 1e9)
    if armed and stop_requested():
        return LoopEnd(0, "the host was asked to stop")
    commands = [[0.0, 0.0] for _ in beds]
    rates = [0.0] * len(beds)
    missed = [0] * len(beds)
    for b, bed in enumerate(beds):
        sample = bed.arm() if armed else bed.read()
        rates[b] = sample.rate
        put(packed(0, b, 0, (0, 0, 0, 0), 0.0, 0.0, sample))
        # it may have been armed by the first of two asks
        if ending := _ending(0, b, replace(sample, refused=False), armed):
            return ending
    compute(0, rates, commands)
    origin, computed, ended, gone = clock(), 0, 0, 0
    for e in range(1, exchanges + 1):
        if stop_requested():
            return LoopEnd(e, "the host was asked to stop")
        due, flags = e * period + gone, 0
        if lock_step:
            due = clock() - origin
        else:
            woken = _waited(origin + due)
            late = woken - origin - due
            if late >= period:
                flags = records.LATE_WOKEN
                if computed > due:
                    flags = records.LATE_ANSWERED if ended > due else records.LATE_COMPUTED
                if late >= MISSED * period:
                    if armed:
                        return LoopEnd(e, f"the host is {late * 1e-6:.3g} ms behind: {_LATE[flags]}")
                    gone += late
        for b, bed in enumerate(beds):
            voltage, current = commands[b]
            began = clock() - origin
            answer = bed.exchange(voltage, current) if armed else bed.look()
            ended = clock() - origin
            put(packed(e, b, flags, (due, began, ended, computed), voltage, current, answer))
            if answer is None:
                missed[b] += 1
                if armed and missed[b] >= MISSED:
                    return LoopEnd(e, f"no answer for {MISSED} exchanges", b)
                continue
            missed[b] = 0
            rates[b] = answer.rate
            if ending := _ending(e, b, answer, armed):
                return ending
        compute(e, rates, commands)
        computed = clock() - origin
    return LoopEnd(exchanges + 1)


_LATE = {
    records.LATE_COMPUTED: "it computed too long",
    records.LATE_WOKEN: "it was not woken in time",
    records.LATE_ANSWERED: "it waited for answers",
}


def _waited(due: int) -> int:
    """Wait until a time of the clock, ns. Returns the time then."""
    clock = time.perf_counter_ns
    left = (due - clock()) * 1e-9 - SPIN
    if left > 0.0:
        time.sleep(left)
    while (now := clock()) < due:
        pass
    return now


def _ending(e: int, b: int, sample: BedSample, armed: bool) -> LoopEnd | None:
    """The end of the loop where a bed takes commands no more, or, if it is only read, where it was reset; else None."""
    if sample.greeted and (not armed or (sample.state == BedState.ARMED and not sample.refused)):
        return None
    if not sample.greeted:
        return LoopEnd(e, "the bed was reset", b)
    if sample.state == BedState.STOPPED:
        names = ", ".join(fault.name.lower().replace("_", " ") for fault in Fault if fault in sample.faults)  # type: ignore[union-attr]
        names = "; ".join([names or "it does not say why", *(why for why, _ in interlocked(sample.interlock))])
        return LoopEnd(e, f"the bed stopped itself: {names}", b, sample.faults)
    return LoopEnd(e, "the bed is not armed any more" if not sample.refused else "the bed refused a command", b)
