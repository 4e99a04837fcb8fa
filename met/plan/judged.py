"""Numbers that a plan computes from channels, the conditions that judge its cases, and figures of linear answers.

A run asks for linear answers by name:

    linear hand_loop { at = 2 s; open = pan.servo.voltage; }
    require phase_margin(hand_loop) > 30 deg;

Their figures are computed for each case after it has run (`met.analysis.linear.metrics`). They are part of no program,
so they change no bit of a run and no structure key.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
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


@frozen
class LinearUse:
    """A question for linear answers, under a name of the deck's.

    at       s; they are of the last begin of a period up to it
    inputs   channels of servos that tick: commands, outputs of laws
    outputs  what can be recorded
    opened   outputs of laws, at which loops are opened: each by itself, and all at once
    pose     rad (m), of each moving joint: where the arm is to stand still, in place of the instant; none of them:
             where the run begins. None: it is as the run has it at the instant
    """

    name: str
    at: float = 0.0
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    opened: tuple[str, ...] = ()
    pose: tuple[float, ...] | None = None
    place: Place | None = keyed("never", default=None)

    @property
    def where(self) -> str:
        """The place of the answers in words: `at 2 s`, `at equilibrium`."""
        return f"at {self.at:.9g} s" if self.pose is None else "at equilibrium"


@frozen
class LinearFigure:
    """A number of linear answers that may be a metric.

    unit      SI;  least: bound below which it never is
    of_loops  whether it is of opened loops: the least of all of them
    of_way    whether it is of the way from one input to one output
    one_rate  whether a loop has it whose law ticks once in a period alone
    unstable  its value where the loop is unstable as it is
    margin    whether more of it is better
    """

    name: str
    unit: str
    doc: str
    least: float = -math.inf
    of_loops: bool = True
    of_way: bool = False
    one_rate: bool = True
    unstable: float = 0.0
    margin: bool = True


FIGURES: Mapping[str, LinearFigure] = {
    figure.name: figure
    for figure in (
        LinearFigure("gain_margin", "1", "factor by which the loop's gain may rise or fall; 1 if the loop is unstable",
                     least=1.0, one_rate=False, unstable=1.0),
        LinearFigure("phase_margin", "rad", "angle by which the loop's phase may change in either direction; 0 if "
                                            "the loop is unstable",
                     least=0.0),
        LinearFigure("delay_margin", "s", "time by which the output of the control law may come later; 0 if the loop "
                                          "is unstable",
                     least=0.0),
        LinearFigure("disk_margin", "1", "size alpha of the disk of simultaneous changes of gain and phase; 0 if the "
                                         "loop is unstable",
                     least=0.0),
        LinearFigure("damping", "1", "smallest damping ratio of all poles that decay or grow; negative if one grows",
                     least=-1.0, of_loops=False, one_rate=False),
        LinearFigure("decay_time", "s", "time in which the slowest mode decays by a factor of e; infinite if a mode "
                                        "grows",
                     least=0.0, of_loops=False, one_rate=False, margin=False),
        LinearFigure("bandwidth", "Hz", "lowest frequency at which what comes from the input to the output falls to "
                                        "1/sqrt(2) of what it is at rest; 0 if a mode grows",
                     least=0.0, of_loops=False, of_way=True, one_rate=False),
        LinearFigure("bending_share", "1", "bandwidth as a share of the frequency of the first bending mode of a boom "
                                           "while computers hold their joints; infinite if a mode grows",
                     least=0.0, of_loops=False, of_way=True, one_rate=False, unstable=math.inf, margin=False),
    )
}  # fmt: skip
"""Figures of linear answers, by name."""

WHY_ANSWER = "linear:"
"""Prefix of a `LinearUse`'s name: the output that says why a case has no answer, a key of `WHY_NONE`; 0 where it has
one."""

ANSWERED, NOT_ASKED, EVENT, OPEN, SEVERAL_TICKS, NO_EQUILIBRIUM, AT_LIMIT, NOTHING_DECAYS, NO_REST = range(9)

WHY_NONE: Mapping[int, str] = {
    NOT_ASKED: "it is not computed of a case that is driven on beds, or run by itself",
    EVENT: "an event is in the period there",
    OPEN: "nothing comes back where the loop is opened, as its joint is held, or its law at its limit",
    SEVERAL_TICKS: "its law ticks several times in a period, and has no phase, delay or disk of one rate",
    AT_LIMIT: "something is at its limit there, so that its poles are not those of its loops",
    NOTHING_DECAYS: "nothing decays or grows there: all of it stays, or is held",
    NO_REST: "its output is nothing, or has no end, for an input that stays",
    NO_EQUILIBRIUM: "its servos cannot hold it there, or something moves that no servo holds",
}
"""Reasons why a case has no answer, in words."""
