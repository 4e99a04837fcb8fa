"""Margins of a sampled loop: the gain, phase, delay, or both gain and phase, that it tolerates before it is unstable.

A loop is P(z) = C (z I - A)^-1 B + D from the signal put in at an open place to the one that comes back, closed where
the two are equal: a loop with negative feedback has L = -P. The frequencies at which |P| has a given value on the unit
circle, or P is real there, are eigenvalues of a pencil (S. Boyd, V. Balakrishnan and P. Kabamba, A bisection method for
computing the H-inf norm of a transfer matrix, 1989, of discrete systems), not on a grid, so no narrow peak is missed.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from met.frozen import frozen

ON_CIRCLE = 1e-4
"""Distance from the unit circle within which a root of a pencil is tried: rounding moves double roots so far."""

APART = 1e-10
"""Share of the largest coupling below which a state counts as not moved."""

EDGE = 1e-7
"""Distance from a gain of 1 within which a loop counts as being at its stability limit."""

STABLE = 1e-7
"""Smallest growth of a period that counts as unstable: a drift in position and rate has poles this near to 1."""


@frozen
class ScalarLoop:
    """A loop that is open at one place, one tick a period.

    A, B, C, D  [state, state], [state], [state], and a number;  period  s
    drift       growth of a period up to which it is not called unstable
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: float
    period: float
    drift: float = STABLE

    def at(self, z: complex) -> complex:
        """L = -P at z."""
        return -complex(self.C @ np.linalg.solve(z * np.eye(len(self.A)) - self.A, self.B) + self.D)

    def response(self, w: np.ndarray) -> np.ndarray:
        """L at angular frequencies, rad/s: [frequency]."""
        z = np.exp(1j * np.asarray(w, dtype=np.float64) * self.period)[:, None, None]
        B = np.broadcast_to(self.B[:, None], (len(z), len(self.B), 1))
        moved = np.linalg.solve(z * np.eye(len(self.A)) - self.A, B)
        L: np.ndarray = -(moved[..., 0] @ self.C + self.D)
        return L

    def sizes(self, w: Sequence[float]) -> Iterator[tuple[float, float]]:
        """|L| at angular frequencies, rad/s, each with the frequency."""
        return zip(np.abs(self.response(np.array(w))).tolist(), w, strict=True)

    @cached_property
    def poles(self) -> np.ndarray:
        """The open-loop poles."""
        poles: np.ndarray = np.linalg.eigvals(self.A)
        return poles

    def closed(self, gain: float = 1.0) -> np.ndarray:
        """The closed loop's A, with the gain multiplied by this."""
        return self.A + gain / (1.0 - gain * self.D) * np.outer(self.B, self.C)

    def grows(self, gain: float = 1.0) -> bool:
        """True where the loop is unstable, closed with the gain multiplied by this."""
        if gain * self.D == 1.0:
            return True
        return bool(np.max(np.abs(np.linalg.eigvals(self.closed(gain))), initial=0.0) > 1.0 + self.drift)

    def minimal(self) -> ScalarLoop:
        """The loop reduced to its controllable and observable states: others have poles that are not the loop's own."""
        from scipy.linalg import matrix_balance

        n = len(self.A)
        moves = np.block([[self.A - np.eye(n), self.B[:, None]], [self.C[None, :], np.zeros((1, 1))]])
        with np.errstate(invalid="ignore"):  # scipy takes scales above 2^63 for permutations too, which are not used
            _, (scale, _) = matrix_balance(moves, permute=False, separate=True)
        by = scale[:n] / scale[n]
        A, B, C = self.A * (by[None, :] / by[:, None]), self.B / by, self.C * by
        moved = _krylov(A, B)
        A, B, C = moved.T @ A @ moved, moved.T @ B, C @ moved
        seen = _krylov(A.T, C)
        return replace(self, A=seen.T @ A @ seen, B=seen.T @ B, C=C @ seen)


def _krylov(A: np.ndarray, start: np.ndarray) -> np.ndarray:
    """An orthonormal basis, [state, basis], of the span of a vector under all powers of A."""
    n, length = len(A), float(np.linalg.norm(start))
    basis = np.zeros((n, 0)) if length == 0.0 else start[:, None] / length
    while 0 < basis.shape[1] < n:
        new = A @ basis[:, -1] - basis[:, -1]  # the difference stays accurate for a slow A too
        before = float(np.linalg.norm(new))
        for _ in range(2):
            new = new - basis @ (basis.T @ new)
        after = float(np.linalg.norm(new))
        if after <= APART * before:
            break
        basis = np.column_stack([basis, new / after])
    return basis


@frozen
class LoopMargins:
    """The margins of a stable loop; frequencies are angular, rad/s.

    gain_up, gain_down  times its gain from which on it is unstable, above 1 and below; None: at none
    phase    rad;  delay: s;  None where |L| is 1 nowhere
    disk     alpha of a balanced disk: gain and phase may change at once within it (P. Seiler, A. Packard and
             P. Gahinet, An introduction to disk margins, IEEE Control Systems 40(5), 2020)
    at_*     the frequency of each
    """

    gain_up: float | None
    gain_down: float | None
    phase: float | None
    delay: float | None
    disk: float
    at_gain_up: float | None
    at_gain_down: float | None
    at_phase: float | None
    at_delay: float | None
    at_disk: float

    @property
    def disk_gain(self) -> tuple[float, float]:
        """The lowest and the highest factor on the gain that the disk allows."""
        half = min(1.0, 0.5 * self.disk)
        return (1.0 - half) / (1.0 + half), (1.0 + half) / (1.0 - half) if half < 1.0 else math.inf

    @property
    def disk_phase(self) -> float:
        """Phase that the disk allows, rad."""
        return 2.0 * math.atan(0.5 * self.disk)


def margins(loop: ScalarLoop) -> LoopMargins | None:
    """The margins of a loop; None where it is already unstable."""
    if loop.grows():
        return None
    loop = loop.minimal()
    up, down = _gains(loop)
    crossings = [(w, loop.at(cmath.exp(1j * w * loop.period))) for w in _where_size_is(loop, 1.0)]
    # to -1, from L the way that a delay turns it; and the other way, which is that of the crossing below 0
    of_phase = [(abs(cmath.phase(-L)), w) for w, L in crossings]
    of_delay = [((cmath.phase(-L) % (2.0 * math.pi)) / w, w) for w, L in crossings if w > 0.0]
    phase, at_phase = min(of_phase, default=(None, None))
    delay, at_delay = min(of_delay, default=(None, None))
    disk, at_disk = _disk(loop)
    return LoopMargins(up[0], down[0], phase, delay, disk, up[1], down[1], at_phase, at_delay, at_disk)


def bandwidth(way: ScalarLoop) -> float:
    """The lowest frequency at which |P| is 1/sqrt(2) of its value at rest, Hz. It is infinite where |P| never is, 0
    of what grows, and not a number where P has no value at rest or that is 0."""
    if way.grows(0.0):
        return 0.0
    own = way.minimal()
    rest = abs(own.at(1.0)) if _is_number(own, 0.0) else 0.0
    frequencies = _where_size_is(own, rest / math.sqrt(2.0)) if rest else [math.nan]
    return min(frequencies, default=math.inf) / (2.0 * math.pi)


def _gains(loop: ScalarLoop) -> tuple[tuple[float | None, float | None], tuple[float | None, float | None]]:
    """The gains at which the closed loop comes to the unit circle: the least above 1 and the largest below, each with
    its frequency."""
    crossings = [
        (-1.0 / L.real, w) for w in _where_real(loop) if (L := loop.at(cmath.exp(1j * w * loop.period))).real < 0
    ]
    edge = [(1.0, w) for k, w in crossings if abs(k - 1.0) <= EDGE]
    above = [(k, w) for k, w in crossings if k > 1.0 + EDGE] + (edge if loop.grows(1.01) else [])
    below = [(k, w) for k, w in crossings if k < 1.0 - EDGE] + (edge if loop.grows(0.99) else [])
    return min(above, default=(None, None)), max(below, default=(None, None))


def _roots(loop: ScalarLoop, last: Sequence[Sequence[np.ndarray | float]], by_output: bool) -> list[float]:
    """Angular frequencies, rad/s, from 0 to the half of the sampling rate, at which the rows `last` hold of (x, xi, u):
    x of P, and xi of P(1/z), which is driven by u, or by P's output."""
    from scipy.linalg import eig

    A, B, C, D, n = loop.A, loop.B[:, None], loop.C[None, :], np.array([[loop.D]]), len(loop.A)
    none, identity = np.zeros((n, n)), np.eye(n)
    F = np.block([[A, none, B], [none, identity, np.zeros((n, 1))], [np.atleast_2d(row) for row in last[0]]])
    driven = [B @ C, A, B @ D] if by_output else [none, A, B]
    E = np.block([[identity, none, np.zeros((n, 1))], driven, [np.zeros((1, n)), np.zeros((1, n)), np.zeros((1, 1))]])
    over, under = eig(F, E, right=False, homogeneous_eigvals=True)
    with np.errstate(all="ignore"):
        z = over / under
    near = z[np.isfinite(z) & (np.abs(np.abs(z) - 1.0) < ON_CIRCLE)]
    return sorted({abs(cmath.phase(eigenvalue)) / loop.period for eigenvalue in near.tolist()})


def _where_real(loop: ScalarLoop) -> list[float]:
    """Frequencies at which L is real, the two ends among them."""
    C = loop.C[None, :]
    frequencies = _roots(loop, [[C, -C, np.zeros((1, 1))]], by_output=False)
    nyquist = math.pi / loop.period
    inner = _refined(frequencies, lambda w: loop.at(cmath.exp(1j * w * loop.period)).imag, nyquist)
    ends = [w for w in (0.0, nyquist) if _is_number(loop, w)]
    return [*inner, *ends]


def _where_size_is(loop: ScalarLoop, size: float) -> list[float]:
    """Frequencies, rad/s up to Nyquist's, at which the size of the loop |L| has this value.

    They are eigenvalues of the pencil of |L|^2 = size^2, then refined on |L| itself. Nyquist's own is tried by itself,
    for a root is refined from both of its sides.
    """
    C, D = loop.C[None, :], loop.D
    last = [[D * C, C, np.array([[D * D - size * size]])]]
    frequencies = _roots(loop, last, by_output=True)
    nyquist = math.pi / loop.period

    def apart(w: float) -> float:
        return abs(loop.at(cmath.exp(1j * w * loop.period))) - size

    inner = _refined(frequencies, apart, nyquist)
    return inner + [w for w in (nyquist,) if abs(apart(w)) <= 1e-12 * size]


def _is_number(loop: ScalarLoop, w: float) -> bool:
    """True where L, of a loop with its own states only, has a value: there is no pole. A multiple pole is computed as
    several beside it, at a distance of that root of the rounding error."""
    z = cmath.exp(1j * w * loop.period)
    poles = loop.poles[np.argsort(np.abs(loop.poles - z))]
    # rounding spreads a multiple pole around itself, by that root of it; their mean stays
    return not any(
        abs(poles[many - 1] - z) <= 20.0 * 2.2e-16 ** (1.0 / many) + 1e-9 and abs(poles[:many].mean() - z) <= 1e-9
        for many in range(1, min(len(poles), 4) + 1)
    )


def _refined(estimates: Sequence[float], zero: Callable[[float], float], nyquist: float) -> list[float]:
    """Roots of a function near these, each refined in an interval in which the function changes its sign."""
    from scipy.optimize import brentq

    roots: list[float] = []
    for w in estimates:
        for width in (1e-9, 1e-7, 1e-5, 1e-3):
            low, high = max(w * (1.0 - width) - 1e-12 * nyquist, 1e-12 * nyquist), min(w * (1.0 + width), nyquist)
            if low >= high:
                continue
            a, b = zero(low), zero(high)
            if math.isfinite(a) and math.isfinite(b) and (a < 0.0) != (b < 0.0):
                root = float(brentq(zero, low, high, xtol=1e-15 * nyquist, rtol=8.9e-16))
                if not any(abs(root - other) < 1e-12 * nyquist for other in roots):
                    roots.append(root)
                break
    return roots


def _disk(loop: ScalarLoop) -> tuple[float, float]:
    """The disk margin alpha = 1/max|S - 1/2| on the unit circle, S = 1/(1 + L), and the frequency of the maximum:
    levels are raised until none is above (N. Bruinsma and M. Steinbuch, A fast algorithm to compute the H-inf norm of a
    transfer function matrix, 1990)."""
    gain = 1.0 / (1.0 - loop.D)
    A, B = loop.closed(), gain * loop.B
    T = ScalarLoop(A, B, gain * loop.C, gain - 0.5, loop.period)  # S - 1/2, of P: S = 1/(1 - P)
    nyquist = math.pi / loop.period
    tried = [nyquist * k / 16 for k in range(1, 17)] + [
        abs(cmath.phase(z)) / loop.period for z in T.poles.tolist() if abs(z) > 0.0
    ]
    size, frequency = max(T.sizes([w for w in tried if _is_number(T, w)]))
    for _ in range(60):
        level = size * (1.0 + 1e-12)
        crossings = sorted({1e-9 * nyquist, *_where_size_is(T, level), nyquist})
        middles = [math.sqrt(a * b) for a, b in pairwise(crossings)]
        best, where = max(T.sizes([*middles, *crossings]))
        if best <= level:
            break
        size, frequency = best, where
    return 1.0 / size, frequency


def comes_back(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray) -> bool:
    """False where nothing comes back from the open places: P is 0. Arrays as in `gain_limits`."""
    moved, largest = B, np.max(np.abs(D), initial=0.0)
    for _ in range(len(A)):
        largest = max(largest, np.max(np.abs(C @ moved), initial=0.0))
        moved = A @ moved
    return bool(largest > 0.0)


FARTHEST, STRIDE = 1e4, 1.05
"""Largest factor on the gain up to which a limit of several ticks or loops is searched for, and the ratio of
neighbouring tries."""

AT_ONCE = 16
"""Gains that are tried at once."""

HUGE = 1e300
"""Stands for a pole of a loop that has no value."""


def gain_limits(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, drift: float = STABLE
) -> tuple[float | None, float | None]:
    """The factors on the gain of all loops at once at which they become unstable, the nearest below and above 1, to
    1e-12; None: at none that was tried, or they are already unstable. C x + D u comes back for u put in at the open
    places; drift: as in `ScalarLoop`."""

    from scipy.optimize import brentq

    def sizes(gains: Sequence[float]) -> np.ndarray:
        """The spectral radius of the closed loop for each gain."""
        factors = np.array(gains)[:, None, None]
        try:
            back = np.linalg.solve(np.eye(len(D)) - factors * D, np.broadcast_to(C, (len(gains), *C.shape)))
        except np.linalg.LinAlgError:
            return np.concatenate([sizes([gain]) for gain in gains]) if len(gains) > 1 else np.array([HUGE])
        poles = np.linalg.eigvals(A + factors * (B @ back)) if len(A) else np.zeros((len(gains), 0))
        largest: np.ndarray = np.max(np.abs(poles), axis=-1, initial=0.0)
        return largest

    own = float(sizes([1.0])[0])
    if own > 1.0 + drift:
        return None, None
    edge = max(1.0, own) + 1e-2 * STABLE
    limits: list[float | None] = []
    for stride in (1.0 / STRIDE, STRIDE):
        tried = [1.0]
        while 1.0 / FARTHEST < tried[-1] < FARTHEST:
            tried.append(tried[-1] * stride)
        for first in range(1, len(tried), AT_ONCE):
            grows = np.flatnonzero(sizes(tried[first : first + AT_ONCE]) > edge)
            if len(grows):
                good, bad = tried[first + int(grows[0]) - 1 : first + int(grows[0]) + 1]
                root = brentq(lambda gain: sizes([gain])[0] - edge, good, bad, xtol=1e-18, rtol=1e-13, maxiter=1000)
                limits.append(float(root))
                break
        else:
            limits.append(None)
    return limits[0], limits[1]
