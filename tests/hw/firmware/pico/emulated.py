"""A Raspberry Pi Pico in its emulator, on a clock that passes when it is told to (emulator.mjs says what is around it).

The emulator is rp2040js by Uri Shaked (MIT licence, which is in it; github.com/wokwi/rp2040js): rp2040js-1.4.1.tgz
beside this file is the package as `npm pack rp2040js@1.4.1` gives it, known by its hash.
"""

from __future__ import annotations

import atexit
import functools
import hashlib
import io
import json
import os
import shutil
import subprocess
import tarfile
import tempfile
from pathlib import Path
from typing import Any

import pytest

from hw.beds.wire import WireBed
from hw.boards.build import Config, build
from hw.boards.pico import flash_of
from hw.boards.pico_bench import lock_step_wiring, wiring_c
from hw.line import BedLine

HERE = Path(__file__).parent
PACKAGE = HERE / "rp2040js-1.4.1.tgz"
SHA_512 = (
    "633af9c46ed9c1bb40e74218014d64fe84a84b20c084fb53e6a0bf436785029a"
    "0bb80604f0341b3c830fb3fd2487821eb5de0fd0ea4a93708891f36a8dcaf9ea"
)
STACK_TOP = 0x20002000
LOAD_ENABLE, DRIVE_ENABLE, BRAKE_RELEASE, PULSE, LED = (1 << pin for pin in (8, 9, 10, 11, 25))


def skip_without_tools() -> None:
    """Skip the test where a tool is missing, and say which and how it comes here."""
    packages = {"arm-none-eabi-gcc": "gcc-arm-none-eabi", "node": "nodejs"}
    missing = [name for name in packages if shutil.which(name) is None]
    if missing:
        words = " ".join(packages[name] for name in missing)
        pytest.skip(f"no {' and no '.join(missing)}; on Debian or Ubuntu: apt-get install {words}")


@functools.cache
def unpacked() -> Path:
    """The emulator's package in a folder that lasts as long as this process."""
    data = PACKAGE.read_bytes()
    assert hashlib.sha512(data).hexdigest() == SHA_512, f"{PACKAGE.name} is not what npm gave"
    folder = Path(tempfile.mkdtemp(prefix="met-rp2040js-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    with tarfile.open(fileobj=io.BytesIO(data)) as archive:
        if hasattr(tarfile, "data_filter"):  # Python 3.11.2 has no filters
            archive.extraction_filter = tarfile.data_filter
        archive.extractall(folder)
    return folder / "package"


class Emulator:
    """A Pico of this flash, switched on. motor: its pins are wired to a bench that turns, else to nothing."""

    def __init__(self, flash: bytes, **bench: Any) -> None:
        command = ["node", str(HERE / "emulator.mjs"), str(unpacked())]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.flash, self.out = flash, b""
        self.told: dict[str, Any] = {}
        self.ask("boot", flash=flash.hex(), by_watchdog=False, stack=STACK_TOP, bench=bench)

    def ask(self, do: str, **words: Any) -> dict[str, Any]:
        """An answer of emulator.mjs."""
        process = self._process
        assert process.stdin is not None and process.stdout is not None
        process.stdin.write(json.dumps({"do": do, **words}) + "\n")
        process.stdin.flush()
        answer = process.stdout.readline()
        assert answer, f"the emulator has ended: {process.wait()}"
        self.told = json.loads(answer)
        self.out += bytes.fromhex(self.told["out"])
        return self.told

    def bench(self, **changes: Any) -> None:
        self.ask("set", bench=changes)

    def sleep(self, seconds: float) -> dict[str, Any]:
        return self.ask("sleep", us=seconds * 1e6)

    def close(self) -> None:
        self._process.kill()
        self._process.wait()
        for each in (self._process.stdin, self._process.stdout):
            assert each is not None
            each.close()

    def __enter__(self) -> Emulator:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class EmulatedLine:
    """The line to an emulated Pico; time is the emulator's."""

    def __init__(self, emulator: Emulator) -> None:
        self._emulator = emulator

    def now(self) -> float:
        return float(self._emulator.told["now"]) * 1e-6

    def send(self, frame: bytes) -> None:
        self._emulator.ask("bytes", data=frame.hex())

    def receive(self, until: float) -> bytes:
        emulator = self._emulator
        if not emulator.out and until > self.now():
            emulator.ask("run", us=(until - self.now()) * 1e6)
        found, emulator.out = emulator.out, b""
        return found

    def sleep(self, seconds: float) -> None:
        self._emulator.sleep(seconds)

    def close(self) -> None:
        pass


class PicoBed(WireBed):
    """The host's side of a bed on an emulated Pico."""

    def __init__(self, emulator: Emulator, period: float) -> None:
        super().__init__("a Pico in its emulator", period, int.from_bytes(os.urandom(2), "little"))
        self.emulator = emulator

    def open(self) -> BedLine:
        return EmulatedLine(self.emulator)


def pico_simulation(config: Config, plant_c: str) -> bytes:
    """The image with a simulated plant in place of pins, for an emulator of the chip. plant_c: as for
    hw.boards.build.build"""
    return flash_of(build("pico", config, plant_c, texts={"wiring.c": wiring_c(lock_step_wiring(config.tick_hz))}))
