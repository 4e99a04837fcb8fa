"""Sensor models, one a file. To add one: write its file, add it to `SENSORS`."""

from met.sensors import accelerometer, encoder, gyroscope, low_pass, tachometer
from met.sensors.sensor import Sensor

SENSORS: tuple[Sensor, ...] = (
    tachometer.SENSOR,
    encoder.SENSOR,
    low_pass.SENSOR,
    accelerometer.SENSOR,
    gyroscope.SENSOR,
)
