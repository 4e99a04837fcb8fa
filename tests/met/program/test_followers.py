"""Runs of arms whose joints follow others: exactness, friction, energy, order, impacts, linear answers."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.diagnostic import Problem
from met.plan import Joint
from met.plan.codec import Damaged
from met.plan.structure import check
from tests.ic.small_decks import changed, experiment
from tests.ic.small_decks import check as compile_deck

HINGED = """\
arm pair {
    link a { mass = 1 kg;  shape = rod(length = 0.3 m, along = x); }
    link b { mass = 0.5 kg;  shape = rod(length = 0.2 m, along = x); }
    joint lead revolute { parent = base;  child = a;  axis = z; }
    joint tip revolute {
        parent = a;  child = b;  at = [0.3, 0, 0] m;  axis = z;  follows = lead;  ratio = -2;  offset = 10 deg;
    }
}
servo bearing { model = passive; }
run swing {
    arm = pair;
    servos { lead = bearing; }
    environment { gravity = [0, -9.81, 0] m/s^2; }
    initial { q = 20 deg;  qd = 0.3 rad/s; }
    rates { dynamics = 1 kHz;  record = 100 Hz; }
    integrator = rk4;
    duration = 1 s;
    record = [q, qd, energy.kinetic, energy.potential];
}
"""
CARTS = """\
arm train {
    link first { mass = 2 kg;  shape = sphere(radius = 0.1 m); }
    link second { mass = 3 kg;  shape = sphere(radius = 0.1 m); }
    joint drive prismatic { parent = base;  child = first;  axis = x; }
    joint trail prismatic { parent = base;  child = second;  axis = x;  follows = drive;  ratio = 2; }
}
servo bearing { model = passive; }
run roll {
    arm = train;
    servos { drive = bearing;  trail = bearing; }
    rates { dynamics = 1 kHz;  record = 100 Hz; }
    duration = 0.5 s;
    record = [q, qd, drive.J_eff, drive.b, drive.tau_load];
}
"""
J = 2.0 + 2.0**2 * 3.0
GROUPS = """\
arm crane {
    link upper { mass = 8 kg;  shape = rod(length = 0.9 m, along = x); }
    link crank { mass = 3 kg;  shape = rod(length = 0.4 m, along = x); }
    link fore  { mass = 4 kg;  shape = rod(length = 0.8 m, along = x); }
    link rack  { mass = 1 kg;  shape = sphere(radius = 0.1 m); }
    link hand  { mass = 1 kg;  shape = box(size = [0.1, 0.2, 0.1] m, along = x); }
    joint shoulder revolute { parent = base;  child = upper;  axis = -y; }
    joint lever    revolute { parent = base;  child = crank;  axis = -y; }
    joint elbow    revolute { parent = upper;  child = fore;  at = [0.9, 0, 0] m;  axis = -y;
                              follows = [shoulder, lever];  ratio = [-1, 1]; }
    joint slide    prismatic { parent = fore;  child = rack;  axis = [1, 0.5, 0.2];
                               follows = lever;  ratio = 0.1 m/rad;  offset = 0.3 m; }
    joint wrist    revolute { parent = rack;  child = hand;  axis = z; }
}
servo bearing { model = passive;  damping = 0.5 N*m*s/rad;  stiffness = 300 N*m/rad; }
servo sliding { model = passive;  damping = 3 N*s/m;  friction = 4 N; }
run lift {
    arm = crane;
    servos {
        shoulder = bearing { friction = 2 N*m;  rotor = 0.3 kg*m^2; }
        lever = bearing;
        slide = sliding;
        wrist = bearing { stiffness = 5 N*m/rad;  friction = 0.1 N*m; }
    }
    environment { gravity = [0, 1, -9.81] m/s^2; }
    initial { shoulder.q = 0.3 rad;  lever.q = -0.2 rad;  wrist.q = 0.4 rad;  shoulder.qd = 0.8 rad/s; }
    rates { dynamics = 1 kHz;  record = 100 Hz; }
    duration = 1 s;
    record = [q, qd, qdd, tau];
    metric last = final { of = wrist.q; }
    metric most = peak { of = elbow.qd; }
}
sweep ratios of lift { vary slide.ratio = [-0.1, 0.05, 0.2] m/rad; }
"""
"""A group of two leaders, in which a joint follows both and a prismatic one a revolute one, with friction and loads."""


def ran(folder: Path, text: str, select: str | None = None) -> engine.Run:
    return engine.run(experiment(folder, text, select=select))


def test_a_follower_is_where_its_leader_puts_it_to_the_last_bit(tmp_path: Path) -> None:
    run = ran(tmp_path, HINGED)
    q, qd = run.signals["q"][0], run.signals["qd"][0]
    np.testing.assert_array_equal(q[:, 1], -2.0 * q[:, 0] + math.radians(10.0))
    np.testing.assert_array_equal(qd[:, 1], -2.0 * qd[:, 0])
    energy = run.signals["energy.kinetic"][0] + run.signals["energy.potential"][0]
    assert np.ptp(energy) < 1e-9 * np.ptp(run.signals["energy.kinetic"][0])


@pytest.mark.slow
@pytest.mark.parametrize(("integrator", "order"), [("modified_euler", 2), ("rk4", 4)])
def test_integrators_keep_their_order(tmp_path: Path, integrator: str, order: int) -> None:
    ends = []
    for hz in (400, 800, 1600, 12800):
        text = changed(HINGED, ("dynamics = 1 kHz", f"dynamics = {hz} Hz"), ("= rk4", f"= {integrator}"))
        ends.append(ran(tmp_path, text).signals["q"][0, -1, 0])
    errors = np.abs(np.array(ends[:3]) - ends[3])
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(order, abs=0.1)


def test_a_follower_of_a_follower_is_led_by_the_first(tmp_path: Path) -> None:
    third = "joint end prismatic { parent = base;  child = last;  axis = x;  follows = trail;  ratio = -0.5; }\n}"
    text = changed(
        CARTS,
        (
            "ratio = 2; }\n}",
            f"ratio = 2; }}\n    link last {{ mass = 4 kg;  shape = sphere(radius = 0.1 m); }}\n    {third}",
        ),
    )
    run = ran(tmp_path, text)
    np.testing.assert_allclose(run.signals["drive.J_eff"][0], J + 4.0, rtol=1e-15)


def test_inertia_and_load_at_a_leader_are_those_of_the_group(tmp_path: Path) -> None:
    push = "environment { push = wrench { link = second;  force = [5, 0, 0] N; } }\n    rates"
    run = ran(
        tmp_path, changed(CARTS, ("    rates", f"    {push}"), ("trail = bearing", "trail = bearing { rotor = 1 kg; }"))
    )
    np.testing.assert_allclose(run.signals["drive.J_eff"][0], J + 4.0, rtol=1e-15)
    np.testing.assert_allclose(run.signals["drive.b"][0], -10.0, rtol=1e-14)
    np.testing.assert_allclose(run.signals["q"][0, -1], np.array([0.125, 0.25]) * 10.0 / (J + 4.0), rtol=1e-12)


@pytest.mark.parametrize(("push", "slides"), [(2.999, False), (3.001, True)])
def test_a_group_sticks_as_one(tmp_path: Path, push: float, slides: bool) -> None:
    # the leader's own friction 1 N, and 1 N at a joint that moves twice as fast: 3 N at the leader
    load = f"environment {{ push = wrench {{ link = first;  force = [{push}, 0, 0] N; }} }}\n    rates"
    rubbing = (
        "drive = bearing;  trail = bearing",
        "drive = bearing { friction = 1 N; }  trail = bearing { friction = 1 N; }",
    )
    run = ran(tmp_path, changed(CARTS, ("    rates", f"    {load}"), rubbing))
    expected = (push - 3.0) / J * 0.125 if slides else 0.0
    np.testing.assert_allclose(run.signals["q"][0, -1], [expected, 2.0 * expected], rtol=1e-9)


def test_brakes_and_sliding_friction_of_followers_act_by_their_ratio(tmp_path: Path) -> None:
    brake = (
        "environment { hold = brake { joint = trail;  torque = 4 N; } }\n    initial { drive.qd = 2 m/s; }\n    rates"
    )
    run = ran(tmp_path, changed(CARTS, ("    rates", f"    {brake}"), ("duration = 0.5 s", "duration = 5 s")))
    slowed = 8.0 / J
    at_rest = 2.0 / slowed
    np.testing.assert_allclose(run.signals["qd"][0, 100, 0], 2.0 - slowed, rtol=1e-12)
    np.testing.assert_array_equal(run.signals["qd"][0, -1], 0.0)
    np.testing.assert_allclose(run.signals["q"][0, -1, 0], at_rest, rtol=1e-9)


@pytest.mark.slow
def test_a_payload_that_a_follower_grapples_strikes_the_whole_group(tmp_path: Path) -> None:
    ball = """payload ball { mass = 1 kg;  inertia = [0.1, 0.1, 0.1] kg*m^2;  on = second;  grapple = 0.2 s;
                   velocity = [-3, 0, 0] m/s;  position = [0, 0, 0] m; }\n    rates"""
    run = ran(
        tmp_path, changed(CARTS, ("    rates", f"    {ball}"), ("record = [q, qd, ", "record = [q, qd, energy, "))
    )
    rate = -3.0 * 2.0 / (J + 4.0)
    np.testing.assert_allclose(run.signals["qd"][0, 21:], np.array([rate, 2.0 * rate]) * np.ones((30, 1)), rtol=1e-12)


@pytest.mark.slow
def test_the_momentum_of_a_free_flyer_with_a_gripper_stays(tmp_path: Path) -> None:
    text = changed(
        HINGED,
        ("    link a", "    link base { mass = 4 kg;  inertia = [0.3, 0.3, 0.3] kg*m^2; }\n    link a"),
        ("    arm = pair;", "    arm = pair;  base = free;"),
        ("environment { gravity = [0, -9.81, 0] m/s^2; }", ""),
        ("servos { lead = bearing; }", "servos { lead = bearing { stiffness = 3 N*m/rad; } }"),
        ("energy.kinetic,", "momentum, energy.kinetic,"),
    )
    run = ran(tmp_path, text)
    for kind in ("linear", "angular"):
        momentum = run.signals[f"momentum.{kind}"][0]
        assert np.abs(momentum - momentum[0]).max() < 1e-9
    energy = run.signals["energy.kinetic"][0]
    assert np.ptp(energy) > 0.01


def test_cases_with_other_ratios_are_as_runs_alone(tmp_path: Path) -> None:
    swept = ran(tmp_path, HINGED + "sweep ratios of swing { vary tip.ratio = [-2, 0.7]; }", "ratios")
    for case, ratio in enumerate(("-2", "0.7")):
        alone = ran(tmp_path, changed(HINGED, ("ratio = -2", f"ratio = {ratio}")))
        np.testing.assert_allclose(swept.signals["q"][case], alone.signals["q"][0], rtol=1e-12, atol=1e-14)


def test_modes_of_a_group_are_those_of_its_one_coordinate(tmp_path: Path) -> None:
    from met.analysis.linear import period

    text = changed(CARTS, ("drive = bearing;", "drive = bearing { stiffness = 7 N/m; }"))
    program = period.PeriodProgram(experiment(tmp_path, text))
    assert program.states == ("drive.q", "drive.qd")
    run = ran(
        tmp_path, changed(text, ("    rates", "    initial { drive.q = 0.1 m; }\n    integrator = rk4;\n    rates"))
    )
    np.testing.assert_allclose(run.signals["q"][0, -1, 0], 0.1 * math.cos(math.sqrt(7.0 / J) * 0.5), rtol=1e-9)


TWO = changed(
    CARTS,
    (
        "ratio = 2; }\n}",
        """ratio = 2; }
    link last { mass = 4 kg;  shape = sphere(radius = 0.1 m); }
    link more { mass = 1 kg;  shape = sphere(radius = 0.1 m); }
    joint other prismatic { parent = base;  child = more;  axis = x; }
    joint end prismatic { parent = base;  child = last;  axis = x;  follows = [drive, other]; }
}""",
    ),
    ("trail = bearing;", "trail = bearing;  end = bearing;"),
)


@pytest.mark.parametrize("ratio", ["1e300", "-1e200"])
def test_a_ratio_whose_square_is_no_number_is_refused(ratio: str, tmp_path: Path) -> None:
    (told,) = compile_deck(tmp_path, changed(HINGED, ("ratio = -2", f"ratio = {ratio}"))).diagnostics
    assert told.code == "D077" and told.message == "`ratio` of joint `tip` must be at least -1e+100 and at most 1e+100"
    sweep = "sweep ratios of swing { vary tip.ratio = [-2, RATIO]; }".replace("RATIO", ratio)
    assert "D077" in [each.code for each in compile_deck(tmp_path, HINGED + sweep, select=["ratios"]).diagnostics]


def test_friction_that_no_torque_of_a_leader_feels_is_refused(tmp_path: Path) -> None:
    rubbing = ("trail = bearing;", "trail = bearing { friction = 1 N; }")
    ideal = ("drive = bearing;", "drive = moved;")
    moved = "servo moved { model = ideal;  bandwidth = 40 1/s;  command = rate(0.1 m/s); }\nrun roll"
    brake = ("    rates", "    environment { hold = brake { joint = trail;  torque = 1 N; } }\n    rates")
    ticks = ("dynamics = 1 kHz;", "dynamics = 1 kHz;  servos = 1 kHz;")
    decks = [
        changed(TWO, ("end = bearing;", "end = bearing { friction = 1 N; }")),
        changed(CARTS, rubbing, ideal, ticks, ("run roll", moved)),
        changed(CARTS, brake, ideal, ticks, ("run roll", moved)),
    ]
    for text in decks:
        assert [each.code for each in compile_deck(tmp_path, text).diagnostics] == ["D213"]


def test_friction_of_followers_and_ratios_may_vary_and_be_zero(tmp_path: Path) -> None:
    sweep = "sweep some of roll { vary trail.servo.friction = [0, 1] N;  vary trail.ratio = [0, 2]; }"
    push = "environment { push = wrench { link = first;  force = [1.9, 0, 0] N; } }\n    rates"
    run = ran(tmp_path, changed(CARTS, ("    rates", f"    {push}")) + sweep, "some")
    ends = 1.9 * 0.125 / np.array([2.0, J, 2.0, np.inf])
    np.testing.assert_allclose(run.signals["q"][:, -1, 0], ends, rtol=1e-9, atol=1e-15)


def test_a_joint_of_a_like_arm_is_freed_by_the_removal_of_follows_alone(tmp_path: Path) -> None:
    text = CARTS + "arm loose like train { trail { remove follows; } }\nrun free like roll { arm = loose; }"
    assert experiment(tmp_path, text, select="free").structure.moving[1].follows == ()


def test_an_engine_refuses_such_friction_of_a_plan(tmp_path: Path) -> None:
    of_deck = experiment(tmp_path, TWO)
    friction = replace(of_deck.parameters["end.servo.friction"], value=1.0)
    with pytest.raises(Problem) as problem:
        engine.run(replace(of_deck, parameters={**of_deck.parameters, "end.servo.friction": friction}))
    assert [each.code for each in problem.value.diagnostics] == ["E219"]


def test_friction_of_a_stuck_group_is_divided_by_the_levels_of_its_joints(tmp_path: Path) -> None:
    load = "environment { push = wrench { link = first;  force = [2.4, 0, 0] N; } }\n    rates"
    rubbing = (
        "drive = bearing;  trail = bearing;",
        "drive = bearing { friction = 2 N; }  trail = bearing { friction = 1 N; }",
    )
    run = ran(
        tmp_path, changed(CARTS, ("    rates", f"    {load}"), rubbing, ("record = [q, qd, ", "record = [tau, q, qd, "))
    )
    np.testing.assert_allclose(run.signals["tau"][0], [[-1.2, -0.6]] * 51, rtol=1e-12)


def test_a_leader_without_a_servo_feels_the_friction_of_what_follows_it(tmp_path: Path) -> None:
    load = "environment { push = wrench { link = first;  force = [2.4, 0, 0] N; } }\n    rates"
    rubbing = ("drive = bearing;  trail = bearing;", "trail = bearing { friction = 1 N; }")
    run = ran(tmp_path, changed(CARTS, ("    rates", f"    {load}"), rubbing))
    np.testing.assert_allclose(run.signals["q"][0, -1, 0], 0.4 / J * 0.125, rtol=1e-9)


@pytest.mark.parametrize("follows", [("trail",), ("nothing",), ("drive", "drive")])
def test_a_plan_whose_joints_follow_wrongly_is_damaged(tmp_path: Path, follows: tuple[str, ...]) -> None:
    structure = experiment(tmp_path, CARTS).structure
    joints: tuple[Joint, ...] = (structure.joints[0], replace(structure.joints[1], follows=follows))
    with pytest.raises(Damaged, match="follow"):
        check(replace(structure, joints=joints), "structure")
