"""Warnings about commands, courses, loads and filters that their sampling instants do not resolve, or the run is too
short for (`met.content`).

What is sampled is held until the next instant, or is taken as the mean of a step's two ends: of a pulse between two
zeros both make the sum of the samples times the interval. The integral of a rate is a way, that of a torque an impulse;
of a position, the peak is what counts.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from ic.meaning.control.schedule import evaluate_declared
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import and_more
from met import models
from met.content import Content, Hump, humps_from_zero, humps_of_turns
from met.diagnostic import Place
from met.frozen import frozen
from met.plan import BASE, LinkSensor, Schedule, SensorUse, Structure
from met.plan.judged import Requirement
from met.plan.uses import sensor_parts
from met.trace import Real

MOST_ROWS = 1000
"""Largest number of different cases of a sweep that are examined, evenly spread."""

OFF = 0.05
"""Largest relative error of a pulse's integral, or peak, in samples that is not warned of."""

FEW = 20.0
"""Number of intervals in a pulse from which on its integral is within `OFF`: half an interval at each end."""

SLIGHT = 0.1
"""Size of a pulse as a share of the largest one's, below which it is ignored."""

ROUNDING = 1e-9
"""Share of an interval by which an instant may miss its time."""

NEAR = 0.02
"""Share of a run by which a command may go on after it without a word."""

MOST_TIMES = 40
"""Factor over the present rate up to which a sufficient one is searched for."""

ENOUGH = 10
"""Number of instants in a swing that show its shape, and not only its existence."""


@frozen
class SampledContent:
    """The time content of a model, and the instants that sample it.

    label     whose it is, in words;  path: of its parameters
    declared  its parameters;  content: what it brings (`Profile.content`, `Environment.content`)
    interval  s between instants;  by: what they are, in words, as in "its servo ticks"
    integral  whether the integral of its pulses counts, as of a rate or a torque, else their peaks
    recorded  s between rows of the histories; 0 where none are kept
    finishes  whether it should end within the run: a command of what a requirement judges
    """

    label: str
    path: str
    declared: tuple[Any, ...]
    content: Callable[[Any, float], Content]
    interval: float
    by: str
    place: Place | None
    integral: bool = True
    recorded: float = 0.0
    finishes: bool = False


@frozen
class Swing:
    """The fastest swing of something that is sampled, Hz.  label: whose it is, in words"""

    label: str
    frequency: float
    place: Place

    def remark(self, scope: Scope, base: float, interval: float, by: str, seen: str, cure: str, ticks: int = 0) -> bool:
        """Return True, with a warning, if instants at this interval, s, take it for a slower one.

        base  rate, Hz;  by: what the instants are, in words, `seen`: what they make of it, `cure`: before a rate
        ticks that the rate is to divide (`_fitting`)
        """
        if 2.0 * self.frequency * interval < 1.0 - ROUNDING:
            return False
        hz = 1.0 / interval
        enough = _fitting(ENOUGH * self.frequency, base, ticks)
        rate = f"; or {cure} {_written(enough, base)}, {ENOUGH} instants a swing or more" if enough < math.inf else ""
        scope.complaints.remark(
            "D335",
            f"{self.label} swings at {self.frequency:.6g} Hz, and {by} at {hz:.6g} Hz: "
            f"{seen} swings at {abs(math.remainder(self.frequency, hz)):.6g} Hz",
            self.place,
            help=f"let it swing slower than {0.5 * hz:.6g} Hz{rate}",
        )
        return True


def check_sampling(scope: Scope, structure: Structure, requirements: Iterable[Requirement] = ()) -> None:
    """Warn about changes that begin or go on after the run's end, and swings and pulses between the sampling
    instants."""
    schedule, named = structure.schedule, {requirement.metric for requirement in requirements}
    judged = {use.of for use in structure.metrics if use.name in named}
    finishing = {f"{channel.rpartition('.')[0]}.servo.command" for channel in judged if channel.endswith((".q", ".qd"))}
    recorded = schedule.record / schedule.base_hz if structure.record else 0.0
    for sampled in _all_sampled(structure):
        _observe(scope, replace(sampled, recorded=recorded, finishes=sampled.path in finishing), schedule)
    for use in structure.servos:
        for sensor in use.sensors if not use.continuous else ():
            label = f"sensor `{sensor.of}` of servo `{use.definition}`"
            path = f"{use.joint}.servo.sensor.{sensor.of}"
            _observe_filter(scope, sensor, label, path, use.divisor, "its servo ticks", schedule)
    for link_sensor in structure.sensors:
        label, path = f"sensor `{link_sensor.name}`", f"sensors.{link_sensor.name}"
        _observe_filter(scope, link_sensor, label, path, link_sensor.divisor, "it reads", schedule)


def _observe_filter(
    scope: Scope, use: SensorUse | LinkSensor, label: str, path: str, divisor: int, by: str, schedule: Schedule
) -> None:
    """Warn about a sensor whose filter passes what its instants, every `divisor` base ticks, take for slower swings."""
    by_name = {
        sensor_part.name: scope.parameters.get(f"{path}.{sensor_part.name}")
        for sensor_part in sensor_parts(use, "parameters")
    }
    settled = {name: setting for name, setting in by_name.items() if setting is not None}
    values = {name: setting.value for name, setting in settled.items()}
    rate = evaluate_declared(scope, models.find("sensor", use.model).fastest, values, path)
    place = next(
        (setting.origin.place for setting in settled.values() if setting.unit == "Hz" and setting.origin.place),
        use.place,
    )
    if rate is None or place is None:
        return
    hz = schedule.base_hz / divisor

    def warn(rows: np.ndarray) -> None:
        """Warn where a filter passes frequencies of more than half the rate at which it is read (D335). rows: [case,
        1], the cut-off in rad/s."""
        cutoff = float(rows.max()) / (2.0 * math.pi)
        if 2.0 * cutoff <= hz * (1.0 + ROUNDING) or scope.complaints.error_count:
            return
        enough = _fitting(2.0 * cutoff, schedule.base_hz)
        more = f"; or give what reads it {_written(enough, schedule.base_hz)}" if enough < math.inf else ""
        scope.complaints.remark(
            "D335",
            f"the filter of {label} passes {cutoff:.6g} Hz{scope.checks.where(int(rows.argmax()), [rate])}, and {by} "
            f"at {hz:.6g} Hz: what swings faster than {0.5 * hz:.6g} Hz is read as slower",
            place,
            help=f"a cut-off frequency of {0.5 * hz:.6g} Hz or less{more}",
        )

    scope.checks.observe((rate,), warn, place, needs=(path,))


def _all_sampled(structure: Structure) -> Iterator[SampledContent]:
    """The contents (begin, end, frequency, pulses) of all commands, paths and loads that depend on time, each with the
    interval, s, at which the run samples it."""
    schedule = structure.schedule

    def course(
        label: str, path: str, model: str, interval: float, by: str, place: Place | None, *, integral: bool = False
    ) -> Iterator[SampledContent]:
        """The content of a command's model, if it declares one, with the interval at which it is sampled (s) and by
        what."""
        profile = models.find("command", model, place)
        if profile.content is not None:
            yield SampledContent(label, path, profile.parameters, profile.content, interval, by, place, integral)

    steps = "the dynamics steps"
    for use in structure.servos:
        if use.command is not None and use.command.model:
            interval = schedule.step if use.continuous else use.divisor / schedule.base_hz
            by = steps if use.continuous else "its servo ticks"
            label = f"the command of servo `{use.definition}`"
            path, integral = f"{use.joint}.servo.command", use.command.kind != "position"
            yield from course(label, path, use.command.model, interval, by, use.place, integral=integral)
    for guide in structure.guides:
        interval = guide.divisor / schedule.base_hz
        for component_course in guide.courses:
            label, path = (
                f"`{component_course.component}` of guide `{guide.name}`",
                f"guides.{guide.name}.{component_course.component}",
            )
            yield from course(label, path, component_course.model, interval, "the guide ticks", guide.place)
    for component_course in structure.base.courses if structure.base is not None else ():
        path = f"{BASE}.{component_course.component}"
        yield from course(
            f"`{component_course.component}` of the base", path, component_course.model, schedule.step, steps, None
        )
    for load in structure.environment:
        model = models.find("environment", load.model, load.place)
        if model.content is not None:
            label, path = f"environment `{load.name}`", f"environment.{load.name}"
            yield SampledContent(label, path, model.parameters, model.content, schedule.step, steps, load.place)


def _observe(scope: Scope, sampled: SampledContent, schedule: Schedule) -> None:
    """Check a content's instants and pulses once the cases are known."""
    settled = {
        parameter.name: scope.parameters.get(f"{sampled.path}.{parameter.name}") for parameter in sampled.declared
    }
    known = {name: setting.value for name, setting in settled.items() if setting is not None}
    if len(known) < len(settled):
        return  # what it has no number for is already reported
    fixed = {name: value for name, value in known.items() if isinstance(value, str | tuple)}
    numbers: dict[str, Real] = {name: value for name, value in known.items() if name not in fixed}  # type: ignore[misc]
    by_use = sorted(
        (setting for setting in settled.values() if setting), key=lambda setting: setting.unit not in ("s", "Hz")
    )
    place = next((setting.origin.place for setting in by_use if setting.origin.place), sampled.place)
    if place is None:
        return

    def warn(rows: np.ndarray) -> None:
        """Warn where instants of sampling do not resolve what is sampled in a case, or where it begins after the end of
        the run in some of the cases. rows: [case, number], SI."""
        if scope.complaints.error_count:
            return  # a number may be out of its range
        rows, cases, counts = np.unique(rows, axis=0, return_index=True, return_counts=True)
        if len(rows) > MOST_ROWS:
            chosen = np.linspace(0, len(rows) - 1, MOST_ROWS).astype(int)
            rows, cases, counts = rows[chosen], cases[chosen], counts[chosen]
        contents = [
            sampled.content(SimpleNamespace(**fixed, **dict(zip(numbers, row, strict=True))), schedule.duration)
            for row in rows.tolist()
        ]
        _remark(scope, sampled, contents, schedule, place)
        late = [index for index, content in enumerate(contents) if schedule.duration <= content.begins < math.inf]
        if 0 < len(late) < len(contents) and not sampled.path.startswith("environment."):
            first = min(late, key=lambda index: cases[index])
            others = " and others" if counts[late].sum() > 1 else ""
            _remark_late(scope, sampled, contents[first].begins, schedule, place, f" in case #{cases[first]}{others}")

    scope.checks.observe(tuple(numbers.values()), warn, place, needs=(sampled.path,))


def _remark_late(
    scope: Scope, sampled: SampledContent, begins: float, schedule: Schedule, place: Place, where: str
) -> None:
    """Warn about a command or load that first changes after the end of the run (D334). begins: s; where: the case, in
    words."""
    scope.complaints.remark(
        "D334",
        f"{sampled.label} does nothing{where}: it first changes at {begins:.9g} s, and the run ends at "
        f"{schedule.duration:.9g} s",
        place,
        help="let it begin earlier, or the run last longer; or write the value that it keeps",
    )


def _remark(scope: Scope, sampled: SampledContent, contents: list[Content], schedule: Schedule, place: Place) -> None:
    """Warn about contents that last beyond the run, swing too fast for their interval, or whose pulses are lost."""
    duration, base = schedule.duration, schedule.base_hz
    first = min(contents, key=lambda content: content.begins)
    if duration <= first.begins < math.inf:
        return _remark_late(scope, sampled, first.begins, schedule, place, " in this run")
    last = max(contents, key=lambda content: content.ends)
    if duration * (1.0 + NEAR) < last.ends < math.inf and sampled.finishes and not last.frequency:
        scope.complaints.remark(
            "D349",
            f"{sampled.label} goes on after the run: its last change ends at {last.ends:.6g} s, and the run at "
            f"{duration:.6g} s",
            place,
            help=f"let the run last longer, `duration = {math.ceil(10.0 * last.ends - 1e-6) / 10.0:.9g} s;`, or let it "
            "end earlier",
        )
    hz = 1.0 / sampled.interval
    fastest = min(max(content.frequency for content in contents), sys.float_info.max)
    swing = Swing(sampled.label, fastest, place)
    if not swing.remark(scope, base, sampled.interval, sampled.by, "what is seen of it", "give what sees it"):
        rows, visible = "the histories have rows", "what they show of it, and of what follows it,"
        swing.remark(scope, base, sampled.recorded, rows, visible, "record at", schedule.ticks)
    lost = [pulse for content in contents for pulse in _lost(content.pulses, sampled.interval, duration)]
    if lost:
        begins, ends = min(lost, key=lambda pulse: pulse[1] - pulse[0])
        before = math.floor(begins * hz)
        times = f"{before * sampled.interval:.9g} s and {(before + 1) * sampled.interval:.9g} s"
        enough = _fitting(1.0 / (ends - begins), base) if ends > begins else math.inf
        rate = [f"or give what sees it {_written(enough, base)}"] if enough < math.inf else []
        scope.complaints.remark(
            "D336",
            f"{sampled.label} has a pulse that is not seen{and_more(len(lost) - 1)}: it is beyond half of its height "
            f"from {begins:.9g} s to {ends:.9g} s, and {sampled.by} at {times}",
            place,
            help=[f"let it last longer than {sampled.interval:.6g} s", *rate],
        )
        return
    off = [
        (content.points, pulse)
        for content in contents
        for pulse in uncarried(content.points, sampled.interval, duration, integral=sampled.integral)
    ]
    if off:
        points, worst = max(off, key=lambda pair: pair[1].off)
        what = "integral" if sampled.integral else "peak"
        scope.complaints.remark(
            "D342",
            f"{sampled.label} has a pulse that is seen as another{and_more(len(off) - 1)}: from {worst.begins:.9g} s "
            f"to {worst.ends:.9g} s its {what} is {worst.truth:.4g}, and {sampled.by} every {sampled.interval:.6g} s "
            f"make it {worst.seen:.4g}, {100.0 * worst.off:.3g} % {'more' if worst.seen > worst.truth else 'less'}",
            place,
            help=[
                "let it begin, turn and end at instants that see it, or last longer",
                *_rates_that_carry(sampled, points, duration, base),
            ],
        )


def _rates_that_carry(
    sampled: SampledContent, points: tuple[tuple[float, float], ...], duration: float, base: float
) -> list[str]:
    """The slowest fitting rate at which its pulses are sampled correctly, as a remedy in words; none where it would be
    some dozens of times the present rate."""
    for times in range(2, MOST_TIMES):
        hz = _fitting(times / sampled.interval, base)
        if not uncarried(points, 1.0 / hz, duration, integral=sampled.integral):
            return [f"or give what sees it {_written(hz, base)}"]
    return []


def _fitting(wanted: float, base: float, ticks: int = 0) -> float:
    """The slowest rate from `wanted` Hz on that divides the base rate, or that the base rate divides, Hz.

    Infinite where it is beyond all numbers. ticks: of the run, which a rate of rows divides; 0: any rate will do
    """
    if wanted <= base:
        n = math.floor(base / wanted * (1.0 + ROUNDING))
        return base / next(divisor for divisor in range(n, 0, -1) if ticks % divisor == 0)
    times = wanted / base * (1.0 - ROUNDING)
    return base * math.ceil(times) if times < math.inf else math.inf


def _written(rate: float, base: float) -> str:
    """A rate as a deck is to have it: a share of the base rate where six digits are not exact."""
    return f"{rate:.6g} Hz" if rate >= base or float(f"{rate:.6g}") == rate else f"({base:.9g}/{base / rate:.0f}) Hz"


def _lost(pulses: Iterable[tuple[float, float]], interval: float, duration: float) -> Iterator[tuple[float, float]]:
    """The pulses within the run in which no instant lies."""
    for begins, ends in pulses:
        if 0.0 <= begins < duration and math.ceil(begins / interval - ROUNDING) > ends / interval + ROUNDING:
            yield begins, ends


# Pulses whose size is wrong in the samples


@frozen
class Uncarried:
    """A pulse with a wrong size in samples: from and until, s; its true integral, or peak, and the sampled one."""

    begins: float
    ends: float
    truth: float
    seen: float

    @property
    def off(self) -> float:
        """Relative error of the sampled size."""
        return abs(self.seen / self.truth - 1.0)


def uncarried(
    points: Sequence[tuple[float, float]], interval: float, duration: float, *, integral: bool
) -> list[Uncarried]:
    """The pulses of a course (a value as a function of time) of straight lines whose size is wrong in samples at this
    interval, s.

    integral  whether the integral counts, else the peak
    """
    if len(points) < 2:
        return []
    inner = [hump for hump in humps_of_turns(points) if hump.times[0] >= 0.0 and hump.times[-1] <= duration]
    known = {(float(pulse.times[0]), float(pulse.times[-1])) for pulse in inner}
    from_zero = humps_from_zero(points, duration) if integral else ()
    every = [*inner, *(pulse for pulse in from_zero if (float(pulse.times[0]), float(pulse.times[-1])) not in known)]
    truths = [pulse.impulse if integral else float(pulse.heights.max()) for pulse in every]
    least = SLIGHT * max(truths, default=0.0)
    looked_at = ((hump, truth) for hump, truth in zip(every, truths, strict=True) if truth > least)
    return [pulse for pulse in _judged(looked_at, interval, duration, integral) if pulse.off > OFF]


def _judged(
    humps: Iterable[tuple[Hump, float]], interval: float, duration: float, integral: bool
) -> Iterator[Uncarried]:
    """Compare each hump of a course (a value as a function of time) with its samples at this interval, s: its height
    with theirs, or its integral with theirs where `integral` is set."""
    for hump, truth in humps:
        begins, ends = float(hump.times[0]), float(hump.times[-1])
        if integral and ends - begins > FEW * interval:
            continue
        first, last = math.ceil(begins / interval - ROUNDING), math.floor(ends / interval + ROUNDING)
        if integral and duration <= last * interval * (1.0 + ROUNDING):
            last -= 1  # nothing is held from the run's end on
        instants = np.clip(np.arange(first, last + 1) * interval, begins, ends)
        heights = hump.at(instants)
        seen = interval * float(heights.sum()) if integral else float(heights.max(initial=0.0))
        yield Uncarried(begins, ends, truth, seen)
