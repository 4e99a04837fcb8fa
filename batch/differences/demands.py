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
from batch.queries.step_errors.figures import figures, verdicts


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
            requirement.text
            for requirement in known_b.values()
            if (requirement.metric, requirement.comparison[:1]) == (mine.metric, mine.comparison[:1])
            and requirement.text not in met_a
            and requirement.text not in now.values()
        ]
        if mine.text not in now and alike:
            now[mine.text] = alike[0]
    for text, met_here in met_a.items():
        if text in now:
            met_there = met_b[now[text]]
            own, other = known_a.get(text), known_b.get(now[text])
            gained, lost = int((met_there & ~met_here).sum()), int((met_here & ~met_there).sum())
            out.requirements.append(
                RequirementDiff(
                    text,
                    now[text],
                    int(met_here.sum()),
                    int(met_there.sum()),
                    gained,
                    lost,
                    _unlike(own, other),
                    _limits(b, own, other) if text == now[text] else ("", ""),
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
                note = f"require {text} is only in {path}, met by {int(met.sum()):,} of {matched.count:,}"
                out.notes.append(note)
                out.required_in_one.append(note)


def _compare_step_errors(a: ArchiveGroup, b: ArchiveGroup, out: ExperimentDiff) -> None:
    """Note requirements on errors due to the step whose verdict has changed, or that only one archive has."""
    before, now = ({verdict.text: verdict for verdict in verdicts(group, figures(group))} for group in (a, b))
    for text in [*before, *(text for text in now if text not in before)]:
        verdict, other = before.get(text), now.get(text)
        if verdict is not None and other is not None:
            if verdict.word != other.word:
                out.notes.append(
                    f"require {text} was {verdict.word} ({verdict.reason}), now {other.word} ({other.reason})"
                )
        elif only := verdict or other:
            note = f"require {text} is only in {(b if verdict is None else a).path}, {only.word} ({only.reason})"
            out.notes.append(note)
            out.required_in_one.append(note)


def _compare_evidence(a: ArchiveGroup, b: ArchiveGroup, now: Mapping[str, str], out: ExperimentDiff) -> None:
    """Pair the rows of evidence (what the cases show of each requirement) of both archives. now: the text in b of each
    common requirement of a."""
    rows_a, other = (requirement_evidence([group], str(group.path), several=True) for group in (a, b))
    rows = {(row.requirement, row.at): row for row in other}
    for row in rows_a:
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


def _unlike(requirement: requirements.GroupRequirement | None, other: requirements.GroupRequirement | None) -> bool:
    """True if two requirements demand something different; those without a known limit differ only by their texts."""
    return (
        requirement is not None
        and other is not None
        and (requirement.comparison, requirement.limit) != (other.comparison, other.limit)
    )


def _limits(
    group: ArchiveGroup, requirement: requirements.GroupRequirement | None, other: requirements.GroupRequirement | None
) -> tuple[str, str]:
    """The limits of two requirements in the deck's unit, where both have the same text, as `settle < longest`."""
    if requirement is None or other is None or requirement.limit == other.limit:
        return "", ""
    scale, unit = deck_unit(group.variables[other.metric])
    before, now = (f"{text} {unit}".rstrip() for text in distinct_texts(requirement.limit / scale, other.limit / scale))
    return before, now
