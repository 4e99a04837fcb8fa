"""The Pico passes what every bed must: in lock-step with a simulated plant, and as it is flashed, on an emulated bench.

Time is the emulator's, so none of this depends on how busy the machine is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

import met_conformance as conformance
from hw.bed import BedDriver
from hw.boards.pico import pico_image
from hw.boards.pico_bench import pico_bench
from tests.hw.firmware.line import PLANT, STEPPED
from tests.hw.firmware.pico.emulated import Emulator, PicoBed, pico_simulation, skip_without_tools

pytestmark = [pytest.mark.firmware, pytest.mark.node]


class TestLockStep(conformance.LockStep, conformance.Simulated):
    @pytest.fixture
    def bed(self) -> Iterator[BedDriver]:
        skip_without_tools()
        with Emulator(pico_simulation(STEPPED, PLANT)) as emulator:
            emulator.sleep(0.12)
            with PicoBed(emulator, self.period) as bed:
                bed.patience = 0.5
                yield bed


class TestAsItIsFlashed(conformance.FreeRunning):
    """Without a key, which nobody here could turn again after a fault, and with motors that never become hot."""

    period = 2e-3

    @pytest.fixture
    def bed(self) -> Iterator[BedDriver]:
        skip_without_tools()
        bench = pico_bench()
        lock = bench.config.interlock
        assert lock is not None
        lock = replace(lock, key=False, drive_continuous=10.0)
        with Emulator(pico_image(replace(bench, config=replace(bench.config, interlock=lock))), motor=True) as emulator:
            emulator.sleep(0.15)
            with PicoBed(emulator, self.period) as bed:
                yield bed

    def wait(self, bed: BedDriver, seconds: float) -> None:
        assert isinstance(bed, PicoBed)
        bed.emulator.sleep(seconds)

    def outputs(self, bed: BedDriver) -> tuple[float, float]:
        assert isinstance(bed, PicoBed)
        up, down, load_up, load_down = bed.emulator.ask("sleep", us=0)["level"]
        scales = pico_bench().config.scales
        return (up - down) * scales.voltage, (load_up - load_down) * scales.current
