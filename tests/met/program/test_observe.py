"""Derived channels against numpy and Pinocchio, through a deck and the kernel; when they are computed; what they leave
alone."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ic
from met import run as engine
from met.backends.reference.plain import execute
from met.plan import Experiment, Formula
from met.program import build
from met.program.build import METRIC
from met.trace.recorder import record
from tests.oracles import dense, plan_tree
from tests.oracles.random_deck import random_deck

# Sines of the kernel and of the C library differ in the last place, and five joints lose some digits: measured worst
# 1.4e-14 of the largest number of a signal, over forty random decks.
CLOSE = 1e-12

DECK = """
let reach = 0.8 m;
arm picker {
    link foot     { mass = 3 kg;    shape = box(size = [0.3, 0.3, 0.1] m); }
    link carriage { mass = 12 kg;   shape = box(size = [0.3, 0.3, 0.2] m, along = z); }
    link boom     { mass = 5 kg;    shape = cylinder(radius = 40 mm, length = reach, along = x); }
    link tip      { mass = 0.5 kg;  shape = sphere(radius = 40 mm);  com = [0.01, 0.02, 0.03] m; }
    link lamp     { mass = 1.5 kg;  shape = sphere(radius = 60 mm);  com = [0.1, 0, 0] m; }
    joint stand fixed     { parent = base;      child = foot;      at = [0.1, 0.2, 0.3] m;  rpy = [0, 10, 90] deg; }
    joint lift  prismatic { parent = foot;      child = carriage;  axis = z; }
    joint swing revolute  { parent = carriage;  child = boom;      axis = -y;  at = [0.15, 0, 0.1] m; }
    joint end   fixed     { parent = boom;      child = tip;  at = [reach, 0 m, 0 m];  rpy = [0, 90, 0] deg; }
    joint pan   revolute  { parent = carriage;  child = lamp;      axis = z;   at = [0, 0, 0.2] m; }
}
servo motor {
    model = rigid_gearbox;
    kp = 0.05 V*s/rad;  ki = 1 V/rad;  v_max = 48 V;  resistance = 0.5 ohm;  kt = 0.1 N*m/A;  tau_max = 1.2 N*m;
    j_m = 6e-5 kg*m^2;  f_c = 0.01 N*m;
}
servo spindle like motor {
    ratio = 0.1 cycle/mm;  k_position = 15 1/s;
    command = position(sine(amplitude = 100 mm, frequency = 0.5 Hz));
}
servo turner like motor { ratio = 100;  command = rate(step(to = 30 deg/s, at = 0.5 s)); }
default run pick {
    arm         = picker;
    servos      { lift = spindle;  swing = turner; }
    initial     { swing.q = -20 deg;  pan.qd = 1 rad/s; }
    environment { gravity = [0.5, 0, -9.81] m/s^2; }
    rates       { dynamics = 1 kHz;  servos = 500 Hz;  record = 50 Hz; }
    duration    = 0.8 s;
    record      = [q, qd, qdd, tau];
    metric furthest = max { of = swing.q; }
}
sweep masses of pick { vary links.boom.mass = [5, 7] kg;  vary links.boom.com.x = [0.4, 0.45] m; }
"""

JOINTS = ("tau_load", "J_eff", "b", "mode", "reaction")


def experiment(text: str, select: str | None = None) -> Experiment:
    return ic.compile(text=text, select=[select] if select else None).experiments[0]


def recording(text: str, *names: str) -> str:
    """The deck with these recorded besides."""
    made, count = re.subn(r"(record\s*= \[[^]]*)\]", rf"\1, {', '.join(names)}]", text, count=1)
    assert count == 1
    return made


def of_links(text: str) -> list[str]:
    """All that is to be had of every link that moves."""
    carried = re.findall(r"joint \w+ +(?:revolute|prismatic) .*?child = (\w+)", text) + re.findall("tip", text)[:1]
    kinds = ("position", "orientation", "velocity", "rate", "jacobian")
    return [f"links.{link}.{kind}" for link in carried for kind in kinds]


class Arm:
    """One case of an experiment as the oracles need it."""

    def __init__(self, experiment: Experiment, case: int = 0) -> None:
        values = experiment.formulas.replay({c.path: float(c.values[case]) for c in experiment.cases.coordinates})
        parameters = {
            path: replace(quantity, value=float(values[quantity.value.output]))
            if isinstance(quantity.value, Formula)
            else quantity
            for path, quantity in experiment.parameters.items()
        }

        def number(path: str) -> float:
            return float(parameters[path].value) if path in parameters else 0.0

        alone = replace(experiment, parameters=parameters)
        names = [joint.name for joint in experiment.structure.moving]
        self.names = names
        self.rotor = np.array(
            [number(f"{j}.servo.ratio") ** 2 * number(f"{j}.servo.j_m") + number(f"{j}.servo.rotor") for j in names]
        )
        self.rubs = [number(f"{j}.servo.f_c") > 0.0 for j in names]
        self.gravity = [number(f"environment.gravity.g.{axis}") for axis in "xyz"]
        self.products = experiment.structure.velocity_products
        self.bodies = plan_tree.bodies(alone)
        self.dense = dense.DenseArm(self.bodies, self.gravity)
        self.theirs = plan_tree.pinocchio(alone, gravity=self.gravity, rotor=self.rotor)

    def expected(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, given: Sequence[str]) -> dict[str, np.ndarray]:
        """Every derived channel at one instant, by the variable's name. given: joints whose acceleration is told."""
        felt = qd if self.products else 0.0 * qd
        sticks = [rubs and rate == 0.0 and a == 0.0 for rubs, rate, a in zip(self.rubs, qd, qdd, strict=True)]
        mode = [not held and name not in given for held, name in zip(sticks, self.names, strict=True)]
        tau_load = self.dense.torques(q, felt, qdd)
        tau = tau_load + self.rotor * qdd
        M, h = self.dense.mass_matrix(q) + np.diag(self.rotor), self.dense.bias(q, felt)
        pairs = dense.effective_inertia(M, h, tau, qdd, mode, self.rotor)
        reactions = self.theirs.reactions(q, felt, qdd, {})
        found = {
            "tau_load": tau_load,
            "J_eff": np.array([J for J, _ in pairs]),
            "b": np.array([b for _, b in pairs]),
            "mode": np.array(mode, float),
            "reaction.moment": np.array([moment for moment, _ in reactions]),
            "reaction.force": np.array([force for _, force in reactions]),
            "energy.kinetic": 0.5 * np.sum(self.rotor * qd**2),
            "energy.potential": 0.0,
            "momentum.linear": np.zeros(3),
            "momentum.angular": np.zeros(3),
        }
        for body, link in zip(self.bodies, self.dense.links(q, qd, qdd), strict=True):
            head = f"links.{body.name}"
            carrying = np.flatnonzero(np.any(link.Jw != 0.0, axis=0) | np.any(link.Jv != 0.0, axis=0))
            found |= {
                f"{head}.position": link.p,
                f"{head}.velocity": link.v,
                f"{head}.rate": link.w,
                f"{head}.orientation": link.R,
                f"{head}.jacobian.angular": link.Jw[:, carrying].T,
                f"{head}.jacobian.linear": link.Jv[:, carrying].T,
            }
            if not len(carrying):
                continue  # fixed to the base
            c, J, _ = self.dense._matter(body, link)
            v = link.v + np.cross(link.w, c)
            found["energy.kinetic"] += 0.5 * (body.mass * v @ v + link.w @ J @ link.w)
            found["energy.potential"] -= body.mass * np.dot(self.gravity, link.p + c)
            found["momentum.linear"] += body.mass * v
            found["momentum.angular"] += body.mass * np.cross(link.p + c, v) + J @ link.w
        return found


def compare(
    experiment: Experiment, names: Sequence[str], given: Callable[[float], Sequence[str]] = lambda time: ()
) -> engine.Run:
    """Every row of every case has what the oracles say of its q, qd and qdd."""
    run = engine.run(experiment)
    assert (run.status == engine.DONE).all(), run.cause
    recorded = [each.name for each in experiment.structure.record]
    assert all(any(each.startswith(name) for each in recorded) for name in names)
    for case in range(len(run.case)):
        arm = Arm(experiment, case)
        rows = zip(*(run.signals[name][case] for name in ("q", "qd", "qdd")), run.time, strict=True)
        wanted = [arm.expected(q, qd, qdd, given(time)) for q, qd, qdd, time in rows]
        for name in recorded[4:]:
            ours, theirs = run.signals[name][case], np.array([each[name] for each in wanted])
            if name.endswith("orientation"):
                assert np.abs((ours**2).sum(axis=1) - 1.0).max() < CLOSE and (ours[:, 0] >= 0.0).all()
                ours = Rotation.from_quat(ours, scalar_first=True).as_matrix()
            size = max(np.abs(theirs).max(), np.abs(run.signals["q"][case]).max(), 1.0)
            assert ours.shape == theirs.shape, name
            assert np.abs(ours - theirs).max() <= CLOSE * size, (name, case)
    return run


@pytest.mark.oracle
def test_an_arm_with_a_stuck_joint_a_slide_a_branch_and_fixed_links() -> None:
    names = [*JOINTS, "energy", "momentum", *of_links(DECK)]
    run = compare(experiment(recording(DECK, *names), "masses"), names)
    assert set(run.signals["mode"][0, :, 1]) == {0.0, 1.0}, "the swing is to stick first, and then to move"
    assert (run.signals["mode"][0, :, 2] == 1.0).all(), "nothing drives the lamp: its torque is given, and 0"


TOLD = """
servo follow { model = ideal;   rotor = 0.4 kg*m^2;  command = acceleration(sine(amplitude = 3 rad/s^2, frequency = 2 Hz)); }
servo hold   { model = locked;  release = 0.4 s; }
"""  # noqa: E501 - a deck is as wide as it is


@pytest.mark.oracle
def test_joints_that_are_told_their_acceleration() -> None:
    text = DECK.replace("swing = turner;", "swing = follow;  pan = hold;").replace("  pan.qd = 1 rad/s;", "")
    names = [*JOINTS, "energy", "momentum", "links.lamp.position"]

    def given(time: float) -> Sequence[str]:
        return ("swing", "pan") if time < 0.4 else ("swing",)

    run = compare(experiment(TOLD + recording(text, *names)), names, given)
    assert run.signals["mode"][0, [0, -1]].tolist() == [[1.0, 0.0, 0.0], [1.0, 0.0, 1.0]]


@pytest.mark.release
@pytest.mark.oracle
@pytest.mark.parametrize("seed", range(8))
def test_random_decks(seed: int) -> None:
    text = random_deck(seed)
    names = [*JOINTS, "energy", "momentum", *of_links(text)]
    compare(experiment(recording(text, *names)), names)


@pytest.mark.release
@pytest.mark.parametrize("seed", range(8, 12))
def test_kernel_and_plain_floats_agree(seed: int) -> None:
    text = random_deck(seed)
    made = experiment(recording(text, *JOINTS, "energy", "momentum", *of_links(text)))
    run = engine.run(made)
    rows, _ = execute(build(made), {}, made.structure.schedule.ticks)
    kernel = np.concatenate([values[0].reshape(len(rows), -1) for values in run.signals.values()], axis=1)
    # along 400 steps of a driven arm rounding grows as in test_programs; a quaternion's sign is open where w is 0
    assert np.abs(kernel - rows).max() / np.abs(rows).max() < 1e-10, seed


@pytest.mark.slow
def test_a_link_fixed_to_the_base_stands_still() -> None:
    text = recording(DECK, "links.foot.position", "links.foot.velocity", "links.foot.orientation", "links.foot.rate")
    run = engine.run(experiment(text))
    assert np.abs(run.signals["links.foot.position"] - [0.1, 0.2, 0.3]).max() < 1e-15  # its frame was turned and back
    assert not run.signals["links.foot.velocity"].any() and not run.signals["links.foot.rate"].any()
    theirs = Rotation.from_euler("xyz", [0.0, 10.0, 90.0], degrees=True).as_quat(scalar_first=True)
    assert np.abs(run.signals["links.foot.orientation"] - theirs).max() < 1e-15  # of numbers up to 1


TWO_RODS = """
#include <two_link.ic>
servo later like gearbox { command = rate(step(to = slow, at = 0.5 s)); }
run hold like nominal {
    servos { elbow = later; }
    rates  { dynamics = 100 Hz;  servos = 100 Hz;  record = 100 Hz; }
    initial { elbow.q = 60 deg; }
    duration = 1 s;
    record = [q, qdd, J_eff, mode];
}
"""


@pytest.mark.slow
def test_two_rods_by_their_closed_form() -> None:
    run = engine.run(experiment(TWO_RODS, "hold"))
    m, n, length, r = 40.0, 20.0, 2.0, 1570.0**2 * 6.38e-5
    c = np.cos(run.signals["q"][0, :, 1])
    M11 = length**2 * (m / 3.0 + n * (4.0 / 3.0 + c))
    M12 = length**2 * n * (1.0 / 3.0 + c / 2.0)
    M22 = length**2 * n / 3.0
    stuck = run.signals["mode"][0, :, :] == 0.0
    assert stuck[:, 1].any() and not stuck[:, 1].all(), "the elbow is to stick, and to be let go"
    shoulder = np.where(stuck[:, 1], M11, M11 - M12**2 / (M22 + r))
    elbow = np.where(stuck[:, 0], M22, M22 - M12**2 / (M11 + r))
    # the numbers are up to 200, and M11 - M12^2/(M22 + r) takes no digits away
    assert np.abs(run.signals["J_eff"][0, :, 0] - shoulder).max() < 1e-12 * 200.0
    assert np.abs(run.signals["J_eff"][0, :, 1] - elbow).max() < 1e-12 * 200.0


METRICS = """
    metric top    = max { of = links.tip.position.z; }
    metric work   = max { of = energy.kinetic; }
    metric felt   = min { of = swing.J_eff; }
    metric lever  = final { of = links.tip.jacobian.linear.swing.z; }
"""


@pytest.mark.slow
def test_a_metric_of_a_derived_channel_sees_every_instant() -> None:
    watched = DECK.replace("    metric furthest", METRICS + "    metric furthest")
    every = watched.replace("record = 50 Hz", "record = 1 kHz")
    names = ("links.tip.position.z", "energy.kinetic", "swing.J_eff", "links.tip.jacobian.linear.swing.z")
    slow, fast = (engine.run(experiment(text)) for text in (watched, recording(every, *names)))
    z, kinetic, J, lever = (fast.signals[name][0] for name in names)
    wanted = {"top": z.max(), "work": kinetic.max(), "felt": J.min(), "lever": lever[-1]}
    assert {name: slow.metrics[name][0] for name in wanted} == wanted
    assert {name: fast.metrics[name][0] for name in wanted} == wanted


@pytest.mark.slow
def test_a_slow_record_has_the_rows_of_a_fast_one() -> None:
    names = (*JOINTS, "energy", "links.tip.orientation")
    slow, fast = (
        engine.run(experiment(recording(DECK.replace("record = 50 Hz", f"record = {rate}"), *names)))
        for rate in ("50 Hz", "1 kHz")
    )
    for name, values in slow.signals.items():
        assert values.tobytes() == fast.signals[name][:, ::20].tobytes(), name


@pytest.mark.slow
def test_a_row_between_instants_shows_the_last_one() -> None:
    rates = "dynamics = 250 Hz;  servos = 500 Hz;  record = 1 kHz;"
    text = recording(re.sub(r"dynamics = 1 kHz;.*?record = 50 Hz;", rates, DECK), "J_eff", "links.tip.position")
    run = engine.run(experiment(text))
    for name in ("J_eff", "links.tip.position"):
        values = run.signals[name][0]
        assert (values[:-1].reshape(-1, 4, 3) == values[:-1:4, None]).all(), name
        assert len(np.unique(values[::4], axis=0)) > 100, name


@pytest.mark.slow
def test_what_is_asked_for_changes_no_bit_of_the_rest() -> None:
    names = [*JOINTS, "energy", "momentum", *of_links(DECK)]
    plain = engine.run(experiment(DECK, "masses"))
    watched = DECK.replace("    metric furthest", METRICS + "    metric furthest")
    full = engine.run(experiment(recording(watched, *names), "masses"))
    for name, values in plain.signals.items():
        assert values.tobytes() == full.signals[name].tobytes(), name
    assert plain.metrics["furthest"].tobytes() == full.metrics["furthest"].tobytes()


def test_nothing_is_computed_that_nobody_asks_for() -> None:
    def operations(text: str) -> dict[str, int]:
        made = record(build(experiment(text)))
        work = {section.name: [section.nodes[i][0] for i in section.order] for section in made.sections}
        return {name: sum(op not in ("cell", "const") for op in ops) for name, ops in work.items()}

    plain, one, all_ = (
        operations(DECK),
        operations(recording(DECK, "links.lamp.rate.z")),
        operations(recording(DECK, *JOINTS)),
    )
    assert plain["record"] == 0 and "observe" not in plain
    assert 0 < one["record"] < 20 < all_["record"], (one, all_)
    rest = {name: count for name, count in plain.items() if name != "record"}
    assert rest == {name: count for name, count in all_.items() if name != "record"}


def test_a_case_that_fails_has_not_a_number_and_no_error() -> None:
    text = """
    arm thin {
        link rod { mass = 1 kg;  shape = rod(length = 1 m, along = x); }
        joint spin revolute { parent = base;  child = rod;  axis = x; }
    }
    run it {
        arm = thin;  rates { dynamics = 100 Hz; }  duration = 0.1 s;
        environment { gravity = [0, 0, -9.81] m/s^2; }
        record = [q, J_eff, b, tau_load, mode, reaction, energy, momentum, links.rod.orientation];
        metric most = max { of = spin.b; }
    }
    """
    made = experiment(text)
    run = engine.run(made)
    assert run.status[0] == engine.FAILED and "D is not above 0" in run.cause[0]
    assert all(np.isnan(values).all() for values in run.signals.values())
    assert np.isnan(run.metrics["most"][0])
    _, out = execute(build(made), {}, made.structure.schedule.ticks)
    assert METRIC + "most" in out
