"""The timing of this computer and a line, measured with a bed that is not armed, in a process of its own:
`python -m hw.driving.jitter`, which reads a line of JSON, a `JitterRequest`.

It runs the loop of `hw.driving.loop` as a run has it, but that the bed is read and told nothing. On its standard output
is a line of JSON each: {"said": words}, {"about": ...}, at the end {"kept": ...} (`JitterResult`) or
{"wrong": diagnostics}.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import asdict, replace

import numpy as np

from hw.bed import Capability
from hw.drivers import opened
from hw.driving import loop, process
from hw.driving.case import pace_of
from hw.driving.pace import Pace
from hw.driving.timing import Timing, stops, time_spread, timing
from hw.ports import Port
from hw.recording.records import ANSWERED, LAYOUT
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.plan import file as plan_file


@frozen
class JitterRequest:
    """The measurement that the process is to make.

    port, baud   where the bed is
    plan, joint  for a simulated bed: plan of one experiment, as text (met.plan.file), and its joint; else ""
    hz, joints   periods a second, and exchanges in each, one a joint;  seconds: length of the measurement
    """

    port: str
    hz: float
    seconds: float
    joints: int = 1
    baud: int = 921600
    plan: str = ""
    joint: str = ""


@frozen
class JitterResult:
    """The measurement. seconds: that it took;  timing: lateness of the first exchange of a period, trips of all;
    stops: how often a run would have been stopped"""

    seconds: float
    timing: Timing
    stops: int


def measure(request: JitterRequest) -> JitterResult:
    """Measure the timing of exchanges with a bed that is not armed. Raises Problem."""
    stop_requested = process.listening()
    experiment = plan_file.loads(request.plan).experiments[0] if request.plan else None
    period = 1.0 / (request.hz * request.joints) if experiment is None else pace_of(experiment).period
    rows: list[bytes] = []
    with opened(Port(request.port, request.baud), experiment, request.joint, 0, period) as bed:
        about = bed.connect()
        process.say(about={"name": about.name, "firmware": about.firmware})
        process.warnings(bed)
        if Capability.LOCK_STEP in about.capabilities:
            message = f"bed `{about.name}` has no time of its own, so that nothing can be late"
            raise Problem(error("E426", message, help="a line, or `--port firmware`, has one; `met bed run` drives it"))
        process.precedence()
        pace = Pace(request.hz, 1)
        bed.patience = pace.patience(False)
        begun = time.perf_counter()
        ended = loop.drive(
            [bed] * request.joints,
            _nothing,
            pace,
            math.ceil(request.seconds * request.hz),
            rows.append,
            lock_step=False,
            armed=False,
            stop_requested=lambda: stop_requested() or time.perf_counter() - begun > request.seconds,
        )
        if ended.bed >= 0:
            message = f"bed `{about.name}` was reset while it was measured"
            raise Problem(error("E427", message, help="look at its supply, and whether its watchdog resets it"))
    return jitter_result(np.frombuffer(b"".join(rows), LAYOUT), about.tick_hz, request.hz)


def jitter_result(rows: np.ndarray, tick_hz: float, hz: float) -> JitterResult:
    """The figures from the records of one bed that was read once for each joint, `hz` times a second."""
    first = rows[rows["bed"] == 0]
    own = rows[rows["exchange"] > 0]
    answered = (own["flags"] & ANSWERED) != 0
    figures = replace(
        timing(first, tick_hz),
        exchanges=len(own),
        trip=time_spread((own["ended"] - own["began"])[answered]),
        unanswered=int((~answered).sum()),
    )
    return JitterResult(float(rows["ended"][-1]) * 1e-9, figures, stops(first, 1.0 / hz))


def _nothing(e: int, rates: Sequence[float], commands: list[list[float]]) -> None:
    """Compute no commands: the bed is only read."""


if __name__ == "__main__":
    process.answer(JitterRequest, lambda request: {"kept": asdict(measure(request))})
