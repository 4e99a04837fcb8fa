"""The declaration of a bed model: a drive motor and a load motor on one shaft, a wire to them, and the reading.

The wire carries the drive motor's voltage and the load motor's current, held by the amplifiers from one tick to the
next, and brings back the filtered rate of the shaft, once a tick. A bed model simulates that; a real bed takes its
place at the wire, and the model then serves as its description. Drivers of real beds are in hw/beds.

`PARAMETERS`, `SIMULATION_PARAMETERS` and `MEMORY` are all names of a bed model that code outside of it reads.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any, Literal

from met.frozen import frozen
from met.parameter import Declaration, Memory, Parameter
from met.trace import Real, Truth


@frozen
class Wire:
    """The values that the amplifiers hold: the drive's command (`DRIVES`), and the current of the load motor, A."""

    drive: Real
    current: Real

    @property
    def voltage(self) -> Real:
        """Voltage of the drive motor, V, on a bed whose drive is commanded one."""
        return self.drive


DriveCommand = Literal["voltage", "torque", "rate"]
"""The quantity that the drive of a bed is commanded: there the servo's law ends and the drive's begins."""

DRIVES: Mapping[DriveCommand, tuple[str, str]] = {
    "voltage": ("V", "all of the servo's law is ours: its voltage is on the drive motor"),
    "torque": ("N*m", "the drive has a current loop of its own: it takes the torque of the motor as its command"),
    "rate": ("rad/s", "the drive has a rate loop of its own: it takes the rate of the shaft as its command"),
}
"""The unit of each command, and the part of the law that the drive then has."""

Draw = Callable[[str], Real]
"""A function that gives a normal deviate of mean 0 and variance 1, by the name of its channel: one a tick, the same
however it is run."""


PARAMETERS = (
    Parameter(name="inertia", unit="kg*m^2", doc="inertia of the shaft with both rotors"),
    Parameter(name="kt_load", unit="N*m/A", doc="torque constant of the load motor"),
    Parameter(name="f_cut", unit="Hz", doc="cut-off of the tachometer's filter, a Butterworth low-pass of order 2"),
    Parameter(
        name="delay", at_most=3.0, whole=True, doc="ticks from reading the rate to acting on it: a whole number to 3"
    ),
)
"""Parameters that every bed model declares, under these names and in these units: the laws read them.

The load current is the law's torque over `kt_load`; the balance of torques has `inertia`; the observer has `inertia`,
`f_cut` and `delay`. `met bed identify` begins its search at `kt_load` and `f_cut`.
"""

SIMULATION_PARAMETERS = (
    Parameter(name="kt", unit="N*m/A", doc="torque constant of the drive motor"),
    Parameter(name="resistance", unit="ohm", doc="armature resistance of the drive motor"),
    Parameter(name="tau_max", unit="N*m", doc="largest torque of the drive motor"),
    Parameter(name="f_c", unit="N*m", doc="Coulomb friction of the shaft"),
    Parameter(name="f_v", unit="N*m*s/rad", doc="viscous friction of the shaft"),
    Parameter(name="i_max", unit="A", doc="limit of the load motor's amplifier"),
)
"""Parameters that a bed model declares besides where `met bed` is to simulate it.

At `--port emulated` the bed's limit of current is `i_max`; at `firmware` and `qemu` the firmware's guard knows the
shaft by all of them. A bed model without some of them runs under `met run` and on a real bed; those ports refuse it
(E429).

`converter_voltage` (V), `converter_current` (A) and `converter_in` (rad/s) are optional: the steps of the bed's
converters, which become the counts of the wire. Without them, or at 0, a count is 2^-20 of the unit.
"""

MEMORY = (Memory(name="shaft_rate", unit="rad/s", doc="rate of the shaft itself"),)
TORQUE = Memory(name="motor_torque", unit="N*m", doc="torque of the drive motor")
"""Memory that every bed model has; a model whose drive is commanded a rate has `TORQUE` too, which is not known
otherwise. A model may have `shaft_angle` (rad), which a simulated bed's encoder then reads; without it the encoder
stays at 0."""


def of_bed(drive: DriveCommand) -> tuple[tuple[str, str, str], ...]:
    """Name, unit and meaning of the numbers that the engine holds for a bed, besides the memory of its model."""
    meaning = "voltage on the drive motor" if drive == "voltage" else f"{drive} that the drive is commanded"
    return (f"drive_{drive}", DRIVES[drive][0], meaning), ("load_current", "A", "current in the load motor")


@frozen(kw_only=True)
class BedModel(Declaration):
    """A bed that the engine simulates; one a file. `check` finds faults of a declaration.

    parameters  its numbers; `PARAMETERS` are among them
    memory    its state, recorded under its names; `MEMORY` is among them
    begin     (p, w) -> the memory of a shaft that has turned at w rad/s for long
    advance   (p, held, wire, time, draw) -> the memory after `time` s, by name
    read      (p, held) -> the filtered rate as the computer reads it, rad/s
    taken     (p, wire) -> what the amplifiers make of a command, converters and limits; whether a limit held it back
    presets   by the word `faults`, a parameter of shape text: values of parameters that a deck does not write
    drive     what its drive is told, one of `DRIVES`
    """

    memory: tuple[Memory, ...]
    begin: Callable[[Any, Real], Mapping[str, Real]]
    advance: Callable[[Any, Any, Wire, float, Draw], Mapping[str, Real]]
    read: Callable[[Any, Any], Real]
    taken: Callable[[Any, Wire], tuple[Wire, Truth]]
    presets: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    drive: DriveCommand = "voltage"

    @property
    def shown(self) -> tuple[tuple[str, str, str], ...]:
        """Name, unit and meaning of all recordable numbers of a bed of this model, its own memory first."""
        return (*((memory.name, memory.unit, memory.doc) for memory in self.memory), *of_bed(self.drive))


def check(model: BedModel) -> tuple[str, str] | None:
    """The first fault of a declaration: words that go on after the model's name, and the remedy. None: it is sound."""
    for needed in PARAMETERS:
        parameters = [parameter for parameter in model.parameters if parameter.name == needed.name]
        if not parameters:
            return _missing("parameter", needed)
        if any(parameter.unit != needed.unit or parameter.shape != needed.shape for parameter in parameters):
            return _other_unit(needed, parameters[0])
        if needed.at_most is not None and not all(_within(parameter, needed.at_most) for parameter in parameters):
            message = f"lets `{needed.name}` be other than a whole number from 0 to {needed.at_most:g}"
            return message, f"declare it with `at_least=0.0, at_most={needed.at_most}, whole=True`"
    for needed_memory in (*MEMORY, *(TORQUE,) * (model.drive == "rate")):
        held = next((memory for memory in model.memory if memory.name == needed_memory.name), None)
        if held is None:
            whose = " whose drive is told a rate" if needed_memory is TORQUE else ""
            return _missing("memory", needed_memory, whose)
        if held.unit != needed_memory.unit:
            return _other_unit(needed_memory, held)
    return None


def _missing(kind: str, needed: Parameter | Memory, whose: str = "") -> tuple[str, str]:
    message = f"declares no {kind} `{needed.name}`, which every bed model has{whose}"
    return message, f"`{needed.name}`, {needed.unit}: {needed.doc}"


def _other_unit(needed: Parameter | Memory, declared: Parameter | Memory) -> tuple[str, str]:
    """The fault of a bed model that declares a number in another unit than all, and the remedy."""
    if declared.unit == needed.unit:
        return f"declares `{needed.name}`, which is no number", f"`{needed.name}`, {needed.unit}: {needed.doc}"
    message = f"declares `{needed.name}` in {declared.unit}, and every bed model has it in {needed.unit}"
    return message, f"`{needed.name}`, {needed.unit}: {needed.doc}"


def _within(parameter: Parameter, most: float) -> bool:
    """True where only whole numbers from 0 to `most` are allowed."""
    return parameter.whole and parameter.at_least == 0.0 and parameter.at_most is not None and parameter.at_most <= most
