"""What environment models are told of links: orientation, rate, mass properties, and the ground."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met.diagnostic import Problem
from met.integrators.integrator import Motion
from met.parameter import WORLD
from met.program.motion.base import ArmWorld, BaseMotion
from met.program.system import System
from tests.ic.small_decks import changed, experiment
from tests.met.tree_deck import TREE
from tests.oracles.plan_tree import pinocchio

RUN = "run it { arm = tree;  rates { dynamics = 10 Hz; }  duration = 1 s;  record = [q]; }\n"
Q, QD = (0.3, -0.7, 0.2, 1.1), (0.5, -0.4, 0.3, -1.0)


def world(tmp_path: Path, text: str = TREE) -> ArmWorld:
    system = System(experiment(tmp_path, text, RUN))
    return ArmWorld(system, lambda _: 0.0, system.tree(lambda _: 0.0), Motion(Q, QD), BaseMotion(), time=0.0, begin=0.0)


@pytest.mark.oracle
def test_orientation_and_rate_are_those_of_pinocchio(tmp_path: Path) -> None:
    arm = pinocchio(experiment(tmp_path, TREE, RUN))
    found = world(tmp_path)
    d = 1e-6
    for link in ("trunk", "boom", "ram", "tool", "side"):
        R, p = arm.link_pose(np.array(Q), link)
        np.testing.assert_allclose(np.array(found.orientation(link), float), R, rtol=0, atol=1e-14)
        np.testing.assert_allclose(np.array(found.position(link), float), p, rtol=0, atol=1e-14)
        ahead, back = (arm.link_pose(np.array(Q) + s * np.array(QD), link)[0] for s in (d, -d))
        turning = (ahead - back) / (2 * d) @ R.T
        # by a central difference: 1e-16/1e-6 of rounding, and d^2
        rate = [turning[2, 1], turning[0, 2], turning[1, 0]]
        np.testing.assert_allclose(np.array(found.rate(link), float), rate, rtol=0, atol=1e-9)


def test_mass_centre_and_inertia_are_the_decks(tmp_path: Path) -> None:
    found = world(tmp_path)
    assert (found.mass("trunk"), found.com("trunk")) == (6.0, (0.1, -0.05, 0.3))
    assert found.inertia("trunk") == (0.4, 0.5, 0.3, 0.02, -0.03, 0.01)


def test_the_ground_is_at_rest_where_the_world_is(tmp_path: Path) -> None:
    found = world(tmp_path)
    point = (1.0, 2.0, 3.0)
    assert found.position(WORLD, point) == point and found.to_world(WORLD, point) == point
    assert found.velocity(WORLD, point) == found.rate(WORLD) == (0.0, 0.0, 0.0)
    assert np.array_equal(np.array(found.orientation(WORLD), float), np.eye(3))


def test_a_link_of_the_grounds_name_is_a_link(tmp_path: Path) -> None:
    found = world(tmp_path, changed(TREE, ("link side", "link world"), ("child = side", "child = world")))
    assert not found.is_ground(WORLD) and found.mass(WORLD) == 4.0 and found.position(WORLD) != (0.0, 0.0, 0.0)


@pytest.mark.parametrize("asked", ["position", "orientation", "rate", "mass", "com", "inertia"])
def test_a_link_that_is_not_there_is_told(asked: str, tmp_path: Path) -> None:
    with pytest.raises(Problem) as caught:
        getattr(world(tmp_path), asked)("boon")
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.code == "E218" and "`boon`" in diagnostic.message
