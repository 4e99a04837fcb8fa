"""Ticks of guides and sensors of links: their rates, and the check that each tick is at an instant of the dynamics."""

from __future__ import annotations

from typing import Protocol

from ic.meaning.control.schedule import CONTINUOUS, Rate
from ic.meaning.parameters.scope import Scope
from met.diagnostic import Label, Place


class Ticking(Protocol):
    """A guide or a sensor of the run."""

    @property
    def label(self) -> str:
        """Its name in words: "guide `tip`"."""

    @property
    def kind(self) -> str:
        """Its kind in a word: "guide"."""

    @property
    def path(self) -> str:
        """The path of its parameters."""

    @property
    def verb(self) -> str:
        """The verb for a part at its ticks, as messages use it: "ticks" of a guide, "reads" of a sensor."""

    @property
    def code(self) -> str:
        """The code of what is wrong with its rate."""

    @property
    def rate(self) -> Rate | None:
        """Its rate as the deck has it; None: that of the servos."""

    @property
    def ticks(self) -> bool:
        """Whether it has a computer."""

    @property
    def place(self) -> Place:
        """Where the deck has it."""


def rate_of(scope: Scope, ticker: Ticking, shared: Rate | None) -> Rate | None:
    """The own rate, else that of the servos; None where there is neither (already reported)."""
    own_rate = ticker.rate or shared
    if own_rate is None or own_rate.hz == CONTINUOUS:
        message = "the servos are continuous" if own_rate is not None else "the run has no rate of the servos"
        scope.complaints.error(
            ticker.code,
            f"{ticker.label} has no rate, and {message}",
            ticker.place,
            help=f"write `rate = 100 Hz;` in the {ticker.kind}",
        )
        return None
    return own_rate


def check_instants(scope: Scope, ticker: Ticking, divisor: int, dynamics: int, rate: Rate, step: Rate) -> None:
    """Check that it ticks at instants of the dynamics, since it sees the arm there."""
    if divisor % dynamics:
        report_between_steps(scope, ticker, rate, step)


def report_between_steps(scope: Scope, ticker: Ticking, rate: Rate, step: Rate) -> None:
    """Report one whose rate does not divide that of the dynamics."""
    scope.complaints.error(
        ticker.code,
        f"{ticker.label} {ticker.verb} at {rate.hz:g} Hz, between the steps of the dynamics",
        rate.place,
        also=[Label(step.place, f"{step.hz:g} Hz")],
        help=f"give the {ticker.kind} a `rate` that divides {step.hz:g} Hz, or quicken the dynamics",
    )
