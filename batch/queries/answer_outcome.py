"""The requirements of a search, judged only in the cases of its answer: an optimiser chose all others, so that shares
of them mean nothing."""

from __future__ import annotations

import numpy as np

from batch.queries.requirements import GroupRequirement, beyond, outcomes
from batch.queries.search_answers import SearchAnswer, goal_text
from batch.queries.signals import deck_unit
from met.frozen import frozen


@frozen
class AnswerRequirement:
    """A requirement in the cases of an answer. One over a share of cases is asked of each of them.

    met, missed, unknown  cases of the answer;  no_value: of the unknown ones, those that reached their end
    worst                 the value that is furthest beyond the limit or nearest to it, as text;  case: its number in
                          the case table
    outcome               how it came out in words, without the value;  outcome_with_value: with it, and with other
                          cases that miss
    it elsewhere  a case that a search tried besides its answer misses it
    """

    text: str
    met: int
    missed: int
    unknown: int
    no_value: int
    worst: str
    case: int
    outcome: str
    outcome_with_value: str
    elsewhere: bool = False

    @property
    def ok(self) -> bool:
        """True if all cases of the answer meet it, and all that a search tried."""
        return not self.missed and not self.unknown and not self.elsewhere


@frozen
class AnswerOutcome:
    """The verdict on the answer of a search or a tuning, with a sentence that says it, and its requirements."""

    headline: str
    ok: bool
    requirements: tuple[AnswerRequirement, ...]


def answer_outcome(group_answer: SearchAnswer) -> AnswerOutcome:
    """The verdict on an answer: of a tuning in the cases of the sweep that it is held against, of a search in the worst
    case that was found, and in others where one misses what that case meets."""
    judged = tuple(_required(group_answer, requirement) for requirement in group_answer.required)
    headline = _of_tuning if group_answer.search.kind == "tune" else _of_worst
    return AnswerOutcome(headline(group_answer, judged), group_answer.ok, judged)


def _required(answer: SearchAnswer, requirement: GroupRequirement) -> AnswerRequirement:
    """The outcome of a requirement in the cases of a search's answer, with the furthest value, and others that miss
    it."""
    group, cases = answer.group, np.array(answer.best.cases)
    variable, values = group.variables[requirement.metric], group.values(requirement.metric)
    met, numbers = outcomes(group)[:, requirement.place], group.values("case")
    scale, unit = deck_unit(variable)

    def value_text(place: int) -> str:
        return goal_text(float(values[place]), unit or "1", scale)

    far = beyond(values, requirement.comparison, requirement.limit)
    worst = int(cases[np.argmax(far[cases])])
    missed, unknown = (int((met[cases] == outcome).sum()) for outcome in (0, -1))
    if answer.search.kind == "search":
        came = f"{'met' if met[worst] == 1 else 'missed' if met[worst] == 0 else 'not known'} in the worst case found"
        text = f"{came}: {value_text(worst)}, case #{numbers[worst]}"
    else:
        came = _came_out(answer, missed, unknown)
        text = f"{came}; worst {value_text(worst)}, case #{numbers[worst]}"
    others = np.flatnonzero(met != 1) if answer.search.kind == "search" and met[worst] == 1 else np.array([], int)
    if len(others):
        other = int(others[np.argmax(far[others])])
        more = f"; but missed in another: {value_text(other)}, case #{numbers[other]}"
        came, text = came + more, text + more
    no_value = int(((met[cases] == -1) & (group.values("status")[cases] == 0)).sum())
    counts = int((met[cases] == 1).sum()), missed, unknown, no_value
    return AnswerRequirement(
        requirement.text, *counts, value_text(worst), int(numbers[worst]), came, text, bool(len(others))
    )


def _came_out(answer: SearchAnswer, missed: int, unknown: int) -> str:
    """The outcome in words: `met in all 32 cases of spread`; `missed in 3 of 32 cases of spread, not known in 1 of 32
    cases of spread`."""
    if not missed and not unknown:
        return f"met{(cases := _cases(answer)) and f' in {cases}'}"
    cases = _cases(answer, every=False)
    counts = [("missed", missed), ("not known", unknown)]
    return ", ".join(f"{word}{cases and f' in {count:,} of {cases}'}" for word, count in counts if count)


def _cases(answer: SearchAnswer, *, every: bool = True) -> str:
    """The cases of a tuning's answer: `all 32 cases of spread`; empty where it is judged against no sweep."""
    best, sweep = answer.best, answer.search.against
    if best.all == 1:
        return ""
    if not best.confirmed:
        return f"{best.tried:,} cases of {sweep}, of {best.all:,}"
    return f"{'all ' * every}{best.all:,} cases of {sweep}"


def _all(answer: SearchAnswer) -> str:
    return "meets all requirements" if answer.required else "reaches its end"


def _misses(judged: tuple[AnswerRequirement, ...], *, named: bool) -> str:
    """The missed requirements in words: `misses settle < 5 s in case #2521, over < 10 % in 3 cases`. named: False where
    the case is known"""

    def where(requirement: AnswerRequirement) -> str:
        count = requirement.missed + requirement.unknown
        return f" in case #{requirement.case}" if count == 1 else f" in {count:,} cases"

    bad = [requirement for requirement in judged if requirement.missed or requirement.unknown]
    return f"misses {', '.join(f'{requirement.text}{where(requirement) * named}' for requirement in bad)}"


def _of_tuning(answer: SearchAnswer, judged: tuple[AnswerRequirement, ...]) -> str:
    """The headline of a tuning's answer: what it fails or misses, its margin, and the sweeps that do not confirm it."""
    best, sweep = answer.best, answer.search.against
    if best.failed:
        return f"The answer fails in case #{answer.position}"
    if best.missed:
        return f"The answer {_misses(judged, named=True)}{f' of {sweep}' if best.all > 1 else ''}"
    if not best.confirmed:
        return f"The answer was tried in {best.tried:,} of {best.all:,} cases of {sweep} alone"
    if not best.stands:
        return f"The answer has no {answer.search.metric} in case #{answer.position}"
    text = f"The answer {_all(answer)}{(cases := _cases(answer)) and f' in {cases}'}"
    if best.stability is not None and best.stability.margins is not None and not best.serves:
        margins = f"disk margin of {best.stability.margins.disk:.3g} is below the least, {answer.search.least_margin:g}"
        return f"{text}, but its {margins}"
    for confirmation in answer.search.confirmation:
        if not confirmation.withstood:
            misses = confirmation.failed + confirmation.missed
            text += f", but not in {misses:,} of {confirmation.cases:,} of {confirmation.against}"
    return text


def _of_worst(answer: SearchAnswer, judged: tuple[AnswerRequirement, ...]) -> str:
    """A sentence on the worst case that a search found. judged: requirements"""
    worst = f"The worst case found, #{answer.position},"
    if answer.best.failed:
        return f"{worst} fails"
    if answer.best.missed:
        return f"{worst} {_misses(judged, named=False)}"
    if (others := [requirement.text for requirement in judged if requirement.elsewhere]) and not answer.ok:
        return f"{worst} {_all(answer)}, but another that was tried misses {', '.join(others)}"
    return f"{worst} {_all(answer)}"
