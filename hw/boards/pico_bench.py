"""A bench on a Raspberry Pi Pico from its TOML file: the bed's configuration, and the port's numbers.

The file is data: bounded, each figure a number with a unit of its kind, above zero. `hw/firmware/pico/bench.toml` is
the one that is taken where none is given, and says what each means.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

from hw.bed import Capability, Limits, Scales
from hw.boards.build import Config, Shaft, Uncountable, config_c
from hw.boards.interlock import Interlock
from hw.toml_file import TomlFile, quantity
from met.diagnostic import did_you_mean
from met.frozen import frozen

SHIPPED = Path(__file__).parents[1] / "firmware" / "pico" / "bench.toml"
MOST_BYTES = 1 << 16

CLOCK = 125_000_000
"""Hz of the processor."""

STEPS = 4096
"""Steps of the converter, and of a command's pulse width."""

RATE_SECONDS = 0.009
"""Time over which a rate by the encoder alone is taken, s: as late as a filter of 50 Hz."""

WATCHDOG_TICKS = 5
"""Ticks without one, after which the watchdog resets the chip."""

FLOOR_COUNTS, FLOOR_STEPS = 4.0, 2.0
"""Counts of the encoder, and steps of the tachometer's zero, by which the two may differ always."""

_TEXT, _FLAG, _WHOLE = "text", "flag", "whole"
_SCHEMA: Mapping[str, Mapping[str, str]] = {
    "bed": {"name": _TEXT, "tick": "Hz", "deadman": "s"},
    "drive": {
        "voltage_full": "V",
        "voltage_limit": "V",
        "voltage_slew": "V/s",
        "current_range": "A",
        "current_limit": "A",
        "current_continuous": "A",
        "heat": "A^2*s",
        "kt": "N*m/A",
        "resistance": "ohm",
        "tau_max": "N*m",
    },
    "load": {
        "current_full": "A",
        "current_limit": "A",
        "current_slew": "A/s",
        "current_range": "A",
        "current_continuous": "A",
        "heat": "A^2*s",
        "kt": "N*m/A",
    },
    "shaft": {
        "rate_limit": "rad/s",
        "rate_arming": "rad/s",
        "inertia": "kg*m^2",
        "f_c": "N*m",
        "f_v": "N*m*s/rad",
        "f_cut": "Hz",
        "rate_range": "rad/s",
        "encoder": _WHOLE,
        "angle_least": "rad",
        "angle_most": "rad",
    },
    "converter": {
        "rate_zero": _WHOLE,
        "drive_zero": _WHOLE,
        "load_zero": _WHOLE,
        "rate_reversed": _FLAG,
        "drive_reversed": _FLAG,
        "load_reversed": _FLAG,
    },
    "interlock": {
        "key": _FLAG,
        "settle": "s",
        "hold": "s",
        "thermistor": "ohm",
        "thermistor_beta": _WHOLE,
        "thermistor_pull_up": "ohm",
        "warmest": _WHOLE,
        "bus_full": "V",
        "bus_least": "V",
        "bus_most": "V",
        "load_off": "A",
        "load_time": "s",
    },
}
_TOGETHER = (
    ("shaft", "angle_least", "angle_most"),
    ("interlock", "thermistor", "thermistor_beta", "thermistor_pull_up", "warmest"),
    ("interlock", "bus_full", "bus_least", "bus_most"),
)
_OPTIONAL = {("shaft", "rate_range"), *((table, key) for table, *keys in _TOGETHER for key in keys)}


@frozen
class PicoBench:
    """A bench on a Pico. wiring: the fields of `pico_wiring` (hw/firmware/pico/pico.h), by name."""

    config: Config
    wiring: Mapping[str, int]


def pico_bench(path: str | os.PathLike[str] | None = None) -> PicoBench:
    """The bench of a file, or that which is shipped. Raises Problem E447, OSError."""
    file = _File(SHIPPED if path is None else path)
    figures = file.figures()
    try:
        bench = _bench(figures)
        config_c(bench.config, plant=False)
    except Uncountable as reason:
        raise file.wrong(f"the bench cannot be counted: {reason}", "take numbers that a bed may have") from None
    except ValueError as reason:
        raise file.wrong(str(reason), "take numbers that a bed may have") from None
    return bench


def wiring_c(wiring: Mapping[str, int]) -> str:
    """The text of wiring.c."""
    unsigned = ("reload", "watchdog", "rate_ticks")
    fields = (f"    .{name} = {value}{'u' if name in unsigned else ''}," for name, value in wiring.items())
    head = ("/* A Pico's numbers beside config.c. */", '#include "pico.h"', "", "const pico_wiring board_wiring = {")
    return "\n".join([*head, *fields, "};", ""])


def lock_step_wiring(tick_hz: float) -> dict[str, int]:
    """The wiring of a Pico that simulates its bed, so that nothing is connected to it."""
    return {"reload": round(CLOCK / tick_hz) - 1, "watchdog": 0}


def _bench(figures: Mapping[str, Any]) -> PicoBench:
    """The bench of these figures, SI by `table.key`. Raises ValueError where they do not fit together."""
    tick_hz: float = figures["bed.tick"]
    if not 200.0 <= tick_hz <= 4000.0:
        raise ValueError(f"a tick of {tick_hz:g} Hz is not 200 Hz to 4 kHz")
    for full, limit in (("drive.voltage_full", "drive.voltage_limit"), ("load.current_full", "load.current_limit")):
        if figures[limit] > figures[full] * (STEPS - 1) / STEPS:
            raise ValueError(f"`{limit}` is more than the amplifier holds at 4095 of 4096 steps, `{full}`")
    encoder = 2.0 * math.pi / figures["shaft.encoder"]
    tachometer = figures.get("shaft.rate_range")
    ticks = 0 if tachometer else min(32, max(1, round(RATE_SECONDS * tick_hz)))
    rate = 2.0 * tachometer / STEPS if tachometer else encoder * tick_hz / ticks
    load_step, load_count = 2.0 * figures["load.current_range"] / STEPS, figures["load.current_full"] / STEPS
    scales = Scales(
        voltage=figures["drive.voltage_full"] / STEPS,
        current=load_count,
        rate=rate,
        angle=encoder,
        drive_current=2.0 * figures["drive.current_range"] / STEPS,
        acceleration=1.0,
    )
    limits = Limits(
        voltage=figures["drive.voltage_limit"],
        current=figures["load.current_limit"],
        rate=figures["shaft.rate_limit"],
        arming_rate=figures["shaft.rate_arming"],
        voltage_slew=figures["drive.voltage_slew"],
        current_slew=figures["load.current_slew"],
        heat=figures["load.heat"],
    )
    if tachometer and figures["shaft.rate_limit"] > 0.95 * tachometer:
        raise ValueError("`shaft.rate_limit` is beyond 95 % of `shaft.rate_range`, so that no reading could pass it")
    shaft = Shaft(
        **{name: figures[f"drive.{name}"] for name in ("kt", "resistance", "tau_max")},
        kt_load=figures["load.kt"],
        **{name: figures[f"shaft.{name}"] for name in ("inertia", "f_c", "f_v", "f_cut")},
    )
    angle = (figures["shaft.angle_least"], figures["shaft.angle_most"]) if "shaft.angle_most" in figures else None
    if angle is not None and angle[0] >= angle[1]:
        raise ValueError("`shaft.angle_least` is not below `shaft.angle_most`")
    span = 0.064
    lock = Interlock(
        key=figures["interlock.key"],
        settle=figures["interlock.settle"],
        hold=figures["interlock.hold"],
        drive_heat=figures["drive.heat"],
        drive_continuous=figures["drive.current_continuous"],
        warmest=_warmest(figures),
        bus=_bus(figures),
        angle=angle,
        f_cut=figures["shaft.f_cut"] if tachometer else None,
        angle_floor=FLOOR_COUNTS * encoder + FLOOR_STEPS * rate * span,
        load_off=figures["interlock.load_off"],
        load_time=figures["interlock.load_time"],
    )
    config = Config(
        name=figures["bed.name"],
        tick_hz=tick_hz,
        deadman=figures["bed.deadman"],
        scales=scales,
        limits=limits,
        continuous_current=figures["load.current_continuous"],
        drive_current=figures["drive.current_limit"],
        shaft=shaft,
        capabilities=Capability.ENCODER | Capability.DRIVE_CURRENT | Capability.WATCHDOG,
        interlock=lock,
    )
    ratio = Fraction(load_step / load_count).limit_denominator(1000)
    wiring = {
        **lock_step_wiring(tick_hz),
        "watchdog": round(WATCHDOG_TICKS * 1e6 / tick_hz),
        "rate_ticks": ticks,
        "rate_zero": figures["converter.rate_zero"],
        "rate_sign": -1 if figures["converter.rate_reversed"] else 1,
        "drive_zero": figures["converter.drive_zero"],
        "drive_sign": -1 if figures["converter.drive_reversed"] else 1,
        "load_zero": figures["converter.load_zero"],
        "load_counts": ratio.numerator * (-1 if figures["converter.load_reversed"] else 1),
        "load_steps": ratio.denominator,
        "reference": STEPS // 2,
        "reference_off": 40,
        "has_temperature": int("interlock.thermistor" in figures),
        "has_bus": int("interlock.bus_full" in figures),
    }
    return PicoBench(config, wiring)


HIGHEST = 4079
"""Step of the converter above which a wire is off (hw/firmware/pico/port.c)."""


def _warmest(figures: Mapping[str, Any]) -> int:
    """Steps, counted down from `HIGHEST`, of the thermistor at its warmest: R = R25 exp(B (1/T - 1/298.15 K))."""
    if "interlock.thermistor" not in figures:
        return STEPS
    kelvin = figures["interlock.warmest"] + 273.15
    hot = figures["interlock.thermistor"] * math.exp(
        figures["interlock.thermistor_beta"] * (1.0 / kelvin - 1.0 / 298.15)
    )
    steps = math.ceil((STEPS - 1) * hot / (hot + figures["interlock.thermistor_pull_up"]))
    if not 32 <= steps <= HIGHEST - 32:
        warmest = figures["interlock.warmest"]
        raise ValueError(f"at {warmest} degC the thermistor reads {steps} of 4095: take another resistor")
    return HIGHEST - steps


def _bus(figures: Mapping[str, Any]) -> tuple[int, int]:
    """The least and greatest reading of the bus voltage, in steps of the converter; all of them where it is not
    measured. Raises ValueError."""
    if "interlock.bus_full" not in figures:
        return 0, STEPS
    least, most = (
        figures[f"interlock.bus_{end}"] / figures["interlock.bus_full"] * (STEPS - 1) for end in ("least", "most")
    )
    if not 0.0 <= least < most <= STEPS - 1:
        raise ValueError("`bus_least` is not below `bus_most`, or that not below `bus_full`")
    return math.ceil(least), math.floor(most)


class _File(TomlFile):
    """A bench's file."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        super().__init__(path, code="E447", most=MOST_BYTES, kind="a bench is TOML", about=_BEGIN)

    def figures(self) -> dict[str, Any]:
        """All figures in SI, by `table.key`."""
        for table, keys in self.tables.items():
            if table not in _SCHEMA or not isinstance(keys, dict):
                helps = [*did_you_mean(table, _SCHEMA), f"a bench has {', '.join(f'[{name}]' for name in _SCHEMA)}"]
                raise self.wrong(f"a bench has no `{table}`", helps, key=table)
            for key in keys:
                if key not in _SCHEMA[table]:
                    helps = [*did_you_mean(key, _SCHEMA[table]), f"it has {', '.join(_SCHEMA[table])}"]
                    raise self.wrong(f"[{table}] has no `{key}`", helps, table=table, key=key)
        figures = {}
        for table, schema in _SCHEMA.items():
            entries = self.tables.get(table, {})
            for key, kind in schema.items():
                if key in entries:
                    figures[f"{table}.{key}"] = self._figure(table, key, kind, entries[key])
                elif (table, key) not in _OPTIONAL:
                    raise self.wrong(f"[{table}] has no `{key}`", _BEGIN, table=table)
        for table, *keys in _TOGETHER:
            present = [key for key in keys if f"{table}.{key}" in figures]
            if present and len(present) < len(keys):
                missing = next(key for key in keys if key not in present)
                message = f"[{table}] has `{present[0]}` and no `{missing}`"
                raise self.wrong(message, f"give {', '.join(keys)}, or none of them", table=table, key=present[0])
        return figures

    def _figure(self, table: str, key: str, kind: str, value: Any) -> Any:
        """The value of a key in SI, by the kind of its schema. Raises Problem E447 where it is of another kind."""
        good = {
            _TEXT: lambda: isinstance(value, str) and value.isascii() and value.isprintable() and 1 <= len(value) <= 16,
            _FLAG: lambda: isinstance(value, bool),
            _WHOLE: lambda: isinstance(value, int) and not isinstance(value, bool) and 0 < value < 10**6,
        }
        example = {_TEXT: '"my bench"', _FLAG: "true", _WHOLE: "2000"}
        if kind in good:
            if not good[kind]():
                what = {_TEXT: "text of 1 to 16 letters", _FLAG: "true or false", _WHOLE: "whole number above zero"}
                message = f"`{key}` is no {what[kind]}: {value!r}"
                raise self.wrong(message, f"write `{key} = {example[kind]}`", table=table, key=key)
            return value
        try:
            return quantity(value, kind, signed=key.startswith("angle"))
        except ValueError:
            above = "" if key.startswith("angle") else " above zero"
            message = f"`{key}` is no quantity{above} in {kind}: {value!r}"
            raise self.wrong(message, f'write `{key} = "1.5 {kind}"`', table=table, key=key) from None


_BEGIN = "`met bed firmware --board pico --show` prints one to begin with"
