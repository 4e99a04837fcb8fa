"""Stability margins of servo loops at poses that cases pass: what a recommended design rests on.

Each pose is taken at rest, without drive, and with dry friction released, as `met check` takes the start (D320). Every
loop is opened where its law puts out, with all others closed; then all loops change their gain at once. A law that
ticks several times in a frame has an open loop from what is put in at each tick to what comes back at each: its disk is
that of the largest singular value, which is the same where the loop does not change from tick to tick.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from met.analysis.laws import SampledLaw
from met.analysis.linear.margins import ScalarLoop, gain_limits, margins
from met.analysis.loops import LEAST, MOST_EVENTS, events, frame, opened, seconds
from met.analysis.passed import Passed
from met.analysis.step_map import Linearizer, SampledLoops
from met.frozen import frozen
from met.plan import Experiment
from met.plan.searches import LeastMargins, allowed_gain

FREQUENCIES = 60
"""Number of frequencies at which loops are compared, to find the pose whose margin is then computed exactly."""

STRIDE, FARTHEST = 1.2, 100.0
"""Ratio of neighbouring gains at which all loops at once are tried, and the largest."""

TOGETHER = 1e-4
"""Relative error of the largest gain of all loops at once."""

SHORT = 0.95
"""Share of a least margin that counts for loops which keep it one by one, and not all at once."""

AT_ONCE = 1_000_000
"""Largest number of complex elements of matrices that are solved at once, to bound memory."""

SLOWEST = 1e-4
"""Lowest of these frequencies, as a share of half the sampling rate."""


def least_margins(experiment: Experiment, passed: Passed) -> LeastMargins | str:
    """The least margins of all loops at these instants of cases; in their place the reason, in words, where there are
    none. Raises Problem where the program cannot be built."""
    structure = experiment.structure
    if structure.substitutions:
        return "a motor is on a bed: `met margin` judges its loop"
    linearizer = Linearizer(experiment, passed.case.tolist(), passed.memory)
    sampled = linearizer.sampled()
    if sampled is None:
        return "no law closes a loop over the arm"
    if linearizer.continuous:
        return f"the law of joint `{min(linearizer.continuous)}` is continuous"
    if events(sampled) > MOST_EVENTS:
        return "the rates of dynamics and servos have no common period that is short enough"
    if not np.isfinite(sampled.slope).all():
        return "the arm has no finite slopes at an instant"
    closed = _largest(sampled, np.arange(len(sampled.case)))
    several = list[_Least]()
    for law in sampled.laws:
        if law.outputs != 1:
            return f"the law of joint `{law.joint}` has {law.outputs} outputs"
        loops = _open_loops(sampled, law, closed)
        if loops is not None:
            several.append(_least(loops, law.joint))
    if not several:
        return "nothing comes back where a loop is opened: the arm is held"
    worst = min(several, key=lambda loop: loop.disk)
    together, joints = math.inf, tuple(loop.joints[0] for loop in several)
    if worst.disk and several[1:]:
        every = _together(sampled, worst, joints)
        together = every.gain
        worst = every if every.disk * (1.0 + TOGETHER) < worst.disk else worst
    return LeastMargins(
        disk=_rounded(worst.disk),
        gain=_rounded(min(together, *(loop.gain for loop in several))),
        delay=_rounded(float(np.min([loop.delay for loop in several]))),
        joints=worst.joints if worst.disk else joints,
        case=int(experiment.cases.table[passed.case[worst.lane]]),
        time=float(passed.tick[worst.lane]) / structure.schedule.base_hz,
        loops=len(several),
        cases=len(np.unique(passed.case)),
        poses=len(sampled.case),
    )


def _rounded(value: float) -> float:
    """A figure in five digits: libraries of linear algebra agree to those on any machine."""
    return float(f"{value:.5g}")


def margins_at_start(experiment: Experiment, rows: Sequence[int], least: float) -> np.ndarray | None:
    """The least disk margin of the loops of each of these cases as it begins, each loop by itself, on a grid of
    frequencies, [case]; a little less than `least` where all loops at once do not bear the gain that it allows. None
    where there are no margins. Raises Problem where the program cannot be built."""
    if experiment.structure.substitutions:
        return None
    linearizer = Linearizer(experiment, rows)
    sampled = linearizer.sampled()
    if sampled is None or linearizer.continuous or events(sampled) > MOST_EVENTS:
        return None
    disks, lanes = np.full(len(sampled.case), math.inf), np.arange(len(sampled.case))
    fine = np.isfinite(sampled.slope).all((1, 2))
    if not fine.all():
        return np.where(fine, disks, math.nan)

    closed, allowed = _largest(sampled, lanes), allowed_gain(least)
    for law in sampled.laws:
        loops = _open_loops(sampled, law, closed) if law.outputs == 1 else None
        if loops is not None:
            disks = np.minimum(disks, np.where(loops.stable, 1.0 / _sensitivities(loops).max(axis=0), 0.0))
    raised, lowered = (
        _largest(sampled, lanes, dict.fromkeys((law.joint for law in sampled.laws), gain))
        for gain in (allowed, 1.0 / allowed)
    )
    together = np.maximum(raised, lowered) <= 1.0 + LEAST
    return np.where(together, disks, np.minimum(disks, SHORT * least))


@frozen
class _OpenLoops:
    """A law's open loop in each lane: A, B, C and D of a frame, [lane, ...], with an input and an output for each tick
    in it; largest: the closed loop's largest eigenvalue, [lane]; period, s."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    largest: np.ndarray
    period: float

    @property
    def stable(self) -> np.ndarray:
        return self.largest <= 1.0 + LEAST

    def sensitivities(self, frequencies: np.ndarray) -> np.ndarray:
        """The largest singular value of S - 1/2 at angular frequencies, rad/s, where S is the loop's sensitivity:
        [frequency, lane]."""
        z, identity = np.exp(1j * frequencies * self.period)[:, None, None, None], np.eye(self.D.shape[-1])
        P = self.C @ np.linalg.solve(z * np.eye(self.A.shape[-1]) - self.A, self.B.astype(complex)) + self.D
        if identity.size == 1:
            return np.asarray(np.abs(1.0 / (1.0 - P[..., 0, 0]) - 0.5))
        return np.asarray(np.linalg.svd(np.linalg.inv(identity - P) - 0.5 * identity, compute_uv=False)[..., 0])

    def only(self, lane: int) -> _OpenLoops:
        """The loop in one lane."""
        own = slice(lane, lane + 1)
        return _OpenLoops(self.A[own], self.B[own], self.C[own], self.D[own], self.largest[own], self.period)


def _open_loops(sampled: SampledLoops, law: SampledLaw, closed: np.ndarray) -> _OpenLoops | None:
    """A law's open loop; None where nothing comes back. closed: the closed loop's largest eigenvalue, [lane]"""
    parts = opened(sampled, np.arange(len(sampled.case)), law.joint)
    A, B, C, D = parts
    moved, comes_back = B, bool(D.any())
    for _ in range(2 if not comes_back else 0):  # a voltage moves the arm within two steps, if at all
        moved = A @ moved
        comes_back |= bool((np.abs(C @ moved) > 0.0).any())
    return _OpenLoops(*parts, closed, seconds(sampled)) if comes_back or (C @ B).any() else None


@frozen
class _Least:
    """The least margins of one loop, and the lane of the least disk. delay: not-a-number where the law ticks several
    times in a frame."""

    disk: float
    gain: float
    delay: float
    joints: tuple[str, ...]
    lane: int


def _least(loops: _OpenLoops, joint: str) -> _Least:
    """The margins of a loop in the first lane and in those where a grid of frequencies shows the least."""
    unstable = np.flatnonzero(~loops.stable)
    if len(unstable):
        return _Least(0.0, 1.0, 0.0, (joint,), int(unstable[np.argmax(loops.largest[unstable])]))
    sizes = _sensitivities(loops)
    lane = int(sizes.max(axis=0).argmax())
    by_lane = [_of_lane(loops.only(number), sizes[:, number]) for number in sorted({0, lane})]
    disk, gain, delay = (float(np.min([lane_margins[place] for lane_margins in by_lane])) for place in range(3))
    return _Least(disk, gain, delay, (joint,), lane)


def _of_lane(loops: _OpenLoops, sizes: np.ndarray) -> tuple[float, float, float]:
    """Disk, gain and delay margin of a loop of one lane. sizes: of its sensitivity on the grid of frequencies"""
    A, B, C, D = loops.A[0], loops.B[0], loops.C[0], loops.D[0]
    if D.shape == (1, 1):
        margins_of = margins(ScalarLoop(A, B[:, 0], C[0], float(D[0, 0]), loops.period, LEAST))
        if margins_of is None:
            return 0.0, 1.0, 0.0
        factors = _factors(margins_of.gain_down, margins_of.gain_up)
        delay = math.inf if margins_of.delay is None else margins_of.delay
        return margins_of.disk, min(factors, default=math.inf), delay
    from scipy.optimize import minimize_scalar

    grid, peak = np.log(_frequencies(loops)), int(sizes.argmax())
    ends = (grid[max(0, peak - 1)], grid[min(len(grid) - 1, peak + 1)])
    least = minimize_scalar(lambda w: -float(loops.sensitivities(np.exp([w]))[0, 0]), bounds=ends, method="bounded")
    gain = min(_factors(*gain_limits(A, B, C, D, LEAST)), default=math.inf)
    return 1.0 / max(-float(least.fun), float(sizes.max())), gain, math.nan


def _frequencies(loops: _OpenLoops) -> np.ndarray:
    nyquist = math.pi / loops.period
    return np.geomspace(SLOWEST * nyquist, nyquist, FREQUENCIES)


def _sensitivities(loops: _OpenLoops) -> np.ndarray:
    """The largest singular value of S - 1/2 on a grid of frequencies: [frequency, lane]."""
    pieces = math.ceil(FREQUENCIES * loops.A.size / AT_ONCE)
    return np.concatenate([loops.sensitivities(some) for some in np.array_split(_frequencies(loops), pieces)])


def _together(sampled: SampledLoops, least: _Least, joints: tuple[str, ...]) -> _Least:
    """The factor by which the gains of all these loops at once may rise or fall, to `TOGETHER`, with the disk that
    allows it: of the lanes that do not bear what the least margin of single loops allows, or of that margin's lane
    where all bear it. Infinite where no factor up to `FARTHEST` is too much."""
    lanes = np.array([least.lane])

    def largest(gain: float) -> np.ndarray:
        return _largest(sampled, lanes, dict.fromkeys(joints, gain))

    if (allowed := allowed_gain(least.disk)) < FARTHEST:
        lanes = np.arange(len(sampled.case))
        grown = np.maximum(largest(allowed), largest(1.0 / allowed)) > 1.0 + LEAST
        lanes = np.flatnonzero(grown) if grown.any() else np.array([least.lane])
    factor, lane = math.inf, least.lane
    for stride in (STRIDE, 1.0 / STRIDE):
        good, bad = 1.0, stride
        while (largest(bad) <= 1.0 + LEAST).all() and 1.0 / FARTHEST < bad < FARTHEST:
            good, bad = bad, bad * stride
        grown = largest(bad)
        if (grown <= 1.0 + LEAST).all():
            continue
        while abs(bad / good - 1.0) > TOGETHER:
            middle = math.sqrt(good * bad)
            if ((tried := largest(middle)) > 1.0 + LEAST).any():
                bad, grown = middle, tried
            else:
                good = middle
        if max(good, 1.0 / good) < factor:
            factor, lane = max(good, 1.0 / good), int(lanes[grown.argmax()])
    disk = 2.0 * (factor - 1.0) / (factor + 1.0) if math.isfinite(factor) else math.inf
    return _Least(disk, factor, math.nan, joints, lane)


def _largest(sampled: SampledLoops, lanes: np.ndarray, gains: dict[str, float] | None = None) -> np.ndarray:
    """The largest eigenvalue of a frame with all loops closed, in size, [lane]."""
    return np.asarray(np.abs(np.linalg.eigvals(frame(sampled, lanes, gains))).max(axis=1))


def _factors(down: float | None, up: float | None) -> Iterator[float]:
    """The factors above 1 by which a gain may rise, and fall."""
    if up is not None:
        yield up
    if down:
        yield 1.0 / down
