"""Servos that begin balanced: what each of them gives at the start, and whole arms of them."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from met import models
from met import run as engine
from met.plan import Experiment
from met.servos.servo import JointMotion, Seen, Setpoint
from tests.ic.small_decks import check, experiment, messages
from tests.met.small_models import Use, uses

BALANCED = [name for name, servo in models.find_own("servo").items() if servo.balance]


def values(use: Use, made: Experiment) -> SimpleNamespace:
    """The parameters of the servo as the deck has them."""
    return SimpleNamespace(**{p.name: made.parameters[f"{use.head}.{p.name}"].value for p in use.in_plan()})


@pytest.mark.release
@pytest.mark.parametrize("qd", [0.0, 0.07, -0.07])
@pytest.mark.parametrize("torque", [0.0, 31.0, -31.0])
@pytest.mark.parametrize("name", BALANCED)
def test_the_joint_gets_the_torque_and_nothing_in_the_drive_changes(
    name: str, torque: float, qd: float, tmp_path: Path
) -> None:
    """In every way to use it, sampled or continuous: the law is asked, then nature."""
    for use in uses("servo", name):
        if use.command == "torque":
            continue  # open loop: the law asks what it is told
        made = experiment(tmp_path, use.deck(), select=["it"])
        p, servo, parts, q = values(use, made), use.model, use.parts, 0.3
        setpoint = Setpoint("position", q, qd) if use.command == "position" else Setpoint("rate", qd, 0.0)
        states = {state.name: state.start for state in parts.natural}
        if servo.begin is not None:
            states |= servo.begin(p, q, qd)
        found = servo.balance(p, torque, Seen(q, qd, setpoint, 0.0, 0.0, SimpleNamespace(**states)))
        assert set(found) == {state.name for state in (*parts.natural, *parts.integrals)}
        held = SimpleNamespace(**{part.name: 0.0 for part in parts.outputs}, **found)
        there = (q, qd) if servo.measured is None else servo.measured(p, q, qd, held)
        control = servo.control(p, held, Seen(*there, setpoint, 0.0, 0.0, held))
        held = SimpleNamespace(**found, **control.outputs)
        drive = servo.drive(p, held, held, JointMotion(q, qd, 0.0, command=use.command))
        dry = np.sign(qd) * drive.dry
        assert drive.torque - dry == pytest.approx(torque, rel=1e-13, abs=1e-12), (use.command, use.words)
        for state, slope in drive.slopes.items():
            rubs = np.sign(found[state]) * drive.friction.get(state, 0.0) if qd else 0.0
            size = 1.0 + abs(slope) + abs(torque / (p.ratio * p.j_m))
            assert abs(slope - rubs) < 1e-11 * size, (use.command, use.words, state, slope, rubs)


def test_a_torque_beyond_the_motor_is_given_as_far_as_it_goes(tmp_path: Path) -> None:
    use = next(each for each in uses("servo", "rigid_gearbox") if each.command == "rate")
    p = values(use, experiment(tmp_path, use.deck(), select=["it"]))
    found = use.model.balance(p, 1e4, Seen(0.0, 0.0, Setpoint("rate", 0.0, 0.0), 0.0, 0.0, SimpleNamespace()))
    assert found["integral"] * p.ki == pytest.approx(p.resistance * p.tau_max / p.kt)


def test_a_loop_without_integral_has_nothing_to_balance_with(tmp_path: Path) -> None:
    use = next(each for each in uses("servo", "rigid_gearbox") if each.command == "rate")
    p = values(use, experiment(tmp_path, use.deck({"ki": "0 V/rad"}), select=["it"]))
    found = use.model.balance(p, 5.0, Seen(0.0, 0.0, Setpoint("rate", 0.0, 0.0), 0.0, 0.0, SimpleNamespace()))
    assert found == {"integral": 0.0}


# Whole arms

ARM = """\
#include <panda.ic>
servo soft {
    model = compliant_gearbox;  stiffness = 2e4 N*m/rad;  hardening = 4e7 N*m/rad^3;  backlash = 1e-4 rad;
    damping = 5 N*m*s/rad;  ratio = 100;  kp = 0.5 V*s/rad;  ki = 5 V/rad;  v_max = 1000 V;  resistance = 0.5 ohm;
    kt = 0.1 N*m/A;  tau_max = 100 N*m;  j_m = 6e-5 kg*m^2;  f_c = 0.01 N*m;  f_v = 1e-5 N*m*s/rad;
    f_c_joint = 0.2 N*m;  command = rate(0 rad/s);
}
servo stiff {
    model = cascade;  gear = rigid;  ratio = 100;  kp = 1 A*s/rad;  ki = 5 A/rad;  k_position = 5 1/s;
    k_current = 1 V/A;  ki_current = 100 V/(A*s);  resistance = 0.5 ohm;  inductance = 5 mH;  kt = 0.1 N*m/A;
    j_m = 6e-5 kg*m^2;  f_c = 0.01 N*m;  command = rate(0 rad/s);
}
"""


def run_of(arm: str, body: str) -> str:
    joints = [f"joint{n}" for n in range(1, 8)]
    servos = " ".join(f"{joint} = {'stiff' if n % 3 else 'soft'};" for n, joint in enumerate(joints))
    return f"""
run still {{
    arm = {arm};  servos {{ {servos} }}
    environment {{ gravity = [0, 0, -9.81] m/s^2;  {{more}} }}
    initial {{ q = [0.1, -0.4, 0.3, -1.8, 0.2, 1.4, 0.5] rad;  {body} }}
    rates {{ dynamics = 4 kHz; servos = 1 kHz; record = 100 Hz; }}
    duration = 0.1 s;
    record = [q, qd, qdd, tau];
    payload weight {{ mass = 1 kg;  shape = sphere(radius = 5 cm);  on = link7;  at = [0, 0, 10] cm; }}
}}
"""


BEGINS = "servos = balanced;"
SPRING = "used = spring { link = link5;  to = world;  stiffness = 90 N/m;  length = 0.1 m; }"


@pytest.mark.slow
def test_an_arm_on_elastic_gears_hangs_still_with_any_load(tmp_path: Path) -> None:
    """The torques are those of each case: its payload, and what the environment does."""
    deck = ARM + run_of("panda", BEGINS).replace("{more}", SPRING)
    deck += "sweep loads of still { vary payloads.weight.mass = [0, 1, 2, 5] kg; }\n"
    run = engine.run(experiment(tmp_path, deck, select=["loads"]))
    tau, qdd = run.signals["tau"], run.signals["qdd"]
    assert run.status.tolist() == [0, 0, 0, 0]
    assert np.ptp(tau[:, 0], axis=0).max() > 20.0, "the loads are felt"
    assert np.abs(qdd[:, 0]).max() < 1e-9
    assert np.abs(run.signals["qd"]).max() < 3e-3, "the motors' loops pull by what the gears are wound up, no more"


@pytest.mark.slow
def test_an_arm_that_hangs_still_feels_gravity_alone(tmp_path: Path) -> None:
    sensor = "sensor hand = accelerometer { link = link7;  along = [0, 0, 1];  cutoff = 50 Hz;  rate = 1 kHz; } record"
    deck = (ARM + run_of("panda", BEGINS)).replace("{more}", "").replace("record = [", f"{sensor} = [sensors, ")
    found = engine.run(experiment(tmp_path, deck)).signals["sensors.hand"][0]
    assert abs(found[0]) > 5.0 and np.abs(found - found[0]).max() < 0.05


@pytest.mark.slow
def test_unloaded_it_falls_into_its_gears(tmp_path: Path) -> None:
    run = engine.run(experiment(tmp_path, ARM + run_of("panda", "").replace("{more}", "")))
    assert np.abs(run.signals["qdd"][0, 0]).max() > 1.0 and np.abs(run.signals["qd"]).max() > 0.05


@pytest.mark.release
@pytest.mark.parametrize("integrator", ["modified_euler", "rk4"])
def test_on_a_base_that_moves_the_joints_do_not(tmp_path: Path, integrator: str) -> None:
    """The base floats or swings; what its motion asks of the joints is in the balance."""
    for base in ("free;", "prescribed { x = sine(amplitude = 0.1 m, frequency = 2 Hz, phase = 90 deg); }"):
        deck = (
            (ARM + run_of("panda", BEGINS))
            .replace("{more}", SPRING)
            .replace("gravity = [0, 0, -9.81] m/s^2;", "gravity = [0, 0, -1] m/s^2;")
        )
        deck = deck.replace("duration", f"base = {base}  integrator = {integrator};  duration", 1)
        body = "link base { mass = 50 kg; inertia = [4, 5, 6] kg*m^2; }"
        deck = deck.replace("run still", f"arm floats like panda {{ {body} }}\nrun still")
        deck = deck.replace("arm = panda;", "arm = floats;")
        run = engine.run(experiment(tmp_path, deck, select=["still"]))
        assert np.abs(run.signals["qdd"][0, 0]).max() < 1e-9, base


@pytest.mark.slow
def test_joints_that_cannot_be_balanced_move_and_are_reckoned_with(tmp_path: Path) -> None:
    deck = ARM + run_of("panda", BEGINS).replace("{more}", "").replace("joint4 = soft;", "joint4 = limp;")
    deck += "servo limp { model = passive; damping = 0.1 N*m*s/rad; }\n"
    qdd = engine.run(experiment(tmp_path, deck)).signals["qdd"][0, 0]
    assert abs(qdd[3]) > 1.0 and np.abs(np.delete(qdd, 3)).max() < 1e-9


@pytest.mark.release
@pytest.mark.parametrize("level", [50.0, 2.0])
@pytest.mark.parametrize("by", ["friction", "brake"])
def test_what_holds_a_joint_that_is_not_balanced_is_reckoned_with(by: str, level: float, tmp_path: Path) -> None:
    """A forearm of 4.9 N m that friction or a brake holds is carried; one that it does not hold falls, dragged."""
    brake = f"hold = brake {{ joint = elbow; torque = {level} N*m; }}" if by == "brake" else ""
    deck = (
        """\
arm bars {
    link upper { mass = 3 kg; shape = rod(length = 0.7 m, along = x); }
    link fore  { mass = 2 kg; shape = rod(length = 0.5 m, along = x); }
    joint shoulder revolute { parent = base;  child = upper; axis = y; }
    joint elbow    revolute { parent = upper; child = fore;  axis = y; at = [0.7, 0, 0] m; }
}
"""
        + ARM.split("\n", 1)[1]
        + f"""
servo limp {{ model = passive; friction = {level if by == "friction" else 0.0} N*m; }}
run still {{
    arm = bars;  servos {{ shoulder = soft; elbow = limp; }}  initial {{ {BEGINS} }}
    environment {{ gravity = [0, 0, -9.81] m/s^2;  {brake} }}
    rates {{ dynamics = 4 kHz; servos = 1 kHz; record = 1 kHz; }}  duration = 0.01 s;  record = [q, qdd, tau];
}}
"""
    )
    run = engine.run(experiment(tmp_path, deck))
    qdd, tau = run.signals["qdd"][0, 0], run.signals["tau"][0, 0]
    assert abs(qdd[0]) < 1e-9, "the shoulder begins balanced"
    fore, held = 2.0 * 9.81 * 0.25, level == 50.0
    whole = 3.0 * 9.81 * 0.35 + 2.0 * 9.81 * 0.7 + fore
    assert qdd[1] == pytest.approx(0.0 if held else (fore - level) / (2.0 * 0.25 / 3.0), rel=1e-9, abs=1e-12)
    # what falls is felt less: its mass at its middle, and its inertia, go with it
    felt = whole if held else whole - qdd[1] * (2.0 * 0.25 / 3.0 + 2.0 * 0.7 * 0.25)
    assert tau[0] == pytest.approx(-felt, rel=1e-9)


# What a deck may write


@pytest.mark.slow
def test_it_is_a_word_that_sweeps_and_the_command_line_may_change(tmp_path: Path) -> None:
    deck = ARM + run_of("panda", "").replace("{more}", "")
    sweep = "sweep both of still { vary initial.servos = [unloaded, balanced]; }\n"
    both = check(tmp_path, deck + sweep, select=["both"]).plan
    assert both is not None
    assert [each.structure.balanced for each in both.experiments] == [False, True]
    by_hand = check(tmp_path, deck, select=["still"], set=["initial.servos=balanced"]).plan
    assert by_hand is not None and by_hand.experiments[0].structure.balanced


@pytest.mark.parametrize(
    ("body", "servo", "said"),
    [
        (
            "servos = level;",
            "stiff",
            """\
error[D076]: `servos` of the initial state cannot be `level`
  --> deck.ic:10:24
   |
10 |     initial { servos = level; }
   |                        ^^^^^
   = help: one of: unloaded, balanced

1 error
""",
        ),
        (
            "servos = balanced;",
            "limp",
            """\
warning[D248]: no servo of this run can begin balanced: this changes nothing
  --> deck.ic:10:15
   |
10 |     initial { servos = balanced; }
   |               ^^^^^^
   = help: models that can: rigid_gearbox, compliant_gearbox, cascade

1 warning
""",
        ),
    ],
)
def test_a_mistake_is_told(body: str, servo: str, said: str, tmp_path: Path) -> None:
    servos = """servo limp { model = passive; }
servo stiff { model = rigid_gearbox; ratio = 100; kp = 0.1 V*s/rad; ki = 1 V/rad; v_max = 24 V; resistance = 1 ohm;
    kt = 0.05 N*m/A; tau_max = 1 N*m; j_m = 1e-4 kg*m^2; }
"""
    command = "command = rate(0 rad/s);" if servo == "stiff" else ""
    deck = f"""{servos}arm bar {{
    link one {{ mass = 1 kg; shape = rod(length = 1 m, along = x); }}
    joint hinge revolute {{ parent = base; child = one; axis = y; }}
}}
run it {{
    arm = bar;  servos {{ hinge = {servo} {{ {command} }} }}
    initial {{ {body} }}
    rates {{ dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }}
    duration = 1 s;  record = [q];
}}
"""
    assert messages(check(tmp_path, deck)) == said
