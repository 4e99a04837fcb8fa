"""Lumped links: identified sets of numbers that are no body's, and the mass matrix that is checked instead."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.analysis.mass_matrix import mass_matrices
from met.dynamics.recursion import solve
from met.plan import keys
from met.plan.file import dumps, loads
from met.program.system import System
from tests.ic.small_decks import changed, check, experiment, messages

UPPER = "mass = 2 kg;  com = [0.5, 0, 0] m;  inertia = [0.01, 0.2, 0.2] kg*m^2;"
FORE = "mass = 1 kg;  com = [0.4, 0, 0] m;  inertia = [0.01, 0.1, 0.1] kg*m^2;"
ARM = f"""\
arm two {{
    link upper {{ {UPPER} }}
    link fore {{ {FORE} }}
    joint shoulder revolute {{ parent = base;  child = upper;  axis = z; }}
    joint elbow revolute {{ parent = upper;  child = fore;  axis = z;  at = [1, 0, 0] m; }}
}}
"""
RUN = """\
run fall {
    arm = two;
    environment { gravity = [0, -9.81, 0] m/s^2; }
    initial { elbow.q = 90 deg;  shoulder.qd = 1 rad/s;  elbow.qd = -2 rad/s; }
    rates { dynamics = 1 kHz;  record = 100 Hz; }
    duration = 0.5 s;
    record = [q, qdd];
}
"""


def with_zz(zz: float, limits: str = "") -> str:
    """The arm whose forearm is a lumped link with this moment about the joint's axis."""
    lumped = changed(
        ARM, ("0.1, 0.1]", f"0.1, {zz!r}]"), ("kg*m^2; }\n    joint", "kg*m^2;  lumped = on; }\n    joint")
    )
    return changed(lumped, ("at = [1, 0, 0] m;", f"at = [1, 0, 0] m;{limits}"))


def regrouped(moved: float) -> str:
    """The arm with a point mass on the elbow's axis, kg, counted with the upper arm instead of the forearm."""

    def with_point(mass: float, com: float, moment: float, point: float, at: float) -> str:
        total = mass + point
        centre = (mass * com + point * at) / total
        about = moment + mass * com**2 + point * at**2 - total * centre**2
        return (
            f"mass = {total!r} kg;  com = [{centre!r}, 0, 0] m;  inertia = [0.01, {about!r}, {about!r}] kg*m^2;"
            "  lumped = on;"
        )

    upper, fore = with_point(2.0, 0.5, 0.2, moved, 1.0), with_point(1.0, 0.4, 0.1, -moved, 0.0)
    return changed(ARM, (UPPER, upper), (FORE, fore))


def test_a_set_regrouped_across_a_joint_accelerates_as_the_bodies_do(tmp_path: Path) -> None:
    bodies, lumped = (experiment(tmp_path, arm, RUN) for arm in (ARM, regrouped(0.5)))
    assert lumped.parameters["links.fore.inertia.zz"].value == pytest.approx(-0.06)
    random = np.random.default_rng(0)
    trees = [System(each).tree(lambda _: 0.0) for each in (lumped, bodies)]
    for _ in range(20):
        q, qd, tau = (tuple(map(float, random.normal(size=2) * size)) for size in (3.0, 2.0, 9.0))
        a, b = (np.array(solve(tree, q=q, qd=qd, tau=tau, gravity=(1.0, -9.0, 3.0)).qdd, float) for tree in trees)
        assert np.abs(a - b).max() <= 1e-12 * np.abs(b).max()
    assert [note for note in lumped.notes if note.startswith("lumped")] == [
        "lumped links: upper, fore; mass matrix positive definite at 258 poses, least eigenvalue 0.221, "
        "scaled to ones on its diagonal"
    ]


@pytest.mark.slow
def test_a_run_of_a_regrouped_set_is_that_of_the_bodies(tmp_path: Path) -> None:
    ours, theirs = (engine.run(experiment(tmp_path, arm, RUN)) for arm in (regrouped(0.5), ARM))
    for name in ("q", "qdd"):
        a, b = (np.asarray(each.signals[name]) for each in (ours, theirs))
        assert np.abs(a - b).max() <= 1e-11 * np.abs(b).max()


@pytest.mark.parametrize(
    "numbers", ["mass = 1 kg;  inertia = [0, 0, 1] kg*m^2;", "mass = 0 kg;  inertia = [0, 0, 1] kg*m^2;"]
)
def test_numbers_of_no_body_are_accepted_as_the_message_says_and_no_density_is_reckoned(
    numbers: str, tmp_path: Path
) -> None:
    odd = changed(ARM, (FORE, numbers))
    (word,) = re.findall(r"which need be no body's: write `(.*)` in the link", messages(check(tmp_path, odd, RUN)))
    assert messages(check(tmp_path, changed(odd, (numbers, f"{numbers}  {word}")), RUN)) == ""
    large = changed(ARM, (FORE, f"mass = 1 g;  inertia = [0, 0, 900] kg*m^2;  {word}"))
    assert messages(check(tmp_path, large, RUN)) == ""


def test_the_word_changes_no_number_and_no_key_and_is_kept_in_a_plan_file(tmp_path: Path) -> None:
    bare = experiment(tmp_path, ARM, RUN)
    worded = check(tmp_path, changed(ARM, (FORE, f"{FORE}  lumped = on;")), RUN).plan
    off = experiment(tmp_path, changed(ARM, (FORE, f"{FORE}  lumped = off;")), RUN)
    assert worded is not None and off.structure == bare.structure and off.notes == bare.notes
    assert keys.structure_key(worded.experiments[0].structure) == keys.structure_key(bare.structure)
    assert [link.lumped for link in loads(dumps(worded)).experiments[0].structure.links] == [False, True]
    lumped = check(tmp_path, with_zz(-0.03), RUN).plan
    assert lumped is not None and loads(dumps(lumped)) == lumped


def test_a_set_that_is_indefinite_within_the_range_is_refused_though_it_starts_well(tmp_path: Path) -> None:
    text = messages(check(tmp_path, with_zz(-0.1), RUN))
    assert (
        text
        == """\
error[D182]: the mass matrix is not positive definite with the lumped link `fore`
 --> deck.ic:3:64
  |
3 |     link fore { mass = 1 kg;  com = [0.4, 0, 0] m;  inertia = [0.01, 0.1, -0.1] kg*m^2;  lumped = on; }
  |                                                                ^^^^ shoulder = -75.09 deg, elbow = 180.8 deg: an eigenvalue is -0.416, scaled to ones on its diagonal
  = help: with zz of the inertia of `fore` larger by 0.035 kg*m^2, so -0.065 kg*m^2, it is positive definite at the 258 poses looked at
  = help: is the set one that leaves the rotors to the motors? then the servos need their inertia

1 error
"""
    )
    # at the start, and about it, it is positive definite
    assert messages(check(tmp_path, with_zz(-0.1, "  q_min = 60 deg;  q_max = 120 deg;"), RUN)) == ""
    # the value that the help names is enough
    (value,) = re.findall(r"so (-?[\d.]+) kg\*m\^2, it is positive definite at the 258 poses", text)
    assert messages(check(tmp_path, with_zz(float(value)), RUN)) == ""
    assert messages(check(tmp_path, with_zz(float(value) - 0.002), RUN)).startswith("error[D182]")


def test_the_rotor_of_a_servo_counts(tmp_path: Path) -> None:
    assert messages(check(tmp_path, with_zz(-0.17), RUN)).startswith("error[D182]: ")
    servo = "servo drive { model = ideal;  bandwidth = 9 1/s;  rotor = 0.5 kg*m^2;  command = rate(0 rad/s); }\n"
    driven = changed(
        RUN, ("arm = two;", "arm = two;  servos { elbow = drive; }"), ("record = 100", "servos = 1 kHz;  record = 100")
    )
    assert messages(check(tmp_path, with_zz(-0.17), servo, driven)) == ""


def test_of_a_sweep_the_extreme_values_are_looked_at(tmp_path: Path) -> None:
    sweep = "sweep some of fall { vary links.fore.inertia.zz = linspace(VALUES, 0.1, 25) kg*m^2; }\n"
    good = experiment(tmp_path, with_zz(-0.03), RUN, sweep.replace("VALUES", "-0.03"), select=["some"])
    (note,) = (note for note in good.notes if note.startswith("lumped"))
    assert re.search(r"positive definite at [\d,]+ poses of (\d+) cases, least eigenvalue 0.0936, scaled", note), note
    assert re.search(r"; (\d+) of 25 cases were not looked at$", note), note
    text = messages(check(tmp_path, with_zz(-0.03), RUN, sweep.replace("VALUES", "-0.17"), select=["some"]))
    assert re.search(r"deg, case #\d+: an eigenvalue is -", text), text
    assert re.search(r"larger by 0.11 kg\*m\^2 it is positive definite at the [\d,]+ poses of \d+ cases looked", text)


def test_a_free_base_adds_its_six_velocities(tmp_path: Path) -> None:
    odd = changed(ARM, ("[0.01, 0.1, 0.1] kg*m^2;", "[-5, 0.1, 0.1] kg*m^2;  lumped = on;"))
    assert messages(check(tmp_path, odd, RUN)) == ""  # about x a planar arm on a fixed base does not turn
    still = changed(ARM, (FORE, f"{FORE}  lumped = on;"))
    for joint in ("shoulder", "elbow"):
        still = changed(still, (f"{joint} revolute", f"{joint} fixed"), ("  axis = z;", ""))
    alone = changed(RUN, ("arm = two;", "arm = two;  base = free;"), ("record = [q, qdd]", "record = [energy]"))
    alone = re.sub(r"    (initial|environment) .*\n", "", alone)
    negative = changed(still, ("0.1, 0.1]", "0.1, -9]"))
    assert [n for n in experiment(tmp_path, still, alone).notes if "positive definite at 1 pose, least" in n]
    assert " ^^^^ an eigenvalue is -" in messages(check(tmp_path, negative, alone))
    free = changed(
        RUN, ("arm = two;", "arm = two;  base = free;"), ("environment { gravity = [0, -9.81, 0] m/s^2; }", "")
    )
    odd = changed(
        odd, ("    link upper", "    link base { mass = 9 kg;  shape = sphere(radius = 0.5 m); }\n    link upper")
    )
    text = messages(check(tmp_path, odd, free))
    assert "an eigenvalue is -" in text
    (larger,) = re.findall(r"xx of the inertia of `fore` larger by [\d.]+ kg\*m\^2, so (-?[\d.]+) kg", text)
    assert messages(check(tmp_path, changed(odd, ("[-5,", f"[{larger},")), free)) == ""


def test_where_no_one_moment_is_enough_the_message_says_what_else_to_look_at(tmp_path: Path) -> None:
    other = """\
    link other { mass = 1 kg;  com = [0.4, 0, 0] m;  inertia = [0.01, 0.1, -0.2] kg*m^2;  lumped = on; }
    joint side revolute { parent = upper;  child = other;  axis = z; }
}
"""
    text = messages(check(tmp_path, with_zz(-0.2).removesuffix("}\n") + other, RUN))
    assert text.startswith(
        "error[D182]: the mass matrix is not positive definite with the lumped links `fore` and `other`\n"
    )
    assert re.search(r"\n ::: deck.ic:\d+:\d+  link `other`\n", text), text
    assert (
        "no larger moment of inertia of one such link is enough: look at their masses and centres of mass too" in text
    )


PUMA = """\
deck 2;
#include <puma_560.ic>
arm published like puma_560 {
    link1 { mass = 0 kg;  inertia = [0, 0.35, 0] kg*m^2;  lumped = on; }
    link3 { inertia = [0.066, 0.086, 0.0125] kg*m^2;  lumped = on; }
}
run nominal like puma_reach {
    arm = published;
    initial { shoulder.q = 45 deg;  elbow.q = -180 deg;  bend.q = 45 deg; }
}
"""
"""The inertia of Corke and Armstrong-Helouvry, "A Search for Consensus Among Model Parameters Reported for the PUMA 560
Robot", Proc. IEEE Int. Conf. Robotics and Automation, 1994, 1608-1613, where no body has that of links 1 and 3."""

PRINTED = [
    [2.6152, -0.6550, -0.0363, 0.0001, 0.0010, 0.0],
    [-0.6550, 4.3038, 0.2953, -0.0008, -0.0017, 0.0],
    [-0.0363, 0.2953, 0.9366, -0.0009, -0.0006, 0.0],
    [0.0001, -0.0008, -0.0009, 0.1926, 0.0, 0.0],
    [0.0010, -0.0017, -0.0006, 0.0, 0.1713, 0.0],
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.1941],
]
"""The mass matrix with all joints turned, by 1, 2 ... 6 rad, kg m^2: what P. Corke's Robotics Toolbox for MATLAB, which
has that set, prints for `p560.inertia([1 2 3 4 5 6])`, in four decimals."""


def test_the_published_set_of_the_puma_560_has_the_published_mass_matrix(tmp_path: Path) -> None:
    found = experiment(tmp_path, PUMA, select=["nominal"])
    rotors = [found.parameters[f"{use.joint}.servo.rotor"].value for use in found.structure.servos]
    tree = System(found).tree(lambda _: 0.0)
    (M,) = mass_matrices(tree, np.arange(1.0, 7.0)[None], rotors, [0.0] * 6)  # type: ignore[arg-type]
    assert np.abs(M - PRINTED).max() <= 5e-5
    assert any(note.startswith("lumped links: link1, link3; mass matrix positive definite") for note in found.notes)
    assert "D087" in messages(check(tmp_path, PUMA.replace("lumped = on;", ""), select=["nominal"]))
