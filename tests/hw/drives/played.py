"""Benches of two played drives, and their files, for the tests of this folder."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import met_conformance as conformance
from hw.bed import About, BedDriver, BedSample, BedState
from hw.beds.can_bed import CanBed
from hw.drives import DIALECTS
from hw.drives.bench_file import TwoDrives, two_drives
from hw.drives.drive import CanLine
from hw.drives.odrive_lines import OdriveLines
from met.substitution.bed import DriveCommand
from tests.hw.drives.simulated_lines import PlayedLine, PlayedOdriveLines, Spoil, unspoiled
from tests.hw.players import PLAYED
from tests.hw.players.odrive import endpoints
from tests.hw.players.player import PlayedBench
from tests.hw.players.shaft import InertiaShaft

KT, RESISTANCE, INERTIA = 0.06, 1.5, 1.3e-4

TEXT = """\
name = "paper"

[bus]
interface = "{interface}"
channel   = "{channel}"
{bus}
[shaft]
inertia  = "1.3e-4 kg*m^2"
rate_max = "380 rad/s"

[supply]
voltage_max = "40 V"

[drive]
dialect     = "{dialect}"
node        = 1
kt          = "0.06 N*m/A"
resistance  = "1.5 ohm"
voltage_max = "20 V"
torque_max  = "0.4 N*m"
{more}
[load]
dialect       = "{dialect}"
node          = 2
reversed      = true
kt            = "0.06 N*m/A"
current_max   = "3 A"
current_rated = "2 A"
heat          = "9 A^2*s"
{more}"""

BUS = {"moteus": "fd = true\n"}
MORE = {"odrive": 'endpoints = "flat_endpoints.json"\n', "robstride": 'model = "RS05"\n'}


def bench_file(folder: Path, dialect: str = "odrive", interface: str = "virtual", channel: str = "bench") -> Path:
    """A bench file of two drives of a dialect, with what it names beside it."""
    (folder / "flat_endpoints.json").write_text(json.dumps(endpoints()))
    path = folder / "bench.toml"
    if dialect == "odrive_ascii":
        path.write_text(
            on_serial_lines(TEXT.format(dialect=dialect, interface="", channel="", bus="", more=""), folder)
        )
        return path
    bus = "" if interface == "fdcanusb" else BUS.get(dialect, "")
    path.write_text(
        TEXT.format(dialect=dialect, interface=interface, channel=channel, bus=bus, more=MORE.get(dialect, ""))
    )
    return path


def on_serial_lines(text: str, folder: Path) -> str:
    """The text of a bench file, its drives being each on a serial line, in a folder."""
    text = re.sub(r"(?m)^interface = .*\nchannel .*$", 'interface = "serial"', text)
    ports = iter(f'port = "{folder / name}"' for name in ("ttyDrive", "ttyLoad"))
    return re.sub(r"(?m)^node +=.*$", lambda found: next(ports), text)


def line_of(dialect: str, played: PlayedBench, spoil: Spoil = unspoiled) -> PlayedLine:
    """The host's end of a played bench's bus, or of its two serial lines."""
    return (PlayedOdriveLines if dialect == "odrive_ascii" else PlayedLine)(played, spoil)


def host_line(bench: TwoDrives, line: PlayedLine) -> CanLine:
    """What the host's side of a bench speaks to, at its end of a played line."""
    ports = bench.bus.get("ports")
    return OdriveLines(line, tuple(ports)) if ports else line


PERIODS = {"odrive_ascii": 2e-3}
"""Times from one exchange to the next, s, of dialects for which 1 ms is too short."""


def period_of(dialect: str) -> float:
    """Time from one exchange to the next, at the highest rate of a dialect, s."""
    return PERIODS.get(dialect, 1e-3)


def played_bench(dialect: str = "odrive") -> PlayedBench:
    """Two played drives of a dialect on a shaft, the load's counting the other way round."""
    shaft = InertiaShaft(inertia=INERTIA, kt=KT, resistance=RESISTANCE, f_c=1e-3, f_v=1e-4)
    make = PLAYED[dialect]
    return PlayedBench(shaft, make(1, 1), make(2, -1))


def host_on(
    bench: TwoDrives, open_line: Callable[[], CanLine], period: float | None = None, drive: DriveCommand = "voltage"
) -> CanBed:
    """The host's side of a bench, on lines that `open_line` gives. period: s; None: that of its highest rate"""
    one, other = (DIALECTS[entry.dialect](entry) for entry in (bench.drive, bench.load))
    if period is None:
        period = period_of(bench.drive.dialect)
    return CanBed(bench, (one, other), open_line, period=period, drive=drive)


def host_of(bench: TwoDrives, line: PlayedLine, period: float | None = None, drive: DriveCommand = "voltage") -> CanBed:
    """The host's side of a bench, on a line, or on two."""
    return host_on(bench, lambda: host_line(bench, line), period, drive)


def go(bed: CanBed, line: PlayedLine, seconds: float, voltage: float) -> None:
    """Command a voltage each millisecond, as long as the bed is armed."""
    for _ in range(round(seconds * 1e3)):
        line.sleep(1e-3)
        sample = bed.exchange(voltage, 0.0)
        if sample is not None and sample.state != BedState.ARMED:
            return


class PlayedConformance(conformance.FreeRunning):
    """What every bed must pass, of two played drives of a dialect, in the time of a simulated bus."""

    dialect = "odrive"
    drive_told: DriveCommand = "voltage"

    def opened(self, folder: Path) -> BedDriver:
        self.played = played_bench(self.dialect)
        self.line = line_of(self.dialect, self.played)
        return host_of(two_drives(bench_file(folder, self.dialect)), self.line, drive=self.drive_told)

    def rate_told(self) -> float:
        """The rate that the drive under test follows, rad/s of the shaft."""
        raise NotImplementedError

    def weaken(self) -> None:
        """Leave a drive that is told rates next to no torque, so that its load turns the shaft."""
        raise NotImplementedError

    def sped(self, bed: BedDriver, about: About) -> BedSample:
        if self.drive_told != "rate":
            return super().sped(bed, about)
        self.weaken()  # else it holds its shaft at what it is told, which is no more than the limit
        return self.drive(bed, 1.0, current=about.limits.current)

    def wait(self, bed: BedDriver, seconds: float) -> None:
        self.line.sleep(seconds)

    def outputs(self, bed: BedDriver) -> tuple[float, float]:
        """Voltage, or rate of a drive that is told rates, and current for which the drives' torques are, to the nearest
        count."""
        assert isinstance(bed, CanBed)
        drive, load = (each.output for each in self.played.drives)
        if self.played.off or bed._about is None:
            return 0.0, 0.0
        scales = bed._about.scales
        volts = RESISTANCE * drive.value / KT
        if self.drive_told == "rate":
            volts = self.rate_told()
        return round(volts / scales.voltage) * scales.voltage, round(load.value / KT / scales.current) * scales.current


class HalfStepConformance(PlayedConformance):
    """The same, of a dialect whose torque is a whole number of steps of which none is 0. torque_step: N m"""

    torque_step = 0.0

    def test_a_command_takes_hold_as_whole_counts(self, bed: BedDriver) -> None:
        """Within half a step, and never by more than was asked for: 0 is between two steps."""
        assert isinstance(bed, CanBed)
        about = self.driven(bed)
        for share in (0.1, -0.1, 0.07, 0.0):
            current = share * about.limits.current
            self.drive(bed, self.period, 0.0, current)
            held, step = self.played.load.output.value, self.torque_step
            assert abs(held - KT * current) <= 1.001 * step
            assert abs(held) <= max(abs(KT * current), 0.5001 * step)
