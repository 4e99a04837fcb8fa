"""The lines that `met bed size` prints."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from textwrap import wrap

from batch.beds.bed_size import BedSize
from batch.beds.sizing import UNITS, Extreme, MotorFigures, PartCheck, PartVerdict
from batch.queries.bed_margins import in_words
from ic.printing.columns import columns, count
from met.analysis.margin import remedy

WORDS = {
    "torque_rms": "torque, continuous",
    "torque_peak": "torque, peak",
    "rate": "rate",
    "power_mean": "power, continuous",
    "power_peak": "power, peak",
    "returned_peak": "returned, peak",
    "returned_energy": "returned in a case",
    "current_rms": "current, continuous",
    "current_peak": "current, peak",
    "voltage": "voltage",
}
WIDTH = 100
RPM = 30.0 / math.pi
ROLES = ("drive", "load")


def size_lines(size: BedSize, *, named: bool, curves: bool = False) -> Iterator[str]:
    """The sizes in lines. named: whether the parts were named;  curves: with the torque-speed curves."""
    figures, several = size.figures, size.experiment.varies
    duration = size.experiment.structure.schedule.duration
    yield (
        f"{size.experiment.name}: a bed for joint `{size.joint}`, {count(figures.cases, 'case')} of {duration:g} s, "
        f"{count(figures.instants, 'instant')} each"
    )
    for role, motor in zip(ROLES, (figures.drive, figures.load), strict=True):
        yield ""
        rows = [[f"{role} motor", "at most", f"order, x {size.margin:g}", "where"]]
        for name, extreme in motor.extremes.items():
            least = size.margin * extreme.value
            also = f" = {_digits(RPM * least)} rpm" if name == "rate" else ""
            unit = UNITS[name]
            rows.append(
                [WORDS[name], _with(extreme.value, unit), _with(least, unit) + also, _where(name, extreme, several)]
            )
        yield from columns(rows, right=(1,))
        if curves:
            yield from _curves(motor)
    yield ""
    yield from columns(list(_rest(size, several)))
    yield ""
    yield from _named(size, several) if named else _listed(size)
    yield ""
    for note in size.notes:
        yield from wrap(note, WIDTH, initial_indent="  ", subsequent_indent="    ")


def _curves(motor: MotorFigures) -> Iterator[str]:
    """The required torque at a rate or above, driving and braking."""
    rows = [["at or above", "driving", "braking"]]
    for rate, driving, braking in zip(motor.rates, *map(motor.envelope, ("driving", "braking")), strict=True):
        rows.append([_with(rate, "rad/s"), _with(driving, "N*m"), _with(braking, "N*m")])
    yield from columns(rows, right=(0, 1, 2), indent="    ")


def _rest(size: BedSize, several: bool) -> Iterator[Sequence[str]]:
    """Rows of figures that belong to both motors."""
    figures, own = size.figures, size.filter.own
    (light, heavy), (least, most) = figures.arm, figures.ratio
    yield (
        "arm at the shaft",
        f"{_with(light.value, 'kg*m^2')} ({_place(light, several)}) to {_with(heavy.value, 'kg*m^2')} "
        f"({_place(heavy, several)})",
    )
    yield "", f"r = {_digits(least.value)} to {_digits(most.value)} of the joint's rotor, {_span(figures.rotor)}"
    whose = "the deck's bed, both rotors" if size.in_deck else "the joint's rotor alone: a load's adds to it"
    yield "shaft", f"{_span(figures.shaft)}, {whose}"
    peak, energy = figures.both["returned_peak"], figures.both["returned_energy"]
    yield "returned", "on a supply each, what is said above, into its brake resistor or capacitors;"
    of_both = f"{_with(peak.value, 'W')}{_in(peak, several)}" if peak.value else "0 W"
    yield "", f"on one supply at most {of_both}, and {_with(energy.value, 'J')} in a case, less what windings take"
    bare, all_of_them = size.bauds
    yield "line", f"{size.exchanges.hz:,g} exchanges a second, for a servo of {size.exchanges.servo_hz:g} Hz:"
    yield "", f"at least {bare} baud, with all sensors {all_of_them}"
    bed = "the deck's bed" if size.in_deck else f"a bed by itself, delay = {own.delay:g}"
    yield "loop", f"{in_words(own)};"
    yield "", bed if own.stable else f"{bed}: NOT STABLE, {remedy(own)} may help"
    yield "filter", _filter(size)


def _filter(size: BedSize) -> str:
    """The cut-offs at which the loop is stable, in words."""
    tried, good = [f_cut for f_cut, _ in size.filter.tried], size.filter.good
    cut_off = f"{size.filter.f_cut:g} Hz here; " if math.isfinite(size.filter.f_cut) else ""
    ends = f"{_digits(tried[0])} to {_digits(tried[-1])} Hz"
    margin = f"with a margin of {size.margin:g} of r"
    if len(good) == len(tried):
        return f"{cut_off}stable {margin} at all of {ends}"
    if not good:
        return f"{cut_off}stable {margin} at none of {ends}"
    words = " to ".join(dict.fromkeys(_digits(end) for end in (good[0], good[-1]))) + " Hz"
    whole = good == tuple(tried[tried.index(good[0]) : tried.index(good[-1]) + 1])
    return f"{cut_off}stable {margin} at {words}{'' if whole else ', not all of them'}, of {ends} that were tried"


def _named(size: BedSize, several: bool) -> Iterator[str]:
    """The verdicts of named parts, check by check."""
    for verdict in size.verdicts:
        yield f"  {verdict.role} {verdict.part.name}: {_verdict(verdict)}"
        rows = [
            [
                check.what,
                _with(check.required, check.unit),
                "of",
                _with(check.has, check.unit),
                f"{100.0 * check.share:.0f} %",
                _in(check.extreme, several).removeprefix(", "),
            ]
            for check in sorted(verdict.checks, key=lambda check: -check.share)
        ]
        yield from columns(rows, right=(1, 3, 4), indent="    ")
        yield f"    source: {verdict.part.source}"
        yield from wrap(verdict.part.note, WIDTH, initial_indent="    ", subsequent_indent="    ")


def _listed(size: BedSize) -> Iterator[str]:
    """All parts by role, fitting ones first and the tightest of them before; then benches, both motors on a shaft."""
    rows = [["part", "", "fits", "what binds"]]
    for role in ROLES:
        of_role = [verdict for verdict in size.verdicts if verdict.role == role]
        for number, verdict in enumerate(sorted(of_role, key=lambda verdict: (not verdict.fits, _order(verdict)))):
            rows.append([role if number == 0 else "", verdict.part.name, _fits(verdict), _binding(verdict)])
    for name, two in size.benches.items():
        worst = max(two, key=lambda verdict: (not verdict.fits, _share(verdict)))
        names = " with ".join(dict.fromkeys(verdict.part.name for verdict in two))
        rows.append([f"bench {name}", names, _fits(worst), f"{worst.role}, {_binding(worst)}"])
    yield from columns(rows)


def _order(verdict: PartVerdict) -> float:
    return -_share(verdict) if verdict.fits else _share(verdict)


def _fits(verdict: PartVerdict) -> str:
    return {True: "yes", False: "NO", None: "?"}[verdict.fits]


def _binding(verdict: PartVerdict) -> str:
    """The figure that binds, or those that its source leaves out."""
    if verdict.fits is None or verdict.binds is None:
        return f"not given: {', '.join(verdict.missing)}"
    return _check(verdict.binds)


def _verdict(verdict: PartVerdict) -> str:
    if verdict.fits is None:
        return f"not known, for its source does not give: {', '.join(verdict.missing)}"
    assert verdict.binds is not None
    return f"{'fits' if verdict.fits else 'DOES NOT FIT'}; what binds is {_check(verdict.binds)}"


def _share(verdict: PartVerdict) -> float:
    return 0.0 if verdict.binds is None else verdict.binds.share


def _check(check: PartCheck) -> str:
    """One check in words: `torque, peak: 0.3 of 1.1 N*m, 27 %`."""
    return f"{check.what}: {_digits(check.required)} of {_with(check.has, check.unit)}, {100.0 * check.share:.0f} %"


def _where(name: str, extreme: Extreme, several: bool) -> str:
    """The place of an extreme in words, `#3, 0.16 s, at 8.77 rad/s`: case, instant and operating point."""
    if extreme.value == 0.0:
        return "never"
    place = _place(extreme, several)
    if extreme.torque is None or extreme.rate is None:
        return place
    point = {
        "torque_peak": f"at {_with(abs(extreme.rate), 'rad/s')}",
        "current_peak": f"at {_with(abs(extreme.rate), 'rad/s')}",
        "rate": f"at {_with(abs(extreme.torque), 'N*m')}",
    }.get(name, f"at {_with(abs(extreme.torque), 'N*m')} and {_with(abs(extreme.rate), 'rad/s')}")
    return f"{place}, {point}"


def _place(extreme: Extreme, several: bool) -> str:
    case, time = f"#{extreme.case}" if several else "", "" if extreme.time is None else f"{extreme.time:.6g} s"
    return ", ".join(part for part in (case, time) if part)


def _in(extreme: Extreme, several: bool) -> str:
    place = _place(extreme, several)
    return f", {place}" if place else ""


def _span(ends: tuple[float, float]) -> str:
    low, high = (_digits(end) for end in ends)
    return f"{low} kg*m^2" if low == high else f"{low} to {high} kg*m^2"


def _digits(value: float) -> str:
    """Four digits; a number that is only rounding is 0."""
    return f"{0.0 if abs(value) < 1e-12 else value:.4g}"


def _with(value: float, unit: str) -> str:
    return f"{_digits(value)} {unit}"
