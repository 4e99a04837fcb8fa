"""The cases of a run or sweep in one table, over all its structures, with their names and outcomes."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from typing import Literal

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.archive.stored import Stored
from batch.queries import requirements
from batch.queries.grids import METRIC_SPAN, is_log, levels, spans
from batch.queries.requirements import Ranking
from batch.queries.signals import deck_unit, number_text
from met.diagnostic import Problem, error
from met.distinct import distinct
from met.frozen import frozen
from met.run import DONE, FAILED, LOST, TIMED_OUT


def by_run(groups: Iterable[ArchiveGroup]) -> dict[str, list[ArchiveGroup]]:
    """The groups of each run or sweep, under its name."""
    groups_of_run: dict[str, list[ArchiveGroup]] = {}
    for group in groups:
        groups_of_run.setdefault(group.sweep or group.name, []).append(group)
    return groups_of_run


def groups_named(archive: ArchiveFile, names: Sequence[str]) -> tuple[ArchiveGroup, ...]:
    """The experiments of these names, or all where none is given."""
    for name in names:
        if all(name not in (group.name, group.sweep) for group in archive.groups):
            helps = f"in it: {', '.join(by_run(archive.groups))}"
            raise Problem(error("E325", f"no run or sweep `{name}` in {archive.path}", help=helps))
    named = [group for name in names for group in archive.groups if name in (group.name, group.sweep)]
    return tuple(dict.fromkeys(named)) if names else archive.groups


def cases_named(archive: ArchiveFile, names: Sequence[str], case: str | None) -> list[tuple[ArchiveGroup, int | None]]:
    """The experiments of these names; where a case is given, those that have it, with its position in each."""
    groups = groups_named(archive, names)
    if case is None:
        return [(group, None) for group in groups]
    cases: list[tuple[ArchiveGroup, int | None]] = []
    problems = []
    for group in groups:
        try:
            cases.append((group, group.find_case(case)))
        except Problem as problem:
            problems.append(problem)
    if not cases:
        raise Problem([d for problem in problems for d in problem.diagnostics])
    return cases


Role = Literal["case", "choice", "parameter", "repeat", "metric", "change"]
Ended = Literal["met", "missed", "unknown", "done", "failed", "timed out", "lost"]

ENDED: tuple[Ended, ...] = ("met", "missed", "unknown", "done", "failed", "timed out", "lost")
"""Possible outcomes of a case; arrays hold places in this tuple. `done`: it reached its end and there were no
requirements."""


@frozen
class RequirementLimit:
    """A requirement as a line in a plot: its text, its limit in the metric's unit, `<` or `>`."""

    text: str
    value: float
    sense: str


@frozen
class CaseColumn:
    """A number for each case: a metric, or a quantity against which it may be drawn. words: for a choice, those that
    its numbers stand for.

    before  of a metric, what it is in the other archive, where one is compared with; not a number where it has no such
            case. A column of role "change" holds values less before; its key is that of the metric after "change:"
    log     whether an axis of its values is logarithmic
    """

    key: str
    label: str
    unit: str
    role: Role
    values: np.ndarray
    words: tuple[str, ...] = ()
    limits: tuple[RequirementLimit, ...] = ()
    about: str = ""
    before: np.ndarray | None = None
    log: bool = False


class Pool:
    """The cases of the groups of one run or sweep, in the order of the case table."""

    def __init__(self, name: str, groups: Sequence[ArchiveGroup]) -> None:
        self.name, self.groups = name, tuple(groups)
        numbers = [group.values("case").astype(np.int64) for group in groups]
        order = np.argsort(np.concatenate(numbers), kind="stable")
        self.cases = np.concatenate(numbers)[order]
        """Numbers of the cases in the case table."""
        self.group_of = np.repeat(np.arange(len(numbers)), [len(number) for number in numbers])[order]
        self.position_of = np.concatenate([np.arange(len(number)) for number in numbers])[order]

    @property
    def count(self) -> int:
        return len(self.cases)

    def gathered(self, name: str, otherwise: float = np.nan) -> np.ndarray:
        """A variable along `case`, over all groups; `otherwise` where a group lacks it."""
        out = np.full(self.count, otherwise, np.float64)
        for number, group in enumerate(self.groups):
            if name in group.variables:
                in_group = self.group_of == number
                out[in_group] = group.values(name)[self.position_of[in_group]]
        return out

    def texts(self, name: str, places: Sequence[int] | np.ndarray) -> list[str]:
        """A variable of words in the cases at these places."""
        wanted = np.asarray(places, np.int64)
        out = [""] * len(wanted)
        for number, group in enumerate(self.groups):
            mine = np.flatnonzero(self.group_of[wanted] == number)
            if len(mine) and name in group.variables:
                words = group.at(name, self.position_of[wanted[mine]])
                for i, text in zip(mine.tolist(), words.tolist(), strict=True):
                    out[i] = str(text)
        return out

    @cached_property
    def status(self) -> np.ndarray:
        return self.gathered("status", -1.0).astype(np.int64)

    @cached_property
    def requirements(self) -> tuple[str, ...]:
        """Texts of the requirements of all groups."""
        return tuple(dict.fromkeys(text for group in self.groups for text in requirements.requirement_texts(group)))

    @cached_property
    def outcomes(self) -> np.ndarray:
        """The outcome of each requirement in each case, [case, requirement]: 1 met, 0 missed, -1 unknown; 1 where a
        structure does not have the requirement."""
        out = np.ones((self.count, len(self.requirements)), np.int8)
        for number, group in enumerate(self.groups):
            in_group = self.group_of == number
            if "met" in group.variables:
                met = group.values("met")[self.position_of[in_group]]
                for column, text in enumerate(requirements.requirement_texts(group)):
                    out[in_group, self.requirements.index(text)] = met[:, column]
        return out

    def missed(self, column: CaseColumn) -> np.ndarray:
        """True of each case in which a metric misses one of its requirements, [case]."""
        places = [self.requirements.index(limit.text) for limit in column.limits]
        return np.asarray((self.outcomes[:, places] == 0).any(axis=1))

    @cached_property
    def ended(self) -> np.ndarray:
        """The outcome of each case, as its place in `ENDED`, [case]."""
        out = np.full(self.count, ENDED.index("met" if self.requirements else "done"))
        out[(self.outcomes < 0).any(axis=1)] = ENDED.index("unknown")
        out[(self.outcomes == 0).any(axis=1)] = ENDED.index("missed")
        for status in distinct(self.status).tolist():
            if status != DONE:
                word = STATUS.get(status, "failed")
                out[self.status == status] = next(n for n, outcome in enumerate(ENDED) if outcome in (word, "lost"))
        return out

    @cached_property
    def failures(self) -> tuple[FailureGroup, ...]:
        """The cases that did not reach their end, by cause."""
        failed = np.flatnonzero(self.status != DONE)
        causes, ids = (np.array(self.texts(name, failed), dtype=object) for name in ("cause", "case_id"))
        return failures(self.status[failed], causes, self.cases[failed], ids)

    @cached_property
    def limits(self) -> dict[str, tuple[RequirementLimit, ...]]:
        """For each metric's variable, its requirements, limits in SI."""
        out: dict[str, dict[str, RequirementLimit]] = {}
        for group in self.groups:
            for group_requirement in requirements.group_requirements(group):
                out.setdefault(group_requirement.metric, {})[group_requirement.text] = RequirementLimit(
                    group_requirement.text, group_requirement.limit, group_requirement.comparison[:1]
                )
        return {metric: tuple(limits.values()) for metric, limits in out.items()}

    @cached_property
    def ranking(self) -> Ranking:
        """The cases: failed ones, then those that miss most requirements, then by how far they miss
        (`requirements.ranking`).

        The amount is relative to the limit (to the largest value where the limit is 0). Of equal ones those that are
        far from one another in what is varied come first.
        """
        return requirements.ranking(self.status, self.outcomes, self._far(), self._varied)

    def _varied(self, places: np.ndarray) -> list[np.ndarray]:
        """The choices, as numbers, and the varied parameters in the cases at some places, an array each."""
        choices = [self._choice(variable).values for variable in self.variables("choice")]
        numbers = [self.gathered(variable.name) for variable in self.variables("coordinate")]
        return [values[places] for values in (*choices, *numbers)]

    @property
    def worst_first(self) -> np.ndarray:
        """Places of the cases in that order."""
        return self.ranking.order

    def _far(self) -> np.ndarray:
        """The distance of each case beyond the limit that it misses most, relative to that limit."""
        worst = np.full(self.count, -np.inf)
        for metric, limits in self.limits.items():
            values = self.gathered(metric)
            has = np.isin(self.group_of, [n for n, group in enumerate(self.groups) if metric in group.variables])
            for limit in limits:
                far = requirements.beyond(values, limit.sense, limit.value)
                worst = np.where(has, np.maximum(worst, far), worst)
        return worst

    @cached_property
    def columns(self) -> tuple[CaseColumn, ...]:
        """All columns that may be drawn: choices, varied parameters, repeats, metrics; in the deck's units."""
        out = [self._choice(variable) for variable in self.variables("choice")]
        out += [self._numbers(variable, "parameter") for variable in self.variables("coordinate")]
        repeats = self.gathered("repeat", 0.0)
        if repeats.any():
            out.append(CaseColumn("repeat", "repeat", "", "repeat", repeats))
        return (*out, *(self._numbers(variable, "metric") for variable in self.variables("metric")))

    def metrics(self) -> tuple[CaseColumn, ...]:
        return tuple(column for column in self.columns if column.role == "metric")

    def varied(self) -> tuple[CaseColumn, ...]:
        """The columns that distinguish the cases, the one with most values first."""
        return tuple(
            sorted(
                (c for c in self.columns if c.role != "metric" and len(levels(c.values)) > 1),
                key=lambda c: (c.role == "choice", -len(levels(c.values))),
            )
        )

    def variables(self, role: str) -> list[Stored]:
        """The variables of this role in all groups, each name once."""
        return list({v.name: v for group in reversed(self.groups) for v in group.role(role)}.values())

    def _numbers(self, variable: Stored, role: Role) -> CaseColumn:
        """A column of a variable's numbers, in the deck's unit, with the limits that are required of it."""
        scale, unit = deck_unit(variable)
        limits = tuple(
            RequirementLimit(requirement.text, requirement.value / scale, requirement.sense)
            for requirement in self.limits.get(variable.name, ())
        )
        values = self.gathered(variable.name) / scale
        return CaseColumn(
            f"{role}:{variable.name}",
            variable.path,
            unit,
            role,
            values,
            (),
            limits,
            variable.long_name,
            log=is_log(levels(values)) if role == "parameter" else spans(values, METRIC_SPAN),
        )

    def _choice(self, variable: Stored) -> CaseColumn:
        """The column of a choice, whose values number the words in the order in which groups have them."""
        words: dict[str, int] = {}
        values = np.full(self.count, np.nan)
        for number, group in enumerate(self.groups):
            if variable.name in group.variables and group.count:
                word = str(group.at(variable.name, [0])[0])
                values[self.group_of == number] = words.setdefault(word, len(words))
        return CaseColumn(f"choice:{variable.name}", variable.path, "", "choice", values, tuple(words))


def page_number(value: float) -> str:
    """A number as a page shows it."""
    if np.isnan(value):
        return "–"
    return number_text(value).replace("inf", "∞")


def pools(groups: Sequence[ArchiveGroup]) -> list[Pool]:
    """For each run or sweep among the groups, its cases over all its structures."""
    return [Pool(name, own) for name, own in by_run(groups).items()]


STATUS = {DONE: "done", FAILED: "failed", TIMED_OUT: "timed out", LOST: "lost"}
"""Words for how a case ended."""

MOST_RANGES, FEW = 120, 20
"""Largest number of stretches of cases that are listed for one cause, and the number listed if there are more."""

NUMBER = re.compile(r"(?<![\w.])[-+]?\d[\d.]*(e[-+]?\d+)?")


@frozen
class FailureGroup:
    """Cases that failed alike: their status, the cause and id of the first, and all their positions; where an archive
    keeps a summary, only the position of the first, and their number, `of`."""

    status: str
    cause: str
    case_id: str
    cases: tuple[int, ...]
    of: int = 0

    @property
    def count(self) -> int:
        """The number of the cases."""
        return self.of or len(self.cases)

    @property
    def row(self) -> int:
        """The position of the first case."""
        return self.cases[0]


def failures(status: np.ndarray, cause: np.ndarray, case: np.ndarray, case_id: np.ndarray) -> tuple[FailureGroup, ...]:
    """Group failed cases by cause, in the order of their first cases. Causes that differ only in numbers are grouped.

    status, cause, case, case_id   of failed cases, in order
    """
    places_of: dict[tuple[int, str], list[int]] = {}
    for place in range(len(status)):
        places_of.setdefault((int(status[place]), NUMBER.sub("#", str(cause[place]))), []).append(place)
    return tuple(
        FailureGroup(
            STATUS.get(ended, str(ended)),
            str(cause[places[0]]),
            str(case_id[places[0]]),
            tuple(int(case[place]) for place in places),
        )
        for (ended, _), places in places_of.items()
    )


def failure_lines(failure_groups: Sequence[FailureGroup], width: int) -> Iterator[str]:
    """Lines with each cause and its cases, wrapped."""
    width = max(width, 40)
    for failure in failure_groups:
        word = "" if failure.status == "failed" else f"{failure.status}: "
        cause = failure.cause.removeprefix(word)
        if failure.count == 1:
            head = f"  #{failure.row} {failure.case_id[:8]}  {word}"
            yield from textwrap.wrap(cause, width, initial_indent=head, subsequent_indent=" " * len(head))
            continue
        head = f"  {failure.count:,} cases  {word}"
        yield from textwrap.wrap(
            f"{cause} (#{failure.row})", width, initial_indent=head, subsequent_indent=" " * len(head)
        )
        if not failure.of:
            yield from textwrap.wrap(ranges(failure.cases), width, initial_indent="    ", subsequent_indent="    ")


def ranges(cases: Sequence[int]) -> str:
    """Ascending positions in words: `#3, #7-#12`."""
    stretches: list[list[int]] = []
    for case in cases:
        if stretches and case == stretches[-1][1] + 1:
            stretches[-1][1] = case
        else:
            stretches.append([case, case])
    most = MOST_RANGES if len(stretches) <= MOST_RANGES else FEW
    texts = [f"#{first}" if first == last else f"#{first}-#{last}" for first, last in stretches[:most]]
    left = sum(last - first + 1 for first, last in stretches[most:])
    return ", ".join(texts) + (f" and {left:,} more; `cause` in the archive has them all" if left else "")
