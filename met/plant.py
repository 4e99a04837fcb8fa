"""One joint's emulated bed alone, in place of a real one on the wire: in this process, or as C.

Its phases are those of the kernel that has the bed inside, over the same cells, so where the wire's period is the
servo's the bits are the same: each phase is a section of its own in both, and constants are the same ones. What a sweep
varies is settled for one case, with the kernel's own arithmetic. Seed and repeat of the noise are given when a bed
begins; the wire's ticks are counted from there.
"""

from __future__ import annotations

import numpy as np

from met import backends
from met.backends.c.emit import emit, literal
from met.frozen import frozen
from met.plan import Experiment, Formula
from met.program.build import build
from met.program.control.rate_drives import Mounted
from met.program.control.substituted import Substituted
from met.program.system import PARAMETER, System
from met.trace import Real
from met.trace.nodes import evaluate
from met.trace.program import CallPhase, Phase, Program, RunSection, Tape, Unless0
from met.trace.recorder import record

_INPUTS = ("voltage", "current", "rate", "seed", "repeat")
_OUTPUTS = ("rate", "shaft_rate", "shaft_angle")


def servo_period(experiment: Experiment) -> float:
    """The period of the servos whose motors are on beds, s."""
    return _beds(experiment).period


def plant_program(experiment: Experiment, joint: str, *, case: int = 0, period: float | None = None) -> Program:
    """The program of a joint's emulated motor bed: a drive motor and a load motor on one shaft, with its sensors.

    inputs   V and A that the amplifiers hold (N m or rad/s for V where the drive is told that); what `start` alone
             reads: rate of the shaft, rad/s; seed and repeat of the noise
    outputs  the filtered rate as the computer reads it, rad/s; rate (rad/s) and angle (rad) of the shaft itself, 0
             where the bed's model knows no `shaft_angle`

    case    row of the case table;  period: of the wire, s; the servo's where it is None
    """
    beds = _beds(experiment)
    on_bed = [mounted for mounted in beds.mounted if mounted.joint == joint]
    if not on_bed:
        raise ValueError(f"joint {joint!r} is not substituted")
    period = beds.period if period is None else period
    return _Phases(beds, on_bed[0], period, _settled(experiment, joint, case)).program()


class Plant:
    """A joint's emulated bed in this process, stepped tick by tick. Parameters as in `plant_program`.

    period  of a tick, s
    """

    def __init__(self, experiment: Experiment, joint: str, *, case: int = 0, period: float | None = None) -> None:
        self.period = servo_period(experiment) if period is None else period
        program = plant_program(experiment, joint, case=case, period=self.period)
        self._block = backends.load(record(program), 2).block(np.zeros((1, len(_INPUTS))))
        self._inputs, self._outputs = self._block.inputs, self._block.outputs
        self._tick = 0

    def start(self, rate: float, seed: float = 0.0, repeat: float = 0.0) -> float:
        """Start with a shaft that has turned at rate (rad/s) for long, and noise from its beginning; returns the
        filtered rate, rad/s."""
        self._inputs[:] = [[0.0], [0.0], [rate], [seed], [repeat]]
        self._tick = 0
        self._block.step(0, 0)
        return float(self._outputs[0, 0])

    def tick(self, voltage: float, current: float) -> float:
        """Run one tick with the amplifiers' held outputs, V and A; returns the filtered rate after it, rad/s."""
        self._inputs[0] = voltage
        self._inputs[1] = current
        self._tick += 1
        self._block.step(self._tick, self._tick)
        return float(self._outputs[0, 0])

    @property
    def shaft_rate(self) -> float:
        """Rate of the shaft itself, not of its encoder, rad/s."""
        return float(self._outputs[1, 0])

    @property
    def shaft_angle(self) -> float:
        """Angle of the shaft itself, rad, from 0 at the start."""
        return float(self._outputs[2, 0])


def plant_c(experiment: Experiment, joint: str, *, case: int = 0, period: float | None = None) -> str:
    """The program of `plant_program`, a joint's emulated motor bed, as C for a bed's firmware: the text of plant.c,
    whose functions hw/firmware/plant.h declares.

    Parameters as in `plant_program`.
    """
    period = servo_period(experiment) if period is None else period
    source = emit(record(plant_program(experiment, joint, case=case, period=period)))
    into, out = (
        {name: f"plant.{member}" for name, member in members.items()} for members in (source.inputs, source.outputs)
    )
    named = joint.replace("*/", "* /")
    return "\n".join(
        [
            f"/* The motor bed of joint {named} as simulated, a tick every {period} s. Written by MET. */",
            '#include "plant.h"',
            "",
            source.text,
            "static met_case plant;",
            "",
            f"const double plant_period = {literal(period)};",
            "",
            "void plant_start(double rate, double seed, double repeat)",
            "{",
            f"    {into['voltage']} = 0.0;",
            f"    {into['current']} = 0.0;",
            *(f"    {into[name]} = {name};" for name in ("rate", "seed", "repeat")),
            "    met_start(&plant);",
            "    met_tick(&plant, 0);",
            "    met_end(&plant);",
            "}",
            "",
            "void plant_tick(double voltage, double current)",
            "{",
            *(f"    {into[name]} = {name};" for name in ("voltage", "current")),
            "    met_tick(&plant, (int64_t)plant.tick + 1);",
            "    met_end(&plant);",
            "}",
            *(
                line
                for name in _OUTPUTS
                for line in ("", f"double plant_{name}(void)", "{", f"    return {out[name]};", "}")
            ),
            "",
        ]
    )


def bed_values(experiment: Experiment, joint: str, case: int = 0) -> dict[str, float]:
    """The numbers of a joint's motor bed in a case, SI, by the names of its parameters."""
    head = f"{joint}.bed."
    by_path = {path: quantity.value for path, quantity in experiment.parameters.items() if path.startswith(head)}
    by_path |= _settled(experiment, joint, case)
    return {path.removeprefix(head): value for path, value in by_path.items() if isinstance(value, float)}


def _beds(experiment: Experiment) -> Substituted:
    """The motor beds of an experiment's joints, without its arm."""

    def no_arm(tape: Tape) -> tuple[list[list[Real]], list[Real]]:
        raise AssertionError("a bed alone asks nothing of an arm")

    return Substituted(System(experiment), no_arm)


@frozen
class _Phases:
    """The phases of one bed. settled: the case's values of the parameters that vary, by path."""

    beds: Substituted
    mounted: Mounted
    period: float
    settled: dict[str, float]

    def program(self) -> Program:
        """The program of the bed alone: it begins at a rate, holds its inputs, advances by a period, and gives its
        readings."""
        names = ("settle", "begin", "hold", "bed", "read")
        settle, begin, hold, bed, read = (CallPhase(Phase(name, getattr(self, name))) for name in names)
        return Program(
            base_hz=1.0 / self.period,
            start=(settle, begin) if self.settled else (begin,),
            tick=(Unless0((hold, bed)),),
            end=(read,),
            inputs=_INPUTS,
            outputs=_OUTPUTS,
        )

    def settle(self, tape: Tape) -> None:
        for path, value in self.settled.items():
            tape.write(PARAMETER + path, value)

    def begin(self, tape: Tape) -> None:
        self.beds.begin_bed(tape, self.mounted, tape.input("rate"))

    def hold(self, tape: Tape) -> None:
        tape.write(f"{self.mounted.joint}.bed.drive_{self.mounted.bed.drive}", tape.input("voltage"))
        tape.write(f"{self.mounted.joint}.bed.load_current", tape.input("current"))

    def bed(self, tape: Tape) -> None:
        seed, repeat, tick = tape.input("seed"), tape.input("repeat"), tape.tick - 1.0
        self.beds.advance_bed(tape, self.mounted, self.period, seed=seed, repeat=repeat, tick=tick)

    def read(self, tape: Tape) -> None:
        """Give out the readings of the bed: its filtered rate, and rate and angle of the shaft itself."""
        tape.output("rate", self.beds.reading(tape, self.mounted))
        tape.output("shaft_rate", tape.read(f"{self.mounted.joint}.bed.shaft_rate"))
        knows_angle = any(memory.name == "shaft_angle" for memory in self.mounted.bed.memory)
        tape.output("shaft_angle", tape.read(f"{self.mounted.joint}.bed.shaft_angle") if knows_angle else 0.0)


def _settled(experiment: Experiment, joint: str, case: int) -> dict[str, float]:
    """Values of the varied parameters of a joint's bed in a case, by path, as the kernel's start computes them."""
    coordinates = {c.path: float(c.values[case]) for c in experiment.cases.coordinates}
    varying = {
        path: quantity.value.output
        for path, quantity in experiment.parameters.items()
        if isinstance(quantity.value, Formula) and path.startswith(f"{joint}.bed.")
    }
    if not varying:
        return {}
    # numbers that no phase of the kernel reads are not computed there
    plain = experiment.formulas.replay(coordinates)
    settled = {path: float(plain[output]) for path, output in varying.items()}
    recording = record(build(experiment))
    first = recording.start[0]
    assert isinstance(first, RunSection)
    section = recording.sections[first.section]
    values = evaluate(section.nodes, section.order, lambda node: coordinates.get(node[1], 0.0), arrays=False)
    for name, ref in section.stores:
        path = name.removeprefix(PARAMETER)
        if name != path and path in settled:
            settled[path] = float(-values[ref >> 1] if ref & 1 else values[ref >> 1])
    return settled
