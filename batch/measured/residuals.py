"""Residuals of a log: what was measured less what a run computed, how large that is, and what it follows.

A residual is white where it is not correlated with itself: then nothing is left that a model could explain. Where it is
not white, it is compared with what it may follow: the signs and sizes of the joint's rate, its position, acceleration
and torque, and the signal itself. The share of a residual's variance that one of these explains is fitted on one half
of the log and judged by the other half: stretches of a sixteenth of the log, by turns. So what fits a half by chance
explains nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from scipy import stats

from batch.measured.doubts import LATEST, clock_doubts, column_doubts, gaps_of
from batch.measured.mcap_log import MeasuredSignals
from batch.measured.paired import ComputedChannel, Pair, autocorrelation
from met.frozen import frozen

STRETCHES = 16
"""Largest number of stretches of a log, of which every other one is of the half that a share is fitted on."""

FEWEST = 8 * STRETCHES
"""Fewest instants of a log of which shares are told."""

LEAST_SHARE = 0.1
"""Least share of a residual's variance that is told, and that each after the first adds."""

ALIKE = 0.8
"""Share of what one adds that another adds in its place, from which on it is told beside it."""

LAGS, WHITE = 10, 0.01
"""Lags of the test of whiteness, in instants of the log, and its level (Ljung and Box, Biometrika 65, 1978)."""

STILL = 0.01
"""Share of a joint's largest rate below which it has no sign."""

ALIKE_FOR, SHORTEST = 3.0, 4
"""A stretch is at least so many times as long as a residual stays alike, and a log at least so many stretches."""

ROUNDING = 1e-12
"""Share of the largest number below which a spread is that of rounding."""

MOST_INSTANTS = 20_000
"""Largest number of instants with which shares are reckoned."""

UNEVEN = 0.05
"""Share of gaps among a log's steps from which on its time is uneven."""


@frozen
class FollowedCause:
    """A cause that a residual follows.

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
                        the residual is constant, or of too few instants
    too_short           whether the log is too short to say what the residual follows
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
    explained: tuple[FollowedCause, ...]
    too_short: bool


@frozen
class Comparison:
    """The residuals of a log and what makes it doubtful.

    doubts   mistakes of the log that are suspected, in words
    gaps     instants (s) at which time goes on by more than one and a half usual steps, with the steps' lengths;
             uneven: whether a twentieth of the steps are gaps
    step     the usual step of the log's time, s; of the run's record: `run_step`
    log_span, run_span  first and last instant of each, s; left_out: numbers of the log without one of the run
    missing  channels that the run records and the log lacks; unused: what the log has besides
    """

    residuals: tuple[Residual, ...]
    doubts: tuple[str, ...]
    gaps: tuple[tuple[float, float], ...]
    uneven: bool
    step: float
    run_step: float
    log_span: tuple[float, float]
    run_span: tuple[float, float]
    left_out: int
    missing: tuple[str, ...]
    unused: tuple[str, ...]


def compare(
    courses: Mapping[str, ComputedChannel],
    columns: Sequence[Mapping[str, str]],
    joints: Sequence[str],
    log: MeasuredSignals,
) -> Comparison:
    """Compare a run with a log of measured signals at the log's instants, as far as both last; between recorded rows,
    what was computed is on straight lines.

    courses  computed signals over time, by channel; columns: those of `described_columns`; joints: the arm's
    """
    pairs = {name: Pair.of(*log.signals[name], courses[name]) for name in courses if name in log.signals}
    pairs = {name: pair for name, pair in pairs.items() if len(pair.instants)}
    units = {column["channel"]: column["unit"] for column in columns}
    kinds = {column["channel"]: (column["signal"], column["unit"]) for column in columns}
    residuals = []
    for name, pair in pairs.items():
        joint = next((joint_name for joint_name in joints if name.startswith(f"{joint_name}.")), "")
        residuals.append(_residual(name, pair, courses, units, joint))
    usual = {name: pair.usual() for name, pair in pairs.items()}
    white = {residual.channel for residual in residuals if residual.white}
    times = [log.signals[name][0] for name in courses if name in log.signals]
    longest = max(times, key=len, default=np.empty(0))
    step, gaps = gaps_of(longest)
    return Comparison(
        tuple(residuals),
        (*column_doubts(usual, kinds, white), *clock_doubts(usual)),
        gaps,
        len(gaps) > UNEVEN * (len(longest) - 1),
        step,
        max(
            (float(np.median(np.diff(course.times))) for course in courses.values() if len(course.times) > 1),
            default=0.0,
        ),
        _span(times),
        _span([course.times for course in courses.values()]),
        sum(len(time) for time in times) - sum(residual.rows for residual in residuals),
        tuple(column["channel"] for column in columns if column["channel"] not in log.signals),
        tuple(log.unused),
    )


def _span(times: Sequence[np.ndarray]) -> tuple[float, float]:
    """The first and the last of all these instants, s; 0 and 0 where there are none."""
    first = min((float(time[0]) for time in times if len(time)), default=0.0)
    last = max((float(time[-1]) for time in times if len(time)), default=0.0)
    return first, last


def _residual(
    name: str, pair: Pair, courses: Mapping[str, ComputedChannel], units: Mapping[str, str], joint: str
) -> Residual:
    """The residual of a channel, the log's numbers less the run's, and the causes that it follows. joint: the
    channel's, "" where it has none"""
    residual, usual = pair.residual, pair.usual()
    largest = int(np.argmax(np.abs(residual)))
    correlation, white = _whiteness(usual.residual)
    spread = float(np.std(pair.measured))
    few = len(usual.instants) < FEWEST
    explained = () if white is not False or few else _explained(usual, list(_features(name, courses, units, joint)))
    return Residual(
        name,
        units[name],
        len(residual),
        float(np.sqrt(np.mean(residual**2))),
        float(np.mean(residual)),
        float(residual[largest]),
        float(pair.instants[largest]),
        spread if spread > ROUNDING * float(np.abs(pair.measured).max()) else 0.0,
        len(residual) - len(usual.instants),
        correlation,
        white,
        explained or (),
        explained is None or (few and white is False),
    )


def _whiteness(residual: np.ndarray) -> tuple[float, bool | None]:
    """Correlation at a lag of one instant, and whether no lag has any."""
    count, centred = len(residual), residual - residual.mean()
    power = float(centred @ centred)
    lags = min(LAGS, count // 4)
    if lags < 2 or power <= 1e-24 * float(residual @ residual):
        return 0.0, None
    correlations = np.array([centred[lag:] @ centred[:-lag] / power for lag in range(1, lags + 1)])
    statistic = count * (count + 2.0) * float(np.sum(correlations**2 / (count - np.arange(1, lags + 1))))
    return float(correlations[0]), bool(stats.chi2.sf(statistic, lags) >= WHITE)


# What a residual follows


@frozen
class _Feature:
    """A quantity that a residual may follow. unit: of its size; values_at: its numbers at instants (s), [instant,
    number]"""

    what: str
    means: str
    unit: str
    values_at: Callable[[np.ndarray], np.ndarray]


def _features(
    name: str, courses: Mapping[str, ComputedChannel], units: Mapping[str, str], joint: str
) -> Iterator[_Feature]:
    """The quantities that a channel's residual may follow: itself, its rate, time, and those of its joint."""
    own, unit = courses[name], units[name]
    slope, middle = own.rate, float(own.times.mean())
    q, qd, tau = (f"{joint}.{signal}" for signal in ("q", "qd", "tau"))
    why = "a unit, a gain, masses or a payload" if name == tau else "a unit, a gain, a constant of the motor"
    yield from [
        _Feature(f"{name} itself", why, "1", lambda t: own.at(t)[:, None]),
        _Feature(f"the rate of {name}", "a delay", "s", lambda t: -slope.at(t)[:, None]),
        _Feature("time", "a drift", f"{unit} per s", lambda t: t[:, None] - middle),
    ]
    if tau in courses and name in (q, qd):
        load = courses[tau]
        words = "what yields under load"
        yield _Feature(tau, words, f"{unit} per {units[tau]}", lambda t: load.at(t)[:, None])
    if name in (q, qd):
        return
    if qd in courses:
        rate = courses[qd]
        faster = rate.rate
        still = STILL * float(np.abs(rate.values).max())
        yield from [
            _Feature(f"the sign of {qd}", "dry friction", unit, lambda t: _sign(rate.at(t), still)[:, None]),
            _Feature(qd, "viscous friction", f"{unit} per {units[qd]}", lambda t: rate.at(t)[:, None]),
            _Feature(
                f"the rate of {qd}", "inertia, payload", f"{unit} per {units[qd]}^2", lambda t: faster.at(t)[:, None]
            ),
        ]
    if q in courses and units[q] == "rad":
        angle = courses[q]
        yield _Feature(f"sine and cosine of {q}", "gravity, payload", unit, lambda t: _turned(angle.at(t)))


def _sign(rates: np.ndarray, still: float) -> np.ndarray:
    return np.where(np.abs(rates) > still, np.sign(rates), 0.0)


def _turned(angles: np.ndarray) -> np.ndarray:
    return np.stack([np.sin(angles), np.cos(angles)], axis=1)


def _explained(pair: Pair, features: Sequence[_Feature]) -> tuple[FollowedCause, ...] | None:
    """One after the other, the feature that adds most to the share of those before it; None where the log is too
    short."""
    pair = pair.thinned(MOST_INSTANTS)
    residual, instants = pair.residual, pair.instants
    count = min(STRETCHES, int(len(residual) / (ALIKE_FOR * _alike_for(residual))))
    if count < SHORTEST:
        return None
    halves = np.arange(len(residual)) * count // len(residual) % 2
    numbers = {feature: feature.values_at(instants) for feature in features}
    left = [feature for feature in features if _varies_enough(feature, numbers[feature], residual)]
    chosen: list[_Feature] = []
    gains: list[tuple[float, tuple[str, ...]]] = []
    explained = 0.0
    while left:
        shares = [
            _share(residual, np.hstack([numbers[feature] for feature in (*chosen, feature)]), halves)
            for feature in left
        ]
        best = int(np.argmax(shares))
        gain = shares[best] - explained
        if gain < LEAST_SHARE:
            break
        others = zip(left, shares, strict=True)
        alike = tuple(
            other.what for other, share in others if other != left[best] and share - explained >= ALIKE * gain
        )
        gains.append((gain, alike))
        explained = shares[best]
        chosen.append(left.pop(best))
    if not chosen:
        return ()
    sizes = np.split(
        _fitted(residual, np.hstack([numbers[feature] for feature in chosen]))[1:],
        np.cumsum([numbers[feature].shape[1] for feature in chosen])[:-1],
    )
    return tuple(
        FollowedCause(
            feature.what, feature.means, float(size[0]) if len(size) == 1 else None, feature.unit, gain, alike
        )
        for feature, size, (gain, alike) in zip(chosen, sizes, gains, strict=True)
    )


def _varies_enough(feature: _Feature, numbers: np.ndarray, residual: np.ndarray) -> bool:
    """True if a feature changes over the log, and is no delay beyond those that the log's clock is tried with."""
    if not np.isfinite(numbers).all() or np.ptp(numbers, axis=0).max() == 0.0:
        return False
    return feature.unit != "s" or abs(float(_fitted(residual, numbers)[1])) <= LATEST


def _alike_for(residual: np.ndarray) -> int:
    """Number of instants after which a residual's correlation with itself is below 1/e."""
    correlation = autocorrelation(residual)
    below = np.flatnonzero(correlation < math.exp(-1.0))
    return int(below[0]) if len(below) else len(residual)


def _fitted(residual: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Coefficients of least squares, the constant first."""
    scale = np.abs(numbers).max(axis=0)
    scale[scale == 0.0] = 1.0
    design = np.hstack([np.ones((len(residual), 1)), numbers / scale])
    coefficients = np.linalg.lstsq(design, residual, rcond=1e-10)[0]
    return np.asarray(coefficients / np.concatenate([[1.0], scale]))


def _share(residual: np.ndarray, numbers: np.ndarray, halves: np.ndarray) -> float:
    """Share of the variance that is explained, each half by what is fitted on the other one; below 0 where the fit
    makes it worse."""
    left = 0.0
    for half in (0, 1):
        fitted = _fitted(residual[halves != half], numbers[halves != half])
        in_half = halves == half
        left += float(np.sum((residual[in_half] - fitted[0] - numbers[in_half] @ fitted[1:]) ** 2))
    return 1.0 - left / float(np.sum((residual - residual.mean()) ** 2))
