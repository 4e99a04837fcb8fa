"""The states, limits and deadman of docs/protocol.md, to hold the core against: frames in, outputs and answers out."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

from tests.hw.firmware import wire

SAFE = [("i", 0), ("v", 0)]
LENGTHS = {1: 1, 2: 5, 3: 4, 4: 9, 5: 9, 6: 0, 7: 0, 8: 0, 9: 9}


@dataclass
class Model:
    """One bed of PLAIN's numbers. `events` is what a port is told; answers are what `take` gives back."""

    lock_step: bool
    simulated: bool
    own: tuple[int, ...] = (2000, 1500, 3500, 400, 750)
    arming: int = 20
    deadman: int = 15
    trip: int = 1650
    most: int = 250_000_000
    continuous: int = 562_500
    session: int = 0xC0FFEE
    state: int = wire.DISARMED
    faults: int = 0
    greeted: bool = False
    number: int | None = None
    tick_count: int = 0
    since: int = 0
    held: tuple[int, int] = (0, 0)
    base: tuple[int, int, int] = (1, 0, 0)
    heat: int = 0
    largest: int = 0
    rate: int = 0
    seen: int = 0
    frames: list[bool] = field(default_factory=list)
    events: list[tuple[str, int]] = field(default_factory=lambda: list(SAFE))

    def __post_init__(self) -> None:
        self.limits = list(self.own)

    def take(self, payload: bytes | None) -> tuple[object, ...] | None:
        """The answer to a frame; None: a frame that does not decode."""
        known = payload is not None and self.known(payload)
        if self.state == wire.ARMED:
            self.frames = [*self.frames, known][-64:]
            if self.frames.count(False) >= 16:
                self.stop(wire.NOISE)
        if payload is None or not known:
            return None
        kind, number = struct.unpack_from("<BH", payload)
        body = payload[3:]
        new = kind == wire.HELLO or self.number is None or 1 <= (number - self.number) % 65536 <= 32767
        if not new:
            return self.sample(number, False)
        self.number = number
        if kind == wire.HELLO:
            if self.state == wire.ARMED:
                self.safe(wire.DISARMED)
            self.greeted = True
            self.limits = list(self.own)
            return ("hello", number)
        if kind == wire.LIMIT:
            which, value = struct.unpack("<Bi", body)
            if self.state == wire.DISARMED and which < 5 and value >= 0:
                self.limits[which] = min(value, self.own[which])
            return ("limits", number, *self.limits)
        return self.sample(number, self.refuses(kind, body))

    def known(self, payload: bytes) -> bool:
        if len(payload) < 3 or len(payload) > 12 or len(payload) - 3 != LENGTHS.get(payload[0], -1):
            return False
        if payload[0] == wire.DRIVE:
            return not self.lock_step and payload[-1] == 0
        if payload[0] == wire.STEP:
            return self.lock_step and payload[-1] != 0
        return payload[0] != wire.PRESET or self.simulated

    def refuses(self, kind: int, body: bytes) -> bool:
        state, slow = self.state, abs(self.seen) <= self.arming
        if kind == wire.ARM:
            ready = self.greeted and slow and self.heat <= self.most
            if state == wire.DISARMED and ready and struct.unpack("<I", body) == (self.session,):
                self.safe(wire.ARMED)
                self.since, self.base, self.frames = 0, (1, 0, 0), []
                return False
            return True
        if kind in (wire.DRIVE, wire.STEP):
            self.command(*struct.unpack_from("<ii", body))
            for _ in range(body[8]):
                self.events.append(("a", 0))
                self.tick()
            return state != wire.ARMED
        if kind == wire.STOP:
            self.safe(wire.DISARMED if state == wire.ARMED else state)
        if kind == wire.CLEAR:
            hot = bool(self.faults & wire.HEAT) and 2 * self.heat > self.most
            if state == wire.ARMED or (state == wire.STOPPED and (hot or not slow)):
                return True
            self.faults = 0
            self.safe(wire.DISARMED)
        if kind == wire.PRESET:
            if state != wire.DISARMED:
                return True
            self.events.append(("p", body[0]))
            if body[0] > 2 or body[1:] == b"\xff" * 8:
                return True
            self.seen = self.rate
        return False

    def command(self, voltage: int, current: int) -> None:
        if self.state != wire.ARMED:
            return
        ticks, faults = max(self.since, 1), 0
        if self.since:
            self.base = (self.since, *self.held)
        if abs(voltage) > self.limits[0] or abs(current) > self.limits[1]:
            faults |= wire.RANGE
        if abs(voltage - self.held[0]) > ticks * self.limits[3] or abs(current - self.held[1]) > ticks * self.limits[4]:
            faults |= wire.SLEW
        together = self.base[0] + 1
        if (
            abs(voltage - self.base[1]) > together * self.limits[3]
            or abs(current - self.base[2]) > together * self.limits[4]
        ):
            faults |= wire.SLEW
        if faults:
            self.stop(faults)
            return
        self.held, self.since = (voltage, current), 0
        self.largest = max(self.largest, abs(current))
        self.events += [("i", current), ("v", voltage)]

    def tick(self) -> None:
        self.tick_count += 1
        self.seen = self.rate
        self.heat = min(max(self.heat + self.largest**2 - self.continuous, 0), self.most + 1)
        if self.state == wire.ARMED:
            self.since += 1
            faults = wire.DEADMAN * (self.since >= self.deadman) | wire.RATE * (abs(self.rate) > self.limits[2])
            faults |= wire.HEAT * (self.heat > self.most)
            if faults:
                self.stop(faults)
        else:
            self.safe(self.state)
        self.largest = abs(self.held[1])
        self.events.append(("k", 0))

    def stop(self, faults: int) -> None:
        self.faults |= faults
        self.safe(wire.STOPPED)

    def safe(self, state: int) -> None:
        self.state, self.held = state, (0, 0)
        self.events += SAFE

    def sample(self, number: int, refused: bool) -> tuple[object, ...]:
        status = self.state | self.faults | wire.GREETED * self.greeted | wire.REFUSED * refused
        return ("sample", number, status, self.tick_count, self.seen)
