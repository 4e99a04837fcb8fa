"""A payload on a link, in free flight, and the impact between: against linear algebra, and by hand."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from met.dynamics.effective_inertia import effective_inertia
from met.dynamics.kinematics import Energy, LinkMotion, energy, link_motions, momentum
from met.dynamics.payload import (
    energy_of,
    free_acceleration,
    in_tree,
    loaded,
    raised,
    twist_against,
)
from met.dynamics.recursion import Solved, reactions, solve
from met.dynamics.spatial import Pose, Rigid, compose, inverse, rigid_about_centre, rotation_rpy
from met.dynamics.tree import Body, Tree
from tests.met.dynamics.passes import CLOSE, stand
from tests.met.dynamics.test_free_base import floated, vector
from tests.oracles import dense
from tests.oracles.random_tree import RandomArm, random_tree
from tests.oracles.worst import Worst, relative

Array = np.ndarray


@dataclass(frozen=True)
class Meeting:
    """A payload that meets a link of an arm, the base's pose and velocity (its own axes) beside it."""

    body: Body
    motion: LinkMotion
    link: str
    base: Pose
    base_velocity: tuple[tuple[float, ...], tuple[float, ...]]

    @property
    def rigid(self) -> Rigid:
        return rigid_about_centre(self.body.mass, self.body.com, self.body.inertia)


def meeting(arm: RandomArm, *, free: bool) -> Meeting:
    """A random payload in a random place; where the base is not free it is at rest at the world's origin."""
    random = np.random.default_rng(9000 + arm.seed)
    body = replace(floated(replace(arm, seed=arm.seed + 500)).bodies[-1], name="payload")
    position, rpy, w, v, at, turn, rate, push = random.normal(size=(8, 3))
    link = arm.bodies[int(random.integers(len(arm.bodies)))].name
    own = LinkMotion(Pose(rotation_rpy(*map(float, rpy)), vector(position)), vector(w), vector(v))
    base = Pose(rotation_rpy(*map(float, turn)), vector(at)) if free else Pose(rotation_rpy(0.0, 0.0, 0.0), (0.0,) * 3)
    return Meeting(body, own, link, base, (vector(rate), vector(push)) if free else ((0.0,) * 3, (0.0,) * 3))


def struck(arm: RandomArm, tree: Tree, met: Meeting, mode: object) -> tuple[Solved, Tree, Pose]:
    """The pass of the impact, the tree with the payload, and its pose in the link."""
    link = link_motions(tree, arm.q, arm.qd, met.base, met.base_velocity)[met.link]
    pose = compose(inverse(link.pose), met.motion.pose)
    more = loaded(tree, met.link, in_tree(tree, met.link, met.rigid, pose))
    blow = raised(momentum(met.rigid, twist_against(met.motion, link)), pose)
    return solve(more, arm.q, (0.0,) * arm.n, mode=mode, rotor=arm.rotor, wrenches={met.link: blow}), more, pose


def in_world(met: Meeting) -> tuple[Array, Array, Array]:
    """Of the payload, about its frame's origin in world axes: spatial inertia, velocity, and the origin."""
    R, p = np.array(met.motion.pose.R), np.array(met.motion.pose.p)
    xx, yy, zz, xy, xz, yz = met.body.inertia
    c = R @ np.array(met.body.com)
    C = np.array([[0.0, -c[2], c[1]], [c[2], 0.0, -c[0]], [-c[1], c[0], 0.0]])
    J = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T
    m = met.body.mass
    inertia = np.block([[J - m * C @ C, m * C], [-m * C, m * np.eye(3)]])
    return inertia, np.concatenate([R @ np.array(met.motion.w), R @ np.array(met.motion.v)]), p


def algebra(arm: RandomArm, met: Meeting, *, free: bool) -> tuple[Array, Array, Array, Array]:
    """M, J of the link's material where the payload is (angular over linear, world axes), I_p and dV; a free base's
    coordinates are those of a stand without matter."""
    bodies, q, qd, rotor = list(arm.bodies), arm.q, arm.qd, arm.rotor
    if free:
        bodies = [*stand(), *(replace(body, parent=body.parent + 6) for body in arm.bodies)]
        at, to_twist = platform(met.base)
        rates = np.linalg.solve(to_twist, np.concatenate(met.base_velocity))
        q, qd, rotor = (*at, *arm.q), (*rates, *arm.qd), (0.0,) * 6 + arm.rotor
    on = dense.DenseArm(bodies, rotor=rotor)
    link = on.links(q, qd, (0.0,) * len(q))[[body.name for body in bodies].index(met.link)]
    inertia, V, p = in_world(met)
    r = p - np.array(link.p, float)
    Jw, Jv = np.array(link.Jw, float), np.array(link.Jv, float)
    J = np.vstack([Jw, Jv + np.cross(Jw.T, r).T])
    return np.array(on.mass_matrix(q), float), J, inertia, V - J @ np.array(qd)


def platform(base: Pose) -> tuple[tuple[float, ...], Array]:
    """Positions of the stand whose last body is where the base is, and from its rates to the base's twist in base
    axes."""
    R = np.array(base.R)
    yaw, pitch, roll = math.atan2(R[1, 0], R[0, 0]), -math.asin(R[2, 0]), math.atan2(R[2, 1], R[2, 2])
    at = (*base.p, yaw, pitch, roll)
    top = dense.DenseArm(stand()).links(at, (0.0,) * 6, (0.0,) * 6)[-1]
    return at, np.array(np.vstack([R.T @ top.Jw, R.T @ top.Jv]), float)


def predicted(M: Array, J: Array, inertia: Array, dV: Array, yields: Array) -> Array:
    """The jump of the rates: (M + J' I_p J) d(qd) = J' I_p dV over what yields."""
    jump = np.zeros(len(M))
    whole = M + J.T @ inertia @ J
    jump[yields] = np.linalg.solve(whole[np.ix_(yields, yields)], (J.T @ inertia @ dV)[yields])
    return jump


def total(arm: RandomArm, tree: Tree, qd: tuple[float, ...], base: Pose, twist: object, *others: Energy) -> Array:
    """Kinetic energy with rotors, and momentum, of arm and others."""
    own = energy(tree, arm.q, qd, rotor=arm.rotor, base=base, base_velocity=twist)
    return sum(np.array([each.kinetic, *each.linear, *each.angular]) for each in (own, *others))


@pytest.mark.release
@pytest.mark.parametrize("free", [False, True])
def test_the_jump_of_the_rates_agrees_with_linear_algebra_in_every_mode(free: bool) -> None:
    joints, bases = Worst("impact: joints"), Worst("impact: base")
    for seed in range(60):
        arm = floated(random_tree(seed)) if free else random_tree(seed)
        tree, met = Tree.build(arm.bodies, free=free), meeting(arm, free=free)
        M, J, inertia, dV = algebra(arm, met, free=free)
        for mode in ((True,) * arm.n, arm.mode):
            ours = struck(arm, tree, met, mode)[0]
            expected = predicted(M, J, inertia, dV, np.array((True,) * 6 * free + mode))
            size = np.max(np.abs(expected), initial=1e-3)
            joints.see(np.max(np.abs(np.array(ours.qdd) - expected[6 * free :])) / size, f"seed {seed}")
            if free:
                twist = platform(met.base)[1] @ expected[:6]
                bases.see(np.max(np.abs(np.concatenate(ours.base_acceleration) - twist)) / size, f"seed {seed}")
    # numpy's elimination on M, in doubles, loses what the recursion does not: measured 1.2e-12
    joints.below(1e-11)
    if free:
        bases.below(1e-11)


@pytest.mark.release
def test_momentum_goes_over_to_rounding_and_energy_is_lost_as_the_formula_says() -> None:
    kept, lost = Worst("impact on a free base: momentum"), Worst("impact: energy lost")
    for seed in range(60):
        for free in (True, False):
            arm = floated(random_tree(seed)) if free else random_tree(seed)
            tree, met = Tree.build(arm.bodies, free=free), meeting(arm, free=free)
            ours, more, _ = struck(arm, tree, met, True)
            before = total(arm, tree, arm.qd, met.base, met.base_velocity, energy_of(met.rigid, met.motion))
            twist = tuple(tuple(np.add(a, b)) for a, b in zip(met.base_velocity, ours.base_acceleration, strict=True))
            after = total(arm, more, tuple(np.add(arm.qd, ours.qdd)), met.base, twist)
            if free:
                sizes = np.max(np.abs(np.concatenate([before[1:], after[1:]])))
                kept.see(np.max(np.abs(after[1:] - before[1:])) / sizes, f"seed {seed}")
            M, J, inertia, dV = algebra(arm, met, free=free)
            mobility = J @ np.linalg.solve(M, J.T) + np.linalg.inv(inertia)
            formula = 0.5 * dV @ np.linalg.solve(mobility, dV)
            lost.see(abs(before[0] - after[0] - formula) / before[0], f"seed {seed}, free {free}")
    kept.below(1e-13)
    lost.below(1e-11)


@pytest.mark.slow
def test_a_payload_on_a_link_is_a_body_of_the_tree() -> None:
    motion, felt, borne = (Worst(f"payload held: {what}") for what in ("motion", "J_eff and b", "reactions"))
    for seed in range(60):
        for free in (True, False):
            arm = floated(random_tree(seed)) if free else random_tree(seed)
            met = meeting(arm, free=free)
            rng = np.random.default_rng(seed)
            at, rpy = vector(rng.normal(size=3)), vector(rng.normal(size=3))
            number = [body.name for body in arm.bodies].index(met.link)
            whole = Tree.build(
                [*arm.bodies, replace(met.body, parent=number, at=at, rpy=rpy)],
                [body.joint for body in arm.bodies if body.kind != "fixed"],
                free=free,
            )
            bare = Tree.build(arm.bodies, free=free)
            more = loaded(bare, met.link, in_tree(bare, met.link, met.rigid, Pose(rotation_rpy(*rpy), at)))
            one, other = (
                solve(
                    tree,
                    arm.q,
                    arm.qd,
                    tau=arm.tau,
                    qdd=arm.qdd,
                    mode=arm.mode,
                    rotor=arm.rotor,
                    gravity=arm.gravity,
                    base_rate=met.base_velocity[0],
                )
                for tree in (more, whole)
            )
            motion.see(relative((*one.qdd, *one.tau), (*other.qdd, *other.tau)), f"seed {seed}")
            felt.see(relative(effective_inertia(more, one), effective_inertia(whole, other)), f"seed {seed}")
            for a, b in zip(reactions(more, one), reactions(whole, other), strict=True):
                borne.see(relative(np.concatenate(a), np.concatenate(b)), f"seed {seed}")
    motion.below(CLOSE)
    felt.below(CLOSE)
    borne.below(CLOSE)


def test_two_free_bodies_that_meet_go_on_as_one() -> None:
    # A sphere of 3 kg at 4 m/s meets one of 1 kg at rest, 0.5 m beside its line. By hand: 3 m/s for the centre of
    # both, w = mu d v/(I_1 + I_2 + mu d^2) about it, and 1/2 mu v^2 (1 - mu d^2/I) of the energy goes.
    m_1, m_2, d, v = 1.0, 3.0, 0.5, 4.0
    I_1, I_2 = 0.2, 0.7
    tree = Tree.build([Body("base", "", "fixed", -1, mass=m_1, inertia=(I_1,) * 3 + (0.0,) * 3)], free=True)
    body = rigid_about_centre(m_2, (0.0, 0.0, 0.0), (I_2,) * 3 + (0.0,) * 3)
    there = Pose(rotation_rpy(0.0, 0.0, 0.0), (0.0, d, 0.0))
    own = LinkMotion(there, (0.0, 0.0, 0.0), (v, 0.0, 0.0))
    blow = raised(momentum(body, (own.w, own.v)), there)
    found = solve(loaded(tree, "base", in_tree(tree, "base", body, there)), (), (), wrenches={"base": blow})
    mu = m_1 * m_2 / (m_1 + m_2)
    w = -mu * d * v / (I_1 + I_2 + mu * d * d)
    at_centre = m_2 * v / (m_1 + m_2)
    np.testing.assert_allclose(found.base_acceleration[0], (0.0, 0.0, w), rtol=0, atol=1e-15)
    np.testing.assert_allclose(
        found.base_acceleration[1], (at_centre + w * m_2 / (m_1 + m_2) * d, 0.0, 0.0), rtol=0, atol=2e-15
    )
    V = found.base_acceleration[1][0]
    left = 0.5 * (m_1 * V**2 + m_2 * (V - w * d) ** 2 + (I_1 + I_2) * w**2)
    lost = 0.5 * mu * v * v * (1.0 - mu * d * d / (I_1 + I_2 + mu * d * d))
    assert 0.5 * m_2 * v * v - left == pytest.approx(lost, rel=1e-14)


def test_a_body_in_flight_changes_its_momentum_by_the_wrench_alone() -> None:
    worst = Worst("free flight: d(momentum)/dt against the wrench")
    for seed in range(60):
        met = meeting(random_tree(seed), free=False)
        moment, force, gravity = (vector(x) for x in np.random.default_rng(seed).normal(size=(3, 3)))
        wd, a = map(np.array, free_acceleration(met.rigid, met.motion.w, (moment, force), gravity))
        xx, yy, zz, xy, xz, yz = met.body.inertia
        J, c, w = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), np.array(met.body.com), np.array(met.motion.w)
        a_c = a + np.cross(wd, c) + np.cross(w, np.cross(w, c))
        pull = met.body.mass * np.array(gravity)
        found = np.concatenate([met.body.mass * a_c, J @ wd + np.cross(w, J @ w)])
        given = np.concatenate([np.array(force) + pull, np.array(moment) - np.cross(c, force)])
        worst.see(relative(found, given), f"seed {seed}")
    worst.below(1e-12)


def test_a_payload_on_the_ground_is_nothing_to_the_arm() -> None:
    arm = random_tree(3)
    tree = Tree.build(
        [*arm.bodies, Body("floor", "", "fixed", -1)], [body.joint for body in arm.bodies if body.kind != "fixed"]
    )
    assert loaded(tree, "floor", Rigid(5.0, (1.0, 0.0, 0.0), (1.0,) * 6)) is tree
