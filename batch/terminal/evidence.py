"""Evidence for requirements over a share of cases, and its table, as lines of the terminal."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from batch.queries.evidence import EvidenceRow, percent_above, percent_below
from batch.queries.evidence_table import EvidenceTexts, RequirementEvidence, notes_of, texts_of
from batch.queries.signals import number_text
from ic.printing.columns import columns

MOST_POINTS = 12
"""Largest number of listed design points of a requirement; of more, unmet ones come first."""


def evidence_lines(rows: Sequence[EvidenceRow]) -> Iterator[str]:
    """Lines on what the cases show of a requirement, for each design point: the verdict, its grounds, and the missing
    cases."""
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


OF_CASES = (("verdict", "verdict"), ("missed", "missed"), ("met", "share_met"), ("of all", "of_all"),
            ("asked", "demand"), ("percentile", "bound"), ("needed", "needed"))  # fmt: skip
OF_VALUES = (("limit", "limit"), ("worst", "worst"), ("margin", "margin"), ("in sigmas", "sigmas"),
             ("± step", "step_error"))  # fmt: skip
"""Columns of the two halves of the table, which would be too wide as one: head, and field of `EvidenceTexts`."""


def evidence_table_lines(rows: Sequence[RequirementEvidence], width: int) -> list[str]:
    """The table of evidence in lines: the requirements, numbered; what the cases show of each, and the distance to its
    limit; the command that runs the worst case again; notes."""
    if not rows:
        return ["nothing is required"]
    required = list(dict.fromkeys(row.requirement for row in rows))
    out = []
    for number, text in enumerate(required, start=1):
        out += textwrap.wrap(f"{number}  {text}", width, initial_indent="  ", subsequent_indent="     ")
    numbers = list(_numbers(rows, required))
    if any(row.at for row in rows):
        out += ["", *columns([[number, row.at] for number, row in zip(numbers, rows, strict=True) if row.at])]
    texts = list(map(texts_of, rows))
    out += [
        "",
        *_half(numbers, texts, OF_CASES, width, right=(2, 3, 7)),
        "",
        *_half(numbers, texts, OF_VALUES, width, right=range(1, 6)),
    ]
    again = [[number, row.again] for number, row in zip(numbers, rows, strict=True) if row.again]
    out += ["", "  the worst case of each, run again to the same bits:", *columns(again)] if again else []
    notes = notes_of(rows)
    out += [""] if notes else []
    for note in notes:
        out += textwrap.wrap(f"note: {note}", width, initial_indent="  ", subsequent_indent="    ")
    return out


def _half(
    numbers: Sequence[str],
    texts: Sequence[EvidenceTexts],
    which: Sequence[tuple[str, str]],
    width: int,
    *,
    right: Iterable[int],
) -> list[str]:
    """Some columns of the table, after the numbers of its rows; with signs in place of words where they are too
    wide."""
    cells = [[getattr(text, field) for _, field in which] for text in texts]
    rows = [["", *(head for head, _ in which)], *([number, *row] for number, row in zip(numbers, cells, strict=True))]
    lines = columns(rows, right=right)
    if max(map(len, lines)) <= width:
        return lines
    return columns([[_short(cell) for cell in row] for row in rows], right=right)


def _short(cell: str) -> str:
    """A shortened cell: `at least 99.42 %` as `≥ 99.42 %`, `99 % with 90 %` as `99 %, 90 %`."""
    signs = cell.replace("at least", "\N{GREATER-THAN OR EQUAL TO}").replace("at most", "\N{LESS-THAN OR EQUAL TO}")
    return signs.replace(" with", ",")


def _numbers(rows: Sequence[RequirementEvidence], required: Sequence[str]) -> Iterator[str]:
    """The numbers of the rows: those of their requirements, `1`; with the number of the design point where there are
    several, `2.1`, `2.2`."""
    many, seen = Counter(row.requirement for row in rows), Counter[str]()
    for row in rows:
        seen[row.requirement] += 1
        point = f".{seen[row.requirement]}" if many[row.requirement] > 1 else ""
        yield f"{required.index(row.requirement) + 1}{point}"
