"""Changes in the requirements of two archives, and in the cases that meet them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from batch.archive.read import ArchiveGroup
from batch.differences.matching import MatchedCases
from batch.differences.result import EvidenceDiff, ExperimentDiff, RequirementDiff
from batch.differences.words import distinct_texts
from batch.queries import requirements
from batch.queries.evidence_table import requirement_evidence
from batch.queries.signals import deck_unit
from batch.queries.step_errors.figures import figures
from batch.queries.step_errors.limits import verdicts


def compare_requirements(a: ArchiveGroup, b: ArchiveGroup, matched: MatchedCases, out: ExperimentDiff) -> None:
    """Count the matched cases that meet each requirement in a and in b; a requirement whose limit has changed counts as
    the same. Requirements of one archive only are noted."""
    met_a, met_b = _met(a, matched.a), _met(b, matched.b)
    known_a, known_b = (
        {group_requirement.text: group_requirement for group_requirement in requirements.group_requirements(group)}
        for group in (a, b)
    )
    now = {text: text for text in met_a if text in met_b}
    for mine in known_a.values():
        alike = [
            each.text
            for each in known_b.values()
            if (each.metric, each.comparison[:1]) == (mine.metric, mine.comparison[:1])
            and each.text not in met_a
            and each.text not in now.values()
        ]
        if mine.text not in now and alike:
            now[mine.text] = alike[0]
    for text, here in met_a.items():
        if text in now:
            there = met_b[now[text]]
            one, other = known_a.get(text), known_b.get(now[text])
            gained, lost = int((there & ~here).sum()), int((here & ~there).sum())
            out.requirements.append(
                RequirementDiff(
                    text,
                    now[text],
                    int(here.sum()),
                    int(there.sum()),
                    gained,
                    lost,
                    _unlike(one, other),
                    _limits(b, one, other) if text == now[text] else ("", ""),
                )
            )
            if gained == lost > 0:
                out.notes.append(
                    f"require {now[text]} is met by as many as before, but by others: {lost:,} no more, {gained:,} now"
                )
    _compare_step_errors(a, b, out)
    _compare_evidence(a, b, now, out)
    for known, others, path in ((met_a, now, a.path), (met_b, now.values(), b.path)):
        for text, met in known.items():
            if text not in others:
                said = f"require {text} is only in {path}, met by {int(met.sum()):,} of {matched.count:,}"
                out.notes.append(said)
                out.required_in_one.append(said)


def _compare_step_errors(a: ArchiveGroup, b: ArchiveGroup, out: ExperimentDiff) -> None:
    """Note requirements on errors due to the step whose verdict has changed, or that only one archive has."""
    before, now = ({verdict.text: verdict for verdict in verdicts(group, figures(group))} for group in (a, b))
    for text in [*before, *(text for text in now if text not in before)]:
        one, other = before.get(text), now.get(text)
        if one is not None and other is not None:
            if one.word != other.word:
                out.notes.append(f"require {text} was {one.word} ({one.said}), now {other.word} ({other.said})")
        elif found := one or other:
            said = f"require {text} is only in {(b if one is None else a).path}, {found.word} ({found.said})"
            out.notes.append(said)
            out.required_in_one.append(said)


def _compare_evidence(a: ArchiveGroup, b: ArchiveGroup, now: Mapping[str, str], out: ExperimentDiff) -> None:
    """Pair the rows of both tables of evidence. now: the text in b of each common requirement of a"""
    one, other = (requirement_evidence([group], str(group.path), several=True) for group in (a, b))
    rows = {(row.requirement, row.at): row for row in other}
    for row in one:
        text = now.get(row.requirement, row.requirement)
        if (text, row.at) in rows:
            out.evidence.append(EvidenceDiff(row, rows[text, row.at]))


def _met(group: ArchiveGroup, cases: np.ndarray) -> dict[str, np.ndarray]:
    """For each requirement, whether each of these cases meets it."""
    texts = requirements.requirement_texts(group)
    if not len(cases):
        return {text: np.empty(0, bool) for text in texts}
    met = requirements.outcomes(group, cases) == 1
    return {text: met[:, column] for column, text in enumerate(texts)} if met.shape[1] else {}


def _unlike(one: requirements.GroupRequirement | None, other: requirements.GroupRequirement | None) -> bool:
    """True if two requirements demand something different; those without a known limit differ only by their texts."""
    return one is not None and other is not None and (one.comparison, one.limit) != (other.comparison, other.limit)


def _limits(
    group: ArchiveGroup, one: requirements.GroupRequirement | None, other: requirements.GroupRequirement | None
) -> tuple[str, str]:
    """The limits of two requirements in the deck's unit, where both have the same text, as `settle < longest`."""
    if one is None or other is None or one.limit == other.limit:
        return "", ""
    scale, unit = deck_unit(group.variables[other.metric])
    before, now = (f"{text} {unit}".rstrip() for text in distinct_texts(one.limit / scale, other.limit / scale))
    return before, now
