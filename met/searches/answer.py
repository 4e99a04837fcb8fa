"""The best answer of a search, from the results of its cases, and the obstacles to a better one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Protocol

import numpy as np

from met.frozen import frozen
from met.plan.searches import JudgedDesign, Search, SearchedParameter
from met.searches.values import MET, MetricLimit, hurt, served


class NamedLimit(MetricLimit, Protocol):
    """A requirement with its text."""

    @property
    def text(self) -> str: ...


@frozen
class Room:
    """The distance of a value inside a limit, as a share of it; below 0 where it is beyond. text: the requirement."""

    text: str
    share: float


@frozen
class NearestMiss:
    """The candidate nearest to the answer among those that were tried and miss a requirement.

    case      the place of the first of its cases that does;  text: the requirement, empty where the case failed
    distance  from the answer, as a share of the parameter's range, by the parameter that is farthest
    """

    case: int
    text: str
    distance: float


@frozen
class Answer:
    """The case that hurts most; or the candidate that serves best, with the worst of its cases.

    case     its place among the cases;  cases: the places of all of the candidate's
    value    of the goal there, SI; not-a-number where it failed, or has none
    failed   whether that case failed
    tried    the number of plants that the candidate was tried against; all: of how many
    missed   texts of the requirements that are missed in any of its cases
    rooms    how far it is inside each limit in its worst case, the nearest first; those without a value are not there
    ends     paths of what is chosen that stand at an end of their range, with `lower` or `upper`
    stability  of a tuning: what was judged of the candidate; None where nothing was
    left     the candidate that is better by the goal, and is not advised for its stability; None where there is none;
             left_value: of the goal in its worst case, SI
    miss     of a tuning: the nearest candidate that misses a requirement; None where none that was tried does
    """

    search: Search
    case: int
    cases: tuple[int, ...]
    value: float
    failed: bool
    tried: int
    all: int
    missed: tuple[str, ...]
    rooms: tuple[Room, ...]
    ends: tuple[tuple[str, str], ...]
    miss: NearestMiss | None
    stability: JudgedDesign | None = None
    left: JudgedDesign | None = None
    left_value: float = float("nan")

    @property
    def confirmed(self) -> bool:
        """True if the candidate was run on all plants (the cases of the sweep that a tuning judges candidates on)."""
        return self.tried == self.all

    @property
    def serves(self) -> bool:
        """True if a tuning's candidate meets all requirements on all plants (the cases that it is judged on) and its
        least margin; for a search, if even the worst case meets them."""
        return self.stands and (self.stability is None or self.search.advises(self.stability))

    @property
    def stands(self) -> bool:
        """True if the candidate meets all requirements on all plants (the cases that it is judged on), whatever its
        stability."""
        return self.confirmed and not self.failed and not self.missed and self.value == self.value


def answer(
    search: Search,
    table: np.ndarray,
    done: np.ndarray,
    metrics: Mapping[str, np.ndarray],
    requirements: Sequence[NamedLimit],
) -> Answer:
    """The best of these cases. table: their coordinates, [case, coordinate], SI, chosen parameters first; done: which
    of them reached their end; metrics: by name, SI."""
    goal, count, left_value = metrics[search.metric], len(search.parameters), float("nan")
    every = max(1, len(search.plants))
    if search.kind == "tune":
        worth = served(goal, search.largest, done, requirements, metrics, search.margin)
        _, first, of_case = np.unique(table[:, :count], axis=0, return_index=True, return_inverse=True)
        of_case = of_case.ravel()
        tried = np.bincount(of_case)
        worst = np.full(len(first), -np.inf)
        np.maximum.at(worst, of_case, worth)
        order = np.lexsort((first, worst, -tried))
        judged = [candidate for candidate in search.judged if candidate.case < len(table)]
        advised = next((candidate for candidate in judged if search.advises(candidate)), None)
        stability = advised or next(iter(judged), None)
        best = order[0] if stability is None else of_case[stability.case]
        left = judged[0] if advised is not None and advised is not judged[0] else None
        cases = np.flatnonzero(of_case == best)
        if left is not None:
            of_left = np.flatnonzero(of_case == of_case[left.case])
            left_value = float(goal[of_left[np.argmax(worth[of_left])]])
        case = int(cases[np.argmax(worth[cases])])
    else:
        stability = left = None
        worth = hurt(goal, search.largest, done)
        case = int(np.argmin(worth))
        cases, every = np.array([case]), 1
    missed = [
        requirement.text
        for requirement in requirements
        if not _met(requirement, metrics[requirement.metric][cases], done[cases]).all()
    ]
    rooms = [
        Room(requirement.text, _room(requirement, metrics[requirement.metric][cases])) for requirement in requirements
    ]
    return Answer(
        search,
        case,
        tuple(cases.tolist()),
        float(goal[case]) if done[case] else float("nan"),
        not bool(done[case]),
        len(cases),
        every,
        tuple(missed),
        tuple(sorted((room for room in rooms if room.share == room.share), key=lambda room: room.share)),
        tuple(_ends(search, table[case])),
        _nearest_miss(search, table, case, done, metrics, requirements) if search.kind == "tune" else None,
        stability,
        left,
        left_value,
    )


def designs_that_stand(search: Search, table: np.ndarray, worth: np.ndarray) -> list[np.ndarray]:
    """The candidates of a tuning that meet all requirements on all plants (the cases that it judges them on), the best
    by the goal first: of each the places of its cases in `table`, its worst first. table: as of `answer`; worth: of the
    cases, as the tuning took it."""
    _, first, of_case = np.unique(table[:, : len(search.parameters)], axis=0, return_index=True, return_inverse=True)
    of_case = of_case.ravel()
    worst = np.full(len(first), -np.inf)
    np.maximum.at(worst, of_case, worth)
    whole = (np.bincount(of_case) == max(1, len(search.plants))) & (worst < MET)
    order = [number for number in np.lexsort((first, worst)).tolist() if whole[number]]
    places = [np.flatnonzero(of_case == number) for number in order]
    return [cases[np.argsort(-worth[cases], kind="stable")] for cases in places]


def _nearest_miss(
    search: Search,
    table: np.ndarray,
    case: int,
    done: np.ndarray,
    metrics: Mapping[str, np.ndarray],
    requirements: Sequence[NamedLimit],
) -> NearestMiss | None:
    """The candidate nearest to that of `case`, among those with a case that fails or misses a requirement;
    None where there is none.

    table    the parameters that are chosen, of each case, [case, parameter]
    done     whether each case ran to its end;  metrics: by name, a value for each case
    """
    met = np.array([_met(requirement, metrics[requirement.metric], done) for requirement in requirements]).reshape(
        -1, len(done)
    )
    bad = np.flatnonzero(~(done & met.all(axis=0)))
    if not len(bad):
        return None
    nearest_case, distance = nearest(search, table, case, bad)
    missed = [requirement.text for requirement, row in zip(requirements, met, strict=True) if not row[nearest_case]]
    return NearestMiss(nearest_case, missed[0] if done[nearest_case] else "", distance)


def nearest(search: Search, table: np.ndarray, case: int, among: np.ndarray) -> tuple[int, float]:
    """The first case, among these places of a table, whose candidate is nearest to that of a case; and its distance, as
    a share of the range of the parameter that is farthest apart."""
    shares = np.stack(
        [shares_of_range(parameter, table[:, column]) for column, parameter in enumerate(search.parameters)]
    )
    distances = np.abs(shares[:, among] - shares[:, [case]]).max(axis=0)
    first = int(np.argmin(distances))
    return int(among[first]), float(distances[first])


def shares_of_range(parameter: SearchedParameter, values: np.ndarray) -> np.ndarray:
    """Places of a parameter's values in its range: 0 at the lower end, 1 at the upper one; on a logarithmic scale where
    the parameter is searched so."""
    low, high = parameter.low, parameter.high
    if parameter.logarithmic:
        values, low, high = np.log(np.abs(values)), float(np.log(abs(low))), float(np.log(abs(high)))
    return np.asarray((values - low) / (high - low))


def _met(limit: MetricLimit, values: np.ndarray, done: np.ndarray) -> np.ndarray:
    compare = {"<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal}[limit.comparison]
    return np.asarray(compare(values, limit.limit) & done)


def _room(limit: MetricLimit, values: np.ndarray) -> float:
    """The distance of the worst of these values inside a limit, as a share of it, or in SI where it is 0."""
    inside = limit.limit - values if limit.comparison.startswith("<") else values - limit.limit
    return float(np.min(inside)) / (abs(limit.limit) or 1.0)


def _ends(search: Search, case: np.ndarray) -> Iterator[tuple[str, str]]:
    """The chosen parameters that are at an end of their range in this case, with the end."""
    for parameter, value in zip(search.parameters, case, strict=False):
        share = float(shares_of_range(parameter, value))
        if not NEAR < share < 1.0 - NEAR:
            yield (parameter.path, "lower" if share < 0.5 else "upper")


NEAR = 0.005
"""The share of its range within which a parameter counts as being at an end of it."""
