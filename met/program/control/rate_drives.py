"""Joints whose drive on a bed closes the rate loop: its command at a tick of the servo, and the model of its loop.

The command is the rate that the servo's law gives its rate loop. The drive need not report its torque: the servo's own
loop, with the law's estimate of the shaft's rate and an integral of its own, serves as the drive's model
(met/substitution/drive.py). Rates and torques are of the joint's size, on the motor's side of the gearbox.
"""

from __future__ import annotations

from met.frozen import frozen
from met.program import cells
from met.program.cells import answer
from met.program.system import Actuator, System
from met.servos.motor import Motor, RateLoop
from met.servos.servo import Seen
from met.substitution import drive
from met.substitution.bed import BedModel
from met.substitution.law import Law
from met.trace import Real
from met.trace.program import Tape


@frozen
class Mounted:
    """A substituted joint: its servo, the bed that its motor is on, the law, and whether the bed is scaled."""

    actuator: Actuator
    joint: str
    bed: BedModel
    law: Law
    scaled: bool

    @property
    def index(self) -> int:
        """Number of the joint among the moving ones."""
        return self.actuator.index

    @property
    def closes_rate_loop(self) -> bool:
        """True where the drive closes the rate loop: its command is a rate."""
        return self.bed.drive == "rate"


@frozen
class RateDrives:
    """Models of the rate loops of drives on beds. period: of the servos' ticks, s"""

    system: System
    period: float

    def begin(self, tape: Tape, joint: Mounted) -> None:
        """Start the loop of an armed drive with an integral of 0."""
        tape.write(cells.LOOP_INTEGRAL(joint.joint), 0.0)

    def integral(self, tape: Tape, joint: Mounted) -> Real:
        """The integral of the drive's loop at this tick, rad; 0 where it has no loop."""
        return tape.read(cells.LOOP_INTEGRAL(joint.joint)) if joint.closes_rate_loop else 0.0

    def want(self, tape: Tape, joint: Mounted, seen: Seen) -> None:
        """Keep the joint rate that the servo's law gives its rate loop at this tick, rad/s (m/s)."""
        assert joint.actuator.servo.rate_wanted is not None
        p = self.system.servo_values(joint.actuator, tape.read)
        wanted = answer(joint.actuator.owner, joint.actuator.servo.rate_wanted, p, seen.q, seen.setpoint)
        tape.write(cells.RATE_WANTED(joint.joint), wanted)

    def commanded_rate(self, tape: Tape, joint: Mounted, motor: Motor) -> Real:
        """The rate of the shaft that the drive is commanded at this tick, rad/s."""
        return motor.ratio * tape.read(cells.RATE_WANTED(joint.joint))

    def torque(
        self, tape: Tape, joint: Mounted, motor: Motor, commanded: Real, integral: Real, w: Real
    ) -> drive.LoopTorque:
        """Torque of the motor under the loop, N m. integral: rad;  commanded, w: rates of the shaft, rad/s"""
        return drive.loop_torque(motor, self.loop(tape, joint), integral, commanded, w, self.period)

    def wound(self, tape: Tape, joint: Mounted, commanded: Real, integral: Real, w: Real, after: Real) -> Real:
        """The integral one tick on, rad, under a commanded rate, while the shaft's rate goes from w to `after`,
        rad/s."""
        return drive.wound(self.loop(tape, joint), integral, commanded - 0.5 * (w + after), self.period)

    def wind(self, tape: Tape, joint: Mounted, commanded: Real, w: Real, after: Real) -> None:
        """Advance the kept integral to the next tick, as `wound` does."""
        wound = self.wound(tape, joint, commanded, self.integral(tape, joint), w, after)
        tape.write(cells.LOOP_INTEGRAL(joint.joint), wound)

    def loop(self, tape: Tape, joint: Mounted) -> RateLoop:
        """The rate loop of the joint's servo."""
        assert joint.actuator.servo.rate_loop is not None
        p = self.system.servo_values(joint.actuator, tape.read)
        return answer(joint.actuator.owner, joint.actuator.servo.rate_loop, p)
