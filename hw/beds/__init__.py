"""Drivers of motor beds, one a file: in this process, simulated firmware, from a transcript, over a serial line.

To add one: write its file with a `PortKind` (hw/ports.py), and add that to `PORTS`.
"""

from hw.beds import emulated, replay, serial_line, simulated
from hw.ports import PortKind

PORTS: tuple[PortKind, ...] = (
    emulated.PORT,
    simulated.FIRMWARE,
    simulated.QEMU,
    replay.PORT,
    serial_line.PORT,  # the last one: it takes every name that no other takes
)
