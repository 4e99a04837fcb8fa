"""Stops of a joint: the law, what a contact gives back, the order of integrators through it, and what is told."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from met import run as engine
from met.environments.joint_stop import ENVIRONMENT, loads
from met.plan.channel import channels
from met.plan.keys import structure_key
from tests.ic.small_decks import changed, check, codes, experiment, messages
from tests.met.environments.worlds import Given, given

SLIDER = """\
arm rail {
    link block { mass = 2 kg; shape = sphere(radius = 0.1 m); }
    joint slide prismatic { parent = base; child = block; axis = x; }
}
run it {
    arm = rail;  initial { slide.qd = 0.6 m/s; }
    environment {
        end = joint_stop { joint = slide; lower = -0.1 m; upper = 0.1 m; stiffness = 800 N/m; dissipation = 0.5 s/m; }
    }
    integrator = rk4;  rates { dynamics = 2 kHz; record = 50 Hz; }  duration = 0.6 s;  record = [q, qd, qdd, tau];
}
"""
HINGE = changed(
    SLIDER,
    ("prismatic", "revolute"),
    ("axis = x", "axis = z"),
    ("0.6 m/s", "0.6 rad/s"),
    ("-0.1 m", "-0.1 rad"),
    ("0.1 m;", "0.1 rad;"),
    ("800 N/m", "6.4 N*m/rad"),
    ("0.5 s/m", "0.5 s/rad"),
)


def given_back(v: float, a: float) -> float:
    """The rate at which a joint leaves that came in at v."""
    entry = a * v - math.log1p(a * v)
    return float(brentq(lambda u: -a * u - math.log1p(-a * u) - entry, 0.0, min(v, 1.0 / a - 1e-12)))


@pytest.mark.parametrize(("deck", "inertia", "unit"), [(SLIDER, 2.0, "N"), (HINGE, 0.008, "N*m")])
def test_its_push_is_a_channel_in_the_unit_of_its_joint(tmp_path: Path, deck: str, inertia: float, unit: str) -> None:
    """Nothing else acts: it is inertia times acceleration; a sphere's is 2/5 m r^2."""
    text = changed(deck, ("qdd, tau]", "qdd, environment.end.tau]"), ("record = 50 Hz", "record = 500 Hz"))
    made = experiment(tmp_path, text)
    assert channels(made.structure)["environment.end.tau"].unit == unit
    found = engine.run(made)
    tau = found.signals["environment.end.tau"]
    np.testing.assert_allclose(tau, inertia * found.signals["qdd"][..., 0], rtol=1e-12, atol=1e-12)
    assert np.ptp(tau) > 1e-3


def test_the_unit_of_a_stops_push_changes_no_key(tmp_path: Path) -> None:
    structure = experiment(tmp_path, SLIDER).structure
    [use] = structure.environment
    plain = replace(structure, environment=(replace(use, slides=False),))
    assert use.slides and plain != structure and structure_key(plain) == structure_key(structure)


def test_it_pushes_back_from_either_end_and_never_pulls() -> None:
    p = given(ENVIRONMENT, joint="one", lower=-0.5, upper=0.2, stiffness=100.0, dissipation=2.0)

    def torque(q: float, qd: float) -> float:
        return float(loads(p, Given({}, {"one": (q, qd)})).torques["one"])

    assert [torque(q, 7.0) for q in (-0.5, 0.0, 0.2)] == [0.0, 0.0, 0.0]
    assert torque(0.3, 0.25) == pytest.approx(-100.0 * 0.1 * 1.5, rel=1e-14)
    assert torque(-0.6, -0.25) == pytest.approx(100.0 * 0.1 * 1.5, rel=1e-14)
    assert torque(0.3, -0.25) == pytest.approx(-100.0 * 0.1 * 0.5, rel=1e-14)
    assert torque(0.3, -3.0) == 0.0 and torque(-0.6, 3.0) == 0.0, "it would pull"
    assert math.isnan(torque(math.nan, 0.0)) and math.isnan(torque(0.3, math.nan))


def test_an_end_that_is_not_written_is_none() -> None:
    for one in ({"lower": -0.5}, {"upper": 0.2}):
        p = given(ENVIRONMENT, joint="one", stiffness=100.0, **one)
        for q in (-1e6, 1e6):
            found = float(loads(p, Given({}, {"one": (q, 3.0)})).torques["one"])
            assert math.isfinite(found) and (found != 0.0) == (("lower" in one) == (q < 0.0))


@pytest.mark.slow
@pytest.mark.parametrize("deck", [SLIDER, HINGE], ids=["prismatic", "revolute"])
@pytest.mark.parametrize("dissipation", [0.2, 0.5, 1.5])
def test_a_contact_gives_back_what_the_closed_form_says(tmp_path: Path, deck: str, dissipation: float) -> None:
    """Whatever stiffness and inertia: of a block and of a ball about its middle."""
    unit = "s/rad" if deck is HINGE else "s/m"
    text = changed(deck, (f"0.5 {unit}", f"{dissipation} {unit}"))
    found = engine.run(experiment(tmp_path, text))
    after = given_back(0.6, dissipation)
    # 2 kHz against 20/s: the kinks at both ends of the contact leave some 1e-6
    assert found.signals["qd"][0, -1, 0] == pytest.approx(-after, abs=2e-6)
    assert 0.3 < after < 0.6 * (1.0 - 0.5 * 2.0 / 3.0 * dissipation * 0.6)
    assert found.signals["q"][0].max() > 0.11 and (found.signals["tau"] == 0.0).all()


def test_without_dissipation_it_gives_all_energy_back(tmp_path: Path) -> None:
    text = changed(SLIDER, ("dissipation = 0.5 s/m;", ""), ("duration = 0.6 s", "duration = 3 s"))
    rates = engine.run(experiment(tmp_path, text)).signals["qd"][0, :, 0]
    assert abs(rates[-1]) == pytest.approx(0.6, abs=2e-5), "after seven contacts"
    assert (np.diff(np.sign(rates)) != 0).sum() > 5


STARTS = 0.01 * (np.arange(400) * 0.618034 % 1.0)
"""That meet the stop at all shares of a step."""


@cache
def places() -> np.ndarray:
    """Where each start is after 0.6 s: by DOP853 over the contact, stopped where it ends."""

    def motion(_: float, y: np.ndarray) -> list[float]:
        return [y[1], -400.0 * (y[0] - 0.1) * max(0.0, 1.0 + 0.5 * y[1])]

    def out(_: float, y: np.ndarray) -> float:
        return float(y[0] - 0.1 if y[1] < 0.0 else 1.0)

    out.terminal = True  # type: ignore[attr-defined]
    end = solve_ivp(motion, (0.0, 0.4), [0.1, 0.6], method="DOP853", rtol=1e-12, atol=1e-14, events=out)
    assert end.status == 1, "it leaves the stop before the end"
    left = 0.6 - (0.1 - STARTS) / 0.6 - end.t[-1]
    return np.asarray(0.1 + end.y[1, -1] * left)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["modified_euler", "midpoint", "rk4"])
def test_integrators_keep_order_two_through_contacts(tmp_path: Path, integrator: str) -> None:
    worst = []
    for rate in (250, 1000, 4000):
        sweep = f"sweep starts of it {{ vary initial.slide.q = [{', '.join(map(str, STARTS))}] m; }}"
        text = changed(SLIDER, ("integrator = rk4", f"integrator = {integrator}"), ("2 kHz", f"{rate} Hz"))
        found = engine.run(experiment(tmp_path, text, sweep, select=["starts"])).signals["q"][:, -1, 0]
        worst.append(float(np.abs(found - places()).max()))
    orders = np.log2(np.array(worst[:-1]) / worst[1:]) / 2.0
    assert orders == pytest.approx(2.0, abs=0.2), worst  # the worst of 400 is not the worst of all
    assert worst[1] < 8e-6 and worst[2] < 4.1e-7, worst  # docs/environments.md, of the worst of the three


def test_a_servo_that_pushes_against_a_stop_rests_where_springs_balance(tmp_path: Path) -> None:
    run = ("arm = rail;", "arm = rail;  servos { slide = push; }")
    text = changed(SLIDER, run, ("duration = 0.6 s", "duration = 6 s"))
    servo = "servo push { model = passive; stiffness = 200 N/m; rest = 0.3 m; damping = 40 N*s/m; }\n"
    found = engine.run(experiment(tmp_path, servo, text)).signals["q"][0, -1, 0]
    assert found == pytest.approx((200.0 * 0.3 + 800.0 * 0.1) / 1000.0, abs=1e-9)


def test_the_units_are_those_of_its_joint(tmp_path: Path) -> None:
    assert codes(tmp_path, changed(SLIDER, ("800 N/m", "800 N*m/rad"))) == ["D061"]
    assert codes(tmp_path, changed(HINGE, ("6.4 N*m/rad", "6.4 N/m"))) == ["D061"]
    deck = experiment(tmp_path, SLIDER)
    assert deck.parameters["environment.end.stiffness"].unit == "N/m"
    assert deck.parameters["environment.end.upper"].unit == "m"


def test_ends_that_are_the_wrong_way_round_are_told(tmp_path: Path) -> None:
    assert (
        messages(check(tmp_path, changed(SLIDER, ("lower = -0.1 m", "lower = 0.2 m"))))
        == """\
error[D241]: `lower` of environment `end` must be less than `upper`
 --> deck.ic:8:51
  |
8 |         end = joint_stop { joint = slide; lower = 0.2 m; upper = 0.1 m; stiffness = 800 N/m; dissipation = 0.5 s/m; }
  |                                                   ^^^^^ 0.2 m is not less than 0.1 m
  = help: swap them, or leave one out (position of the lower stop; by default there is none)

1 error
"""
    )
    sweep = "sweep some of it { vary environment.end.upper = [0.1, -0.2] m; }"
    compiled = check(tmp_path, SLIDER, sweep, select=["some"])
    assert [d.message for d in compiled.diagnostics] == [
        "`lower` of environment `end` must be less than `upper`; case #1 breaks it"
    ]


def test_a_joint_that_is_not_there_and_a_stop_without_ends_are_told(tmp_path: Path) -> None:
    assert messages(check(tmp_path, changed(SLIDER, ("joint = slide;", "joint = slid;")))).startswith(
        "error[D159]: no joint `slid` in arm `rail`\n"
    )
    assert codes(tmp_path, changed(SLIDER, ("lower = -0.1 m; upper = 0.1 m;", ""))) == ["D168"]
