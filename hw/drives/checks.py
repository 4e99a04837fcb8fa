"""What a drive says that it was told, held against what this host has told it: another master's commands do not go over
the host's line where it is on another port of the drive, or where the line carries no more than one drive's answers.

A drive is asked again and again, now for the command that it has, now for a setting. One that is neither what it was
told lately nor what it was set to makes it doubtful; the second time it is another master's.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence

TOLD = 32
"""Last commands of which the one that a drive says it has may be any: frames are lost and late."""

OFTEN = 2
"""Questions for each command to one for a setting."""

SAME = 1e-5
"""Share by which two values that are the same may differ: they are told with 7 decimals or 24 bits, and said with 6."""

DOUBTS = 64
"""Questions for what was seen to be another's once, after which it is one of many again."""

AGAIN = 10.0
"""Time within which it must be seen twice, s: a checksum of 8 bits lets some answers through that are altered."""

SELDOM = "a few commands that last less than a period, and those that arm what is armed"
"""What another master may do to a drive that is asked what it was told, without being noticed."""


class SetpointChecks:
    """Chooses what a drive is asked of its own setpoint and settings, and judges whether the answer is this master's.

    apart          the largest difference of two values that are the same, besides `SAME`
    open_question  what was asked for last, where it is not answered; "" where it is
    """

    def __init__(self, apart: float = SAME) -> None:
        self._apart = apart
        self._commanded = deque[float](maxlen=TOLD)
        self.open_question: str = ""
        self.begin(())

    def begin(self, commands: Sequence[str], settings: Mapping[str, float] | None = None) -> None:
        """Begin anew. commands: names of the drive's commanded quantities to ask for, first the one that is commanded,
        then those that are 0 meanwhile; settings: other values that must stay"""
        self._commands, self._settings = tuple(commands), dict(settings or {})
        self._count = self._doubts = 0
        self._odd: dict[str, float] = {}
        self._doubted: str = ""
        self.open_question = ""

    @property
    def doubtful(self) -> bool:
        """True where something was seen to be another's once, so that it is to be asked for often."""
        return self._doubts > 0

    def tell(self, value: float) -> None:
        """Remember a command, as the drive says it."""
        self._commanded.append(value)

    def next(self) -> str:
        """Choose the setpoint or setting to ask for now; "" where there is nothing to ask for."""
        self._count += 1
        self._doubts = max(0, self._doubts - 1)
        settings = tuple(self._settings)
        round_, turn = divmod(self._count, OFTEN * len(self._commands) + 1)
        if self._doubts:
            self.open_question = self._doubted
        elif settings and not turn:
            self.open_question = settings[round_ % len(settings)]
        else:
            self.open_question = self._commands[turn % len(self._commands)] if self._commands else ""
        return self.open_question

    def answered(self, value: float, time: float) -> str:
        """Take the answer to the last question, at a time of the line's clock, s. Returns what another master has
        changed, in words; "" while that is not sure."""
        what, self.open_question = self.open_question, ""
        right = (self._settings.get(what, 0.0),) if what not in self._commands[:1] else self._commanded
        if any(abs(value - expected) <= self._apart + SAME * abs(expected) for expected in right):
            return ""
        again = time - self._odd.get(what, -math.inf) <= AGAIN
        self._odd[what], self._doubted, self._doubts = time, what, DOUBTS
        return f"its {what} is {value:.6g}" if again else ""
