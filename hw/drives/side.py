"""One drive of a bench as its host follows it: its angle without jumps, the shaft's rate, and whether two agree."""

from __future__ import annotations

import math

from hw.drives.drive import CanDrive, DriveFacts, DriveReading

LONGEST_STEP = 0.05
"""Longest time between two samples of which one is still held against the other, s."""

SKEW = 2e-4
"""Longest time between the samples of two drives, beyond the difference of their frames' times, s."""

APART = 5e-4
"""Longest time between two drives' answers to one question, s."""

FLOAT = 2.0**-23
"""Relative step of the floats for angles and rates."""


class Side:
    """A drive, its description, and what its last sound answer says of the shaft.

    angle  rad, without jumps, from what it was at the greeting;  rate: rad/s;  time: s of the line's clock, which may
           be off by `time_unsure`, s
    """

    def __init__(self, drive: CanDrive, facts: DriveFacts) -> None:
        self.drive, self.facts = drive, facts
        self.angle = self.rate = self.time = self.time_unsure = 0.0
        self.zero_unsure = 0.0
        """Uncertainty of the angle because the shaft turned at its zero, rad."""
        self._angle_read = 0.0
        """The angle as it was told last, rad."""

    @property
    def words(self) -> str:
        """The drive in words, for the bed's description."""
        d, f = self.drive, self.facts
        counts = ((f.torque_count, "N*m"), (f.angle_count, "rad"), (f.rate_count, "rad/s"))
        steps = ", ".join(f"{count:.3g} {unit}" for count, unit in counts if count)
        parts = [
            f"{d.where}, {d.dialect} {f.firmware}, {f.hardware}",
            f"in steps of {steps}" if steps else "in floats",
            *(["counts the other way round"] if d.sense < 0 else []),
        ]
        return "; ".join(parts if d.supply is None else [*parts, f"supply {d.supply:.4g} V"])

    def begin(self, reading: DriveReading, time: float) -> None:
        """Count the angle from its present value, by an answer, at a time of the line's clock, s."""
        self._angle_read, self.angle, self.rate, self.time = (
            reading.angle,
            -reading.rate * (time - reading.time),
            reading.rate,
            reading.time,
        )
        self.time_unsure = reading.time_unsure
        self.zero_unsure = abs(reading.rate) * (SKEW + reading.time_unsure)

    def angle_of(self, reading: DriveReading) -> float:
        """The angle that an answer means, rad, without jumps."""
        turned = reading.angle - self._angle_read
        if self.facts.angle_range:
            turned = math.remainder(turned, self.facts.angle_range)
        return self.angle + turned

    def follow(self, reading: DriveReading) -> None:
        """Take over the contents of an answer."""
        self.angle, self.rate, self.time = self.angle_of(reading), reading.rate, reading.time
        self.time_unsure = reading.time_unsure
        self._angle_read = reading.angle

    def unsure(self, reading: DriveReading) -> tuple[float, float]:
        """The angle (rad) and rate (rad/s) by which the dialect's steps alone let it be off."""
        return (
            self.facts.angle_count or FLOAT * abs(reading.angle) + FLOAT,
            self.facts.rate_count or FLOAT * abs(reading.rate) + FLOAT,
        )

    def goes_on(self, reading: DriveReading, acceleration: float) -> bool:
        """True where an answer goes on from the one before: neither angle nor rate has jumped by more than twice what
        the largest acceleration (rad/s^2) makes of the time between. After a pause anything does."""
        time = reading.time - self.time
        if not 0.0 <= time <= LONGEST_STEP:
            return True
        angle_step, rate_step = self.unsure(reading)
        skew = SKEW + self.time_unsure + reading.time_unsure
        slack = time + skew
        jump = abs(self.angle_of(reading) - self.angle - self.rate * time)
        most = acceleration * slack * slack + 2.0 * (abs(self.rate) * skew + rate_step * slack + angle_step)
        return jump <= most and abs(reading.rate - self.rate) <= 2.0 * (acceleration * slack + rate_step)


def agree(sides: tuple[Side, Side], readings: tuple[DriveReading, DriveReading], acceleration: float) -> bool:
    """True where both drives on one shaft say the same of it at the same time, and go on from before: angles and rates
    differ by no more than the largest acceleration (rad/s^2) makes of the time between their samples, and by the steps
    in which the drives count."""
    (first_side, other), (first, second) = sides, readings
    apart, unsure = abs(first.time - second.time), first.time_unsure + second.time_unsure
    if apart > APART + unsure or not (first_side.goes_on(first, acceleration) and other.goes_on(second, acceleration)):
        return False
    steps = first_side.unsure(first), other.unsure(second)
    skew = apart + SKEW + unsure
    rate_most = acceleration * skew + steps[0][1] + steps[1][1]
    angle_steps = steps[0][0] + steps[1][0] + first_side.zero_unsure + other.zero_unsure
    angle_most = 2.0 * ((abs(first.rate) + rate_most) * skew + angle_steps)
    differ = first_side.angle_of(first) - other.angle_of(second)
    if turns := max(first_side.facts.angle_range, other.facts.angle_range):
        differ = math.remainder(differ, turns)  # after a pause nobody knows how often either went round
    return abs(differ) <= angle_most and abs(first.rate - second.rate) <= rate_most
