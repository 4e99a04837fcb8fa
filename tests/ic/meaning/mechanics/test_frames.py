"""Links of `mass = 0 kg`: frames that need no inertia, where nothing that moves is left without mass; and points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run
from tests.ic.small_decks import changed, check, codes, experiment, messages
from tests.oracles.plan_tree import pinocchio

YOKE = """\
arm wrist {
    link yoke { mass = 0 kg; }
    link bar  { mass = 2 kg; com = [0.1, 0.2, 0.3] m; inertia = [0.2, 0.3, 0.4] kg*m^2; }
    link tool { mass = 0 kg; }
    link tip  { mass = 0.1 kg; inertia = [0, 0, 0] kg*m^2; }
    joint roll  revolute { parent = base; child = yoke; axis = x; }
    joint pitch revolute { parent = yoke; child = bar;  axis = y; }
    joint mount fixed    { parent = bar;  child = tool; at = [0.5, 0, 0] m; }
    joint grip  fixed    { parent = tool; child = tip;  at = [0, 0, 0.1] m; }
}
"""
FALL = """\
run fall {
    arm = wrist;  initial { q = [0.3, -0.4] rad;  qd = [1, 2] rad/s; }
    environment { gravity = [0, 0, -9.81] m/s^2; }
    rates { dynamics = 1 kHz; }  duration = 1 ms;  record = [qdd];
}
"""


@pytest.mark.oracle
def test_a_yoke_without_mass_and_a_point_move_as_in_pinocchio(tmp_path: Path) -> None:
    found = experiment(tmp_path, YOKE, FALL)
    assert [found.parameters[f"links.yoke.inertia.{each}"].value for each in ("xx", "yy", "zz", "xy", "xz", "yz")] == [
        0.0
    ] * 6
    ours = run.run(found).signals["qdd"][0, 0]
    theirs = pinocchio(found, gravity=(0.0, 0.0, -9.81)).accelerations((0.3, -0.4), (1.0, 2.0), (0.0, 0.0), {})
    np.testing.assert_allclose(ours, theirs, rtol=1e-12)  # rounding


@pytest.mark.parametrize(
    ("piece", "code"),
    [
        ("mass = 0 kg; inertia = [1, 1, 1] kg*m^2;", "D087"),
        ("mass = 0 kg; inertia = [1, 1, 1, 0, 0, 0.1] kg*m^2;", "D087"),
        ("mass = 1 kg; inertia = [0, 1, 2] kg*m^2;", "D087"),
        ("mass = 1 kg;", "D089"),
    ],
)
def test_only_what_has_no_mass_needs_no_inertia_and_has_none(tmp_path: Path, piece: str, code: str) -> None:
    assert codes(tmp_path, changed(YOKE, ("link tool { mass = 0 kg; }", f"link tool {{ {piece} }}")), FALL) == [code]


def test_a_joint_that_moves_nothing_with_mass_is_told_and_not_those_behind_it(tmp_path: Path) -> None:
    arm = changed(
        YOKE,
        ("mass = 2 kg; com = [0.1, 0.2, 0.3] m; inertia = [0.2, 0.3, 0.4] kg*m^2;", "mass = 0 kg;"),
        ("mass = 0.1 kg; inertia = [0, 0, 0] kg*m^2;", "mass = 0 kg;"),
    )
    assert (
        messages(check(tmp_path, arm, FALL))
        == """\
error[D217]: joint `roll` moves nothing that has mass
 --> deck.ic:6:5
  |
6 |     joint roll  revolute { parent = base; child = yoke; axis = x; }
  |     ^^^^^^^^^^^^^^^^^^^^
  = help: write the mass of link `yoke`, or of one that it carries
  = help: or make the joint fixed

1 error
"""
    )


def test_a_sweep_may_take_a_mass_to_zero_where_another_is_left(tmp_path: Path) -> None:
    sweep = "sweep many of fall { vary links.tip.mass = [0.1, 0] kg; }\n"
    found = run.run(experiment(tmp_path, YOKE, FALL, sweep, select=["many"]))
    assert (found.status == 0).all()
    assert found.signals["qdd"][0, 0, 0] != found.signals["qdd"][1, 0, 0]


def test_a_sweep_that_leaves_a_joint_nothing_is_told_with_its_case(tmp_path: Path) -> None:
    arm = changed(
        YOKE, ("inertia = [0.2, 0.3, 0.4] kg*m^2;", "shape = sphere(radius = 5 cm);"), ("mass = 0.1 kg", "mass = 0 kg")
    )
    sweep = "sweep many of fall { vary links.bar.mass = [2, 0] kg; }\n"
    assert (
        messages(check(tmp_path, arm, FALL, sweep, select=["many"]))
        == """\
error[D217]: joint `roll` moves nothing that has mass; case #1 breaks it
 --> deck.ic:6:5
  |
6 |     joint roll  revolute { parent = base; child = yoke; axis = x; }
  |     ^^^^^^^^^^^^^^^^^^^^
  = help: case #1: links.bar.mass = 0 kg
  = help: write the mass of link `yoke`, or of one that it carries
  = help: or make the joint fixed

1 error
"""
    )
