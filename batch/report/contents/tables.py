"""Tables of a report: the best and the worst cases, the structures of a sweep side by side, the evidence, and the
varied parameters that explain each metric, as `met sensitivity` finds them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from batch.archive.read import ArchiveGroup
from batch.archive.searched import is_search
from batch.queries.evidence_table import NONE, EvidenceTexts, notes_of, requirement_evidence, texts_of
from batch.queries.pool import ENDED, CaseColumn, Pool, page_number
from batch.queries.requirements import group_requirements
from batch.queries.sensitivity import Sensitivity, sensitivities, share_text, total_text
from batch.queries.sensitivity import notes_of as sensitivity_notes
from batch.queries.summary import median_text
from batch.report.contents.against import GOOD, EarlierCases
from batch.report.contents.parts import (
    EvidenceLine,
    EvidencePart,
    InfluencePart,
    InfluenceRow,
    NotableCases,
    TextTable,
)
from ic.printing.columns import count as counted
from met.diagnostic import Problem
from met.distinct import distinct
from met.outputs import quoted
from met.statistics.sensitivity import FEWEST

MOST_CASES, MOST_BEST = 20, 5
"""Rows of the tables of worst and of best cases."""

MISSES = "\N{BALLOT X}"


def best(pool: Pool, archive: str, only: str, before: EarlierCases | None = None) -> NotableCases | None:
    """The cases that meet all requirements and stay furthest from their limits, the best first; None where there are no
    requirements, no case meets them, or the other table has all cases. For a search, its answer is the best. only,
    before: as for `worst`"""
    if not pool.requirements or pool.count <= MOST_BEST or any(map(is_search, pool.groups)):
        return None
    order = pool.worst_first[::-1]
    places = order[pool.ended[order] == ENDED.index("met")]
    if not len(places):
        return None
    table = _case_table(pool, places[:MOST_BEST], archive, only, before)
    left = len(places) - len(table.cases)
    more = f"{counted(left, 'more case')} {'meets' if left == 1 else 'meet'} all." if left else ""
    return replace(table, title="Best cases", more=more)


def worst(pool: Pool, archive: str, only: str, before: EarlierCases | None = None) -> NotableCases | None:
    """The worst cases, failed ones first. only: the run or sweep to name in commands; "" where there is one. before:
    outcomes in another archive"""
    if pool.count < 2:
        return None
    table = _case_table(pool, pool.worst_first[:MOST_CASES], archive, only, before)
    left = pool.count - len(table.cases)
    more = f"{counted(left, 'more case')} {'is' if left == 1 else 'are'} in the archive." if left else ""
    return replace(table, title=_title(pool, len(table.cases)), more=more)


def _case_table(pool: Pool, places: np.ndarray, archive: str, only: str, before: EarlierCases | None) -> NotableCases:
    """The cases at these places, a row each, with all their columns."""
    columns = pool.columns
    missed = [pool.missed(column) for column in columns]
    rows, marked = [], set()
    ids = pool.texts("case_id", places)
    for number, place in enumerate(places.tolist()):
        cells = [f"#{pool.cases[place]}", ids[number][:8]]
        for column_number, column in enumerate(columns):
            text = cell_text(column, place)
            if missed[column_number][place]:
                marked.add((number, column_number + 2))
                text = f"{text} {MISSES}"
            cells.append(text)
        was = ENDED[before.ended[place]] if before is not None and before.in_both[place] else page_number(np.nan)
        rows.append((*cells, *([was] if before is not None else []), ENDED[pool.ended[place]]))
    ends = ("before", "now") if before is not None else ("came out",)
    table = TextTable(
        heads=("case", "id", *(column.label for column in columns), *ends),
        units=("", "", *(column.unit for column in columns), *("" for _ in ends)),
        rows=tuple(rows),
        right=frozenset(
            [0, *(column_number + 2 for column_number, column in enumerate(columns) if column.role != "choice")]
        ),
        marked=frozenset(marked),
    )
    numbers = tuple(int(pool.cases[place]) for place in places)
    return NotableCases("", table, numbers, tuple(replay(archive, only, case) for case in numbers))


def replay(archive: str, only: str, case: int | str) -> str:
    """The command that runs a case again."""
    named = f" {quoted(only)}" if only else ""
    return f"met run {quoted(archive)}{named} --case '#{case}'"


def cell_text(column: CaseColumn, place: int) -> str:
    """A value as shown in a table."""
    value = float(column.values[place])
    if column.words:
        return column.words[int(value)] if np.isfinite(value) else ""
    return page_number(value)


def _title(pool: Pool, count: int) -> str:
    """The title of the table of the worst cases. count: how many it shows"""
    every, equal = count == pool.count, pool.ranking.equal(count)
    if any(ENDED[ended] not in ("met", "done") for ended in distinct(pool.ended)):
        many = f" ({equal:,} are equally bad)" if equal else ""
        return "Cases, worst first" if every else f"Worst cases{many}"
    if not pool.requirements:
        return "Cases" if every else "The first cases"
    many = f" ({equal:,} are equally close)" if equal else ""
    return "Cases, closest to a limit first" if every else f"Cases closest to a limit{many}"


def structures(pool: Pool, before: EarlierCases | None = None) -> TextTable | None:
    """A row for each structure: its choices, number of cases, number that meet all requirements, those in another
    archive before, and the median of each metric."""
    if len(pool.groups) < 2:
        return None
    metrics = pool.metrics()
    good = "meet all" if pool.requirements else "reached their end"
    choices = [column for column in pool.columns if column.role == "choice"]
    rows = []
    for number, _ in enumerate(pool.groups):
        places = np.flatnonzero(pool.group_of == number)
        chosen = [cell_text(column, int(places[0])) if len(places) else "" for column in choices]
        counts = [_good(pool.ended[places])]
        if before is not None:
            both = places[before.in_both[places]]
            counts.append(_good(before.ended[both]) if len(both) else page_number(np.nan))
        medians = (median_text(column.values[places], infinite="∞", none=page_number(np.nan)) for column in metrics)
        rows.append((*chosen, f"{len(places):,}", *counts, *medians))
    heads = (*(c.label for c in choices), "cases", good, *(("before",) if before is not None else ()))
    return TextTable(
        heads=(*heads, *(f"{c.label}, median" for c in metrics)),
        units=(*[""] * len(heads), *(c.unit for c in metrics)),
        rows=tuple(rows),
        right=frozenset(range(len(choices), len(heads) + len(metrics))),
    )


def _good(ended: np.ndarray) -> str:
    """The number and share of cases that met all or reached their end. ended: places in `pool.ENDED`"""
    good = int(np.isin(ended, GOOD).sum())
    return f"{good:,} ({100 * good / max(1, len(ended)):.3g} %)"


MOST_EVIDENCE = 200
"""Largest number of rows of a page; of more, unmet ones come first, and a sentence counts the rest."""


def evidence_part(pool: Pool, archive: str, *, several: bool) -> EvidencePart | None:
    """The rows, those of a requirement together, and notes; None where there are no requirements, or for a search,
    whose verdict says everything. archive: its name in commands; several: whether these must name the run or sweep"""
    if any(map(is_search, pool.groups)):
        return None
    evidence = requirement_evidence(pool.groups, archive, several=several)
    if not evidence:
        return None
    shown_rows = (
        evidence if len(evidence) <= MOST_EVIDENCE else sorted(evidence, key=lambda row: row.ok)[:MOST_EVIDENCE]
    )
    notes = notes_of(shown_rows)
    if len(shown_rows) < len(evidence):
        command = f"met show {quoted(archive)} --evidence"
        notes.append(f"{len(evidence) - len(shown_rows):,} rows more: `{command}`")
    rows = (
        EvidenceLine(
            row.requirement, row.at, row.ok, row.worst_case, row.again, _with_dashes(texts_of(row, page_number))
        )
        for row in shown_rows
    )
    return EvidencePart(tuple(rows), tuple(notes))


def _with_dashes(texts: EvidenceTexts) -> EvidenceTexts:
    """The texts with the page's dash in place of missing ones."""
    names = EvidenceTexts.__dataclass_fields__
    return EvidenceTexts(**{n: "\N{EN DASH}" if (text := getattr(texts, n)) == NONE else text for n in names})


# Which parameters matter


MOST_METRICS, MOST_INPUTS, MOST_SAMPLED = 6, 12, 50_000
"""Largest number of metrics, of parameters of each, and of cases that are used."""


def influences(pool: Pool) -> tuple[InfluencePart, ...]:
    """A part for each metric of a sweep of one structure with draws or enough cases, those with requirements first;
    none where one parameter varies, or a search chose the cases, which are not a sample."""
    if len(pool.groups) != 1 or is_search(pool.groups[0]):
        return ()
    [group] = pool.groups
    coordinates = group.role("coordinate")
    drawn = any(variable.attributes.get("design") for variable in coordinates)
    if len(coordinates) < 2 or group.count > MOST_SAMPLED or not (drawn or group.count >= FEWEST):
        return ()
    names = _metrics(group)
    if group.count < FEWEST:
        return (InfluencePart("", f"Not enough cases to tell: {group.count:,}; {FEWEST} at least.", 0.0, (), ()),)
    try:
        return tuple(map(_influence, sensitivities(group, names[:MOST_METRICS]))) if names else ()
    except Problem:  # nothing varies
        return ()


def _metrics(group: ArchiveGroup) -> list[str]:
    """The group's metrics, those with requirements first."""
    required = dict.fromkeys(group_requirement.metric for group_requirement in group_requirements(group))
    return list(dict.fromkeys([*required, *(variable.name for variable in group.role("metric"))]))


def _influence(sensitivity: Sensitivity) -> InfluencePart:
    """The parameters that explain a metric, as texts of the page; without rows where there are too few cases."""
    count = f"{sensitivity.cases:,} cases" + (
        f"; {sensitivity.left:,} are left out, with no finite value" if sensitivity.left else ""
    )
    if sensitivity.cases < sensitivity.fewest:
        why_none = f"not enough cases, {count}; {sensitivity.fewest:,} at least"
        return InfluencePart(sensitivity.name, why_none, 0.0, (), ())
    if not sensitivity.shares:
        return InfluencePart(sensitivity.name, f"the same in all cases, {count}", 0.0, (), ())
    rows = []
    for place in sensitivity.order[:MOST_INPUTS]:
        share = sensitivity.shares[place]
        low, high = share.low / sensitivity.scale, share.high / sensitivity.scale
        rows.append(
            InfluenceRow(
                path=sensitivity.inputs[place],
                alone=share_text(share.first, share.first_by),
                together=total_text(share),
                low=low,
                high=high,
                ends=sensitivity.ends(share, f"{page_number(low)} …", page_number(high)),
                rank=f"{share.rank:+.2f}",
            )
        )
    notes = list(sensitivity_notes(sensitivity))
    if len(sensitivity.order) > len(rows):
        notes.append(f"{len(sensitivity.order) - len(rows):,} parameters more explain less")
    return InfluencePart(sensitivity.name, count, sensitivity.mean / sensitivity.scale, tuple(rows), tuple(notes))
