"""The rate of exchanges with a bed: the servo's rate, or the smallest multiple of it that is at least 500 Hz.

A bed stops itself when it hears nothing for 10 to 20 ms, so that a slow servo's command is repeated on the wire.
"""

from __future__ import annotations

import math

from met.frozen import frozen

SLOWEST_HZ = 500.0
LOCK_STEP_PATIENCE, SHORTEST_PATIENCE = 1.0, 0.002
MISSED = 5
"""Exchanges in a row without an answer, or periods of lateness, after which the host stops the beds."""


@frozen
class Pace:
    """The rate of exchanges. servo_hz: rate of the substituted joints' servos, Hz;  repeats: exchanges a tick of
    theirs"""

    servo_hz: float
    repeats: int

    @property
    def hz(self) -> float:
        """The rate of exchanges on the wire, Hz."""
        return self.servo_hz * self.repeats

    @property
    def period(self) -> float:
        """The time from one exchange to the next, s."""
        return 1.0 / self.hz

    def patience(self, lock_step: bool) -> float:
        """The time to wait for an answer, s. It is long in lock-step, where an emulator may be slow."""
        return LOCK_STEP_PATIENCE if lock_step else max(self.period, SHORTEST_PATIENCE)

    def late(self, lock_step: bool) -> int:
        """The smallest number of servo ticks from reading a rate to acting on it: a bed with a time of its own is
        commanded at the next exchange, one in lock-step at once."""
        return 0 if lock_step or self.repeats > 1 else 1


def pace(servo_hz: float) -> Pace:
    """The pace of exchanges for servos that tick at this rate, Hz."""
    return Pace(servo_hz, max(1, math.ceil(SLOWEST_HZ / servo_hz - 1e-9)))
