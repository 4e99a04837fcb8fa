"""What stands between host and device in tests, and does to what passes what lines do, by a seed.

`Faults` says what becomes of a frame. `VirtualLine` is a line with a clock of its own, so that a second of faults takes
no second; `Relay` does the same to real bytes between two file descriptors.
"""

from __future__ import annotations

import heapq
import os
import random
import select
import threading
import time
from collections import Counter
from itertools import pairwise

from met.diagnostic import Problem, error
from tests.hw.device import Device

KINDS = (
    "drop",
    "flip",
    "truncate",
    "duplicate",
    "delay",
    "reorder",
    "split",
    "stall",
    "garbage",
    "cut",
    "reboot",
    "version",
)
"""cut: the line ends in the middle of a frame; version: the device is another one from now on."""

STALL = 0.050


class Faults:
    """One kind of fault, to so large a share of the frames of both directions. device: what is rebooted.

    count  how many there were
    """

    def __init__(self, kind: str, share: float, seed: int, device: Device) -> None:
        self.kind, self.share, self.device = kind, share, device
        self.random = random.Random(f"{kind} {seed}")
        self.count = 0
        self.until = 0.0
        self.cut = False
        self.held: dict[str, bytes] = {}

    def passed(self, way: str, frame: bytes, now: float) -> list[tuple[float, bytes]]:
        """Pieces of a frame that goes `up` or `down`, and when each arrives."""
        if self.cut:
            return []
        if held := self.held.pop(way, None):
            return [(now, frame), (now, held)]
        if self.random.random() >= self.share:
            return [(max(now, self.until), frame)]
        self.count += 1
        r, n = self.random, len(frame)
        match self.kind:
            case "drop":
                return []
            case "flip":
                bit = r.randrange(8 * n)
                changed = bytearray(frame)
                changed[bit // 8] ^= 1 << bit % 8
                return [(now, bytes(changed))]
            case "truncate":
                return [(now, frame[: r.randrange(n)])]
            case "duplicate":
                return [(now, frame), (now + r.uniform(0.0, 0.004), frame)]
            case "delay":
                return [(now + r.uniform(0.0005, 0.008), frame)]
            case "reorder":
                self.held[way] = frame
                return []
            case "split":
                at = sorted(r.randrange(1, n) for _ in range(3))
                gap = r.uniform(0.0, 0.0004)
                pieces = [frame[a:b] for a, b in pairwise([0, *at, n])]
                return [(now + i * gap, piece) for i, piece in enumerate(pieces) if piece]
            case "stall":
                self.until = now + STALL
                return [(self.until, frame)]
            case "garbage":
                return [(now, r.randbytes(r.randrange(1, 40))), (now, frame)]
            case "cut":
                self.cut = True
                return [(now, frame[: r.randrange(n)])]
            case "reboot" | "version":
                if self.kind == "version":
                    self.device.version = 2
                self.device.boot()
                return []
        raise ValueError(self.kind)


class VirtualLine:
    """To a device, through faults. A frame takes 0.2 ms each way."""

    FLIGHT = 0.0002

    def __init__(self, device: Device, faults: Faults | None, start: float = 0.0) -> None:
        self.device, self.faults, self.time = device, faults, start
        self._coming: list[tuple[float, int, str, bytes]] = []
        self._order = 0
        self.seen = Counter[str]()

    def now(self) -> float:
        return self.time

    def send(self, frame: bytes) -> None:
        self.seen["sent"] += 1
        self._alive()
        self._put("up", frame, self.time)

    def receive(self, until: float) -> bytes:
        while self._coming and self._coming[0][0] <= max(until, self.time):
            if data := self._arrived():
                self.seen["received"] += 1
                return data
        self._alive()
        self._goes_on(until)
        return b""

    def sleep(self, seconds: float) -> None:
        end, kept = self.time + seconds, []
        while self._coming and self._coming[0][0] <= end:
            if data := self._arrived():
                kept.append(data)
        self._goes_on(end)
        for data in kept:  # it waits in the host's buffer
            self._push(self.time, "down", data)

    def close(self) -> None:
        pass

    def _arrived(self) -> bytes:
        """What comes next: bytes for the host, or none where it was for the device."""
        at, _, way, data = heapq.heappop(self._coming)
        self._goes_on(at)
        if way == "down":
            return data
        for frame in self.device.take(data).split(b"\0")[:-1]:
            self._put("down", frame + b"\0", self.time)
        return b""

    def _put(self, way: str, frame: bytes, now: float) -> None:
        pieces = [(now, frame)] if self.faults is None else self.faults.passed(way, frame, now)
        for at, piece in pieces:
            if piece:
                self._push(at + self.FLIGHT, way, piece)

    def _push(self, at: float, way: str, data: bytes) -> None:
        self._order += 1
        heapq.heappush(self._coming, (at, self._order, way, data))

    def _goes_on(self, to: float) -> None:
        self.time = max(self.time, to)
        self.device.at(self.time)

    def _alive(self) -> None:
        if self.faults is not None and self.faults.cut and not self._coming:
            raise Problem(error("E401", "the line was lost: cut", help="join it"))


class Relay:
    """A thread that carries bytes between a file of the host's and a device, frames through `Faults`.

    The device's clock stands still while the thread is kept waiting: a busy machine is not the bed's fault.
    """

    def __init__(self, host: int, device: Device, faults: Faults | None = None) -> None:
        self.host, self.device, self.faults = host, device, faults
        self._pending: list[tuple[float, int, str, bytes]] = []
        self._order = 0
        self._closing = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._closing = True
        self._thread.join()

    def _run(self) -> None:
        rest, clock, last = b"", 0.0, time.perf_counter()
        tick = 1.0 / self.device.tick_hz
        while not self._closing:
            clock, last = clock + min(time.perf_counter() - last, tick), time.perf_counter()
            self.device.at(clock)
            ready, _, _ = select.select([self.host], [], [], 0.0 if self._pending else tick / 4)
            if ready:
                try:
                    rest += os.read(self.host, 4096)
                except OSError:  # nobody has the other end open
                    time.sleep(tick)
            *frames, rest = rest.split(b"\0")
            now = time.perf_counter()
            for frame in frames:
                self._put("up", frame + b"\0", now)
            while self._pending and self._pending[0][0] <= time.perf_counter():
                _, _, way, data = heapq.heappop(self._pending)
                if way == "down":
                    os.write(self.host, data)
                    continue
                for frame in self.device.take(data).split(b"\0")[:-1]:
                    self._put("down", frame + b"\0", time.perf_counter())

    def _put(self, way: str, frame: bytes, now: float) -> None:
        pieces = [(now, frame)] if self.faults is None else self.faults.passed(way, frame, now)
        for at, piece in pieces:
            self._order += 1
            heapq.heappush(self._pending, (at, self._order, way, piece))
