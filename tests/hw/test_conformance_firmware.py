"""The firmware passes what every bed must: behind a pseudo-terminal, and on an emulated controller."""

from __future__ import annotations

import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import met_conformance as conformance
from hw.bed import BedDriver
from hw.beds.serial_line import SerialBed
from hw.boards.build import Config, build, qemu
from tests.hw.firmware.line import FREE, PLANT, STEPPED

pytestmark = pytest.mark.alone


class BehindATerminal(conformance.Conformance):
    config: Config

    @pytest.fixture
    def bed(self, tmp_path: Path) -> Iterator[BedDriver]:
        self.log = tmp_path / "log"
        command = [str(build("host", self.config, PLANT)), "--log", str(self.log)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            try:
                with SerialBed(process.stdout.readline().strip(), period=self.period) as bed:
                    bed.patience = 0.5
                    yield bed
            finally:
                process.kill()

    def outputs(self, bed: BedDriver) -> tuple[float, float]:
        """As the amplifiers were told last."""
        scales = self.config.scales
        held = {"v": 0, "i": 0}
        for line in self.log.read_text(encoding="utf-8").splitlines():
            _, _, output, counts = line.split()
            held[output] = int(counts)
        return held["v"] * scales.voltage, held["i"] * scales.current


class TestLockStep(conformance.LockStep, conformance.Simulated, BehindATerminal):
    config = STEPPED


@pytest.mark.usefixtures("precedence")
class TestFreeRunning(conformance.FreeRunning, conformance.Simulated, BehindATerminal):
    config, period = FREE, 2e-3


def listens(path: Path) -> bool:
    """Whether someone accepts at this socket: a while after it is there."""
    sockets = [line.split() for line in Path("/proc/net/unix").read_text(encoding="utf-8").splitlines()]
    return any(each[-1] == str(path) and each[3] == "00010000" for each in sockets)


@pytest.mark.firmware
class TestUnderQemu(conformance.LockStep, conformance.Simulated):
    @pytest.fixture
    def bed(self, tmp_path: Path) -> Iterator[BedDriver]:
        missing = [name for name in ("arm-none-eabi-gcc", "qemu-system-arm") if shutil.which(name) is None]
        if missing:
            pytest.skip(
                f"no {' and no '.join(missing)}; on Debian or Ubuntu: apt-get install gcc-arm-none-eabi qemu-system-arm"
            )
        path = tmp_path / "line"
        with subprocess.Popen(qemu(build("arm", STEPPED, PLANT), path)) as process:
            try:
                while not listens(path):
                    assert process.poll() is None
                    time.sleep(0.01)
                with SerialBed(f"unix://{path}", period=self.period) as bed:
                    bed.patience = 2.0
                    yield bed
            finally:
                process.kill()
