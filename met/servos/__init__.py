"""Servo models, one a file. To add one: write its file, add it to `SERVOS`."""

from met.servos import rigid_gearbox
from met.servos.servo import Servo

SERVOS: tuple[Servo, ...] = (rigid_gearbox.SERVO,)
