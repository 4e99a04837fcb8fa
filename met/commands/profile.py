"""The declaration of a command profile: the course of a commanded quantity in time.

In a deck a profile stands inside the kind of command: `rate(step(to = slow, at = 1 s))`; a bare value is the
constant profile. The engine evaluates it at the servo's ticks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

from met.content import Content
from met.frozen import frozen
from met.parameter import Declaration, Limit, Parameter
from met.trace import Real

FILE = Parameter(name="file", shape="text", doc="CSV file")
COLUMN = Parameter(name="column", shape="text", default="the joint's", doc="name of the column")


Jump = Literal["value", "rate", "none"]


@frozen(kw_only=True)
class Profile(Declaration):
    """The declaration of a command profile; one a file.

    parameters  what `course` reads, and what a plan holds
    course      (p, t) -> (value, slope): value in the unit `command`, slope its time derivative; t in s.
                The slope at a jump is zero, at a kink the slope of what follows.
    jumps       what of the course may jump within a run: its value; the slope, so that it has kinks; none of the two.
                What moves a base must not jump. (p) -> that, where a word decides
    content     (p, duration) -> what it brings in a run of that length (s): a deck is warned where the instants that
                sample it do not carry that, or the run ends before. Asked with numbers. None: nothing is known of it
    limits      those that it has, such as a table's ends: how much of a run is spent at each is kept of every case
    shortest    (p) -> the least, s, that its parameter `over` may be, for all of it to find room; None: any
    of_a_rate   what help says of it under a `rate` command, where it is easily taken for another course
    from_file   the lists `times` and `values` are columns of a CSV file: a deck writes `file` and `column` for them
    """

    course: Callable[[Any, Real], tuple[Real, Real]]
    jumps: Jump | Callable[[Any], Jump] = "rate"
    content: Callable[[Any, float], Content] | None = None
    limits: tuple[Limit, ...] = ()
    shortest: Callable[[Any], Real] | None = None
    of_a_rate: str = ""
    from_file: bool = False

    def jump(self, p: Any) -> Jump:
        """The part of the command in time that may jump with these parameters: `value`, `rate` or `none`."""
        return self.jumps(p) if callable(self.jumps) else self.jumps

    @property
    def written(self) -> tuple[Parameter, ...]:
        """The parameters as a deck writes them."""
        if not self.from_file:
            return self.parameters
        return (FILE, COLUMN, *(p for p in self.parameters if p.name not in ("times", "values")))
