"""Evidence for requirements over a share of cases, as lines of the terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from batch.queries.evidence import EvidenceRow, percent_above, percent_below
from batch.queries.signals import number_text

MOST_POINTS = 12
"""Largest number of listed design points of a requirement; of more, unmet ones come first."""


def evidence_lines(rows: Sequence[EvidenceRow]) -> Iterator[str]:
    """Lines for each design point: the verdict, its grounds, and the missing cases."""
    listed = list(rows) if len(rows) <= MOST_POINTS else sorted(rows, key=lambda row: row.ok)[:MOST_POINTS]
    wide = max((len(row.verdict) for row in listed), default=0)
    heads = [", ".join(f"{path} = {text}" for path, text in row.chosen.items()) for row in listed]
    widest = max(map(len, heads), default=0)
    widest += 2 * (widest > 0)
    for head, row in zip(heads, listed, strict=True):
        first, *more = _grounds(row)
        yield f"{head:<{widest}}{row.verdict:<{wide}}  {first}"
        yield from [" " * (widest + wide + 2) + text for text in more]
    if len(rows) > len(listed):
        yield f"{len(rows):,} design points in all, at {sum(row.ok for row in rows):,} of which it is met"


def _grounds(row: EvidenceRow) -> list[str]:
    """The grounds of a verdict: the number of cases that meet the requirement, the resulting bound, and the number of
    further cases needed."""
    text = f"{row.cases - row.missed:,} of {row.cases:,} cases meet it"
    if row.why:
        return [f"{text}; {row.why}"]
    if row.lower is None or row.upper is None:
        return [text]
    if row.verdict == "refuted":
        return [f"{text}: at most {percent_above(row.upper)} of all do{_test(row)}"]
    lines = [f"{text}: at least {percent_below(row.lower)} of all do"]
    if row.bound is not None:
        side = "at most" if row.requirement.comparison.startswith("<") else "at least"
        value = f"{number_text(row.bound / row.scale)} {row.unit}".removesuffix(" 1")
        lines[0] += f"; in {100.0 * (row.requirement.share or 0.0):g} % of all it is {side} {value.strip()}"
    lines[0] += _test(row)
    if row.more:
        these = "it does not miss it" if row.more == 1 else "none of these misses it"
        lines.append(f"{row.more:,} more case{'s' * (row.more != 1)} would show it if {these}")
    return lines


def _test(row: EvidenceRow) -> str:
    """Words on a sequential test, after its result."""
    if not row.sequential:
        return ""
    early = row.decided is not None and row.decided < row.cases
    return f" (sequential test{f', decided after {row.decided:,} cases' if early else ''})"
