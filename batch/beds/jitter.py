"""`met bed jitter`: the lateness and duration of exchanges with a bed, as histograms. It never arms."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from batch.beds.chosen_bed import ChosenBed, chosen_bed
from hw.drivers import kind_of
from hw.driving.case import pace_of
from hw.driving.jitter import JitterRequest
from hw.driving.process import talk
from hw.driving.timing import EDGES
from ic.printing.columns import columns
from met.diagnostic import Problem, error
from met.messages.visible import say
from met.plan import Plan
from met.plan import file as plan_file

HZ, SECONDS = 1000.0, 10.0
"""Rate (Hz) and length (s) of a measurement where neither the user nor a deck gives one."""

WIDTH = 40
"""Length of the longest bar, characters."""

_SPREADS = (("lateness", "late"), ("trip", "answered in"))
_FIGURES = (("median", "median"), ("high", "p99"), ("highest", "p99.9"), ("largest", "max"))


def measured(
    bed: ChosenBed, baud: int, hz: float | None, seconds: float, joints: int
) -> tuple[dict[str, Any], list[str]]:
    """Measure the timing at a port. Returns the figures for programs, and the process's lines about the measurement.
    Raises Problem."""
    kind = kind_of(bed.port)
    if kind.simulated and kind.lock_step(bed.port, False):
        message = "an emulated bed has no time of its own, so that nothing can be late"
        raise Problem(error("E426", message, help="`--port firmware` has one, over a pseudo-terminal"))
    rate = hz or (HZ if bed.experiment is None else pace_of(bed.experiment).hz)
    simulated = bed.simulated
    plan = "" if simulated is None else plan_file.dumps(Plan("", (simulated,)))
    question = JitterRequest(bed.port, rate, seconds, joints, baud, plan, bed.joint)
    heard = list[str]()
    about, measurement = dict[str, Any](), dict[str, Any]()
    for line in talk("hw.driving.jitter", question, heard.append, until="kept", goes_on=True):
        about = line.get("about", about)
        measurement = line.get("kept", measurement)
    timing = measurement["timing"]
    return {
        "port": bed.port,
        **about,
        "rate_hz": rate,
        "joints": joints,
        "seconds": measurement["seconds"],
        "exchanges": timing["exchanges"],
        **{name: _spread(timing[name]) for name, _ in _SPREADS},
        "misses": {name: timing[name] for name in ("woken", "computed", "waited", "unanswered")},
        "stops": measurement["stops"],
        "clock": timing["drift"] if math.isfinite(timing["drift"]) else None,
    }, heard


def jitter_and_tell(
    word: str,
    source: str | None,
    names: tuple[str, ...],
    *,
    baud: int,
    rate: float | None,
    duration: float,
    joints: int,
    form: str,
    quiet: bool = False,
    verbose: bool = False,
    **options: Any,
) -> bool:
    """Run `met bed jitter`. Returns True where no run would have been stopped. Raises Problem."""
    data, warnings = measured(chosen_bed(word, source, names, quiet=quiet, **options), baud, rate, duration, joints)
    if form == "json":
        say(json.dumps({**data, "warnings": warnings}, indent=2))
    elif not quiet:
        say("\n".join([*lines(data), *(f"  {warning}" for warning in warnings)]))
    return not data["stops"]


def lines(data: Mapping[str, Any]) -> list[str]:
    """The figures of `met bed jitter` for people, line by line: how late exchanges with the bed began, and how long
    they took."""
    misses = data["misses"]
    each_period = "" if data["joints"] == 1 else f" in {data['joints']} each period"
    out = [
        f"bed `{data['name']}` at {data['port']}, not armed: {data['exchanges']:,} exchanges{each_period} at "
        f"{data['rate_hz']:g} Hz in {data['seconds']:.3g} s"
    ]
    for name, words in _SPREADS:
        spread = data[name]
        figures = ", ".join(f"{label} {duration(spread[figure])}" for figure, label in _FIGURES)
        out += ["", f"{words}: {figures}", *histogram(spread["histogram"])]
    late = sum(misses[name] for name in ("woken", "computed", "waited"))
    out += [
        "",
        f"a period late: {late:,} (woken too late {misses['woken']:,}, computing {misses['computed']:,}, "
        f"waiting {misses['waited']:,}); unanswered: {misses['unanswered']:,}",
    ]
    times = "never" if not data["stops"] else "once" if data["stops"] == 1 else f"{data['stops']:,} times"
    out.append(f"a run would have been stopped {times}, by five periods of lateness or silence")
    if data["clock"] is not None:
        out.append(f"the bed's clock against the computer's: {off(data['clock'])}")
    return out


def histogram(stretches: Sequence[Mapping[str, Any]]) -> list[str]:
    """A bar for each bin from the first to the last non-empty one. A bin with any count has a visible bar."""
    full = [number for number, bin_ in enumerate(stretches) if bin_["count"]]
    if not full:
        return ["  (none)"]
    shown_bins = stretches[full[0] : full[-1] + 1]
    most = max(bin_["count"] for bin_ in shown_bins)
    rows = []
    for bin_ in shown_bins:
        eighths = max(round(8 * WIDTH * bin_["count"] / most), 1) if bin_["count"] else 0
        whole, rest = divmod(eighths, 8)
        upto = f">= {duration(bin_['from'])}" if bin_["to"] is None else f"< {duration(bin_['to'])}"
        rows.append([upto, f"{bin_['count']:,}", "█" * whole + " ▏▎▍▌▋▊▉"[rest].strip()])
    return columns(rows, right=(0, 1))


def duration(seconds: float | None) -> str:
    """A time in words: `2.5 us`, `1.2 ms`, `3 s`, three digits; `-` where it is not known."""
    if seconds is None or math.isnan(seconds):
        return "-"
    for scale, unit in ((1e-6, "us"), (1e-3, "ms")):
        if float(f"{seconds:.3g}") < 1000.0 * scale * (1.0 - 1e-12):
            return f"{seconds / scale:.3g} {unit}"
    return f"{seconds:.3g} s"


def off(share: float) -> str:
    """The drift of a clock in words: `+12.3 ppm`; from 1 % on in percent."""
    if math.isnan(share):
        return "not known"
    if abs(share) >= 0.01:
        return f"{1e2 * share:+.3g} %"
    ppm = round(1e6 * share, 2) + 0.0  # no -0
    return f"{ppm:+,.0f} ppm" if abs(ppm) >= 100.0 else f"{ppm:+.3g} ppm"


def _spread(spread: Mapping[str, Any]) -> dict[str, Any]:
    """The figures of a duration's spread for JSON, s, with its histogram."""
    edges = [0.0, *EDGES, None]
    return {
        **{name: spread[name] if math.isfinite(spread[name]) else None for name, _ in _FIGURES},
        "histogram": [
            {"from": edges[number], "to": edges[number + 1], "count": count}
            for number, count in enumerate(spread["counts"])
        ],
    }
