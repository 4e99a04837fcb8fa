"""Servo models, one a file. To add one: write its file, add it to `SERVOS`."""

from met.servos import cascade, compliant_gearbox, external, ideal, locked, passive, rigid_gearbox
from met.servos.servo import Servo

SERVOS: tuple[Servo, ...] = (
    rigid_gearbox.SERVO,
    compliant_gearbox.SERVO,
    cascade.SERVO,
    ideal.SERVO,
    external.SERVO,
    passive.SERVO,
    locked.SERVO,
)
