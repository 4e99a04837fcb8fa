"""Passes of the recursion over random arms, as several tests make them."""

from __future__ import annotations

from functools import cache

from met.dynamics.recursion import Solved, solve
from met.dynamics.tree import Body, Tree
from tests.oracles.pinocchio_tree import PinocchioTree
from tests.oracles.random_tree import RandomArm, random_trees

# The recursion and Pinocchio both round at 1e-16 and lose some three digits on thirty joints in a row; measured worst
# over the 300 trees: 1.3e-14 for what is solved from the same numbers, 2.1e-12 for the reaction at a joint that bears
# little beside its neighbours.
CLOSE = 1e-11


@cache
def forest() -> tuple[tuple[RandomArm, Tree], ...]:
    """The 300 random arms with their trees."""
    return tuple((arm, Tree.build(arm.bodies)) for arm in random_trees())


def passed(arm: RandomArm, mode: object, tree: Tree | None = None, **changed: object) -> Solved:
    """One pass over an arm at its instant; words that `solve` takes replace the arm's own."""
    given = {"tau": arm.tau, "qdd": arm.qdd, "rotor": arm.rotor, "gravity": arm.gravity, "wrenches": arm.wrenches}
    return solve(tree or Tree.build(arm.bodies), arm.q, arm.qd, mode=mode, **{**given, **changed})


def pinocchio(arm: RandomArm) -> PinocchioTree:
    """The arm in Pinocchio."""
    return PinocchioTree(arm.bodies, arm.gravity, arm.rotor)


def stand() -> tuple[Body, ...]:
    """Three slides and three hinges without matter: what stands on the last can move in any way."""
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    slides = [Body(f"slide{i}", f"along{i}", "prismatic", i - 1, axis=axis) for i, axis in enumerate(axes)]
    hinges = [Body(f"hinge{i}", f"about{i}", "revolute", i + 2, axis=axis) for i, axis in enumerate(axes[::-1])]
    return (*slides, *hinges)
