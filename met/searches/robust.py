"""A tuning against plants, in turns: tune against the active ones, try the best against all, add the worst.

Where metrics have slopes, a turn goes on from its best along these: CMA-ES finds the valley, and a few steps its floor.
So an inner loop of a few plants decides for many (P. Apkarian, M. N. Dao, D. Noll, Parametric robust structured control
design, IEEE Trans. Automatic Control 60 (2015) 1857). The worth of a candidate is that of its worst plant.
"""

from __future__ import annotations

import math

import numpy as np

from met import optimisers
from met.plan.searches import SHORTEST, Search
from met.searches.slopes import SlopeSource, SlopeSteps
from met.searches.values import MET


class HardestCase:
    """Method of a search for the worst case (`SearchMethod`). A point that is rounded to a former case gets that case's
    worth."""

    def __init__(self, search: Search) -> None:
        self._search = search
        self._optimiser = optimisers.hardest(len(search.parameters), search.seed, search.at_most)
        self._known: dict[bytes, float] = {}
        self._batch: list[bytes] = []
        self._new: list[bytes] = []

    def ask(self) -> np.ndarray:
        """Coordinates of the next generation's cases, [case, coordinate], at which the optimiser looks for the worst
        (`SearchMethod.ask`)."""
        left = self._search.at_most - len(self._known)
        while left > 0:
            cases = self._search.values(self._optimiser.ask())
            if not len(cases):
                break
            self._batch = [case.tobytes() for case in cases]
            first = {key: place for place, key in reversed(list(enumerate(self._batch)))}
            places = sorted(place for key, place in first.items() if key not in self._known)
            if len(places) > left:
                break
            self._new = [self._batch[place] for place in places]
            if places:
                return cases[places]
            self._pass_on()
        return np.empty((0, len(self._search.parameters)))

    def tell(self, values: np.ndarray) -> None:
        """Take the worths of the cases that were asked last (`SearchMethod.tell`)."""
        self._known.update(zip(self._new, values.tolist(), strict=True))
        self._pass_on()

    def _pass_on(self) -> None:
        self._optimiser.tell(np.array([self._known[key] for key in self._batch]))


SHARE = 4
"""Divisor of the remaining cases that gives a turn's number of cases, while plants may become active."""

EARLIER = 8
"""The divisor for a turn of CMA-ES with slopes: it need not reach the floor of a valley. After steps that ended away
from a floor it is `SHARE`: they may be in the wrong valley."""

GAIN = 1e-3
"""Relative improvement of the goal below which a turn counts as idle."""

IDLE = 2
"""Number of idle turns after which a tuning ends; the second has twice as many cases. With slopes it then begins
afresh, and ends after this many idle fresh beginnings."""

AFRESH = 2
"""Divisor of the remaining cases for the first turn of a fresh beginning. A short turn comes before: where it leads
into a wrong valley, steps along slopes go to the floor of that one, and no turn around it comes out again."""

INSIDE = 0.05
"""Smallest distance of the middle of a turn from the ends of the cube, so that there are points on both sides of it."""

Candidate = bytes
"""The values of a candidate's parameters, as bytes."""


class RobustTuning:
    """Method of a tuning (`SearchMethod`). Without plants the candidates themselves are the cases.

    source      of slopes; None: there are none
    beginnings  numbers of the cases that were asked for before each fresh beginning

    A turn ends when the optimiser does, or when its share of the cases that are left is spent, and then the steps along
    slopes have ended. A plant that becomes active where these have settled takes steps alone. The tuning ends when no
    plant is worse than the worst active one and two turns brought next to nothing, or when no further turn has room.
    With slopes it has soon come to the floor of a valley, which may be the wrong one. So it begins afresh with what is
    left, against the plant that was worst, from the middle of the cube, and then from opposite to the best.
    """

    def __init__(self, search: Search, source: SlopeSource | None = None) -> None:
        self._search, self._plants = search, search.plants or ((),)
        self.steps = None if source is None else SlopeSteps(search, source)
        self._left = search.budget
        self._points: dict[Candidate, np.ndarray] = {}
        self._known: dict[Candidate, dict[int, float]] = {}
        self._active, self._turn = [0], 0
        self._batch: list[Candidate] = []
        self._wanted: list[tuple[Candidate, int]] = []
        self._confirmed = self._confirming = self._converged = False
        self._may_ask = 0
        self._borne: float | None = None
        self._idle = 0
        self._since_beginning: dict[Candidate, None] = {}
        self._best_before: float | None = None
        self._fruitless = 0
        self.beginnings: list[int] = []
        self._begins_afresh = False
        self._begin_turn(None)

    def ask(self) -> np.ndarray:
        """Coordinates of the next generation's cases, [case, coordinate]: each candidate with the plants (cases of a
        sweep to judge it on) that it is run on (`SearchMethod.ask`)."""
        while not self._confirmed:
            self._wanted = self._next()
            if self._wanted:
                if self._begins_afresh:
                    self.beginnings.append(self._search.budget - self._left)
                    self._begins_afresh = False
                self._left -= len(self._wanted)
                return np.array(
                    [[*np.frombuffer(candidate), *self._plants[plant]] for candidate, plant in self._wanted]
                )
            if not self._confirmed:
                self._go_on()
        return np.empty((0, len(self._search.parameters) + len(self._plants[0])))

    def tell(self, values: np.ndarray) -> None:
        """Take the worths of the cases that were asked last (`SearchMethod.tell`)."""
        for (candidate, plant), value in zip(self._wanted, values.tolist(), strict=True):
            self._known[candidate][plant] = value
        self._go_on()

    def _begin_afresh(self) -> None:
        """Begin again after steps along slopes, from the middle of the cube, or, if that was idle, from opposite to the
        best point; if that was idle too, the tuning is over."""
        worths = {
            candidate: max(known.values())
            for candidate, known in self._known.items()
            if len(known) == len(self._plants)
        }
        least, before = min(worths.values(), default=math.inf), self._best_before
        better = before is None or (least < before and not hardly_better(least, before))
        self._best_before, self._fruitless = least, 0 if better else self._fruitless + 1
        stepped = self.steps is not None and self.steps.cases > 0
        room = self._left - len(self._plants) + 1
        if not stepped or not worths or self._fruitless == IDLE or room < SHORTEST:
            self._confirmed = True
            return
        best = min(worths, key=lambda candidate: worths[candidate])
        known = self._known[best]
        self._active = [max(known, key=lambda number: known[number])]
        self._since_beginning, self._borne, self._idle = {}, None, 0
        self._begins_afresh = True
        self._begin_turn(1.0 - self._points[best] if self._fruitless else None)

    def _begin_turn(self, start: np.ndarray | None) -> None:
        """Begin a turn, which tunes on the active plants (cases to judge on) around a good candidate or in the middle,
        if enough cases are left; else begin afresh."""
        room = self._left - self._reserve
        if room < SHORTEST * len(self._active):
            self._begin_afresh()
            return
        least = SHORTEST * len(self._active)
        first, stepping = self._turn == 0, self.steps is not None and self.steps.cases > 0
        goes_by_slopes = self._search.gradients and (first or stepping)
        settled = first or (self.steps is not None and self.steps.settled)
        share = (EARLIER if goes_by_slopes and settled else SHARE) >> self._idle
        if not self._since_beginning and not first:
            share = AFRESH
        whole = room < 2 * least or (self._reserve == 0 and not goes_by_slopes)
        cases = room if whole else max(room // share, least)
        dimension, seed = len(self._search.parameters), self._search.seed + self._turn
        self._may_ask = cases // len(self._active)
        self._tuner, self._middle = optimisers.tuner(dimension, seed, self._may_ask), start
        self._turn += 1
        self._confirming = False

    @property
    def _reserve(self) -> int:
        """The number of cases that it takes to run the best candidate of a turn on the plants that it was not tuned
        on."""
        return len(self._plants) - len(self._active)

    def _next(self) -> list[tuple[Candidate, int]]:
        """The next candidates, each with the plants (cases to judge it on) that it has not been run on yet."""
        if not self._confirming and (self.steps is None or not self.steps.going):
            before = len(self._batch)
            wanted = self._of_points(around(self._middle, self._tuner.ask()))
            self._converged = not self._batch and self._may_ask >= before
            self._may_ask -= len(self._batch)
            if self._has_room(wanted):
                return wanted
            self._step_from(self._best())
        if not self._confirming and self.steps is not None and self.steps.going:
            wanted = self._of_points(self.steps.ask())
            if self._has_room(wanted):
                self.steps.cases += len(wanted)
                return wanted
            self.steps.end()
        self._confirming = True
        wanted = self._unknown([self._best()], range(len(self._plants)))
        self._confirmed = len(wanted) > self._left
        return [] if self._confirmed else wanted

    def _of_points(self, points: np.ndarray) -> list[tuple[Candidate, int]]:
        """The candidates at these points of the unit cube that are new, each to be run on the active plants (those that
        are tuned against in this turn)."""
        self._batch = [value.tobytes() for value in self._search.values(points)]
        for candidate, point in zip(self._batch, points, strict=True):
            self._points.setdefault(candidate, point)
            self._known.setdefault(candidate, {})
            self._since_beginning[candidate] = None
        return self._unknown(self._batch, self._active)

    def _has_room(self, wanted: list[tuple[Candidate, int]]) -> bool:
        """True if there are candidates, and running the new ones leaves enough cases to run the best on all plants."""
        return bool(self._batch) and len(wanted) <= self._left - self._reserve

    def _step_from(self, candidate: Candidate) -> None:
        """Begin steps along slopes, where there are any."""
        if self.steps is not None:
            self.steps.begin(
                self._points[candidate], np.frombuffer(candidate), self._active_plants, self._worst(candidate)
            )

    @property
    def _active_plants(self) -> list[tuple[float, ...]]:
        return [self._plants[number] for number in self._active]

    def _unknown(self, candidates: list[Candidate], plants: list[int] | range) -> list[tuple[Candidate, int]]:
        once = dict.fromkeys(candidates)
        return [(candidate, plant) for candidate in once for plant in plants if plant not in self._known[candidate]]

    def _go_on(self) -> None:
        """Hand the results of a generation to the optimiser; after a turn, when the best was run on all plants, add the
        plant on which it is worst to the active ones and begin the next turn."""
        if not self._confirming:
            if self.steps is not None and self.steps.going:
                candidate = self._batch[0]
                self.steps.tell(np.frombuffer(candidate), self._active_plants, self._worst(candidate))
            else:
                self._tuner.tell(np.array([self._worst(candidate) for candidate in self._batch]))
            return
        best = self._best()
        plant = max(range(len(self._plants)), key=lambda number: self._known[best][number])
        if self._known[best][plant] > self._worst(best):
            self._active.append(plant)
            if self.steps is not None and self.steps.settled:
                self._step_from(best)
                self._confirming = not self.steps.going
                if self.steps.going:
                    return
        else:
            worth, before = self._worst(best), self._borne
            self._idle = self._idle + 1 if before is not None and hardly_better(worth, before) else 0
            if self._converged or self._idle == IDLE:
                self._begin_afresh()
                return
            self._borne = worth
        self._begin_turn(self._points[best])

    def _best(self) -> Candidate:
        """The candidate with the best worth on the active plants (those that are tuned against now), among those that
        were run on all of them since the last fresh beginning."""
        tried = [candidate for candidate in self._since_beginning if self._known[candidate].keys() >= set(self._active)]
        return min(tried, key=self._worst)

    def _worst(self, candidate: Candidate) -> float:
        """The worth of a candidate on the active plant (one that is tuned against now) on which it is worst."""
        return max(self._known[candidate][plant] for plant in self._active)


def around(middle: np.ndarray | None, points: np.ndarray) -> np.ndarray:
    """Points of the cube stretched so that its middle, where a tuner begins, comes to lie at a good one; the ends stay.

    middle  None: the cube's own
    """
    if middle is None or not len(points):
        return points
    centre = np.clip(middle, INSIDE, 1.0 - INSIDE)
    return np.where(points < 0.5, 2.0 * centre * points, centre + (1.0 - centre) * (2.0 * points - 1.0))


def hardly_better(now: float, before: float) -> bool:
    """True if the goal of a candidate that meets all requirements, by its worth (`served`), has hardly improved."""
    if not (abs(now) < MET and abs(before) < MET):
        return False
    new, other = (worth / (1.0 - abs(worth)) for worth in (now, before))
    return abs(new - other) <= GAIN * abs(other)
