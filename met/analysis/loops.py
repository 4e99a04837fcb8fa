"""Servo loops closed over the linearised arm: the map from one frame of all computers to the next, and its growth.

A frame is as long as it takes until the dynamics and all servos tick together again. Its map combines the integrator's
steps and the laws' slopes, both found by differences of the functions that run (`step_map`, `laws`). It includes the
delays of sampling and of sensors, the lag of their filters, held memory, and its course over a step where servos are
faster than the dynamics (docs/physics.md, section 4). Continuous laws are closed first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from met.analysis.laws import SampledLaw
from met.analysis.step_map import SampledLoops, linear_step

MOST_EVENTS = 2000
"""Ticks and steps in a frame above which it is not analysed."""

GROWS = 1.0
"""ln of the growth over a run above which a loop is called unstable."""

LEAST = 1e-5
"""Smallest growth of a frame, its logarithm, that differences resolve: a freely drifting body is no nearer to 0."""

SLOWEST = 1e-3
"""Smallest growth rate that differences resolve for the arm with laws that have no ticks, 1/s."""

WHOLE = 200
"""States and memory up to which an arm is analysed as a whole, even where parts of it are uncoupled."""

Gains = Mapping[str, float]
"""Factors on the gains of joints' laws; 1 where a joint is not listed."""


def _rows(law: SampledLaw, lane: int | np.ndarray, gains: Gains | None, direct: bool) -> np.ndarray:
    """The slopes of a law whose gain is scaled; direct: of the law without its sensors."""
    rows = (law.direct if direct and law.direct.shape[1] else law.slope)[lane].copy()
    rows[..., : law.outputs, :] *= (gains or {}).get(law.joint, 1.0)
    return rows


def _over(
    loops: SampledLoops, lane: int | np.ndarray, gains: Gains | None, direct: bool, laws: Sequence[SampledLaw]
) -> tuple[np.ndarray, int, np.ndarray]:
    """The arm with these laws closed as though they had no ticks: slopes by state and memory, 1/s, [..., state, state
    and memory], where the state has these laws' integrals; how many are of it; and which of all states and memory these
    are. Raises LinAlgError where an output answers itself."""
    A, (n, m), places = loops.slope[lane], (loops.states, len(loops.held)), {c: k for k, c in enumerate(loops.held)}
    if not laws:
        return A, n, np.arange(n + m)
    after_tick = np.broadcast_to(np.eye(m, n + m, n), (*A.shape[:-2], m, n + m)).copy()  # what a tick makes of memory
    kinds, periods = np.zeros(m, dtype=int), np.ones(m)
    for law in laws:
        indices = np.array([places[name] for name in law.memory], dtype=int)
        after_tick[..., indices, :], periods[indices] = _rows(law, lane, gains, direct), law.divisor / loops.base_hz
        kinds[indices] = 1
        kinds[indices[law.outputs : law.outputs + law.integrals]] = 2
    left, at_once, i = (np.flatnonzero(kinds == kind) for kind in (0, 1, 2))
    columns, o = np.concatenate([np.arange(n), n + i, n + left]), n + at_once
    own = after_tick[..., at_once, :]
    answer = np.linalg.solve(np.eye(len(o)) - own[..., o], own[..., columns])
    integrals = (after_tick[..., i, :] - np.eye(m, n + m, n)[i]) / periods[i, None]
    slopes = np.concatenate([A[..., :n, :], integrals], axis=-2)
    return slopes[..., columns] + slopes[..., o] @ answer, n + len(i), columns


def frame(
    loops: SampledLoops, lane: int | np.ndarray, gains: Gains | None = None, *, direct: bool = False
) -> np.ndarray:
    """The map of one frame for a lane or several: of state, memory, memory at the step's first tick, and the state a
    step before; of state and memory alone where all laws tick with the dynamics.

    gains   what the outputs of a joint's law are multiplied by, 1 where nothing is said
    direct  whether laws see what is so, without their sensors
    """
    laws = [law for law in loops.laws if not law.continuous]
    A, n, cells = _over(loops, lane, gains, direct, [law for law in loops.laws if law.continuous])
    if all(law.divisor == loops.divisor for law in laws):
        return _frame_of_a_step(loops, A, n, cells, [(law, _rows(law, lane, gains, direct)) for law in laws])
    whole = np.eye(2 * len(cells))
    for matrix, _ in _phases(loops, A, n, cells, lane, gains, direct):
        whole = matrix @ whole
    return whole


def opened(
    loops: SampledLoops, lane: int | np.ndarray, joint: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The map of one frame, for a lane or several, opened where the law of a joint puts out, which has one output: A of
    the frame's state, B of what is put in at each of its ticks in place of the output, C and D of what comes back at
    each. All loops but this one are closed."""
    laws = [law for law in loops.laws if not law.continuous]
    A, n, cells = _over(loops, lane, None, False, [law for law in loops.laws if law.continuous])
    law = next(law for law in laws if law.joint == joint)
    output = n + [loops.held[cell - loops.states] for cell in cells[n:].tolist()].index(law.memory[0])
    ticks, size, tick, returns = _length(loops) // law.divisor, 2 * len(cells), 0, list[np.ndarray]()
    whole = np.broadcast_to(np.eye(size, size + ticks), (*A.shape[:-2], size, size + ticks)).copy()
    for matrix, joints in _phases(loops, A, n, cells, lane, None, False):
        after = matrix @ whole
        if joint in joints:
            returns.append(after[..., output, :].copy())
            after[..., output, :] = np.eye(size + ticks)[size + tick]
            tick += 1
        whole = after
    back = np.stack(returns, axis=-2)
    return whole[..., :size], whole[..., size:], back[..., :size], back[..., size:]


def _phases(
    loops: SampledLoops,
    A: np.ndarray,
    n: int,
    cells: np.ndarray,
    lane: int | np.ndarray,
    gains: Gains | None,
    direct: bool,
) -> Iterator[tuple[np.ndarray, tuple[str, ...]]]:
    """Yield the maps of a frame in the order in which they take effect, each with the joints whose laws tick in it. A
    map is of state, memory, memory at the step's first tick, and the state a step before.

    A, n, cells  as of `_over`
    """
    laws = [law for law in loops.laws if not law.continuous]
    p, m, held = loops.positions, len(cells) - n, [loops.held[cell - loops.states] for cell in cells[n:].tolist()]
    h, d, hz, over = loops.h, loops.divisor, loops.base_hz, A.shape[:-2]
    size = 2 * n + 2 * m
    x, u, first, before = (slice(a, b) for a, b in ((0, n), (n, n + m), (n + m, n + 2 * m), (n + 2 * m, size)))

    def unchanged() -> np.ndarray:
        return np.broadcast_to(np.eye(size), (*over, size, size)).copy()

    # memory goes evenly from its first to its last value over a step: two more states for each
    wide = np.zeros((*over, n + 2 * m, n + 2 * m))
    wide[..., :n, : n + m] = A[..., :n, :]
    wide[..., n : n + m, n + m :] = np.eye(m)
    advanced = linear_step(loops.integrator, wide, p, h)[..., :n, :]
    step = unchanged()
    step[..., x, x], step[..., x, u] = advanced[..., :n], advanced[..., n + m :] / h
    step[..., x, first] = advanced[..., n : n + m] - step[..., x, u]
    step[..., before, x], step[..., before, before] = np.eye(n), 0.0
    latch = np.eye(size)
    latch[first, u], latch[first, first] = np.eye(m), 0.0
    places = [np.array([n + held.index(name) for name in law.memory], dtype=int) for law in laws]
    slopes = [_rows(law, lane, gains, direct)[..., cells] for law in laws]
    ticks: dict[tuple[float, tuple[bool, ...]], np.ndarray] = {}
    length = math.lcm(d, *(law.divisor for law in laws))
    for k in sorted({k for divisor in (d, *(law.divisor for law in laws)) for k in range(0, length, divisor)}):
        if k % d == 0:
            yield step, ()
        since, due = (k % d) / hz, tuple(k % law.divisor == 0 for law in laws)
        if any(due):
            if (since, due) not in ticks:
                carried = _carried(n, p, m, since, h)
                tick = ticks[since, due] = unchanged()
                for memory_places, rows, ticking in zip(places, slopes, due, strict=True):
                    if ticking:
                        tick[..., memory_places, :] = rows[..., :n] @ carried
                        tick[..., memory_places, u] += rows[..., n:]
            yield ticks[since, due], tuple(law.joint for law, ticking in zip(laws, due, strict=True) if ticking)
        if k % d == 0:
            yield latch, ()


def _frame_of_a_step(
    loops: SampledLoops, A: np.ndarray, n: int, cells: np.ndarray, laws: Sequence[tuple[SampledLaw, np.ndarray]]
) -> np.ndarray:
    """The frame of laws that all tick with the dynamics, of state and memory: memory is constant over a step, and no
    tick sees an extrapolated state.

    A, n, cells  as of `_over`;  laws: those that tick, with their slopes by all states and memory
    """
    m = len(cells) - n
    wide = np.zeros((*A.shape[:-2], n + m, n + m))
    wide[..., :n, :] = A[..., :n, :]
    step = linear_step(loops.integrator, wide, loops.positions, loops.h)
    tick = np.broadcast_to(np.eye(n + m), step.shape).copy()
    places = {cell: place for place, cell in enumerate(cells.tolist())}
    for law, rows in laws:
        indices = [places[loops.states + loops.held.index(name)] for name in law.memory]
        tick[..., indices, :] = rows[..., cells]
    return np.asarray(tick @ step)


def _carried(n: int, positions: int, m: int, since: float, h: float) -> np.ndarray:
    """The state that a tick sees `since` s after an instant, from a frame's state, extrapolated from the step
    before."""
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


def ticking(loops: SampledLoops) -> frozenset[str]:
    """Joints whose laws tick."""
    return frozenset(law.joint for law in loops.laws if not law.continuous)


def seconds(loops: SampledLoops) -> float:
    """The length of a frame, s."""
    return _length(loops) / loops.base_hz


def _length(loops: SampledLoops) -> int:
    """The number of base-rate ticks in a frame."""
    return math.lcm(loops.divisor, *(law.divisor for law in loops.laws if not law.continuous))


def events(loops: SampledLoops) -> int:
    """The number of ticks and steps in a frame."""
    length = _length(loops)
    return length // loops.divisor + sum(length // law.divisor for law in loops.laws)


def growths(
    loops: SampledLoops, lanes: np.ndarray, gains: Gains | None = None, *, ticks: bool, direct: bool = False
) -> np.ndarray:
    """Rates at which modes grow, or decay where they are negative, 1/s: [lane, mode]; infinite where one is not finite.

    lanes   the cases that are looked at, by their numbers
    ticks   of a frame; else of the arm with all laws continuous, without delays of ticks
    direct  see `spectrum`

    Parts of the arm that are not coupled are computed one by one.
    """
    parts = uncoupled(loops)
    if len(parts) > 1:
        return np.concatenate([growths(part, lanes, gains, ticks=ticks, direct=direct) for part in parts], axis=1)
    return rates_of(loops, spectrum(loops, lanes, gains, ticks=ticks, direct=direct), ticks=ticks)


def spectrum(
    loops: SampledLoops, lanes: np.ndarray, gains: Gains | None = None, *, ticks: bool, direct: bool = False
) -> np.ndarray:
    """Eigenvalues of the frame, or, without ticks, of the arm with all laws continuous, 1/s: [lane, mode]; infinite
    where one is not finite."""
    if ticks:
        with np.errstate(all="ignore"):  # an overflow gives no finite number
            return _eigenvalues(frame(loops, lanes, gains, direct=direct))
    try:
        return _eigenvalues(_over(loops, lanes, gains, direct, loops.laws)[0])
    except np.linalg.LinAlgError:
        return np.full((len(lanes), 1), math.inf, dtype=complex)


def rates_of(loops: SampledLoops, eigenvalues: np.ndarray, *, ticks: bool) -> np.ndarray:
    """Rates at which modes of these eigenvalues grow, or decay, 1/s."""
    if not ticks:
        return eigenvalues.real
    with np.errstate(all="ignore"):
        return np.asarray(np.log(np.abs(eigenvalues)) / seconds(loops))


def parts_in(
    loops: SampledLoops, lane: int, gains: Gains | None, eigenvalue: complex, *, ticks: bool
) -> dict[str, float]:
    """The weight of the gain of each law in a mode: the derivative of its eigenvalue, as a size, by joint; of laws
    that tick where the eigenvalue is that of a frame, else of all. One factorisation, where all eigenvectors would cost
    as much as many spectra."""
    from scipy.linalg import lu_factor, lu_solve

    if ticks:
        matrix = frame(loops, lane, gains)
        continuous = [law for law in loops.laws if law.continuous]
        cells = _over(loops, lane, gains, False, continuous)[2].tolist()
    else:
        matrix, _, columns = _over(loops, lane, gains, False, loops.laws)
    size = len(matrix)
    nearly = eigenvalue + 1e-7 * max(1.0, abs(eigenvalue))
    factors = lu_factor(matrix - nearly * np.eye(size), check_finite=False)
    right = left = np.cos(np.arange(size) ** 2)  # any vector that is square to no mode
    for _ in range(3):
        right, left = lu_solve(factors, right), lu_solve(factors, left, trans=1)
        right, left = right / np.linalg.norm(right), left / np.linalg.norm(left)
    shares = {}
    for law in loops.laws:
        indices = [loops.states + loops.held.index(name) for name in law.memory[: law.outputs]]
        if not ticks:
            rows = _rows(law, lane, gains, False)[: law.outputs]
            acts = left[: loops.states] @ loops.slope[lane][:, indices]
            shares[law.joint] = float(np.abs(acts @ (rows[:, columns] @ right)))
        elif not law.continuous:
            own = [cells.index(cell) for cell in indices]
            shares[law.joint] = float(np.abs(left[own] @ right[own]))
    return shares


def uncoupled(loops: SampledLoops, largest: int | None = None) -> tuple[SampledLoops, ...]:
    """Parts of an arm that do not act on each other in any lane, such as chains on a fixed base, each with its own
    laws; the whole where it has no more than `largest` states and memory, else `WHOLE`. A frame of a part is no longer
    than the whole's."""
    n, p, count = loops.states, loops.positions, loops.states + len(loops.held)
    if count <= (WHOLE if largest is None else largest):
        return (loops,)
    places = {name: place for place, name in enumerate(loops.held, n)}
    acts = np.zeros((count, count), dtype=bool)
    acts[:n] = np.any(loops.slope[:, :n] != 0.0, axis=0)
    acts[np.arange(p), np.arange(p, 2 * p)] = True
    first = {}
    for law in loops.laws:
        indices = [places[name] for name in law.memory]
        first[law.joint] = indices[0]
        acts[indices[0], indices] = True
        for slopes in (law.slope, law.direct):
            acts[indices[0]] |= np.any(slopes != 0.0, axis=(0, 1))
    parts = []
    for cells in _components(acts | acts.T):
        parts.append(
            replace(
                loops,
                states=int(np.count_nonzero(cells < n)),
                positions=int(np.count_nonzero(cells < p)),
                held=tuple(loops.held[cell - n] for cell in cells[cells >= n].tolist()),
                slope=loops.slope[:, cells[cells < n]][:, :, cells],
                laws=tuple(
                    replace(law, slope=law.slope[..., cells], direct=law.direct[..., cells])
                    for law in loops.laws
                    if first[law.joint] in cells
                ),
            )
        )
    return tuple(parts)


def _components(joined: np.ndarray) -> Iterator[np.ndarray]:
    """The connected parts of a graph, ascending. joined: whether two are neighbours, symmetric, [any, any]"""
    left = np.ones(len(joined), dtype=bool)
    while left.any():
        part = np.zeros(len(joined), dtype=bool)
        new = np.arange(len(joined)) == np.argmax(left)
        while new.any():
            part |= new
            new = joined[new].any(axis=0) & ~part
        left &= ~part
        yield np.flatnonzero(part)


def _eigenvalues(matrices: np.ndarray) -> np.ndarray:
    """Eigenvalues of each matrix: infinite where one is not finite."""
    eigenvalues = np.full(matrices.shape[:2], math.inf, dtype=complex)
    numbers = np.isfinite(matrices).all((1, 2))
    eigenvalues[numbers] = np.linalg.eigvals(matrices[numbers])
    return eigenvalues


def fastest(loops: SampledLoops) -> np.ndarray:
    """The largest growth rate of each lane, 1/s: infinite where it is not finite, or a frame is too long to be
    analysed."""
    rates = np.full(len(loops.case), math.inf)
    if events(loops) <= MOST_EVENTS:
        lanes = np.flatnonzero(_numbers(loops))
        if len(lanes):
            rates[lanes] = growths(loops, lanes, ticks=True).max(1, initial=-math.inf)
    return rates


def _numbers(loops: SampledLoops) -> np.ndarray:
    """True for the lanes whose slopes are all finite."""
    numbers = np.isfinite(loops.slope).all((1, 2))
    for law in loops.laws:
        numbers &= np.isfinite(law.slope).all((1, 2))
    return np.asarray(numbers)


def least(loops: SampledLoops, duration: float) -> float:
    """The growth rate above which a frame is reported, 1/s: growth by e over this time, where differences resolve
    it."""
    return max(LEAST / seconds(loops), GROWS / duration)


def growing(loops: SampledLoops, rates: np.ndarray, duration: float) -> Iterator[tuple[int, float, bool]]:
    """Lanes that grow by e and more over this time: the rate above which that is so, 1/s, and whether ticks have a part
    in it; growth too slow for a frame's differences is analysed without ticks.

    rates  as `fastest` has them
    """
    limit, slowest = least(loops, duration), max(SLOWEST, GROWS / duration)
    reported = (limit < rates) & (rates < math.inf)
    for lane in np.flatnonzero(reported)[np.argsort(-rates[reported], kind="stable")].tolist():
        yield lane, limit, True
    quiet = np.flatnonzero(_numbers(loops) & ~reported)
    if slowest < limit and len(quiet):
        analog = growths(loops, quiet, ticks=False).max(1, initial=-math.inf)
        for place in np.argsort(-analog, kind="stable").tolist():
            if slowest < analog[place] < math.inf:
                yield int(quiet[place]), slowest, False
