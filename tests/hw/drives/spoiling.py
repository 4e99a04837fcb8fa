"""Faults of a bus, for the tests of this folder: what they do to frames, and a drive that goes through them."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol

from hw.bed import BedSample, BedState, Fault
from hw.beds.can_bed import CanBed
from hw.drives.drive import CanFrame
from hw.drives.side import SKEW
from met.diagnostic import Problem
from tests.hw.players.player import PlayedBench

SHARE = 0.05
"""Share of frames that a fault befalls."""

SPARED = 6
"""Answers after an altered one that are not altered, too: those of the other drive to the same question."""

SWUNG = 100.0
"""Largest rate of a shaft, rad/s, for which a bed's limit has to have room, so that it is swung in full."""

Spoilt = list[tuple[float, CanFrame]]


class Spoiler:
    """One fault, befalling frames by chance. kind: of `FAULTS`"""

    def __init__(self, kind: str, seed: int) -> None:
        self.kind, self.random = kind, random.Random(f"{kind} {seed}")
        self.befell = 0
        self.on = False
        self._kept: list[CanFrame] = []
        self._sound = SPARED + 1
        """Answers since the last that was altered."""

    def __call__(self, frame: CanFrame, from_drive: bool) -> Spoilt:
        self._kept = [*self._kept[-40:], *([frame] if from_drive else [])]
        self._sound += from_drive
        if not self.on or self.random.random() >= SHARE:
            return [(0.0, frame)]
        out = FAULTS[self.kind](self, frame, from_drive)
        self.befell += out != [(0.0, frame)]
        return out

    def lost_command(self, frame: CanFrame, from_drive: bool) -> Spoilt:
        return [(0.0, frame)] if from_drive else []

    def lost_answer(self, frame: CanFrame, from_drive: bool) -> Spoilt:
        return [] if from_drive else [(0.0, frame)]

    def late(self, frame: CanFrame, from_drive: bool) -> Spoilt:
        return [(self.random.uniform(2e-4, 6e-3), frame)]

    def doubled(self, frame: CanFrame, from_drive: bool) -> Spoilt:
        return [(0.0, frame), (self.random.uniform(0.0, 4e-3), frame)]

    def swapped(self, frame: CanFrame, from_drive: bool) -> Spoilt:
        return [(3e-4, frame)]

    def altered(self, frame: CanFrame, from_drive: bool) -> Spoilt:
        """An answer with bits that are wrong, and a checksum that is right: a controller lets such through once in
        2^15. Of two drives' answers to one question one at most: two may be wrong alike, and nothing else is asked."""
        if not from_drive or not frame.data or self._sound <= SPARED:
            return [(0.0, frame)]
        self._sound = 0
        data = bytearray(frame.data)
        for _ in range(self.random.randint(1, 4)):
            data[self.random.randrange(len(data))] ^= 1 << self.random.randrange(8)
        return [(0.0, replace(frame, data=bytes(data)))]

    def cut_short(self, frame: CanFrame, from_drive: bool) -> Spoilt:
        return [(0.0, replace(frame, data=frame.data[: self.random.randrange(max(1, len(frame.data)))]))]

    def wrong_node(self, frame: CanFrame, from_drive: bool) -> Spoilt:
        """Another node's identifier, one of this bench's too."""
        if not from_drive:
            return [(0.0, frame)]
        other = self.random.choice([each.id for each in self._kept] + [self.random.randrange(0x800)])
        return [(0.0, replace(frame, id=other))]

    def stale(self, frame: CanFrame, from_drive: bool) -> Spoilt:
        """What was said before, in the place of what is said."""
        before = [each for each in self._kept[:-1] if each.id == frame.id]
        return [(0.0, self.random.choice(before))] if from_drive and before else [(0.0, frame)]

    def foreign(self, frame: CanFrame, from_drive: bool) -> Spoilt:
        data = self.random.randbytes(self.random.randrange(9))
        return [(0.0, CanFrame(self.random.randrange(0x800), data)), (0.0, frame)]

    def reboot(self, frame: CanFrame, from_drive: bool) -> Spoilt:
        """Of a drive, at times: its frames are sound."""
        return [(0.0, frame)]


FAULTS: dict[str, Callable[[Spoiler, CanFrame, bool], Spoilt]] = {
    name: getattr(Spoiler, name)
    for name in (
        "lost_command",
        "lost_answer",
        "late",
        "doubled",
        "swapped",
        "altered",
        "cut_short",
        "wrong_node",
        "stale",
        "foreign",
        "reboot",
    )
}


class WaitingLine(Protocol):
    """What a campaign needs of a line: its time, and to let it pass."""

    def now(self) -> float: ...

    def sleep(self, seconds: float) -> None: ...


class BefallingFault(Protocol):
    """A fault that a campaign switches on and off. kind: its name;  befell: how often it did"""

    kind: str
    on: bool
    befell: int


@dataclass
class Tally:
    """What came of exchanges: how many were answered, how many of these wrong, by how much at most, and how much was
    allowed at most (rad/s), how often the bed stopped, and by what."""

    exchanges: int = 0
    answered: int = 0
    wrong: int = 0
    stops: int = 0
    faults: Fault = field(default_factory=lambda: Fault(0))
    worst: float = 0.0
    allowed: float = 0.0


def campaign(
    bed: CanBed,
    line: WaitingLine,
    played: PlayedBench,
    spoiler: BefallingFault,
    exchanges: int,
    swing: float = 6.0,
    period: float = 1e-3,
) -> Tally:
    """Drive a bed through a fault, as fast as its limits let, arming it anew each time that it has stopped.

    An answer is wrong where its rate is not the shaft's at any time of the period before it, by more than the shaft can
    change in the time by which the two drives' samples may be apart: what is wrong by less cannot be told. swing: of
    the voltage or rate that is sent, where the bed's limit of the rate lets it;  period: s from one to the next
    """
    tally = Tally()
    bed.connect()
    bed.patience = 2.0 * period  # as of a run
    truth = _Truth(played)
    share = min(1.0, bed._require_about().limits.rate / SWUNG)
    chance = random.Random(f"{spoiler.kind} drives")
    while tally.exchanges < exchanges:
        spoiler.on = False
        line.sleep(0.05)  # a command that is late may still come, and be stopped by the watchdog
        played.shaft.rate = 0.0  # a hand stops it, which would coast for most of the time, where no fault befalls it
        line.sleep(0.05)  # what the drives said before has come
        try:
            bed.read()
        except Problem:  # angles have begun anew: whoever greets it begins with what they are
            bed.connect()
        if bed.read().state != BedState.DISARMED:
            bed.rest(0.2)
            while abs(bed.read().rate) > bed._require_about().limits.arming_rate:
                bed.rest(0.5)
            bed.clear()
        while abs(bed.read().rate) > bed._require_about().limits.arming_rate:
            bed.rest(0.5)
        bed.arm()
        spoiler.on = True
        due = line.now()
        missed = 0
        while tally.exchanges < exchanges:
            due += period
            line.sleep(max(0.0, due - line.now()))
            phase = 2.0 * math.pi * 3.0 * line.now()
            sample = bed.exchange(share * swing * math.sin(phase), share * 1.5 * math.sin(0.7 * phase))
            tally.exchanges += 1
            if spoiler.kind == "reboot" and chance.random() < 0.02:
                chance.choice(played.drives).reboot()
                spoiler.befell += 1
            if sample is None:
                missed += 1
                if missed == 5:
                    break
                continue
            missed = 0
            if sample.state != BedState.ARMED:
                tally.stops, tally.faults = tally.stops + 1, tally.faults | sample.faults
                break
            one, other = (side.time for side in bed._sides)
            steps = sum(side.facts.rate_count for side in bed._sides)
            skew = SKEW + sum(side.time_unsure for side in bed._sides)
            allowed = bed._acceleration * (abs(one - other) + skew) + steps + 0.01
            tally.allowed = max(tally.allowed, allowed)
            _judge(tally, sample, truth.between(one - 1e-3, one), allowed)
        spoiler.on = False
        bed.stop()
    return tally


def _judge(tally: Tally, sample: BedSample, true: list[float], allowed: float) -> None:
    tally.answered += 1
    off = min(abs(sample.rate - each) for each in true)
    tally.worst = max(tally.worst, off)
    tally.wrong += off > allowed


class _Truth:
    """The rates that a played shaft had, at the ends of its ticks."""

    def __init__(self, played: PlayedBench) -> None:
        self._rates: list[float] = []
        self._times: list[float] = []
        step = played.shaft.step

        def noted(drive: object, load: object) -> None:
            step(drive, load)  # type: ignore[arg-type]
            self._rates.append(played.shaft.rate)
            self._times.append(played.ticked + played.shaft.period)

        played.shaft.step = noted  # type: ignore[method-assign]

    def between(self, begin: float, end: float) -> list[float]:
        """The rates from a tick before a time to a tick after another, s."""
        last = len(self._times) - 1
        while last > 0 and self._times[last] > end:
            last -= 1
        first = last
        while first > 0 and self._times[first] >= begin:
            first -= 1
        return self._rates[first : last + 2]
