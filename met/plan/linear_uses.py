"""Linear answers that a run asks for by name, and their figures that are metrics.

    linear hand_loop { at = 2 s; open = pan.servo.voltage; }
    require phase_margin(hand_loop) > 30 deg;

They are computed for each case after it has run (`met.analysis.linear.metrics`). They are part of no program, so they
change no bit of a run and no structure key.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from met.diagnostic import Place
from met.frozen import frozen, keyed


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
