"""What the payloads say: a class a message, its fields in the order of the wire, in counts.

Fields that the wire has no room for raise `struct.error`: whoever sends checks first.
"""

from __future__ import annotations

import struct

from hw.bed import Capability, Limits, Scales
from hw.protocol.frames import framed
from met.frozen import frozen

VERSION = 1
NUMBERS = 1 << 16
"""Sequence numbers: a frame's is the last one's plus one, modulo this."""

MOST = (1 << 31) - 1
"""Counts that a value can have on the wire."""

STATE = 3
"""The bits of a status that are the state; all of them set are none."""

_HEAD = struct.Struct("<BH")


# What the host says


@frozen
class Hello:
    """Who is there? version: the highest that the host speaks."""

    kind = 0x01
    layout = struct.Struct("<B")
    version: int = VERSION


@frozen
class Limit:
    """A tighter limit. which: 0 voltage, 1 current, 2 rate, 3 voltage slew, 4 current slew; slews in counts a tick."""

    kind = 0x02
    layout = struct.Struct("<Bi")
    which: int
    value: int


@frozen
class Arm:
    """session: as the bed said it when it was greeted."""

    kind = 0x03
    layout = struct.Struct("<I")
    session: int


@frozen
class Drive:
    """What the amplifiers are to hold from now on."""

    kind = 0x04
    layout = struct.Struct("<iix")
    voltage: int
    current: int


@frozen
class Step:
    """The same, of a bed in lock-step, and let so many ticks pass, 1 to 255."""

    kind = 0x05
    layout = struct.Struct("<iiB")
    voltage: int
    current: int
    ticks: int


@frozen
class Stop:
    """Disarm."""

    kind = 0x06
    layout = struct.Struct("<")


@frozen
class Clear:
    """Unlatch faults."""

    kind = 0x07
    layout = struct.Struct("<")


@frozen
class Read:
    """The present state, please."""

    kind = 0x08
    layout = struct.Struct("<")


@frozen
class Preset:
    """Of a simulated plant. which: 0 start anew at so many rad/s, 1 seed, 2 repeat."""

    kind = 0x09
    layout = struct.Struct("<Bd")
    which: int
    value: float


Asked = Hello | Limit | Arm | Drive | Step | Stop | Clear | Read | Preset
_ASKED: dict[int, type[Asked]] = {
    each.kind: each for each in (Hello, Limit, Arm, Drive, Step, Stop, Clear, Read, Preset)
}


# What the bed answers


@frozen
class Greeting:
    """firmware, name: as they stand, with their zeros."""

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
class OtherVersion:
    """The greeting of a bed that speaks another version: of the rest nothing is known."""

    version: int


@frozen
class InForce:
    """The limits in force, slews in counts a tick."""

    kind = 0x82
    voltage: int
    current: int
    rate: int
    voltage_slew: int
    current_slew: int


@frozen
class Reading:
    """status: its bits; others: angle, drive current, acceleration, of those that the bed has."""

    kind = 0x84
    status: int
    tick: int
    rate: int
    others: tuple[int, ...]


Answer = Greeting | OtherVersion | InForce | Reading

_GREETING = struct.Struct("<BHBHI8s16s15d")
_IN_FORCE = struct.Struct("<BH5i")
_READINGS = [struct.Struct(f"<BHHIi{n}i") for n in range(4)]

SENSORS = (Capability.ENCODER, Capability.DRIVE_CURRENT, Capability.ACCELEROMETER)
"""The capabilities that each add a number to a SAMPLE, in its order."""


def sent(message: Asked, number: int) -> bytes:
    """The frame of a message."""
    body = message.layout.pack(*message.__dict__.values())
    return framed(_HEAD.pack(message.kind, number) + body)


def asked(payload: bytes) -> tuple[int, Asked] | None:
    """Number and message of a payload from the host; None of one that means nothing."""
    kind, number = _HEAD.unpack_from(payload)
    message = _ASKED.get(kind)
    if message is None or len(payload) != _HEAD.size + message.layout.size:
        return None
    return number, message(*message.layout.unpack_from(payload, _HEAD.size))


def answered(payload: bytes, sensors: int) -> tuple[int, Answer] | None:
    """Number and message of a payload from a bed with so many of `SENSORS`; None of one that means nothing."""
    kind = payload[0]
    if kind == Reading.kind:
        layout = _READINGS[sensors]
        if len(payload) != layout.size:
            return None
        _, number, status, tick, rate, *others = layout.unpack(payload)
        if status & STATE == STATE:
            return None
        return number, Reading(status, tick, rate, tuple(others))
    if kind == Greeting.kind and len(payload) > _HEAD.size and payload[_HEAD.size] != VERSION:
        return _HEAD.unpack_from(payload)[1], OtherVersion(payload[_HEAD.size])
    if kind == Greeting.kind and len(payload) == _GREETING.size:
        _, number, version, capabilities, session, firmware, name, *x = _GREETING.unpack(payload)
        scales, limits = Scales(*x[2:8]), Limits(*x[8:])
        return number, Greeting(version, capabilities, session, firmware, name, x[0], x[1], scales, limits)
    if kind == InForce.kind and len(payload) == _IN_FORCE.size:
        _, number, *limits_in_force = _IN_FORCE.unpack(payload)
        return number, InForce(*limits_in_force)
    return None
