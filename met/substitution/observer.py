"""The observer: a steady-state Kalman filter that estimates shaft rate, the filter's two states and the torque missing
in the data sheet from the filtered rate alone.

    x = (w, y, z, d):  J w' = -damp w + d + u,  y' = z,  z' = wc^2 (w - y) - sqrt(2) wc z,  d' = 0

u is held over a tick, so the prediction is exact. The noises of a tick are a torque held over it, a step of d, and an
error of the reading.
"""

from __future__ import annotations

from met.frozen import frozen
from met.substitution import butterworth
from met.trace import Real, exp

Four = tuple[Real, Real, Real, Real]
Square = tuple[Four, Four, Four, Four]


@frozen
class DiscreteModel:
    """The bed over one tick.

    A, B   x at the next tick is A x + B u
    """

    A: Square
    B: Four


def model(*, inertia: Real, damping: Real, f_cut: Real, period: Real) -> DiscreteModel:
    """The modelled bed: shaft inertia (kg m^2), Kt^2/R + F_v (N m s/rad, above 0), filter (Hz), tick (s)."""
    decay = damping / inertia
    lowpass = butterworth.over(f_cut, period)
    fading = exp(-decay * period)

    def after(w: Real, y: Real, z: Real, d: Real, u: Real) -> Four:
        final = (d + u) / damping
        y, z = butterworth.along_decay(lowpass, (y, z), w, final, decay)
        return final + (w - final) * fading, y, z, d

    columns = [after(*(1.0 if i == j else 0.0 for i in range(5))) for j in range(5)]
    rows = tuple((columns[0][i], columns[1][i], columns[2][i], columns[3][i]) for i in range(4))
    return DiscreteModel((rows[0], rows[1], rows[2], rows[3]), columns[4])


def predicted(discrete: DiscreteModel, x: Four, u: Real) -> Four:
    """x at the next tick, with the torque u (N m) held until then."""
    rows = [
        sum((a * b for a, b in zip(row, x, strict=True)), b * u) for row, b in zip(discrete.A, discrete.B, strict=True)
    ]
    return rows[0], rows[1], rows[2], rows[3]


def corrected(x: Four, gain: Four, reading: Real) -> Four:
    """x once the filtered rate (rad/s) has been read at this tick."""
    surprise = reading - x[1]
    a, b, c, d = (value + k * surprise for value, k in zip(x, gain, strict=True))
    return a, b, c, d


@frozen
class Noise:
    """Noise of the observer's model, as variances of one tick.

    torque   of a torque held over the tick, (N m)^2
    drift    of a step of d, (N m)^2
    reading  of the filtered rate that is read, (rad/s)^2
    """

    torque: Real
    drift: Real
    reading: Real


def gain_of(P: Square, noise: Noise) -> Four:
    """The gain on the innovation of a reading of y, from the covariance of x before it."""
    total = P[1][1] + noise.reading
    return P[0][1] / total, P[1][1] / total, P[2][1] / total, P[3][1] / total


def next_covariance(discrete: DiscreteModel, P: Square, noise: Noise) -> Square:
    """The covariance of x before the next reading, from that before this one: one turn of Riccati's recursion."""
    gain = gain_of(P, noise)
    read = [[P[i][j] - gain[i] * P[1][j] for j in range(4)] for i in range(4)]
    half = [[sum((discrete.A[i][k] * read[k][j] for k in range(4)), 0.0) for j in range(4)] for i in range(4)]
    rows = [[0.0] * 4 for _ in range(4)]  # type: list[list[Real]]
    for i in range(4):
        for j in range(i + 1):
            entry = sum((half[i][k] * discrete.A[j][k] for k in range(4)), discrete.B[i] * discrete.B[j] * noise.torque)
            rows[i][j] = rows[j][i] = entry + (noise.drift if i == j == 3 else 0.0)
    a, b, c, d = (tuple(row) for row in rows)
    return a, b, c, d  # type: ignore[return-value]
