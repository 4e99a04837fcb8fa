"""Beds that are here pass what every bed must."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator

import pytest

import met_conformance as conformance
from hw.bed import BedDriver
from hw.beds import emulated
from hw.beds.emulated import EmulatedBed
from hw.beds.serial_line import SerialBed
from tests.hw.conftest import LineBed
from tests.hw.device import Device, Shaft
from tests.hw.relay import VirtualLine

VALUES = {"i_max": 3.0, "converter_voltage": 40 / 4096, "converter_current": 6 / 4096, "converter_in": 800 / 4096}


class TestEmulated(conformance.LockStep, conformance.Simulated):
    @pytest.fixture
    def bed(self) -> Iterator[BedDriver]:
        scales, limits = emulated.scales(VALUES), emulated.limits(VALUES, 1e-3, voltage=20.0, rate=380.0)
        with EmulatedBed(Shaft(), scales, limits) as bed:
            yield bed

    def outputs(self, bed: BedDriver) -> tuple[float, float]:
        assert isinstance(bed, EmulatedBed)
        return bed.voltage, bed.current


class OfDevice(conformance.Conformance):
    device: Device

    def outputs(self, bed: BedDriver) -> tuple[float, float]:
        return self.device.voltage, self.device.current


class TestLockStepOnALine(conformance.LockStep, conformance.Simulated, OfDevice):
    @pytest.fixture
    def bed(self) -> Iterator[BedDriver]:
        self.device = Device(capabilities=0b111)
        with LineBed(lambda: VirtualLine(self.device, None)) as bed:
            yield bed


class TestFreeRunningOnALine(conformance.FreeRunning, conformance.Simulated, OfDevice):
    @pytest.fixture
    def bed(self) -> Iterator[BedDriver]:
        self.device = Device(lock_step=False, capabilities=0, deadman=0.010)
        self.line = VirtualLine(self.device, None)
        with LineBed(lambda: self.line) as bed:
            yield bed

    def wait(self, bed: BedDriver, seconds: float) -> None:
        self.line.sleep(seconds)


class TestLockStepOnAPty(conformance.LockStep, conformance.Simulated, OfDevice):
    @pytest.fixture
    def bed(self, on_pty: Callable[..., str]) -> Iterator[BedDriver]:
        self.device = Device()
        with SerialBed(on_pty(self.device), period=self.period) as bed:
            bed.patience = 1.0
            yield bed


@pytest.mark.usefixtures("precedence")
@pytest.mark.slow
class TestFreeRunningOnAPty(conformance.FreeRunning, conformance.Simulated, OfDevice):
    period = 2e-3

    def test_its_ticks_are_those_of_its_rate(self, bed: BedDriver) -> None:
        """Or fewer: its clock stands still while this machine is busy."""
        about = self.connected(bed)
        began = bed.read().tick
        self.wait(bed, 0.5)
        assert 0 < bed.read().tick - began < 0.6 * about.tick_hz

    @pytest.fixture
    def bed(self, on_pty: Callable[..., str]) -> Iterator[BedDriver]:
        self.device = Device(lock_step=False)
        with SerialBed(on_pty(self.device), period=self.period) as bed:
            yield bed


def test_the_old_name_of_these_tests_works_with_a_warning() -> None:
    with pytest.warns(DeprecationWarning, match="`hw.conformance` is now `met_conformance`"):
        old = importlib.import_module("hw.conformance")
    assert all(getattr(old, name) is getattr(conformance, name) for name in old.__all__)
