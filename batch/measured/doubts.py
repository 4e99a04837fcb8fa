"""Mistakes that a log may have, each tried: it is suspected where mending it leaves at most half of the residual.

These are columns in other units or with the other sign, columns that are exchanged, an encoder's zero elsewhere, and a
clock that is late, early, fast or slow. Columns whose residuals are white are as they should be.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping

import numpy as np
from scipy import optimize

from batch.measured.paired import Pair

FEWEST = 8
"""Fewest instants of a column that is suspected of something."""

LATEST, FASTEST = 0.5, 0.05
"""Largest delay of a log, s, and largest difference of its clock's rate, that are tried."""

HALVED, LATE = 0.25, 0.5
"""Largest shares of a column's squared residuals that mending leaves, and of the mean over columns for the clock."""

UNLIKE = 0.01
"""Least share of a column's mean square that its squared residuals have where it is suspected."""

NOTHING = 1e-6
"""Share of a column's variance that counts as none."""

FAR = 30.0
"""A column that is so many times what was computed, or as small a part of it, is suspected of another unit."""

MOST_INSTANTS = 20_000
"""Largest number of a log's instants with which its clock is tried."""

SCALES = {-1.0: "with its sign turned", 1e3: "divided by 1,000", 1e-3: "times 1,000"}
"""Factors by which a column may be wrong, with what mends it: the column is divided by the factor."""

ANGLES = {
    float(np.degrees(1.0)): "read as degrees instead of radians",
    float(np.radians(1.0)): "read as radians instead of degrees",
}
"""The same of columns with angles."""


def column_doubts(pairs: Mapping[str, Pair], kinds: Mapping[str, tuple[str, str]], white: set[str]) -> Iterator[str]:
    """Columns that fit after a change, and not as they are. kinds: signal and unit of each; white: those that fit as
    they are but for noise"""
    pairs = {name: pair for name, pair in pairs.items() if len(pair.instants) >= FEWEST}
    residuals = {name: _mean_square(pair.residual) for name, pair in pairs.items()}
    for name, pair in pairs.items():
        unlike = residuals[name] > UNLIKE * _mean_square(pair.measured)
        if unlike and (doubt := _column_doubt(name, pair, kinds[name][1], residuals[name], name in white)):
            yield doubt
    names = [name for name in pairs if name not in white]
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            if kinds[a] == kinds[b]:
                yield from _exchanged(a, b, pairs, residuals)


def _column_doubt(name: str, pair: Pair, unit: str, now: float, white: bool) -> str:
    """The change of unit, sign or offset with which a column of a log fits much better, in words; "" where none
    does."""
    course = pair.course.at(pair.instants)
    if not white and not np.ptp(pair.measured) and np.ptp(course):
        return f"`{name}` of the log does not change"
    square = _mean_square(course)
    scales = {} if white else SCALES | (ANGLES if "rad" in unit else {})
    left = {factor: _mean_square(pair.measured / factor - course) for factor in scales}
    factor = min(left, key=lambda way: left[way], default=1.0)
    if left and left[factor] <= HALVED * min(now, square):
        return f"`{name}` of the log fits {scales[factor]}: {_left(left[factor], now)}"
    times = math.sqrt(_mean_square(pair.measured) / square) if square else 1.0
    if not white and not 1.0 / FAR <= times <= FAR:
        return f"`{name}` of the log is {times:.3g} times what was computed: has it another unit?"
    mean = float(np.mean(pair.residual))
    if now - mean**2 <= HALVED * min(now, float(np.var(course))):
        size = f"{abs(mean):.3g} {unit}".removesuffix(" 1")
        return f"`{name}` of the log fits with {size} {'less' if mean > 0.0 else 'more'}: {_left(now - mean**2, now)}"
    return ""


def _exchanged(a: str, b: str, pairs: Mapping[str, Pair], residuals: Mapping[str, float]) -> list[str]:
    """A doubt in words that two channels of a log are exchanged, where that leaves at most half of their residuals;
    else none."""
    crossed = [Pair.of(pairs[x].instants, pairs[x].measured, pairs[y].course) for x, y in ((a, b), (b, a))]
    if any(len(pair.instants) < FEWEST for pair in crossed):
        return []
    left = [_mean_square(pair.residual) for pair in crossed]
    now, after = residuals[a] + residuals[b], sum(left)
    if now == 0.0 or after > HALVED * now or left[0] > residuals[b] or left[1] > residuals[a]:
        return []
    return [f"`{a}` and `{b}` of the log fit when they change places: {_left(after, now)}"]


LONG_GAP, MOST_JUMPS = 1.5, 5
"""A step of a log's time that is longer than this many usual ones is a gap; and the largest number of gaps that are
tried as jumps of its clock."""


def clock_doubts(pairs: Mapping[str, Pair]) -> list[str]:
    """A log that fits with another beginning of its time, or another rate of its clock, and not as it is; but none that
    fits best at the largest change that is tried."""
    moving = [pair.thinned(MOST_INSTANTS) for pair in pairs.values() if len(pair.instants) >= FEWEST]
    moving = [pair for pair in moving if np.var(pair.measured) > 0.0]
    if not moving:
        return []

    def share(delay: float = 0.0, rate: float = 0.0, jump: tuple[float, float] = (math.inf, 0.0)) -> float:
        """Geometric mean over the columns: one of which the model knows little does not hide the others. jump: an
        instant, s, and by how much later ones come earlier"""
        residual_shares = []
        for pair in moving:
            instants = pair.instants - np.where(pair.instants > jump[0], jump[1], 0.0)
            residual = pair.measured - pair.course.at(instants / (1.0 + rate) - delay)
            residual = residual[np.isfinite(residual)]
            if 2 * len(residual) < len(pair.instants):
                return math.inf
            residual_shares.append(_mean_square(residual) / float(np.var(pair.measured)) + NOTHING)
        return float(np.exp(np.mean(np.log(residual_shares))))

    now, (delay, late), (rate, fast) = share(), _best(share, LATEST), _best(lambda trial: share(rate=trial), FASTEST)
    longest = max((pair.instants for pair in moving), key=len)
    usual, gaps = gaps_of(max((pair.instants for pair in pairs.values()), key=len))
    jumps = [(instant, length - usual) for instant, length in gaps]
    if 0 < len(jumps) <= MOST_JUMPS:
        left, (instant, length) = min((share(jump=jump), jump) for jump in jumps)
        if left <= min(LATE * now, late, fast):
            return [f"the log fits best with its times after {instant:.4g} s {length:.3g} s less: {_left(left, now)}"]
    span, step = float(longest[-1] - longest[0]), float(np.median(np.diff(longest)))
    edge, shift = (abs(delay) / LATEST, abs(delay)) if late <= fast else (abs(rate) / FASTEST, abs(rate) * span)
    if edge > 0.98 or shift < step or min(late, fast) > LATE * now:
        return []
    if late <= fast:
        change = "less" if delay > 0.0 else "more"
        return [f"the log fits best with its times {abs(delay):.3g} s {change}: {_left(late, now)}"]
    times, factor = ("divided by", 1.0 + rate) if rate > 0.0 else ("multiplied by", 1.0 / (1.0 + rate))
    digits = max(3, math.ceil(math.log10(span / step)) + 1)
    return [f"the log fits best with its times {times} {round(factor, digits)}: {_left(fast, now)}"]


def gaps_of(instants: np.ndarray) -> tuple[float, tuple[tuple[float, float], ...]]:
    """The usual step of a log's time, s, and its gaps: when each begins, and how long it is, s."""
    steps = np.diff(instants)
    usual = float(np.median(steps)) if len(steps) else 0.0
    gaps = np.flatnonzero(steps > LONG_GAP * usual)
    return usual, tuple((float(instants[i]), float(steps[i])) for i in gaps)


def _best(score: Callable[[float], float], largest: float) -> tuple[float, float]:
    """The number up to `largest`, of either sign, with the lowest score, and its score."""
    grid = np.linspace(-largest, largest, 101)
    lowest = float(grid[int(np.argmin([score(trial) for trial in grid]))])
    step = 2.0 * largest / 100.0
    bounds = (max(lowest - step, -largest), min(lowest + step, largest))
    optimum = optimize.minimize_scalar(score, bounds=bounds, method="bounded", options={"xatol": 1e-7})
    return float(optimum.x), float(optimum.fun)


def _mean_square(numbers: np.ndarray) -> float:
    return float(np.mean(numbers**2))


def _left(after: float, before: float) -> str:
    return f"{math.sqrt(max(after, 0.0) / before):.2g} of the residual is left"
