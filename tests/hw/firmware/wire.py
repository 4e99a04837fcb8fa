"""The wire as docs/protocol.md has it, written for the firmware's tests alone: nothing here comes from hw/protocol."""

from __future__ import annotations

import binascii
import struct
from dataclasses import dataclass

HELLO, LIMIT, ARM, DRIVE, STEP, STOP, CLEAR, READ, PRESET = range(1, 10)
TOLD_HELLO, TOLD_LIMITS, TOLD_SAMPLE = 0x81, 0x82, 0x84

DISARMED, ARMED, STOPPED = 0, 1, 2
GREETED = 1 << 2
DEADMAN, RANGE, SLEW, RATE, CURRENT, HEAT, DEAD, REVERSED, NOISE = (1 << n for n in range(3, 12))
WATCHDOG, REFUSED, INTERLOCK = 1 << 12, 1 << 13, 1 << 14


def stuffed(data: bytes) -> bytes:
    """COBS, without the ending zero; for less than 254 bytes."""
    return b"".join(bytes([len(part) + 1]) + part for part in data.split(b"\0"))


def unstuffed(data: bytes) -> bytes:
    parts, at = [], 0
    while at < len(data):
        code = data[at]
        assert code and at + code <= len(data), data.hex()
        parts.append(data[at + 1 : at + code])
        at += code
    return b"\0".join(parts)


def framed(payload: bytes) -> bytes:
    return stuffed(payload + struct.pack("<H", binascii.crc_hqx(payload, 0xFFFF))) + b"\0"


def frame(kind: int, number: int, body: bytes = b"") -> bytes:
    return framed(struct.pack("<BH", kind, number & 0xFFFF) + body)


def payloads(data: bytes) -> list[bytes]:
    """The payloads of whole frames; asserts that nothing else is there."""
    assert not data or data.endswith(b"\0"), data.hex()
    found = []
    for each in data.split(b"\0")[:-1]:
        whole = unstuffed(each)
        assert binascii.crc_hqx(whole[:-2], 0xFFFF) == struct.unpack("<H", whole[-2:])[0], each.hex()
        found.append(whole[:-2])
    return found


@dataclass
class Sample:
    number: int
    status: int
    tick: int
    rate: int
    more: tuple[int, ...]

    @property
    def state(self) -> int:
        return self.status & 3

    @property
    def faults(self) -> int:
        return self.status & (0xFF8 | INTERLOCK)

    @property
    def refused(self) -> bool:
        return bool(self.status & REFUSED)


@dataclass
class Limits:
    number: int
    counts: tuple[int, ...]


@dataclass
class Hello:
    number: int
    version: int
    capabilities: int
    session: int
    firmware: bytes
    name: bytes
    numbers: tuple[float, ...]


def told(payload: bytes) -> Sample | Limits | Hello:
    """What a device's payload says."""
    kind, number = struct.unpack_from("<BH", payload)
    body = payload[3:]
    if kind == TOLD_HELLO:
        version, capabilities, session, firmware, name = struct.unpack_from("<BHI8s16s", body)
        return Hello(number, version, capabilities, session, firmware, name, struct.unpack("<15d", body[31:]))
    if kind == TOLD_LIMITS:
        return Limits(number, struct.unpack("<5i", body))
    assert kind == TOLD_SAMPLE, payload.hex()
    status, tick, rate = struct.unpack_from("<HIi", body)
    return Sample(number, status, tick, rate, struct.unpack(f"<{len(body[10:]) // 4}i", body[10:]))
