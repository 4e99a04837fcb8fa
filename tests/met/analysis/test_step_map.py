"""The linearised step of the program, against closed forms, an independent dynamics, and differences of runs."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import ic
from met import models
from met import run as engine
from met.analysis.modes import _answers, modes, slowest
from met.analysis.step_map import Linearizer, StepMap, linear_step
from met.plan import Experiment
from met.program.step import StepPhases
from tests.ic.small_decks import changed, experiment

SWING = """\
arm swing {
    link bar { mass = 1 kg;  com = [0, 0, 0] m;  inertia = [1, 1, 1] kg*m^2; }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
}
servo sprung { model = passive;  stiffness = 2500 N*m/rad; }
run hold {
    arm = swing;
    servos { hinge = sprung; }
    integrator = modified_euler;
    rates { dynamics = 100 Hz;  servos = 100 Hz; }
    duration = 5 s;
    record = [q, qd];
}
"""


def step_map(experiment: Experiment, *, stages: bool = True) -> StepMap:
    return Linearizer(experiment, range(experiment.cases.count)).map(stages=stages)


@pytest.mark.parametrize("integrator", ["modified_euler", "midpoint", "semi_implicit_euler", "rk4"])
def test_of_a_spring_it_is_the_integrators_matrix(integrator: str, tmp_path: Path) -> None:
    """h w = 0.5 with w = 50 1/s: I + hA + (hA)^2/2, the whole series up to (hA)^4, and that of semi-implicit Euler."""
    found = step_map(experiment(tmp_path, changed(SWING, ("modified_euler", integrator))))
    h, w = 0.01, 50.0
    A = np.array([[0.0, 1.0], [-w * w, 0.0]])
    terms = [np.linalg.matrix_power(h * A, k) / math.factorial(k) for k in range(5)]
    expected = {
        "modified_euler": sum(terms[:3]),
        "midpoint": sum(terms[:3]),
        "rk4": sum(terms),
        "semi_implicit_euler": np.array([[1.0 - h * h * w * w, h], [-h * w * w, 1.0]]),
    }[integrator]
    assert found.names == ("hinge.q", "hinge.qd") and found.h == h
    np.testing.assert_allclose(found.slope[0], A, rtol=1e-8, atol=1e-6)
    np.testing.assert_allclose(found.step[0], expected, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(
        linear_step(models.find("integrator", integrator), found.slope, found.positions, h),
        found.step,
        rtol=1e-7,
        atol=1e-8,
    )
    np.testing.assert_allclose(
        linear_step(models.find("integrator", integrator), A, 1, h), expected, rtol=1e-12, atol=1e-12
    )


GEAR = """\
arm light {
    link bar { mass = 1 kg;  com = [0, 0, 0] m;  inertia = [J, J, J] kg*m^2; }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
}
servo geared {
    model = compliant_gearbox;  ratio = 50;  kp = 0 V*s/rad;  ki = 0 V/rad;  v_max = 30 V;  resistance = 1e9 ohm;
    kt = 0.08 N*m/A;  tau_max = 3 N*m;  j_m = 2e-4 kg*m^2;  stiffness = 2000 N*m/rad;  command = torque(0 N*m);
}
run hold {
    arm = light;
    servos { hinge = geared; }
    rates { dynamics = 4 kHz;  servos = 1 kHz; }
    duration = 1 s;
    record = [q];
}
"""


@pytest.mark.parametrize("inertia", [1e-3, 0.1, 10.0])
def test_two_inertias_swing_against_each_other(inertia: float, tmp_path: Path) -> None:
    """w^2 = k (1/J + 1/(N^2 J_m)): the gear's own swing is that of the held joint."""
    made = experiment(tmp_path, GEAR.replace("J, J, J", ", ".join([repr(inertia)] * 3)))
    found = step_map(made)
    w = math.sqrt(2000.0 * (1.0 / inertia + 1.0 / (50.0**2 * 2e-4)))
    fastest = max(modes(found, models.find("integrator", "modified_euler")), key=lambda each: abs(each.root))
    assert abs(fastest.root) == pytest.approx(w, rel=1e-7) and abs(fastest.root.real) < 1e-3
    assert fastest.growth == pytest.approx(0.5 * math.log(1.0 + (w / 4e3) ** 4 / 4.0), rel=1e-3, abs=1e-8)


TREE = """\
arm tree {
    link a { mass = 2 kg;  shape = rod(length = 0.7 m, along = x); }
    link b { mass = 1 kg;  shape = rod(length = 0.5 m, along = y); }
    link c { mass = 0.3 kg;  shape = rod(length = 0.2 m, along = x); }
    joint s revolute { parent = base;  child = a;  axis = z; }
    joint e revolute { parent = a;  child = b;  axis = [0, 1, 1];  at = [0.7, 0, 0] m; }
    joint t prismatic { parent = b;  child = c;  axis = x;  at = [0, 0.5, 0] m; }
}
servo sprung { model = passive;  stiffness = 80 N*m/rad;  damping = 0.5 N*m*s/rad; }
servo slide { model = passive;  stiffness = 300 N/m;  damping = 1 N*s/m; }
run hold {
    arm = tree;
    servos { s = sprung;  e = sprung;  t = slide; }
    integrator = INTEGRATOR;
    initial { s.q = 0.3 rad;  e.q = -0.7 rad;  t.q = 0.1 m;  qd = [1.5 rad/s, -2 rad/s, 0.4 m/s]; }
    environment { g = gravity { g = [0, 3, -9.81] m/s^2; } }
    rates { dynamics = 50 Hz; }
    duration = 20 ms;
    record = [q, qd];
}
"""
PLACES = ("s.q", "e.q", "t.q", "s.qd", "e.qd", "t.qd")


@pytest.mark.release
@pytest.mark.parametrize("integrator", ["modified_euler", "semi_implicit_euler", "rk4"])
def test_it_is_the_difference_of_runs_of_one_step(integrator: str, tmp_path: Path) -> None:
    """Three joints that move, turn against each other and slide, in a pose of no symmetry."""
    deck = changed(TREE, ("INTEGRATOR", integrator))
    made = experiment(tmp_path, deck)
    found = step_map(made)
    assert found.names == PLACES
    start = {"s.q": 0.3, "e.q": -0.7, "t.q": 0.1, "s.qd": 1.5, "e.qd": -2.0, "t.qd": 0.4}
    columns = []
    for name in PLACES:
        unit = {"s.q": "rad", "e.q": "rad", "t.q": "m", "s.qd": "rad/s", "e.qd": "rad/s", "t.qd": "m/s"}[name]
        ends = ", ".join(repr(start[name] + sign * 1e-5) for sign in (1.0, -1.0))
        sweep = f"sweep about of hold {{ vary initial.{name} = [{ends}] {unit}; }}\n"
        pair = experiment(tmp_path, deck, sweep, select=["about"])
        run = engine.run(pair)
        state = np.concatenate([run.signals["q"][:, -1], run.signals["qd"][:, -1]], axis=1)
        columns.append((state[0] - state[1]) / 2e-5)
    np.testing.assert_allclose(found.step[0], np.array(columns).T, rtol=1e-6, atol=1e-6)


@pytest.mark.slow
def test_a_swing_is_found_grown_damped_or_followed_and_a_rate_that_does(tmp_path: Path) -> None:
    """What runs of 5 s with these steps make of a spring's swing, h w = 0.5 and 0.25, and the truth, 1."""
    for hz, integrator in ((100, "modified_euler"), (100, "rk4"), (200, "modified_euler"), (800, "rk4")):
        deck = changed(
            SWING,
            ("modified_euler", integrator),
            ("dynamics = 100 Hz;  servos = 100 Hz", f"dynamics = {hz} Hz;  servos = {hz} Hz"),
            ("    integrator", "    initial { hinge.q = 1 rad; }\n    integrator"),
        )
        made = experiment(tmp_path, deck)
        found, schedule = step_map(made), made.structure.schedule
        model = models.find("integrator", integrator)
        steps = schedule.ticks // schedule.dynamics
        mode = next(each for each in modes(found, model) if not each.loose)
        run = engine.run(made)
        size = float(np.hypot(run.signals["q"][0, :, 0], run.signals["qd"][0, :, 0] / 50.0)[-1])
        told = math.exp(mode.grown(found.h, steps)) * mode.missed(found.h, steps)[0]
        assert told == pytest.approx(size, rel=0.06 if hz == 100 else 0.01)
        fits = slowest(found, mode, model, schedule, follows=True)
        assert fits is not None and fits > hz


def test_what_friction_holds_is_seen_loose_beside(tmp_path: Path) -> None:
    """A joint held by friction has no mode; loose, its servo's back-EMF brakes it: Kt^2 N^2/R / (J + N^2 J_m)."""
    deck = """\
arm swing { link bar { mass = 1 kg; com = [0, 0, 0] m; inertia = [1, 1, 1] kg*m^2; }
    joint hinge revolute { parent = base; child = bar; axis = z; } }
servo drive { model = rigid_gearbox; ratio = 10; kp = 1 V*s/rad; ki = 1 V/rad; v_max = 24 V; resistance = 1 ohm;
    kt = 0.5 N*m/A; tau_max = 10 N*m; j_m = 1e-2 kg*m^2; f_c = 1 N*m; command = rate(0 rad/s); }
run hold { arm = swing; servos { hinge = drive; } rates { dynamics = 100 Hz; servos = 100 Hz; } duration = 1 s;
    record = [q]; }
"""
    found = step_map(experiment(tmp_path, deck))
    held, loose = found.slope
    assert list(found.loose) == [False, True] and held[1, 1] == 0.0
    assert loose[1, 1] == pytest.approx(-(0.5**2) * 100.0 / 2.0, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("brake", "held"),
    [
        ("torque = 6 N*m;", True),
        ("torque = 4 N*m;", False),
        ("torque = 6 N*m;  until = 0.5 s;", False),
        ("torque = 6 N*m;  from = 0.5 s;", False),
    ],
)
def test_a_joint_that_its_brake_holds_from_the_start_to_the_end_stays_held(brake: str, held: bool) -> None:
    """A bar of 1 kg whose weight takes 9.81 N * 0.5 m cos(0.2) about the hinge."""
    deck = f"""\
arm swing {{ link bar {{ mass = 1 kg; com = [0.5, 0, 0] m; inertia = [1, 1, 1] kg*m^2; }}
    joint hinge revolute {{ parent = base; child = bar; axis = y; }} }}
run hold {{ arm = swing; initial {{ hinge.q = 0.2 rad; }} rates {{ dynamics = 100 Hz; }} duration = 1 s; record = [q];
    environment {{ gravity = [0, 0, -9.81] m/s^2;  grip = brake {{ joint = hinge;  {brake} }} }} }}
sweep several of hold {{ vary links.bar.com.x = [0.5, 0.4, 0.3] m; }}
"""
    made = ic.compile(text=deck, select=["several"]).experiments[0]
    found = Linearizer(made, [0]).map()
    assert list(found.loose) == [False, True]
    assert bool(found.slope[1, 1, 0] == 0.0) is held
    several = Linearizer(made, [0, 1, 2]).map()
    lighter = held or ("until" not in brake and "from" not in brake)  # 0.4 m and less: 4 N m hold that
    assert [bool(each) for each in several.slope[1::2, 1, 0] == 0.0] == [held, lighter, lighter]


def test_slopes_are_equal_to_the_bit_in_blocks_of_any_size(monkeypatch: pytest.MonkeyPatch) -> None:
    deck = SWING + "sweep several of hold { vary sprung.stiffness = [25, 250, 2500] N*m/rad; }\n"
    made = ic.compile(text=deck, select=["several"]).experiments[0]
    whole = Linearizer(made, [0, 1, 2]).slope
    ran = []
    plain = StepPhases.slope
    monkeypatch.setattr(StepPhases, "slope", lambda self, tape: (ran.append(tape.lanes), plain(self, tape)))
    monkeypatch.setattr("met.analysis.step_map.AT_ONCE", 1)
    assert np.array_equal(Linearizer(made, [0, 1, 2]).slope, whole)
    assert ran == [12, 12]  # three cases as they are and loose, to both sides: a block for q, and one for qd


def test_of_many_modes_the_inverse_is_taken_at_once_and_is_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, made = step_map(experiment(tmp_path, SWING), stages=False), models.find("integrator", "modified_euler")
    [few] = (each for each in modes(found, made) if each.lane == 0)
    monkeypatch.setattr("met.analysis.modes.MANY", 0)
    [many] = (each for each in modes(found, made) if each.lane == 0)
    assert many.root == pytest.approx(few.root, rel=1e-12) and many.factor == few.factor
    np.testing.assert_allclose(many.weights, few.weights, rtol=1e-12)


@pytest.mark.parametrize("rate", [1e121, 1e160])
def test_a_rate_whose_step_overflows_has_infinite_factors(rate: float) -> None:
    A = np.array([[[0.0, 1.0], [-3.0, -rate]]])
    roots, factors = _answers(A, models.find("integrator", "modified_euler", None), 1e-3)
    fast = roots[0].real == -rate
    assert np.isinf(factors[0][fast]).sum() >= 2
    assert factors[0][~fast] == pytest.approx([1.0] * 3, abs=1e-12)
