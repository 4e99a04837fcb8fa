"""Rates as exact whole divisors of one base rate, and their effect on stability.

Rates are taken as fractions, so that 1000/3 Hz divides 1 kHz and 333.3 Hz does not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np

from ic.grammar.syntax import Call
from ic.meaning.definitions.merge import Item, no_block
from ic.meaning.parameters.models import word_of
from ic.meaning.parameters.owner import Owner
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import Complaints
from met.diagnostic import Label, Place
from met.frozen import frozen
from met.parameter import Parameter
from met.plan import Schedule
from met.trace import Real

if TYPE_CHECKING:
    from fractions import Fraction


T = TypeVar("T")

MOST_TICKS = 10**12  # what a plan may have (met/plan_structure): thirty years at a kilohertz
WARN_ABOVE = 0.5  # of h lambda: above it, a step sees less than the decay it should follow


CONTINUOUS = math.inf
"""The `Rate.hz` of a continuous law."""

SLOWEST, FASTEST = 1e-3, 1e9
"""Smallest and largest rate, Hz."""

RATE = Parameter(
    name="rate", unit="Hz", at_least=SLOWEST, at_most=FASTEST, ticks=True, doc="how often the servo's computer ticks"
)


@frozen
class Rate:
    """A rate as written: its owner, in words, its value (Hz), and its place."""

    label: str
    hz: float
    place: Place


@frozen
class Ticks:
    """The ticks of a servo's law: the number of base ticks between them; or continuous, as a part of each step of the
    dynamics."""

    divisor: int
    continuous: bool


def fixed_rate(
    scope: Scope,
    owner: Owner,
    item: Item,
    label: str,
    name: str = "rate",
    *,
    continuous: bool = False,
    doc: str = RATE.doc,
) -> Rate | None:
    """The rate of an entry, Hz, which no sweep can vary; `CONTINUOUS` where it may be `continuous`, and is; None where
    it has a mistake, which is reported."""
    if word_of(item.value) == "continuous" and not isinstance(item.value, Call):
        if item.upon is not None:
            scope.complaints.add(no_block(item.name, item.upon, item.place))
            return None
        if continuous:
            return Rate(label, CONTINUOUS, item.value_place)
        message = f"`{name}` cannot be continuous: only the law of a servo can"
        scope.complaints.error("D106", message, item.value_place, help="write a rate in Hz")
        return None
    wanted = replace(RATE, name=name, doc=doc)
    rate = scope.constant(owner, wanted, item)
    return Rate(label, rate, item.value_place) if rate is not None and SLOWEST <= rate <= FASTEST else None


def exact(value: float) -> Fraction:
    """The simplest fraction that is this number to a part in 1e12: 333.33333333333331 is 1000/3."""
    from fractions import Fraction  # takes 2 ms, and whole rates do without

    for most in (1, 1000, 1_000_000):
        simple = Fraction(value).limit_denominator(most)
        if simple > 0 and abs(float(simple) - value) <= 1e-12 * value:
            return simple
    return Fraction(value)


def divisor(complaints: Complaints, rate: Rate, base: Rate, others: list[Rate], *, written: bool) -> int:
    """The number of base ticks between ticks of this rate; where that is not whole, it is reported, and 1 returned."""
    if base.hz.is_integer() and rate.hz.is_integer() and base.hz % rate.hz == 0.0:
        return int(base.hz // rate.hz)
    ratio = exact(base.hz) / exact(rate.hz)
    if ratio.denominator == 1:
        return int(ratio)
    label = Label(rate.place, f"{hz(base.hz)}/{hz(rate.hz)} = {float(ratio):.4g}")
    also = [Label(base.place, "base rate set here" if written else f"base rate set here: the fastest, {base.label}")]
    helps = []
    if ratio < 1:
        message = f"{rate.label} at {hz(rate.hz)} Hz is faster than the base rate, {hz(base.hz)} Hz"
    else:
        message = f"{rate.label} at {hz(rate.hz)} Hz does not divide the base rate, {hz(base.hz)} Hz"
        fits = dict.fromkeys((max(1, math.floor(ratio)), math.ceil(ratio)))
        helps.append("nearest that fit: " + ", ".join(_fitting(base.hz, n) for n in fits))
    common = _common([exact(other.hz) for other in (rate, base, *others)])
    if common is not None:
        helps.append(f"{'or ' if helps else ''}a base rate that all divide: `base = {common};` in `rates`")
    complaints.error("D100", message, label, also=also, help=helps)
    return 1


def _fitting(base_hz: float, n: int) -> str:
    """The n-th part of the base rate in words, so that it can be written exactly."""
    exactly = exact(base_hz) / n
    if exactly.denominator == 1 or float(exactly) == float(f"{float(exactly):.6g}"):
        return f"{hz(float(exactly))} Hz ({hz(base_hz)}/{n})"
    return f"{hz(float(exactly))} Hz, written ({hz(base_hz)}/{n}) Hz"


def _common(rates: list[Fraction]) -> str | None:
    """The slowest rate that all divide, unless it is absurd."""
    from fractions import Fraction

    common = Fraction(math.lcm(*(rate.numerator for rate in rates)), math.gcd(*(rate.denominator for rate in rates)))
    if common > 100_000:
        return None
    return f"{hz(float(common))} Hz"


def make_schedule(
    complaints: Complaints,
    dynamics: Rate,
    record: Rate,
    base: Rate,
    others: list[Rate],
    duration: float | None,
    duration_place: Place,
    *,
    base_written: bool,
) -> Schedule:
    """The schedule. Mismatches are reported. duration: of the run, s; None: unknown (already reported)"""
    all_rates, before = [dynamics, record, *others], complaints.error_count
    step = divisor(complaints, dynamics, base, all_rates, written=base_written)
    row = step if record == dynamics else divisor(complaints, record, base, all_rates, written=base_written)
    if duration is None:
        return Schedule(base.hz, step, row, step * row)
    if duration * base.hz > MOST_TICKS:
        ticks_in_words = f"{min(duration * base.hz, 1e308):.3g}"
        complaints.error(
            "D103",
            f"a run of {ticks_in_words} ticks of the base rate",
            duration_place,
            also=[Label(base.place, "the base rate")],
            help="at most 1e12 are possible: shorten the run",
        )
        return Schedule(base.hz, step, row, 1)
    in_whole = duration.is_integer() and base.hz.is_integer()
    refused = complaints.error_count > before  # and so are the steps from which a duration would be made
    ticks = int(duration) * int(base.hz) if in_whole else exact(duration) * exact(base.hz)
    whole = round(ticks)
    if refused:
        return Schedule(base.hz, step, row, max(1, whole))
    if ticks.denominator != 1 or whole % step:
        length, per_step = exact(duration), step / exact(base.hz)
        count = max(1, math.floor(length / per_step))
        near = [f"{float(n * per_step):.9g} s" for n in (count, count + 1)]
        complaints.error(
            "D101",
            f"a duration of {duration:g} s is {float(length / per_step):.6g} steps of the dynamics",
            duration_place,
            also=[Label(dynamics.place, f"a step is {float(per_step):g} s")],
            help="nearest that fit: " + ", ".join(near),
        )
        whole = count * step
    elif whole % row:
        last = whole // row * row / exact(base.hz)
        complaints.remark(
            "D102",
            f"the last row is recorded at {float(last):g} s, before the run's end at {duration:g} s",
            record.place,
            also=[Label(duration_place, "the end")],
            help="a duration that is a whole number of rows records both ends",
        )
    return Schedule(base.hz, step, row, whole)


def fastest_rate(
    scope: Scope, servo: Any, parameters: Mapping[str, Any], path: str, *, continuous: bool = False
) -> Real | None:
    """The fastest rate constant of a joint under its servo, 1/s (`Servo.fastest`); None where the servo does not know
    it.

    path        of the servo: nothing is computed where a parameter of it is out of its range (already reported)
    continuous  whether its law is, so that its gains count
    """
    bound: Callable[..., Real] | None = servo.fastest_law if continuous else None
    return evaluate_declared(scope, bound or servo.fastest, parameters, path)


def evaluate_declared(
    scope: Scope, function: Callable[..., T] | None, values: Mapping[str, Any], path: str, *more: Any
) -> T | None:
    """The result of a declaration's function for these parameters; None without a function, or if one is out of range.

    path  of the parameters
    """
    if function is None or scope.checks.failed(path):
        return None
    # as in the engine, a division by a product that underflows is infinite, without an exception
    numbers = {name: np.float64(x) if isinstance(x, float) else x for name, x in values.items()}
    with scope.complaints.gather(), np.errstate(all="ignore"):
        return function(SimpleNamespace(**numbers), *more)
    return None


def check_stability(
    scope: Scope,
    label: str,
    fastest: Real,
    schedule: Schedule,
    integrator: Any,
    dynamics: Rate,
    path: str,
    meaning: str = "the servo's fastest rate constant, on any arm",
) -> None:
    """Warn of h lambda of a joint under its servo, or of a sensor; an error where it is unstable.

    label  the servo in words; joints with the same servo and the same figure are reported once, and of several servos
           for which one rate is too slow the first that is checked
    path   of the servo
    meaning  what lambda is
    """
    with scope.complaints.gather():
        limit, h = integrator.real_limit, schedule.step
        slowest = slowest_that_fits(schedule, limit)

        def test(values: np.ndarray) -> tuple[np.ndarray, list[str]]:
            """True of each case in which a decay is unstable with the steps of the dynamics, h lambda at or above the
            limit, with words about the worst. values: [case, 1], lambda in 1/s."""
            x = h * values[:, 0]
            bad = ~(x < limit)
            if bad.any():
                scope.note_rate("D104", float(np.max(x)), int(np.argmax(x)))
            worst = float(np.max(values[:, 0])) if bad.any() else 0.0
            return bad, [
                f"h * lambda = {float(np.max(x)):.3g}; the slowest rate that fits is {slowest(worst)}"
            ] if bad.any() else []

        def warn(values: np.ndarray) -> None:
            """Warn where a decay is stable, and too fast for the steps to follow its motion (D105). values: [case, 1],
            lambda in 1/s."""
            x = h * values[:, 0]
            above = WARN_ABOVE * (1.0 + 1e-9)
            if above < float(np.max(x)) < limit:
                scope.note_rate("D105", float(np.max(x)), int(np.argmax(x)))
                better = slowest_that_fits(schedule, above)(float(np.max(values[:, 0])))
                scope.complaints.remark(
                    "D105",
                    f"{label} is fast for the dynamics' step: h * lambda = {float(np.max(x)):.3g}",
                    Label(dynamics.place, f"h = {h:g} s"),
                    help=f"stable below {limit:g} with {integrator.name}, true to the motion below {WARN_ABOVE:g}: the "
                    f"slowest rate that fits is {better}",
                )

        scope.checks.require(
            (fastest,),
            test,
            code="D104",
            place=dynamics.place,
            message=f"{label} is unstable with {integrator.name} at this rate of the dynamics",
            help=f"h * lambda must stay below {limit:g}; lambda is {meaning}",
            needs=(path,),
        )
        scope.checks.observe((fastest,), warn, dynamics.place, needs=(path,))


def slowest_that_fits(schedule: Schedule, limit: float) -> Callable[[float], str]:
    """A function from a rate constant (1/s) to the slowest rate of the dynamics that keeps h times it below the
    limit."""

    def name(fastest: float) -> str:
        """The slowest rate of the dynamics with which h lambda stays below the limit, in words. fastest: lambda,
        1/s."""
        if not math.isfinite(fastest):
            return "none"
        most = min(schedule.dynamics, math.ceil(limit * schedule.base_hz / fastest) - 1, 100_000)
        for n in range(most, 0, -1):
            if schedule.ticks % n == 0:
                return f"{hz(schedule.base_hz / n)} Hz"
        times = math.floor(fastest / limit / schedule.base_hz) + 1
        return f"{hz(schedule.base_hz * times)} Hz"

    return name


def hz(value: float) -> str:
    """A rate in a deck's notation."""
    return f"{value:.6g}"


@frozen
class Ticker:
    """A guide or a sensor of the run, which ticks: its name, its own rate (None: that of the servos), and its place.

    kind  its kind in a word: "guide";  verb: for it at its ticks, as messages use it;  code: of a wrong rate
    """

    name: str
    rate: Rate | None
    place: Place

    kind: ClassVar[str]
    verb: ClassVar[str]
    code: ClassVar[str]

    @property
    def label(self) -> str:
        """The guide or sensor in words: "guide `tip`"."""
        return f"{self.kind} `{self.name}`"

    @property
    def path(self) -> str:
        """The path of the guide's or sensor's parameters: "guides.tip"."""
        return f"{self.kind}s.{self.name}"

    @property
    def ticks(self) -> bool:
        """True of a guide or sensor that has a computer, which ticks; of another the rate says nothing."""
        return True


def rate_of(scope: Scope, ticker: Ticker, shared: Rate | None) -> Rate | None:
    """The own rate, else that of the servos; None where there is neither (already reported)."""
    own_rate = ticker.rate or shared
    if own_rate is None or own_rate.hz == CONTINUOUS:
        message = "the servos are continuous" if own_rate is not None else "the run has no rate of the servos"
        scope.complaints.error(
            ticker.code,
            f"{ticker.label} has no rate, and {message}",
            ticker.place,
            help=f"write `rate = 100 Hz;` in the {ticker.kind}",
        )
        return None
    return own_rate


def report_between_steps(scope: Scope, ticker: Ticker, rate: Rate, step: Rate) -> None:
    """Report a guide or a sensor whose rate does not divide that of the dynamics, at whose instants it sees the arm."""
    scope.complaints.error(
        ticker.code,
        f"{ticker.label} {ticker.verb} at {rate.hz:g} Hz, between the steps of the dynamics",
        rate.place,
        also=[Label(step.place, f"{step.hz:g} Hz")],
        help=f"give the {ticker.kind} a `rate` that divides {step.hz:g} Hz, or quicken the dynamics",
    )
