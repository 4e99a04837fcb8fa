"""The host's end of the line of two played drives, in a simulated time: bit times and all, and in no time at all. What
becomes of frames and bytes on their way, a test says.

PlayedLine           a bus with two drives on it
PlayedOdriveLines    two serial lines, each with an ODrive
PlayedFdcanusbLine   the line of an fdcanusb, the bus behind it being a `PlayedLine`
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable

from hw.drives.drive import CanFrame, on_bus
from tests.hw.players.fdcanusb import PlayedFdcanusb
from tests.hw.players.player import PlayedBench

TURNAROUND = 5e-5
"""Time in which a played drive answers, s."""

USB = 2.5e-4
"""Time that bytes are played to take one way, s. What an ODrive's take was not measured."""


Spoil = Callable[[CanFrame, bool], list[tuple[float, CanFrame]]]
"""A function (frame, whether it comes from a drive) -> the frames that arrive in its place, with delays in s."""


def unspoiled(frame: CanFrame, from_drive: bool) -> list[tuple[float, CanFrame]]:
    return [(0.0, frame)]


class PlayedLine:
    """A bus with two played drives on it, as a line with a clock of its own: time goes on where the host waits for it.

    spoil  what becomes of each frame on its way
    """

    def __init__(self, bench: PlayedBench, spoil: Spoil = unspoiled) -> None:
        self.bench, self.spoil = bench, spoil
        self._now = self._free = bench.ticked
        self._order = itertools.count()
        self._events: list[tuple[float, int, bool, CanFrame]] = []
        self.closed = False

    def now(self) -> float:
        return self._now

    def send(self, frame: CanFrame) -> None:
        self._put(frame, False, self._now)

    def receive(self, until: float) -> CanFrame | None:
        until = max(until, self._now)
        while True:
            due = self.bench.ticked + self.bench.shaft.period
            if self._events and self._events[0][0] <= min(due, until):
                time, _, from_drive, frame = heapq.heappop(self._events)
                self._now = max(self._now, time)
                if from_drive:
                    return CanFrame(frame.id, frame.data, frame.extended, frame.remote, frame.fd, time)
                for answer in self.bench.receive(frame, time):
                    self._put(answer, True, time + TURNAROUND)
            elif due <= until:
                for frame in self.bench.tick():
                    self._put(frame, True, due)
            else:
                self._now = until
                return None

    def sleep(self, seconds: float) -> None:
        """Let time pass; frames of that time stay on the line."""
        end, kept = self._now + seconds, []
        while (frame := self.receive(end)) is not None:
            kept.append(frame)
        for frame in kept:
            heapq.heappush(self._events, (frame.time, next(self._order), True, frame))

    def close(self) -> None:
        self.closed = True

    def _put(self, frame: CanFrame, from_drive: bool, now: float) -> None:
        for later, each in self.spoil(frame, from_drive):
            start = max(self._free, now)
            self._free = start + on_bus(each)
            heapq.heappush(self._events, (self._free + later, next(self._order), from_drive, each))


class PlayedOdriveLines(PlayedLine):
    """The host's end of two drives' lines in a time of their own: each line keeps its order both ways, so that what is
    late holds up what comes after it."""

    def __init__(self, bench: PlayedBench, spoil: Spoil = unspoiled) -> None:
        super().__init__(bench, spoil)
        self._last: dict[tuple[int, bool], float] = {}

    def _put(self, frame: CanFrame, from_drive: bool, now: float) -> None:
        for later, each in self.spoil(frame, from_drive):
            way = each.id, from_drive
            self._last[way] = max(self._last.get(way, 0.0), now + USB + later)
            heapq.heappush(self._events, (self._last[way], next(self._order), from_drive, each))


SpoilText = Callable[[bytes, bool], list[tuple[float, bytes]]]
"""A function (a line with its end, whether it comes from the adapter) -> the bytes that arrive in its place, with
delays in s."""


def unspoiled_text(text: bytes, from_adapter: bool) -> list[tuple[float, bytes]]:
    return [(0.0, text)]


class PlayedFdcanusbLine:
    """The host's end of an adapter's line, whose bus is simulated: bytes in the time of that bus. What is late holds up
    what comes after it, as a stream does.

    spoil  what becomes of each line of text on its way
    """

    def __init__(self, bus: PlayedLine, spoil: SpoilText = unspoiled_text) -> None:
        self.bus, self.spoil, self.adapter = bus, spoil, PlayedFdcanusb()
        self._waiting: list[tuple[float, int, bytes]] = []
        self._order, self._last = itertools.count(), 0.0

    @property
    def closed(self) -> bool:
        return self.bus.closed

    def now(self) -> float:
        return self.bus.now()

    def send(self, frame: bytes) -> None:
        for _, data in self.spoil(frame, False):
            frames, said = self.adapter.hears(data)
            for each in frames:
                self.bus.send(each)
            self._put(said)

    def receive(self, until: float) -> bytes:
        while True:
            if self._waiting and self._waiting[0][0] <= self.now():
                return heapq.heappop(self._waiting)[2]
            first = self._waiting[0][0] if self._waiting else until
            frame = self.bus.receive(min(first, until))
            if frame is not None:
                self._put(self.adapter.says(frame))
            elif self.now() >= until:
                return b""

    def sleep(self, seconds: float) -> None:
        self.bus.sleep(seconds)

    def close(self) -> None:
        self.bus.close()

    def _put(self, said: bytes) -> None:
        for text in said.splitlines(keepends=True):
            for later, data in self.spoil(text, True):
                self._last = max(self._last, self.now() + later)
                heapq.heappush(self._waiting, (self._last, next(self._order), data))
