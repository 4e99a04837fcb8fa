"""heyoka's variational equations of arms that swing: what `arms_heyoka.json.gz` was made with.

heyoka.py (Biscani and Izzo, Revisiting high-order Taylor methods for astrodynamics and celestial mechanics, MNRAS 504,
2021; MPL 2.0) integrates ordinary differential equations, and how their solution moves with where it began, to
rounding. It is large, and not among the locked packages; so its answers are kept, and this file makes them anew in an
environment that has it:

    pip install heyoka==7.13.2
    python -m tests.oracles.arms_heyoka

An arm is a chain of rods in a vertical plane, each on the tip of the one before, whose joints turn freely. Its
equations are Lagrange's, in the rods' angles against the world: none of the recursion's.
"""

from __future__ import annotations

import gzip
import json
import sys
from pathlib import Path
from typing import Any

ANSWERS = Path(__file__).with_name("arms_heyoka.json.gz")
COUNTS = (2, 3, 5, 8)
SECONDS = 0.2
GRAVITY = 9.81


def rods(count: int) -> list[tuple[float, float, float, float]]:
    """Mass (kg), length, distance of the centre of mass (m) and inertia about it (kg m^2) of each rod."""
    return [(2.0 * 0.95**i, 0.5 * 0.97**i, 0.22 * 0.97**i, 0.04 * 0.9**i) for i in range(count)]


def begins(count: int) -> tuple[list[float], list[float]]:
    """Angles and rates of the joints at first, rad and rad/s."""
    return [0.3 - 0.4 * (i % 3) for i in range(count)], [0.5 - 0.3 * (i % 4) for i in range(count)]


def equations(hy: Any, count: int) -> list[tuple[Any, Any]]:
    """The variables, joint angles and then rates, each with its slope, for heyoka."""
    q = hy.make_vars(*(f"q{i}" for i in range(count)))
    u = hy.make_vars(*(f"u{i}" for i in range(count)))
    angle, rate = [q[0]], [u[0]]
    for i in range(1, count):
        angle.append(angle[-1] + q[i])
        rate.append(rate[-1] + u[i])
    A, pull, numbers = couplings(count), pulls(count), range(count)
    M = [[A[i][j] * hy.cos(angle[i] - angle[j]) if i != j else A[i][i] + 0.0 * q[0] for j in numbers] for i in numbers]
    right = []
    for i in numbers:
        bias = [A[i][j] * hy.sin(angle[i] - angle[j]) * rate[j] * rate[j] for j in numbers if j != i]
        right.append(-pull[i] * hy.cos(angle[i]) - hy.sum(bias))
    for k in numbers:  # Gauss; the matrix is positive definite
        for i in range(k + 1, count):
            share = M[i][k] / M[k][k]
            M[i] = [M[i][j] - share * M[k][j] if j > k else M[i][j] for j in numbers]
            right[i] = right[i] - share * right[k]
    turns: list[Any] = [None] * count
    for i in reversed(numbers):
        turns[i] = (right[i] - hy.sum([M[i][j] * turns[j] for j in range(i + 1, count)] or [0.0 * q[0]])) / M[i][i]
    slopes = [turns[0], *(turns[i] - turns[i - 1] for i in range(1, count))]
    return [*zip(q, u, strict=True), *zip(u, slopes, strict=True)]


def couplings(count: int) -> list[list[float]]:
    """A of M_ij = A_ij cos(angle_i - angle_j), kg m^2."""
    parts = rods(count)

    def coupling(i: int, j: int) -> float:
        inner, outer = min(i, j), max(i, j)
        mass, length, centre, inertia = parts[outer]
        beyond = sum(part[0] for part in parts[outer + 1 :])
        if i == j:
            return inertia + mass * centre**2 + length**2 * beyond
        return parts[inner][1] * (mass * centre + length * beyond)

    return [[coupling(i, j) for j in range(count)] for i in range(count)]


def pulls(count: int) -> list[float]:
    """What gravity pulls at each rod's angle where it is level, N m."""
    parts = rods(count)
    return [
        GRAVITY * (mass * centre + length * sum(part[0] for part in parts[i + 1 :]))
        for i, (mass, length, centre, _) in enumerate(parts)
    ]


def answer(count: int) -> dict[str, Any]:
    """The state of an arm after `SECONDS`, and its derivatives by where it began, [state][state]."""
    import heyoka as hy

    varied = hy.var_ode_sys(equations(hy, count), hy.var_args.vars, order=1)
    found = hy.taylor_adaptive(varied, [x for part in begins(count) for x in part], tol=1e-16, compact_mode=True)
    found.propagate_until(SECONDS)
    moves = [found.state[found.get_vslice(order=1, component=i)].tolist() for i in range(2 * count)]
    return {"state": found.state[: 2 * count].tolist(), "moves": moves}


def main() -> None:
    made = {}
    for count in COUNTS:
        made[str(count)] = answer(count)
        print(count, "joints", file=sys.stderr)
    with ANSWERS.open("wb") as raw, gzip.GzipFile(fileobj=raw, mode="wb", mtime=0, filename="") as file:
        file.write(json.dumps(made).encode())


if __name__ == "__main__":
    main()
