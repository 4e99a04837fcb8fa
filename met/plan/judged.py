"""Numbers that a plan computes from a run's channels, and the conditions that judge its cases."""

from __future__ import annotations

from typing import Literal

from met.diagnostic import Place
from met.frozen import frozen, keyed
from met.trace.graph import Formulas


@frozen
class SignalExpression:
    """A number that a run computes from its channels at their samples, which is a channel too.

    name     path of that channel: `signals.NAME`, or the expression as the deck wrote it
    unit     of its value, SI; of a condition that of its margin, by which it holds (at least 0) or does not
    formula  one output; inputs are channels, their paths behind `CHANNEL_INPUT`, and coordinates of the sweep
    text     the expression as the deck wrote it
    """

    name: str
    unit: str
    formula: Formulas
    text: str = keyed("never", default="")
    place: Place | None = keyed("never", default=None)

    @property
    def channels(self) -> tuple[str, ...]:
        """Paths of the channels that it is computed from."""
        return tuple(name.removeprefix(CHANNEL_INPUT) for name in self.formula.inputs if name.startswith(CHANNEL_INPUT))


CHANNEL_INPUT = "channel:"
"""Prefix of the inputs of a `SignalExpression` that are channels."""


@frozen
class MetricUse:
    """A metric under a name of the deck's, of one channel (`Channel.path`) or of one linear answer."""

    name: str
    model: str
    of: str
    place: Place | None = keyed("never", default=None)


@frozen
class Requirement:
    """A condition on a metric that a case meets or misses, in SI; `text` as the deck wrote it.

    share       of all cases that may be drawn, the part that is to meet it, above 0 and at most 1; None where every
                case of the campaign is to meet it
    confidence  with which the cases that were drawn are to show the share, above 0 and below 1; None where the share of
                these cases themselves decides
    """

    text: str
    metric: str
    comparison: Literal["<", "<=", ">", ">="]
    limit: float
    place: Place | None = None
    share: float | None = keyed("where set", default=None)
    confidence: float | None = keyed("where set", default=None)


@frozen
class StepErrorLimit:
    """A condition on the error of a metric due to the step, for each case that is also run with shorter steps; `text`
    as the deck wrote it. limit: SI, or where it is a `share`, relative to the metric's value."""

    text: str
    metric: str
    comparison: Literal["<", "<="]
    limit: float
    share: bool = False
    place: Place | None = None


@frozen
class Tolerance:
    """The difference up to which a diff calls two versions equal; `text` as the deck wrote it.

    of     a signal, `q`; a joint's part of one, `elbow.q`; a metric; `rel`: of all, a share; `time`: of all, s
    value  in SI
    """

    of: str
    value: float
    text: str
    place: Place | None = None
