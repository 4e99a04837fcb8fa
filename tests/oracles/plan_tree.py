"""The arm of a compiled deck, for Pinocchio: its bodies with the numbers of the plan, which no case may vary."""

from __future__ import annotations

from collections.abc import Sequence

from met.dynamics.tree import Body
from met.plan import Experiment
from tests.oracles.pinocchio_tree import PinocchioTree

INERTIA = ("xx", "yy", "zz", "xy", "xz", "yz")


def bodies(experiment: Experiment) -> list[Body]:
    """Parents before children, as the deck's joints are to be written."""

    def number(path: str) -> float:
        value = experiment.parameters[path].value
        assert isinstance(value, float), path
        return value

    def vector(path: str) -> tuple[float, float, float]:
        x, y, z = (number(f"{path}.{axis}") for axis in "xyz")
        return (x, y, z)

    joints = experiment.structure.joints
    order = [joint.child for joint in joints]
    return [
        Body(
            name=joint.child,
            joint=joint.name,
            kind=joint.kind,
            parent=-1 if joint.parent == "base" else order.index(joint.parent),
            at=vector(f"{joint.name}.at"),
            rpy=vector(f"{joint.name}.rpy"),
            axis=(0.0, 0.0, 1.0) if joint.kind == "fixed" else vector(f"{joint.name}.axis"),
            mass=number(f"links.{joint.child}.mass"),
            com=vector(f"links.{joint.child}.com"),
            inertia=tuple(number(f"links.{joint.child}.inertia.{entry}") for entry in INERTIA),
        )
        for joint in joints
    ]


def pinocchio(
    experiment: Experiment, *, gravity: Sequence[float] = (0.0, 0.0, 0.0), rotor: Sequence[float] = ()
) -> PinocchioTree:
    """The same arm in Pinocchio; rotor: one number a moving joint, none where left out."""
    moving = experiment.structure.moving
    return PinocchioTree(bodies(experiment), gravity, list(rotor) or [0.0] * len(moving))
