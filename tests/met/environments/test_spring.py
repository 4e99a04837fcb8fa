"""A spring between two points: its law, its energy along a run, and a rope that does not push."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.environments.spring import ENVIRONMENT, loads
from met.integrators import INTEGRATORS
from met.integrators.integrator import Integrator
from tests.ic.small_decks import changed, check, experiment, messages
from tests.met.environments.energies import Placed, order_of_loss
from tests.met.environments.worlds import Given, Link, given, turned

A, B = (0.3, -0.1, 0.2), (-0.2, 0.4, 0.1)
VALUES = {"link": "one", "to": "two", "point": A, "to_point": B, "stiffness": 70.0, "damping": 9.0, "length": 0.8}


def pair(**moved: object) -> Given:
    return Given(
        {
            "one": Link(turned(1), (0.2, 0.5, -0.3), (0.3, -1.0, 0.4), (0.1, 0.0, -0.6)),
            "two": Link(turned(2), (1.4, -0.2, 0.9), (-0.7, 0.2, 0.5), (0.3, 0.9, 0.2)),
            **moved,  # type: ignore[dict-item]
        }
    )


def test_it_pulls_both_links_together_along_the_line_between_its_points() -> None:
    world = pair()
    way = np.subtract(world.position("two", B), world.position("one", A))
    d = np.linalg.norm(way)
    growing = way @ np.subtract(world.velocity("two", B), world.velocity("one", A)) / d
    expected = (70.0 * (d - 0.8) + 9.0 * growing) * way / d
    one, two = loads(given(ENVIRONMENT, **VALUES), world).forces
    np.testing.assert_allclose(one.force, expected, rtol=1e-13)
    np.testing.assert_array_equal(two.force, np.negative(one.force))
    assert (one.link, one.point, two.link, two.point) == ("one", A, "two", B)
    assert (*one.moment, *two.moment) == (0.0,) * 6


@pytest.mark.parametrize("length", [0.0, 0.8])
def test_where_its_points_are_in_one_place_it_does_nothing(length: float) -> None:
    p = given(ENVIRONMENT, **{**VALUES, "point": (0.0, 0.0, 0.0), "to_point": (0.0, 0.0, 0.0), "length": length})
    there = (1.0, 2.0, 3.0)
    one, _ = loads(p, pair(one=Link(p=there, v=(1.0, 0.0, 0.0)), two=Link(p=there))).forces
    assert one.force == (0.0, 0.0, 0.0)
    near = (1.0 + 1e-170, 2.0, 3.0)  # whose square is none
    assert np.isfinite(loads(p, pair(one=Link(p=there), two=Link(p=near))).forces[0].force).all()


def test_a_rope_neither_pushes_nor_holds_when_it_is_slack() -> None:
    rope = {**VALUES, "acts": "pull", "point": (0.0, 0.0, 0.0), "to_point": (0.0, 0.0, 0.0)}

    def tension(d: float, growing: float) -> float:
        world = pair(one=Link(), two=Link(p=(d, 0.0, 0.0), v=(growing, 0.0, 0.0)))
        return float(loads(given(ENVIRONMENT, **rope), world).forces[0].force[0])

    assert tension(1.0, 0.1) == pytest.approx(70.0 * 0.2 + 9.0 * 0.1, rel=1e-14)
    assert tension(1.0, -10.0) == 0.0, "it would push"
    assert tension(0.7, 10.0) == 0.0, "it is slack"
    assert math.isnan(tension(math.nan, 0.0))


MODEL = """\
    web = spring { link = side; point = [0.1, 0.2, 0] m; to = tool; to_point = [0, 0.1, 0.3] m;
                   stiffness = 400 N/m; length = 0.9 m; }
    tie = spring { link = boom; point = [0.5, 0, 0] m; to_point = [1, 1, 1] m; stiffness = 250 N/m; length = 1 m; }
"""


def held(links: Placed) -> float:
    def stretched(a: np.ndarray, b: np.ndarray, stiffness: float, length: float) -> float:
        return float(stiffness / 2.0 * (np.linalg.norm(b - a) - length) ** 2)

    side, tool, boom = (links[name] for name in ("side", "tool", "boom"))
    web = stretched(side.p + side.R @ [0.1, 0.2, 0.0], tool.p + tool.R @ [0.0, 0.1, 0.3], 400.0, 0.9)
    return web + stretched(boom.p + boom.R @ [0.5, 0.0, 0.0], np.ones(3), 250.0, 1.0)


@pytest.mark.release
@pytest.mark.parametrize("integrator", [each for each in INTEGRATORS if each.order > 1], ids=lambda each: each.name)
def test_with_what_springs_hold_energy_is_kept_to_the_integrators_order(tmp_path: Path, integrator: Integrator) -> None:
    assert order_of_loss(tmp_path, MODEL, held, integrator.name) > integrator.order - 0.15


RAIL = """\
arm rail {
    link block { mass = 2 kg; shape = sphere(radius = 0.1 m); }
    joint slide prismatic { parent = base; child = block; axis = x; }
}
run it {
    arm = rail;  initial { slide.q = 0.5 m; }
    environment {
        pull = spring { link = block; to_point = [-1, 0, 0] m; stiffness = 50 N/m; length = 1 m; damping = 4 N*s/m; }
    }
    integrator = rk4;  rates { dynamics = 1 kHz; record = 100 Hz; }  duration = 2 s;  record = [q, qd];
}
"""


def test_a_damped_slider_swings_as_it_must(tmp_path: Path) -> None:
    found = engine.run(experiment(tmp_path, RAIL))
    w, z = 5.0, 1.0  # sqrt(k/m), c/(2 m)
    wd = math.sqrt(w * w - z * z)
    q = 0.5 * np.exp(-z * found.time) * (np.cos(wd * found.time) + z / wd * np.sin(wd * found.time))
    # rk4: (w h)^4/120 a radian, 5e-12, for 10 rad
    np.testing.assert_allclose(found.signals["q"][0, :, 0], q, rtol=0, atol=5e-11)


def test_a_rope_lets_the_slider_go_at_the_rate_that_it_reached(tmp_path: Path) -> None:
    text = changed(RAIL, ("damping = 4 N*s/m;", "acts = pull;"))
    found = engine.run(experiment(tmp_path, text))
    # q = 0.5 cos(5 t) until it is slack, at t = pi/10; then with 2.5 m/s until it is taut on the other side, at -2 m
    slack = (found.time > 0.33) & (found.time < 0.33 + 0.7)
    # the stiffness jumps once, within a step: off by a step's share
    np.testing.assert_allclose(found.signals["qd"][0, slack, 0], -2.5, rtol=0, atol=1e-5)


def test_a_link_that_is_not_there_and_one_that_is_both_ends_are_told(tmp_path: Path) -> None:
    assert (
        messages(check(tmp_path, changed(RAIL, ("to_point = [-1, 0, 0] m", "to = blok"))))
        == """\
error[D159]: no link `blok` in arm `rail`
 --> deck.ic:8:44
  |
8 |         pull = spring { link = block; to = blok; stiffness = 50 N/m; length = 1 m; damping = 4 N*s/m; }
  |                                            ^^^^
  = help: did you mean `block`?
  = help: links: block
  = help: or `world`

1 error
"""
    )
    both = changed(RAIL, ("link = block; to_point", "link = block; to = block; to_point"))
    assert [d.code for d in check(tmp_path, both).diagnostics] == ["D168"]


def test_a_link_called_world_is_not_the_ground(tmp_path: Path) -> None:
    text = RAIL.replace("block", "world").replace("length = 1 m; damping = 4 N*s/m;", "")
    assert (
        messages(check(tmp_path, text))
        == """\
error[D159]: `world` is the ground here, and a link of arm `rail`
 --> deck.ic:8:32
  |
8 |         pull = spring { link = world; to_point = [-1, 0, 0] m; stiffness = 50 N/m;  }
  |                                ^^^^^
  = help: give the link another name

1 error
"""
    )


def test_ends_and_numbers_vary_with_the_case(tmp_path: Path) -> None:
    sweep = """\
sweep some of it {
    vary environment.pull.stiffness = [50, 200] N/m;
    vary environment.pull.to = [world, block];
}
"""
    compiled = check(tmp_path, RAIL, sweep, select=["some"])
    assert compiled.plan is not None and len(compiled.plan.experiments) == 2
