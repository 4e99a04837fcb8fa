"""Residuals of a log: what was measured less what a run computed, how large that is, and what it follows.

A residual is white where it is not correlated with itself: then nothing is left that a model could explain. Where it is
not white, it is compared with what it may follow: the signs and sizes of the joint's rate, its position, acceleration
and torque, and the signal itself. The share of a residual's variance that one of these explains is fitted on one half
of the log and judged by the other half: stretches of a sixteenth of the log, by turns. So what fits a half by chance
explains nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy import optimize, stats

from batch.archive.read import ArchiveGroup
from batch.measured.mcap_log import MeasuredSignals
from met.frozen import frozen

STRETCHES = 16
"""Number of stretches of a log of which every other one is of the half that a share is fitted on."""

FEWEST = 8 * STRETCHES
"""Fewest instants of a log of which shares are told."""

LEAST_SHARE = 0.1
"""Least share of a residual's variance that is told, and that each after the first adds."""

ALIKE = 0.8
"""Share of what one adds that another adds in its place, from which on it is told beside it."""

LAGS, WHITE = 10, 0.01
"""Lags of the test of whiteness, in instants of the log, and its level (Ljung and Box, Biometrika 65, 1978)."""

LATEST, FASTEST = 0.5, 0.05
"""Largest delay of a log, s, and largest difference of its clock's rate, that are tried."""

HALVED = 0.25
"""A mistake of a log is suspected where mending it leaves at most this share of the squared residuals."""

OUTLYING, OUTLIERS = 5.0, 0.01
"""An outlier is so many times as far from the middle of nine tenths of a residual as these are; and the largest share
of outliers."""

STILL = 0.01
"""Share of a joint's largest rate below which it has no sign."""

UNLIKE = 0.01
"""Share of a column's mean square that its squared residuals have at least where the column is suspected."""

LATE, NOTHING = 0.5, 1e-6
"""The same share of a log's times, in the mean of its columns; and the share of a column's variance that counts as
none."""

MOST_INSTANTS = 20_000
"""Largest number of a log's instants with which its times are tried."""

FAR = 30.0
"""A column that is so many times what was computed, or as small a part of it, is suspected of another unit."""

LONG_GAP = 1.5
"""A step of a log's time that is longer than this many usual ones is a gap."""

SCALES = {-1.0: "with its sign turned", 1e3: "divided by 1,000", 1e-3: "times 1,000"}
"""Factors by which a column may be wrong, with what mends it: the column is divided by the factor."""

ANGLES = {
    float(np.degrees(1.0)): "read as degrees instead of radians",
    float(np.radians(1.0)): "read as radians instead of degrees",
}
"""The same of columns with angles."""


@frozen
class Explanation:
    """What a residual follows.

    what    in the words of `_features`; means: what leaves such a mark in a model
    size    by how much, in `unit`; of a delay by how long, s, above 0 where the log is late; None where there is no
            single size
    share   of the residual's variance, which it adds to that of those before it
    alike   others that add nearly as much in its place, so that this motion does not tell which it is
    """

    what: str
    means: str
    size: float | None
    unit: str
    share: float
    alike: tuple[str, ...]


@frozen
class Residual:
    """The residual of a channel at `rows` instants of a log, in the SI unit `unit`.

    rms, mean, largest  of measured less computed, the largest with its sign, `at` s
    spread              standard deviation of what was measured
    outliers            instants at which it is far beyond its usual size, of which the following is not made
    correlation         of the residual with the one an instant later; white: whether no lag is correlated, None where
                        the residual is constant
    """

    channel: str
    unit: str
    rows: int
    rms: float
    mean: float
    largest: float
    at: float
    spread: float
    outliers: int
    correlation: float
    white: bool | None
    explained: tuple[Explanation, ...]


@frozen
class Comparison:
    """The residuals of a log and what makes it doubtful.

    doubts   mistakes of the log that, mended, leave at most a quarter of the squared residuals, in words
    gaps     instants (s) at which time goes on by more than one and a half usual steps, with the steps' lengths
    step     the usual step of the log's time, s; of the run's record: `run_step`
    missing  channels that the run records and the log lacks
    """

    residuals: tuple[Residual, ...]
    doubts: tuple[str, ...]
    gaps: tuple[tuple[float, float], ...]
    step: float
    run_step: float
    missing: tuple[str, ...]


@frozen
class Course:
    """A channel as computed: `values` at the run's `times`, s."""

    times: np.ndarray
    values: np.ndarray

    def at(self, instants: np.ndarray) -> np.ndarray:
        return np.interp(instants, self.times, self.values, left=np.nan, right=np.nan)


def computed(group: ArchiveGroup, position: int, columns: Sequence[Mapping[str, str]]) -> dict[str, Course]:
    """The channels of a recorded case as far as they are finite. columns: those of `described_columns`, in order"""
    times = group.values("time")
    signals = list(dict.fromkeys(each["signal"] for each in columns))
    found = np.hstack([group.signal(name, position).reshape(len(times), -1) for name in signals])
    out = {}
    for each, values in zip(columns, found.T.astype(np.float64), strict=True):
        finite = np.isfinite(values)
        if finite.any():
            out[each["channel"]] = Course(times[finite], values[finite])
    return out


def compare(
    courses: Mapping[str, Course], columns: Sequence[Mapping[str, str]], joints: Sequence[str], log: MeasuredSignals
) -> Comparison:
    """Compare a run with a log at the log's instants, as far as both last; between recorded rows, what was computed is
    on straight lines.

    courses  what was computed, by channel; columns: those of `described_columns`; joints: the arm's
    """
    pairs = {name: _Pair(*log.signals[name], courses[name]) for name in courses if name in log.signals}
    pairs = {name: pair for name, pair in pairs.items() if pair.rows.any()}
    units = {each["channel"]: each["unit"] for each in columns}
    kinds = {each["channel"]: (each["signal"], each["unit"]) for each in columns}
    residuals = []
    for name, pair in pairs.items():
        joint = next((each for each in joints if name.startswith(f"{each}.")), "")
        residuals.append(_residual(name, pair, courses, units, joint))
    step, gaps = _clock(pairs)
    run_step = max(
        (float(np.median(np.diff(each.times))) for each in courses.values() if len(each.times) > 1), default=0.0
    )
    missing = tuple(each["channel"] for each in columns if each["channel"] not in log.signals)
    doubts = (*_column_doubts(pairs, kinds), *_clock_doubts(pairs))
    return Comparison(tuple(residuals), doubts, gaps, step, run_step, missing)


@frozen
class _Pair:
    """A channel measured at `instants`, s, and its computed course."""

    instants: np.ndarray
    measured: np.ndarray
    course: Course

    @property
    def rows(self) -> np.ndarray:
        """True at instants at which both have a number."""
        return np.isfinite(self.measured) & np.isfinite(self.course.at(self.instants))

    def squares(self, delay: float = 0.0, rate: float = 0.0, factor: float = 1.0) -> float:
        """Mean square of the residual where the log is late by `delay` s, its clock fast by the share `rate`, and its
        numbers `factor` times too large."""
        residual = self.measured / factor - self.course.at(self.instants / (1.0 + rate) - delay)
        finite = residual[np.isfinite(residual)]
        return float(np.mean(finite**2)) if len(finite) > len(residual) // 2 else np.inf


def _residual(name: str, pair: _Pair, courses: Mapping[str, Course], units: Mapping[str, str], joint: str) -> Residual:
    rows = pair.rows
    instants, measured = pair.instants[rows], pair.measured[rows]
    residual = measured - pair.course.at(instants)
    largest = int(np.argmax(np.abs(residual)))
    usual = _usual(residual)
    correlation, white = _whiteness(residual[usual])
    explained: tuple[Explanation, ...] = ()
    if white is False and np.count_nonzero(usual) >= FEWEST:
        explained = _explained(residual[usual], _features(name, courses, units, joint), instants[usual])
    return Residual(
        name,
        units[name],
        len(residual),
        float(np.sqrt(np.mean(residual**2))),
        float(np.mean(residual)),
        float(residual[largest]),
        float(instants[largest]),
        float(np.std(measured)),
        int(np.count_nonzero(~usual)),
        correlation,
        white,
        explained,
    )


def _usual(residual: np.ndarray) -> np.ndarray:
    """True but for outliers, as long as they are few."""
    low, high = np.quantile(residual, [0.05, 0.95])
    usual = np.abs(residual - 0.5 * (low + high)) <= OUTLYING * 0.5 * (high - low)
    return usual if np.mean(~usual) <= OUTLIERS else np.ones(len(residual), bool)


def _whiteness(residual: np.ndarray) -> tuple[float, bool | None]:
    """Correlation at a lag of one instant, and whether no lag has any."""
    count, centred = len(residual), residual - residual.mean()
    power = float(centred @ centred)
    lags = min(LAGS, count // 4)
    if lags < 1 or power <= 1e-24 * float(residual @ residual):
        return 0.0, None
    each = np.array([centred[lag:] @ centred[:-lag] / power for lag in range(1, lags + 1)])
    statistic = count * (count + 2.0) * float(np.sum(each**2 / (count - np.arange(1, lags + 1))))
    return float(each[0]), bool(stats.chi2.sf(statistic, lags) >= WHITE)


# What a residual follows


@frozen
class _Feature:
    """What a residual may follow. unit: of its size; at: its numbers at instants (s), [instant, number]"""

    what: str
    means: str
    unit: str
    at: Callable[[np.ndarray], np.ndarray]


def _features(name: str, courses: Mapping[str, Course], units: Mapping[str, str], joint: str) -> list[_Feature]:
    own, unit = courses[name], units[name]
    slope = Course(own.times, _rate(own))
    found = [
        _Feature(f"{name} itself", "a unit, a gain, a constant of the motor", "1", lambda t: own.at(t)[:, None]),
        _Feature(f"the rate of {name}", "a delay", "s", lambda t: -slope.at(t)[:, None]),
    ]
    q, qd, tau = (f"{joint}.{signal}" for signal in ("q", "qd", "tau"))
    if tau in courses and name in (q, qd):
        load = courses[tau]
        words = "what yields under load"
        found.append(_Feature(tau, words, f"{unit} per {units[tau]}", lambda t: load.at(t)[:, None]))
    if name in (q, qd):
        return found
    if qd in courses:
        rate = courses[qd]
        faster = Course(rate.times, _rate(rate))
        still = STILL * float(np.abs(rate.values).max())
        found += [
            _Feature(f"the sign of {qd}", "dry friction", unit, lambda t: _sign(rate.at(t), still)[:, None]),
            _Feature(qd, "viscous friction", f"{unit} per {units[qd]}", lambda t: rate.at(t)[:, None]),
            _Feature(
                f"the rate of {qd}", "inertia, payload", f"{unit} per {units[qd]}/s", lambda t: faster.at(t)[:, None]
            ),
        ]
    if q in courses and units[q] == "rad":
        angle = courses[q]
        found.append(_Feature(f"sine and cosine of {q}", "gravity, payload", unit, lambda t: _turned(angle.at(t))))
    return found


def _rate(course: Course) -> np.ndarray:
    return np.gradient(course.values, course.times) if len(course.times) > 1 else np.zeros(len(course.times))


def _sign(rates: np.ndarray, still: float) -> np.ndarray:
    return np.where(np.abs(rates) > still, np.sign(rates), 0.0)


def _turned(angles: np.ndarray) -> np.ndarray:
    return np.stack([np.sin(angles), np.cos(angles)], axis=1)


def _explained(residual: np.ndarray, features: Sequence[_Feature], instants: np.ndarray) -> tuple[Explanation, ...]:
    """One after the other, the feature that adds most to the share of those before it."""
    halves = np.arange(len(residual)) * STRETCHES // len(residual) % 2
    numbers = {each: each.at(instants) for each in features}
    left = [each for each in features if np.isfinite(numbers[each]).all() and np.ptp(numbers[each], axis=0).max() > 0.0]
    chosen: list[_Feature] = []
    gains: list[tuple[float, tuple[str, ...]]] = []
    explained = 0.0
    while left:
        shares = [_share(residual, np.hstack([numbers[one] for one in (*chosen, each)]), halves) for each in left]
        best = int(np.argmax(shares))
        gain = shares[best] - explained
        if gain < LEAST_SHARE:
            break
        others = zip(left, shares, strict=True)
        alike = tuple(each.what for each, share in others if each != left[best] and share - explained >= ALIKE * gain)
        gains.append((gain, alike))
        explained = shares[best]
        chosen.append(left.pop(best))
    if not chosen:
        return ()
    sizes = np.split(
        _fitted(residual, np.hstack([numbers[each] for each in chosen]))[1:],
        np.cumsum([numbers[each].shape[1] for each in chosen])[:-1],
    )
    return tuple(
        Explanation(each.what, each.means, float(size[0]) if len(size) == 1 else None, each.unit, gain, alike)
        for each, size, (gain, alike) in zip(chosen, sizes, gains, strict=True)
    )


def _fitted(residual: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Coefficients of least squares, the constant first."""
    scale = np.abs(numbers).max(axis=0)
    scale[scale == 0.0] = 1.0
    design = np.hstack([np.ones((len(residual), 1)), numbers / scale])
    found = np.linalg.lstsq(design, residual, rcond=1e-10)[0]
    return np.asarray(found / np.concatenate([[1.0], scale]))


def _share(residual: np.ndarray, numbers: np.ndarray, halves: np.ndarray) -> float:
    """Share of the variance that is explained, each half by what is fitted on the other one; below 0 where the fit
    makes it worse."""
    left = 0.0
    for half in (0, 1):
        fitted = _fitted(residual[halves != half], numbers[halves != half])
        here = halves == half
        left += float(np.sum((residual[here] - fitted[0] - numbers[here] @ fitted[1:]) ** 2))
    return 1.0 - left / float(np.sum((residual - residual.mean()) ** 2))


# What makes a log doubtful


def _clock(pairs: Mapping[str, _Pair]) -> tuple[float, tuple[tuple[float, float], ...]]:
    """The usual step of a log's time, s, and its gaps: when and how long."""
    longest = max((pair.instants for pair in pairs.values()), key=len, default=np.empty(0))
    steps = np.diff(longest)
    usual = float(np.median(steps)) if len(steps) else 0.0
    gaps = np.flatnonzero(steps > LONG_GAP * usual)
    return usual, tuple((float(longest[i]), float(steps[i])) for i in gaps)


def _column_doubts(pairs: Mapping[str, _Pair], kinds: Mapping[str, tuple[str, str]]) -> list[str]:
    """Columns that fit with a factor, and pairs of columns that fit when they change places, and not as they are."""
    now = {name: pair.squares() for name, pair in pairs.items()}
    found = []
    for name, pair in pairs.items():
        if now[name] <= UNLIKE * float(np.mean(pair.measured[pair.rows] ** 2)):
            continue
        scales = SCALES | (ANGLES if "rad" in kinds[name][1] else {})
        factor = min(scales, key=lambda each: pair.squares(factor=each))
        after, computed_squares = pair.squares(factor=factor), float(np.mean(pair.course.values**2))
        times = float(np.sqrt(np.mean(pair.measured[pair.rows] ** 2) / computed_squares)) if computed_squares else 1.0
        if after <= HALVED * min(now[name], computed_squares):
            found.append(f"`{name}` of the log fits {scales[factor]}: {_left(after, now[name])}")
        elif not 1.0 / FAR <= times <= FAR:
            found.append(f"`{name}` of the log is {times:.3g} times what was computed: has it another unit?")
    names = list(pairs)
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            if kinds[a] != kinds[b] or min(now[a], now[b]) == 0.0:
                continue
            crossed = [
                _Pair(pairs[x].instants, pairs[x].measured, pairs[y].course).squares() for x, y in ((a, b), (b, a))
            ]
            before, after = now[a] + now[b], sum(crossed)
            if after <= HALVED * before and crossed[0] <= now[b] and crossed[1] <= now[a]:
                found.append(f"`{a}` and `{b}` of the log fit when they change places: {_left(after, before)}")
    return found


def _clock_doubts(pairs: Mapping[str, _Pair]) -> list[str]:
    """A log that fits with another beginning of its time, or another rate of its clock, and not as it is."""
    of = {name: _thinned(pair) for name, pair in pairs.items() if np.var(pair.measured[pair.rows]) > 0.0}
    if not of:
        return []
    variances = {name: float(np.var(pair.measured[pair.rows])) for name, pair in of.items()}

    def squares(delay: float = 0.0, rate: float = 0.0) -> float:
        """The geometric mean over the columns: one of which the model knows little does not hide the others."""
        shares = [pair.squares(delay, rate) / variances[name] + NOTHING for name, pair in of.items()]
        return float(np.exp(np.mean(np.log(shares))))

    def best(score: Callable[[float], float], largest: float) -> tuple[float, float]:
        grid = np.linspace(-largest, largest, 101)
        at = float(grid[int(np.argmin([score(each) for each in grid]))])
        step = 2.0 * largest / 100.0
        found = optimize.minimize_scalar(score, bounds=(at - step, at + step), method="bounded")
        return float(found.x), float(found.fun)

    now = squares()
    (delay, late), (rate, fast) = best(squares, LATEST), best(lambda each: squares(rate=each), FASTEST)
    longest = max((pair.instants for pair in of.values()), key=len)
    shift = abs(delay) if late <= fast else abs(rate) * float(longest[-1] - longest[0])
    if min(late, fast) > LATE * now or shift < float(np.median(np.diff(longest))):
        return []
    if late <= fast:
        change = "less" if delay > 0.0 else "more"
        return [f"the log fits best with its times {abs(delay):.3g} s {change}: {_left(late, now)}"]
    times = "divided by" if rate > 0.0 else "multiplied by"
    factor = 1.0 + rate if rate > 0.0 else 1.0 / (1.0 + rate)
    return [f"the log fits best with its times {times} {factor:.4g}: {_left(fast, now)}"]


def _thinned(pair: _Pair) -> _Pair:
    every = -(-len(pair.instants) // MOST_INSTANTS)
    return _Pair(pair.instants[::every], pair.measured[::every], pair.course)


def _left(after: float, before: float) -> str:
    return f"{np.sqrt(after / before):.2g} of the residual is left"
