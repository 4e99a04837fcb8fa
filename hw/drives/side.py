"""One drive of a bench as its host follows it: its angle without jumps, the shaft's rate, and whether two agree."""

from __future__ import annotations

import math

from hw.drives.drive import Drive, DriveFacts, DriveReading

LONGEST_STEP = 0.05
"""Longest time between two samples whose difference is still taken for a rate, s."""

SKEW = 2e-4
"""Longest time between the instants at which two drives sampled, besides what their frames' times tell, s."""

APART = 5e-4
"""Longest time between two drives' answers to one question, s."""

FLOAT = 2.0**-23
"""Relative step of the floats in which angles and rates are told."""


class Side:
    """A drive, its description, and what its last sound answer says of the shaft.

    angle  rad, without jumps, from what it was at the greeting;  rate: rad/s;  time: s of the line's clock
    """

    def __init__(self, drive: Drive, facts: DriveFacts, difference: bool) -> None:
        self.drive, self.facts, self.difference = drive, facts, difference
        self.angle = self.rate = self.time = 0.0
        self._before: DriveReading | None = None
        self._zero: float | None = None

    @property
    def words(self) -> str:
        """What the drive is, for whoever asks what the bed is."""
        d, f = self.drive, self.facts
        told = (f.voltage_count, "V") if d.entry.quantity == "voltage" else (f.torque_count, "N*m")
        counts = (told, (f.angle_count, "rad"), (f.rate_count, "rad/s"))
        steps = ", ".join(f"{count:.3g} {unit}" for count, unit in counts if count)
        said = [
            f"node {d.node}, {d.dialect} {f.firmware}, {f.hardware}",
            f"told a {d.entry.quantity}{', counts it the other way round' if d.sense < 0 else ''}",
            f"in steps of {steps}" if steps else "in floats",
            f"rate by {'the differences of its angle' if self.difference else 'its own estimate'}",
        ]
        return "; ".join(said if d.supply is None else [*said, f"supply {d.supply:.4g} V"])

    def begin(self) -> None:
        """Let the angle count from the last answer."""
        reading = self.drive.reading
        assert reading is not None
        self._before, self._zero, self.angle, self.rate, self.time = (
            reading,
            reading.angle,
            0.0,
            reading.rate,
            reading.time,
        )
        if self.difference:
            self.rate = 0.0

    def looked(self, reading: DriveReading) -> tuple[float, float]:
        """Angle (rad, without jumps) and rate (rad/s) that an answer would mean; nothing is kept."""
        before = self._before
        assert before is not None
        turned = reading.angle - before.angle
        if self.facts.angle_range:
            turned = math.remainder(turned, self.facts.angle_range)
        time = reading.time - before.time
        if not self.difference:
            return self.angle + turned, reading.rate
        return self.angle + turned, turned / time if 0.0 < time < LONGEST_STEP else reading.rate

    def follow(self, reading: DriveReading) -> None:
        """Keep what an answer means."""
        self.angle, self.rate = self.looked(reading)
        self._before, self.time = reading, reading.time

    def unsure(self, reading: DriveReading, period: float) -> tuple[float, float]:
        """The angle (rad) and rate (rad/s) by which the dialect's steps alone let it be off."""
        angle = self.facts.angle_count or FLOAT * abs(reading.angle) + FLOAT
        if self.difference:
            return angle, 2.0 * angle / period
        return angle, self.facts.rate_count or FLOAT * abs(reading.rate) + FLOAT

    def goes_on(self, reading: DriveReading, acceleration: float, period: float) -> bool:
        """Whether an answer goes on from the one before: neither angle nor rate has jumped by more than twice the
        largest acceleration (rad/s^2) makes of the time between. After a pause anything does."""
        assert self._before is not None
        time = reading.time - self._before.time
        if not 0.0 <= time <= LONGEST_STEP:
            return True
        angle, rate = self.looked(reading)
        angle_step, rate_step = self.unsure(reading, period)
        slack = time + SKEW
        turned = abs(angle - self.angle - self.rate * time)
        return abs(rate - self.rate) <= 2.0 * (acceleration * slack + rate_step) and turned <= 2.0 * (
            acceleration * slack * slack + abs(self.rate) * SKEW + rate_step * slack + angle_step
        )


def agree(
    sides: tuple[Side, Side], readings: tuple[DriveReading, DriveReading], acceleration: float, period: float
) -> bool:
    """Whether two drives on one shaft say the same of it, at once, and what goes on from before: their angles and rates
    differ by no more than the largest acceleration (rad/s^2) makes of the time between their samples, and by the steps
    in which they are told."""
    if abs(readings[0].time - readings[1].time) > APART or not all(
        side.goes_on(reading, acceleration, period) for side, reading in zip(sides, readings, strict=True)
    ):
        return False
    (angle, rate), (other_angle, other_rate) = (
        side.looked(reading) for side, reading in zip(sides, readings, strict=True)
    )
    steps = [side.unsure(reading, period) for side, reading in zip(sides, readings, strict=True)]
    apart = abs(readings[0].time - readings[1].time) + SKEW
    rate_step = acceleration * apart + sum(each[1] for each in steps)
    angle_step = (abs(rate) + rate_step) * apart + sum(each[0] for each in steps)
    return abs(angle - other_angle) <= 2.0 * angle_step and abs(rate - other_rate) <= rate_step
