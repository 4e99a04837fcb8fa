"""What each integrator does in one step: its stages, its limit of stability, and what friction makes of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import models
from met import run as engine
from met.integrators import INTEGRATORS, Integrator
from met.integrators.integrator import Motion, Slope, ahead
from met.program import friction
from tests.ic.small_decks import ARM, changed, check, experiment, messages

BY_NAME = {model.name: model for model in INTEGRATORS}
EACH = pytest.mark.parametrize("model", INTEGRATORS, ids=lambda model: model.name)

# Shares of the step at which a stage is evaluated after the first, and the weight of every stage in the step's rate.
STAGES = {
    "modified_euler": ((1.0,), (1 / 2, 1 / 2)),
    "midpoint": ((0.5,), (0.0, 1.0)),
    "semi_implicit_euler": ((), (1.0,)),
    "rk4": ((0.5, 0.5, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
}


def still(c: float) -> Slope:
    return Slope((0.0,), (0.0,), (0.0,))


@EACH
def test_stages_lie_and_weigh_as_in_the_tableau(model: Integrator) -> None:
    shares, weights = STAGES[model.name]
    for unit in range(len(weights)):
        asked = [0.0]

        def slope(c: float, y: Motion, asked: list[float] = asked, unit: int = unit) -> Slope:
            asked.append(c)
            here = float(len(asked) - 1 == unit)
            return Slope((0.0,), (here,), (2.0 * here,))

        k1 = Slope((0.0,), (float(unit == 0),), (2.0 * float(unit == 0),))
        end = model.advance(slope, 0.25, Motion((0.0,), (0.0,), (0.0,)), k1)
        assert tuple(asked[1:]) == shares
        assert end.qd[0] == pytest.approx(0.25 * weights[unit], rel=1e-15)  # two roundings
        assert end.x[0] == pytest.approx(0.5 * weights[unit], rel=1e-15)


@EACH
def test_a_decay_is_stable_up_to_the_limit_and_no_further(model: Integrator) -> None:
    def after(x: float) -> float:
        def slope(c: float, y: Motion) -> Slope:
            return Slope(y.qd, (-x * y.qd[0],))

        start = Motion((0.0,), (1.0,))
        return abs(model.advance(slope, 1.0, start, slope(0.0, start)).qd[0])

    # the limit is a root of a polynomial of slope of order 1: 1e-9 beside it is 1e-9 beside 1, far above rounding
    assert after(model.real_limit - 1e-9) < 1.0 < after(model.real_limit + 1e-9)
    assert all(after(x) < 1.0 for x in np.linspace(0.01, model.real_limit - 0.01, 50))


@pytest.mark.slow
@EACH
def test_a_damped_spring_with_both_roots_alike_is_stable_as_physics_says(model: Integrator) -> None:
    """As under `ideal` with a position command: docs/physics.md, section 3."""
    limit = 2.0 * np.sqrt(2.0) - 2.0 if model.name == "semi_implicit_euler" else model.real_limit

    def after(x: float) -> float:
        """What is left of q + qd after 4000 steps."""

        def slope(c: float, y: Motion) -> Slope:
            return Slope(y.qd, (-2.0 * x * y.qd[0] - x * x * y.q[0],))

        y = Motion((1.0,), (1.0,))
        for _ in range(4000):
            y = model.advance(slope, 1.0, y, slope(0.0, y))
        return float(abs(y.q[0]) + abs(y.qd[0]))

    # 1 % beside the limit the motion falls, or grows, by 1 % a step or more: by e^40 at least in 4000
    assert after(0.99 * limit) < 1e-6
    with np.errstate(all="ignore"):
        assert not after(1.01 * limit) < 1e6


def test_semi_implicit_euler_moves_positions_with_the_new_rates() -> None:
    y = Motion((1.0,), (2.0,), (5.0,))
    end = BY_NAME["semi_implicit_euler"].advance(lambda c, there: still(c), 0.5, y, Slope((2.0,), (-1.0,), (3.0,)))
    assert end == Motion((1.0 + 0.5 * 1.5,), (1.5,), (6.5,))
    assert end.q != ahead(y, 0.5, Slope((2.0,), (-1.0,), (3.0,))).q, "explicit Euler takes the old rate"


def test_where_friction_splits_semi_implicit_euler_it_has_made_a_shorter_step_of_its_own() -> None:
    """Its path and the engine's parabola are the same, at every share: a split leaves nothing behind."""
    advance = BY_NAME["semi_implicit_euler"].advance
    y, k1 = Motion((0.3,), (np.float64(1.0),)), Slope((np.float64(1.0),), (np.float64(-5.0),))
    with np.errstate(all="ignore"):
        whole = advance(lambda c, there: still(c), 0.5, y, k1)
        split = friction.split_at_rest(y, k1, whole, 0.5, (1.0,), may_split=True)
    assert split.share == pytest.approx(0.4, rel=1e-15)  # 1 - 5 * 0.5 * 0.4 = 0
    assert split.y.qd == (0.0,)
    shorter = advance(lambda c, there: still(c), 0.2, y, k1)
    assert split.y.q[0] == pytest.approx(shorter.q[0], rel=1e-15)


JUMPS = """\
servo pushed { model = ideal; command = acceleration(step(to = 1 rad/s^2, at = 0.25 s)); }
run hold {
    arm = swing;  servos { hinge = pushed; }
    rates { base = 8 Hz; dynamics = 1 Hz; servos = 8 Hz; record = 1 Hz; }
    duration = 2 s;  record = [q, qd];  integrator = modified_euler;
}
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("integrator", "q", "qd"),
    [
        ("modified_euler", 0.0, 1 / 2),  # 0 at the start, 1 at the end
        ("midpoint", 0.0, 1 / 2),  # the mean of both
        ("semi_implicit_euler", 0.0, 0.0),  # what holds at the start
        ("rk4", 1 / 6, 1 / 2),  # (0 + 4 * 1/2 + 1)/6; q from the first three stages, (0 + 1/2 + 1/2)/6
    ],
)
def test_what_a_faster_servo_holds_is_seen_between_its_first_tick_and_its_last(
    tmp_path: Path, integrator: str, q: float, qd: float
) -> None:
    """Eight ticks a step; from the third on the acceleration asked is 1."""
    found = engine.run(experiment(tmp_path, ARM, changed(JUMPS, ("modified_euler", integrator)))).signals
    assert found["q"][0, 1, 0] == pytest.approx(q, abs=1e-15)
    assert found["qd"][0, 1, 0] == pytest.approx(qd, abs=1e-15)


FAST = """\
servo quick {{ model = ideal; bandwidth = {w} s^-1; command = rate(0.1 rad/s); }}
run hold {{
    arm = swing;  servos {{ hinge = quick; }}
    rates {{ dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }}
    duration = 1 s;  record = [q];  integrator = {integrator};
}}
"""


@EACH
def test_a_servo_beyond_the_limit_is_an_error_that_names_integrator_and_rate(tmp_path: Path, model: Integrator) -> None:
    text = ARM + FAST.format(w=1000 * model.real_limit * 1.001, integrator=model.name)
    lambda_ = 1.001 * model.real_limit
    assert (
        messages(check(tmp_path, text))
        == f"""\
error[D104]: servo `quick` is unstable with {model.name} at this rate of the dynamics
 --> deck.ic:8:24
  |
8 |     rates {{ dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }}
  |                        ^^^^^ h * lambda = {lambda_:.3g}; the slowest rate that fits is 2000 Hz
  = help: h * lambda must stay below {model.real_limit:g}; lambda is the servo's fastest rate constant, on any arm

1 error
"""
    )


@pytest.mark.slow
@EACH
def test_a_servo_just_below_the_limit_is_warned_of_and_runs(tmp_path: Path, model: Integrator) -> None:
    text = ARM + FAST.format(w=1000 * model.real_limit * 0.99, integrator=model.name)
    compiled = check(tmp_path, text)
    assert [diagnostic.code for diagnostic in compiled.diagnostics] == ["D105"]
    assert f"stable below {model.real_limit:g} with {model.name}" in messages(compiled)
    rates = engine.run(compiled.plan.experiments[0]).signals["q"][0]  # type: ignore[union-attr]
    assert rates[-1] == pytest.approx(0.1, rel=0.01)  # 0.1 rad/s for 1 s, after a start of some steps


def test_the_plan_shows_what_its_integrator_makes_of_a_decay(tmp_path: Path) -> None:
    (note,) = experiment(tmp_path, ARM + FAST.format(w=500, integrator="rk4")).notes
    assert "h * lambda = 0.5, and a step makes 0.607 of it, in truth 0.607" in note
    assert models.find("integrator", "rk4").real_limit == pytest.approx(2.785293563405282, rel=1e-12)
