"""`met bed probe`: the bed at a port, its sensors, and the rates for which the line is fast enough. It never arms."""

from __future__ import annotations

import json
import math
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from batch.beds.chosen_bed import ChosenBed, chosen_bed
from hw import refusals
from hw.bed import About, BedDriver, BedSample, Capability, Fault
from hw.beds import latch
from hw.beds.serial_line import LONGEST_SHARE, exchanged
from hw.drivers import kind_of, opened
from hw.driving.case import pace_of
from hw.ports import Port
from ic.printing.columns import columns, number, quantity
from met.diagnostic import Diagnostic, Problem, error
from met.frozen import frozen
from met.messages.visible import say
from met.substitution.bed import DRIVES

ASKED = 32
"""Number of times that the sensors are read, to measure the duration of an answer."""

WORST = 0.01
"""Share of questions without an answer above which no rate is fast enough; `met bed run` warns of more."""

RATES = (500.0, 1000.0, 2000.0, 4000.0)
"""Rates in Hz for which the probe says whether the line is fast enough."""

_SENSORS = (("rate", "rad/s"), ("angle", "rad"), ("drive_current", "A"), ("acceleration", "rad/s^2"))


@frozen
class ProbeResult:
    """The bed at a port, and its line.

    trips   s from question to answer, for each of the `ASKED` questions that had one; empty where there is no line
    lost    how many of those questions had no answer
    needed  s that the bytes of an exchange take; 0 where the line has no baud rate
    remarks  what the driver says of the bed besides, a word and a line each; its line, too, where it says that
    """

    port: str
    about: About
    sample: BedSample
    warnings: tuple[Diagnostic, ...]
    baud: int
    needed: float
    trips: tuple[float, ...]
    remarks: tuple[tuple[str, str], ...] = ()
    lost: int = 0

    @property
    def fastest(self) -> float:
        """The rate of exchanges, Hz, at which one takes the largest allowed share of a period; infinite in
        lock-step; 0 where too many questions had no answer."""
        if self.lost > WORST * ASKED:
            return 0.0
        longest = max(self.needed, statistics.median(self.trips) if self.trips else 0.0)
        stepped = Capability.LOCK_STEP in self.about.capabilities
        return math.inf if stepped or longest == 0.0 else LONGEST_SHARE / longest


def probe(chosen: ChosenBed, baud: int) -> ProbeResult:
    """Greet the bed, and read its sensors. Raises Problem."""
    simulated = chosen.simulated
    period = math.inf if simulated is None else pace_of(simulated).period
    with opened(Port(chosen.port, baud), chosen.experiment, chosen.joint, 0, period) as bed:
        about = bed.connect()
        sample = bed.read()
        trips = tuple(_trips(bed)) if bed.has_line else ()
        lost = ASKED - len(trips) if bed.has_line else 0
        needed = bed.line_time(about)
        return ProbeResult(chosen.port, about, sample, bed.warnings, baud, needed, trips, bed.remarks, lost)


def probe_and_tell(
    word: str,
    source: str | None,
    names: tuple[str, ...],
    *,
    baud: int,
    form: str,
    quiet: bool = False,
    verbose: bool = False,
    **options: Any,
) -> None:
    """Run `met bed probe`. Raises Problem."""
    result = probe(chosen_bed(word, source, names, quiet=quiet, **options), baud)
    if form == "json":
        say(json.dumps(data(result), indent=2))
    elif not quiet:
        say("\n".join(lines(result)))


def lines(result: ProbeResult) -> Iterator[str]:
    """The result of `met bed probe` for people, line by line: what the bed is, its limits, sensors and faults."""
    about, sample, limits = result.about, result.sample, result.about.limits
    unit, _ = DRIVES[about.drive]
    yield f"bed `{about.name}` at {result.port}"
    sensors = (f"{name.replace('_', ' ')} {quantity(value, unit)}" for name, value, unit in _read(sample))
    rows = [
        ["firmware", _firmware(about)],
        ["has", ", ".join(_properties(about))],
        ["ticks", f"{number(about.tick_hz)} Hz; stops itself after {number(1e3 * about.deadman)} ms without a command"],
        [
            "limits",
            f"{number(limits.voltage)} {unit}, {number(limits.voltage_slew)} {unit}/s; {number(limits.current)} A, "
            f"{number(limits.current_slew)} A/s, I2t {number(limits.heat)} A^2 s; {number(limits.rate)} rad/s, armed "
            f"below {number(limits.arming_rate)} rad/s",
        ],
        ["a count", ", ".join(quantity(value, unit) for value, unit in _scales(about))],
        ["sensors", ", ".join(sensors)],
        ["state", sample.state.name.lower()],
        *(list(row) for row in result.remarks),
        *_line(result),
    ]
    yield from columns(rows)
    for fault in Fault:
        if fault in sample.faults:
            yield f"  fault: {refusals.words(fault)}"
            yield from [f"    = help: {remedy}" for remedy in refusals.remedies(fault)]
    for what, remedy in refusals.interlocked(sample.interlock):
        yield from [f"  interlock: {what}", f"    = help: {remedy}"]
    for warning in result.warnings:
        yield f"  warning: {warning.message}"
        yield from [f"    = help: {help_}" for help_ in warning.help]


def data(result: ProbeResult) -> dict[str, Any]:
    """The result of `met bed probe` for JSON, SI: description, state, sensors and faults of the bed (a motor with a
    load on a test bench)."""
    about, sample = result.about, result.sample
    return {
        "port": result.port,
        **{name: value for name, value in asdict(about).items() if name not in ("capabilities", "scales")},
        "capabilities": [str(capability.name).lower() for capability in Capability if capability in about.capabilities],
        "scales": {name: value if math.isfinite(value) else None for name, value in asdict(about.scales).items()},
        "state": sample.state.name.lower(),
        "sensors": {name: value for name, value, _ in _read(sample)},
        "faults": [
            {"name": str(fault.name).lower(), "message": refusals.words(fault), "help": refusals.remedies(fault)}
            for fault in Fault
            if fault in sample.faults
        ],
        "interlock": [{"message": what, "help": [remedy]} for what, remedy in refusals.interlocked(sample.interlock)],
        "remarks": dict(result.remarks),
        "warnings": [
            {"code": warning.code, "message": warning.message, "help": list(warning.help)}
            for warning in result.warnings
        ],
        "line": {
            "bytes": exchanged(about.capabilities),
            "bytes_take": result.needed or None,
            "answered_in": statistics.median(result.trips) if result.trips else None,
            "answered_in_at_most": max(result.trips, default=None),
            "unanswered": result.lost,
            "fastest_hz": result.fastest if math.isfinite(result.fastest) else None,
        },
    }


def capabilities(about: About) -> list[str]:
    """The optional properties of the bed, in words."""
    words = {
        Capability.WATCHDOG: "a watchdog of its own",
        Capability.LOCK_STEP: "no time of its own",
        Capability.SIMULATED: "no motor: it is simulated",
        Capability.COASTS: "a shaft that coasts when it is stopped",
    }
    return [
        words.get(capability, str(capability.name).lower().replace("_", " "))
        for capability in Capability
        if capability in about.capabilities and capability != Capability.ARMATURE
    ]


def _firmware(about: About) -> str:
    if not about.version:
        return f"{about.firmware}, of what both drives say of themselves; they speak no protocol of MET's"
    return f"{about.firmware}, version {about.version} of the protocol, session {about.session}"


def _properties(about: About) -> list[str]:
    """Outputs and sensors in words. A bed without a protocol of MET's has drives that report their rate."""
    if not about.version:
        drive = "drive rate" if about.drive == "rate" else "drive torque"
        drive += " of an armature at a voltage" * (Capability.ARMATURE in about.capabilities)
        return [drive, "load torque by a current", "rate as the drive tells it", *capabilities(about)]
    return [f"drive {about.drive}", "load current", "tachometer", *capabilities(about)]


def _trips(bed: BedDriver) -> Iterator[float]:
    """The times of `ASKED` exchanges with the bed, s, without those that had no answer."""
    bed.patience = 0.1
    for _ in range(ASKED):
        begun = time.perf_counter()
        if bed.look() is not None:
            yield time.perf_counter() - begun


def _scales(about: About) -> list[tuple[float, str]]:
    """The smallest step of each quantity that the bed tells or takes, with its unit."""
    s, has = about.scales, about.capabilities
    result = [(s.voltage, DRIVES[about.drive][0]), (s.current, "A"), (s.rate, "rad/s")]
    others = (
        (Capability.ENCODER, s.angle, "rad"),
        (Capability.DRIVE_CURRENT, s.drive_current, "A of the drive"),
        (Capability.ACCELEROMETER, s.acceleration, "rad/s^2"),
    )
    return result + [(value, unit) for capability, value, unit in others if capability in has]


def _read(sample: BedSample) -> list[tuple[str, float, str]]:
    return [(name, getattr(sample, name), unit) for name, unit in _SENSORS if getattr(sample, name) is not None]


def _line(result: ProbeResult) -> list[Sequence[str]]:
    """Rows about the line, and about the rates for which it is fast enough."""
    if not result.trips and not result.needed and not result.lost:
        return [["line", "none: the bed is in this process"]]
    parts = []
    if result.needed and not result.remarks:
        bytes_ = exchanged(result.about.capabilities)
        parts.append(f"{result.baud} baud: {bytes_} bytes an exchange take {1e3 * result.needed:.3g} ms")
    if result.trips:
        median, longest = statistics.median(result.trips), max(result.trips)
        parts.append(
            f"answered in {1e3 * median:.3g} ms, at most {1e3 * longest:.3g} ms, {ASKED} times asked"
            + (f", {result.lost} times without an answer" if result.lost else "")
        )
    elif result.lost:
        parts.append(f"{result.lost} times asked, and never an answer")
    if not math.isfinite(result.fastest):
        return [["line", "; ".join(parts)], ["rates", "all: the bed waits for the computer"]]
    words = [f"{hz:g} Hz {'yes' if hz <= result.fastest else 'no'}" for hz in RATES]
    if not result.fastest:
        return [["line", "; ".join(parts)], ["rates", f"{', '.join(words)}: exchanges without an answer stop a bed"]]
    rates = (
        f"{', '.join(words)}; up to {result.fastest:.3g} Hz, where an exchange takes {LONGEST_SHARE:.0%} of a period"
    )
    return [["line", "; ".join(parts)], ["rates", rates]]


def clear_and_tell(word: str, *, baud: int, form: str, quiet: bool = False, verbose: bool = False) -> None:
    """Run `met bed clear`. Raises Problem."""
    about, faults = clear(word, baud)
    if form == "json":
        names = [str(fault.name).lower() for fault in Fault if fault in faults]
        say(json.dumps({"name": about.name, "cleared": names}))
    elif not quiet:
        say(f"bed `{about.name}` at {word}: {cleared_line(faults)}")
        for remedy in refusals.remedies(faults):
            say(f"  = help: {remedy}")


def clear(word: str, baud: int) -> tuple[About, Fault]:
    """Clear the faults of the bed at a port, without arming it. Returns its description and the faults. Raises
    Problem."""
    if kind_of(word).simulated:
        helps = "each run begins with one in which nothing is latched"
        raise Problem(error("E425", f"port `{word}` simulates a bed, anew for each command", help=helps))
    with opened(Port(chosen_bed(word, None, ()).port, baud), None, "", 0, math.inf) as bed:
        about = bed.connect()
        return about, latch.cleared(bed, about)


def cleared_line(faults: Fault) -> str:
    """The line that says which latched faults were cleared."""
    return f"cleared: {refusals.words(faults)}" if faults else "nothing was latched"
