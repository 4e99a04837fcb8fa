"""A body that is held in an attitude: the moment itself, and the damped oscillator that it is for small angles."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from met import run as engine
from met.dynamics.spatial import rotation_about, rotation_rpy
from met.environments.attitude_hold import ENVIRONMENT, loads
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, experiment, messages

DECK = """\
arm top { link base { mass = 3 kg; inertia = [2, 3, 4] kg*m^2; } }
run it {
    arm = top;  base = free;  integrator = rk4;
    initial {
        base.rpy  = [0.0001, -0.0002, 0.0003] rad;
        base.rate = [0.0002, 0, -0.0001] rad/s;
    }
    environment { h = attitude_hold { stiffness = [8,9,10] N*m/rad; damping = [2, 12, 1] N*m*s/rad; axes = link; } }
    rates { dynamics = 200 Hz; record = 10 Hz; }
    duration = 5 s;
    record = [links.base.orientation, links.base.rate];
}
"""


def oscillator(J: float, k: float, d: float, x: float, v: float, t: np.ndarray) -> np.ndarray:
    """J x'' + d x' + k x = 0, under or over critical damping."""
    a = d / (2.0 * J)
    root = np.sqrt(complex(a * a - k / J))
    first = (v + (a + root) * x) / (2.0 * root)
    return np.real(first * np.exp((root - a) * t) + (x - first) * np.exp((-root - a) * t))


@pytest.mark.slow
@pytest.mark.parametrize("axes", ["link", "world"])
def test_small_angles_about_each_axis_are_a_damped_oscillator(tmp_path: Path, axes: str) -> None:
    run = engine.run(experiment(tmp_path, changed(DECK, ("axes = link", f"axes = {axes}"))))
    angles = 2.0 * run.signals["links.base.orientation"][0, :, 1:]
    start, rate = (1e-4, -2e-4, 3e-4), (2e-4, 0.0, -1e-4)
    for i, (J, k, d) in enumerate(((2.0, 8.0, 2.0), (3.0, 9.0, 12.0), (4.0, 10.0, 1.0))):
        expected = oscillator(J, k, d, start[i], rate[i], run.time)
        # the axes touch by products of angles of 3e-4
        np.testing.assert_allclose(angles[:, i], expected, rtol=0, atol=3e-7)


@pytest.mark.slow
def test_it_turns_a_body_from_anywhere_to_where_it_is_wanted(tmp_path: Path) -> None:
    limited = "rpy = [20, 30, -50] deg; limit = [0.5, 0.6, 0.7] N*m; damping = [3, 4, 5] N*m*s/rad"
    far = ("[0.0001, -0.0002, 0.0003] rad", "[100, -40, 150] deg")
    text = changed(
        DECK,
        far,
        ("duration = 5 s", "duration = 60 s"),
        ("damping = [2, 12, 1] N*m*s/rad; ", ""),
        ("axes = link", limited),
    )
    run = engine.run(experiment(tmp_path, text))
    R = np.array(rotation_rpy(*np.radians([20.0, 30.0, -50.0])), float)
    w, x, y, z = run.signals["links.base.orientation"][0, -1]
    found = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    np.testing.assert_allclose(found, R, rtol=0, atol=1e-5)


def moment(R: np.ndarray, rate: tuple[float, ...], **given: object) -> np.ndarray:
    """What it asks of a link with this orientation, world axes."""
    world = SimpleNamespace(
        orientation=lambda link: tuple(map(tuple, R)),
        rate=lambda link: rate,
        to_world=lambda link, vector: tuple(map(float, R @ np.array(vector, float))),
    )
    p = {parameter.name: parameter.default for parameter in ENVIRONMENT.parameters} | given
    (force,) = loads(SimpleNamespace(**p), world).forces
    assert force.link == "base"
    return np.array(force.moment, float)


@pytest.mark.parametrize("angle", [1e-9, 0.5, 2.0, 3.1, -3.1])
@pytest.mark.parametrize("axes", ["link", "world"])
def test_the_moment_is_along_the_axis_of_the_error(angle: float, axes: str) -> None:
    n = np.array([2.0, -1.0, 2.0]) / 3.0
    wanted = np.array(rotation_rpy(0.3, -0.4, 0.5), float)
    R = np.array(rotation_about(tuple(n), angle), float) @ wanted  # n in world axes
    found = moment(R, (0.0, 0.0, 0.0), rpy=(0.3, -0.4, 0.5), stiffness=(5.0, 5.0, 5.0), axes=axes)
    np.testing.assert_allclose(found, -5.0 * 2.0 * math.sin(angle / 2.0) * n, rtol=1e-6 if angle < 1e-6 else 1e-13)


def test_damping_and_limit_are_along_the_links_axes_or_the_worlds() -> None:
    R = np.array(rotation_rpy(0.0, 0.0, math.pi / 2), float)
    for axes, expected in (("link", (-2.0, -0.5, 0.0)), ("world", (-1.0, -0.8, 0.0))):
        found = moment(
            R,
            (1.0, 0.5, 0.0),
            rpy=(0.0, 0.0, math.pi / 2),
            damping=(1.0, 2.0, 3.0),
            limit=(math.inf, 0.8 if axes == "world" else math.inf, 1.0),
            axes=axes,
        )
        np.testing.assert_allclose(found, expected, atol=1e-15)


def test_a_rate_that_is_no_number_is_not_hidden_by_the_limit() -> None:
    found = moment(np.eye(3), (math.nan, 0.0, 0.0), damping=(1.0, 1.0, 1.0), limit=(1.0, 1.0, 1.0))
    assert math.isnan(found[0])


def test_one_that_holds_nothing_is_told(tmp_path: Path) -> None:
    text = changed(DECK, ("stiffness = [8,9,10] N*m/rad; damping = [2, 12, 1] N*m*s/rad; ", ""))
    assert (
        messages(check(tmp_path, text))
        == """\
warning[D168]: environment `h` never acts: it has neither stiffness nor damping
 --> deck.ic:8:19
  |
8 |     environment { h = attitude_hold { axes = link; } }
  |                   ^
  = help: change that, or leave it out

1 warning
"""
    )


def test_one_on_a_base_that_does_not_yield_is_told(tmp_path: Path) -> None:
    told_of = DECK[DECK.index("        base.rpy") : DECK.index("    environment")]
    text = changed(
        DECK,
        ("base = free;", "base = prescribed { yaw = sine(amplitude = 1 deg, frequency = 1 Hz); };"),
        (told_of, "    }\n"),
    )
    assert (
        messages(check(tmp_path, text))
        == """\
warning[D256]: environment `h` changes nothing: link `base` moves as it is told
 --> deck.ic:6:19
  |
6 |     environment { h = attitude_hold { stiffness = [8,9,10] N*m/rad; damping = [2, 12, 1] N*m*s/rad; axes = link; } }
  |                   ^
  = help: write `base = free;` in the run, or name a link that a joint moves

1 warning
"""
    )


def test_one_on_a_base_that_is_no_link_is_told_where_it_stands(tmp_path: Path) -> None:
    held = changed(RUN, ("duration", "environment { h = attitude_hold { stiffness = [1, 1, 1] N*m/rad; } }  duration"))
    assert (
        messages(check(tmp_path, ARM, SERVO, held))
        == """\
error[D159]: no link `base` in arm `swing`
  --> deck.ic:15:19
   |
15 |     environment { h = attitude_hold { stiffness = [1, 1, 1] N*m/rad; } }  duration = 1 s;
   |                   ^
   = help: links: bar
   = help: the base is a link where it moves: `base = free;` in the run

1 error
"""
    )
