"""The messages of the wire: a class for each, its fields in the order of the wire, in counts.

Values that do not fit on the wire raise `struct.error`: the sender checks first.
"""

from __future__ import annotations

import struct
from typing import get_args

from hw.bed import Capability, Limits, Scales
from hw.protocol.frames import framed
from met.frozen import frozen

VERSION = 1
NUMBERS = 1 << 16
"""The number of sequence numbers: each frame's is the one before plus one, modulo this."""

MOST = (1 << 31) - 1
"""Largest count that a value can have on the wire, either way."""

STATE = 3
"""The bits of a status that hold the state. All of them set is no state."""

_HEAD = struct.Struct("<BH")


# What the host says


@frozen
class HelloMessage:
    """HELLO, the question for a bed's description. version: the highest of the protocol that the host speaks"""

    word = "HELLO"
    kind = 0x01
    layout = struct.Struct("<B")
    version: int = VERSION


@frozen
class LimitMessage:
    """LIMIT, a tighter limit, in counts. which: 0 voltage, 1 current, 2 rate; 3 voltage and 4 current slew, a tick."""

    word = "LIMIT"
    kind = 0x02
    layout = struct.Struct("<Bi")
    which: int
    value: int


@frozen
class ArmMessage:
    """ARM: have commands taken from here on. session: the number that the bed gave in its answer to HELLO."""

    word = "ARM"
    kind = 0x03
    layout = struct.Struct("<I")
    session: int


@frozen
class DriveMessage:
    """DRIVE: voltage and current, in counts, that the amplifiers hold from now on."""

    word = "DRIVE"
    kind = 0x04
    layout = struct.Struct("<iix")
    voltage: int
    current: int


@frozen
class StepMessage:
    """STEP: as DRIVE, for a bed in lock-step, which then advances by `ticks` ticks, 1 to 255."""

    word = "STEP"
    kind = 0x05
    layout = struct.Struct("<iiB")
    voltage: int
    current: int
    ticks: int


@frozen
class StopMessage:
    """STOP: go to the safe state, disarmed."""

    word = "STOP"
    kind = 0x06
    layout = struct.Struct("<")


@frozen
class ClearMessage:
    """CLEAR: forget the faults that are latched."""

    word = "CLEAR"
    kind = 0x07
    layout = struct.Struct("<")


@frozen
class ReadMessage:
    """READ: answer with the present state and sensors."""

    word = "READ"
    kind = 0x08
    layout = struct.Struct("<")


@frozen
class PresetMessage:
    """PRESET, for a simulated plant. which: 0 start anew at a rate in rad/s, 1 seed of the noise, 2 its repeat."""

    word = "PRESET"
    kind = 0x09
    layout = struct.Struct("<Bd")
    which: int
    value: float


HostMessage = (
    HelloMessage
    | LimitMessage
    | ArmMessage
    | DriveMessage
    | StepMessage
    | StopMessage
    | ClearMessage
    | ReadMessage
    | PresetMessage
)
_HOST_MESSAGES: dict[int, type[HostMessage]] = {message.kind: message for message in get_args(HostMessage)}


# What the bed answers


@frozen
class HelloAnswer:
    """The answer to HELLO. firmware, name: the bytes as they come, filled up with zeros; the rest as in `About`."""

    kind = 0x81
    version: int
    capabilities: int
    session: int
    firmware: bytes
    name: bytes
    tick_hz: float
    deadman: float
    scales: Scales
    limits: Limits


@frozen
class OtherVersionAnswer:
    """The answer to HELLO of a bed that speaks another version of the protocol: the rest of it cannot be read."""

    version: int


@frozen
class LimitsAnswer:
    """LIMITS: the limits in force, in counts; slews in counts a tick."""

    kind = 0x82
    voltage: int
    current: int
    rate: int
    voltage_slew: int
    current_slew: int


@frozen
class SampleAnswer:
    """SAMPLE: status bits, tick, rate in counts. others: counts of angle, drive current and acceleration, and the
    interlock's reasons, those that the bed has."""

    kind = 0x84
    status: int
    tick: int
    rate: int
    others: tuple[int, ...]


Answer = HelloAnswer | OtherVersionAnswer | LimitsAnswer | SampleAnswer

_GREETING = struct.Struct("<BHBHI8s16s15d")
_IN_FORCE = struct.Struct("<BH5i")
_LAYOUTS = [struct.Struct(f"<BHHIi{n}i") for n in range(5)]

SENSORS = (Capability.ENCODER, Capability.DRIVE_CURRENT, Capability.ACCELEROMETER)
"""The capabilities that each add a sensor's number to a SAMPLE, in its order."""

READINGS = (*SENSORS, Capability.INTERLOCK)
"""The capabilities that each add a number to a SAMPLE, in its order."""


def frame_of(message: HostMessage, number: int) -> bytes:
    """The frame of a message with its sequence number, as it goes over the line."""
    body = message.layout.pack(*message.__dict__.values())
    return framed(_HEAD.pack(message.kind, number) + body)


def host_message(payload: bytes) -> tuple[int, HostMessage] | None:
    """Sequence number and message of a payload from the host; None for a payload that is no message."""
    kind, number = _HEAD.unpack_from(payload)
    message = _HOST_MESSAGES.get(kind)
    if message is None or len(payload) != _HEAD.size + message.layout.size:
        return None
    return number, message(*message.layout.unpack_from(payload, _HEAD.size))


def bed_answer(payload: bytes, readings: int) -> tuple[int, Answer] | None:
    """Sequence number and answer of a payload from a bed. readings: how many of `READINGS` it has; None: no answer."""
    kind = payload[0]
    if kind == SampleAnswer.kind:
        layout = _LAYOUTS[readings]
        if len(payload) != layout.size:
            return None
        _, number, status, tick, rate, *others = layout.unpack(payload)
        if status & STATE == STATE:
            return None
        return number, SampleAnswer(status, tick, rate, tuple(others))
    if kind == HelloAnswer.kind and len(payload) > _HEAD.size and payload[_HEAD.size] != VERSION:
        return _HEAD.unpack_from(payload)[1], OtherVersionAnswer(payload[_HEAD.size])
    if kind == HelloAnswer.kind and len(payload) == _GREETING.size:
        _, number, version, capabilities, session, firmware, name, *x = _GREETING.unpack(payload)
        scales, limits = Scales(*x[2:8]), Limits(*x[8:])
        return number, HelloAnswer(version, capabilities, session, firmware, name, x[0], x[1], scales, limits)
    if kind == LimitsAnswer.kind and len(payload) == _IN_FORCE.size:
        _, number, *limits_in_force = _IN_FORCE.unpack(payload)
        return number, LimitsAnswer(*limits_in_force)
    return None
