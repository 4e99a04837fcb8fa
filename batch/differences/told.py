"""`met diff` in words: what made the two, status first, then signals and metrics, then the worst cases."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from batch.differences.compare import DIFFERENT, EQUIVALENT, IDENTICAL, INCOMPARABLE
from batch.differences.found import Diff, Ended, Experiment, Ranked, Signal
from batch.differences.samples import LEVEL
from batch.failures import STATUS, ranges
from batch.output import quoted
from batch.signals import number_text, pretty_unit
from ic.printing.columns import columns

MOST_LINES = 12
"""Of one kind of change."""

SHOWN_ENDED, SHOWN_WORST = 8, 5


def told(found: Diff) -> list[str]:
    """All of it, for people."""
    out = [f"a  {found.a}", f"b  {found.b}", *_changed(found)]
    for name, where in ((name, found.a) for name in found.only_a):
        out += ["", f"`{name}` is only in {where}"]
    for name, where in ((name, found.b) for name in found.only_b):
        out += ["", f"`{name}` is only in {where}"]
    for experiment in found.experiments:
        out += ["", *_experiment(found, experiment)]
    return [*out, "", _verdict(found)]


def _changed(found: Diff) -> Iterator[str]:
    changed = found.changed
    said = [
        *(f"versions   {line}" for line in changed.versions),
        *(f"code       the program of `{name}` is another" for name in changed.code),
        *(f"structure  of `{name}` is another: bits cannot be expected to agree" for name in changed.structure),
        *_few("deck      ", changed.decks),
        *_few("changed   ", changed.meaning),
        *_few("new       ", changed.defaults),
    ]
    yield ""
    if not said:
        yield "made from the same: deck, parameters, models and versions"
    for line in said:
        yield f"  {line}"


def _few(head: str, lines: Sequence[str]) -> list[str]:
    out = [f"{head} {line}" for line in lines[:MOST_LINES]]
    return out + ([f"{head} and {len(lines) - MOST_LINES} more"] if len(lines) > MOST_LINES else [])


def _experiment(found: Diff, experiment: Experiment) -> list[str]:
    names = dict.fromkeys([experiment.name_a, experiment.name_b])
    out = [f"{' and '.join(names)}: {experiment.cases.count:,} cases in both, {experiment.verdict}"]
    for cases, where in ((experiment.only_a, found.a), (experiment.only_b, found.b)):
        if cases:
            out.append(f"  {len(cases):,} case{'s' if len(cases) > 1 else ''} only in {where}: {ranges(cases)}")
    out += _ended(experiment)
    out += [f"  note: {note}" for note in experiment.notes]
    for text, before, after in experiment.requirements:
        if before != after:
            out.append(f"  require {text}  met by {before:,}, now by {after:,} of {experiment.cases.count:,}")
    out += _signals(experiment.signals)
    out += _samples(experiment)
    out += _worst(found, experiment.worst)
    return out


def _ended(experiment: Experiment) -> Iterator[str]:
    """Cases that end otherwise, in kinds: what fails now comes first."""
    kinds: dict[str, list[Ended]] = {}
    for each in experiment.ended:
        if each.before == each.after:
            kind = f"{STATUS.get(each.after, 'failed')} earlier or later"
        elif each.before == 0:
            kind = "fail that did not" if each.after == 1 else f"are {STATUS.get(each.after, 'failed')} that were done"
        elif each.after == 0:
            kind = "are done that failed" if each.before == 1 else f"are done that were {STATUS[each.before]}"
        else:
            kind = f"are {STATUS.get(each.after)} that were {STATUS.get(each.before)}"
        kinds.setdefault(kind, []).append(each)
    for kind in sorted(kinds, key=lambda kind: not kind.startswith(("fail", "are timed", "are lost"))):
        cases = kinds[kind]
        yield f"  {len(cases):,} case{'s' if len(cases) > 1 else ''} {_one(kind, len(cases))}: " + ranges(
            sorted(each.case for each in cases)
        )
        for each in cases[:SHOWN_ENDED]:
            cause = each.cause_after or each.cause_before
            when = "" if each.after else "before: "
            yield f"    #{each.case} {each.case_id[:8]}  {when}{cause}"
        if len(cases) > SHOWN_ENDED:
            yield f"    and {len(cases) - SHOWN_ENDED:,} more"


def _one(kind: str, count: int) -> str:
    return kind if count > 1 else kind.replace("fail that", "fails that").replace("are ", "is ").replace("were", "was")


def _signals(signals: Sequence[Signal]) -> list[str]:
    if not signals:
        return []
    rows = [["", "", "cases", "largest", "", "of range", "where", "first", "tolerance"]]
    rows += [_row(signal) for signal in signals]
    used = [column for column in range(len(rows[0])) if column < 3 or any(row[column] for row in rows[1:])]
    right = [used.index(column) for column in (3, 5) if column in used]
    return columns([[row[column] for column in used] for row in rows], right=right)


def _row(signal: Signal) -> list[str]:
    if signal.verdict == INCOMPARABLE:
        return [signal.name, INCOMPARABLE, signal.why, "", "", "", "", "", ""]
    unit = pretty_unit(signal.unit).removesuffix("1") if signal.unit != "1" else ""
    count = {DIFFERENT: signal.different, EQUIVALENT: signal.equivalent}.get(signal.verdict, signal.compared)
    cases = f"{count:,} of {signal.compared:,}" if signal.verdict != IDENTICAL else f"{signal.compared:,}"
    if signal.verdict == IDENTICAL:
        return [signal.name, IDENTICAL, cases, "", "", "", "", "", ""]
    place = signal.place
    where = first = ""
    if place is not None:
        where = " ".join(part for part in (place.label, f"#{place.case}") if part)
        where += f" at {place.time:g} s" if place.time == place.time else ""
    begins = signal.first_beyond if signal.different else signal.first
    if begins < float("inf"):
        first = f"{begins:g} s"
    largest = number_text(signal.largest) if signal.largest or not signal.nan else ""
    share = f"{number_text(float(f'{100 * signal.share:.2g}'))} %" if 0.0 < signal.share < float("inf") else ""
    if signal.nan:
        where = f"{signal.nan:,} not-a-number on one side" + (f", {where}" if where else "")
    unit = unit if largest else ""
    return [signal.name, signal.verdict, cases, largest, unit, share, where, first, _tolerance(signal)]


def _tolerance(signal: Signal) -> str:
    given = signal.tolerance
    if not given.given:
        return ""
    words = []
    if given.absolute:
        words.append(f"{given.absolute:g} {pretty_unit(signal.unit)}".strip())
    if given.relative:
        words.append(f"rel {given.relative:g}")
    if given.time:
        words.append(f"time {given.time:g} s")
    used = f", {100 * signal.used:.3g} % used" if signal.used < float("inf") else ""
    return " + ".join(words) + used


def _samples(experiment: Experiment) -> list[str]:
    if not experiment.samples:
        return []
    rows = [["  as distributions", "cases", "", "median", "", "distance", "by chance"]]
    for each in experiment.samples:
        chance = f"{each.probability:.2g}" + (" *" if each.unlike else "")
        rows.append([f"  {each.name}", f"{each.cases[0]:,}", f"{each.cases[1]:,}", number_text(each.medians[0]),
                     number_text(each.medians[1]), f"{each.distance:.3g}", chance])  # fmt: skip
    note = f"  * less than {LEVEL:g}, corrected for {len(experiment.samples)} metrics (Kolmogorov-Smirnov, Holm)"
    return ["", *columns(rows, right=range(1, 7)), *([note] if any(each.unlike for each in experiment.samples) else [])]


def _worst(found: Diff, worst: Sequence[Ranked]) -> list[str]:
    if not worst:
        return []
    out = ["", "  worst cases, each with what runs it again:"]
    for each in worst[:SHOWN_WORST]:
        where = f" of {each.place.label}" if each.place.label else ""
        when = f" at {each.place.time:g} s" if each.place.time == each.place.time else ""
        values = ", now ".join(apart(each.place.before, each.place.after))
        out.append(f"    #{each.case_b} {each.case_id[:8]}  {each.signal}{where}{when}: {values}")
        again = [f"met run {quoted(path)} --case '#{case}'" for path, case in
                 ((found.a, each.case_a), (found.b, each.case_b))]  # fmt: skip
        out.append(f"      {'; '.join(again)}")
    return out


def apart(before: float, after: float) -> tuple[str, str]:
    """Two numbers in as few digits as tell them apart, but four at least."""
    for digits in range(4, 18):
        texts = f"{before:.{digits}g}", f"{after:.{digits}g}"
        if texts[0] != texts[1]:
            break
    return texts


def _verdict(found: Diff) -> str:
    said = {
        IDENTICAL: "identical, to the bit",
        EQUIVALENT: "equivalent: bits differ, and no value by more than its tolerance",
        DIFFERENT: "different",
        INCOMPARABLE: "incomparable",
    }[found.verdict]
    given = found.tolerances
    if found.verdict in (EQUIVALENT, DIFFERENT) and not given.given:
        said += "; no tolerance was given"
    return said
