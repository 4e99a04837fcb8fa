"""The Panda that users copy from is the published Panda, moves as Pinocchio's does, and meets its own requirements."""

from __future__ import annotations

import re

import numpy as np
import pytest

import ic
from met import run as engine
from met.plan import Experiment
from tests.oracles.package import Package
from tests.oracles.panda_pinocchio import FRANKA_GRAVITY_READY, READY, follow, panda

pin = Package("pinocchio")

DEG = np.pi / 180.0
JOINTS = tuple(f"joint{i}" for i in range(1, 8))
ROTORS = np.array([0.605721456] * 2 + [0.462474144] * 2 + [0.205544064] * 3)

BARE = """
#include <panda.ic>
arm bare like panda { remove flange; remove load; }
"""


def experiment(text: str, name: str) -> Experiment:
    return ic.compile(text=text, select=[name]).experiments[0]


def pose(values: np.ndarray) -> str:
    return "".join(f"{joint}.q = {value!r} rad; " for joint, value in zip(JOINTS, values.tolist(), strict=True))


def zipped(what: str, values: np.ndarray, unit: str) -> str:
    return "".join(f"initial.{j}.{what} = {v} {unit}; " for j, v in zip(JOINTS, values.T.tolist(), strict=True))


@pytest.mark.oracle
def test_accelerations_are_those_of_pinocchio_built_from_the_published_tables():
    seed = 20190401
    random = np.random.default_rng(seed)
    q, qd = random.uniform(-2.5, 2.5, (8, 7)), random.uniform(-2.0, 2.0, (8, 7))
    deck = (
        BARE
        + f"""
        run fall {{
            arm = bare;  environment {{ gravity = [0, 0, -9.81] m/s^2; }}
            rates {{ dynamics = 1 kHz; }}  duration = 1 ms;  record = [qdd];
        }}
        sweep poses of fall {{ zip {{ {zipped("q", q, "rad")} {zipped("qd", qd, "rad/s")} }} }}
    """
    )
    found = engine.run(experiment(deck, "poses")).signals["qdd"][:, 0]
    model = panda()
    data = model.createData()
    expected = np.array([pin.aba(model, data, q[k], qd[k], np.zeros(7)) for k in range(len(q))])
    # rounding, times the condition number of the mass matrix (some 1e4 without rotors)
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-9 * np.abs(expected).max(), err_msg=f"{seed=}")


@pytest.mark.oracle
def test_holding_the_ready_pose_takes_the_gravity_torques_of_pinocchio_and_of_frankas_own_model():
    servos = "".join(
        f"{j} = panda_{j} {{ f_c = 0 N*m;  command = position({v!r} rad); }}"
        for j, v in zip(JOINTS, READY.tolist(), strict=True)
    )
    deck = (
        BARE
        + f"""
        run hold {{
            arm = bare;  servos {{ {servos} }}  initial {{ {pose(READY)} }}
            environment {{ gravity = [0, 0, -9.81] m/s^2; }}
            rates {{ dynamics = 1 kHz; servos = 1 kHz; record = 1 Hz; }}  duration = 10 s;  record = [q, tau];
        }}
    """
    )
    signals = engine.run(experiment(deck, "hold")).signals
    q, tau = signals["q"][0, -1], signals["tau"][0, -1]
    np.testing.assert_allclose(q, READY, atol=1e-9)  # settled: the slowest mode is 10 /s or so
    model = panda()
    np.testing.assert_allclose(tau, pin.computeGeneralizedGravity(model, model.createData(), q), atol=1e-7)
    # Two models of one arm, identified by different hands: they differ by at most 0.082 N m here.
    np.testing.assert_allclose(tau, FRANKA_GRAVITY_READY, atol=0.1)


@pytest.mark.oracle
def test_the_reach_without_friction_is_that_of_pinocchio_under_the_same_servos():
    away = np.array([45.0, 15.0, -20.0, -90.0, 25.0, 110.0, 10.0]) * DEG

    def course(t: float) -> tuple[np.ndarray, np.ndarray]:
        share = min(max((t - 0.5) / 3.0, 0.0), 1.0)
        return READY + (away - READY) * share, (away - READY) / 3.0 * (0.5 <= t < 3.5)

    smooth = "".join(f"{joint} {{ f_c = 0 N*m; }} " for joint in JOINTS)
    deck = f"#include <panda.ic>\nrun smooth like reach {{ servos {{ {smooth} }}  rates {{ record = 1 kHz; }} }}"
    signals = engine.run(experiment(deck, "smooth")).signals
    q, tau = follow(
        panda(load=0.5, load_radius=0.04, rotors=ROTORS), READY, course,
        ratio=100.0, kt=np.array([0.1] * 4 + [0.06] * 3), resistance=np.array([0.5] * 2 + [0.6] * 5),
        tau_max=np.array([0.87] * 4 + [0.12] * 3), kp=np.array([0.05] * 4 + [0.02] * 3),
        ki=np.array([2.0] * 4 + [1.0] * 3), k_position=15.0, hz=1000.0, steps=5000,
    )  # fmt: skip
    # the same arithmetic in another order, over 5000 steps of a stable loop; at each of them
    np.testing.assert_allclose(signals["q"][0], q, rtol=0.0, atol=1e-13)  # 5e-15 found
    np.testing.assert_allclose(signals["tau"][0], tau, rtol=0.0, atol=1e-10)  # 3e-12 N m found, of 70


@pytest.mark.slow
def test_the_decks_runs_meet_their_requirements_and_its_steps_are_short_enough():
    plan = ic.compile("panda.ic", select=["reach", "swing"])
    for one in plan.experiments:
        result = engine.run(one)
        assert result.met and all(bool(met[0]) for met in result.met.values()), (one.name, result.metrics)
        (figure,) = [float(x) for note in one.notes for x in re.findall(r"h \* lambda = ([0-9.]+)", note)]
        assert figure <= 0.5  # of the fastest mode


@pytest.mark.slow
def test_the_payload_sweep_shows_what_a_weak_and_a_strong_gain_cost():
    (payload,) = ic.compile("panda.ic", select=["payload"]).experiments
    result = engine.run(payload, record=False)
    load, kp = result.coordinates["links.load.mass"], result.coordinates["panda_large.kp"]
    past, effort = result.metrics["past"], result.metrics["effort"]
    assert len(load) == 12
    for mass in np.unique(load):
        order = np.argsort(kp[load == mass])
        assert np.all(np.diff(past[load == mass][order]) < 0.0)  # a stronger gain overshoots less
        assert np.all(np.diff(effort[load == mass][order]) < 0.0)  # and asks for more torque
    for gain in np.unique(kp)[:2]:  # at the largest gain the motor is at its limit whatever the load
        order = np.argsort(load[kp == gain])
        assert np.all(np.diff(effort[kp == gain][order]) < 0.0)
