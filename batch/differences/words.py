"""Differences in words, part by part, as plain data, which `text` sets in lines and a report in a page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

from batch.differences import paired
from batch.differences.compare import DIFFERENT, EQUIVALENT, IDENTICAL, INCOMPARABLE
from batch.differences.result import Diff, EndingDiff, ExperimentDiff, RankedCase, RequirementDiff, SignalDiff
from batch.differences.samples import LEVEL, MetricSamples
from batch.queries.evidence_table import texts_of
from batch.queries.pool import STATUS, ranges
from batch.queries.signals import number_text
from ic.printing.columns import count
from met.frozen import frozen
from met.messages.visible import visible
from met.outputs import quoted

EVIDENCE = "requirements over cases"
"""The heading of `evidence_lines`."""

PAIRED = "metrics, case by case"
"""The heading of metrics compared in pairs of the same cases."""

SMALLEST = 1e-9
"""Smallest probability that is printed exactly."""

SAME = "made from the same: deck, parameters, models and versions"


def provenance_lines(difference: Diff) -> list[tuple[str, tuple[str, ...]]]:
    """Differences in provenance: kind and lines of each, causes before effects. An indented line belongs to the one
    above."""
    changed = difference.changed
    why = ": constants are part of it" if changed.meaning or changed.structure else ""
    lines_of = [
        ("versions", changed.versions),
        ("deck", tuple(text for deck in changed.decks for text in (deck.said, *(f"  {line}" for line in deck.lines)))),
        ("changed", changed.meaning),
        ("follows", changed.follows),
        ("new", changed.defaults),
        ("structure", tuple(f"that of `{name}` is another" for name in changed.structure)),
        (
            "code",
            (
                *(f"the program of `{name}` is another{why}" for name in changed.code),
                *(f"`{what}` of `{name}` is computed otherwise" for name, what in changed.results),
            ),
        ),
        ("kept", changed.kept),
    ]
    return [(kind, tuple(map(visible, lines))) for kind, lines in lines_of if lines]


def unmatched_runs(difference: Diff) -> list[str]:
    """Runs and sweeps that only one archive has."""
    both = ((difference.only_a, difference.a), (difference.only_b, difference.b))
    return [f"`{name}` is only in {where}" for names, where in both for name in names]


def heading(experiment: ExperimentDiff) -> str:
    """The names of a pair of experiments, the number of their common cases, and the verdict on these."""
    names = dict.fromkeys([experiment.name_a, experiment.name_b])
    how = experiment.of_values
    if how != experiment.verdict:
        how = f"{how}, with other requirements"
    return f"{' and '.join(names)}: {count(experiment.cases.count, 'case')} in both, {how}"


def unmatched_cases(difference: Diff, experiment: ExperimentDiff) -> list[str]:
    """Cases that only one archive has."""
    return [
        f"{count(len(cases), 'case')} only in {where}: {ranges(cases)}"
        for cases, where in ((experiment.only_a, difference.a), (experiment.only_b, difference.b))
        if cases
    ]


def tolerance_lines(difference: Diff, experiment: ExperimentDiff) -> list[str]:
    """The tolerances, and their sources."""
    mine, every = set(difference.tolerances.words()), experiment.tolerances.words()
    both = (("the deck of b", [word for word in every if word not in mine]), ("--tol", sorted(mine & set(every))))
    return [f"{who} allows {', '.join(what)}" for who, what in both if what]


def requirement_lines(experiment: ExperimentDiff) -> list[str]:
    """Lines about requirements that have changed, or are met by another number of cases."""
    cases = experiment.cases.count
    return [
        f"require {requirement_text(requirement)}  "
        f"{met_by_text(requirement.met_before, requirement.met_now, cases)}{pairs_text(requirement)}"
        for requirement in experiment.requirements
        if requirement.has_changed
    ]


def evidence_pairs(experiment: ExperimentDiff) -> Iterator[tuple[str, str]]:
    """Requirements over a share of cases of which the archives show different things, and the change, in words."""
    for change in experiment.evidence:
        before, now = texts_of(change.before), texts_of(change.now)
        named = (("", "verdict"), ("of all cases ", "of_all"), ("margin ", "margin"), ("in sigmas ", "sigmas"))
        pairs = [(name, getattr(before, field), getattr(now, field)) for name, field in named]
        if change.now.share is None or all(before_text == other for _, before_text, other in pairs):
            continue
        texts = [
            f"{name}{before_text}" if before_text == other else f"{name}{before_text}, now {other}"
            for name, before_text, other in pairs
        ]
        condition = f", {change.now.at}" if change.now.at else ""
        yield (f"{change.now.requirement}{condition}", "; ".join(texts))


def pairs_text(requirement: RequirementDiff) -> str:
    """The end of a line: the number of cases that meet it in only one archive, where that says more than how many meet
    it in each, and whether it is more than chance, where cases were drawn."""
    if not requirement.gained + requirement.lost or (
        math.isnan(requirement.chance) and not requirement.gained * requirement.lost
    ):
        return ""
    return f"; {requirement.gained:,} gained, {requirement.lost:,} lost{_chance(requirement.chance)}"


def paired_metrics(experiment: ExperimentDiff) -> list[str]:
    """For each metric that differs in several cases, the numbers of cases in which it rose and fell, and whether that
    is more than chance, where cases were drawn."""
    return [
        f"{signal.name} rose in {signal.higher:,} of {signal.compared:,}, "
        f"fell in {signal.lower:,}{_chance(signal.chance)}"
        for signal in experiment.signals
        if signal.metric and not signal.why and signal.compared > 1 and signal.higher + signal.lower
    ]


def _chance(chance: float) -> str:
    """A probability by chance, and whether the difference is shown by it: `: not shown (p = 0.25)`; empty where it was
    not tested."""
    if math.isnan(chance):
        return ""
    size = f"= {chance:.2g}" if chance >= SMALLEST else f"< {SMALLEST:g}"
    return f": {'shown' if chance < paired.LEVEL else 'not shown'} (p {size})"


def requirement_text(requirement: RequirementDiff) -> str:
    """A requirement, with its former text where it has changed."""
    before, now = requirement.limits
    text = (
        requirement.now
        if requirement.before == requirement.now
        else f"{requirement.now} (before: {requirement.before})"
    )
    return f"{text} (limit before: {before}, now: {now})" if now else text


def met_by_text(before: int, now: int, total: int) -> str:
    """The numbers of common cases that meet a requirement, in words."""
    return f"met by {before:,}, now by {now:,} of {total:,}"


@frozen
class Ending:
    """Cases with the same change of ending: the change, the cases, and each of them."""

    text: str
    cases: str
    case_endings: tuple[EndingDiff, ...]


def endings(experiment: ExperimentDiff) -> list[Ending]:
    """Group the cases with another ending by the change; those that fail now come first."""
    kinds: dict[str, list[EndingDiff]] = {}
    for ending in experiment.ended:
        kinds.setdefault(_kind(ending), []).append(ending)
    order = sorted(kinds, key=lambda kind: not kind.startswith(("fail", "are timed", "are lost")))
    return [
        Ending(
            f"{count(len(cases), 'case')} {_of_one(kind, len(cases))}",
            ranges(sorted(case.case for case in cases)),
            tuple(cases),
        )
        for kind, cases in ((kind, kinds[kind]) for kind in order)
    ]


def _kind(ending: EndingDiff) -> str:
    """The change between two endings of a case, in words: `fail that did not`."""
    if ending.before == ending.after:
        return f"{STATUS.get(ending.after, 'failed')} earlier or later"
    if ending.before == 0:
        return "fail that did not" if ending.after == 1 else f"are {STATUS.get(ending.after, 'failed')} that were done"
    if ending.after == 0:
        return "are done that failed" if ending.before == 1 else f"are done that were {STATUS[ending.before]}"
    return f"are {STATUS.get(ending.after)} that were {STATUS.get(ending.before)}"


def _of_one(kind: str, count: int) -> str:
    return kind if count > 1 else kind.replace("fail that", "fails that").replace("are ", "is ").replace("were", "was")


def cause(ending: EndingDiff) -> str:
    """The cause of the ending, now or before."""
    return f"{'' if ending.after else 'before: '}{ending.cause_after or ending.cause_before}"


@frozen
class SignalRow:
    """A signal or a metric as a row of the table of `met diff` and of the report; texts, "" for what there is not.

    cases      how many, of how many
    largest    the largest difference, in `unit`
    share      of it, in what the values of a span
    where      it is, and in which `case`
    by_step    of a metric, the sum of both archives' errors by the step, in `unit`
    first      the earliest difference, with its unit
    tolerance  what was given, and how much of it was used
    """

    name: str
    verdict: str
    cases: str
    largest: str = ""
    unit: str = ""
    share: str = ""
    by_step: str = ""
    where: str = ""
    first: str = ""
    tolerance: str = ""
    case: int | None = None


@frozen
class DiffColumn:
    """A column of the table of signals, for the terminal and for the page alike.

    field       of `SignalRow`
    head        above it in the terminal;  page_head  in the report
    unit        the field that has the unit of its numbers; "" for none
    kind        how it is set: "number" flush right, "words" with room to wrap
    always      True where it is shown even if every cell is empty
    """

    field: str
    head: str
    page_head: str
    unit: str = ""
    kind: Literal["", "number", "words"] = ""
    always: bool = False


SIGNAL_COLUMNS = (
    DiffColumn("name", "", "signal or metric", always=True),
    DiffColumn("verdict", "", "verdict", always=True),
    DiffColumn("cases", "cases", "cases", always=True),
    DiffColumn("largest", "largest", "largest difference", unit="unit", kind="number"),
    DiffColumn("share", "of range", "of range", kind="number"),
    DiffColumn("by_step", "by the step", "error by the step", kind="number"),
    DiffColumn("where", "where", "where", kind="words"),
    DiffColumn("first", "first", "first"),
    DiffColumn("tolerance", "tolerance", "tolerance", kind="words"),
)


def signal_columns(rows: Sequence[SignalRow]) -> list[DiffColumn]:
    """The columns that are not empty in these rows."""
    return [column for column in SIGNAL_COLUMNS if column.always or any(getattr(row, column.field) for row in rows)]


def signal_row(signal: SignalDiff) -> SignalRow:
    """The row of a signal or metric, in the unit for people."""
    if signal.verdict == INCOMPARABLE:
        return SignalRow(signal.name, INCOMPARABLE, signal.why)
    if signal.verdict == IDENTICAL:
        return SignalRow(signal.name, IDENTICAL, f"{signal.compared:,}")
    unit = signal.deck_unit if signal.largest < float("inf") else ""
    unlike = signal.different or signal.equivalent
    place = signal.place
    where = first = ""
    if place is not None:
        where = " ".join(part for part in (place.label, f"#{place.case}") if part)
        where += f" at {place.time:g} s" if place.time == place.time else ""
    begins = signal.first_beyond if signal.different else signal.first
    if begins < float("inf"):
        first = f"{begins:g} s"
    largest = number_text(signal.largest / signal.deck_scale) if signal.largest or not signal.nan else ""
    if signal.largest == float("inf"):
        largest = "infinite on one side"
    share = f"{number_text(float(f'{100 * signal.share:.2g}'))} %" if 0.0 < signal.share < float("inf") else ""
    if signal.nan:
        where = f"{signal.nan:,} not-a-number on one side" + (f", {where}" if where else "")
    return SignalRow(
        name=signal.name,
        verdict=signal.verdict,
        cases=f"{unlike:,} of {signal.compared:,}",
        largest=largest,
        unit=unit if largest else "",
        share=share,
        by_step=_by_step(signal) if largest else "",
        where=where,
        first=first,
        tolerance=_tolerance(signal),
        case=None if place is None else place.case,
    )


def _by_step(signal: SignalDiff) -> str:
    """The errors by the step, in two digits; "" where they are not known."""
    if not math.isfinite(signal.by_step):
        return ""
    return f"± {number_text(float(f'{signal.by_step / abs(signal.deck_scale):.2g}'))}"


def step_error_note(experiment: ExperimentDiff) -> str:
    """A note on the metrics whose differences are within their errors due to the step; "" where there are none."""
    names = [f"`{signal.name}`" for signal in experiment.signals if signal.within_step_error]
    if not names:
        return ""
    single = len(names) == 1
    verb = "differs by no more than its error" if single else "differ by no more than their errors"
    return f"{', '.join(names)} {verb} by the step: with shorter steps the difference may be another"


def _tolerance(signal: SignalDiff) -> str:
    """A signal's tolerance in words, with the share of it that was used."""
    tolerance = signal.tolerance
    words = [f"{joint} {text}".lstrip() for joint, text in signal.as_written.items()]
    if len(words) > 1 or any(signal.as_written):
        words = [f"({', '.join(words)})"]
    if tolerance.relative:
        words.append(f"rel {tolerance.relative:g}")
    of_size = bool(words)
    if tolerance.time:
        words.append(f"time {tolerance.time:g} s")
    return " + ".join(words) + (_used(signal.used) if of_size else "")


def _used(share: float) -> str:
    """The share of a tolerance that was needed, as the end of its text."""
    if share == float("inf"):
        return ""
    return f", {100 * share:.3g} % used" if share <= 1.0 else f", {share:.3g} times that"


@frozen
class Distribution:
    """A metric as a sample of each archive: cases with a value, medians, distance, and its probability by chance; a
    star where that is less than `LEVEL`."""

    name: str
    cases: tuple[str, str]
    medians: tuple[str, str]
    distance: str
    chance: str

    @property
    def cells(self) -> tuple[str, ...]:
        """The row under `DISTRIBUTION_HEADS`; all cells but the first are numbers."""
        return self.name, *self.cases, *self.medians, self.distance, self.chance


DISTRIBUTION_HEADS = (
    ("as distributions", "as distributions"),
    ("cases", "cases before"),
    ("", "now"),
    ("median", "median before"),
    ("", "now"),
    ("distance", "distance"),
    ("by chance", "by chance"),
)
"""The heads of the table of distributions: in the terminal, and in the report."""


def distribution(metric: MetricSamples) -> Distribution:
    """The row of a metric that is compared as two samples, as texts; `*` marks samples that differ by more than
    chance."""
    chance = f"{metric.probability:.2g}" + (" *" if metric.unlike else "")
    cases, medians = [f"{count:,}" for count in metric.cases], [number_text(median) for median in metric.medians]
    return Distribution(metric.name, (cases[0], cases[1]), (medians[0], medians[1]), f"{metric.distance:.3g}", chance)


def star_note(experiment: ExperimentDiff) -> str:
    """A note on what a star means, where there is one."""
    if not any(sample.unlike for sample in experiment.samples):
        return ""
    return f"* less than {LEVEL:g}, corrected for {len(experiment.samples)} metrics (Kolmogorov-Smirnov, Holm)"


WORST = "worst cases, each with what runs it again"


@frozen
class WorstCase:
    """A case that differs much, as `met diff` and the report list it.

    case      its position in the case table of b;  id  its first letters
    what      differs most in it, where and when
    before    the value in a, and `now` that in b, in `unit`
    commands  that run it again, in a and in b
    """

    case: int
    id: str
    what: str
    before: str
    now: str
    unit: str
    commands: tuple[str, str]


def worst_cases(difference: Diff, experiment: ExperimentDiff) -> Iterator[WorstCase]:
    """The cases that differ most, the first ones first."""
    for ranked in experiment.worst:
        where = f" of {ranked.place.label}" if ranked.place.label else ""
        when = f" at {ranked.place.time:g} s" if ranked.place.time == ranked.place.time else ""
        before, now = distinct_texts(ranked.place.before / ranked.deck_scale, ranked.place.after / ranked.deck_scale)
        what, commands = f"{ranked.signal}{where}{when}", replay_commands(difference, experiment, ranked)
        yield WorstCase(ranked.case_b, ranked.case_id[:8], what, before, now, ranked.deck_unit, commands)


def replay_commands(difference: Diff, experiment: ExperimentDiff, ranked: RankedCase) -> tuple[str, str]:
    """The commands that run a case of both archives again."""
    several = len(difference.experiments) + len(difference.only_a) + len(difference.only_b) > 1
    return (
        _again(difference.a, experiment.name_a if several else "", ranked.case_a),
        _again(difference.b, experiment.name_b if several else "", ranked.case_b),
    )


def _again(path: Path, name: str, case: int) -> str:
    return f"met run {quoted(path)}{f' {quoted(name)}' if name else ''} --case '#{case}'"


def distinct_texts(before: float, after: float) -> tuple[str, str]:
    """Two numbers in the fewest digits, but at least four, that distinguish them."""
    for digits in range(4, 18):
        texts = f"{before:.{digits}g}", f"{after:.{digits}g}"
        if texts[0] != texts[1]:
            break
    return texts


MOST_REQUIREMENTS = 3
"""Largest number of requirements that the verdict names."""


def verdict(difference: Diff) -> str:
    """The verdict in a sentence: on values, and first on changed requirements."""
    others = [text for experiment in difference.experiments for text in _other_requirements(experiment)]
    if not others:
        return _of_values(difference)
    left = len(others) - MOST_REQUIREMENTS
    requirements_text = ", ".join([*others[:MOST_REQUIREMENTS], *([f"and {left:,} more"] if left > 0 else [])])
    return f"{DIFFERENT}; requirements differ: {requirements_text}; values: {_of_values(difference)}"


def _other_requirements(experiment: ExperimentDiff) -> list[str]:
    """The changed requirements: `settle < 10 s -> settle < 1 s (30 of 36 cases no longer meet it)`."""
    out, of_all = [], f" of {experiment.cases.count:,}"
    for requirement in experiment.requirements:
        if requirement.other:
            before, now = requirement.limits
            change = (
                f"{requirement.now}, limit {before} -> {now}" if now else f"{requirement.before} -> {requirement.now}"
            )
            moved = [
                f"{count:,}{of_all} cases {text}"
                for count, text in ((requirement.lost, "no longer meet it"), (requirement.gained, "meet it now"))
                if count
            ]
            out.append(f"{change} ({', '.join(moved) or 'met by the same cases'})")
    return [*out, *(text.removeprefix("require ") for text in experiment.required_in_one)]


def _of_values(difference: Diff) -> str:
    """In how far two archives agree in signals and metrics, in words."""
    of_values = difference.of_values
    text = {
        IDENTICAL: "identical, to the bit",
        EQUIVALENT: "equivalent: bits differ, and no value by more than its tolerance",
        DIFFERENT: "different",
        INCOMPARABLE: "incomparable",
    }[of_values]
    if of_values == EQUIVALENT and not any(
        signal.equivalent for experiment in difference.experiments for signal in experiment.signals
    ):
        return "equivalent: identical, to the bit, in what both have"
    signals = [signal for experiment in difference.experiments for signal in experiment.signals]
    lost = sum(signal.verdict == INCOMPARABLE for signal in signals)
    if of_values == INCOMPARABLE and lost < len(signals):
        return f"incomparable: {lost} of {len(signals)} signals and metrics; no other is different"
    has_tolerances = any(experiment.tolerances.allow_any for experiment in difference.experiments)
    of_size = of_values == EQUIVALENT or any(signal.different for signal in signals)
    if of_values == DIFFERENT and (others := _beyond_any_tolerance(difference)):
        text += f": {'; '.join([*others, *(['values differ'] if of_size else [])])}"
    if of_size and not has_tolerances:
        text += "; no tolerance was given"
    return text


def _beyond_any_tolerance(difference: Diff) -> list[str]:
    """Name the differences that are not of values: runs and cases that one archive has alone, and how cases end."""
    out = unmatched_runs(difference)
    several = len(difference.experiments) > 1
    for experiment in difference.experiments:
        of_run = f" of `{experiment.name_b}`" if several else ""
        out += [f"{text}{of_run}" for text in unmatched_cases(difference, experiment)]
        out += [f"{kind.text}{of_run}: {kind.cases}" for kind in endings(experiment)]
        out += [f"{experiment.last_digits}{of_run}"] if experiment.last_digits else []
    return out
