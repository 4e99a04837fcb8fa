"""A bushing between two frames: what its energy asks for, momentum, and its energy along a run."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.environments.bushing import ENVIRONMENT, loads, restoring
from met.integrators import INTEGRATORS
from met.integrators.integrator import Integrator
from met.plan import Experiment
from met.run import Prepared
from met.trace import Formulas, Graph
from met.vectors import rotation_about, rotation_rpy, rotation_vector
from tests.ic.small_decks import changed, check, experiment
from tests.met.environments.energies import Placed, order_of_loss
from tests.met.environments.test_spring import RAIL, pair
from tests.met.environments.worlds import given

STIFFNESS = (40.0, 90.0, 15.0)
VALUES = {
    "link": "one", "to": "two", "at": (0.3, -0.1, 0.2), "rpy": (0.2, -0.4, 1.1), "to_at": (-0.2, 0.4, 0.1),
    "to_rpy": (1.3, 0.2, -0.6), "stiffness": (100.0, 300.0, 50.0), "damping": (2.0, 5.0, 1.0), "turning": STIFFNESS,
    "turning_damping": (0.4, 0.2, 0.9),
}  # fmt: skip


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.05, 0.0999, 0.1001, 1.0, 2.5, 3.1])
def test_the_moment_is_what_its_energy_falls_by(angle: float) -> None:
    """-d(phi' K phi/2) for a small turn about each of the other frame's axes, by a central difference."""
    rng = np.random.default_rng(int(1e4 * angle))
    axis = rng.standard_normal(3)
    R = np.array(rotation_about(tuple(axis / np.linalg.norm(axis)), angle))
    found = np.array(restoring(STIFFNESS, tuple(map(tuple, R))))

    def energy(turn: np.ndarray) -> float:
        phi = np.array(rotation_vector(tuple(map(tuple, turn))))
        return float(phi @ (np.array(STIFFNESS) * phi) / 2.0)

    d = 1e-5
    for k in range(3):
        e = np.eye(3)[k]
        ahead, back = (np.array(rotation_about(tuple(e), s)) @ R for s in (d, -d))
        # of a difference of energies up to 400 J: 1e-13/1e-5 of rounding, and d^2 of the third derivative
        assert found[k] == pytest.approx(-(energy(ahead) - energy(back)) / (2 * d), abs=2e-7)


def test_for_small_angles_it_is_stiffness_times_angle() -> None:
    phi = np.array([1e-6, -2e-6, 3e-6])
    R = rotation_about(tuple(phi / np.linalg.norm(phi)), float(np.linalg.norm(phi)))
    np.testing.assert_allclose(restoring(STIFFNESS, R), -np.array(STIFFNESS) * phi, rtol=1e-5)


def test_both_links_feel_opposite_wrenches_on_one_line() -> None:
    world = pair()
    one, two = loads(given(ENVIRONMENT, **VALUES), world).forces
    np.testing.assert_array_equal(np.add(one.force, two.force), 0.0)
    total = sum(np.cross(world.position(f.link, f.point), f.force) + np.array(f.moment) for f in (one, two))
    np.testing.assert_allclose(total, 0.0, atol=1e-13 * np.linalg.norm(one.force))


def test_it_is_the_springs_of_its_axes_and_takes_energy_by_its_damping_alone() -> None:
    """Force and moment along the other frame's axes from the motion of one against the other, by hand."""
    world = pair()
    p = given(ENVIRONMENT, **VALUES)
    other = world._link("two").R @ np.array(rotation_rpy(*p.to_rpy))
    own = world._link("one").R @ np.array(rotation_rpy(*p.rpy))
    apart = np.subtract(world.position("one", p.at), world.position("two", p.to_at))
    seen = np.subtract(
        world.velocity("one", p.at),
        np.add(
            world._link("two").v,
            np.cross(world._link("two").w, np.subtract(world.position("one", p.at), world._link("two").p)),
        ),
    )
    spin = np.subtract(world._link("one").w, world._link("two").w)
    one, two = loads(p, world).forces
    force = -other @ (np.array(p.stiffness) * (other.T @ apart) + np.array(p.damping) * (other.T @ seen))
    np.testing.assert_allclose(one.force, force, rtol=1e-13)
    moment = other @ np.array(restoring(p.turning, tuple(map(tuple, other.T @ own))))
    moment -= other @ (np.array(p.turning_damping) * (other.T @ spin))
    np.testing.assert_allclose(one.moment, moment, rtol=1e-12)
    power = sum(
        np.dot(f.force, world.velocity(f.link, f.point)) + np.dot(f.moment, world.rate(f.link)) for f in (one, two)
    )
    felt = seen @ np.array(one.force) + spin @ np.array(one.moment)
    assert power == pytest.approx(felt, rel=1e-12), "nothing is gained but by the motion of one against the other"


def test_recorded_it_computes_the_same() -> None:
    graph = Graph()
    names = [f"r{i}{j}" for i in range(3) for j in range(3)]
    entries = [graph.input(name) for name in names]
    recorded = Formulas.of(graph, restoring(STIFFNESS, (tuple(entries[:3]), tuple(entries[3:6]), tuple(entries[6:]))))  # type: ignore[arg-type]
    for angle in (0.0, 1e-8, 0.09, 0.11, 2.0, math.pi):
        R = rotation_about((0.6, 0.0, 0.8), np.float64(angle))
        found = recorded.replay(dict(zip(names, [float(x) for row in R for x in row], strict=True)))
        np.testing.assert_allclose(found, restoring(STIFFNESS, R), rtol=0, atol=2e-12)  # 100 N m to some roundings


MODEL = """\
    mount = bushing { link = side; at = [0.1, 0.2, 0] m; rpy = [0.1, 0.2, 0.3] rad; to = tool;
                      to_at = [0, 0.1, 0.3] m; to_rpy = [-0.3, -1.2, 0] rad; stiffness = [100, 60, 30] N/m;
                      turning = [12, 30, 6] N*m/rad; }
"""


def held(links: Placed) -> float:
    side, tool = links["side"], links["tool"]
    other = tool.R @ np.array(rotation_rpy(-0.3, -1.2, 0.0))
    x = other.T @ (side.p + side.R @ [0.1, 0.2, 0.0] - tool.p - tool.R @ [0.0, 0.1, 0.3])
    own = side.R @ np.array(rotation_rpy(0.1, 0.2, 0.3))
    phi = np.array(rotation_vector(tuple(map(tuple, other.T @ own))))
    assert 0.3 < np.linalg.norm(phi) < 2.8, "large, and short of half a turn"
    return float(x @ (np.array([100.0, 60.0, 30.0]) * x) + phi @ (np.array([12.0, 30.0, 6.0]) * phi)) / 2.0


@pytest.mark.release
@pytest.mark.parametrize("integrator", [each for each in INTEGRATORS if each.order > 1], ids=lambda each: each.name)
def test_with_what_it_holds_energy_is_kept_to_the_integrators_order(tmp_path: Path, integrator: Integrator) -> None:
    """Stiffnesses that differ and large angles: kept, since the moment is that of the energy at any angle."""
    assert order_of_loss(tmp_path, MODEL, held, integrator.name) > integrator.order - 0.15


def test_one_that_holds_nothing_is_told(tmp_path: Path) -> None:
    text = RAIL.replace("pull = spring", "mount = bushing").replace("to_point = [-1, 0, 0] m; ", "")
    text = text.replace("stiffness = 50 N/m; length = 1 m; damping = 4 N*s/m;", "")
    assert [d.code for d in check(tmp_path, text).diagnostics] == ["D168"]


LATCH = RAIL.replace("pull = spring", "latch = bushing").replace("to_point = [-1, 0, 0] m; ", "").replace(
    "stiffness = 50 N/m; length = 1 m; damping = 4 N*s/m;", "stiffness = [50, 0, 0] N/m; TIMING"
)  # fmt: skip
TIMING = ("environment.latch.from", "environment.latch.until", "environment.latch.ramp")


def latched(folder: Path, timing: str, *parts: str, select: list[str] | None = None) -> Experiment:
    return experiment(folder, LATCH.replace("TIMING", timing), *parts, select=select)


def test_a_plan_has_a_window_and_a_ramp_only_where_a_deck_sets_them(tmp_path: Path) -> None:
    plain, written = latched(tmp_path, ""), latched(tmp_path, "from = 0 s; ramp = 0 s;")
    assert not {*TIMING} & {*plain.parameters} and {*written.parameters} - {*plain.parameters} == {TIMING[0], TIMING[2]}
    assert Prepared(plain).code_key == Prepared(written).code_key, "and what always acts costs nothing"


def test_a_ramp_that_a_deck_leaves_out_may_still_vary(tmp_path: Path) -> None:
    sweep = "sweep closing of it { vary environment.latch.ramp = [0, 0.5] s; }"
    found = engine.run(latched(tmp_path, "", sweep, select=["closing"]))
    plain, slow = (engine.run(latched(tmp_path, each)) for each in ("", "ramp = 0.5 s;"))
    for case, alone in enumerate((plain, slow)):
        np.testing.assert_allclose(found.signals["q"][case], alone.signals["q"][0], rtol=1e-12, atol=1e-15)
    assert np.ptp(plain.signals["q"]) > 1e-3 < np.abs(plain.signals["q"] - slow.signals["q"]).max()


def test_it_acts_within_its_window_and_its_force_is_a_channel(tmp_path: Path) -> None:
    text = changed(
        LATCH,
        ("record = [q, qd]", "record = [q, environment.latch.force]"),
        ("slide.q = 0.5 m", "slide.q = -0.5 m; slide.qd = 1 m/s"),
    )
    found = engine.run(experiment(tmp_path, text.replace("TIMING", "from = 0.3 s; until = 0.7 s; ramp = 0.2 s;")))
    force, q, t = found.signals["environment.latch.force"][0], found.signals["q"][0, :, 0], found.time
    share = np.where(t < 0.7 - 1e-9, np.clip((t - 0.3) / 0.2, 0.0, 1.0), 0.0)
    np.testing.assert_allclose(force[:, 0], -50.0 * share * q, rtol=1e-9, atol=1e-12)
    assert np.ptp(force[:, 0]) > 0.1 and not force[:, 1:].any()


def test_steps_are_checked_at_its_full_strength(tmp_path: Path) -> None:
    stiff = LATCH.replace("stiffness = [50, 0, 0] N/m", "stiffness = [5e9, 0, 0] N/m")
    for timing in ("", "from = 0.5 s; ramp = 0.1 s;"):
        assert [each.code for each in check(tmp_path, stiff.replace("TIMING", timing)).diagnostics] == ["D317"], timing
