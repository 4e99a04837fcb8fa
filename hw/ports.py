"""What a user calls a bed, `--port`: a serial line, or what stands for a bed where there is none.

/dev/ttyUSB0, socket://HOST:PORT   a line, or any other URL of pyserial's
emulated                           the deck's bed in this process, in lock-step
firmware                           the bed's firmware with the deck's bed as its plant, a program of its own
qemu                               the same as it runs on a Cortex-M3, in an emulator
FILE                               a transcript: what was answered then
"""

from __future__ import annotations

import os
from collections.abc import Mapping

from hw import refusals
from hw.bed import Bed, Capability
from hw.beds import emulated
from hw.beds.emulated import EmulatedBed
from hw.beds.replay import ReplayBed
from hw.beds.serial_line import BAUD, SerialBed
from hw.beds.simulated import SimulatedBed
from hw.build import Config, Shaft, Uncountable
from hw.protocol.frames import unframed
from hw.protocol.messages import Step
from hw.transcript import MAGIC, SENT, File, read
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.host.files import open_regular
from met.plan import Experiment
from met.program.control.plant import Plant, bed_values, plant_c

SIMULATED = EMULATED, FIRMWARE, QEMU = "emulated", "firmware", "qemu"
"""Ports that simulate a deck's bed."""


@frozen
class Port:
    """name: as above;  baud: of a line;  lock_step: whether simulated firmware is to have no time of its own
    transcript: a new file for what goes over the line"""

    name: str
    baud: int = BAUD
    lock_step: bool = False
    transcript: str | None = None


def opened(port: Port, experiment: Experiment | None, joint: str, row: int, period: float) -> Bed:
    """The bed of a joint of a case. period: s, from exchange to exchange; infinite for one that is only read. Without
    an experiment, only what is there without one. Raises Problem."""
    if experiment is None:
        if port.name in SIMULATED:
            helps = "give a deck, and the name of a run in it that substitutes a joint"
            raise Problem(error("E425", f"port `{port.name}` simulates a deck's bed, and there is no deck", help=helps))
        return SerialBed(port.name, period=period, baud=port.baud)
    if port.name == EMULATED and port.transcript is not None:
        helps = "`--port firmware` has one; with `--lock-step` it gives the same bits"
        raise Problem(error("E409", "an emulated bed has no line whose transcript could be kept", help=helps))
    if port.name == EMULATED:
        values = bed_values(experiment, joint, row)
        plant = Plant(experiment, joint, case=row, period=period)
        return EmulatedBed(plant, emulated.scales(values), emulated.limits(values, period))
    if port.transcript is not None and is_transcript(port.name):
        helps = f"leave out `--transcripts`: {port.name} is what it would be"
        raise Problem(error("E409", "a transcript has no line whose transcript could be kept", help=helps))
    keep = None if port.transcript is None else File(port.transcript)
    if port.name == FIRMWARE or port.name == QEMU:
        config = config_of(bed_values(experiment, joint, row), period, lock_step=port.lock_step)
        text = plant_c(experiment, joint, case=row, period=period)
        kind = "qemu" if port.name == QEMU else "firmware"
        try:
            return SimulatedBed(kind, config, text, period=period, transcript=keep)  # type: ignore[arg-type]
        except Uncountable as reason:
            raise refusals.uncountable(joint, reason) from None
    if is_transcript(port.name):
        return ReplayBed(port.name)
    return SerialBed(port.name, period=period, baud=port.baud, transcript=keep)


def in_lock_step(name: str, asked: bool) -> bool:
    """Whether the bed at a port has no time of its own. asked: whether a user says so of simulated firmware."""
    if is_transcript(name):
        sent = (unframed(each.data[:-1]) for each in read(name).records if each.kind == SENT)
        return any(payload is not None and payload[0] == Step.kind for payload in sent)
    return asked or name == EMULATED


def kind(name: str) -> str:
    """What a port is, where another of the same kind may be its stand-in: a line may get another name."""
    return name if name in SIMULATED or is_transcript(name) else "a line"


def is_transcript(name: str) -> bool:
    """Whether a port is a file that a run wrote."""
    if not os.path.isfile(name):
        return False
    with open_regular(name) as file:
        return file.read(len(MAGIC)) == MAGIC


def config_of(values: Mapping[str, float], period: float, *, lock_step: bool) -> Config:
    """Of the firmware that simulates a bed of these parameters."""
    names = ("kt", "resistance", "tau_max", "kt_load", "inertia", "f_c", "f_v", "f_cut")
    return Config(
        name="simulated", tick_hz=1.0 / period, deadman=emulated.DEADMAN, scales=emulated.scales(values),
        limits=emulated.limits(values, period), continuous_current=values["i_max"],
        shaft=Shaft(**{name: values[name] for name in names}),
        capabilities=Capability.ENCODER | (Capability.LOCK_STEP if lock_step else Capability(0)),
    )  # fmt: skip
