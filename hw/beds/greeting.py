"""The description of a bed, made from its answer to HELLO and checked; its limits and commands in counts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from hw import refusals
from hw.bed import LIMIT_NAMES, About, BedDriver, Capability, Limits, Scales
from hw.protocol import messages
from met.diagnostic import Problem, error
from met.substitution.bed import DRIVES, DriveCommand

DEADMAN = (0.010, 0.020)
"""Shortest and longest deadman that a bed may have, s (docs/protocol.md, States)."""

_UNITS = {
    "voltage": "V",
    "current": "A",
    "rate": "rad/s",
    "angle": "rad",
    "drive_current": "A",
    "acceleration": "rad/s^2",
    "arming_rate": "rad/s",
    "voltage_slew": "V/s",
    "current_slew": "A/s",
    "heat": "A^2 s",
}


def about(hello: messages.HelloAnswer) -> About:
    """The description of a bed from its answer to HELLO. Raises Problem E404 where MET cannot drive such a bed."""
    name = hello.name.rstrip(b"\0").decode("latin-1").encode("unicode_escape").decode()
    capabilities = Capability(hello.capabilities & _KNOWN)
    wrong = [*_scales(hello.scales, capabilities), *_limits(hello.limits, hello.scales)]
    if not name or name.encode() != hello.name.rstrip(b"\0"):
        wrong.append("its name is not printable ASCII")
    if not (math.isfinite(hello.tick_hz) and hello.tick_hz > 0.0):
        wrong.append(f"its ticks come at {hello.tick_hz:g} Hz")
    if not DEADMAN[0] <= hello.deadman <= DEADMAN[1]:
        wrong.append(f"its deadman is {hello.deadman * 1e3:g} ms, which is not 10 to 20 ms")
    if wrong:
        helps = "correct the configuration in its firmware"
        raise Problem([error("E404", f"bed `{name}` cannot be driven: {reason}", help=helps) for reason in wrong])
    return About(
        name,
        hello.version,
        hello.firmware.hex(),
        hello.session,
        capabilities,
        hello.tick_hz,
        hello.deadman,
        hello.scales,
        hello.limits,
    )


_KNOWN = sum(Capability)
_SENSORS = dict(zip(("angle", "drive_current", "acceleration"), messages.SENSORS, strict=True))


def in_force(about: About) -> messages.LimitsAnswer:
    """The bed's own limits in counts, slews in counts a tick."""
    s, limits = about.scales, about.limits
    voltage, current, rate = (
        counts(limits.voltage, s.voltage),
        counts(limits.current, s.current),
        counts(limits.rate, s.rate),
    )
    slews = (
        counts(limits.voltage_slew / about.tick_hz, s.voltage),
        counts(limits.current_slew / about.tick_hz, s.current),
    )
    return messages.LimitsAnswer(voltage, current, rate, *slews)


def tighter(about: About, limits: Mapping[str, float]) -> dict[str, int]:
    """Limits that are asked for in SI as whole counts, slews in counts a tick; both by their names in `LIMIT_NAMES`.
    Raises Problem E408 for a number that is no limit, KeyError for another name."""
    s, hz = about.scales, about.tick_hz
    scale_of = dict(zip(LIMIT_NAMES, (s.voltage, s.current, s.rate, s.voltage * hz, s.current * hz), strict=True))
    for name, value in limits.items():
        if not 0.0 <= value < math.inf:
            message = f"a limit of {_words(name)} of {value:g} {_UNITS[name]} for bed `{about.name}`"
            raise Problem(error("E408", message, help="a limit is a number from 0 on"))
    return {name: counts(value, scale_of[name]) for name, value in limits.items()}


def commanded(
    bed: BedDriver,
    about: About,
    limits: messages.LimitsAnswer,
    voltage: float,
    current: float,
    *,
    drive: DriveCommand = "voltage",
) -> tuple[int, int]:
    """Both commands to a bed, for its drive and for the load's current (A), as whole counts, the nearest ones. Stops
    the bed and raises Problem E408 where one is no finite number, or beyond its limit in force.

    limits  in force, in counts;  drive: what `voltage` is, for the message
    """
    scales, counted = about.scales, []
    for what, value, scale, most, unit in (
        (f"a {drive}", voltage, scales.voltage, limits.voltage, DRIVES[drive][0]),
        ("a current", current, scales.current, limits.current, "A"),
    ):
        exact = value / scale
        if not (math.isfinite(exact) and -most <= round(exact) <= most):
            bed.stop()
            raise refusals.no_command(about, what, value, unit, most * scale)
        counted.append(round(exact))
    return counted[0], counted[1]


def ticks(about: About, period: float) -> int:
    """The number of ticks that a bed in lock-step makes in a period, s. Raises Problem E405 where it is not whole."""
    exact = period * about.tick_hz
    whole = round(exact)
    if not 1 <= whole <= 255 or abs(exact - whole) > 1e-6 * whole:
        message = f"a period of {period * 1e3:.6g} ms is {exact:.6g} ticks of bed `{about.name}`"
        helps = f"its ticks come at {about.tick_hz:g} Hz: take a whole number of them, 1 to 255"
        raise Problem(error("E405", message, help=helps))
    return whole


def counts(value: float, scale: float) -> int:
    """The whole counts in a limit, rounded down; a limit that only rounding has made smaller than a count has that
    count."""
    return math.floor(min(value / scale + 1e-6, messages.MOST))


def _scales(scales: Scales, capabilities: Capability) -> list[str]:
    """The faults of a bed's counts, in words: one that is no number above zero."""
    missing = {name for name, sensor in _SENSORS.items() if sensor not in capabilities}
    return [
        f"a count of its {_words(name)} is {value:g} {_UNITS[name]}"
        for name, value in scales.__dict__.items()
        if name not in missing and not (math.isfinite(value) and value > 0.0)
    ]


def _limits(limits: Limits, scales: Scales) -> Iterator[str]:
    """The faults of a bed's limits, in words: one that is no number above zero, or does not fit in counts."""
    for name, value in limits.__dict__.items():
        scale = getattr(scales, name, None)
        if not (math.isfinite(value) and value > 0.0):
            yield f"its limit of {_words(name)} is {value:g} {_UNITS[name]}"
        elif scale is not None and scale > 0.0 and not 1.0 <= value / scale <= messages.MOST:
            yield f"its limit of {_words(name)}, {value:g} {_UNITS[name]}, is {value / scale:.3g} counts"


def _words(name: str) -> str:
    return name.replace("_", " ")
