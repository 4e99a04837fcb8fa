"""The declaration of a law: the control of the load motor, by which the shaft turns as if it carried the arm.

At a tick the engine has read the filtered rate of every substituted joint, has run its servo for the voltage, and knows
the arm's load on these joints together: tau_load = Lambda qdd + b_0. A law gives the load torque of each, and the
acceleration of the arm's joint.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from met.frozen import frozen
from met.messages.renamed import old_names
from met.parameter import Declaration, Memory, Parameter
from met.servos.motor import Motor
from met.substitution.balance import Balanced
from met.trace import Real


@frozen
class LawInput:
    """The inputs of a law for one substituted joint at a tick; shaft side but for b_0.

    motor    as the servo believes it;  inertia: of the bed's shaft, kg m^2
    rate     filtered rate read now, before: at the tick before, rad/s
    w, d     rate and unknown torque: the observer's where the law has one, else the filtered rate and 0
    w_ref    the rate that the joint's own motor would have, rad/s; 0 without an observer
    period   from tick to tick, s
    balance  the motion that balances all torques, of this joint; None where the law takes no balance
    extra    what the bed's shaft must be given besides its inertia, for the mean over the tick, kg m^2
    """

    motor: Motor
    inertia: Real
    rate: Real
    before: Real
    w: Real
    d: Real
    w_ref: Real
    period: float
    balance: Balanced | None
    extra: Real


@frozen
class LawOutput:
    """The answer of a law: load torque on the shaft (N m), joint acceleration for the arm (rad/s^2; m/s^2)."""

    torque: Real
    qdd: Real


OF_LAW = (
    ("torque", "N*m", "load torque that the law commands"),
    ("rate", "rad/s", "rate of the shaft, as estimated by the law"),
)
"""Name, unit and meaning of the numbers that the engine holds for every law, besides its own memory."""

OF_OBSERVER = (
    ("unknown_torque", "N*m", "torque on the shaft that the motor's parameters do not explain"),
    ("reference_rate", "rad/s", "rate that the shaft would have on the joint itself"),
)
"""Name, unit and meaning of the further numbers that the engine holds for a law with an observer."""


@frozen(kw_only=True)
class Law(Declaration):
    """The declaration of a law; one a file. All substituted joints of a run have the same.

    observer  whether it has one: parameters `torque_noise`, `drift`, `reading_noise`
    balance   "full": friction is part of the balance, means over the tick; "bare": neither; "none": there is none
    memory    of its own, one a joint
    give      (p, held, inputs, load) -> LawOutput of each joint, and its new memory by name. p, held,
              inputs: one a joint;  load: joint accelerations -> Lambda qdd + b_0, N m (N)
    """

    observer: bool = False
    balance: Literal["full", "bare", "none"] = "full"
    memory: tuple[Memory, ...] = ()
    give: Callable[
        [Sequence[Any], Sequence[Any], Sequence[LawInput], Callable[[Sequence[Real]], Sequence[Real]]],
        Sequence[tuple[LawOutput, Mapping[str, Real]]],
    ]

    @property
    def shown(self) -> tuple[tuple[str, str, str], ...]:
        """Name, unit and meaning of all recordable numbers of this law, its own memory first."""
        own = ((memory.name, memory.unit, memory.doc) for memory in self.memory)
        return (*own, *OF_LAW, *OF_OBSERVER * self.observer)


BAND = Parameter(
    name="band",
    unit="rad/s",
    default=0.5,
    at_least=0.0,
    doc="rate of the shaft below which it counts as at rest, held by friction",
)

OBSERVER = (
    Parameter(
        name="torque_noise",
        unit="N^2*m^2*s",
        default=1e-9,
        above=0.0,
        doc="spectral density of the torque noise on the shaft",
    ),
    Parameter(
        name="drift",
        unit="N^2*m^2/s",
        default=1e-5,
        above=0.0,
        doc="spectral density of the changes of the unknown torque",
    ),
    Parameter(
        name="reading_noise",
        unit="rad^2/s",
        default=1e-5,
        above=0.0,
        doc="spectral density of the noise in the rate reading",
    ),
)
"""Parameters of the observer's noise. 1e-5 rad^2/s is 0.1 rad/s, rms, at 1 kHz."""

if not TYPE_CHECKING:  # a type checker knows the new names alone
    __getattr__ = old_names(__name__, {"Told": "LawInput", "Given": "LawOutput"}, globals())
