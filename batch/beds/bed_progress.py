"""Lines about cases on beds: their progress while they are driven, then how well the loop kept its time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from batch.beds.executor import OnBeds
from batch.beds.jitter import duration, off
from batch.terminal.progress import Bar
from hw.driving.timing import TimeSpread, Timing, timing
from hw.recording.records import ANSWERED
from met.messages.visible import say


class BedProgress:
    """Progress of a campaign on beds (`batch.campaigns.drive.Progress`): a case counts by the time that it has been
    driven."""

    def __init__(self, executor: OnBeds, *, quiet: bool, bar: Bar | None = None) -> None:
        self._executor, self._quiet = executor, quiet
        self._bar = bar or Bar()

    def begin(self, name: str, cases: int, done: int, failed: int, workers: str) -> None:
        if not self._quiet:
            self._bar.begin(name, cases, done, failed, workers)

    def advance(self, done: int, failed: int, more: str = "") -> None:
        if self._quiet:
            return
        driving = self._executor.driving
        if driving is None:
            self._bar.advance(done, failed, more)
            return
        seconds = driving.done
        driven = f"{seconds:.3g} of {driving.seconds:.6g} s"
        self._bar.advance(done + seconds / driving.seconds, failed, ", ".join(filter(None, [driven, more])))

    def end(self) -> None:
        if not self._quiet:
            self._bar.end()

    def say(self, line: str) -> None:
        """Print a line in the bar's place."""
        if not self._quiet:
            self._bar.end()
            say(line)


def timings(executor: OnBeds) -> dict[str, Timing]:
    """The timing of each joint's bed, over all cases; none where the beds are in lock-step and have no time."""
    timing_of = {}
    for joint in executor.ports:
        cases = executor.known.of(joint)
        if cases and not executor.lock_step:
            # a bed's ticks, and the host's clock, restart with each case
            drifts = [timing(rows, hz).drift for hz, rows in cases]
            known = [drift for drift in drifts if math.isfinite(drift)]
            drift = float(np.median(known)) if known else math.nan
            timing_of[joint] = replace(timing(np.concatenate([rows for _, rows in cases]), math.nan), drift=drift)
    return timing_of


WORST = 0.01
"""Share of exchanges without an answer, and error of a bed's clock, above which there is a warning."""


def timing_lines(executor: OnBeds) -> Iterator[str]:
    """Lines about the loop's timing, with a warning where it was bad."""
    for joint, times in timings(executor).items():
        late = times.woken + times.computed + times.waited
        parts = [
            ("late by", times.lateness),
            ("answered in", times.trip),
            ("computed in", times.computing),
        ]
        spreads = "; ".join(f"{what} {duration(spread.median)}, p99 {duration(spread.high)}" for what, spread in parts)
        yield f"{joint}: {times.exchanges:,} exchanges; {spreads}"
        yield (
            f"  a period late: {late:,} (woken too late {times.woken:,}, computing {times.computed:,}, waiting "
            f"{times.waited:,}); unanswered: {times.unanswered:,}; the bed's clock: {off(times.drift)}"
        )
        if abs(times.drift) > WORST:
            hz = executor.known.of(joint)[-1][0]
            yield (
                f"  warning: the bed says that it ticks at {hz:g} Hz, and ticks at {(1.0 + times.drift) * hz:.4g} Hz: "
                "its deadman and slew limits are not what it says; mend its timer, or its configuration"
            )
        if times.unanswered > WORST * times.exchanges:
            yield (
                f"  warning: {100.0 * times.unanswered / times.exchanges:.3g} % of the exchanges had no answer, and "
                "commands were held longer than was computed: `met bed jitter` and `met bed probe` say more of the line"
            )
    for joint in executor.ports if executor.lock_step else ():
        silent = sum(int(((rows["flags"] & ANSWERED) == 0).sum()) for _, rows in executor.known.of(joint))
        if silent:
            yield f"{joint}: unanswered: {silent:,}; such a run has not the bits of another"


def sidecar_entries(executor: OnBeds) -> Mapping[str, Any]:
    """The entries for the file beside the archive: the beds, and the loop's timing, s."""
    executor.know_all()
    timing_of = timings(executor)
    return {
        "beds": [
            {
                "joint": joint,
                "port": port,
                "baud": executor.baud,
                "lock_step": executor.lock_step,
                "beds": executor.known.beds[joint],
                **({"bench": executor.benches[joint]} if executor.benches[joint] else {}),
                "timing": _figures(timing_of[joint]) if joint in timing_of else None,
            }
            for joint, port in executor.ports.items()
        ]
    }


def _figures(times: Timing) -> dict[str, Any]:
    spreads = {"lateness": times.lateness, "trip": times.trip, "computing": times.computing}
    return {
        "exchanges": times.exchanges,
        **{name: _spread(spread) for name, spread in spreads.items()},
        "woken_late": times.woken,
        "computed_late": times.computed,
        "answered_late": times.waited,
        "unanswered": times.unanswered,
        "clock": times.drift if math.isfinite(times.drift) else None,
    }


def _spread(time_spread: TimeSpread) -> dict[str, float | None]:
    values = {
        "median": time_spread.median,
        "p99": time_spread.high,
        "p99.9": time_spread.highest,
        "largest": time_spread.largest,
    }
    return {name: round(value, 9) if math.isfinite(value) else None for name, value in values.items()}
