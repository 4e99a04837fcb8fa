"""A search or a tuning in a plan: the parameters that it may choose, their bounds, and its goal.

Its cases are not known before it has run: each generation follows from the results of the ones before (met/searches).
Until then its case table is its first generation.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from met.diagnostic import Place
from met.frozen import frozen
from met.plan.drawing import drawn_values
from met.unit_parser import parse_unit

MOST_SEARCHED = 1_000_000
"""Largest number of cases of a search."""

MOST_PLANTS = 10_000
"""Largest number of cases of a sweep against which a tuning is judged."""

SHORTEST = 10
"""Smallest number of candidates of a tuning."""


@frozen
class SearchedParameter:
    """A chosen parameter, by its path: its bounds in SI, and the unit in which values are rounded, "" for 1.

    logarithmic  whether equal ratios are equal steps, rather than equal differences
    """

    path: str
    low: float
    high: float
    logarithmic: bool = False
    unit: str = ""

    def values(self, points: np.ndarray) -> np.ndarray:
        """Values in SI at these points of the unit interval, rounded to 12 digits in the deck's unit."""
        measure = parse_unit(self.unit) if self.unit else None
        scale = "loguniform" if self.logarithmic else "uniform"
        return drawn_values(scale, (self.low, self.high), measure, points)


LEAST_MARGIN, USUAL_MARGIN = 0.3, 0.67
"""Disk margins: below the first (a gain of 1.35, or 17 deg) a design is not advised, where a deck says nothing else;
below the second (6 dB, 37 deg) it is less than usual."""


def allowed_gain(disk: float) -> float:
    """The factor by which a disk margin allows a gain to rise or fall."""
    return (1.0 + 0.5 * disk) / (1.0 - 0.5 * disk) if disk < 2.0 else math.inf


@frozen
class LeastMargins:
    """The least stability margins of an experiment's servo loops over some of its cases, at poses that these pass.

    disk    alpha of a balanced disk (docs/linear.md); 0 where a loop is unstable. A gain margin g of all loops at once
            counts as the disk that allows it, 2 (g - 1)/(g + 1)
    gain    factor by which a loop's gain may rise or fall, or that of all at once;  delay: s by which a law's output
            may come later; infinite where nothing limits it, not-a-number where a law ticks several times in a frame
    joints  of the loop with the least disk; of all of them where that is of all at once, or where they are unstable;
            case: position in the case table, and time: s, at which it is so
    loops, cases, poses  how many were looked at
    """

    disk: float
    gain: float
    delay: float
    joints: tuple[str, ...]
    case: int
    time: float
    loops: int
    cases: int
    poses: int


@frozen
class JudgedDesign:
    """The stability of a candidate of a tuning.

    case     position in the case table of the first of its cases
    margins  None where there are none, for the reason `why_not`, in words
    """

    case: int
    margins: LeastMargins | None
    why_not: str = ""

    def keeps(self, least_margin: float) -> bool:
        """True where the design keeps a least disk margin, or has none that could be judged."""
        return self.margins is None or self.margins.disk >= least_margin


@frozen
class TuningStart:
    """A start of a tuning, and what it came to.

    first  position in the case table of its first case
    best   position of the worst case of its best design that meets all requirements with all plants; -1 for none
    """

    first: int
    best: int


@frozen
class Confirmation:
    """The outcome of the design of a tuning in cases that did not choose it.

    against  the sweep that drew them
    failed   cases that failed;  missed: others that miss a requirement, or have no value of one or of the goal
    worst    of the goal in those that have one, SI; not-a-number where none has
    """

    against: str
    cases: int
    failed: int
    missed: int
    worst: float

    @property
    def withstood(self) -> bool:
        """True where the design meets all requirements in all of them."""
        return not self.failed and not self.missed


def are_starts(starts: tuple[TuningStart, ...], cases: int) -> bool:
    """True if a tuning of so many cases can have had these starts."""
    ends = [start.first for start in starts[1:]] + [cases]
    return not starts or (
        starts[0].first == 0
        and all(start.first < end for start, end in zip(starts, ends, strict=True))
        and all(start.best == -1 or start.first <= start.best < end for start, end in zip(starts, ends, strict=True))
    )


@frozen
class Search:
    """A search or a tuning: its goal, and the bounds of the chosen parameters.

    kind         "search": the case that hurts most; "tune": the parameters that serve best;  of: the run's name
    metric       the goal, and `largest`: whether it is to be that
    parameters   that are chosen; the first coordinates of the cases
    at_most      cases in all
    against      the sweep whose cases a tuning is held against, "" for none; plants: the values of its coordinates in
                 each of them, SI; these are the coordinates behind those that are chosen;  drawn_with: the seed of what
                 it draws
    margin       share of its limit by which a tuning would stay inside each requirement, and of its goal what it would
                 pay for that
    gradients    whether a tuning takes steps along slopes of its metrics, where they have any
    least_margin  disk margin below which a design is not advised; 0: none is asked for;  steers: whether it is also
                  required of the candidates, by the poses in which their cases begin
    generations  numbers of cases that each generation added to the case table; none before it has run
    along_slopes  how many of its cases were tried along slopes, and `without_slopes`: why there were none where there
                 were none last, in words, empty where there were; as found when it has run
    starts       of a tuning that has run: where it began, and what it came to from there
    confirms     the sweep with whose cases the design of a tuning is run in the end, "" for none; fresh: these, as
                 `plants`; they count among `at_most`, but are not in the case table
    confirmation  what came of it, of a tuning that has run and found a design that stands; one at most
    judged       the designs whose stability was judged when it had run, the best by its goal first, until one keeps the
                 least margin; none of a search, or of one that was run before MET judged it
    """

    kind: Literal["search", "tune"]
    metric: str
    largest: bool
    parameters: tuple[SearchedParameter, ...]
    at_most: int
    of: str = ""
    seed: int = 0
    against: str = ""
    plants: tuple[tuple[float, ...], ...] = ()
    drawn_with: int = 0
    margin: float = 0.0
    generations: tuple[int, ...] = ()
    gradients: bool = False
    along_slopes: int = 0
    without_slopes: str = ""
    starts: tuple[TuningStart, ...] = ()
    least_margin: float = LEAST_MARGIN
    steers: bool = False
    judged: tuple[JudgedDesign, ...] = ()
    confirms: str = ""
    fresh: tuple[tuple[float, ...], ...] = ()
    confirmation: tuple[Confirmation, ...] = ()
    place: Place | None = None

    @property
    def complete(self) -> bool:
        """True where the case table holds all of its cases, and not only its first generation."""
        return bool(self.generations)

    @property
    def budget(self) -> int:
        """The largest number of cases of its table."""
        return self.at_most - len(self.fresh)

    def advises(self, design: JudgedDesign) -> bool:
        """True where a judged design keeps the least margin, or has none that could be judged."""
        return design.keeps(self.least_margin)

    @property
    def goal(self) -> str:
        """The goal as a deck writes it: `minimise settle`."""
        return f"{'maximise' if self.largest else 'minimise'} {self.metric}"

    def values(self, points: np.ndarray) -> np.ndarray:
        """Values of the chosen parameters, [candidate, parameter], SI, at these points of the unit cube."""
        columns = [parameter.values(points[:, number]) for number, parameter in enumerate(self.parameters)]
        return np.stack(columns, axis=1) if len(points) else np.empty((0, len(self.parameters)))

    def generation_of(self, rows: np.ndarray) -> np.ndarray:
        """The number of the generation, from 0, that added each of these rows of the case table."""
        return np.searchsorted(np.cumsum(self.generations), rows, side="right") if self.complete else 0 * rows
