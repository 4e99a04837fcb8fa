"""Models that cannot both hold are warned of: stops and ideal servos, two models of one thing, grapples from afar."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

import met.run as engine
from tests.ic.small_decks import ARM, RUN, SERVO, changed, codes, experiment, shown

IDEAL = "servo drive { model = ideal; bandwidth = 2 1/s; command = rate(1 rad/s); }\n"
STOP = "end = joint_stop { joint = hinge; upper = 0.5 rad; stiffness = 1e3 N*m/rad; };"


def inside(text: str) -> str:
    """The run, with this in its environment."""
    return changed(RUN, ("duration", f"environment {{ {text} }}\n    duration"))


def with_payload(text: str) -> str:
    """The run, with a payload that is grappled."""
    body = f"payload box {{ mass = 1 kg; shape = sphere(radius = 1 cm); on = bar; at = [1, 0, 0] m;\n {text} }}"
    return changed(RUN, ("duration", f"{body}\n    duration"))


def test_an_ideal_servo_and_a_stop(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, ARM, IDEAL, inside(STOP))
        == """\
warning[D337]: `end` cannot stop joint `hinge`: servo `drive` (ideal) tells it its acceleration, and goes on through \
an end
 --> deck.ic:10:46
   |
10 |     environment { end = joint_stop { joint = hinge; upper = 0.5 rad; stiffness = 1e3 N*m/rad; }; }
   |                                              ^^^^^
 ::: deck.ic:8:14  its servo
   = help: give the joint a servo that has a torque, or leave the stop out
   = help: or watch the joint, and require that it stays within: `metric most = max { of = hinge.q; }`
""".replace(" -->", "  -->").replace(" :::", "  :::")
    )
    assert codes(tmp_path, ARM, SERVO, inside(STOP.replace("1e3", "10"))) == []
    assert (
        codes(tmp_path, ARM, SERVO, changed(inside(STOP.replace("1e3", "10")), ("servos { hinge = drive; }", ""))) == []
    )


@pytest.mark.parametrize(
    ("command", "begin", "told"),
    [
        ("position(0.4 rad)", 0.4, False),
        ("position(sine(amplitude = 0.49 rad, frequency = 2 Hz))", 0.0, False),
        ("position(sine(amplitude = 0.51 rad, frequency = 2 Hz))", 0.0, True),
        ("position(table(times = [0, 0.5, 1] s, values = [0, 0.4, 0] rad))", 0.0, False),
        ("position(table(times = [0, 0.5, 1] s, values = [0, 0.6, 0] rad))", 0.0, True),
        ("position(step(to = 0.4 rad, at = 0.1 s))", 0.6, True),
        ("rate(0.1 rad/s)", 0.0, True),
    ],
)
def test_a_stop_that_no_position_comes_to_is_not_told(tmp_path: Path, command: str, begin: float, told: bool) -> None:
    servo = f"servo drive {{ model = ideal;  bandwidth = 40 1/s;  command = {command}; }}\n"
    run = changed(
        inside(STOP.replace("1e3", "10")), ("environment", f"initial {{ hinge.q = {begin} rad; }} environment")
    )
    assert ("D337" in codes(tmp_path, ARM, servo, run)) is told


def test_what_is_warned_of_is_so(tmp_path: Path) -> None:
    deck = changed(inside(STOP), ("duration = 1 s", "initial { hinge.qd = 1 rad/s; }  duration = 1 s"))
    found = engine.run(experiment(tmp_path, ARM, IDEAL, deck))
    assert found.signals["q"][0, -1, 0] == pytest.approx(1.0, rel=1e-6)


MOUNT = "mount = bushing { link = bar; stiffness = [1e5, 1e5, 1e5] N/m; };"
PULL = "mount = spring { link = bar; point = [1, 0, 0] m; to = world; to_point = [1, 1, 0] m; length = 1 m; stiffness = 10 N/m; };"


def test_a_bushing_on_a_link_that_is_told_its_motion(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, ARM, IDEAL, inside(MOUNT))
        == """\
warning[D296]: `mount` holds nothing: servo `drive` (ideal) tells joint `hinge` its acceleration, and what holds `bar` \
gives way to it
  --> deck.ic:10:19
   |
10 |     environment { mount = bushing { link = bar; stiffness = [1e5, 1e5, 1e5] N/m; }; }
   |                   ^^^^^
 ::: deck.ic:8:14  its servo
   = help: give the joint a servo that has a torque, or leave this out
   = help: if what it takes is what the run is about, `allow D296 because "...";`
""".replace(" :::", "  :::")
    )


def test_what_is_told_of_a_bushing_is_so(tmp_path: Path) -> None:
    """The joint goes as without it, to the last bit."""
    runs = [engine.run(experiment(tmp_path, ARM, IDEAL, deck)) for deck in (inside(MOUNT), RUN)]
    assert runs[0].signals["q"].tobytes() == runs[1].signals["q"].tobytes()


TWO = changed(
    ARM,
    ("    joint hinge", "    link tip { mass = 1 kg; shape = rod(length = 1 m, along = x); }\n    joint hinge"),
    (
        "axis = z; }\n",
        "axis = z; }\n    joint wrist revolute { parent = bar; child = tip; axis = z; at = [1, 0, 0] m; }\n",
    ),
)


@pytest.mark.parametrize(
    ("arm", "servo", "environment", "more"),
    [
        (ARM, SERVO, MOUNT.replace("1e5", "10"), ""),  # it has a torque
        (ARM, IDEAL, MOUNT.replace("stiffness = [1e5, 1e5, 1e5] N/m", "damping = [1, 1, 1] N*s/m"), ""),
        (ARM, IDEAL, PULL, "metric most = peak { of = hinge.tau; }"),  # a load
        (TWO, IDEAL, MOUNT.replace("bar", "tip").replace("1e5", "10"), ""),  # the wrist yields
        (TWO, IDEAL, MOUNT.replace("link = bar", "link = tip; to = bar; to_at = [1, 0, 0] m").replace("1e5", "10"), ""),
    ],
)
def test_what_moves_something_or_is_a_load_is_not_told(
    tmp_path: Path, arm: str, servo: str, environment: str, more: str
) -> None:
    deck = changed(inside(environment), ("    duration", f"    {more}\n    duration"))
    assert "D296" not in codes(tmp_path, arm, servo, deck)


def test_a_spring_between_two_links_that_are_both_told_is_told(tmp_path: Path) -> None:
    deck = changed(
        inside(PULL.replace("to = world; to_point = [1, 1, 0] m", "to = tip")),
        ("hinge = drive;", "hinge = drive; wrist = drive;"),
    )
    said = shown(tmp_path, TWO, IDEAL, deck)
    assert (
        "warning[D296]: `mount` holds nothing: servo `drive` (ideal) tells joint `wrist` its acceleration, and" in said
    )
    free = changed(deck, ("arm = swing;", "arm = swing; base = free;"))
    heavy = changed(TWO, ("arm swing {", "arm swing {\n    link base { mass = 9 kg; inertia = [1, 1, 1] kg*m^2; }"))
    assert "D296" in codes(tmp_path, heavy, IDEAL, free)  # both are of the arm
    assert "D296" not in codes(tmp_path, heavy, IDEAL, free.replace("to = tip", "to = world"))  # the base yields


def test_two_gravities_and_two_attitudes_are_told(tmp_path: Path) -> None:
    twice = "gravity = [0, 0, -9.81] m/s^2; pull = gravity { g = [0, 0, -1] m/s^2; };"
    assert (
        shown(tmp_path, ARM, SERVO, inside(twice))
        == """\
warning[D338]: `gravity` and `pull` both give gravity: what they do adds up
  --> deck.ic:15:50
   |
15 |     environment { gravity = [0, 0, -9.81] m/s^2; pull = gravity { g = [0, 0, -1] m/s^2; }; }
   |                                                  ^^^^
  ::: deck.ic:15:19  this one
   = help: leave one of them out
"""
    )
    orbit = "around = gravity_gradient { radius = 7000 km; frame = inertial; };"
    assert codes(tmp_path, ARM, SERVO, inside(f"gravity = [0, 0, -9.81] m/s^2; {orbit}")) == ["D338"]
    assert codes(tmp_path, ARM, SERVO, inside(f"gravity = [0, 0, 0] m/s^2; {orbit}")) == []
    held = (
        "one = attitude_hold {{ link = {}; stiffness = [1, 1, 1] N*m/rad; }}; "
        "two = attitude_hold {{ stiffness = [1, 1, 1] N*m/rad; }};"
    )
    free = changed(inside(held.format("base")), ("arm = swing;", "arm = swing; base = free;"))
    heavy = changed(ARM, ("arm swing {", "arm swing {\n    link base { mass = 9 kg; inertia = [1, 1, 1] kg*m^2; }"))
    assert codes(tmp_path, heavy, SERVO, free) == ["D338"]
    assert codes(tmp_path, heavy, SERVO, free.replace("link = base", "link = bar")) == []
    damped = free.replace("; stiffness = [1, 1, 1] N*m/rad; }; two", "; damping = [1, 1, 1] N*m*s/rad; }; two")
    assert damped != free and codes(tmp_path, heavy, SERVO, damped) == []
    by_axis = free.replace("[1, 1, 1] N*m/rad", "[1, 0, 0] N*m/rad", 1).replace(
        "[1, 1, 1] N*m/rad", "[0, 1, 1] N*m/rad"
    )
    assert codes(tmp_path, heavy, SERVO, by_axis) == []


def test_a_grapple_from_afar(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, ARM, SERVO, with_payload("grapple = 0.5 s; position = [1000, 0, 0] m;"))
        == """\
warning[D339]: link `bar` grapples payload `box` from afar: at 0.5 s it flies 1000 m from the base, and no part of \
the link is ever further than 2.866 m
  --> deck.ic:16:12
   |
16 |  grapple = 0.5 s; position = [1000, 0, 0] m; }
   |            ^^^^^
   = help: let it be at the link by then: change `position`, `velocity` or `grapple`
   = help: `payloads.box.distance` is how far it is from its place
"""
    )


@pytest.mark.parametrize(
    "text",
    [
        "grapple = 0.5 s; position = [1.2, 0, 0] m;",
        "grapple = 0.5 s; position = [1000, 0, 0] m; velocity = [-1998, 0, 0] m/s;",
        "grapple = 0.5 s; position = [8, 0, 0] m; com = [5, 0, 0] m;",
        "grapple = 0.5 s; position = [8, 0, 0] m; velocity = [-14, 0, 0] m/s;",
    ],
)
def test_what_may_be_near_is_not_told(tmp_path: Path, text: str) -> None:
    assert "D339" not in codes(tmp_path, ARM, SERVO, with_payload(text))


def test_falling_counts(tmp_path: Path) -> None:
    deck = with_payload("grapple = 1 s; position = [1, 0, 4.9] m;")
    falls = changed(deck, ("duration", "environment { pull = gravity { g = [0, 0, -9.81] m/s^2; }; }\n    duration"))
    assert codes(tmp_path, ARM, SERVO, deck) == ["D339"]
    assert codes(tmp_path, ARM, SERVO, falls) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_no_grapple_that_a_pose_could_make_is_told(tmp_path: Path, seed: int) -> None:
    """Payloads put where the link's place for them is, at a random pose of a random chain."""
    pick = random.Random(seed)
    joints = range(3)
    offsets = [[round(pick.uniform(-1.0, 1.0), 3) for _ in range(3)] for _ in range(4)]
    arm = "arm swing {\n"
    for i in joints:
        parent = "base" if i == 0 else f"l{i - 1}"
        arm += f"    link l{i} {{ mass = 1 kg; shape = sphere(radius = 1 cm); }}\n"
        arm += (
            f"    joint j{i} revolute {{ parent = {parent}; child = l{i}; axis = {'xyz'[i]}; at = {offsets[i]} m; }}\n"
        )
    q = " ".join(f"j{i}.q = {pick.uniform(-3.0, 3.0):.3f} rad;" for i in joints)
    run = changed(RUN, ("servos { hinge = drive; }", f"initial {{ {q} }}"), ("[q]", "[payloads.box.distance]"))
    body = "payload box {{ mass = 1 kg; shape = sphere(radius = 1 cm); on = l2; at = {} m; grapple = 0 s; position = {} m; }}\n"
    place = [0.0, 0.0, 0.0]
    probe = changed(
        run, ("[payloads.box.distance]", "[links.l2.position, links.l2.orientation]"), (" servos = 1 kHz;", "")
    )
    found = engine.run(experiment(tmp_path, arm + "}\n", probe)).signals
    w, *v = found["links.l2.orientation"][0, 0]
    at = np.array(offsets[3])
    turned = at + 2.0 * np.cross(v, np.cross(v, at) + w * at)
    place = [float(f"{x:.12f}") for x in found["links.l2.position"][0, 0] + turned]
    deck = changed(run, ("duration", body.format(offsets[3], place) + "    duration"), (" servos = 1 kHz;", ""))
    assert codes(tmp_path, arm + "}\n", deck) == [], seed
    distance = engine.run(experiment(tmp_path, arm + "}\n", deck)).signals["payloads.box.distance"]
    assert distance[0, 0] < 1e-9, seed
