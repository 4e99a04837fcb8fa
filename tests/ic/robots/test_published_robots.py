"""Robots that others publish: every file of two packages is an arm as Pinocchio reads it, or is refused in words.

`python -m tests.ic.robots.test_published_robots` prints the table of docs/robots.md.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import robots

import ic
from ic.driver.import_robot import import_robot
from ic.robots.robot import MOVING
from met import run
from met.diagnostic import Problem
from tests.oracles.urdf_plan import body, made_from, see
from tests.oracles.worst import Worst

PAGE = Path(__file__).parents[3] / "docs" / "robots.md"
CLOSE = 1e-11  # as of random robots: rounding, times the condition number of the mass matrix
LONE = "random_urdfs"  # a thousand single bodies

# Arms, hands and other things on a base that stands still; the rest walks, rolls, flies or has no joints.
ARMS = (
    "TwoDofs", "double_pendulum", "double_pendulum_continuous", "double_pendulum_simple", "finger_edu", "kinova",
    "panda", "panda_collision", "so100", "so101", "talos_left_arm", "ur3", "ur3_robot", "ur3_joint_limited_robot",
    "ur3_gripper", "ur5_robot", "ur5_joint_limited_robot", "ur5_gripper", "ur10_robot", "ur10_joint_limited_robot",
    "xarm7", "z1", "baxter", "allegro_left_hand", "allegro_right_hand", "TwoJointRobot_w_fixedJoints",
    "TwoJointRobot_wo_fixedJoints", "cartpole", "model", "model_for_sdf", "model_free_base", "model_vr_limits",
    "pendulum5", "pr2_gripper", "spherical_joint_limit", "xarm6_robot", "xarm6_robot_white", "xarm6_with_gripper",
)  # fmt: skip


def files() -> list[Path]:
    return sorted(path for path in robots.folder().rglob("*.urdf") if LONE not in path.parts)


def shown(path: Path) -> str:
    """`ur_description/ur5_robot.urdf`: the package's own folder of a robot and the file."""
    within = path.relative_to(robots.folder()).parts
    return f"{within[within.index('robots') + 1] if 'robots' in within else within[-2]}/{within[-1]}"


def refusal(path: Path) -> str:
    """Why the file is refused, joints that follow others let go; "" where it is not."""
    try:
        import_robot(str(path), "free")
    except Problem as problem:
        first = problem.diagnostics[0]
        message = first.message.replace(str(path), path.name)
        cause = f"; {first.at.text.rpartition('; ')[2]}" if first.at is not None and first.at.text else ""
        more = f" ({len(problem.diagnostics) - 1} more)" if len(problem.diagnostics) > 1 else ""
        return f"{first.code}: {message}{cause}{more}"
    return ""


def rows() -> Iterator[str]:
    """The rows of the page's table."""
    for path in files():
        if path.stem not in ARMS:
            continue
        why = refusal(path)
        try:
            joints = body(path).robot.joints
            moving = str(sum(joint.type.text in MOVING for joint in joints))
            mimics = sum(joint.mimic is not None for joint in joints)
        except Problem:
            moving, mimics = "", 0
        if mimics and not why:
            why = f"{mimics} {'follows another joint' if mimics == 1 else 'follow other joints'}"
            yield f"| `{shown(path)}` | {moving} | yes | {why} |"
        else:
            yield f"| `{shown(path)}` | {moving} | {'no' if why else 'yes'} | {why} |"


@pytest.mark.release
def test_every_published_robot_that_is_taken_moves_as_pinocchio_reads_it(tmp_path: Path) -> None:
    poses, torques, accelerations = Worst("poses"), Worst("tau against rnea"), Worst("qdd against aba")
    taken = 0
    for path in files():
        if refusal(path) or not any(joint.type.text in MOVING for joint in body(path).robot.joints):
            continue
        see(made_from(path, tmp_path), path, shown(path), poses, torques, accelerations)
        taken += 1
    poses.below(1e-13)  # some hundred roundings of a metre
    torques.below(CLOSE)
    accelerations.below(CLOSE)
    assert taken == int(re.findall(r"(\d+) robots in all", PAGE.read_text(encoding="utf-8"))[0])


@pytest.mark.release
def test_the_pages_table_is_what_becomes_of_the_files() -> None:
    table = re.findall(r"^\| `\S+\.urdf` \|.*$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert table == list(rows())


FAST = ("xarm7", "z1")
"""Robots with a joint whose damping is too fast for the step of the deck that is made, 1 kHz. These runs do not show
it, for its dry friction holds that joint: to 1e-6 rad they are those of 50 kHz."""


ODD = {"cartpole": ["D297"], "baxter": ["D298"]}
"""Robots with a body that cannot be: a pole of 0.1 kg and 1 kg m^2, a base of a gripper of 300 g and 3e-8 kg m^2."""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["panda", "ur5_robot", "kinova", "xarm7", "so100", "z1", "baxter", "cartpole"])
def test_the_deck_of_a_published_robot_holds_its_arm_and_lets_it_fall(name: str) -> None:
    path = next(path for path in files() if path.stem == name)
    compiled = ic.check(text=import_robot(str(path), "free"))
    assert compiled.plan is not None
    odd = ODD.get(name, [])
    assert [each.code for each in compiled.diagnostics] == odd + ["D317"] * (name in FAST)
    for experiment in compiled.plan.experiments:
        assert (run.run(experiment).status == 0).all(), experiment.name


if __name__ == "__main__":
    print("\n".join(rows()))
