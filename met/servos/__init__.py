"""Servo models, one a file. To add one: write its file, add it to `SERVOS`."""

from met.servos import ideal, locked, passive, rigid_gearbox
from met.servos.servo import Servo

SERVOS: tuple[Servo, ...] = (rigid_gearbox.SERVO, ideal.SERVO, passive.SERVO, locked.SERVO)
