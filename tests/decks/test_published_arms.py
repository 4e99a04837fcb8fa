"""The arms of space and the Manutec r3 are their sources', move as Pinocchio's do, and meet their own requirements."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ic
from ic.text.files import LIBRARY
from met import run as engine
from met.dynamics.kinematics import link_motions
from met.plan import Experiment
from met.plan.channel import recordable
from met.program.system import System
from tests.oracles import published_arms as published
from tests.oracles.package import Package
from tests.oracles.published_arms import FOOT, INCH, POUND, SLUG, lacks, tensor

pin = Package("pinocchio")

EARTH = (0.0, 0.0, -9.81)
DEG = np.pi / 180.0

# of each run: its arm in Pinocchio, and the rotors' inertia
MOVES = {
    "shuttle_arm.ic shuttle_arm_reach": lambda: (published.model(published.SHUTTLE, held=1), np.zeros(6)),
    "station_arm.ic station_arm_reach": lambda: (published.model(published.STATION, held=1), np.zeros(7)),
    "ets_vii.ic ets_vii_reach": lambda: (published.model(published.ETS_VII), np.zeros(6)),
    "ets_vii.ic ets_vii_swing": lambda: (published.model(published.ETS_VII), np.zeros(6)),
    "manutec_r3.ic manutec_r3_move":
        lambda: (published.fixed_on(published.model(published.R3, EARTH), *published.R3_LOAD), published.R3_ROTORS),
    "manutec_r3.ic manutec_r3_library_move":
        lambda: (published.fixed_on(published.model(published.R3_LIBRARY, EARTH), *published.R3_LIBRARY_LOAD),
                 published.R3_ROTORS),
}  # fmt: skip
DRIVEN = ("shuttle_arm.ic shuttle_arm_driven", "station_arm.ic station_arm_driven")
SPACE = {  # limits of the joints: N m, rad/s, deg
    "shuttle_arm.ic": (published.SHUTTLE_EFFORT, published.SHUTTLE_RATE,
                       [(-177.4, 177.4), (0.0, 142.4), (-157.6, 0.0), *[(-116.4, 116.4)] * 2, (-442.0, 442.0)]),
    "station_arm.ic": (published.STATION_EFFORT, published.STATION_RATE, [(-270.0, 270.0)] * 7),
}  # fmt: skip


def compiled(what: str) -> Experiment:
    deck, run = what.split()
    return ic.compile(deck, select=[run]).experiments[0]


def with_qdd(tmp_path: Path, what: str) -> Experiment:
    deck, run = what.split()
    (tmp_path / "deck.ic").write_text(f"#include <{deck}>\nrun other like {run} {{ record += [qdd]; }}\n")
    return ic.compile(tmp_path / "deck.ic", select=["other"]).experiments[0]


def value(made: Experiment, path: str) -> float:
    return made.parameters[path].value


def inertia(made: Experiment, link: str) -> list[float]:
    return [value(made, f"links.{link}.inertia.{which}") for which in ("xx", "yy", "zz", "xy", "xz", "yz")]


def place(made: Experiment, link: str, degrees: list[float]) -> np.ndarray:
    """Where the origin of the link's frame is at these joint angles."""
    tree = System(made).tree(lambda path: value(made, path))
    found = link_motions(tree, tuple(np.array(degrees) * DEG), (0.0,) * len(degrees))
    return np.array(found[link].pose.p, float)


@pytest.mark.oracle
@pytest.mark.parametrize("what", MOVES)
def test_the_move_takes_the_torque_that_pinocchio_has_for_its_motion(tmp_path: Path, what: str) -> None:
    model, rotors = MOVES[what]()
    found = engine.run(with_qdd(tmp_path, what)).signals
    q, qd, qdd, tau = (found[name][0] for name in ("q", "qd", "qdd", "tau"))
    data = model.createData()
    wanted = np.array([pin.rnea(model, data, *each) for each in zip(q, qd, qdd, strict=True)]) + rotors * qdd
    assert np.abs(wanted).max() > 1.0
    # rounding of sums of some tens of terms, which cancel in the outer joints
    np.testing.assert_allclose(tau, wanted, rtol=0.0, atol=1e-12 * np.abs(wanted).max())


@pytest.mark.slow
@pytest.mark.parametrize("what", [*MOVES, *DRIVEN])
def test_the_run_meets_its_requirements_in_steps_that_are_short_enough(what: str) -> None:
    made = compiled(what)
    result = engine.run(made)
    assert result.status.tolist() == [0] and all(bool(met[0]) for met in result.met.values()), result.metrics
    (note,) = (note for note in made.notes if note.startswith("step size: "))
    assert all(float(x) <= 0.5 for x in re.findall(r"h \* lambda = ([0-9.]+)", note)), note


@pytest.mark.slow
@pytest.mark.parametrize("what", ["shuttle_arm.ic shuttle_arm_reach", "station_arm.ic station_arm_reach", *DRIVEN])
def test_the_arms_of_space_stay_within_what_is_published_of_their_joints(what: str) -> None:
    effort, rate, stops = SPACE[what.split()[0]]
    found = engine.run(compiled(what)).signals
    q, qd, tau = (found[name][0] for name in ("q", "qd", "tau"))
    assert (np.abs(tau) < effort).all()
    assert (np.abs(qd) < rate * 1.05).all()  # the way in to a rate goes beyond it by some per cent
    for angles, (least, most) in zip(q.T / DEG, stops, strict=True):
        assert least - 0.5 < angles.min() and angles.max() < most + 0.5


@pytest.mark.slow
@pytest.mark.parametrize("arm", ["shuttle", "station"])
def test_motors_and_gearboxes_take_the_arm_to_where_ideal_joints_do(arm: str) -> None:
    ideal, driven = (engine.run(compiled(f"{arm}_arm.ic {arm}_arm_{how}")).signals["q"][0, -1]
                     for how in ("reach", "driven"))  # fmt: skip
    np.testing.assert_allclose(driven, ideal, atol=0.05 * DEG)  # what friction leaves


@pytest.mark.release
@pytest.mark.parametrize(("arm", "largest"), [("shuttle", 28.0), ("station", 120.0)])
def test_a_heavier_payload_takes_more_until_the_motors_are_at_their_limit(arm: str, largest: float) -> None:
    (sweep,) = ic.compile(f"{arm}_arm.ic", select=[f"{arm}_arm_payloads"]).experiments
    metrics = engine.run(sweep, record=False).metrics
    assert (np.diff(metrics["effort"][:3]) > 0.0).all()
    assert metrics["volts"][0] < largest and (metrics["volts"][2:] == largest).all()


def test_the_stretched_shuttle_arm_is_as_long_as_nasa_says() -> None:
    made = compiled("shuttle_arm.ic shuttle_arm_reach")
    reach = place(made, "payload", [0.0] * 6) - place(made, "upper_arm", [0.0] * 6)
    np.testing.assert_allclose(reach, [50.0 * FOOT + 3.0 * INCH, 0.0, 0.0], atol=1e-3)  # lengths to a millimetre
    # yaw turns it out to port, pitch up
    np.testing.assert_allclose(place(made, "payload", [90.0, 0.0, 0.0, 0.0, 0.0, 0.0])[:2], [0.0, -15.3166], atol=1e-12)
    assert place(made, "payload", [0.0, 90.0, 0.0, 0.0, 0.0, 0.0])[2] == pytest.approx(0.822 + 15.3166, abs=1e-12)


@pytest.mark.slow
def test_the_other_arms_are_where_their_lengths_add_up_to() -> None:
    station = compiled("station_arm.ic station_arm_reach")
    ets_vii = compiled("ets_vii.ic ets_vii_reach")
    r3, library = (compiled(f"manutec_r3.ic manutec_r3_{each}") for each in ("move", "library_move"))
    stretched = [0.0, 90.0, -90.0, 0.0, 0.0, 0.0]
    for found, wanted in (
        (place(station, "payload", [0.0] * 7), [0.0, -(0.5692 + 0.475 + 0.5692), 2.0 * (1.3589 + 7.11)]),
        (place(ets_vii, "hand", stretched), [-0.785 + 0.87 + 0.63 + 0.532, -0.295 + 0.275 + 0.275 - 0.267, 1.627]),
        (place(r3, "link6", [0.0] * 6), [0.0, 0.0, 0.5 + 0.73]),
        (place(library, "link6", [0.0] * 6), [0.0, 0.155 - 0.3, 0.351 + 0.324 + 0.65 + 0.414 + 0.186 + 0.125]),
    ):
        np.testing.assert_allclose(found, wanted, atol=1e-14)


def test_the_arms_weigh_what_is_published() -> None:
    for what, parts, mass in (
        ("shuttle_arm.ic shuttle_arm_reach", published.SHUTTLE, 421.76),
        ("station_arm.ic station_arm_reach", published.STATION, 1505.32),
        ("ets_vii.ic ets_vii_reach", published.ETS_VII, 140.38),
    ):
        made = compiled(what)
        links = [link.name for link in made.structure.links if link.name != "base"]
        found = [value(made, f"links.{name}.mass") for name in links]
        assert found[: len(parts)] == [part.mass for part in parts] and set(found[len(parts) :]) == {0.0}
        assert sum(found) == pytest.approx(mass, abs=1e-9)
    assert sum(part.mass for part in published.SHUTTLE) == pytest.approx(905.0 * POUND, rel=0.03)  # NASA's figure


def test_what_is_held_is_published_too() -> None:
    for what, link, part in (("shuttle_arm.ic shuttle_arm_reach", "pedestal", published.SHUTTLE[0]),
                             ("station_arm.ic station_arm_reach", "foot", published.STATION[0])):  # fmt: skip
        made = compiled(what)
        assert inertia(made, link) == [*part.inertia, 0.0, 0.0, 0.0][:6]
        assert [value(made, f"links.{link}.com.{axis}") for axis in "xyz"] == list(part.com)


def test_inertia_about_the_joint_would_leave_the_booms_none_about_their_middle() -> None:
    """What shuttle_arm.ic and station_arm.ic say of their sources' frames."""
    boom = published.SHUTTLE[2]
    assert boom.mass * boom.com[0] ** 2 == pytest.approx(1417.0, abs=0.5)
    shift = boom.mass * (np.dot(boom.com, boom.com) * np.eye(3) - np.outer(boom.com, boom.com))
    assert np.linalg.eigvalsh(tensor(boom.inertia) - shift)[0] < 0.0
    hand = published.STATION[0]
    assert hand.inertia[1] < hand.mass * 1.3589**2 / 3.0 == pytest.approx(150.0, abs=0.5)
    assert hand.mass * 1.3589**2 / 12.0 == pytest.approx(38.0, abs=0.6)
    for part in (*published.SHUTTLE, *published.STATION):
        assert lacks(part.inertia) < 0.0  # about the centre of mass each is a body's
    upper, fore = published.SHUTTLE[2:4]
    assert upper.inertia[4] * fore.inertia[4] < 0.0  # the forearm leads back


def test_three_links_of_ets_vii_are_published_as_no_bodies_and_stand_in_the_deck_as_the_nearest() -> None:
    mended = {link for link, _, _ in published.ETS_VII_MENDED}
    assert {i for i, six in enumerate(published.ETS_VII_PUBLISHED) if lacks(six) > 0.0} == mended
    made = compiled("ets_vii.ic ets_vii_reach")
    for i, six in enumerate(published.ETS_VII_PUBLISHED):
        found = inertia(made, f"link{i + 1}")
        assert found == list(published.ETS_VII[i].inertia) and lacks(found) <= 0.0
        # half of one per cent nearer to what is published, and it is none again
        nearer = np.array(found) + 0.005 * np.array(six) * (np.array(found) != np.array(six)) * (
            np.sign(np.array(six)) * np.sign(np.array(six) - np.array(found))
        )
        assert i not in mended or lacks(nearer) > 0.0


@pytest.mark.parametrize(("deck", "mass", "moments"), [
    ("shuttle_arm.ic", 6366.46 * SLUG, np.array([905443.0, 6789100.0, 7086601.0]) * SLUG * FOOT**2),
    ("station_arm.ic", 419725.0, np.array([1.3e8, 1.1e8, 2e8])),
    ("ets_vii.ic", published.ETS_VII_SATELLITE[0], np.array(published.ETS_VII_SATELLITE[1])),
])  # fmt: skip
def test_the_body_that_the_deck_has_for_a_free_base_is_one(deck: str, mass: float, moments: np.ndarray) -> None:
    (line,) = re.findall(r"link base \{(.*)\}", (LIBRARY / deck).read_text(encoding="utf-8"))
    written = [float(x) for x in re.findall(r"inertia = \[(.*?)\]", line)[0].split(",")]
    assert float(re.findall(r"mass = ([\d.]+) kg", line)[0]) == pytest.approx(mass, abs=0.5)
    np.testing.assert_allclose(written, moments, rtol=5e-5)  # as many digits as are written
    assert lacks(written) < 0.0


@pytest.mark.slow
@pytest.mark.parametrize(("deck", "joint", "rate", "effort", "volts"), [
    ("shuttle_arm.ic shuttle_arm_driven", "shoulder_yaw", 2.29 * DEG, 1570.0, 25.0),
    ("shuttle_arm.ic shuttle_arm_driven", "elbow", 3.21 * DEG, 1074.0, 24.0),
    ("shuttle_arm.ic shuttle_arm_driven", "wrist_roll", 4.76 * DEG, 470.0, 20.0),
    ("station_arm.ic station_arm_driven", "elbow", 4.0 * DEG, 2332.0, 74.0),
])  # fmt: skip
def test_the_assumed_motors_have_the_published_torque_at_the_published_rate(
    deck: str, joint: str, rate: float, effort: float, volts: float
) -> None:
    made = compiled(deck)
    p = {name: value(made, f"{joint}.servo.{name}") for name in ("ratio", "kt", "resistance", "tau_max", "v_max")}
    assert p["ratio"] * p["tau_max"] == pytest.approx(effort, rel=1e-12)
    needed = p["kt"] * p["ratio"] * rate + p["resistance"] * p["tau_max"] / p["kt"]
    assert needed == pytest.approx(volts, abs=0.5) and needed < p["v_max"]


@pytest.mark.slow
def test_the_joints_of_the_r3_keep_step_below_the_librarys_limits() -> None:
    found = engine.run(compiled("manutec_r3.ic manutec_r3_move")).signals
    q, qd = found["q"][0], found["qd"][0]
    shares = (q - q[0]) / (np.array([60.0, -70.0, -35.0, 45.0, 110.0, 45.0]) * DEG - q[0])
    np.testing.assert_allclose(shares, shares[:, [0]] * np.ones(6), atol=1e-12)  # one law for all: rounding
    limits = np.array([3.0, 1.5, 5.0, 3.1, 3.1, 4.1])
    assert (np.abs(qd).max(axis=0) < limits * 1.02).all()  # the way in to a rate goes beyond it by some per cent
    assert np.abs(qd[:, 4]).max() > 3.1


@pytest.mark.release
@pytest.mark.parametrize("deck", [
    "ets_vii.ic ets_vii_afloat", "shuttle_arm.ic shuttle_arm_afloat", "station_arm.ic station_arm_afloat",
])  # fmt: skip
def test_an_arm_that_moves_on_a_free_base_keeps_what_momentum_there_was(deck: str) -> None:
    """None: the base turns and shifts the other way. Against what the links have by themselves."""
    made = compiled(deck)
    record = recordable(made.structure)
    found = engine.run(replace(made, structure=replace(made.structure, record=(
        *record["momentum"], *record["links.base.velocity"], *record["links.base.rate"],
    )))).signals  # fmt: skip
    mass = value(made, "links.base.mass")
    size = mass * np.abs(found["links.base.velocity"]).max()
    assert size > 0.1 and np.abs(found["momentum.linear"]).max() < 2e-5 * size
    turning = value(made, "links.base.inertia.xx") * np.abs(found["links.base.rate"]).max()
    assert np.abs(found["momentum.angular"]).max() < 2e-3 * turning
