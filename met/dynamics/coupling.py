"""Joints that follow others: they and the joints that lead them move as one coordinate, exactly (docs/physics.md).

    q_i = sum_j G_ij u_j + c_i        u: positions of the joints that lead; G_jj = 1 for these

Where a loop gives q_i as a function of u_j, G_ij is its derivative, and q_i'' has a share (dG_ij/du_j) u_j'^2 of its
own. The recursion is affine in the accelerations u'' of the joints that lead. One pass with all coupled joints held at
their own shares gives the torques tau0 that they take, and one more pass for each leader, at rest and without loads,
the torques T_j that u''_j = 1 takes besides. With Q the torques given at the joints

    G' T u'' = G' (Q - tau0)

and every result is that of the first pass plus u''_j times that of pass j. No constraint is solved, so none drifts. The
coupling exerts torques about the axes of its joints alone, each on the joint's link against its parent.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from operator import attrgetter
from typing import Any

from met.dynamics.linearised import tell
from met.dynamics.recursion import SINGULAR, FreeRotor, Solved, solve
from met.dynamics.spatial import ZERO, Real, Vector, add, choose, is_zero, scale
from met.dynamics.tree import Tree
from met.trace import both, is_nan
from met.trace.primitives import divide
from met.trace.scalar import Scalar

Ratios = tuple[Mapping[int, Real], ...]
"""By joint, its rate for each unit of the rate of a joint that leads it, by that one's number: of a leader {itself: 1},
of a joint that is not coupled {}."""


def solve_coupled(tree: Tree, ratios: Ratios, bends: Sequence[Real] = (), **arguments: Any) -> Solved:
    """The arm's motion at one instant, as `recursion.solve`, of which it takes the arguments `q`, `qd`, `tau`, `qdd`,
    `mode`, `rotor` and so on, with coupled joints.

    bends  by joint, its own share of its acceleration, not a number where its loop is flat; none: they have none

    The mode of a leader is that of all that it leads; modes and accelerations given for followers are not read. Of a
    leader, `tau` and `tau_load` are those at its coordinate: what it and its followers take together, less the torques
    given at the followers. Of a follower, `tau` is as given, and `tau_load` what its own link takes.
    """
    n = len(tree.joints)
    arguments = {"tau": (0.0,) * n, "qdd": (0.0,) * n, "rotor": (0.0,) * n, "mode": (True,) * n, **arguments}
    leaders = sorted({j for row in ratios for j in row})
    members = [i for i, row in enumerate(ratios) if row]
    tau, rotor, modes = arguments["tau"], arguments["rotor"], arguments["mode"]
    held = tuple(False if row else mode for row, mode in zip(ratios, modes, strict=True))
    own = tuple(bends) or (0.0,) * n
    rest = tuple(bend if row else x for row, bend, x in zip(ratios, own, arguments["qdd"], strict=True))
    first = _differentiable_pass(tree, {**arguments, "mode": held, "qdd": rest})
    passes = [
        _differentiable_pass(
            tree, _at_rest(arguments, n) | {"mode": held, "qdd": tuple(row.get(j, 0.0) for row in ratios)}
        )
        for j in leaders
    ]

    def at_leader(torques: Sequence[Real], j: int) -> Real:
        """The sum of the joints' torques as they act on the coordinate of a leader."""
        return sum((ratios[i][j] * torques[i] for i in members if j in ratios[i]), 0.0)

    # a leader whose acceleration is given has a row of the identity
    inertia = [
        [choose(modes[j], at_leader(solved.tau, j), float(j == k)) for k, solved in zip(leaders, passes, strict=True)]
        for j in leaders
    ]
    missing = [choose(modes[j], at_leader(tau, j) - at_leader(first.tau, j), arguments["qdd"][j]) for j in leaders]
    moved, pivots = _eliminated(inertia, missing)

    def whole(part: Callable[[Solved], Any]) -> Any:
        """A result of all passes together, numbers in nested tuples."""
        total = part(first)
        for u, solved in zip(moved, passes, strict=True):
            total = _added(total, u, part(solved))
        return total

    qdd = tuple(
        sum((row[j] * u for j, u in zip(leaders, moved, strict=True) if j in row), bend) if row else x
        for row, bend, x in zip(ratios, own, whole(lambda solved: solved.qdd), strict=True)
    )
    needed, torques, loads = whole(lambda solved: solved.tau), list(tau), list(whole(lambda solved: solved.tau_load))
    singular = list(first.singular)
    for i, row in enumerate(ratios):
        if not row:
            torques[i] = needed[i]
        if not is_zero(own[i]):
            singular[i] = is_nan(own[i])
    for j, pivot in zip(leaders, pivots, strict=True):
        followers = sum((ratios[i][j] * tau[i] for i in members if j in ratios[i] and i != j), 0.0)
        torques[j] = choose(modes[j], tau[j], at_leader(needed, j) - followers)
        loads[j] = torques[j] - rotor[j] * qdd[j]
        reach = at_leader([ratios[i].get(j, 0.0) * joint.reach for i, joint in enumerate(tree.joints)], j)
        singular[j] = both(modes[j], pivot <= SINGULAR * reach)
    return replace(
        first,
        qdd=qdd,
        tau=tuple(torques),
        tau_load=tuple(loads),
        singular=tuple(singular),
        mode=tuple(modes[min(row)] if row else mode for row, mode in zip(ratios, modes, strict=True)),
        **{name: whole(attrgetter(name)) for name in ("wd", "a", "about", "base_acceleration")},
    )


def inertia_at(tree: Tree, ratios: Ratios, arguments: Mapping[str, Any], joint: int) -> Real:
    """The inertia at a joint that moves by itself, with all that follows it and all other joints in their modes, kg m^2
    (kg): `effective_inertia` with coupled joints. arguments: as `solve_coupled` takes them"""
    n = len(tree.joints)
    mode = tuple(False if i == joint else mode for i, mode in enumerate(arguments["mode"]))
    unit = tuple(float(i == joint) for i in range(n))
    return solve_coupled(tree, ratios, **_at_rest(arguments, n), mode=mode, qdd=unit).tau_load[joint]


def at_leaders(ratios: Ratios, columns: Sequence[tuple[Vector, Vector]]) -> list[tuple[Vector, Vector]]:
    """Columns of a Jacobian, angular and linear by joint, for unit rates of joints that move by themselves, with all
    that follow each; zeros for those that follow."""
    of_leaders: list[tuple[Vector, Vector]] = []
    for i, own in enumerate(columns):
        total = own if i in ratios[i] or not ratios[i] else (ZERO, ZERO)
        for row, (w, v) in zip(ratios, columns, strict=True):
            if i in row and row is not ratios[i]:
                total = add(total[0], scale(row[i], w)), add(total[1], scale(row[i], v))
        of_leaders.append(total)
    return of_leaders


def _differentiable_pass(tree: Tree, arguments: Mapping[str, Any]) -> Solved:
    """A pass of the recursion, of which the graph is given the derivative."""
    solved = solve(tree, **arguments)
    defaults = {"wrenches": None, "velocity_products": True, "spin": None, "free_rotors": None}
    tell(tree, {**defaults, **arguments}, solved)
    return solved


def _at_rest(arguments: Mapping[str, Any], n: int) -> dict[str, Any]:
    """The arguments of a pass at rest, without loads and gravity, with the same rotors."""
    free = arguments.get("free_rotors")
    return {
        "q": arguments["q"],
        "qd": (0.0,) * n,
        "tau": (0.0,) * n,
        "rotor": arguments["rotor"],
        "spin": arguments.get("spin"),
        "free_rotors": None
        if free is None
        else tuple(None if rotor is None else FreeRotor(rotor.inertia, 0.0, 0.0) for rotor in free),
        "gravity": ZERO,
        "velocity_products": False,
    }


def _eliminated(matrix: list[list[Real]], right: list[Real]) -> tuple[list[Real], list[Real]]:
    """The solution of a positive definite system, rows of the identity among it, and the pivots of its elimination."""
    matrix, right, pivots = [list(row) for row in matrix], list(right), []
    for k, row in enumerate(matrix):
        pivots.append(row[k])
        for i in range(k + 1, len(matrix)):
            share = _quotient(matrix[i][k], row[k])
            matrix[i] = [a - share * b for a, b in zip(matrix[i], row, strict=True)]
            right[i] = right[i] - share * right[k]
    for k in reversed(range(len(matrix))):
        for j in range(k + 1, len(matrix)):
            right[k] = right[k] - matrix[k][j] * right[j]
        right[k] = _quotient(right[k], matrix[k][k])
    return right, pivots


def _quotient(a: Real, b: Real) -> Real:
    return a / b if isinstance(a, Scalar) or isinstance(b, Scalar) else divide(a, b)


def _added(total: Any, factor: Real, more: Any) -> Any:
    """total + factor more, of numbers in nested tuples."""
    if isinstance(total, tuple):
        return tuple(_added(a, factor, b) for a, b in zip(total, more, strict=True))
    return total if is_zero(more) else total + factor * more
