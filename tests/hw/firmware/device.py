"""The core as a library on a port without a board (fake_port.c): bytes in, answers and outputs out.

`MET_TEST_SANITIZE` set: with the address and undefined-behaviour sanitizers (tests/hw/firmware/test_sanitized.py).
`MET_TEST_COVERAGE`, a folder: lines that were run are counted there, for gcov.
"""

from __future__ import annotations

import ctypes
import functools
import os
import struct
from pathlib import Path
from typing import Any

from hw.bed import Capability, Limits, Scales
from hw.boards.build import Config, Shaft, build
from tests.hw.firmware import wire
from tests.hw.firmware.wire import Hello, Sample, frame, payloads, told

HERE = Path(__file__).parent
SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g")

SHAFT = Shaft(
    kt=0.061, resistance=2.05, tau_max=0.144, kt_load=0.072, inertia=6.38e-5, f_c=0.0205, f_v=2.58e-5, f_cut=50.0
)
"""The paper's table 1."""

PLAIN = Config(
    name="a bed for tests",
    tick_hz=1000.0,
    deadman=0.015,
    scales=Scales(0.01, 0.002, 0.1, 0.001, 0.005, 0.25),
    limits=Limits(
        voltage=20.0, current=3.0, rate=350.0, arming_rate=2.0, voltage_slew=4000.0, current_slew=1500.0, heat=1.0
    ),
    continuous_current=1.5,
    drive_current=4.0,
)
"""Counts: 2000 V, 1500 A, 3500 rad/s (arming 20), slews 400 and 750 a tick, 15 ticks of deadman."""

LOCK_STEP = Capability.LOCK_STEP | Capability.SIMULATED
SENSORS = Capability.ENCODER | Capability.DRIVE_CURRENT | Capability.ACCELEROMETER


class Sensors(ctypes.Structure):
    _fields_ = [(name, ctypes.c_int32) for name in ("rate", "angle", "drive_current", "load_current", "acceleration")]


class Event(ctypes.Structure):
    _fields_ = [("output", ctypes.c_int32), ("counts", ctypes.c_int32)]


@functools.cache
def library(config: Config) -> ctypes.CDLL:
    flags: tuple[str, ...] = ()
    if "MET_TEST_SANITIZE" in os.environ:
        flags = SANITIZERS
    if "MET_TEST_COVERAGE" in os.environ:
        flags = ("--coverage", "-O0", f"-fprofile-dir={os.environ['MET_TEST_COVERAGE']}")
    return ctypes.CDLL(str(build("library", config, sources=[HERE / "fake_port.c"], flags=flags)))


class Device:
    """One bed on the fake port; of one config there is one at a time."""

    def __init__(self, config: Config = PLAIN, *, by_watchdog: bool = False, session: int = 0xC0FFEE) -> None:
        self.lib = library(config)
        self.sensors = Sensors.in_dll(self.lib, "fake_sensors")
        self.number = 0
        self._events = (Event * 65536).in_dll(self.lib, "fake_events")
        self._count = ctypes.c_uint32.in_dll(self.lib, "fake_count")
        self.boot(by_watchdog=by_watchdog, session=session)

    def boot(self, *, by_watchdog: bool = False, session: int = 0xC0FFEE) -> None:
        ctypes.memset(ctypes.addressof(self.sensors), 0, ctypes.sizeof(self.sensors))
        self.measures_load(False)
        ctypes.c_uint32.in_dll(self.lib, "fake_session").value = session
        self._count.value = 0
        self.lib.fake_boot(int(by_watchdog))

    def measures_load(self, yes: bool) -> None:
        """Whether `sensors.load_current` is the test's, or what the port was told."""
        ctypes.c_int.in_dll(self.lib, "fake_measures_load").value = int(yes)

    def events(self) -> list[tuple[str, int]]:
        """What the port was told since the last call: i, v and counts; k, a, p (fake_port.c)."""
        found = [(chr(self._events[k].output), self._events[k].counts) for k in range(self._count.value)]
        assert len(found) < 65536
        self._count.value = 0
        return found

    def outputs(self) -> list[tuple[str, int]]:
        """The same, outputs alone."""
        return [event for event in self.events() if event[0] in "iv"]

    def tick(self, count: int = 1) -> None:
        self.lib.fake_tick(count)

    def raw(self, data: bytes, room: int = 1 << 16) -> bytes:
        """What comes back when these bytes are sent."""
        self.lib.fake_receive(data, len(data))
        return self.sent(room)

    def sent(self, room: int = 1 << 16) -> bytes:
        out = ctypes.create_string_buffer(room)
        count = self.lib.fake_send(out, room)
        return out.raw[:count]

    def ask(self, kind: int, body: bytes = b"", number: int | None = None) -> Any:
        """The one answer to a frame, of the next number unless one is given."""
        if number is None:
            self.number = (self.number + 1) & 0xFFFF
            number = self.number
        [answer] = payloads(self.raw(frame(kind, number, body)))
        found = told(answer)
        assert found.number == number
        return found

    def greet(self) -> Hello:
        found: Hello = self.ask(wire.HELLO, b"\1")
        return found

    def arm(self, session: int = 0xC0FFEE) -> Sample:
        found: Sample = self.ask(wire.ARM, struct.pack("<I", session))
        return found

    def drive(self, voltage: int, current: int, number: int | None = None) -> Sample:
        found: Sample = self.ask(wire.DRIVE, struct.pack("<iiB", voltage, current, 0), number)
        return found

    def step(self, voltage: int, current: int, ticks: int = 1) -> Sample:
        found: Sample = self.ask(wire.STEP, struct.pack("<iiB", voltage, current, ticks))
        return found

    def limit(self, which: int, value: int) -> tuple[int, ...]:
        counts: tuple[int, ...] = self.ask(wire.LIMIT, struct.pack("<Bi", which, value)).counts
        return counts

    def read(self) -> Sample:
        found: Sample = self.ask(wire.READ)
        return found

    def ready(self) -> None:
        """Greeted and armed; outputs so far forgotten."""
        self.greet()
        assert self.arm().state == wire.ARMED
        self.events()
