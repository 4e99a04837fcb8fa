"""What changed, for people: what made the two, status first, then signals and metrics, then the worst cases."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from batch.differences import words
from batch.differences.found import Diff, Experiment, Signal
from ic.printing.columns import columns

MOST_LINES = 12
"""Of one kind of change."""

SHOWN_ENDED, SHOWN_WORST = 8, 5


def told(found: Diff) -> list[str]:
    """All of it, for people."""
    out = [f"a  {found.a}", f"b  {found.b}", *_changed(found)]
    for line in words.alone(found):
        out += ["", line]
    for experiment in found.experiments:
        out += ["", *_experiment(found, experiment)]
    return [*out, "", words.verdict(found)]


def _changed(found: Diff) -> Iterator[str]:
    said = [line for kind, lines in words.made(found) for line in _few(f"{kind:<10}", lines)]
    yield ""
    if not said:
        yield words.SAME
    for line in said:
        yield f"  {line}"


def _few(head: str, lines: Sequence[str]) -> list[str]:
    out = [f"{head} {line}" for line in lines[:MOST_LINES]]
    return out + ([f"{head} and {len(lines) - MOST_LINES} more"] if len(lines) > MOST_LINES else [])


def _experiment(found: Diff, experiment: Experiment) -> list[str]:
    out = [words.heading(experiment), *(f"  {line}" for line in words.missing(found, experiment))]
    out += _ended(experiment)
    out += [f"  note: {note}" for note in experiment.notes]
    out += [f"  {line}" for line in words.allowed(found, experiment)]
    out += [f"  {line}" for line in words.requirements(experiment)]
    out += _signals(experiment.signals)
    out += _samples(experiment)
    out += _worst(found, experiment)
    return out


def _ended(experiment: Experiment) -> Iterator[str]:
    """Cases that end otherwise, in kinds."""
    for ending in words.endings(experiment):
        yield f"  {ending.text}: {ending.cases}"
        for each in ending.each[:SHOWN_ENDED]:
            yield f"    #{each.case} {each.case_id[:8]}  {words.cause(each)}"
        if len(ending.each) > SHOWN_ENDED:
            yield f"    and {len(ending.each) - SHOWN_ENDED:,} more"


def _signals(signals: Sequence[Signal]) -> list[str]:
    if not signals:
        return []
    rows = [["", "", "cases", "largest", "", "of range", "where", "first", "tolerance"]]
    rows += [_row(words.compared(signal)) for signal in signals]
    used = [column for column in range(len(rows[0])) if column < 3 or any(row[column] for row in rows[1:])]
    right = [used.index(column) for column in (3, 5) if column in used]
    return columns([[row[column] for column in used] for row in rows], right=right)


def _row(each: words.Compared) -> list[str]:
    return [each.name, each.verdict, each.cases, each.largest, each.unit, each.share, each.where, each.first,
            each.tolerance]  # fmt: skip


def _samples(experiment: Experiment) -> list[str]:
    if not experiment.samples:
        return []
    rows = [["  as distributions", "cases", "", "median", "", "distance", "by chance"]]
    for each in map(words.distribution, experiment.samples):
        rows.append([f"  {each.name}", *each.cases, *each.medians, each.distance, each.chance])
    note = words.starred(experiment)
    return ["", *columns(rows, right=range(1, 7)), *([f"  {note}"] if note else [])]


def _worst(found: Diff, experiment: Experiment) -> list[str]:
    if not experiment.worst:
        return []
    out = ["", f"  {words.WORST}:"]
    for each in experiment.worst[:SHOWN_WORST]:
        what, before, now = words.most(each)
        out.append(f"    #{each.case_b} {each.case_id[:8]}  {what}: {before}, now {now}")
        out.append(f"      {'; '.join(words.again(found, experiment, each))}")
    return out
