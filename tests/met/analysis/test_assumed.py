"""Assumptions of a run: the sizes are those of closed forms and of the engine's own runs."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

import ic
import met.run as engine
from met.analysis.assumed import EARTH, Assumption, assumptions
from met.cli import main
from met.plan import Experiment

DECK = """deck 2;
arm two {{
    link boom {{ mass = 3 kg;  com = [0.4, 0, 0] m;  inertia = [0, 0.05, 0.05] kg*m^2; }}
    link tip {{ mass = 2 kg;  com = [0.3, 0, 0] m;  inertia = [0, 0.02, 0.02] kg*m^2; }}
    joint hinge revolute {{ parent = base;  child = boom;  axis = z; }}
    joint wrist revolute {{ parent = boom;  child = tip;  axis = z;  at = [1, 0, 0] m; }}
}}
servo turn {{ model = ideal;  bandwidth = 1000 1/s;  rotor = 0.1 kg*m^2;
    command = position(trapezoid(to = 60 deg, max_rate = 90 deg/s, max_acceleration = 200 deg/s^2)); }}
servo geared {{ model = rigid_gearbox;  ratio = 50;  kp = 0.1 V*s/rad;  ki = 1 V/rad;  v_max = 24 V;
    resistance = 1 ohm;  kt = 0.05 N*m/A;  tau_max = 1 N*m;  j_m = 1e-5 kg*m^2;  f_c = 0.01 N*m;
    command = rate(30 deg/s); }}
default run move {{ arm = two;  {run}
    rates {{ dynamics = 20 kHz;  servos = continuous;  record = 500 Hz; }}
    duration = 1 s;  record = [tau];
}}
"""
BOTH = "servos { hinge = turn;  wrist = turn; }"
DOWN = "environment { gravity = [0, -9.81, 0] m/s^2; }"


def written(folder: Path, run: str) -> Path:
    path = folder / "deck.ic"
    path.write_text(DECK.format(run=run))
    return path


def planned(folder: Path, run: str) -> Experiment:
    (experiment,) = ic.compile(written(folder, run)).experiments
    return experiment


def by_subject(folder: Path, run: str) -> dict[str, list[Assumption]]:
    found: dict[str, list[Assumption]] = {}
    for each in assumptions(planned(folder, run)):
        found.setdefault(each.subject, []).append(each)
    return found


def test_gravity_that_is_absent_has_the_load_of_the_stretched_arm(tmp_path: Path) -> None:
    (gravity,) = by_subject(tmp_path, BOTH)["gravity"]
    assert (gravity.assumed, gravity.at, gravity.unit) == ("none", "hinge", "N*m")
    assert gravity.size == pytest.approx(EARTH * (3.0 * 0.4 + 2.0 * 1.3), rel=1e-12)


def test_gravity_that_acts_has_its_direction_and_its_largest_load_along_the_motion(tmp_path: Path) -> None:
    (gravity,) = by_subject(tmp_path, f"{BOTH} initial {{ hinge.q = 0 deg; }} {DOWN}")["gravity"]
    assert gravity.assumed == "9.81 m/s^2 along -y"
    assert gravity.size == pytest.approx(9.81 * (3.0 * 0.4 + 2.0 * 1.3), rel=1e-12)


def test_velocity_products_that_are_off_have_the_size_that_they_would_have(tmp_path: Path) -> None:
    """Closed form of two links in a plane: m2 l1 c2 sin(q2) (2 qd1 qd2 + qd2^2) about the first joint."""
    for off, assumed in (("environment { velocity_products = off; }", "off"), ("", "computed")):
        (products,) = by_subject(tmp_path, f"{BOTH} {off}")["velocity products"]
        assert (products.assumed, products.at) == (assumed, "hinge")
        q, qd = _trapezoid(np.linspace(0.0, 1.0, 200))
        assert products.size == pytest.approx(np.max(2.0 * 0.3 * np.sin(q) * 3.0 * qd**2), rel=1e-9)


def _trapezoid(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """60 deg at 90 deg/s at most with 200 deg/s^2."""
    top, slope = math.radians(90.0), math.radians(200.0)
    rise, whole = 0.45, 60.0 / 90.0 + 0.45
    qd = np.clip(np.minimum(slope * t, slope * (whole - t)), 0.0, top)
    falling = math.radians(60.0) - 0.5 * slope * (whole - t) ** 2
    q = np.where(t < rise, 0.5 * slope * t**2, np.where(t < whole - rise, top * (t - 0.5 * rise), falling))
    return q, qd


@pytest.mark.parametrize("environment", ["", DOWN])
def test_what_a_joint_without_a_motor_takes_is_what_the_run_shows(tmp_path: Path, environment: str) -> None:
    """But for the first 10 ms, in which the joints catch up; the instants that are looked at are 5 ms apart."""
    swings = " { command = position(sine(amplitude = 60 deg, frequency = 0.75 Hz, phase = 90 deg)); }"
    both = BOTH.replace("turn;", f"turn{swings}")
    experiment = planned(tmp_path, f"{both} initial {{ q = command; }} {environment}")
    found = {each.at: each for each in assumptions(experiment) if each.subject.startswith("joint ")}
    run = engine.run(experiment)
    for i, joint in enumerate(("hinge", "wrist")):
        assert found[joint].assumed == "no motor"
        later = np.abs(run.signals["tau"][0, 5:, i])
        assert found[joint].size == pytest.approx(later.max(), rel=5e-3)


def test_a_held_base_takes_weight_and_the_moment_of_what_hangs_on_it(tmp_path: Path) -> None:
    force, moment = by_subject(tmp_path, f"servos {{ hinge = geared; }} {DOWN}")["base"]
    assert (force.unit, moment.unit, force.at) == ("N", "N*m", "hinge")
    pull = 3.0 * 0.4 + 2.0 * 1.3  # kg m, turns about the hinge at 30 deg/s
    rate = math.radians(30.0)
    angles = rate * np.linspace(0.0, 1.0, 200)
    forces = np.hypot(5.0 * 9.81 - pull * rate**2 * np.sin(angles), pull * rate**2 * np.cos(angles))
    assert force.size == pytest.approx(forces.max(), rel=1e-9)
    assert moment.size == pytest.approx(9.81 * pull, rel=1e-9)


def test_a_joint_that_nothing_drives_and_numbers_that_no_one_wrote_are_named(tmp_path: Path) -> None:
    found = by_subject(tmp_path, f"servos {{ hinge = geared; }} {DOWN}")
    (wrist,) = found["joint `wrist`"]
    assert (wrist.assumed, wrist.meaning) == ("no servo", "what would hold it where it starts")
    assert wrist.size == pytest.approx(9.81 * 2.0 * 0.3, rel=0.05)
    assert found["servo of `hinge`"][0].assumed == "0, as not written: k_position, f_v"


def test_a_free_base_has_no_loads_that_hold_it() -> None:
    body = "arm two { link base { mass = 9 kg;  inertia = [1, 1, 1] kg*m^2; }"
    text = DECK.format(run=f"{BOTH} base = free;").replace("arm two {", body)
    (experiment,) = ic.compile(text=text).experiments
    assert [each.subject for each in assumptions(experiment)] == []


CRANE = """deck 2;
arm crane {
    link boom { mass = 100 kg;  shape = rod(length = 2 m, along = x); }
    link tube { mass = 0 kg; }
    link rod { mass = 0 kg; }
    joint hinge revolute { parent = base;  child = boom;  at = [0, 0, 1.2] m;  axis = -y; }
    joint swing revolute { parent = base;  child = tube;  axis = -y; }
    joint stroke prismatic { parent = tube;  child = rod;  at = [0.6, 0, 0] m;  axis = x; }
    loop lift { leader = stroke;  branch = right;  link = rod;  at = [0.5, 0, 0] m;
        to = boom;  to_at = [0.9, 0, 0] m; }
}
servo push { model = ideal;  bandwidth = 100 1/s;  command = rate(0.1 m/s); }
default run lift { arm = crane;  servos { stroke = push; }  initial { stroke.q = 0.4 m; }
    rates { dynamics = 1 kHz;  servos = continuous;  record = 100 Hz; }
    duration = 1 s;  record = [q];
}
"""


def test_velocity_products_of_a_loop_are_half_the_slope_of_its_inertia_times_the_square_of_its_rate(
    tmp_path: Path,
) -> None:
    """The boom at the ram, J = I (dtheta/ds)^2, from the law of cosines with sides 1.2 m, 0.9 m and the ram's s."""
    path = tmp_path / "crane.ic"
    path.write_text(CRANE)
    products = [each for each in assumptions(ic.compile(path).experiments[0]) if each.subject == "velocity products"]

    def inertia(s: complex) -> complex:
        cosine = (1.2**2 + 0.9**2 - s * s) / (2.0 * 1.2 * 0.9)
        return 100.0 * 2.0**2 / 3.0 * (s / (1.2 * 0.9)) ** 2 / (1.0 - cosine * cosine)

    slopes = [inertia(complex(s, 1e-20)).imag / 1e-20 for s in np.linspace(1.5, 1.6, 200)]
    assert [(each.at, each.unit) for each in products] == [("stroke", "N")]  # and none at joints that follow
    assert products[0].size == pytest.approx(0.5 * max(slopes) * 0.1**2, rel=1e-6)


def test_they_are_shown_and_given_to_programs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = f"{written(tmp_path, BOTH)}"
    assert main(["explain", path, "--assumptions"]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert shown[0] == "move"
    assert shown[1].split("  ")[1:] and "the Earth's largest load, in its worst direction" in shown[1]
    assert main(["explain", path, "--assumptions", "--format", "json"]) == 0
    (run,) = json.loads(capsys.readouterr().out)
    assert run["run"] == "move" and run["assumptions"][0]["subject"] == "gravity"
    assert main(["explain", path, "--assumptions", "--scales"]) == 2
    assert "write a PATH, or one of" in capsys.readouterr().err
