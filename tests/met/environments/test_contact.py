"""Contact of two bodies: its laws against closed forms, momentum, friction, and what steps make of a rebound."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.special import beta

from met import run as engine
from met.analysis.contact import contacts
from met.environments.contact import ENVIRONMENT, HERTZ, loads, show, touch
from tests.ic.small_decks import changed, check, experiment, messages
from tests.met.environments.test_joint_stop import given_back
from tests.met.environments.test_spring import pair
from tests.met.environments.worlds import Link, given

SPHERES = {
    "link": "one", "to": "two", "at": (0.3, -0.1, 0.2), "to_at": (-0.2, 0.4, 0.1), "surface": "sphere", "radius": 0.9,
    "to_radius": 0.6, "law": "linear", "stiffness": 500.0, "dissipation": 0.1, "friction": 0.4, "slip": 0.02,
}  # fmt: skip
PLANE = {
    "link": "one", "radius": 0.1, "surface": "plane", "normal": (0.0, 0.0, 2.0), "law": "linear", "stiffness": 500.0,
}  # fmt: skip


@pytest.mark.parametrize(
    "change", [{}, {"law": "hertz", "modulus": 9e3}, {"surface": "plane", "normal": (1.0, 2.0, 2.0)}]
)
def test_both_bodies_feel_opposite_forces_at_one_point(change: dict[str, object]) -> None:
    world, p = pair(), given(ENVIRONMENT, **{**SPHERES, "radius": 3.0, **change})
    assert touch(p, world).depth > 0.0
    one, two = loads(p, world).forces
    np.testing.assert_array_equal(np.add(one.force, two.force), 0.0)
    moments = [np.cross(world.position(f.link, f.point), f.force) + np.array(f.moment) for f in (one, two)]
    np.testing.assert_allclose(np.add(*moments), 0.0, atol=1e-13 * np.linalg.norm(one.force))


def test_depth_and_its_rate_are_those_of_the_surfaces() -> None:
    for change in ({}, {"surface": "plane", "normal": (1.0, 2.0, 2.0)}):
        p, world, dt = given(ENVIRONMENT, **{**SPHERES, **change}), pair(), 1e-6
        later = {}
        for name, link in world.placed.items():
            x, y, z = np.multiply(link.w, dt)
            turn = np.eye(3) + np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
            later[name] = Link(turn @ link.R, np.add(link.p, np.multiply(link.v, dt)), link.w, link.v)
        grown = (touch(p, pair(**later)).depth - touch(p, world).depth) / dt
        assert touch(p, world).rate == pytest.approx(float(grown), rel=1e-5)


def test_it_presses_by_its_law_and_rubs_against_the_sliding() -> None:
    def force(depth: float, v: tuple[float, float, float], **more: object) -> np.ndarray:
        p = given(ENVIRONMENT, **{**PLANE, **more})
        return np.array(loads(p, pair(one=Link(p=(0.0, 0.0, 0.1 - depth), v=v))).forces[0].force)

    still = (0.0, 0.0, 0.0)
    np.testing.assert_allclose(force(0.02, still), [0.0, 0.0, 10.0], rtol=1e-13)
    np.testing.assert_allclose(force(0.02, (0.0, 0.0, -2.0), dissipation=0.3), [0.0, 0.0, 16.0], rtol=1e-13)
    assert not force(0.02, (0.0, 0.0, 9.0), dissipation=0.3).any(), "it never pulls"
    for depth in (0.0, -1e-9, -3.0):
        for law in ({}, {"law": "hertz", "modulus": 1e9}):
            assert not force(depth, (1.0, 1.0, -9.0), friction=0.5, **law).any()
    hertz = 4.0 / 3.0 * 1e6 * math.sqrt(0.1) * 0.02**1.5
    np.testing.assert_allclose(force(0.02, still, law="hertz", modulus=1e6), [0.0, 0.0, hertz], rtol=1e-13)
    rubs = 0.5 * 10.0 * 0.05 / math.hypot(0.05, 0.01)
    np.testing.assert_allclose(
        force(0.02, (0.03, -0.04, 0.0), friction=0.5), [-0.6 * rubs, 0.8 * rubs, 10.0], rtol=1e-13
    )
    assert np.isnan(force(math.nan, still)).any(), "what is no number stays none"


def test_what_it_shows_is_what_acts() -> None:
    p, world = given(ENVIRONMENT, **SPHERES), pair(two=Link(p=(0.8, -0.2, 0.4), v=(0.1, 0.2, 0.3)))
    found, shown = touch(p, world), show(p, world)
    assert shown["depth"] == found.depth > 0.0 and shown["force"] == loads(p, world).forces[0].force
    assert np.dot(shown["force"], found.normal) == pytest.approx(float(shown["normal"]), rel=1e-13)


BLOCK = """\
arm drop {
    link block { mass = 2 kg;  inertia = [1, 1, 1] kg*m^2; }
    joint slide prismatic { parent = base;  child = block;  axis = z; }
}
run it {
    arm = drop;
    initial { slide.q = 1 m;  slide.qd = -0.5 m/s; }
    environment { pad = contact { link = block;  radius = 1 m;  normal = [0, 0, 1];  LAW } }
    integrator = INTEGRATOR;
    rates { dynamics = RATE Hz; }
    duration = 40 ms;
    record = [q, qd, environment.pad.depth, environment.pad.normal];
}
"""
MASS, RATE = 2.0, 0.5
K = 1e8
HERTZ_LAW = f"law = hertz;  modulus = {0.75 * K!r} Pa;"
DEEPEST = (5.0 * MASS * RATE**2 / (4.0 * K)) ** 0.4
LASTS = HERTZ * DEEPEST / RATE


def dropped(
    folder: Path, law: str, rate: float, *changes: tuple[str, str], integrator: str = "modified_euler"
) -> engine.Run:
    text = changed(BLOCK, ("LAW", law), ("INTEGRATOR", integrator), ("RATE", repr(rate)), *changes)
    found = engine.run(experiment(folder, text))
    assert not any(found.cause)
    return found


def test_a_hertzian_contact_is_as_deep_and_as_long_as_its_closed_form(tmp_path: Path) -> None:
    assert pytest.approx(4.0 / 5.0 * beta(0.4, 0.5), abs=5e-7) == HERTZ
    found = dropped(tmp_path, HERTZ_LAW, 200_000.0, ("duration = 40 ms", "duration = 4 ms"))
    depth = found.signals["environment.pad.depth"][0]
    assert depth.max() == pytest.approx(DEEPEST, rel=1e-5)
    ends = found.time[np.flatnonzero(depth > 0.0)[-1]]
    assert ends == pytest.approx(LASTS, abs=1.01 / 200_000.0)
    assert found.signals["qd"][0, -1, 0] == pytest.approx(RATE, rel=1e-6), "nothing is lost"
    # the impulse is twice the momentum
    impulse = found.signals["environment.pad.normal"][0].sum() / 200_000.0
    assert impulse == pytest.approx(2.0 * MASS * RATE, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("integrator", "gains"),
    [("modified_euler", (1.2e-2, 1.6e-3, 2e-4)), ("rk4", (8e-4, 1.6e-4, 3e-5))],
)
def test_a_rebound_by_steps_in_a_contact(integrator: str, gains: tuple[float, ...], tmp_path: Path) -> None:
    """Where the contact begins 0.37 of a step after a step: as the page shows."""
    for steps, gain in zip((10, 20, 40), gains, strict=True):
        rate = round(steps / LASTS)
        away = ("slide.q = 1 m", f"slide.q = {1.0 + 0.37 / rate * RATE!r} m")
        long = ("duration = 40 ms", f"duration = {2 * steps} s / {rate}")
        found = dropped(tmp_path, HERTZ_LAW, rate, away, long, integrator=integrator)
        left = float(found.signals["qd"][0, -1, 0]) / RATE - 1.0
        assert 0.5 * gain < abs(left) < 1.6 * gain, (steps, left)


@pytest.mark.parametrize("a", [0.2, 1.0, 4.0])
def test_a_contact_that_takes_energy_gives_back_what_a_stop_would(a: float, tmp_path: Path) -> None:
    found = dropped(tmp_path, f"stiffness = 5e4 N/m;  dissipation = {a} s/m;", 20_000.0, ("40 ms", "100 ms"))
    assert found.signals["qd"][0, -1, 0] == pytest.approx(given_back(RATE, a), rel=1e-5)


def test_a_body_at_rest_is_as_deep_as_its_weight_over_the_stiffness(tmp_path: Path) -> None:
    weight = (
        "environment {",
        "environment { gravity = [0, 0, -9.81] m/s^2;  air = joint_damping { sliding = 200 N*s/m; } ",
    )
    found = dropped(tmp_path, "stiffness = 2e4 N/m;", 1000.0, weight, ("40 ms", "2 s"))
    assert found.signals["environment.pad.depth"][0, -1] == pytest.approx(MASS * 9.81 / 2e4, rel=1e-9)


SLOPE = """\
arm sledge {
    link carrier { mass = 0 kg;  inertia = [0, 0, 0] kg*m^2; }
    link block   { mass = 2 kg;  inertia = [1, 1, 1] kg*m^2; }
    joint along prismatic { parent = base;  child = carrier;  axis = x; }
    joint off   prismatic { parent = carrier;  child = block;  axis = z; }
}
let slope = SLOPE rad;
run it {
    arm = sledge;
    initial { off.q = -DEPTH m; }
    environment {
        gravity = [9.81 m/s^2 * sin(slope), 0 m/s^2, -9.81 m/s^2 * cos(slope)];
        pad     = contact { link = block;  normal = [0, 0, 1];  stiffness = 1e4 N/m;  friction = 0.5;  slip = 2 cm/s; }
    }
    rates { dynamics = 2 kHz; }
    duration = 1 s;
    record = [q, qd];
}
"""


@pytest.mark.parametrize("ratio", [0.4, 0.9, 1.1, 1.5])
def test_on_a_slope_it_slides_only_if_the_slope_exceeds_the_friction_and_creeps_else(
    ratio: float, tmp_path: Path
) -> None:
    slope = math.atan(0.5 * ratio)
    depth = 2.0 * 9.81 * math.cos(slope) / 1e4
    text = SLOPE.replace("SLOPE", repr(slope)).replace("DEPTH", repr(depth))
    found = engine.run(experiment(tmp_path, text))
    v = found.signals["qd"][0, :, 0]
    if ratio < 1.0:  # where friction takes the load: mu N v/sqrt(v^2 + slip^2) = m g sin
        assert v[-1] == pytest.approx(0.02 * ratio / math.sqrt(1.0 - ratio**2), rel=1e-6)
    else:
        late = found.time > 0.9
        gained = np.polyfit(found.time[late], v[late], 1)[0]
        assert gained == pytest.approx(9.81 * (math.sin(slope) - 0.5 * math.cos(slope)), rel=1e-2)


BALLS = """\
arm table {
    link base  { mass = 5 kg;  shape = sphere(radius = 10 cm);  com = [0, 0, 0] m; }
    link knob  { mass = 0.1 kg;  shape = sphere(radius = 1 cm); }
    joint turn revolute { parent = base;  child = knob;  axis = z; }
}
run it {
    arm = table;
    BASE
    payload ball { mass = 2 kg;  shape = sphere(radius = 10 cm);  com = [0, 0, 0] m;  on = base;  grapple = 9 s;  WHERE }
    environment { pad = contact { link = ball;  radius = 10 cm;  to = base;  LAW }  MORE }
    rates { dynamics = 10 kHz;  record = 1 kHz; }
    duration = LONG;
    record = [momentum, energy, payloads.ball.velocity, payloads.ball.rate, environment.pad.depth];
}
"""


def balls(folder: Path, **parts: str) -> engine.Run:
    text = BALLS
    for name, part in parts.items():
        text = text.replace(name, part)
    found = engine.run(experiment(folder, text))
    assert not any(found.cause)
    return found


def test_two_free_bodies_keep_their_momentum_and_without_losses_their_energy(tmp_path: Path) -> None:
    """A ball that spins hits a satellite with a knob, off its middle."""
    found = balls(
        tmp_path, BASE="base = free;", LONG="0.5 s", MORE="",
        WHERE="position = [-0.4, 0.08, 0.05] m;  velocity = [1, 0, 0] m/s;  rate = [0, 2, 5] rad/s;",
        LAW="surface = sphere;  to_radius = 10 cm;  stiffness = 1e5 N/m;  friction = 0.3;",
    )  # fmt: skip
    assert found.signals["environment.pad.depth"][0].max() > 1e-3
    linear, angular = (found.signals[f"momentum.{kind}"][0] for kind in ("linear", "angular"))
    assert np.ptp(found.signals["payloads.ball.velocity"][0, :, 1]) > 0.1, "it is thrown aside"
    np.testing.assert_allclose(linear, np.broadcast_to(linear[0], linear.shape), atol=1e-14 * np.abs(linear[0]).max())
    # of places and rates together, of the order of the steps
    np.testing.assert_allclose(angular, np.broadcast_to(angular[0], angular.shape), atol=1e-6)


def test_a_ball_that_slides_rolls_in_the_end_with_five_sevenths_of_its_speed(tmp_path: Path) -> None:
    depth = 2.0 * 9.81 / 1e4
    found = balls(
        tmp_path, BASE="", LONG="1.5 s", MORE="gravity = [0, 0, -9.81] m/s^2;",
        WHERE=f"position = [1, 0, {0.1 - depth!r}] m;  velocity = [1, 0, 0] m/s;",
        LAW="normal = [0, 0, 1];  stiffness = 1e4 N/m;  friction = 0.3;  slip = 5 mm/s;",
    )  # fmt: skip
    v, w = found.signals["payloads.ball.velocity"][0, -1, 0], found.signals["payloads.ball.rate"][0, -1, 1]
    # it touches in the middle of a depth of 2 mm, and so rolls with the radius less half of that
    arm = 0.1 - depth / 2.0
    assert v == pytest.approx(1.0 / (1.0 + 0.4 * 0.1**2 / arm**2), rel=1e-3)
    assert v == pytest.approx(w * arm, rel=1e-3) and v == pytest.approx(5.0 / 7.0, rel=1e-2)


def test_bodies_feel_the_mass_that_resists_where_they_touch(tmp_path: Path) -> None:
    text = BALLS.replace("BASE", "base = free;").replace("LONG", "1 s").replace("MORE", "")
    text = text.replace("WHERE", "position = [-0.4, 0, 0] m;  velocity = [2, 0, 0] m/s;")
    made = experiment(tmp_path, text.replace("LAW", "surface = sphere;  to_radius = 10 cm;  stiffness = 1e5 N/m;"))
    (found,) = contacts(made)
    assert found.body == "`ball`" and found.unit == "kg"
    assert found.inertia == pytest.approx(2.0 * 5.1 / 7.1, rel=1e-12)
    assert found.steps == pytest.approx(math.pi * math.sqrt(found.inertia / 1e5) * 1e4, rel=1e-12)


def test_below_ten_steps_in_a_contact_it_is_warned(tmp_path: Path) -> None:
    text = changed(BLOCK, ("LAW", "stiffness = 2e5 N/m;"), ("INTEGRATOR", "modified_euler"), ("RATE", "1000"))
    assert messages(check(tmp_path, text)).startswith(
        "warning[D295]: `pad` is stiff for the dynamics' step: `block` touches it for 9.9 steps\n"
    )
    assert not check(tmp_path, text.replace("2e5", "1.9e5")).diagnostics
    hertz = text.replace("stiffness = 2e5 N/m;", f"law = hertz;  modulus = {0.75 * K!r} Pa;")
    assert f"`block` touches it for {LASTS * 1e3:.2g} steps" in messages(check(tmp_path, hertz)), "at 0.5 m/s"


def test_numbers_of_the_other_surface_or_law_are_refused(tmp_path: Path) -> None:
    text = changed(BLOCK, ("INTEGRATOR", "rk4"), ("RATE", "1000"))
    told = messages(check(tmp_path, text.replace("LAW", "to_radius = 1 m;  modulus = 1 GPa;  stiffness = 10 N/m;")))
    assert "environment `pad` has no `to_radius` with `surface = plane`" in told
    assert "environment `pad` has no `modulus` with `law = linear`" in told
    told = messages(check(tmp_path, text.replace("LAW", "law = hertz;  modulus = 1 GPa;").replace("radius = 1 m;", "")))
    assert "D168" in told and "it has no radius, and so no stiffness by Hertz's law" in told
