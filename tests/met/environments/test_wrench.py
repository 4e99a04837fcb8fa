"""A wrench on a link: against Pinocchio's forward dynamics, by statics, and what its window in time does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from tests.ic.small_decks import ARM, changed, check, experiment, messages
from tests.met.tree_deck import GRAVITY, TREE
from tests.oracles.plan_tree import pinocchio

FORCE, MOMENT, POINT = np.array([20.0, -8.0, 14.0]), np.array([3.0, 5.0, -2.0]), np.array([0.3, 0.1, -0.2])


def listed(vector: np.ndarray) -> str:
    return "[" + ", ".join(f"{x:g}" for x in vector) + "]"


RUN = f"""\
run it {{
    arm = tree;
    initial {{ turn.q = 0.3 rad; raise.q = -0.7 rad; push.qd = 0.2 m/s; wag.qd = -1 rad/s; turn.qd = 2 rad/s; }}
    environment {{
        gravity = [{", ".join(map(str, GRAVITY))}] m/s^2;
        shove = wrench {{ link = boom; force = {listed(FORCE)} N; moment = {listed(MOMENT)} N*m;
                         point = {listed(POINT)} m; axes = world; }}
    }}
    rates {{ dynamics = 500 Hz; record = 50 Hz; }}
    duration = 0.5 s;  record = [q, qd, qdd, tau];
}}
"""


@pytest.mark.oracle
@pytest.mark.parametrize("axes", ["world", "link"])
@pytest.mark.parametrize("link", ["boom", "side", "tool"])
def test_it_pushes_as_pinocchios_external_force_does(tmp_path: Path, link: str, axes: str) -> None:
    """On a link in the middle of the tree, on a branch, and behind a fixed joint."""
    text = changed(RUN, ("link = boom", f"link = {link}"), ("axes = world", f"axes = {axes}"))
    deck = experiment(tmp_path, TREE, text)
    found = engine.run(deck).signals
    arm = pinocchio(deck, gravity=GRAVITY)
    assert np.ptp(found["q"][0], axis=0).min() > 0.05, "all joints move"
    for q, qd, qdd, tau in zip(*(found[name][0] for name in ("q", "qd", "qdd", "tau")), strict=True):
        R = arm.link_pose(q, link)[0] if axes == "world" else np.eye(3)
        force, moment = R.T @ FORCE, R.T @ MOMENT
        wrench = {link: (moment + np.cross(POINT, force), force)}
        # rounding: 1e-16 times the arm's condition, some hundreds, and of accelerations up to 100
        assert np.abs(qdd - arm.accelerations(q, qd, tau, wrench)).max() < 1e-10
        without = arm.accelerations(q, qd, tau, {})
        assert np.abs(qdd - without).max() > 0.1, "and it matters"


@pytest.mark.parametrize(
    ("axes", "tau"),
    [
        # the bar, 1 m along x and turned by 30 degrees about z; force (2, 5, 3) N at its tip, moment (7, 8, 4) N*m
        ("world", -(np.cos(np.pi / 6) * 5.0 - np.sin(np.pi / 6) * 2.0 + 4.0)),
        ("link", -(5.0 + 4.0)),
    ],
)
def test_a_locked_joint_takes_what_statics_says(tmp_path: Path, axes: str, tau: float) -> None:
    run = f"""\
servo lock {{ model = locked; }}
run it {{
    arm = swing;  servos {{ hinge = lock; }}  initial {{ hinge.q = 30 deg; }}
    environment {{ hang = wrench {{ link = bar; force = [2, 5, 3] N; moment = [7, 8, 4] N*m; point = [1, 0, 0] m; axes = {axes}; }} }}
    rates {{ dynamics = 10 Hz; }}  duration = 0.1 s;  record = [tau];
}}
"""
    found = engine.run(experiment(tmp_path, ARM, run)).signals["tau"][0, :, 0]
    assert found == pytest.approx([tau, tau], rel=1e-14)  # some roundings of sine, cosine and products


SLIDER = """\
arm rail {
    link block { mass = 2 kg; shape = sphere(radius = 0.1 m); }
    joint slide prismatic { parent = base; child = block; axis = x; }
}
run it {
    arm = rail;
    environment { push = wrench { link = block; force = [6, 0, 0] N; from = 0.2 s; until = 0.5 s; } }
    rates { dynamics = 100 Hz; record = 100 Hz; }  integrator = modified_euler;  duration = 1 s;  record = [q, qd, qdd];
}
"""


@pytest.mark.parametrize("integrator", ["modified_euler", "midpoint", "rk4"])
def test_a_window_that_begins_and_ends_with_steps_is_met_exactly(tmp_path: Path, integrator: str) -> None:
    found = engine.run(experiment(tmp_path, changed(SLIDER, ("modified_euler", integrator))))
    t = found.time
    rate = 3.0 * np.clip(t - 0.2, 0.0, 0.3)
    place = np.where(t < 0.5, 1.5 * np.clip(t - 0.2, 0.0, None) ** 2, 1.5 * 0.09 + 0.9 * (t - 0.5))
    # a step's share of the window is one but for 1e-16 s, the rounding of t, over the step of 0.01 s
    np.testing.assert_allclose(found.signals["qd"][0, :, 0], rate, rtol=0, atol=1e-13)
    np.testing.assert_allclose(found.signals["q"][0, :, 0], place, rtol=0, atol=1e-13)
    pushed = found.signals["qdd"][0, :, 0]
    assert (pushed[:20] == 0.0).all() and (pushed[50:] == 0.0).all()
    np.testing.assert_allclose(pushed[20:50], 3.0, rtol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize(("begin", "end"), [(0.2013, 0.5), (0.2, 0.4991), (0.2013, 0.4987), (0.2032, 0.2071)])
def test_a_window_between_steps_gives_its_impulse_and_is_off_by_the_step_squared(
    tmp_path: Path, begin: float, end: float
) -> None:
    text = changed(SLIDER, ("from = 0.2 s", f"from = {begin} s"), ("until = 0.5 s", f"until = {end} s"))
    found = engine.run(experiment(tmp_path, text))
    rate, place = found.signals["qd"][0, -1, 0], found.signals["q"][0, -1, 0]
    assert rate == pytest.approx(3.0 * (end - begin), abs=1e-13)
    exact = 3.0 * ((end - begin) ** 2 / 2.0 + (end - begin) * (1.0 - end))
    # a share s of a step h, its acceleration a spread over all of it: off by a s (h - s)/2, a h^2/8 at most at each end
    assert abs(place - exact) < 2.0 * 3.0 * 0.01**2 / 8.0


def test_a_window_that_ends_before_it_begins_is_none(tmp_path: Path) -> None:
    text = changed(SLIDER, ("from = 0.2 s; until = 0.5 s", "from = 0.5 s; until = 0.2 s"))
    assert (engine.run(experiment(tmp_path, text)).signals["q"] == 0.0).all()


def test_it_acts_always_unless_told_otherwise(tmp_path: Path) -> None:
    text = changed(SLIDER, (" from = 0.2 s; until = 0.5 s;", ""))
    assert (engine.run(experiment(tmp_path, text)).signals["qdd"] == 3.0).all()


def test_numbers_of_it_that_a_slider_does_not_feel_do_not_vary(tmp_path: Path) -> None:
    turning = "vary environment.push.point.y = [0, 1, 2] m; vary environment.push.moment.z = [0, 1] N*m;"
    sweep = f"sweep some of it {{ {turning} }}"
    assert [d.code for d in check(tmp_path, SLIDER, sweep, select=["some"]).diagnostics] == ["D137", "D137"]


def test_every_number_of_it_varies_with_the_case(tmp_path: Path) -> None:
    sweep = """\
sweep some of it {
    zip {
        environment.push.force.x = [6, 6, 12] N;
        environment.push.from    = [0.2, 0.4, 0.2] s;
        environment.push.until   = [0.5, 0.5, 0.3] s;
    }
}
"""
    found = engine.run(experiment(tmp_path, SLIDER, sweep, select=["some"])).signals["qd"][:, -1, 0]
    np.testing.assert_allclose(found, [0.9, 0.3, 0.6], rtol=1e-12)  # rounding over 30 steps


def test_a_link_that_is_not_there_is_told(tmp_path: Path) -> None:
    assert (
        messages(check(tmp_path, changed(SLIDER, ("link = block", "link = bloc"))))
        == """\
error[D159]: no link `bloc` in arm `rail`
 --> deck.ic:7:42
  |
7 |     environment { push = wrench { link = bloc; force = [6, 0, 0] N; from = 0.2 s; until = 0.5 s; } }
  |                                          ^^^^
  = help: did you mean `block`?
  = help: links: block

1 error
"""
    )


def test_axes_are_the_worlds_or_the_links(tmp_path: Path) -> None:
    assert (
        messages(check(tmp_path, changed(SLIDER, ("from = 0.2 s", "axes = wold"))))
        == """\
error[D076]: `axes` of environment `push` cannot be `wold`
 --> deck.ic:7:77
  |
7 |     environment { push = wrench { link = block; force = [6, 0, 0] N; axes = wold; until = 0.5 s; } }
  |                                                                             ^^^^
  = help: did you mean `world`?
  = help: one of: world, link

1 error
"""
    )
