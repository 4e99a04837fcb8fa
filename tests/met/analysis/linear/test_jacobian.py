"""The Jacobian of a period is that of the program that runs: by differences, by complex steps, and by closed forms."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from met import models
from met.analysis.linear.answers import linear
from met.analysis.linear.jacobian import PeriodMap, period_map
from met.analysis.linear.period import PeriodProgram
from met.diagnostic import Problem
from met.plan import Experiment
from met.plan.linear_signals import input_signals
from tests.ic.small_decks import experiment
from tests.met.analysis.linear.oracles import (
    at_instant,
    by_complex_step,
    by_differences,
    near,
    scattered,
    shipped,
    shipped_experiment,
)
from tests.met.program.test_followers import GROUPS
from tests.met.program.test_loops import LINKED
from tests.met.small_models import EVERY, smallest


def mapped(made: Experiment, time: float = 0.0, inputs: bool = False) -> PeriodMap:
    program = PeriodProgram(made, input_signals(made.structure) if inputs else ())
    tick = round(time * program.schedule.base_hz) // program.ticks * program.ticks
    return period_map(program, at_instant(program, 0, tick))


LATCHED = """
arm rail {
    link cart { mass = 4 kg;  inertia = [1, 1, 1] kg*m^2; }
    joint slide prismatic { parent = base;  child = cart;  axis = x; }
}
run it {
    arm = rail;
    initial { slide.q = 0.1 m;  slide.qd = -1 m/s; }
    environment { MODEL }
    rates { dynamics = 1 kHz; }
    duration = 1 s;
    record = [q];
}
"""
LATCH = "latch = bushing { link = cart;  stiffness = [9, 3, 3] N/m;  from = 0.1 s;  ramp = 2 s; }"
PAD = (
    "pad = contact { link = cart;  radius = 1 m;  normal = [1, 0.2, 0];  law = hertz;  modulus = 1 kPa;  "
    "dissipation = 0.1 s/m;  friction = 0.3; }"
)


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    [
        GROUPS,
        LINKED,
        LATCHED.replace("MODEL", LATCH),
        LATCHED.replace("MODEL", PAD),
    ],
    ids=["groups", "loops", "a latch", "a contact"],
)  # fmt: skip
def test_it_is_that_of_joints_that_follow_others_of_latches_and_of_contacts(text: str, tmp_path: Path) -> None:
    """By complex steps, about states that are scattered around the run's."""
    made = experiment(tmp_path, text, select={GROUPS: ["lift"], LINKED: ["raise"]}.get(text))
    program, rng = PeriodProgram(made), np.random.default_rng(3)
    for time in (0.05, 0.4):
        start = scattered(program, rng, time=time, size=0.1)
        found = period_map(program, start.copy())
        assert near(found.A, by_complex_step(program, start, found)) < 1e-13


@pytest.mark.release
@pytest.mark.parametrize(
    "count", [2, pytest.param(30, marks=pytest.mark.slow, id="of 30 states")]
)  # fmt: skip
@pytest.mark.parametrize(("deck", "name"), shipped())
def test_it_is_that_of_shipped_decks(deck: str, name: str, count: int) -> None:
    """By central differences to 1e-7, by complex steps to 1e-13, about states that are scattered around the run's."""
    made = shipped_experiment(deck, name)
    program, rng, compared = PeriodProgram(made), np.random.default_rng(1), 0
    for number in range(count):
        time = float(rng.uniform(0.1, 0.9)) * made.structure.schedule.duration
        start = scattered(program, rng, time=time, size=0.1)
        try:
            found = period_map(program, start.copy())
        except Problem as refused:  # an event is on the way, which is told
            assert refused.diagnostics[0].code == "D370"
            continue
        compared += 1
        assert near(found.A, by_differences(program, start, found)) < 1e-7
        if number < 10:
            assert near(found.A, by_complex_step(program, start, found)) < 1e-13
    assert compared >= 0.5 * count


@pytest.mark.slow
@pytest.mark.parametrize("times", [(0.06,), pytest.param((0.0, 0.12), marks=pytest.mark.slow)])
@pytest.mark.parametrize(("kind", "name"), [each for each in EVERY if each[0] != "metric"])
def test_it_is_that_of_every_model(kind: models.Kind, name: str, times: tuple[float, ...], tmp_path: Path) -> None:
    """Of two joints whose servos tick twice a step, by complex steps to 1e-12; and a converter is its straight line."""
    made = experiment(tmp_path, smallest(kind, name).put(tmp_path).deck(), select=["cases"])
    program = PeriodProgram(made)
    for time in times:
        start = at_instant(program, 3, program.begin(time))
        try:
            found = period_map(program, start.copy())
        except Problem as refused:  # at rest many a joint just breaks away
            assert time == 0.0 and "away" in refused.diagnostics[0].message
            continue
        assert near(found.A, by_complex_step(program, start, found)) < 1e-12
        if name not in ("tachometer", "encoder"):
            assert near(found.A, by_differences(program, start, found)) < 1e-6


SWING = """\
arm swing {
    link bar { mass = 2 kg;  com = [0.5, 0, 0] m;  inertia = [0, 0.3, 0.3] kg*m^2; }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
}
SERVO
run hold {
    arm = swing;
    servos { hinge = drive; }
    initial { hinge.q = 0.2 rad;  hinge.qd = RATE; }
    environment { ENVIRONMENT }
    rates { dynamics = 1 kHz;  servos = 250 Hz;  record = 1 kHz; }
    duration = 2 s;
    record = [q, qd];
}
"""
DRIVE = """\
servo drive {
    model = rigid_gearbox;  ratio = 50;  kp = 0.02 V*s/rad;  ki = 0.1 V/rad;  v_max = VMAX;  resistance = 2 ohm;
    kt = 0.06 N*m/A;  tau_max = TAU;  j_m = 1e-4 kg*m^2;  f_v = 1e-5 N*m*s/rad;  MORE
    command = rate(0.1 rad/s);
}
"""


def swing(tmp_path: Path, **words: str) -> Experiment:
    deck = SWING.replace("SERVO", words.pop("SERVO", DRIVE))
    for word, text in (
        {"VMAX": "20 V", "TAU": "5 N*m", "RATE": "0 rad/s", "ENVIRONMENT": "", "MORE": ""} | words
    ).items():
        deck = deck.replace(word, text)
    return experiment(tmp_path, deck)


def test_a_rate_loop_is_its_closed_form(tmp_path: Path) -> None:
    """Four steps of Heun under a voltage that is held, and a tick of the integral; so are the inputs' columns."""
    found = mapped(swing(tmp_path), inputs=True)
    assert found.states == ("hinge.q", "hinge.qd", "hinge.servo.integral")
    N, kt, R, J = 50.0, 0.06, 2.0, 0.3 + 2.0 * 0.25 + 50.0**2 * 1e-4
    a, b = -N * N * (kt * kt / R + 1e-5) / J, N * kt / R / J
    A, h = np.array([[0.0, 1.0, 0.0], [0.0, a, b], [0.0, 0.0, 0.0]]), 1e-3
    step = np.eye(3) + h * A + 0.5 * h * h * A @ A
    plant = np.linalg.matrix_power(step, 4)
    tick = 4e-3
    V, V_command = np.array([0.0, -0.02 * N, 0.1]), 0.02 * N
    expected = np.vstack([plant[:2, :2] @ np.eye(2, 3) + np.outer(plant[:2, 2], V), [0.0, -tick * N, 1.0]])
    np.testing.assert_allclose(found.A, expected, rtol=1e-12, atol=1e-15)
    command, voltage = (found.B[:, [place]][:, 0] for place in (0, 1))
    np.testing.assert_allclose(command, [*(plant[:2, 2] * V_command), tick * N], rtol=1e-12)
    np.testing.assert_allclose(voltage, [*plant[:2, 2], 0.0], rtol=1e-12)


def test_what_sticks_is_held_and_no_state(tmp_path: Path) -> None:
    made = swing(tmp_path, MORE="f_c = 1 N*m;")
    assert mapped(made).held == ("hinge",)
    assert mapped(made).states == ("hinge.servo.integral",)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "what"),
    [
        ({"MORE": "f_c = 0.3 N*m;", "RATE": "0.05 rad/s"}, "`hinge` comes to rest"),
        ({"MORE": "f_c = 0.005 N*m;"}, "`hinge` breaks away"),
        ({"TAU": "2.9e-3 N*m"}, "`hinge.servo.tau_max` is reached or left"),
    ],
)
def test_a_derivative_across_an_event_is_refused_with_the_event(
    words: dict[str, str], what: str, tmp_path: Path
) -> None:
    made = swing(tmp_path, **words)
    program = PeriodProgram(made)
    told = set()
    for k in range(0, program.schedule.ticks, program.ticks):
        try:
            period_map(program, at_instant(program, 0, k))
        except Problem as refused:
            told.add(refused.diagnostics[0].message.partition(": ")[2].rpartition(",")[0])
            if what in told:
                return
    raise AssertionError(f"{what} is not among {told}")


def test_the_message_of_an_event_is_whole(tmp_path: Path) -> None:
    with pytest.raises(Problem) as refused:
        mapped(swing(tmp_path, MORE="f_c = 0.002 N*m;"))
    (told,) = refused.value.diagnostics
    assert told.code == "D370"
    assert told.message == "`hold` has no derivative here: `hinge` breaks away, t = 0 s"
    assert told.help == (
        "a derivative describes small changes, and across an event no change is small",
        "ask at another instant, `--at`, from which nothing changes for a period of the computers, 0.004 s",
    )


def test_at_a_kink_it_is_refused_only_where_the_other_side_is_another(tmp_path: Path) -> None:
    """A joint at rest just at its stop has one stiffness on the one side and none on the other; at rest within it has
    neither, though its rate, which damping of a stop goes by, stands where its sign changes."""
    stop = "e = joint_stop { joint = hinge;  lower = LOWER;  stiffness = 1e4 N/m; }".replace("N/m", "N*m/rad")
    passive = "servo drive { model = passive; }"
    made = swing(tmp_path, SERVO=passive, ENVIRONMENT=stop.replace("LOWER", "0.1 rad"))
    np.testing.assert_allclose(mapped(made).A, [[1.0, 1e-3], [0.0, 1.0]], rtol=1e-12)
    with pytest.raises(Problem, match=r"`hinge\.q` is just where something begins to act, t = 0 s"):
        mapped(swing(tmp_path, SERVO=passive, ENVIRONMENT=stop.replace("LOWER", "0.2 rad")))


def test_where_a_sign_jumps_it_is_refused_if_what_is_recorded_or_remembered_jumps_with_it(tmp_path: Path) -> None:
    """The derivative of a sign is none on both sides, and yet there is none at its jump."""
    told = SWING.replace("record = [q, qd];", "signal way = sign(hinge.q); record = [q, qd];")
    for at, outputs, refused in (("0.2", "signals.way", False), ("0", "signals.way", True), ("0", "q", False)):
        deck = told.replace("hinge.q = 0.2 rad", f"hinge.q = {at} rad").replace("hinge.qd = RATE;", "")
        made = experiment(
            tmp_path, deck.replace("SERVO", "servo drive { model = passive; }").replace("ENVIRONMENT", "")
        )
        if refused:
            with pytest.raises(Problem, match=r"`hinge\.q` is just where something begins to act, t = 0 s"):
                linear(made, outputs=[outputs])
        else:
            assert (linear(made, outputs=[outputs]).C != 0.0).any() == (outputs == "q")


def test_a_converter_counts_as_the_straight_line_through_its_steps(tmp_path: Path) -> None:
    fine = mapped(swing(tmp_path, MORE="sensor qd = tachometer { resolution = 1e-3 rad/s; }", RATE="0.1 rad/s"))
    none = mapped(swing(tmp_path, MORE="sensor qd = tachometer { }", RATE="0.1 rad/s"))
    common = [none.states.index(name) for name in fine.states]
    np.testing.assert_allclose(fine.A, none.A[np.ix_(common, common)], rtol=1e-12, atol=1e-15)


@pytest.mark.slow
def test_the_product_of_periods_is_the_monodromy_matrix_of_a_run(tmp_path: Path) -> None:
    """Of 50 periods, by differences of kernel's runs from moved initial states."""
    from dataclasses import replace

    from met import run as engine

    made = swing(tmp_path, RATE="0.05 rad/s", ENVIRONMENT="g = gravity { g = [0, -9.81, 0] m/s^2; }")
    program, product, periods = PeriodProgram(made), np.eye(3), 50
    for n in range(periods):
        product = period_map(program, at_instant(program, 0, n * program.ticks)).A @ product
    ends = []
    for part in ("q", "qd"):
        path, size = f"initial.hinge.{part}", 1e-4
        for move in (size, -size):
            parameters = dict(made.parameters)
            parameters[path] = replace(parameters[path], value=float(parameters[path].value) + move)  # type: ignore[arg-type]
            result = engine.run(replace(made, parameters=parameters))
            ends.append(result.signals["q"][0, periods * program.ticks, 0])
            ends.append(result.signals["qd"][0, periods * program.ticks, 0])
    (q, qd), (q_less, qd_less), (q_, qd_), (q_less_, qd_less_) = (ends[k : k + 2] for k in range(0, 8, 2))
    found = np.array([[q - q_less, q_ - q_less_], [qd - qd_less, qd_ - qd_less_]]) / 2e-4
    np.testing.assert_allclose(product[:2, :2], found, rtol=1e-7, atol=1e-8)
    assert math.isclose(program.seconds, 0.004)


LOCKED = """\
arm pair {
    link bar { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link rod { mass = 1 kg; shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base; child = bar; axis = -y; }
    joint knee revolute { parent = bar; child = rod; axis = -y; at = [1, 0, 0] m; }
}
servo fixed { model = locked; release = 0.5 s; }
run hold {
    arm = pair; servos { knee = fixed; }
    environment { g = gravity { g = [0, 0, -9.81] m/s^2; } }
    rates { dynamics = 1 kHz; } duration = 1 s; record = [];
    initial { hinge.q = 20 deg; }
}
"""


@pytest.mark.slow
def test_a_locked_joint_is_held_until_it_is_released(tmp_path: Path) -> None:
    """Then it is named, and no two poles of it stay; the rest moves as before."""
    made = experiment(tmp_path, LOCKED)
    before, after = mapped(made, 0.25), mapped(made, 0.75)
    assert before.held == before.locked == ("knee",) and before.states == ("hinge.q", "hinge.qd")
    assert after.held == after.locked == () and len(after.states) == 4
    program = PeriodProgram(made)
    flow = at_instant(program, 0, 250)
    for place, name in enumerate(before.states):
        sides = []
        for size in (1e-6, -1e-6):
            moved = flow.copy()
            moved.cells[name] += size
            moved.ticks()
            moved.finish()
            sides.append(np.array([moved.cells[each] for each in before.states]))
        assert before.A[:, place] == pytest.approx((sides[0] - sides[1]) / 2e-6, abs=1e-8)


def test_a_joint_that_is_released_within_the_period_is_none_that_is_locked(tmp_path: Path) -> None:
    made = experiment(tmp_path, LOCKED.replace("release = 0.5 s", "release = 0.2505 s"))
    assert mapped(made, 0.25).locked == ()
