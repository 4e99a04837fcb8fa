"""Booms against closed forms of beams: statics, modes, large bends; starts, energy, momentum and what runs record."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from ic.meaning.mechanics.booms import node_places
from met import run as engine
from met.analysis.linear.answers import LinearQuestion
from tests.ic.small_decks import changed, experiment

BOOM = """\
#include <servos/locked.ic>
arm crane {
    link jib boom {
        mass = 1 kg;  shape = cylinder(radius = 1 mm, length = 1 m, along = x);
        EI = 1 N*m^2;  GJ = 10 N*m^2;  damping_ratio = 0;
    }
    link load { mass = 0 kg; }
    joint root revolute { parent = base;  child = jib;  axis = z; }
    joint end fixed { parent = jib;  child = load;  at = [1, 0, 0] m; }
}
servo bearing { model = passive; }
run hang {
    arm = crane;
    servos { root = locked; }
    rates { dynamics = 10 kHz;  record = 100 Hz; }
    integrator = rk4;
    duration = 1 s;
    record = [q, links.jib.bend, links.jib.deflection];
}
"""
LOADED = ("mass = 0 kg;", "mass = 10 kg;  inertia = [0.9, 0.9, 0.9] kg*m^2;")
HINGED = ("root = locked", "root = bearing")
EIGHT = ("damping_ratio = 0;", "damping_ratio = 0;  nodes = 8;")
FREE = (
    ("joint root revolute { parent = base;  child = jib;  axis = z; }",
     "joint root fixed { parent = base;  child = jib; }"),
    ("servos { root = locked; }", "base = free;"),
)  # fmt: skip


def natural(folder: Path, *changes: tuple[str, str]) -> np.ndarray:
    """The natural frequencies of the boom, rad/s, each once."""
    found = LinearQuestion(experiment(folder, changed(BOOM, *changes))).of(0)
    rates = 2.0 * math.pi * np.array([pole.hz for pole in found.natural])
    return rates[np.append(True, np.diff(rates) > 1e-6 * rates[1:])]


def roots(function: Callable[[float], float], count: int) -> np.ndarray:
    """Squares of the first positive zeros."""
    steps = np.linspace(1e-3, 14.0, 3000)
    signs = np.sign([function(x) for x in steps])
    found = [brentq(function, *steps[i : i + 2]) for i in np.flatnonzero(signs[1:] * signs[:-1] < 0)]
    return np.square(found[:count])


@pytest.mark.parametrize("nodes", [2, 4, 8])
def test_a_load_on_the_tip_bends_the_chain_as_a_beam(nodes: int) -> None:
    """Deflection under force 1/3 and under moment 1/2, slope 1/2 and 1, in units of the beam: to rounding."""
    arms, share = 1.0 - np.array(node_places(nodes)), 1.0 / nodes
    assert (share * arms**2).sum() == pytest.approx(1.0 / 3.0, rel=1e-15)
    assert (share * arms).sum() == pytest.approx(0.5, rel=1e-15)


@pytest.mark.slow
def test_a_balanced_boom_begins_bent_by_its_load_and_stays(tmp_path: Path) -> None:
    small = changed(
        BOOM,
        (
            "    rates",
            "    environment { gravity = [0, 0, -1e-6] m/s^2; }\n    initial { servos = balanced; }\n    rates",
        ),
        LOADED,
    )
    run = engine.run(experiment(tmp_path, small))
    dip, turn = run.signals["links.jib.deflection"][0, :, 2], run.signals["links.jib.bend"][0, :, 1]
    assert dip == pytest.approx(-1e-6 * (10.0 / 3.0 + 1.0 / 8.0), rel=2e-3)  # of its own weight to what 4 nodes give
    assert np.ptp(dip) < 1e-12 * abs(dip[0]) and turn == pytest.approx(-1.5 * dip, rel=0.02)
    heavier = changed(small, ("mass = 10 kg", "mass = 1e7 kg"), ("-1e-6] m/s^2", "-1e-12] m/s^2"))
    run = engine.run(experiment(tmp_path, heavier))
    assert run.signals["links.jib.deflection"][0, 0, 2] == pytest.approx(-1e-5 / 3.0, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("nodes", "shares"), [(4, [3e-4, 0.03]), (8, [1e-4, 5e-4, 7e-3])])
def test_modes_of_a_clamped_boom(tmp_path: Path, nodes: int, shares: list[float]) -> None:
    exact = roots(lambda b: 1.0 / math.cosh(b) + math.cos(b), len(shares))
    found = natural(tmp_path, ("damping_ratio = 0;", f"damping_ratio = 0;  nodes = {nodes};"))
    assert (np.abs(found[: len(shares)] / exact - 1.0) < shares).all()


def test_modes_of_a_boom_with_a_body_at_its_tip(tmp_path: Path) -> None:
    """Clamped, and a body of 10 times its mass with a radius of gyration of 0.3 of its length, about the tip."""
    mu, inertia = 10.0, 0.9

    def determinant(b: float) -> float:
        c, s, ch, sh = math.cos(b), math.sin(b), math.cosh(b), math.sinh(b)
        moment = [-c - ch + inertia * b**3 * (s + sh), -s - sh - inertia * b**3 * (c - ch)]
        force = [s - sh + mu * b * (c - ch), -c - ch + mu * b * (s - sh)]
        return (moment[0] * force[1] - moment[1] * force[0]) / ch**2

    assert natural(tmp_path, LOADED)[:2] == pytest.approx(roots(determinant, 2), rel=2e-4)


@pytest.mark.slow
def test_modes_of_a_hinged_boom_and_of_one_that_flies(tmp_path: Path) -> None:
    (hinged,) = roots(lambda b: math.sin(b) - math.cos(b) * math.tanh(b), 1)
    assert natural(tmp_path, HINGED, EIGHT)[1] == pytest.approx(hinged, rel=5e-4)
    (flying,) = roots(lambda b: math.cos(b) - 1.0 / math.cosh(b), 1)
    assert natural(tmp_path, *FREE, EIGHT)[0] == pytest.approx(flying, rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("rate", [1.0, 3.0])
def test_turning_stiffens_a_boom(tmp_path: Path, rate: float) -> None:
    """Out of the plane by 1.193 times the square of the rate, Southwell's coefficient of the first mode."""
    begins = ("    rates", f"    initial {{ root.qd = {rate} rad/s; }}\n    rates")
    still, turning = natural(tmp_path, HINGED, EIGHT)[0], natural(tmp_path, HINGED, EIGHT, begins)[0]
    assert (turning**2 - still**2) / rate**2 == pytest.approx(1.193, rel=0.01)


def test_torsion_under_a_body(tmp_path: Path) -> None:
    """One spring of GJ/L under a body whose inertia is far above the boom's."""
    rates = natural(tmp_path, LOADED)
    assert np.abs(rates / math.sqrt(10.0 / 0.9) - 1.0).min() < 1e-4


PULLED = (
    ("    rates", "    environment { pull = wrench { link = load;  force = [0, 0, -1] N; } }\n    rates"),
    ("    rates", "    initial { servos = balanced; }\n    rates"),
    ("duration = 1 s", "duration = 1 ms"),
    ("record = 100 Hz", "record = 1 kHz"),
)


@pytest.mark.slow
@pytest.mark.parametrize(("angle", "load"), [(0, 2.0), (80, 2.0), (-60, 2.0), (-80, 1.0), (20, 4.0)])
def test_a_soft_boom_is_found_at_rest(tmp_path: Path, angle: float, load: float) -> None:
    """Under up to four times EI/L^2."""
    text = changed(
        BOOM,
        ("    rates", "    environment { gravity = [0, 0, -1] m/s^2; }\n    rates"),
        ("    rates", f"    initial {{ root.q = {angle} deg;  servos = balanced; }}\n    rates"),
        ("axis = z;", "axis = -y;"),
        ("mass = 0 kg;", f"mass = {load} kg;  inertia = [0.1, 0.1, 0.1] kg*m^2;"),
        ("mass = 1 kg;", "mass = 1 g;"),
        ("record = [q,", "record = [energy.kinetic, q,"),
        ("duration = 1 s", "duration = 0.1 s"),
    )
    run = engine.run(experiment(tmp_path, text))
    assert not run.cause[0] and run.signals["energy.kinetic"].max() < 1e-10


def test_a_boom_that_is_not_found_at_rest_fails(tmp_path: Path) -> None:
    heavy = changed(
        BOOM,
        ("    rates", "    environment { gravity = [0, 0, -1] m/s^2; }\n    rates"),
        ("    rates", "    initial { servos = balanced; }\n    rates"),
        ("mass = 0 kg;", "mass = 300 kg;  inertia = [0.1, 0.1, 0.1] kg*m^2;"),
    )
    assert "it cannot begin balanced: no bend was found" in engine.run(experiment(tmp_path, heavy)).cause[0]


@pytest.mark.slow
@pytest.mark.parametrize(("nodes", "share"), [(4, 2e-3), (8, 5e-4)])
def test_a_bent_boom_is_nearly_an_elastica(tmp_path: Path, nodes: int, share: float) -> None:
    """A force of EI/L^2 across the tip bends a beam to 0.30172 of its length."""
    text = changed(BOOM, *PULLED, ("damping_ratio = 0;", f"damping_ratio = 0;  nodes = {nodes};"))
    run = engine.run(experiment(tmp_path, text))
    assert run.signals["links.jib.deflection"][0, 0, 2] == pytest.approx(-0.30172, rel=share)


def test_a_boom_without_damping_keeps_its_energy_and_momentum(tmp_path: Path) -> None:
    text = changed(
        BOOM,
        *FREE,
        ("    rates", "    initial { jib_1y.q = 0.1 rad;  jib_3z.qd = 2 rad/s; }\n    rates"),
        ("record = [q,", "record = [energy.kinetic, energy.potential, momentum, q,"),
        ("GJ = 10 N*m^2", "GJ = 1e-3 N*m^2"),
        ("radius = 1 mm", "radius = 5 cm"),
    )
    run = engine.run(experiment(tmp_path, text))
    total = run.signals["energy.kinetic"][0] + run.signals["energy.potential"][0]
    assert np.ptp(total) < 1e-6 * np.ptp(run.signals["energy.kinetic"][0])
    for kind in ("linear", "angular"):
        np.testing.assert_allclose(np.ptp(run.signals[f"momentum.{kind}"][0], axis=0), 0.0, atol=1e-10)


@pytest.mark.slow
def test_cases_with_other_stiffness_are_as_runs_alone(tmp_path: Path) -> None:
    begun = changed(BOOM, ("    rates", "    initial { jib_1y.q = 0.1 rad; }\n    rates"), LOADED)
    swept = "sweep several of hang { vary links.jib.EI = [1, 3] N*m^2;  vary links.jib.shape.length = [0.8, 1] m; }"
    run = engine.run(experiment(tmp_path, begun + swept, select=["several"]))
    alone = changed(begun, ("EI = 1 N*m^2", "EI = 3 N*m^2"), ("length = 1 m", "length = 0.8 m"))
    expected = engine.run(experiment(tmp_path, alone)).signals
    for name in ("q", "links.jib.deflection"):
        np.testing.assert_allclose(run.signals[name][2], expected[name][0], rtol=1e-9, atol=1e-12)


def test_values_of_all_joints_are_without_springs_but_for_positions(tmp_path: Path) -> None:
    found = experiment(tmp_path, changed(BOOM, ("record = [q,", "record = [tau, q, jib_1y.tau,")))
    tau, q, one, *_ = found.structure.record
    assert (tau.joints, one.channels) == (("root",), ("jib_1y.tau",))
    assert set(q.joints) == {"root"} | found.structure.springs and len(q.joints) == 10


@pytest.mark.slow
def test_the_displacement_of_a_second_boom_is_what_both_bend_together(tmp_path: Path) -> None:
    """For small bends: the deflection of the first, the lever of its tip's angle, and the deflection of the second."""
    second = (
        "link fore boom { mass = 1 kg;  shape = cylinder(radius = 1 mm, length = 2 m, along = x);  "
        "EI = 1 N*m^2;  damping_ratio = 0; }"
    )
    two = changed(
        BOOM,
        ("    link load { mass = 0 kg; }", f"    {second}"),
        ("child = load;", "child = fore;"),
        ("root = locked", "* = locked"),
        (
            "    rates",
            "    initial { servos = balanced; }\n    environment { gravity = [0, 2e-5, -1e-5] m/s^2; }\n    rates",
        ),
        ("duration = 1 s", "duration = 10 ms"),
        (
            "[q, links.jib.bend,",
            "[q, links.jib.bend, links.fore.displacement, links.fore.deflection, links.jib.displacement,",
        ),
    )
    found = engine.run(experiment(tmp_path, two)).signals
    jib, fore, bend, both = (
        found[f"links.{name}"][0, -1] for name in ("jib.deflection", "fore.deflection", "jib.bend", "fore.displacement")
    )
    np.testing.assert_allclose(found["links.jib.displacement"][0, -1], jib, rtol=1e-9, atol=1e-15)
    lever = np.cross(bend, [2.0, 0.0, 0.0])
    np.testing.assert_allclose(both[1:], (jib + lever + fore)[1:], rtol=1e-3)
    assert np.abs(both[1:]).min() > 2.0 * np.abs(jib[1:]).max() > 1e-6
