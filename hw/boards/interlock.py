"""The interlock of a bed with motors, in SI, and its numbers as the firmware counts (hw/firmware/core/interlock.h)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hw.bed import Capability, Scales
from met.frozen import frozen

SPAN = 0.064
"""Time over which encoder and tachometer are compared, s: some ten times the delay of a tachometer's filter, and short
against the time in which a shaft runs away."""

EARLY, LATE = 0.5, 1.5
"""Shares of a tick between which the next one has to come, by another clock."""

STAND = 5
"""Ticks for which the main program may stand still."""


@frozen(kw_only=True)
class Interlock:
    """The numbers that a bed's interlock goes by.

    key                      a person's key has to be turned before it arms
    settle                   s within which the read-back of the amplifiers' enable follows
    hold                     s for which the drive is held at 0 V before the brake closes on a shaft that still turns
    drive_heat, drive_continuous   of the drive motor: I2t, A^2 s, above the current that it bears for ever, A
    warmest, bus             largest temperature, least and largest voltage of the supply, in the port's steps
    angle                    least and largest angle of the shaft, rad; None: it may turn for ever
    f_cut                    of the tachometer's filter, Hz; None: encoder and tachometer are not compared
    angle_floor              rad by which both may differ always
    load_off, load_time      A by which the load's measured current may be off, and for less than s; 0 s: not watched
    """

    key: bool
    settle: float
    hold: float
    drive_heat: float
    drive_continuous: float
    warmest: int
    bus: tuple[int, int]
    angle: tuple[float, float] | None
    f_cut: float | None
    angle_floor: float
    load_off: float
    load_time: float


def interlock_counts(
    lock: Interlock, tick_hz: float, scales: Scales, slow: int, capabilities: Capability
) -> dict[str, int | str]:
    """The fields of `interlock_config` except its port, by name. slow: counts of rate at which the brake may close.
    Raises ValueError for a number that does not fit in counts."""
    least, most = lock.angle or (1.0, 0.0)
    compared = lock.f_cut is not None and Capability.ENCODER in capabilities
    delay = math.sqrt(2.0) / (2.0 * math.pi * lock.f_cut) if lock.f_cut is not None else 0.0
    squared = scales.drive_current**2
    exact_counts: dict[str, float] = {
        "settle": math.ceil(lock.settle * tick_hz),
        "hold": math.ceil(lock.hold * tick_hz),
        "slow": slow,
        "heat": math.floor(lock.drive_heat / squared * tick_hz),
        "continuous": math.floor(lock.drive_continuous**2 / squared),
        "warmest": lock.warmest,
        "bus_least": lock.bus[0],
        "bus_most": lock.bus[1],
        "angle_least": math.ceil(least / scales.angle),
        "angle_most": math.floor(most / scales.angle),
        "span": round(SPAN * tick_hz) if compared else 0,
        "path": round(scales.rate / tick_hz / scales.angle * 65536.0),
        "lag": math.ceil(delay * tick_hz),
        "floor": math.ceil(lock.angle_floor / scales.angle),
        "load_off": math.ceil(lock.load_off / scales.current),
        "load_ticks": math.ceil(lock.load_time * tick_hz),
        "shortest": math.floor(EARLY * 1e6 / tick_hz),
        "longest": math.ceil(LATE * 1e6 / tick_hz),
        "stand": STAND,
    }
    for name, value in exact_counts.items():
        most_allowed = 2**60 if name in ("heat", "continuous") else 2**31 - 1
        if not -most_allowed <= value <= most_allowed or (value < 0 and not name.startswith("angle")):
            raise ValueError(f"the interlock's {name.replace('_', ' ')} is {value:.10g}, which is out of range")
    counts: dict[str, int | str] = {name: int(value) for name, value in exact_counts.items()}
    heat, continuous = counts.pop("heat"), counts.pop("continuous")
    counts["drive_heat"] = f"{{.most = {heat}, .continuous = {continuous}}}"
    counts["needs_key"] = "true" if lock.key else "false"
    return counts


_UNSIGNED = ("settle", "hold", "span", "lag", "load_ticks", "shortest", "longest", "stand")


def interlock_c(lock: Interlock, tick_hz: float, scales: Scales, slow: int, capabilities: Capability) -> Sequence[str]:
    """Lines of config.c that define `board_interlock`, whose port the board's own file defines."""
    counts = interlock_counts(lock, tick_hz, scales, slow, capabilities)
    return [
        "extern const interlock_port board_interlock_port;",
        "static const interlock_config board_interlock = {",
        "    .port = &board_interlock_port,",
        *(f"    .{name} = {value}{'u' if name in _UNSIGNED else ''}," for name, value in counts.items()),
        "};",
        "",
    ]
