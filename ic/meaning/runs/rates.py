"""The rates of a run, and their schedule."""

from __future__ import annotations

from collections.abc import Sequence

from ic.language.runs import RATES
from ic.meaning.control.guides import Guiding, check_period
from ic.meaning.control.schedule import (
    CONTINUOUS,
    Rate,
    Ticker,
    Ticks,
    divisor,
    exact,
    fixed_rate,
    make_schedule,
    rate_of,
    report_between_steps,
)
from ic.meaning.control.servos import Use
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.parameters.models import body_of
from ic.meaning.parameters.owner import Owner
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words, with_article
from met import models
from met.diagnostic import Help, Label, did_you_mean, write
from met.plan import Schedule

ANY_RATE = 1000  # Hz, where the deck's rate has a mistake


def resolve_rates(scope: Scope, run: Owner, item: Item | None) -> dict[str, Rate]:
    """The rates of a run by name, from its block `rates`; what is missing, unknown or no rate is reported (D115 to
    D117)."""
    rates: dict[str, Rate] = {}
    if item is None:
        scope.complaints.missing(
            run.place,
            ("rates",),
            "D115",
            f"{run.label} has no rates",
            help=write("rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }", where="inside"),
        )
        return rates
    body = body_of(scope, item)
    owner = Owner("`rates`", item.place, "rates")
    for part in body.items.values():
        if part.kind or part.name not in RATES.keys:
            scope.complaints.note_misspelling(item.place, part.name, RATES.keys)
            scope.complaints.error(
                "D116",
                f"no rate `{part.name}`",
                part.place,
                help=[*did_you_mean(part.name, RATES.keys), known_words("rates", RATES.keys)],
            )
            continue
        may_be_continuous, doc = part.name == "servos", RATES[part.name].doc
        rate = fixed_rate(scope, owner, part, f"`{part.name}`", part.name, continuous=may_be_continuous, doc=doc)
        if rate is not None:
            rates[part.name] = rate
    if "dynamics" not in body.items and item.body is not None:
        scope.complaints.missing(
            item.place,
            ("dynamics",),
            "D117",
            "no rate of the dynamics",
            help=_add(item, "dynamics = 1 kHz;"),
        )
    return rates


def _add(rates: Item, entry: str, text: str = "") -> Help:
    """The help to add an entry to `rates`, or where these are a base's, a block of the run's own."""
    text = text or f"write `{entry}`"
    return write(entry, text, where="inside") if len(rates.homes) == 1 else Help(text)


def resolve_schedule(
    scope: Scope,
    run: Owner,
    block: MergedBlock,
    rates: dict[str, Rate],
    uses: list[Use],
    ticking: Sequence[Ticker],
    duration: float | None,
) -> tuple[Schedule, dict[str, Ticks], dict[str, int]]:
    """The schedule, the ticks of each servo's law, and the base ticks between ticks of guides and of links' sensors, by
    path."""
    dynamics = rates.get("dynamics")
    rates_item = block.get("rates")
    body = rates_item.body if rates_item is not None else None
    for use in uses:
        if use.rate is None and use.has_law and body is not None and "servos" not in body.items:
            assert rates_item is not None
            scope.complaints.missing(
                rates_item.place,
                ("servos",),
                "D118",
                "no rate of the servos",
                help=_add(
                    rates_item, "servos = 1 kHz;", "write `servos = 1 kHz;`, or a `rate` in each servo's definition"
                ),
            )
    if dynamics is None:  # already reported: nothing is said of rates, and what does not depend on them is looked at
        ticks = {use.joint: Ticks(1, continuous=False) for use in uses}
        return Schedule(ANY_RATE, 1, 1, ANY_RATE), ticks, dict.fromkeys((ticker.path for ticker in ticking), 1)
    shared = rates.get("servos")
    own = [rate for rate in (*(use.rate for use in uses), *(ticker.rate for ticker in ticking)) if rate is not None]
    others = [rate for rate in (shared, *own) if rate is not None and rate.hz != CONTINUOUS]
    record = rates.get("record") or dynamics
    everyone = [dynamics, record, *others]
    base = rates.get("base") or max(everyone, key=lambda rate: rate.hz)  # the first of the fastest
    item = block.get("duration")
    written = "base" in rates
    schedule = make_schedule(
        scope.complaints,
        dynamics,
        record,
        base,
        others,
        duration,
        item.value_place if item is not None else run.place,
        base_written=written,
    )
    ticks = {}
    for use in uses:
        rate = use.rate or (shared if use.has_law else None) or dynamics
        continuous = rate.hz == CONTINUOUS
        if continuous and use.servo.clocked:
            scope.complaints.error(
                "D106",
                f"the law of `{use.servo.name}` needs a clock: it cannot be continuous",
                rate.place,
                also=[Label(use.place, "used here")],
                help="write a rate in Hz",
            )
        for sensor in use.sensors if continuous else ():
            if models.find("sensor", sensor.model).clocked and sensor.place is not None:
                reads = f"{with_article(sensor.model, quoted=True)} reads at ticks"
                scope.complaints.error(
                    "D106",
                    f"{reads}, and the law of joint `{use.joint}` is continuous",
                    sensor.place,
                    also=[Label(rate.place, "continuous")],
                    help="write a rate in Hz, or `low_pass` for a sensor that is analog",
                )
        if continuous:
            rate = dynamics
        ticks[use.joint] = Ticks(divisor(scope.complaints, rate, base, everyone, written=written), continuous)
    own_ticks = dict.fromkeys((ticker.path for ticker in ticking), schedule.dynamics)
    for ticker in (ticker for ticker in ticking if ticker.ticks):
        rate_of_own = rate_of(scope, ticker, shared)
        if rate_of_own is not None:
            if (exact(dynamics.hz) / exact(rate_of_own.hz)).denominator > 1:
                report_between_steps(scope, ticker, rate_of_own, dynamics)
                continue
            own_ticks[ticker.path] = divisor(scope.complaints, rate_of_own, base, everyone, written=written)
            if isinstance(ticker, Guiding):
                check_period(scope, ticker, rate_of_own)
    if record.hz > dynamics.hz:
        scope.complaints.remark(
            "D167",
            f"`record` is faster than the dynamics: rows repeat, {record.hz / dynamics.hz:g} for each step",
            record.place,
            also=[Label(dynamics.place, "a step of the dynamics")],
            help="record at the rate of the dynamics, or slower",
        )
    if shared is not None and shared.hz != CONTINUOUS and not uses:
        divisor(scope.complaints, shared, base, everyone, written=written)
    return schedule, ticks, own_ticks
