"""Drivers of motor beds, one a file: in this process, simulated firmware, from a transcript, on a CAN bus, on a line.

To add one: write its file with a `PortKind` (hw/ports.py), and add that to `PORTS`.
"""

from hw.beds import can_bed, emulated, replay, serial_line, simulated
from hw.ports import PortKind

PORTS: tuple[PortKind, ...] = (
    emulated.PORT,
    simulated.FIRMWARE,
    simulated.QEMU,
    replay.PORT,
    can_bed.PORT,
    serial_line.PORT,  # the last one: it takes every name that no other takes
)
