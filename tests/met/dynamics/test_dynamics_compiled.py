"""The recursion as machine code: many states of one arm at once, every mode decided by the case, against Pinocchio."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from met.backends.llvm import kernel
from met.dynamics.effective_inertia import effective_inertia
from met.dynamics.recursion import reactions, solve
from met.dynamics.tree import Tree
from met.trace.program import Phase, Program, RunPhase, Tape
from tests.met.dynamics.passes import CLOSE, pinocchio
from tests.oracles import dense
from tests.oracles.random_tree import RandomArm, random_tree
from tests.oracles.worst import Worst, relative

pytestmark = pytest.mark.oracle

CASES = 24
VECTORS = ("q", "qd", "tau", "qdd", "mode", "rotor")


def program_of(arm: RandomArm) -> Program:
    """One pass, all that acts and moves taken from the case: qdd, tau, J_eff, b of every joint, then its reaction."""
    tree = Tree.build(arm.bodies)
    loads = [f"{name}.{part}{axis}" for name in arm.wrenches for part in "nf" for axis in range(3)]
    inputs = [f"{name}.{i}" for name in VECTORS for i in range(arm.n)] + [f"gravity.{i}" for i in range(3)] + loads

    def body(tape: Tape) -> None:
        def some(name: str, count: int) -> Any:
            return tuple(tape.input(f"{name}{i}") for i in range(count))

        q, qd, tau, qdd, mode, rotor = (some(f"{name}.", arm.n) for name in VECTORS)
        wrenches = {name: (some(f"{name}.n", 3), some(f"{name}.f", 3)) for name in arm.wrenches}
        ours = solve(
            tree,
            q,
            qd,
            tau=tau,
            qdd=qdd,
            mode=[m > 0.5 for m in mode],
            rotor=rotor,
            gravity=some("gravity.", 3),
            wrenches=wrenches,
        )
        felt = effective_inertia(tree, ours)
        results = [*ours.qdd, *ours.tau, *(J for J, _ in felt), *(b for _, b in felt)]
        for moment, force in reactions(tree, ours):
            results.extend((*moment, *force))
        for number, value in enumerate(results):
            tape.output(f"o{number}", value)

    outputs = tuple(f"o{number}" for number in range(10 * arm.n))
    return Program(1.0, (), (), (RunPhase(Phase("pass", body)),), tuple(inputs), 0, outputs)


def states_of(arm: RandomArm) -> list[RandomArm]:
    """The arm at several instants; all joints in torque mode, then all in acceleration mode, then any."""
    random = np.random.default_rng(arm.seed)

    def numbers(size: float, count: int = arm.n) -> tuple[float, ...]:
        return tuple(map(float, size * random.standard_normal(count)))

    result = []
    for case in range(CASES):
        share = (1.1, -0.1)[case] if case < 2 else random.random()
        result.append(
            replace(
                arm,
                q=numbers(2.0),
                qd=numbers(1.5),
                tau=numbers(10.0),
                qdd=numbers(3.0),
                gravity=numbers(6.0, 3),
                mode=tuple(bool(x) for x in random.random(arm.n) < share),
                rotor=tuple((10.0 ** random.uniform(-2, 2, arm.n) * (random.random(arm.n) < 0.5)).tolist()),
                wrenches={name: (numbers(2.0, 3), numbers(5.0, 3)) for name in arm.wrenches},
            )
        )
    return result


@pytest.mark.release
@pytest.mark.parametrize(
    "joints",
    [
        1,
        4,
        7,
        *(pytest.param(n, marks=pytest.mark.slow) for n in (2, 3, 5, 6, 9, 12, 15, 18, 21, 24, 27, 30)),
    ],
)
def test_machine_code_agrees_with_pinocchio_and_linear_algebra_in_every_mode(joints: int) -> None:
    arm = random_tree(2000 + joints, joints)
    states = states_of(arm)
    inputs = [
        [float(x) for name in VECTORS for x in getattr(s, name)]
        + [*s.gravity]
        + [x for wrench in s.wrenches.values() for part in wrench for x in part]
        for s in states
    ]
    _, found = kernel.compile(program_of(arm)).run(np.array(inputs), 0)
    forward, inverse, borne, felt, bias = (
        Worst(f"{joints} joints compiled: {what}") for what in ("qdd", "tau", "reactions", "J_eff", "b")
    )
    for case, (state, row) in enumerate(zip(states, found, strict=True)):
        qdd, tau, J, b = row[: 4 * joints].reshape(4, joints)
        theirs = pinocchio(state)
        where = f"case {case}"
        forward.see(relative(qdd, theirs.accelerations(state.q, state.qd, tau, state.wrenches)), where)
        inverse.see(relative(tau, theirs.torques(state.q, state.qd, qdd, state.wrenches)), where)
        expected = [np.concatenate(pair) for pair in theirs.reactions(state.q, state.qd, qdd, state.wrenches)]
        for i, reaction in enumerate(row[4 * joints :].reshape(joints, 6)):
            borne.see(relative(reaction, expected[i]), f"{where}, joint {i}")
        mode = np.array(state.mode)
        assert (tau[mode] == np.array(state.tau)[mode]).all() and (qdd[~mode] == np.array(state.qdd)[~mode]).all()
        whole = dense.DenseArm(state.bodies, state.gravity, state.rotor, state.wrenches)
        M, h, rotor = whole.mass_matrix(state.q), whole.bias(state.q, state.qd), np.array(state.rotor)
        pairs = dense.effective_inertia(M, h, np.array(state.tau), np.array(state.qdd), state.mode, rotor)
        for i, (J_dense, b_dense) in enumerate(pairs):
            felt.see(abs(J[i] - J_dense) / J_dense, f"{where}, joint {i}")
            size = abs(tau[i] - rotor[i] * qdd[i]) + abs(J[i] * qdd[i])
            bias.see(abs(b[i] - b_dense) / size, f"{where}, joint {i}")
    for worst in (forward, inverse, borne):
        worst.below(CLOSE)
    # As test_effective_inertia says: a difference in acceleration mode, which may lose six digits.
    felt.below(1e-9)
    bias.below(1e-9)
