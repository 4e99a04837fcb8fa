"""A motor bed under recorded commands, for many sets of parameters at once: the model of `emulated`, whose motors may
be out of line at any angle.

    J w' = tau_m(V, w) + Kt_load i - F_v w - s F_c + e
    e = sin_1 sin(theta) + cos_1 cos(theta) + sin_2 sin(2 theta) + cos_2 cos(2 theta)

theta is read, not computed: what is computed would run away from it.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from hw.identify.series import Series
from met import backends
from met.backends.backend import Kernel
from met.servos.motor import damping, torque
from met.substitution import butterworth, shaft
from met.substitution.emulated import SUBSTEP
from met.trace import cos, sin
from met.trace.program import CallPhase, Phase, Program, Tape, Unless0
from met.trace.recorder import record

MOTOR = ("kt", "resistance", "tau_max", "f_c", "f_v", "inertia", "kt_load", "f_cut")
RIPPLE = ("sin_1", "cos_1", "sin_2", "cos_2")
PARAMETERS = (*MOTOR, *RIPPLE)

LANES = 32

_GIVEN = ("voltage", "current", "time", "angle")


@lru_cache(maxsize=4)
def _kernel(count: int) -> Kernel:
    """The kernel of a bed whose steps have `count` substeps each."""

    def begin(tape: Tape) -> None:
        for name in ("rate", "filtered", "slope"):
            tape.write(name, 0.0 * tape.input("kt"))

    def advance(tape: Tape) -> None:
        """Record one step of the bed's shaft: rate, filtered rate and its slope after the input `time`, s."""
        p = {name: tape.input(name) for name in PARAMETERS}
        h = tape.input("time") / count
        decay = damping(p["kt"], p["resistance"], p["f_v"]) / p["inertia"]
        coefficients = butterworth.over(p["f_cut"], h)
        load, voltage = p["kt_load"] * tape.input("current"), tape.input("voltage")
        w, angle, x = tape.read("rate"), tape.input("angle"), (tape.read("filtered"), tape.read("slope"))
        for _ in range(count):
            ripple = (
                p["sin_1"] * sin(angle)
                + p["cos_1"] * cos(angle)
                + p["sin_2"] * sin(2.0 * angle)
                + p["cos_2"] * cos(2.0 * angle)
            )
            smooth = torque(p["kt"], p["resistance"], p["tau_max"], voltage, w) + load - p["f_v"] * w + ripple
            after = shaft.slid(w, smooth, p["f_c"], inertia=p["inertia"], decay=decay, time=h)
            x = butterworth.along_line(coefficients, x, w, after)
            angle = angle + 0.5 * h * (w + after)
            w = after
        for name, value in (("rate", w), ("filtered", x[0]), ("slope", x[1])):
            tape.write(name, value)

    def read(tape: Tape) -> None:
        """Give out the filtered rate and the drive motor's current, A."""
        kt, w = tape.input("kt"), tape.read("rate")
        drive = torque(kt, tape.input("resistance"), tape.input("tau_max"), tape.input("voltage"), w)
        tape.output("rate", tape.read("filtered"))
        tape.output("drive_current", drive / kt)

    program = Program(
        base_hz=1000.0,
        start=(CallPhase(Phase("begin", begin)),),
        tick=(Unless0((CallPhase(Phase("advance", advance)),)),),
        end=(CallPhase(Phase("read", read)),),
        inputs=(*_GIVEN, *PARAMETERS),
        outputs=("rate", "drive_current"),
    )
    return backends.load(record(program), LANES)


def simulated(series: Series, sets: np.ndarray) -> np.ndarray:
    """The rate (rad/s) and the drive motor's current (A) that the model reads, [channel, step, set].

    sets  parameters [set, parameter] in the order of `PARAMETERS`, at most `LANES` sets
    """
    count = max(1, math.ceil(float(np.median(series.time)) / SUBSTEP - 1e-9))
    block_inputs = np.zeros((LANES, len(_GIVEN) + len(PARAMETERS)))
    block_inputs[:, len(_GIVEN) :] = sets[0]
    block_inputs[: len(sets), len(_GIVEN) :] = sets
    block = _kernel(count).block(block_inputs)
    steps = np.ascontiguousarray(np.column_stack([series.voltage, series.current, series.time, series.angle]))[
        :, :, None
    ]
    inputs, outputs, step = block.inputs[: len(_GIVEN)], block.outputs, block.step
    read = np.empty((len(steps), 2, LANES))
    starts = set(np.flatnonzero(np.diff(series.move, prepend=-1)).tolist())
    for n in range(len(steps)):
        inputs[:] = steps[n]
        if n in starts:
            step(0, 0)
        step(1, 1)
        read[n] = outputs
    return read.transpose(1, 0, 2)[:, :, : len(sets)]
