"""A number of a run as a multiple of another, and when that is far outside what is usual."""

from __future__ import annotations

import math
from collections.abc import Mapping

from met.frozen import frozen

TURN = 2.0 * math.pi


def inside(bound: float, share: float, digits: int) -> str:
    """A bound in a few digits, rounded to the side on which the finding holds: down where the share is below 1, else
    up, in size."""
    if not bound or not math.isfinite(bound):
        return f"{bound:g}"
    step = 10.0 ** (math.floor(math.log10(abs(bound))) + 1 - digits)
    whole = (math.floor if share < 1.0 else math.ceil)(abs(bound) / step)
    return f"{math.copysign(whole * step, bound):.{digits}g}"


@frozen
class Scale:
    """A number of a run as a multiple of another.

    what    what is compared, in words
    path    of the parameter that the number is of, or the first of them
    size    the number;  unit: its unit, "" of one without;  verb: that leads to it from the path
    beside  the other number, which is `other` in words; 1 and "" where the number is a multiple already
    low     smallest usual multiple;  high: the largest;  usual: where these are from, in words
    meant   unit of the parameter where another may have been meant, "" where it may not;  power: the multiple goes as
            this power of the parameter
    clause  what is so, in words, where the multiple does not say it;  cure: its remedy, where another than to be
            within the usual range
    typical  a multiple in the middle of what is usual, of a number on which the motion depends; 0: none is known
    """

    what: str
    path: str
    size: float
    unit: str
    beside: float
    other: str
    low: float
    high: float
    usual: str
    verb: str = "is"
    meant: str = ""
    power: float = 1.0
    clause: str = ""
    cure: str = ""
    typical: float = 0.0

    @property
    def multiple(self) -> float:
        return self.size / self.beside

    @property
    def nearness(self) -> float:
        """The multiple beside the nearer end of its usual range: 1 at the end, more outside; of a number 0 it is 0."""
        multiple = self.multiple
        return max(multiple / self.high, self.low / multiple) if multiple != 0.0 and math.isfinite(multiple) else 0.0

    def sentence(self, case: str, others: int) -> str:
        """The warning in words. case: words for the case; others: number of further paths that are so"""
        more = f"; {others} more {'is' if others == 1 else 'are'} so" if others else ""
        clause = self.clause or f"{self.verb} {self.size:.4g} {self.unit}".rstrip()
        return f"`{self.path}` {clause}{case}{'' if self.clause else self.times}{more}; {self.usual}"

    @property
    def times(self) -> str:
        """The multiple in words, `, 3 times the arm's reach, 2 m`; "" where there is no other number."""
        return f", {self.multiple:.4g} times {self.other}" if self.other else ""

    @property
    def words(self) -> str:
        """The number and its multiple, in words."""
        return f"{self.verb} {self.size:.4g} {self.unit}".rstrip() + self.times

    @property
    def remedies(self) -> list[str]:
        """Other units of the parameter with which the multiple would be usual, if there are any, and what is usual."""
        if self.clause or self.cure:
            return [self.cure or "ask for less, or move the limit"]
        multiples = [(unit, self.multiple * factor**self.power) for unit, factor in OTHER_UNITS.get(self.meant, ())]
        usual = [
            (unit, multiple) for unit, multiple in multiples if max(self.low, 1e-2 * self.high) <= multiple <= self.high
        ]
        usual.sort(key=lambda pair: abs(math.log(pair[1] / (0.1 * self.high))))
        alternatives = ", ".join(f"in {unit} it would be {multiple:.3g} times" for unit, multiple in usual[:2])
        end, word, side = (self.low, "least", 2.0) if self.multiple < self.low else (self.high, "most", 0.5)
        limit = f"at {word} {inside(end * self.beside, side, 3)} {self.unit}".rstrip() + " is usual"
        return [*([f"{alternatives} {self.other}: is the unit another?"] if alternatives else []), limit]


OTHER_UNITS: Mapping[str, tuple[tuple[str, float], ...]] = {
    "rad": (("deg", math.radians(1.0)),),
    "rad/s": (("deg/s", math.radians(1.0)), ("rpm", TURN / 60.0)),
    "m": (("mm", 1e-3), ("cm", 1e-2)),
    "m/s": (("mm/s", 1e-3), ("cm/s", 1e-2)),
    "m/s^2": (("cm/s^2", 1e-2), ("mm/s^2", 1e-3)),
    "kg": (("g", 1e-3),),
    "kg*m^2": (("kg*cm^2", 1e-4), ("kg*mm^2", 1e-6), ("g*cm^2", 1e-7), ("g*mm^2", 1e-9)),
    "N*m": (("N*cm", 1e-2), ("N*mm", 1e-3)),
    "A": (("mA", 1e-3),),
}
"""Units in which a number may have been meant, and their size in that which it has."""
