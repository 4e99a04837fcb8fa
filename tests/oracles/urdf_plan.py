"""An arm that a deck makes from a URDF file, beside Pinocchio's reading of the same file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import ic
from ic.robots.entries import ArmEntries
from ic.robots.files import load
from met.dynamics.kinematics import link_motions
from met.dynamics.recursion import solve
from met.messages.render import render
from met.plan import Experiment
from met.program.system import System
from tests.oracles.urdf_pinocchio import UrdfPinocchio
from tests.oracles.worst import Worst, relative

GRAVITY = (0.0, 0.0, -9.81)
STATES = 3

RUN = """
run fall {{
    arm = {arm};  environment {{ gravity = [0, 0, -9.81] m/s^2; }}
    rates {{ dynamics = 1 kHz; }}  duration = 1 ms;  record = [];
}}
"""


def body(path: Path) -> ArmEntries:
    return load(str(path), path.read_text(encoding="utf-8"))


def made_from(path: Path, folder: Path) -> Experiment:
    """A run of the arm that is made from the file, its joints that follow others let go."""
    read = body(path)
    free = "".join(f"{read.names.joints[joint.name.text]} {{ remove follows; }} "
                   for joint in read.robot.joints if joint.mimic is not None)  # fmt: skip
    deck = folder / "made_from.ic"
    deck.write_text(f'arm it from urdf("{path}") {{ {free}}}\n' + RUN.format(arm="it"), encoding="utf-8")
    compiled = ic.check(deck)
    assert compiled.plan is not None, render(compiled.diagnostics, compiled.sources)
    return compiled.plan.experiments[0]


def see(experiment: Experiment, path: Path, where: str, poses: Worst, torques: Worst, accelerations: Worst) -> None:
    """Compares at random states, each figure as a share of the largest number of its kind; positions of a metre."""
    names, theirs = body(path).names, UrdfPinocchio(path)
    tree = System(experiment).tree(lambda _: 0.0)
    moving = [joint.name for joint in experiment.structure.moving]
    file_name = {name: written for written, name in names.joints.items()}
    assert sorted(file_name[name] for name in moving) == sorted(theirs.joints), where
    rng = np.random.default_rng(len(moving))
    for _ in range(STATES):
        q, qd, qdd = (dict(zip(moving, rng.uniform(-2.0, 2.0, len(moving)).tolist(), strict=True)) for _ in range(3))
        by_file = [{file_name[name]: value for name, value in given.items()} for given in (q, qd, qdd)]
        found = theirs.poses(by_file[0])
        for name, motion in link_motions(tree, tuple(q.values()), tuple(qd.values())).items():
            written = next(each for each, deck in names.links.items() if deck == name)
            R, p = found[written]
            poses.see(np.max(np.abs(np.array(motion.pose.R, float) - R)), f"{where}, {written}")
            poses.see(np.max(np.abs(np.array(motion.pose.p, float) - p)), f"{where}, {written}")
        state = (tree, tuple(q.values()), tuple(qd.values()))
        none = (0.0,) * len(moving)
        given, solved = (False,) * len(moving), (True,) * len(moving)
        ours = solve(*state, tau=none, qdd=tuple(qdd.values()), mode=given, rotor=none, gravity=GRAVITY)
        tau = theirs.torques(*by_file)
        wanted = [tau[file_name[name]] for name in moving]
        torques.see(relative(ours.tau, wanted), where)
        ours = solve(*state, tau=tuple(wanted), qdd=none, mode=solved, rotor=none, gravity=GRAVITY)
        back = theirs.accelerations(by_file[0], by_file[1], tau)
        accelerations.see(relative(ours.qdd, [back[file_name[name]] for name in moving]), where)
