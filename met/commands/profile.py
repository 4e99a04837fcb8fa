"""What a command profile is to the engine: a course in time of whatever is commanded.

In a deck a profile stands inside the kind of command: `rate(step(to = slow, at = 1 s))`; a bare value is the
constant profile. The engine evaluates it at the servo's ticks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from met.frozen import frozen
from met.parameter import Parameter
from met.trace import Real


@frozen(kw_only=True)
class Profile:
    """The declaration of a command profile; one a file.

    course  (p, t) -> (value, slope): value in the unit `command`, slope its time derivative; t in s.
            The slope at a jump is zero, at a kink the slope of what follows.
    """

    name: str
    doc: str
    parameters: tuple[Parameter, ...]
    course: Callable[[Any, Real], tuple[Real, Real]]
