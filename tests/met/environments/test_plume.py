"""A plume on a plate: against the closed forms of a small plate and of large ones, by momentum, and in a run."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.environments.plume import ENVIRONMENT, loads, on_plate
from met.trace import Formulas, Graph
from tests.ic.small_decks import check, experiment, told
from tests.met.environments.worlds import Given, Link, given, turned

THRUST, EXPONENT = 110.0, 6.5
STEADY = {"thrust": THRUST, "exponent": EXPONENT, "link": "panel", "width": 1e-3, "height": 1e-3, "cells": 1.0}


def felt(link: Link, time: float = 0.0, step: float = 0.001, **values: object) -> tuple[np.ndarray, np.ndarray]:
    """Force and moment about the plate's middle, world axes."""
    p = given(ENVIRONMENT, **{**STEADY, **values})
    force = loads(p, Given({"panel": link}, begin=time, step=step)).forces[0]
    return np.array(force.force, float), np.array(force.moment, float)


def reflected(u: np.ndarray, N: np.ndarray, sigma: float) -> np.ndarray:
    """Momentum that gas of unit momentum along u leaves on a wall: Maxwell's, a share thrown back as by a mirror, the
    rest let go without speed."""
    mirrored = u - 2.0 * (u @ N) * N
    return u - (1.0 - sigma) * mirrored


@pytest.mark.parametrize("sigma", [0.0, 0.7, 1.0])
@pytest.mark.parametrize(("off_axis", "tilt", "far"), [
    (0.0, 0.0, 1.0), (10.0, 0.0, 2.5), (25.0, 40.0, 0.8), (50.0, -60.0, 4.0), (80.0, 15.0, 12.0),
])  # fmt: skip
def test_a_small_plate_takes_the_momentum_that_the_gas_leaves_on_it(
    off_axis: float, tilt: float, far: float, sigma: float
) -> None:
    """At five angles and distances: 2 q A s per unit momentum, with q as the source flow has it."""
    theta, beta = math.radians(off_axis), math.radians(tilt)
    R, nozzle = turned(int(off_axis)), np.array([0.3, -0.2, 0.9])
    axis, across = R[:, 0], R[:, 1]
    u = math.cos(theta) * axis + math.sin(theta) * across
    N = -math.cos(beta) * u + math.sin(beta) * R[:, 2]  # of the front: the gas comes in under the sine cos(tilt)
    x = np.cross(N, u + R[:, 1] * 0.3)
    x /= np.linalg.norm(x)
    link = Link(np.column_stack([x, np.cross(N, x), N]), nozzle + far * u)
    force, moment = felt(
        link, nozzle=tuple(nozzle), axis=tuple(3.0 * axis), sigma_n=sigma, sigma_t=sigma, share=0.9,
    )
    q = (EXPONENT + 2.0) * 0.9 * THRUST / (4.0 * math.pi) * math.cos(theta) ** EXPONENT / far**2
    expected = 2.0 * q * 1e-6 * math.cos(beta) * reflected(u, N, sigma)
    # a point of the plate stands for it, so all that differs is rounding
    np.testing.assert_allclose(force, expected, rtol=0, atol=1e-13 * np.linalg.norm(expected))
    assert np.linalg.norm(moment) == 0.0


def test_what_the_wall_lets_go_of_pushes_it_back() -> None:
    link = Link(np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, 2.0))
    straight = {"nozzle": (0.0, 0.0, 0.0), "axis": (0.0, 0.0, 1.0), "sigma_n": 0.8}
    cold, warm = felt(link, **straight)[0], felt(link, reemission=0.15, **straight)[0]
    q = (EXPONENT + 2.0) * THRUST / (4.0 * math.pi) / 4.0
    # Schaaf and Chambre: the re-emitted part of the pressure is sigma_n sqrt(pi) q s sqrt(Tw/T)/S, S the speed ratio
    assert warm[2] - cold[2] == pytest.approx(q * 1e-6 * 0.8 * math.sqrt(math.pi) * 0.15, rel=1e-12)


def test_hypersonic_free_molecular_flow_is_the_limit_of_what_it_is_at_any_speed() -> None:
    """Schaaf and Chambre's pressure at a speed ratio S that is large: what is left out falls with 1/S^2."""
    s, sigma, warmth = 0.6, 0.8, 2.0  # warmth: sqrt(Tw/T)

    def pressure(S: float) -> float:
        normal = S * s
        mirrored = (2 - sigma) / math.sqrt(math.pi) * normal + sigma / 2 * warmth
        other = (2 - sigma) * (normal**2 + 0.5) + sigma / 2 * math.sqrt(math.pi) * warmth * normal
        return (mirrored * math.exp(-(normal**2)) + other * (1 + math.erf(normal))) / S**2

    for S in (10.0, 20.0):
        u = np.array([math.sqrt(1 - s * s), 0.0, -s])
        p = given(ENVIRONMENT, **{**STEADY, "exponent": 0.0, "sigma_n": sigma, "reemission": warmth / S})
        force, _ = on_plate(p, tuple(-u), tuple(u))
        # of q and A: K = 1 at 1 m; the tangential part has no pressure
        assert -force[2] / 1e-6 == pytest.approx(pressure(S), abs=1.01 * (2 - sigma) / S**2)
        assert -force[2] / 1e-6 == pytest.approx(pressure(S) - (2 - sigma) / S**2, abs=1e-12)


def before(a: float, b: float, far: float, cells: int, **values: object) -> np.ndarray:
    """Force on a plate of sides a, b across the plume's axis."""
    link = Link(np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, far))
    return felt(link, nozzle=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), width=a, height=b, cells=cells, **values)[0]


def test_a_plate_that_takes_all_of_the_plume_takes_its_momentum() -> None:
    """(2 - sigma_n) share thrust, less what goes by: at most that outside of the cone that the plate holds."""
    for sigma in (0.0, 1.0):
        force = before(16.0, 16.0, 1.0, 100, sigma_n=sigma, share=0.8)
        lost = (1.0 / math.sqrt(1.0 + 64.0)) ** (EXPONENT + 2.0)
        # cells of 16 cm do: over the whole plane the derivatives of which the error is made cancel
        assert force[2] == pytest.approx((2.0 - sigma) * 0.8 * THRUST, rel=lost)
        assert np.abs(force[:2]).max() < 1e-12


def test_the_force_on_a_rectangle_goes_to_the_closed_form_as_cells_get_smaller() -> None:
    """n = 0 on a plate across the axis: 2 q s^2 of 1/r^2 is the view factor of a rectangle from a point below its
    middle, which Hottel gave in closed form; the error falls four times per halving."""
    a, b, far = 1.6, 1.0, 1.2
    X, Y = a / 2 / far, b / 2 / far
    quarter = (X / math.hypot(1, X) * math.atan(Y / math.hypot(1, X))
               + Y / math.hypot(1, Y) * math.atan(X / math.hypot(1, Y))) / (2 * math.pi)
    exact = 2.0 * (2.0 * THRUST / (4.0 * math.pi)) * math.pi * 4.0 * quarter
    errors = [abs(before(a, b, far, cells, exponent=0.0)[2] - exact) for cells in (4, 8, 16, 32)]
    print(errors)
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx(2.0, abs=0.1) and errors[-1] < 2e-4 * exact


def test_the_moment_is_that_of_all_the_plates_parts() -> None:
    """Against many small plates, in general position: force and moment about the same point."""
    R, p = turned(5), np.array([0.2, 1.1, 0.4])
    values = {"nozzle": (0.1, -0.3, -0.2), "axis": (0.1, 0.9, 0.4), "sigma_n": 0.9, "sigma_t": 0.6}
    values["sides"] = "both"
    force, moment = felt(Link(R, p), width=1.0, height=0.6, cells=3, **values)
    total, turning = np.zeros(3), np.zeros(3)
    for x in (-1 / 3, 0.0, 1 / 3):
        for y in (-0.2, 0.0, 0.2):
            arm = R @ np.array([x, y, 0.0])
            part = felt(Link(R, p + arm), width=1 / 3, height=0.2, **values)[0]
            total, turning = total + part, turning + np.cross(arm, part)
    np.testing.assert_allclose(force, total, rtol=0, atol=1e-13 * np.linalg.norm(total))
    np.testing.assert_allclose(moment, turning, rtol=0, atol=1e-13 * np.linalg.norm(turning))
    assert np.linalg.norm(turning) > 1e-3


def test_behind_the_nozzle_and_behind_the_plate_there_is_nothing() -> None:
    front = Link(np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, 2.0))
    straight = {"nozzle": (0.0, 0.0, 0.0), "axis": (0.0, 0.0, 1.0)}
    back = Link(np.eye(3), (0.0, 0.0, 2.0))
    assert (felt(back, **straight)[0] == 0.0).all()
    assert felt(back, **straight, sides="both")[0] == pytest.approx(felt(front, **straight)[0], rel=1e-15)
    straight["axis"] = (0.0, 0.0, -1.0)
    assert (felt(front, **straight)[0] == 0.0).all()
    straight["axis"] = (1.0, 0.0, 0.0)  # just in the nozzle's plane
    assert (felt(front, **straight)[0] == 0.0).all()


def test_at_the_nozzle_itself_the_force_is_finite() -> None:
    force, moment = felt(Link(), nozzle=(0.0, 0.0, 0.0), axis=(0.0, 0.0, -1.0), cells=3, width=0.1, height=0.1)
    assert np.isfinite([*force, *moment]).all()


def test_what_is_no_number_stays_none() -> None:
    assert np.isnan(felt(Link(p=(math.nan, 0.0, 1.0)), nozzle=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))[0]).all()


def test_the_thruster_pushes_its_own_link_where_it_is_told_to() -> None:
    p = given(ENVIRONMENT, **{**STEADY, "nozzle": (0.1, 0.0, 0.0), "axis": (0.0, 0.0, 2.0), "nozzle_link": "hull",
                              "reaction": "on"})  # fmt: skip
    R = turned(2)
    _, back = loads(p, Given({"panel": Link(), "hull": Link(R, (0.0, 0.0, -3.0))})).forces
    assert (back.link, back.point) == ("hull", (0.1, 0.0, 0.0))
    np.testing.assert_allclose(back.force, -THRUST * R[:, 2], rtol=0, atol=1e-13)


@pytest.mark.parametrize(("schedule", "fires"), [
    ({"from": 0.2, "until": 0.5}, lambda t: 0.2 <= t < 0.5),
    ({"switches": (0.1, 0.25, 0.3, 0.31, 0.6)}, lambda t: 0.1 <= t < 0.25 or 0.3 <= t < 0.31 or t >= 0.6),
    ({"from": 0.05, "period": 0.1, "duty": 0.3}, lambda t: t >= 0.05 and (t - 0.05) % 0.1 < 0.03),
    ({"from": 0.05, "until": 0.77, "period": 0.004, "duty": 0.25},
     lambda t: 0.05 <= t < 0.77 and (t - 0.05) % 0.004 < 0.001),
    ({"from": 0.05, "period": 0.1, "duty": 0.3, "switches": (0.0, 0.16, 0.3, 0.9)},
     lambda t: t >= 0.05 and (t - 0.05) % 0.1 < 0.03 and (t < 0.16 or 0.3 <= t < 0.9)),
])  # fmt: skip
def test_a_step_sees_the_share_of_it_in_which_the_thruster_fires(schedule, fires) -> None:  # type: ignore[no-untyped-def]
    """Steps that fit the schedule and steps that do not, some longer than a pulse, against a count of fine instants."""
    link = Link(np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, 2.0))
    straight = {"nozzle": (0.0, 0.0, 0.0), "axis": (0.0, 0.0, 1.0)}
    full = felt(link, **straight)[0][2]
    for step in (0.01, 0.0137, 0.09):
        for k in range(int(1.0 / step)):
            fine = (k * step) + step * (np.arange(1000) + 0.5) / 1000
            share = np.mean([fires(t) for t in fine])
            found = felt(link, time=k * step, step=step, **straight, **schedule)[0][2] / full
            # an instant more or less at each edge; 0.09/0.004 pulses have two edges each
            assert found == pytest.approx(share, abs=max(2.5e-3, step / 0.004 * 2.5e-3)), (step, k)


def test_recorded_it_computes_the_same() -> None:
    graph = Graph()
    numbers = {"x": 0.2, "y": -0.3, "z": 1.2, "n": 4.5, "period": 0.013, "duty": 0.4, "begin": 0.021}
    kept = {"cells": 2.0, "width": 0.5, "height": 0.4, "sides": "both", "reemission": 0.1}

    def outcome(one: dict) -> list:  # type: ignore[type-arg]
        p = given(ENVIRONMENT, **{**STEADY, **kept, "nozzle": (one["x"], one["y"], one["z"]), "axis": (0.0, 0.2, -1.0),
                                  "exponent": one["n"], "period": one["period"], "duty": one["duty"]})  # fmt: skip
        force = loads(p, Given({"panel": Link()}, begin=one["begin"], step=0.002)).forces[0]
        return [*force.force, *force.moment]

    recorded = Formulas.of(graph, outcome({name: graph.input(name) for name in numbers})).replay(numbers)
    plain = outcome({name: np.float64(value) for name, value in numbers.items()})
    # exp and log are expanded into primitives when recorded: some units in the last place
    assert [float(x) for x in recorded] == pytest.approx([float(x) for x in plain], rel=1e-13)


DECK = """\
arm sail {
    link panel { mass = 12 kg;  shape = box(size = [0.02, 2, 1] m, along = x); }
    joint hinge revolute { parent = base;  child = panel;  axis = z; }
}
run it {
    arm = sail;
    environment {
        jet = plume {
            link = panel;  at = [0, 0.6, 0] m;  rpy = [0, 90, 0] deg;  width = 1 m;  height = 0.8 m;
            nozzle = [3, 0.6, 0] m;  axis = [-1, 0, 0];  thrust = 20 N;  exponent = 8;  until = 0.5 s;
        }
    }
    rates { dynamics = 1 kHz; record = 10 Hz; }  duration = 1 s;  record = [qd, qdd, tau];
}
"""


def test_in_a_run_it_turns_the_panel_until_it_ends(tmp_path: Path) -> None:
    found = engine.run(experiment(tmp_path, DECK))
    assert found.cause == [""]
    qdd = found.signals["qdd"][0, :, 0]
    link = Link(np.eye(3))
    p = {"at": (0.0, 0.6, 0.0), "rpy": (0.0, math.pi / 2, 0.0), "width": 1.0, "height": 0.8, "cells": 4.0}
    force, moment = felt(link, **p, nozzle=(3.0, 0.6, 0.0), axis=(-1.0, 0.0, 0.0), thrust=20.0, exponent=8.0)
    turning = np.cross([0.0, 0.6, 0.0], force)[2] + moment[2]
    inertia = 12.0 * ((0.02**2 + 2.0**2) / 12.0 + 0.01**2)
    assert qdd[0] == pytest.approx(turning / inertia, rel=1e-12) and turning > 0.1
    assert (qdd[5:] == 0.0).all() and (qdd[:5] > 0.0).all()


def test_a_direction_that_is_none_and_cells_that_vary_are_told(tmp_path: Path) -> None:
    text = DECK.replace("axis = [-1, 0, 0]", "axis = [0, 0, 0]")
    assert [d.code for d in check(tmp_path, text).diagnostics] == ["D240"]
    sweep = "sweep some of it { vary environment.jet.cells = [2, 4]; }"
    assert told(check(tmp_path, DECK, sweep, select=["some"])) == """\
error[D122]: `environment.jet.cells` cannot vary
  --> deck.ic:15:25
   |
15 | sweep some of it { vary environment.jet.cells = [2, 4]; }
   |                         ^^^^^^^^^^^^^^^^^^^^^
   = help: it decides the program: write a run for each, and `sweep NAME = ONE + OTHER;`

1 error
"""


def test_a_plume_that_never_fires_is_told(tmp_path: Path) -> None:
    for written in ("until = 0 s", "switches = [2, 3] s", "from = 1 s", "switches = [0.1, 0.2] s;  from = 0.3 s"):
        text = DECK.replace("until = 0.5 s", written)
        assert [d.code for d in check(tmp_path, text).diagnostics] == ["D168"], written
