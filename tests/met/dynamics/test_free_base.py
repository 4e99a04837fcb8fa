"""A base that moves freely: against Pinocchio's free-flyer, against linear algebra, and what must hold by itself."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from met.dynamics.effective_inertia import effective_inertia
from met.dynamics.kinematics import energy
from met.dynamics.recursion import Solved, reactions, solve
from met.dynamics.spatial import Pose
from met.dynamics.tree import Body, Tree
from met.trace import Formulas, Graph
from tests.met.dynamics.passes import CLOSE, stand
from tests.oracles import dense
from tests.oracles.pinocchio_floating import Flight, FloatingPinocchio
from tests.oracles.random_tree import RandomArm, random_tree, random_trees
from tests.oracles.worst import Worst, relative

ZERO = np.zeros(3)


@cache
def fleet() -> tuple[tuple[RandomArm, Tree, Flight], ...]:
    """150 of the random arms, each on a random base: the body `base` is the last, fixed to the base where it is."""
    arms = [floated(arm) for arm in random_trees()[::2]]
    return tuple((arm, Tree.build(arm.bodies, free=True), flight(arm.seed)) for arm in arms)


def floated(arm: RandomArm) -> RandomArm:
    """The arm on a base with matter, which a wrench may act on."""
    random = np.random.default_rng(7000 + arm.seed)
    spread = random.standard_normal((3, 3)) * 0.4
    mass = float(random.uniform(1.0, 20.0))
    second = mass * spread @ spread.T
    J = np.trace(second) * np.eye(3) - second
    own = Body(
        "base",
        "",
        "fixed",
        -1,
        mass=mass,
        com=tuple(map(float, 0.3 * random.standard_normal(3))),
        inertia=tuple(float(J[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))),
    )
    wrenches = dict(arm.wrenches)
    if random.random() < 0.5:
        moment, force = (tuple(map(float, 4.0 * random.standard_normal(3))) for _ in range(2))
        wrenches["base"] = (moment, force)
    return replace(arm, bodies=(*arm.bodies, own), wrenches=wrenches)


def flight(seed: int) -> Flight:
    """A random pose, and a random velocity."""
    random = np.random.default_rng(8000 + seed)
    R = np.linalg.qr(random.standard_normal((3, 3)))[0]
    return Flight(R * np.linalg.det(R), *(random.standard_normal(3) * size for size in (3.0, 1.0, 2.0)))


def passed(arm: RandomArm, tree: Tree, base: Flight, mode: object = True, **changed: object) -> Solved:
    """One pass over a floating arm; words that `solve` takes replace its own."""
    given = {
        "tau": arm.tau,
        "qdd": arm.qdd,
        "rotor": arm.rotor,
        "wrenches": arm.wrenches,
        "gravity": vector(base.R.T @ np.array(arm.gravity)),
        "base_rate": vector(base.w),
    }
    return solve(tree, arm.q, arm.qd, mode=mode, **{**given, **changed})


def vector(x: np.ndarray) -> tuple[float, float, float]:
    a, b, c = (float(each) for each in x)
    return a, b, c


def pose(base: Flight) -> Pose:
    return Pose(tuple(vector(row) for row in base.R), vector(base.p))  # type: ignore[arg-type]


def whole(solved: Solved) -> np.ndarray:
    """All accelerations."""
    return np.concatenate([*solved.base_acceleration, solved.qdd])


@pytest.mark.release
@pytest.mark.oracle
def test_accelerations_agree_with_pinocchios_free_flyer() -> None:
    # As a share of the largest of all.
    worst = Worst("free base: accelerations against aba")
    for arm, tree, base in fleet():
        theirs = FloatingPinocchio(arm.bodies, arm.gravity, arm.rotor)
        expected = np.concatenate(theirs.accelerations(base, arm.q, arm.qd, arm.tau, arm.wrenches))
        worst.see(relative(whole(passed(arm, tree, base)), expected), f"seed {arm.seed}")
    worst.below(CLOSE)


@pytest.mark.oracle
def test_mixed_modes_agree_with_pinocchios_free_flyer_both_ways() -> None:
    inverse, forward = Worst("free base, mixed modes: forces against rnea"), Worst("free base, mixed modes: aba")
    for arm, tree, base in fleet():
        ours = passed(arm, tree, base, arm.mode)
        theirs = FloatingPinocchio(arm.bodies, arm.gravity, arm.rotor)
        needed, tau = theirs.forces(base, arm.q, arm.qd, *ours.base_acceleration, ours.qdd, arm.wrenches)
        size = np.max(np.abs(tau)) + np.max(np.abs(theirs.forces(base, arm.q, arm.qd, ZERO, ZERO, ours.qdd, {})[0]))
        inverse.see(np.max(np.abs((*needed, *(tau - ours.tau)))) / size, f"seed {arm.seed}")
        expected = np.concatenate(theirs.accelerations(base, arm.q, arm.qd, ours.tau, arm.wrenches))
        forward.see(relative(whole(ours), expected), f"seed {arm.seed}")
    inverse.below(CLOSE)
    forward.below(CLOSE)


@pytest.mark.oracle
def test_energy_and_momentum_agree_with_pinocchios_free_flyer() -> None:
    kinetic, potential, momentum = (Worst(f"free base: {what}") for what in ("kinetic", "potential", "momentum"))
    for arm, tree, base in fleet():
        theirs = FloatingPinocchio(arm.bodies, arm.gravity, arm.rotor)
        ours = energy(
            tree, arm.q, arm.qd, gravity=arm.gravity, base=pose(base), base_velocity=(vector(base.w), vector(base.v))
        )
        expected = theirs.energy(base, arm.q, arm.qd)
        kinetic.see(abs(ours.kinetic - expected[0]) / expected[0], f"seed {arm.seed}")
        weights = sum(body.mass for body in arm.bodies) * np.linalg.norm(arm.gravity)
        potential.see(abs(ours.potential - expected[1]) / (weights + abs(expected[1])), f"seed {arm.seed}")
        both = np.concatenate(theirs.momentum(base, arm.q, arm.qd))
        momentum.see(relative((*ours.angular, *ours.linear), both), f"seed {arm.seed}")
    for each in (kinetic, potential, momentum):
        each.below(CLOSE)


@pytest.mark.release
def test_momentum_changes_by_the_external_wrench_alone() -> None:
    # From the accelerations, by an independent sum over the links; as a share of the largest part of the wrench's rate.
    worst = Worst("free base: d(momentum)/dt against the external wrench")
    for arm, tree, base in fleet():
        ours = passed(arm, tree, base, arm.mode)
        wd, a = (base.R @ np.array(each) for each in ours.base_acceleration)
        none = np.zeros((3, 0))
        moving = dense.LinkState(base.R, base.p, base.R @ base.w, base.R @ base.v, wd, a, none, none)
        links = dense.DenseArm(arm.bodies, arm.gravity, arm.rotor, arm.wrenches, moving)
        rate = np.concatenate(links.momentum_rate(arm.q, arm.qd, ours.qdd))
        parts = sum(body.mass for body in arm.bodies) * np.max(np.abs(whole(ours)))
        worst.see(np.max(np.abs(rate - np.concatenate(links.applied(arm.q)))) / parts, f"seed {arm.seed}")
    worst.below(CLOSE)


@pytest.mark.oracle
def test_qdd_given_back_in_acceleration_mode_returns_the_same_motion_and_torques() -> None:
    motion, torques = Worst("free base, qdd given back: accelerations"), Worst("free base, qdd given back: tau")
    for arm, tree, base in fleet():
        free = passed(arm, tree, base)
        theirs = FloatingPinocchio(arm.bodies, arm.gravity, arm.rotor)
        bias = theirs.forces(base, arm.q, arm.qd, ZERO, ZERO, np.zeros(arm.n), arm.wrenches)[1]
        size = max(np.max(np.abs(bias)), np.max(np.abs(free.tau)))
        random = np.random.default_rng(arm.seed)
        for subset in [random.random(arm.n) < share for share in (0.2, 0.8)] + [np.zeros(arm.n, bool)]:
            back = passed(arm, tree, base, tuple(map(bool, subset)), qdd=free.qdd)
            motion.see(relative(whole(back), whole(free)), f"seed {arm.seed}")
            torques.see(np.max(np.abs(np.subtract(back.tau, free.tau))) / size, f"seed {arm.seed}")
    motion.below(CLOSE)
    torques.below(CLOSE)


@pytest.mark.release
def test_inertia_and_torque_felt_agree_with_linear_algebra_in_every_mode() -> None:
    # The base's six coordinates are those of a stand without matter that yields: three slides and three hinges.
    held, yielding, bias = (Worst(f"free base: {what}") for what in ("J_eff, held", "J_eff, yielding", "b"))
    for seed in range(60):
        arm = floated(random_tree(seed))
        tree, (position, rpy, push, spin) = (
            Tree.build(arm.bodies, free=True),
            np.random.default_rng(seed).normal(size=(4, 3)),
        )
        at, rate = (tuple(map(float, (*x, *y[::-1]))) for x, y in ((position, rpy), (push, spin)))
        bearing = stand()
        platform = dense.DenseArm(bearing).links(at, rate, (0.0,) * 6)[-1]
        base = Flight(
            np.array(platform.R, float),
            np.array(platform.p, float),
            np.array(platform.R.T @ platform.w, float),
            np.array(platform.R.T @ platform.v, float),
        )
        bodies = [*bearing, *(replace(body, parent=body.parent + 6) for body in arm.bodies)]
        rotor = np.array((0.0,) * 6 + arm.rotor)
        on_stand = dense.DenseArm(bodies, arm.gravity, rotor, arm.wrenches)
        M, h = on_stand.mass_matrix(at + arm.q), on_stand.bias(at + arm.q, rate + arm.qd)
        for mode in ((True,) * arm.n, (False,) * arm.n, arm.mode):
            ours = passed(arm, tree, base, mode)
            given = [np.array((0.0,) * 6 + each) for each in (arm.tau, arm.qdd)]
            expected = dense.effective_inertia(M, h, *given, (True,) * 6 + mode, rotor)[6:]
            for i, ((J, b), (J_dense, b_dense)) in enumerate(zip(effective_inertia(tree, ours), expected, strict=True)):
                where = f"seed {seed}, joint {i}, mode {mode}"
                (yielding if mode[i] else held).see(abs(J - J_dense) / J_dense, where)
                bias.see(abs(b - b_dense) / (abs(ours.tau_load[i]) + abs(J * ours.qdd[i])), where)
    # what test_effective_inertia.py grants a fixed base, and for its reasons
    held.below(1e-9)
    yielding.below(1e-11)
    bias.below(1e-9)


@pytest.mark.slow
def test_a_free_base_moves_as_a_prescribed_one_that_is_told_its_acceleration() -> None:
    motion, borne = Worst("acceleration given back: joints"), Worst("acceleration given back: reactions")
    for arm, tree, base in fleet():
        free = passed(arm, tree, base, arm.mode)
        held = Tree.build(arm.bodies)
        told = passed(arm, held, base, arm.mode, base_acceleration=free.base_acceleration)
        motion.see(relative((*told.qdd, *told.tau), (*free.qdd, *free.tau)), f"seed {arm.seed}")
        for one, other in zip(reactions(held, told), reactions(tree, free), strict=True):
            borne.see(relative(np.concatenate(one), np.concatenate(other)), f"seed {arm.seed}")
    motion.below(CLOSE)
    borne.below(CLOSE)


def test_a_free_body_turns_as_euler_says() -> None:
    # dw/dt of a gyroscope, and a force through a point off its centre; no joints at all
    J = np.diag([2.0, 3.0, 4.0])
    com = np.array([0.1, -0.2, 0.3])
    body = Body("base", "", "fixed", -1, mass=5.0, com=vector(com), inertia=(2.0, 3.0, 4.0, 0.0, 0.0, 0.0))
    w, force = np.array([1.0, 2.0, -3.0]), np.array([4.0, 5.0, 6.0])
    found = solve(
        Tree.build([body], free=True), (), (), base_rate=vector(w), wrenches={"base": (vector(ZERO), vector(force))}
    )
    wd = np.linalg.solve(J, np.cross(-com, force) - np.cross(w, J @ w))
    a = force / 5.0 - np.cross(wd, com) - np.cross(w, np.cross(w, com))
    np.testing.assert_allclose(np.concatenate(found.base_acceleration), np.concatenate([wd, a]), rtol=1e-14)
    assert not found.base_singular


HINGED = Body(
    "arm",
    "hinge",
    "revolute",
    -1,
    at=(0.2, 0.1, 0.0),
    rpy=(0.3, 0.4, 0.5),
    mass=2.0,
    com=(0.5, 0.0, 0.0),
    inertia=(0.1, 0.2, 0.3, 0.0, 0.0, 0.0),
)


@pytest.mark.parametrize(
    ("base", "mode", "singular"),
    [
        (Body("base", "", "fixed", -1), True, True),
        (Body("base", "", "fixed", -1), False, False),
        (Body("base", "", "fixed", -1, mass=3.0), True, True),
        (Body("base", "", "fixed", -1, mass=3.0, com=(1.0, 2.0, 0.0)), True, False),
        (Body("base", "", "fixed", -1, mass=3.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)), True, False),
    ],
)
def test_a_base_without_inertia_about_the_joint_is_singular(base: Body, mode: bool, singular: bool) -> None:
    # Without matter it turns with the joint for nothing, and so it does with a point on the joint's axis.
    at = (0.0, 0.0, 0.0) if base.mass and base.com == (0.0, 0.0, 0.0) else HINGED.at
    tree = Tree.build([replace(HINGED, at=at), base], free=True)
    assert bool(solve(tree, (0.1,), (0.2,), mode=mode).base_singular) == singular


def test_a_free_base_is_given_no_acceleration_and_moves_with_all_velocity_products() -> None:
    tree = Tree.build([replace(HINGED)], free=True)
    for given in ({"velocity_products": False}, {"base_acceleration": ((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))}):
        with pytest.raises(ValueError, match="a free base is given no acceleration"):
            solve(tree, (0.0,), (1.0,), **given)


@pytest.mark.release
@pytest.mark.parametrize("seed", range(20))
def test_a_recorded_state_gives_the_plain_results_in_every_mode(seed: int) -> None:
    arm, base = floated(random_tree(seed)), flight(seed)
    tree, graph = Tree.build(arm.bodies, free=True), Graph()
    values: dict[str, float] = {}

    def recorded(name: str, numbers: tuple[float, ...]) -> tuple:
        values.update({f"{name}.{i}": x for i, x in enumerate(numbers)})
        return tuple(graph.input(f"{name}.{i}") for i in range(len(numbers)))

    def everything(arm: RandomArm, w: tuple, v: tuple, place: Pose, mode: object) -> list:
        ours = solve(
            tree,
            arm.q,
            arm.qd,
            tau=arm.tau,
            qdd=arm.qdd,
            mode=mode,
            rotor=arm.rotor,
            gravity=arm.gravity,
            wrenches=arm.wrenches,
            base_rate=w,
        )
        now = energy(tree, arm.q, arm.qd, rotor=arm.rotor, gravity=arm.gravity, base=place, base_velocity=(w, v))
        felt = [x for pair in effective_inertia(tree, ours) for x in pair]
        return [
            *ours.qdd,
            *ours.tau,
            *ours.base_acceleration[0],
            *ours.base_acceleration[1],
            *felt,
            now.kinetic,
            now.potential,
            *now.linear,
            *now.angular,
        ]

    state = replace(arm, **{name: recorded(name, getattr(arm, name)) for name in ("q", "qd", "tau", "qdd", "rotor")})
    w, v, place = recorded("w", vector(base.w)), recorded("v", vector(base.v)), pose(base)
    modes = [x > 0.5 for x in recorded("mode", tuple(map(float, arm.mode)))]
    outputs = Formulas.of(graph, everything(state, w, v, place, modes))
    for mode in (arm.mode, tuple(not m for m in arm.mode)):
        values.update({f"mode.{i}": float(m) for i, m in enumerate(mode)})
        plain = np.array(everything(arm, vector(base.w), vector(base.v), place, mode), float)
        ours = np.array(outputs.replay(values), float)
        # The record's sin and cos may differ from the C library's in the last place.
        assert np.all(np.abs(ours - plain) <= 1e-10 * (np.abs(plain) + np.median(np.abs(plain)))), f"seed {seed}"


@pytest.mark.slow
def test_a_base_whose_every_number_is_a_cases_moves_the_same() -> None:
    worst = Worst("free base of numpy's numbers")
    for arm, tree, base in fleet()[:20]:
        parts = ("at", "rpy", "axis", "com", "inertia")
        varied = [
            replace(
                body,
                mass=np.float64(body.mass),
                **{part: tuple(map(np.float64, getattr(body, part))) for part in parts},
            )
            for body in arm.bodies
        ]
        kept: dict[str, float] = {}

        def keep(name: str, value: float, kept: dict[str, float] = kept) -> float:
            kept[name] = value
            return value

        traced = Tree.build(varied, free=True)
        assert traced.map_numbers(keep) == traced
        assert any(name.startswith("tree.floating.") for name in kept)
        worst.see(
            relative(whole(passed(arm, traced, base, arm.mode)), whole(passed(arm, tree, base, arm.mode))),
            f"seed {arm.seed}",
        )
    worst.below(1e-10)  # other frames round otherwise
