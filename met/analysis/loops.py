"""Servo loops that tick, closed over the linearised arm: the map from one frame of all computers to the next.

A frame is as long as it takes until the dynamics and all servos tick together again. Its map is put together of the
integrator's steps and of the laws' own slopes, both found by differences of the functions that run (`step_map`). So the
delay of sampling is in it, and so are memory that is held, and its course over a step where servos are faster than the
dynamics (docs/physics.md, section 4). Sensors are left out: a law sees what is so.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from met.analysis.step_map import SampledLoops, linear_step
from met.frozen import frozen
from met.plan import Experiment

MOST_EVENTS = 2000
"""Ticks and steps in a frame, above which it is not looked at."""

GROWS = 1.0
"""ln of the growth over a run above which a loop is called unstable."""

LEAST = 1e-5
"""Growth of a frame, its logarithm, that differences are good for: a body that drifts freely is no nearer to 0."""

SMALLEST = 1e-3
"""Share of a loop's gain down to which a gain that fits is looked for."""


@frozen
class Unstable:
    """Loops that are unstable at one pose of one case.

    joints  whose loops: of one the gain alone is to blame; of several those of all of them together
    gain    share of the gains up to which it is stable, as far as all else stays
    every   s in which a disturbance grows by e
    """

    case: int
    joints: tuple[str, ...]
    gain: float
    every: float


def frame(found: SampledLoops, lane: int | np.ndarray, gains: Mapping[str, float] | None = None) -> np.ndarray:
    """The map of one frame, of state, memory, memory at the step's first tick, and the state a step before; of a lane,
    or of several.

    gains  what the outputs of a joint's law are multiplied by, 1 where nothing is said
    """
    A, (n, m, p) = found.slope[lane], (found.states, len(found.held), found.positions)
    h, d, hz, over = found.h, found.divisor, found.base_hz, A.shape[:-2]
    size = 2 * n + 2 * m
    x, u, first, before = (slice(a, b) for a, b in ((0, n), (n, n + m), (n + m, n + 2 * m), (n + 2 * m, size)))

    def unchanged() -> np.ndarray:
        return np.broadcast_to(np.eye(size), (*over, size, size)).copy()

    # memory goes evenly from its first to its last value over a step: two more states for each
    wide = np.zeros((*over, n + 2 * m, n + 2 * m))
    wide[..., :n, : n + m] = A[..., :n, :]
    wide[..., n : n + m, n + m :] = np.eye(m)
    advanced = linear_step(found.integrator, wide, p, h)[..., :n, :]
    step = unchanged()
    step[..., x, x], step[..., x, u] = advanced[..., :n], advanced[..., n + m :] / h
    step[..., x, first] = advanced[..., n : n + m] - step[..., x, u]
    step[..., before, x], step[..., before, before] = np.eye(n), 0.0
    latch = np.eye(size)
    latch[first, u], latch[first, first] = np.eye(m), 0.0
    places = [np.array([n + found.held.index(name) for name in law.memory], dtype=int) for law in found.laws]
    slopes = [law.slope[lane].copy() for law in found.laws]
    for law, rows in zip(found.laws, slopes, strict=True):
        rows[..., : law.outputs, :] *= (gains or {}).get(law.joint, 1.0)
    ticks: dict[tuple[float, tuple[bool, ...]], np.ndarray] = {}
    length = math.lcm(d, *(each.divisor for each in found.laws))
    whole = unchanged()
    for k in sorted({k for each in (d, *(law.divisor for law in found.laws)) for k in range(0, length, each)}):
        if k % d == 0:
            whole = step @ whole
        since, due = (k % d) / hz, tuple(k % law.divisor == 0 for law in found.laws)
        if any(due):
            if (since, due) not in ticks:
                carried = _carried(n, p, m, since, h)
                tick = ticks[since, due] = unchanged()
                for at, rows, ticking in zip(places, slopes, due, strict=True):
                    if ticking:
                        tick[..., at, :] = rows[..., :n] @ carried
                        tick[..., at, u] += rows[..., n:]
            whole = ticks[since, due] @ whole
        if k % d == 0:
            whole = latch @ whole
    return whole


def _carried(n: int, positions: int, m: int, since: float, h: float) -> np.ndarray:
    """The state that a tick sees `since` s after an instant, of a frame's state: carried on as over the step before."""
    p, size = positions, 2 * n + 2 * m
    carried = np.eye(n, size)
    if since:
        now, before = carried[:, :n], carried[:, n + 2 * m :]
        rest, rates = np.eye(n)[p:], np.eye(n)[p : 2 * p]
        now[p:] += rest * since / h
        before[p:] -= rest * since / h
        now[:p] += since * rates + 0.5 * since**2 / h * rates
        before[:p] -= 0.5 * since**2 / h * rates
    return carried


@frozen
class Loops:
    """The findings on the loops: those that are unstable, the one that wants the smallest gain first; and lanes of
    which nothing grows, whatever the step alone does: their laws hold it."""

    unstable: tuple[Unstable, ...]
    quiet: frozenset[int]


def closed(experiment: Experiment, found: SampledLoops) -> Loops:
    """The loops of each lane: a joint's is to blame where its own gain alone can make all stable."""
    growths, seconds = frame_growths(found)
    limit = max(LEAST, GROWS * seconds / experiment.structure.schedule.duration)
    worst: dict[tuple[str, ...], Unstable] = {}
    for lane in np.flatnonzero((limit < growths) & (growths < math.inf)).tolist():
        for each in blamed(found, lane, limit):
            if each.joints not in worst or each.gain < worst[each.joints].gain:
                worst[each.joints] = each
    quiet = frozenset(np.flatnonzero(growths <= limit).tolist())
    return Loops(tuple(sorted(worst.values(), key=lambda each: each.gain)), quiet)


def frame_growths(found: SampledLoops) -> tuple[np.ndarray, float]:
    """ln of the growth of a frame, of each lane: infinite where it is no number, or a frame is too long to be looked
    at; and the length of a frame, s."""
    length, growths = _length(found), np.full(len(found.case), math.inf)
    if length // found.divisor + sum(length // each.divisor for each in found.laws) <= MOST_EVENTS:
        numbers = np.isfinite(found.slope).all((1, 2))
        for law in found.laws:
            numbers &= np.isfinite(law.slope).all((1, 2))
        lanes = np.flatnonzero(numbers)
        growths[lanes] = _growths(frame(found, lanes))
    return growths, length / found.base_hz


def _length(found: SampledLoops) -> int:
    """Ticks of the base rate in a frame."""
    return math.lcm(found.divisor, *(each.divisor for each in found.laws))


def blamed(found: SampledLoops, lane: int, limit: float) -> list[Unstable]:
    """The loops of a lane whose ticks make a frame grow by more than this (ln); none where they do not."""
    seconds = _length(found) / found.base_hz
    growth, joints = partial(_of_ticks, found, lane, seconds), tuple(each.joint for each in found.laws)
    if not limit < growth({}):
        return []
    fitting: dict[tuple[str, ...], float | None] = {(joint,): _fitting(growth, (joint,), limit) for joint in joints}
    if not any(fitting.values()):
        fitting = {joints: _fitting(growth, joints, limit)}
    every = seconds / float(_growths(frame(found, np.array([lane])))[0])
    return [Unstable(int(found.case[lane]), which, gain, every) for which, gain in fitting.items() if gain is not None]


def _growths(frames: np.ndarray) -> np.ndarray:
    """ln of the growth of each frame, infinite where it is no number."""
    growths = np.full(len(frames), math.inf)
    numbers = np.isfinite(frames).all((1, 2))
    largest = np.abs(np.linalg.eigvals(frames[numbers])).max(1, initial=1e-300)
    growths[numbers] = np.log(largest)
    return growths


def _of_ticks(found: SampledLoops, lane: int, seconds: float, gains: Mapping[str, float]) -> float:
    """ln of the growth of a frame as far as it is of the ticks, for it would not be so if the laws were continuous."""
    own = float(_growths(frame(found, np.array([lane]), gains))[0])
    if own == math.inf:
        return 0.0
    analog = continuous(found, lane, gains)
    if not np.isfinite(analog).all():
        return own
    excess = own - seconds * max(0.0, float(np.linalg.eigvals(analog).real.max()))
    return excess if excess > 0.5 * own else 0.0


def continuous(found: SampledLoops, lane: int, gains: Mapping[str, float]) -> np.ndarray:
    """The slopes of state and integrals were all laws continuous, 1/s; not numbers where an output answers itself."""
    n, m, places = found.states, len(found.held), {name: i for i, name in enumerate(found.held)}
    made = np.eye(m, n + m, n)  # what a tick makes of memory
    outputs, periods = np.zeros(m, bool), np.ones(m)
    for law in found.laws:
        rows = law.slope[lane].copy()
        rows[: law.outputs] *= gains.get(law.joint, 1.0)
        at = [places[name] for name in law.memory]
        made[at], periods[at] = rows, law.divisor / found.base_hz
        outputs[at[: law.outputs]] = True
    o, i = n + np.flatnonzero(outputs), n + np.flatnonzero(~outputs)
    kept = np.concatenate([np.arange(n), i])
    try:
        answer = np.linalg.solve(np.eye(len(o)) - made[np.ix_(o - n, o)], made[np.ix_(o - n, kept)])
    except np.linalg.LinAlgError:
        return np.full((len(kept), len(kept)), np.nan)
    slopes = np.concatenate([found.slope[lane][:n], ((made - np.eye(m, n + m, n)) / periods[:, None])[i - n]])
    return np.asarray(slopes[:, kept] + slopes[:, o] @ answer)


def _fitting(growth: Callable[[Mapping[str, float]], float], joints: Sequence[str], limit: float) -> float | None:
    """The largest share of these joints' gains at which nothing grows by ticks, to a thousandth; None: none does."""
    high, low = 1.0, 0.8
    while growth(dict.fromkeys(joints, low)) > limit:
        high, low = low, 0.8 * low
        if low < SMALLEST:
            return None
    while high > 1.001 * low:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if growth(dict.fromkeys(joints, middle)) > limit else (middle, high)
    return low
