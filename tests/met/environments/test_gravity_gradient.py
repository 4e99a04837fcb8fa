"""Gravity gradient: the known torque, sums over parts, the equations of Clohessy and Wiltshire, and one frame's answer
against the other's."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.dynamics.spatial import rotation_quaternion
from met.environments.gravity_gradient import ENVIRONMENT, loads
from met.vectors import rotation_about, rotation_rpy
from tests.ic.small_decks import changed, check, experiment
from tests.met.environments.worlds import Given, Link, given, turned
from tests.met.tree_deck import TREE

MU, RADIUS = 3.986004418e14, 6.778e6
N = math.sqrt(MU / RADIUS**3)
RPY = (0.4, -1.1, 2.3)
FRAMES = ["inertial", "orbital"]


def cloud(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Point masses (kg) and where they are in their link's frame (m)."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0.5, 2.0, 7), rng.standard_normal((7, 3))


def body(seed: int) -> Link:
    """A link made of a cloud of point masses, that moves in space."""
    m, x = cloud(seed)
    com = m @ x / m.sum()
    y = x - com
    I = sum(mass * (r @ r * np.eye(3) - np.outer(r, r)) for mass, r in zip(m, y, strict=True))  # noqa: E741
    rng = np.random.default_rng(seed + 100)
    return Link(
        turned(seed),
        rng.standard_normal(3),
        N * rng.standard_normal(3),
        N * rng.standard_normal(3),
        float(m.sum()),
        tuple(com),
        (I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]),
    )


def axes(time: float, frame: str) -> tuple[np.ndarray, np.ndarray]:
    """Up and the orbit's normal in the world."""
    R = np.array(rotation_rpy(*RPY))
    turn = np.array(rotation_about((0.0, 0.0, 1.0), N * time)) if frame == "inertial" else np.eye(3)
    return (R @ turn)[:, 0], R[:, 2]


@pytest.mark.parametrize("frame", FRAMES)
def test_a_link_feels_the_sum_of_what_its_parts_feel(frame: str) -> None:
    """Of point masses: from Newton's law of the difference of two places, and what a turning world adds."""
    time, links = 1234.5, {str(seed): body(seed) for seed in range(3)}
    up, normal = axes(time, frame)
    found = loads(given(ENVIRONMENT, radius=RADIUS, rpy=RPY, frame=frame), Given(links, time=time)).forces
    assert [force.link for force in found] == list(links)
    for force, (name, link) in zip(found, links.items(), strict=True):
        m, x = cloud(int(name))
        total, moment = np.zeros(3), np.zeros(3)
        for mass, point in zip(m, x, strict=True):
            there, speed = np.asarray(link.p) + link.R @ point, np.asarray(link.v) + np.cross(link.w, link.R @ point)
            a = N**2 * (3.0 * up * (up @ there) - there)
            if frame == "orbital":
                w = N * normal
                a += -np.cross(w, np.cross(w, there)) - 2.0 * np.cross(w, speed)
            total, moment = total + mass * a, moment + np.cross(link.R @ (point - link.com), mass * a)
        # some roundings of what is added up
        np.testing.assert_allclose(force.force, total, rtol=0, atol=1e-13 * np.linalg.norm(total))
        np.testing.assert_allclose(force.moment, moment, rtol=0, atol=3e-13 * np.linalg.norm(moment))
        assert force.point == link.com


def test_to_first_order_it_is_newtons_attraction_less_the_free_fall() -> None:
    link = body(4)
    up, _ = axes(0.0, "inertial")
    (force,) = loads(given(ENVIRONMENT, radius=RADIUS, rpy=RPY, frame="inertial"), Given({"one": link})).forces
    m, x = cloud(4)
    exact = np.zeros(3)
    for mass, point in zip(m, x, strict=True):
        way = RADIUS * up + link.p + link.R @ point
        exact += mass * (-MU * way / np.linalg.norm(way) ** 3 + MU * up / RADIUS**2)
    # the second order is the way over the radius, 1e-6; the difference of two accelerations of 9 m/s^2 is as rounded
    assert np.abs(np.array(force.force) - exact).max() < 3e-6 * np.linalg.norm(force.force) + 1e-13


def test_the_moment_is_the_one_of_the_books() -> None:
    """3 mu/R^3 r x I r."""
    link = body(1)
    up, _ = axes(0.0, "inertial")
    (force,) = loads(given(ENVIRONMENT, radius=RADIUS, rpy=RPY, frame="inertial"), Given({"one": link})).forces
    xx, yy, zz, xy, xz, yz = link.inertia
    I = link.R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ link.R.T  # noqa: E741
    np.testing.assert_allclose(force.moment, 3.0 * MU / RADIUS**3 * np.cross(up, I @ up), rtol=1e-12)


def test_the_forces_on_all_links_add_up_to_that_on_their_mass_at_their_centre() -> None:
    links = {str(seed): body(seed) for seed in range(4)}
    world = Given(links)
    up, _ = axes(0.0, "inertial")
    found = loads(given(ENVIRONMENT, radius=RADIUS, rpy=RPY, frame="inertial"), world).forces
    centre = sum(link.mass * np.array(world.position(name, link.com)) for name, link in links.items())
    np.testing.assert_allclose(
        np.sum([force.force for force in found], axis=0), N**2 * (3.0 * up * (up @ centre) - centre), rtol=1e-12
    )


FLYER = """\
arm flyer {
    link x    { mass = 0 kg; }
    link y    { mass = 0 kg; }
    link z    { mass = 0 kg; }
    link a    { mass = 0 kg; }
    link b    { mass = 0 kg; }
    link body { mass = 8 kg;  com = [0.1, -0.2, 0.3] m;  inertia = [1.2, 2, 2.4, 0.1, -0.2, 0.15] kg*m^2; }
    joint x_way  prismatic { parent = base;  child = x;  axis = x; }
    joint y_way  prismatic { parent = x;  child = y;  axis = y; }
    joint z_way  prismatic { parent = y;  child = z;  axis = z; }
    joint a_turn revolute  { parent = z;  child = a;  axis = z; }
    joint b_turn revolute  { parent = a;  child = b;  axis = x; }
    joint c_turn revolute  { parent = b;  child = body;  axis = y; }
}
run it {
    arm = flyer;
    initial { INITIAL }
    environment { orbit = gravity_gradient { radius = 2 m; mu = 8 m^3/s^2; frame = FRAME; } }
    integrator = rk4;  rates { dynamics = 500 Hz; record = 10 Hz; }  duration = 1.5 s;
    record = [q, links.body.position, links.body.orientation];
}
"""


def flown(tmp_path: Path, frame: str, initial: dict[str, float]) -> tuple[np.ndarray, ...]:
    """Times, positions and orientations of the body of a flyer whose orbit has n = 1/s, and the joints."""
    text = "".join(
        f"{name} = {value!r} {'m' if 'way' in name else 'rad'}{'/s' if 'qd' in name else ''};  "
        for name, value in initial.items()
    )
    found = engine.run(experiment(tmp_path, FLYER.replace("INITIAL", text).replace("FRAME", frame)))
    assert found.cause == [""]
    turns = [np.array(rotation_quaternion(*each)) for each in found.signals["links.body.orientation"][0]]
    return found.time, found.signals["links.body.position"][0], np.array(turns), found.signals["q"][0]


@pytest.mark.slow
def test_a_free_point_follows_clohessy_and_wiltshire(tmp_path: Path) -> None:
    """The closed form for n = 1/s; the body's centre is where its frame is."""
    text = changed(FLYER, ("com = [0.1, -0.2, 0.3] m", "com = [0, 0, 0] m"))
    start = {"x_way.q": 0.3, "y_way.q": -0.2, "z_way.q": 0.5, "x_way.qd": 0.1, "y_way.qd": 0.4, "z_way.qd": -0.3}
    initial = "".join(f"{k} = {v} m{'/s' if 'qd' in k else ''};  " for k, v in start.items())
    found = engine.run(experiment(tmp_path, text.replace("INITIAL", initial).replace("FRAME", "orbital")))
    t = found.time
    x, y, z, u, v, w = start.values()
    c, s = np.cos(t), np.sin(t)
    exact = np.stack(
        [
            (4 - 3 * c) * x + s * u + 2 * (1 - c) * v,
            6 * (s - t) * x + y + 2 * (c - 1) * u + (4 * s - 3 * t) * v,
            c * z + s * w,
        ],
        axis=1,
    )
    # rk4 with h = 2 ms: h^4/120 a second
    np.testing.assert_allclose(found.signals["links.body.position"][0], exact, rtol=0, atol=1e-11)


@pytest.mark.slow
def test_a_tumbling_body_does_the_same_seen_from_either_frame(tmp_path: Path) -> None:
    """Positions and orientations turned back by n t; the rates at t = 0 are less by the orbit's."""
    inertial = {
        "x_way.q": 0.3,
        "y_way.q": -0.2,
        "x_way.qd": 0.1,
        "y_way.qd": 0.5,
        "z_way.qd": 0.2,
        "a_turn.q": 0.4,
        "b_turn.q": 0.3,
        "a_turn.qd": 0.9,
        "b_turn.qd": 0.4,
        "c_turn.qd": -0.5,
    }
    # v - n x p; the first turn is about the orbit's normal, so its rate is less by n
    orbital = inertial | {"x_way.qd": 0.1 - 0.2, "y_way.qd": 0.5 - 0.3, "a_turn.qd": 0.9 - 1.0}
    t, p, R, q = flown(tmp_path, "inertial", inertial)
    _, p_o, R_o, _ = flown(tmp_path, "orbital", orbital)
    assert np.ptp(q, axis=0).min() > 0.1 and np.abs(q[:, 4]).max() < 1.4, "all joints move, none near where two are one"
    for k, time in enumerate(t):
        turn = np.array(rotation_about((0.0, 0.0, 1.0), float(time)))
        # rk4 at 500 Hz of rates of some 1/s
        np.testing.assert_allclose(p[k], turn @ p_o[k], rtol=0, atol=1e-9)
        np.testing.assert_allclose(R[k], turn @ R_o[k], rtol=0, atol=1e-9)


def test_a_rod_swings_about_the_vertical_as_it_must(tmp_path: Path) -> None:
    """Small swings in the orbit's plane: n sqrt(3 (Iyy - Ixx)/Izz), x up."""
    deck = """\
arm pendulum {
    link rod { mass = 10 kg; inertia = [2, 30, 31] kg*m^2; com = [0, 0, 0] m; }
    joint hinge revolute { parent = base; child = rod; axis = z; }
}
run it {
    arm = pendulum;  initial { hinge.q = 1e-4 rad; }
    environment { orbit = gravity_gradient { radius = 6778 km; frame = orbital; } }
    integrator = rk4;  rates { dynamics = 0.5 Hz; record = 0.01 Hz; }  duration = 4000 s;  record = [q];
}
"""
    found = engine.run(experiment(tmp_path, deck))
    swing = 1e-4 * np.cos(N * math.sqrt(3.0 * 28.0 / 31.0) * found.time)
    assert found.signals["q"][0, :, 0].min() < -0.9e-4
    np.testing.assert_allclose(found.signals["q"][0, :, 0], swing, rtol=0, atol=1e-11)  # q^3 of the sine: 1e-12 a swing


@pytest.mark.slow
def test_every_link_of_a_tree_feels_it_and_its_mass_varies(tmp_path: Path) -> None:
    run = """\
run it {
    arm = tree;  environment { orbit = gravity_gradient { radius = 6778 km; frame = orbital; } }
    rates { dynamics = 10 Hz; }  duration = 0.1 s;  record = [qdd];
}
sweep some of it { vary links.tool.mass = [1, 5] kg;  vary environment.orbit.radius = [6778, 7000] km; }
"""
    found = engine.run(experiment(tmp_path, TREE, run, select=["some"])).signals["qdd"][:, 0]
    assert (np.abs(found) > 1e-9).all() and len(np.unique(found[:, 1])) == 4
    # two cases of one mass differ by n^2
    np.testing.assert_allclose(found[0] / found[1], (7000.0 / 6778.0) ** 3, rtol=1e-9)


def test_it_says_in_which_frame(tmp_path: Path) -> None:
    text = FLYER.replace("INITIAL", "").replace("frame = FRAME;", "")
    assert [d.message for d in check(tmp_path, text).diagnostics] == ["environment `orbit` has no `frame`"]


def test_a_stations_axes_are_turned_as_the_page_says() -> None:
    """x along the flight, z to the Earth: a point below the origin is pulled down, one ahead is not."""
    page = (Path(__file__).parents[3] / "docs" / "environments.md").read_text(encoding="utf-8")
    assert "`rpy = [0, 90, -90] deg`" in page
    p = given(ENVIRONMENT, radius=RADIUS, rpy=tuple(np.radians([0.0, 90.0, -90.0])), frame="orbital")
    for point, pulled in (((1.0, 0.0, 0.0), 0.0), ((0.0, 1.0, 0.0), -1.0), ((0.0, 0.0, 1.0), 3.0)):
        (force,) = loads(p, Given({"one": Link(p=point)})).forces
        np.testing.assert_allclose(force.force, N**2 * pulled * np.array(point), atol=1e-18)
    (force,) = loads(p, Given({"one": Link(v=(1.0, 0.0, 0.0))})).forces  # what goes ahead faster rises
    assert force.force[2] == pytest.approx(-2.0 * N, rel=1e-12)
