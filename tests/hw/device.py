"""A bed's device as docs/protocol.md has it, read anew: nothing of it is shared with hw/protocol or the firmware.

For tests. Its plant is an inertia with friction; it is in lock-step, or goes by a clock that `at` sets. It keeps what
its amplifiers were told, in order, and every answer that it gave by number.
"""

from __future__ import annotations

import math
import struct
from collections import deque
from dataclasses import dataclass, field

DISARMED, ARMED, STOPPED = range(3)
DEADMAN, RANGE, SLEW, RATE, CURRENT, HEAT, DEAD, REVERSED, NOISE = (1 << n for n in range(3, 12))
WATCHDOG, REFUSED = 1 << 12, 1 << 13


def _shifted(register: int) -> int:
    for _ in range(8):
        register = (register << 1 ^ 0x1021 if register & 0x8000 else register << 1) & 0xFFFF
    return register


_OF_BYTE = [_shifted(byte << 8) for byte in range(256)]


def crc(data: bytes) -> int:
    register = 0xFFFF
    for byte in data:
        register = (register << 8 & 0xFFFF) ^ _OF_BYTE[register >> 8 ^ byte]
    return register


def stuffed(data: bytes) -> bytes:
    """COBS, as Cheshire and Baker have it: a pass that leaves a gap for each code."""
    out, gap = bytearray(1), 0
    for byte in data:
        if byte:
            out.append(byte)
        if not byte or len(out) - gap == 255:
            out[gap], gap = len(out) - gap, len(out)
            out.append(0)
    out[gap] = len(out) - gap
    return bytes(out)


def unstuffed(data: bytes) -> bytes | None:
    out, at = bytearray(), 0
    while at < len(data):
        code = data[at]
        if code == 0 or at + code > len(data):
            return None
        out += data[at + 1 : at + code]
        at += code
        if code < 255 and at < len(data):
            out.append(0)
    return bytes(out)


def frame(payload: bytes) -> bytes:
    check = crc(payload)
    return stuffed(payload + bytes((check & 255, check >> 8))) + b"\0"


def payload(framed: bytes) -> bytes | None:
    whole = unstuffed(framed)
    if whole is None or len(whole) < 5:
        return None
    return whole[:-2] if crc(whole[:-2]) == whole[-2] | whole[-1] << 8 else None


LENGTHS = {1: 1, 2: 5, 3: 4, 4: 9, 5: 9, 6: 0, 7: 0, 8: 0, 9: 9}
"""Bytes of a body by its kind."""


@dataclass
class Shaft:
    """period s; inertia kg m^2; kt N m/A, of both motors; resistance ohm; friction N m s/rad."""

    period: float = 1e-3
    inertia: float = 1.3e-4
    kt: float = 0.06
    resistance: float = 1.5
    friction: float = 1e-4
    rate: float = 0.0
    shaft_angle: float = 0.0

    def push(self, rate: float, voltage: float, current: float) -> float:
        """What the motors do to it, rad/s^2."""
        return self.kt * ((voltage - self.kt * rate) / self.resistance + current) / self.inertia

    def start(self, rate: float, seed: float, repeat: float) -> float:
        self.rate, self.shaft_angle = rate, 0.0
        return rate

    def tick(self, voltage: float, current: float) -> float:
        decay = (self.kt**2 / self.resistance + self.friction) / self.inertia
        push = (self.kt * voltage / self.resistance + self.kt * current) / self.inertia
        self.shaft_angle += self.rate * self.period
        last = push / decay
        self.rate = last + (self.rate - last) * math.exp(-decay * self.period)
        return self.rate


@dataclass
class Device:
    """lock_step: else its ticks go by the clock. tachometer: `sound`, `dead` or `reversed`. version: that it says."""

    lock_step: bool = True
    plant: Shaft = field(default_factory=Shaft)
    version: int = 1
    session: int = 77
    name: bytes = b"model"
    tick_hz: float = 1000.0
    deadman: float = 0.020
    capabilities: int = 0b000001
    scales: tuple[float, ...] = (40 / 4096, 6 / 4096, 800 / 4096, 2 * math.pi / 4096, 0.001, 0.01)
    limits: tuple[float, ...] = (20.0, 3.0, 380.0, 5.0, 20000.0, 3000.0, 9.0)
    bears: float = 2.0
    tachometer: str = "sound"
    by_watchdog: bool = False

    def __post_init__(self) -> None:
        self.outputs: list[tuple[str, float]] = []
        self.answers: dict[int, list[bytes]] = {}
        self.commanded: list[int] = []
        self.capabilities |= 1 << 5 | (1 << 4 if self.lock_step else 0)
        self.boots, self.filtered = 0, 0.0
        self.coming = b""
        self.boot()

    def boot(self) -> None:
        """As after its supply came back, or its watchdog reset it: the shaft goes on turning."""
        self.boots += 1
        self.session += 1
        self.state, self.faults, self.greeted = DISARMED, 0, False
        self.number: int | None = None
        self.ticks, self.since, self.heat = 0, 0, 0.0
        self.frames: deque[bool] = deque(maxlen=64)
        self.coming = b""
        self.suspect, self.seen = [0, 0], 0.0
        self.began: float | None = None
        self.own()
        self.safe()

    def own(self) -> None:
        volts, amperes, rate = self.scales[:3]
        of = self.limits
        self.mine = [
            math.floor(x + 1e-6)
            for x in (
                of[0] / volts,
                of[1] / amperes,
                of[2] / rate,
                of[4] / self.tick_hz / volts,
                of[5] / self.tick_hz / amperes,
            )
        ]
        self.force = list(self.mine)

    def safe(self) -> None:
        self.hold(0, 0)

    def hold(self, voltage: int, current: int) -> None:
        self.volts, self.amperes = voltage, current
        self.outputs += [("current", current * self.scales[1]), ("voltage", voltage * self.scales[0])]
        del self.outputs[:-1000]

    @property
    def voltage(self) -> float:
        return self.volts * self.scales[0]

    @property
    def current(self) -> float:
        return self.amperes * self.scales[1]

    @property
    def rate(self) -> int:
        """Counts, as the tachometer has it."""
        sign = {"sound": 1.0, "dead": 0.0, "reversed": -1.0}[self.tachometer]
        return round(sign * self.filtered / self.scales[2])

    def slow(self) -> bool:
        return abs(self.rate) * self.scales[2] <= self.limits[3] + 1e-9

    def stop(self, fault: int) -> None:
        self.safe()
        self.state = STOPPED
        self.faults |= fault

    def at(self, time: float) -> None:
        """The clock, s, of one that goes by it."""
        if self.began is None:
            self.began = time
        while not self.lock_step and (self.ticks + 1) / self.tick_hz <= time - self.began + 1e-12:
            self.tick()

    def tick(self) -> None:
        push = self.plant.push(self.filtered, self.voltage, self.current)
        self.filtered = self.plant.tick(self.voltage, self.current)
        self.ticks += 1
        self.since += 1
        self.heat = max(0.0, self.heat + (self.current**2 - self.bears**2) / self.tick_hz)
        if self.state != ARMED:
            self.safe()
            return
        read = self.rate * self.scales[2]
        if abs(push) > 100.0:  # rad/s^2
            moved, self.seen = (read - self.seen) * math.copysign(1.0, push), read
            self.suspect = [self.suspect[0] + 1 if moved == 0.0 else 0, self.suspect[1] + 1 if moved < 0.0 else 0]
        else:
            self.suspect = [0, 0]
        for wrong, fault in (
            (self.since >= self.deadman * self.tick_hz, DEADMAN),
            (abs(self.rate) > self.force[2], RATE),
            (self.heat > self.limits[6], HEAT),
            (self.suspect[0] > 20, DEAD),
            (self.suspect[1] > 5, REVERSED),
        ):
            if wrong:
                self.stop(fault)

    def take(self, data: bytes) -> bytes:
        """Bytes from the line; those that go back."""
        *frames, self.coming = (self.coming + data).split(b"\0")
        self.coming = self.coming[:16]  # longer is none, whatever its end
        return b"".join(self.frame(each) for each in frames if each)

    def frame(self, framed: bytes) -> bytes:
        found = payload(framed) if len(framed) <= 15 else None
        known = found is not None and LENGTHS.get(found[0]) == len(found) - 3
        if known and found is not None and found[0] in (4, 5):
            known = (found[0] == 5) == self.lock_step and (found[0] == 5) == (found[-1] > 0)
        if self.state == ARMED:
            self.frames.append(not known)
            if sum(self.frames) >= 16:
                self.stop(NOISE)
        if not known or found is None:
            return b""
        number = found[1] | found[2] << 8
        answer = self.answer(found[0], number, found[3:])
        self.answers.setdefault(number, []).append(answer)
        return frame(answer)

    def answer(self, kind: int, number: int, body: bytes) -> bytes:
        head = bytes((number & 255, number >> 8))
        if kind == 1:
            self.number, self.greeted = number, True
            if self.state == ARMED:
                self.state = DISARMED
            self.safe()
            self.own()
            said = struct.pack("<BHI", self.version, self.capabilities, self.session) + b"MODEL\0\0\0"
            said += self.name.ljust(16, b"\0")
            said += struct.pack("<15d", self.tick_hz, self.deadman, *self.scales, *self.limits)
            return b"\x81" + head + said
        if self.number is not None and not 1 <= (number - self.number) % 65536 <= 32767:
            return b"\x84" + head + self.sample(False)
        self.number = number
        if kind == 2:
            which, value = struct.unpack("<Bi", body)
            if self.state == DISARMED and which < 5 and value >= 0:
                self.force[which] = min(value, self.mine[which])
            return b"\x82" + head + struct.pack("<5i", *self.force)
        return b"\x84" + head + self.sample(not self.done(kind, body))

    def done(self, kind: int, body: bytes) -> bool:
        if kind == 3:
            (session,) = struct.unpack("<I", body)
            cool = self.heat <= self.limits[6]
            if not (self.state == DISARMED and self.greeted and session == self.session and self.slow() and cool):
                return False
            self.safe()
            self.state, self.since, self.suspect, self.seen = ARMED, 0, [0, 0], self.rate * self.scales[2]
            self.first = 1, 0, 0
            self.frames.clear()
        elif kind in (4, 5):
            voltage, current, ticks = struct.unpack("<iiB", body)
            armed = self.state == ARMED
            if armed:
                self.command(voltage, current)
                self.commanded.append(self.number or 0)
            for _ in range(ticks):
                self.tick()
            return armed
        elif kind == 6:
            self.safe()
            self.state = DISARMED if self.state == ARMED else self.state
        elif kind == 7:
            hot = self.faults & HEAT and self.heat > self.limits[6] / 2
            if self.state == ARMED or (self.state == STOPPED and (hot or not self.slow())):
                return False
            self.state, self.faults = DISARMED, 0
        elif kind == 9:
            which, value = struct.unpack("<Bd", body)
            if self.state != DISARMED or which > 2 or not math.isfinite(value):
                return False
            if which == 0:
                self.filtered = self.plant.start(value, 0.0, 0.0)
        return True

    def command(self, voltage: int, current: int) -> None:
        if self.since:
            self.first = self.since, self.volts, self.amperes
        # from the command before this one, and from the one before the first of this tick
        before = (max(1, self.since), self.volts, self.amperes), (self.first[0] + 1, *self.first[1:])
        if abs(voltage) > self.force[0] or abs(current) > self.force[1]:
            self.stop(RANGE)
        elif any(
            abs(voltage - volts) > ticks * self.force[3] or abs(current - amperes) > ticks * self.force[4]
            for ticks, volts, amperes in before
        ):
            self.stop(SLEW)
        else:
            self.hold(voltage, current)
            self.since = 0

    def sample(self, refused: bool) -> bytes:
        status = self.state | self.faults | self.greeted << 2
        status |= (WATCHDOG if self.by_watchdog else 0) | (REFUSED if refused else 0)
        said = struct.pack("<HIi", status, self.ticks & 0xFFFFFFFF, self.rate)
        if self.capabilities & 1:
            turned = round(self.plant.shaft_angle / self.scales[3])
            said += struct.pack("<i", (turned + 2**31) % 2**32 - 2**31)
        if self.capabilities & 2:
            through = (self.voltage - self.plant.kt * self.filtered) / self.plant.resistance
            said += struct.pack("<i", round(through / self.scales[4]))
        if self.capabilities & 4:
            push = self.plant.push(self.filtered, self.voltage, self.current)
            said += struct.pack("<i", round(push / self.scales[5]))
        return said
