"""The table of evidence of a page, with the rows of `met show --evidence`."""

from __future__ import annotations

from batch.archive.searched import is_search
from batch.queries.evidence_table import NONE, EvidenceTexts, notes_of, requirement_evidence, texts_of
from batch.queries.pool import Pool, page_number
from batch.report.contents.parts import EvidenceLine, EvidencePart
from met.outputs import quoted

MOST_ROWS = 200
"""Largest number of rows of a page; of more, unmet ones come first, and a sentence counts the rest."""


def evidence_part(pool: Pool, archive: str, *, several: bool) -> EvidencePart | None:
    """The rows, those of a requirement together, and notes; None where there are no requirements, or for a search,
    whose verdict says everything. archive: its name in commands; several: whether these must name the run or sweep"""
    if any(map(is_search, pool.groups)):
        return None
    evidence = requirement_evidence(pool.groups, archive, several=several)
    if not evidence:
        return None
    shown_rows = evidence if len(evidence) <= MOST_ROWS else sorted(evidence, key=lambda row: row.ok)[:MOST_ROWS]
    notes = notes_of(shown_rows)
    if len(shown_rows) < len(evidence):
        command = f"met show {quoted(archive)} --evidence"
        notes.append(f"{len(evidence) - len(shown_rows):,} rows more: `{command}`")
    rows = (
        EvidenceLine(row.requirement, row.at, row.ok, row.worst_case, row.again, _page(texts_of(row, page_number)))
        for row in shown_rows
    )
    return EvidencePart(tuple(rows), tuple(notes))


def _page(texts: EvidenceTexts) -> EvidenceTexts:
    """The texts with the page's dash in place of missing ones."""
    names = EvidenceTexts.__dataclass_fields__
    return EvidenceTexts(**{n: "\N{EN DASH}" if (text := getattr(texts, n)) == NONE else text for n in names})
