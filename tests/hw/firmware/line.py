"""A bed at the other end of a line, asked by hand: the firmware behind a pseudo-terminal or under QEMU."""

from __future__ import annotations

import os
import select
import socket
import struct
import subprocess
import time
import tty
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from hw.bed import Capability, Limits, Scales
from hw.boards.build import Config, build, qemu
from tests.hw.firmware import wire
from tests.hw.firmware.device import HERE, SHAFT
from tests.hw.firmware.wire import frame, payloads, told

PLANT = (HERE / "plant.c").read_text(encoding="utf-8")

FREE = Config(
    name="simulated",
    tick_hz=1000.0,
    scales=Scales(40.0 / 4096, 6.0 / 4096, 800.0 / 4096, 1e-3, 1e-3, 1.0),
    limits=Limits(voltage=20.0, current=3.0, rate=350.0, arming_rate=2.0, voltage_slew=4e4, current_slew=6e3, heat=4.0),
    continuous_current=1.5,
    shaft=SHAFT,
    capabilities=Capability.ENCODER,
)
STEPPED = replace(FREE, capabilities=Capability.ENCODER | Capability.LOCK_STEP)


class Line:
    """One end of a line to a bed."""

    def __init__(self, handle: int) -> None:
        self.handle = handle
        self.number = 0

    def ask(self, kind: int, body: bytes = b"", *, wait: float = 5.0) -> Any:
        """The answer to a frame of the next number. TimeoutError where there is none."""
        self.number = (self.number + 1) & 0xFFFF
        os.write(self.handle, frame(kind, self.number, body))
        came, end = b"", time.monotonic() + wait
        while not came.endswith(b"\0"):
            if not select.select([self.handle], [], [], max(0.0, end - time.monotonic()))[0]:
                raise TimeoutError(came.hex())
            came += os.read(self.handle, 4096)
        [payload] = payloads(came)
        found = told(payload)
        assert found.number == self.number
        return found

    def greet(self) -> wire.Hello:
        found: wire.Hello = self.ask(wire.HELLO, b"\1")
        return found

    def arm(self) -> wire.Sample:
        found: wire.Sample = self.ask(wire.ARM, struct.pack("<I", self.greet().session))
        return found

    def step(self, voltage: int, current: int, ticks: int = 1) -> wire.Sample:
        found: wire.Sample = self.ask(wire.STEP, struct.pack("<iiB", voltage, current, ticks))
        return found

    def drive(self, voltage: int, current: int) -> wire.Sample:
        found: wire.Sample = self.ask(wire.DRIVE, struct.pack("<iiB", voltage, current, 0))
        return found

    def preset(self, which: int, value: float) -> wire.Sample:
        found: wire.Sample = self.ask(wire.PRESET, struct.pack("<Bd", which, value))
        return found


@contextmanager
def ended(process: subprocess.Popen[str]) -> Iterator[subprocess.Popen[str]]:
    """A process that does not outlive the test."""
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        for each in (process.stdin, process.stdout, process.stderr):
            if each is not None:
                each.close()


@contextmanager
def behind_a_terminal(
    config: Config, *words: str, plant: str = PLANT, flags: Sequence[str] = ()
) -> Iterator[tuple[Line, subprocess.Popen[str]]]:
    """bed-host and a line to it."""
    command = [str(build("host", config, plant, flags=flags)), *words]
    pipe = subprocess.PIPE
    with ended(subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)) as process:
        assert process.stdout is not None
        handle = os.open(process.stdout.readline().strip(), os.O_RDWR | os.O_NOCTTY)
        try:
            tty.setraw(handle)
            yield Line(handle), process
        finally:
            os.close(handle)


@contextmanager
def under_qemu(config: Config, folder: Path, *, plant: str = PLANT) -> Iterator[Line]:
    """The firmware on an emulated LM3S6965 and a line to it."""
    path = folder / "line"
    command = qemu(build("arm", config, plant), path)
    with ended(subprocess.Popen(command, text=True, stderr=subprocess.DEVNULL)) as process:
        end = time.monotonic() + 20.0
        with socket.socket(socket.AF_UNIX) as line:
            while True:
                try:
                    line.connect(str(path))
                    break
                except OSError:
                    assert process.poll() is None and time.monotonic() < end
                    time.sleep(0.01)
            found = Line(line.fileno())
            while True:  # bytes that come while it starts are lost
                try:
                    found.ask(wire.READ, wait=0.5)
                    break
                except TimeoutError:
                    assert time.monotonic() < end
            found.number = 0
            yield found
