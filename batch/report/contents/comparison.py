"""The comparison with another archive in a page's words, which are those of `met diff`; and the changes of required
metrics, away from their limits, which is better, or towards them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from batch.differences import words
from batch.differences.compare import DIFFERENT, EQUIVALENT, IDENTICAL, VERDICTS, magnitude
from batch.differences.result import Diff, ExperimentDiff
from batch.differences.words import distinct_texts
from batch.queries.pool import ENDED, CaseColumn, Pool, page_number, ranges
from batch.report.contents.against import GOOD, ComparedArchive, EarlierCases
from batch.report.contents.changes import PARAMETERS, ArchiveChanges, DeckTextChange, OtherOrigin, RunChanges
from batch.report.contents.parts import MetricMove, OutcomeCount, RequirementFlow, Verdict
from met.messages.visible import visible

MOST_LINES = 200
"""Largest number of lines of one kind of change in a page."""

KINDS = {
    "versions": "Versions",
    "code": "Code",
    "structure": "Structure",
    "changed": PARAMETERS,
    "follows": "What follows",
    "new": "New parameters",
    "kept": "Histories",
}


def archive_changes(differences: Diff) -> ArchiveChanges:
    """Differences in the provenance of the two archives, and the runs that only one of them has."""
    origins = tuple(
        OtherOrigin(KINDS[kind], lines[:MOST_LINES], max(0, len(lines) - MOST_LINES))
        for kind, lines in words.provenance_lines(differences)
        if kind in KINDS
    )
    decks = tuple(
        DeckTextChange(
            visible(deck.said), tuple(map(visible, deck.lines[:MOST_LINES])), max(0, len(deck.lines) - MOST_LINES)
        )
        for deck in differences.changed.decks
    )
    return ArchiveChanges(
        str(differences.a), str(differences.b), origins, decks, tuple(words.unmatched_runs(differences))
    )


def run_changes(differences: Diff, before: EarlierCases | None) -> tuple[RunChanges, ...]:
    """The changes of each of a section's structures that both archives have."""
    if before is None:
        return ()
    several = len(before.pairs) > 1
    return tuple(_run_changes(differences, experiment, several) for _, _, experiment in before.pairs)


def _run_changes(differences: Diff, experiment: ExperimentDiff, several: bool) -> RunChanges:
    """The changes of one structure. several: True where there are others, so that its requirements are listed here;
    otherwise the verdict has them"""
    alone = words.unmatched_cases(differences, experiment)
    if several:
        alone += words.requirement_lines(experiment)
    allowed = (
        line.replace("the deck of b ", f"the deck of {differences.b} ")
        for line in words.tolerance_lines(differences, experiment)
    )
    paired = words.paired_metrics(experiment)
    return RunChanges(
        heading=words.heading(experiment),
        word=experiment.verdict,
        alone=tuple(alone),
        endings=tuple(words.endings(experiment)),
        notes=(
            *experiment.notes,
            *(f"{words.EVIDENCE}: {what}: {text}" for what, text in words.evidence_pairs(experiment)),
            *([f"{words.PAIRED}: {'; '.join(paired)}"] if paired else []),
        ),
        allowed=tuple(allowed),
        signals=tuple(map(words.signal_row, experiment.signals)),
        samples=tuple(map(words.distribution, experiment.samples)),
        starred=words.star_note(experiment),
        worst=tuple(words.worst_cases(differences, experiment)),
        left=max(0, experiment.cases_different - len(experiment.worst)),
    )


# The verdict


def verdict(against: ComparedArchive, pairs: Sequence[tuple[Pool, EarlierCases | None]]) -> Verdict:
    """The verdict of the comparison, over all cases. pairs: runs and sweeps of the page, with their earlier
    counterparts"""
    differences = against.differences
    both = [(pool, before) for pool, before in pairs if before is not None]
    headline = words.verdict(differences).removeprefix(differences.verdict).lstrip(",;: ")
    if not any(experiment.cases.count for experiment in differences.experiments):
        headline = "the two have no case in common"
    return Verdict(
        kind="comparison",
        about=f"Against {differences.a}",
        ok=differences.verdict in (IDENTICAL, EQUIVALENT),
        headline=headline[:1].upper() + headline[1:],
        parts=_parts(against, pairs),
        word=differences.verdict,
        figure=_figure(both),
        flows=tuple(flow for pool, before in both for flow in _flows(pool, before, named=len(pairs) > 1)),
        ends=_ends(both),
    )


def _parts(against: ComparedArchive, pairs: Sequence[tuple[Pool, EarlierCases | None]]) -> tuple[OutcomeCount, ...]:
    """The number of cases that are identical, equivalent, different, or in only one of the archives."""
    differences = against.differences
    how = np.concatenate([np.zeros(0, np.int8), *(experiment.how for experiment in differences.experiments)])
    counts = {word: int((how == VERDICTS.index(word)).sum()) for word in (IDENTICAL, EQUIVALENT, DIFFERENT)}
    gone = sum(group.count for group in against.file.groups if group.name in differences.only_a)
    new = sum(group.count for pool, _ in pairs for group in pool.groups if group.name in differences.only_b)
    counts["only before"] = sum(len(experiment.only_a) for experiment in differences.experiments) + gone
    counts["only now"] = sum(len(experiment.only_b) for experiment in differences.experiments) + new
    return tuple(OutcomeCount(word, count) for word, count in counts.items() if count)


def _figure(both: Sequence[tuple[Pool, EarlierCases]]) -> tuple[int, int, int] | None:
    """The number of cases that meet all requirements, before and now, and of all common cases; None where there are no
    requirements."""
    judged = [(pool, before) for pool, before in both if pool.requirements and before.pool.requirements]
    total = sum(int(before.in_both.sum()) for _, before in judged)
    if total < 2:
        return None
    was = sum(int(np.isin(before.ended, GOOD).sum()) for _, before in judged)
    now = sum(int((np.isin(pool.ended, GOOD) & before.in_both).sum()) for pool, before in judged)
    return was, now, total


def _flows(pool: Pool, before: EarlierCases, *, named: bool) -> Iterator[RequirementFlow]:
    """For each common requirement, the cases that meet it now, and those that no longer do. named: True to name the
    run"""
    pairs = {
        requirement.now: requirement for _, _, experiment in before.pairs for requirement in experiment.requirements
    }
    for place, text in enumerate(pool.requirements):
        if text not in pairs or not before.in_both.any():
            continue
        column = before.pool.requirements.index(pairs[text].before)
        was = before.in_both & (before.pool.outcomes[before.place, column] == 1)
        now = before.in_both & (pool.outcomes[:, place] == 1)
        met = words.met_by_text(int(was.sum()), int(now.sum()), int(before.in_both.sum()))
        if len(before.pairs) == 1:
            met += words.pairs_text(pairs[text])
        requirement_name = words.requirement_text(pairs[text])
        gained, lost = (ranges(pool.cases[which].tolist()) for which in (now & ~was, was & ~now))
        better, worse = metric_moves(pool, before, text)
        yield (
            RequirementFlow(
                f"{pool.name}: {requirement_name}" if named else requirement_name, met, gained, lost, better, worse
            )
        )


def _ends(both: Sequence[tuple[Pool, EarlierCases]]) -> RequirementFlow | None:
    """The cases that reach their end now, and those that no longer do; None where nothing has changed."""
    gained: list[str] = []
    lost: list[str] = []
    was = now = total = 0
    for pool, before in both:
        now_ended, was_ended = pool.ended < ENDED.index("failed"), before.ended < ENDED.index("failed")
        name = f"{pool.name}: " if len(both) > 1 else ""
        for which, names in ((now_ended & ~was_ended, gained), (was_ended & ~now_ended, lost)):
            if (which & before.in_both).any():
                names.append(f"{name}{ranges(pool.cases[which & before.in_both].tolist())}")
        was, now = was + int((was_ended & before.in_both).sum()), now + int((now_ended & before.in_both).sum())
        total += int(before.in_both.sum())
    if not gained and not lost:
        return None
    met = f"by {was:,}, now by {now:,} of {total:,}" if was != now else f"by {now:,} of {total:,}, other ones"
    return RequirementFlow("reaches its end", met, "; ".join(gained), "; ".join(lost))


def metric_moves(pool: Pool, before: EarlierCases, requirement: str) -> tuple[MetricMove | None, MetricMove | None]:
    """The cases in both archives in which the metric of a requirement is better now, and those in which it is worse.
    Changes within the tolerances, and values that are missing in one of the two, do not count."""
    for column in pool.metrics():
        sense = next((limit.sense for limit in column.limits if limit.text == requirement), None)
        was = None if sense is None else before.values(column)
        if sense is None or was is None:
            continue
        moved = _beyond(pool, before, column)
        lower, higher = (moved & way for way in (column.values < was, column.values > was))
        better_and_worse = (lower, higher) if sense == "<" else (higher, lower)
        return _move(pool, column, was, better_and_worse[0]), _move(pool, column, was, better_and_worse[1])
    return None, None


def _beyond(pool: Pool, before: EarlierCases, column: CaseColumn) -> np.ndarray:
    """True of each case in which a metric differs by more than its structure's tolerances, [case]."""
    name = column.key.partition(":")[2]
    now = pool.gathered(name)
    was = np.where(before.in_both, before.pool.gathered(name)[before.place], np.nan)
    out = np.zeros(pool.count, bool)
    for number, _, experiment in before.pairs:
        diff = next(
            (signal for signal in experiment.signals if signal.metric and signal.name == name and not signal.why), None
        )
        if diff is not None:
            in_both = (pool.group_of == number) & before.in_both
            a, b, allowed = was[in_both], now[in_both], diff.tolerance
            with np.errstate(invalid="ignore", over="ignore"):
                limit = allowed.absolute + allowed.relative * magnitude(a, b)
                out[in_both] = (a != b) & ~(np.abs(b - a) <= limit)
    return out


def _move(pool: Pool, column: CaseColumn, was: np.ndarray, moved: np.ndarray) -> MetricMove | None:
    """The cases that moved, and the one that moved furthest; None where none did."""
    places = np.flatnonzero(moved)
    if not len(places):
        return None
    with np.errstate(over="ignore"):
        furthest = int(places[np.abs(column.values[places] - was[places]).argmax()])
    texts = _texts(float(was[furthest]), float(column.values[furthest]))
    return MetricMove(len(places), int(pool.cases[furthest]), *texts, column.unit)


def _texts(before: float, now: float) -> tuple[str, str]:
    """The two values as a page shows them, or in more digits where these would be the same."""
    texts = page_number(before), page_number(now)
    return texts if texts[0] != texts[1] else distinct_texts(before, now)
