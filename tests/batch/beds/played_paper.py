"""The paper's test with bought drives: figures 7 and 8 with each dialect played, the shoulder's motor between two.

    python -m tests.batch.beds.played_paper      the table of docs/drives.md

The drives' sides of tests/hw/players turn the shaft of the deck's own bed model, told torques: its friction and
inertia, and no faults but the dialect's steps, latency and bus. Host, bus and drives are in one process, in a simulated
time, so that figures are the same each time.
"""

from __future__ import annotations

import functools
import json
import tempfile
from pathlib import Path

import numpy as np

import ic
from hw.bed import BedDriver, BedSample
from hw.beds import emulated
from hw.beds.can_bed import CanBed
from hw.beds.can_deck import BelievedLoop
from hw.beds.emulated import EmulatedBed
from hw.drives import DIALECTS
from hw.drives.bench_file import two_drives
from hw.driving import loop
from hw.driving.case import pace_of
from hw.driving.driven import LANES, CaseKernel
from hw.recording.records import ANSWERED, LAYOUT
from met import models
from met import run as engine
from met.plan import Experiment
from met.plant import Plant, bed_values
from tests.hw.drives.played import BUS, MORE, host_line, line_of, on_serial_lines
from tests.hw.drives.simulated_lines import PlayedLine
from tests.hw.players import PLAYED
from tests.hw.players.cia402 import PlayedCia402
from tests.hw.players.odrive import PlayedOdrive, endpoints
from tests.hw.players.player import PlayedBench
from tests.hw.players.shaft import Output

SLOW = 0.03
KT, KT_LOAD, RESISTANCE, INERTIA = 0.061, 0.072, 2.05, 6.38e-5
GAIN, INTEGRAL = 2.4e-3, 3.7e-3
"""Of the rate loop of a drive that is told rates, N m s/rad and N m/rad: its poles are those of the paper's servo."""
PERIOD = 5e-4
"""Of a tick of the played shaft, s."""

DECK = """\
#include <two_link.ic>
run plain like nominal { remove settle;  remove volts;  record = [q, qd]; }
run volts like plain {
    substitute shoulder { bed = emulated();  law = velocity_tracking; }
}
run torques like plain {
    substitute shoulder { bed = torque_drive();  law = velocity_tracking; }
}
run fast like plain { rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 25 Hz; } }
run fast_volts like fast {
    substitute shoulder { bed = emulated(delay = 1);  law = velocity_tracking; }
}
run fast_torques like fast {
    substitute shoulder { bed = torque_drive(delay = 1);  law = velocity_tracking; }
}
run scaled_volts like volts        { shoulder { bed { kt_load = 0.288 N*m/A; }  scale { torque = 0.25;  rate = 4; } } }
run scaled_torques like torques    { shoulder { bed { kt_load = 0.288 N*m/A; }  scale { torque = 0.25;  rate = 4; } } }
run fast_scaled_volts like fast_volts     {
    shoulder { bed { kt_load = 0.288 N*m/A; }  scale { torque = 0.25;  rate = 4; } }
}
run fast_scaled_torques like fast_torques {
    shoulder { bed { kt_load = 0.288 N*m/A; }  scale { torque = 0.25;  rate = 4; } }
}
servo looped like gearbox {                    // over a current loop: no back-EMF to speak of, and no limit of voltage
    resistance = 2050 ohm;  v_max = 1e6 V;
    kp = GAIN/0.061*2050 V*s/rad;  ki = INTEGRAL/0.061*2050 V/rad;
}
run looping like plain {
    servos { shoulder = looped; }
    rates  { base = 4 kHz;  dynamics = 4 kHz;  servos = 4 kHz;  record = 25 Hz; }
}
run rates like plain {
    servos { shoulder = looped; }
    substitute shoulder { bed = rate_drive();  law = velocity_tracking; }
}
run fast_rates like fast {
    servos { shoulder = looped; }
    substitute shoulder { bed = rate_drive(delay = 1);  law = velocity_tracking; }
}
"""

SCALED = {"robstride": 4.0}
"""By how much a dialect's motor is slower and stronger than the shoulder's, where its drives end at
50 rad/s: the deck's bed has that scale."""

FAST, SLOWER = 1000, {"odrive_ascii": 500}
"""Rate of the fast runs, Hz, and of those of dialects that are slower than that."""

BENCH = """\
name = "paper"

[bus]
interface = "virtual"
channel   = "paper"
{bus}
[shaft]
inertia  = "{inertia} kg*m^2"
rate_max = "200 rad/s"
filter   = "50 Hz"

[supply]
voltage_max = "40 V"

[drive]
dialect     = "{dialect}"
node        = 1
kt          = "{kt} N*m/A"
resistance  = "2.05 ohm"
voltage_max = "20 V"
torque_max  = "{torque_max} N*m"
{more}
[load]
dialect       = "{dialect}"
node          = 2
reversed      = true
kt            = "{kt_load} N*m/A"
current_max   = "3 A"
current_rated = "2 A"
heat          = "9 A^2*s"
{more}"""


class PlantShaft:
    """The shaft of a deck's bed model `torque_drive`, turned by two played drives.

    load  the share of its torque that the load gives;  times: by which motors are stronger and slower
    """

    def __init__(self, experiment: Experiment, joint: str, load: float = 1.0, times: float = 1.0) -> None:
        self.period, self.angle, self.rate, self._share = PERIOD, 0.0, 0.0, load
        self._kt, self._kt_load = times * KT, times * KT_LOAD
        self._plant = Plant(experiment, joint, period=PERIOD)
        self._plant.start(0.0)

    def step(self, drive: Output, load: Output) -> None:
        self._plant.tick(self._torque(drive, self._kt), self._share * self._torque(load, self._kt_load) / self._kt_load)
        self.angle, self.rate = self._plant.shaft_angle, self._plant.shaft_rate

    def _torque(self, output: Output, kt: float) -> float:
        """N m; of shorted windings, what they brake with at the rate of the tick before."""
        return -kt * kt / RESISTANCE * self.rate if output.kind == "short" else output.value


BELIEVED = BelievedLoop(GAIN, INTEGRAL, KT * KT / 2050.0)


class OnTime(CanBed):
    """A bench on a played line, whose exchanges are a period apart in the line's time."""

    line: PlayedLine

    def arm(self) -> BedSample:
        sample = super().arm()
        self._due = self.line.now()
        return sample

    def exchange(self, voltage: float, current: float) -> BedSample | None:
        self._due += self.period
        self.line.sleep(max(0.0, self._due - self.line.now()))
        return super().exchange(voltage, current)


@functools.cache
def compiled(name: str, gains: tuple[float, float] = (1.0, 1.0), hz: int = FAST) -> Experiment:
    """A run of the deck. gains: of its rate loop, over `GAIN` and `INTEGRAL`;  hz: of the fast runs, Hz"""
    text = DECK.replace("GAIN", f"{gains[0] * GAIN!r}").replace("INTEGRAL", f"{gains[1] * INTEGRAL!r}")
    return ic.compile(text=text.replace("1 kHz", f"{hz} Hz"), select=[name]).experiments[0]


def bench(dialect: str, name: str, folder: Path, gains: tuple[float, float] = (1.0, 1.0)) -> OnTime:
    """Two played drives of a dialect, for a run of the deck; all kinds of run have the same shaft. gains: of the rate
    loop of drives that are told rates, over those that the deck takes for theirs"""
    (folder / "flat_endpoints.json").write_text(json.dumps(endpoints()))
    path = folder / "bench.toml"
    times = SCALED.get(dialect, 1.0)
    figures = {"kt": times * KT, "kt_load": times * KT_LOAD, "inertia": times**2 * INERTIA, "torque_max": times * 0.144}
    text = BENCH.format(dialect=dialect, bus=BUS.get(dialect, ""), more=MORE.get(dialect, ""), **figures)
    path.write_text(on_serial_lines(text, folder) if dialect in SLOWER else text)
    described, experiment = two_drives(path), compiled(name, hz=SLOWER.get(dialect, FAST))
    shaft = PlantShaft(compiled("scaled_torques" if dialect in SCALED else "torques"), "shoulder", times=times)
    drives = PLAYED[dialect](1, 1), PLAYED[dialect](2, -1)
    for drive, kt in zip(drives, (KT, KT_LOAD), strict=True):
        if isinstance(drive, PlayedOdrive):
            drive.values["axis0.config.motor.torque_constant"] = kt
            drive.values["axis0.controller.config.vel_gain"] = 2.0 * np.pi * GAIN * gains[0]
            drive.values["axis0.controller.config.vel_integrator_gain"] = 2.0 * np.pi * INTEGRAL * gains[1]
        if isinstance(drive, PlayedCia402):
            drive.rate_gain, drive.rate_integral = GAIN * gains[0], INTEGRAL * gains[1]
    line = line_of(dialect, PlayedBench(shaft, *drives))
    own = DIALECTS[dialect]
    sides = own(described.drive), own(described.load)
    use = experiment.structure.substitutions[0]
    kind = models.find("bed", use.bed, use.place).drive
    period = pace_of(experiment).period
    bed = OnTime(described, sides, lambda: host_line(described, line), period=period, drive=kind, believed=BELIEVED)
    bed.line = line
    return bed


def serial(name: str, hz: int = FAST) -> EmulatedBed:
    """The bed whose bits a serial line has (tests/batch/beds/test_paper.py), told voltages."""
    experiment = compiled(name, hz=hz)
    period, values = pace_of(experiment).period, bed_values(experiment, "shoulder")
    plant = Plant(experiment, "shoulder", period=period)
    return EmulatedBed(plant, emulated.scales(values), emulated.limits(values, period))


def driven(bed: BedDriver, name: str, hz: int = FAST) -> np.ndarray:
    """Rates of both joints in a run of the deck on a bed, rad/s: [time, joint]."""
    experiment = compiled(name, hz=hz)
    pace = pace_of(experiment)
    prepared = engine.prepare(experiment, wire=True, late=pace.late(False), lanes=LANES)
    kernel = CaseKernel(prepared, 0, pace.repeats)
    records: list[bytes] = []
    with bed:
        bed.connect()
        bed.patience = pace.patience(False)
        # the bench waits in its line's time, so the loop itself waits for no clock
        ended = loop.drive([bed], kernel, pace, kernel.exchanges, records.append, lock_step=True)
    assert not ended.why, ended
    rows = np.frombuffer(b"".join(records), LAYOUT)
    rates, told = [], 0.0
    for row in rows:
        told = float(row["rate"]) if row["flags"] & ANSWERED else told
        rates.append([told])
    history, outputs, _ = kernel.again(rates[:: pace.repeats])
    run = engine.results(prepared, np.array([0]), history[None], outputs[None])
    assert not run.status.any(), run.cause
    found: np.ndarray = run.signals["qd"][0]
    return found


@functools.cache
def alone(name: str, gains: tuple[float, float] = (1.0, 1.0), hz: int = FAST) -> np.ndarray:
    """Rates of both joints in a run without a bed, rad/s: [time, joint]."""
    run = engine.run(compiled(name, gains, hz))
    assert not run.status.any(), run.cause
    found: np.ndarray = run.signals["qd"][0]
    return found


@functools.cache
def on_serial(name: str, hz: int = FAST) -> np.ndarray:
    """Rates of both joints in a run of the deck on the serial bed, rad/s: [time, joint]."""
    return driven(serial(name, hz), name, hz)


def apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Rates apart, rms over the run, as a share of the rate that is asked: [joint]."""
    found: np.ndarray = np.sqrt(((one - other) ** 2).mean(axis=0)) / SLOW
    return found


def errors(dialect: str, name: str) -> tuple[np.ndarray, np.ndarray]:
    """How far a run with a played dialect is from the run in software, and from the serial bed's: [joint] each."""
    fast, hz = "fast_" if name.startswith("fast") else "", SLOWER.get(dialect, FAST)
    with tempfile.TemporaryDirectory() as folder:
        own = name.replace(fast, f"{fast}scaled_", 1) if dialect in SCALED else name
        found = driven(bench(dialect, own, Path(folder)), own, hz)
    line = on_serial(f"{fast}volts", hz)
    return apart(found, alone("fast" if fast else "plain", hz=hz)), apart(found, line)


def loop_errors(dialect: str, name: str, gains: tuple[float, float] = (1.0, 1.0)) -> np.ndarray:
    """How far a run with a played drive that is told rates is from the run in software of its own loop: [joint]. gains:
    of that, over those that the deck takes for its"""
    with tempfile.TemporaryDirectory() as folder:
        run = driven(bench(dialect, name, Path(folder), gains), name, SLOWER.get(dialect, FAST))
        return apart(run, alone("looping", gains))


def main() -> None:
    for dialect in (name for name, each in DIALECTS.items() if each.takes_rates):
        for name in ("rates", "fast_rates"):
            for gains in ((1.0, 1.0), (1.2, 1.0), (1.0, 1.3)):
                off = loop_errors(dialect, name, gains)
                words = " ".join(f"{each:.3%}" for each in off)
                print(f"{name} {dialect}, gains {gains} of the deck's: off the run in software {words}", flush=True)
    for fast in ("", "fast_"):
        line = on_serial(f"{fast}volts")
        off = apart(line, alone("fast" if fast else "plain"))
        print(f"{fast}serial: off the run in software", *(f"{each:.3%}" for each in off), flush=True)
        for dialect in DIALECTS:
            for kind in ("volts", "torques"):
                off, beside = errors(dialect, fast + kind)
                words = [" ".join(f"{each:.3%}" for each in both) for both in (off, beside)]
                print(
                    f"{fast}{kind} {dialect}: off the run in software {words[0]}, the serial bed {words[1]}", flush=True
                )


if __name__ == "__main__":
    main()
