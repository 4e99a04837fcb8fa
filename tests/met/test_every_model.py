"""What holds for every model: it declares itself, runs from a small deck, and its bits depend on the case alone.

A model that is added gets a line in `SMALLEST`, or a test here fails.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from met import models
from met import run as engine
from met.channel import COMMAND_UNIT
from met.parameter import Parameter
from met.program import build
from met.trace.reference import execute
from met.units import parse_unit
from tests.ic.small_decks import experiment

KINDS: tuple[models.Kind, ...] = get_args(models.Kind)
EVERY = [(kind, name) for kind in KINDS for name in models.find_own(kind)]

DECK = """\
arm small {{
    link bar {{ mass = 2 kg; shape = rod(length = 1 m, along = x); }}
    link tip {{ mass = 1 kg; shape = sphere(radius = 0.1 m); com = [0.2, 0.1, 0] m; }}
    joint hinge revolute  {{ parent = base; child = bar; axis = y; }}
    joint slide prismatic {{ parent = bar;  child = tip; axis = x; at = [1, 0, 0] m; }}
}}
servo gearbox {{
    model = rigid_gearbox;
    ratio = 100; kp = 0.1 V*s/rad; ki = 1 V/rad; v_max = 24 V; resistance = 1 ohm; kt = 0.05 N*m/A;
    tau_max = 1 N*m; j_m = 1e-4 kg*m^2; f_c = 0.005 N*m; k_position = 5 s^-1;
}}
servo follow {{ model = ideal; bandwidth = 30 s^-1; }}
{more}
run it {{
    arm         = small;
    servos      {{ {servos} }}
    environment {{ gravity = [0, 0, -9.81] m/s^2;  {environment} }}
    rates       {{ base = 1 kHz;  dynamics = 250 Hz;  servos = 500 Hz;  record = 125 Hz; }}
    integrator  = {integrator};
    duration    = 0.2 s;
    record      = [q, qd, qdd, tau];
    metric m    = {metric};
    {substitute}
    {guide}
}}
sweep cases of it {{ vary initial.hinge.q = linspace(-1, 1, 7) rad; }}
"""
DRIVEN = "hinge = gearbox {{ command = {}; }};"
COURSES = {
    "constant": "0.5 UNIT",
    "step": "step(to = 0.5 UNIT, at = 0.1 s)",
    "ramp": "ramp(to = 0.5 UNIT, over = 0.1 s)",
    "sine": "sine(amplitude = 0.5 UNIT, frequency = 3 Hz)",
    "table": "table(times = [0, 0.1] s, values = [0, 0.5] UNIT)",
    "chirp": "chirp(amplitude = 0.5 UNIT, f0 = 1 Hz, f1 = 9 Hz, over = 0.2 s)",
    "trapezoid": "trapezoid(to = 0.5 UNIT, max_rate = 9 UNIT*s^-1, max_acceleration = 300 UNIT*s^-2)",
    "trajectory": 'trajectory("moves.csv")',
}
"""Every profile, its values in the unit of the command."""

UNITS = {"rate": "rad/s", "position": "rad", "torque": "N*m", "acceleration": "rad/s^2"}


def asked(command: str, course: str) -> str:
    """A command, as a deck writes it."""
    return f"{command}({COURSES[course].replace('UNIT', UNITS[command])})"


SMALLEST: dict[tuple[str, str], dict[str, str]] = {
    ("servo", "rigid_gearbox"): {"servos": DRIVEN.format("rate(0.5 rad/s)")},
    ("servo", "ideal"): {"servos": "hinge = follow { command = rate(0.5 rad/s); };"},
    ("servo", "passive"): {"more": "servo rub { model = passive; friction = 1 N*m; }", "servos": "hinge = rub;"},
    ("servo", "locked"): {"more": "servo lock { model = locked; release = 0.1 s; }", "servos": "hinge = lock;"},
    ("environment", "attitude_hold"): {
        "environment": "hold = attitude_hold { link = tip; stiffness = [3, 4, 5] N*m/rad; axes = world; };"
    },
    ("environment", "gravity"): {},
    ("environment", "gravity_gradient"): {
        "environment": "orbit = gravity_gradient { radius = 6778 km; frame = orbital; };"
    },
    ("environment", "joint_damping"): {"environment": "grease = joint_damping { damping = 1 N*m*s/rad; };"},
    ("environment", "wrench_table"): {
        "environment": "load = wrench_table { link = tip; times = [0, 0.1, 0.15] s; force_z = [0, 9, 2] N; };"
    },
    ("environment", "wrench"): {"environment": "push = wrench { link = tip; force = [1, 2, 3] N; until = 0.1 s; };"},
    ("environment", "spring"): {"environment": "line = spring { link = tip; stiffness = 90 N/m; length = 1 m; };"},
    ("environment", "bushing"): {
        "environment": "mount = bushing { link = tip; to = bar; to_at = [1, 0, 0] m; stiffness = [90, 50, 10] N/m;"
        "  turning = [5, 6, 7] N*m/rad; };"
    },
    ("environment", "joint_stop"): {
        "environment": "end = joint_stop { joint = slide; lower = -1 mm; upper = 5 mm; stiffness = 900 N/m;"
        "  dissipation = 0.5 s/m; };"
    },
    ("environment", "plume"): {
        "environment": "jet = plume { link = tip; width = 0.2 m; height = 0.1 m; nozzle = [1, 0, 2] m;"
        "  axis = [0, 0, -1]; thrust = 50 N; exponent = 5; duty = 50 %; period = 0.03 s; };"
    },
    **{("command", name): {"servos": DRIVEN.format(asked("rate", name))} for name in COURSES},
    ("guide", "resolved_rate"): {
        "servos": "hinge = follow { command = rate(tip); }; slide = follow { command = position(tip); };",
        "guide": "guide tip = resolved_rate { link = tip; guides = xz; z = ramp(to = 5 cm, over = 0.2 s);"
        "  rate = 250 Hz; max_damping = 0.2 m; threshold = 0.5 m; hinge.max_rate = 9 rad/s; slide.max_rate = 1 m/s; }",
    },
    ("guide", "together"): {
        "servos": "hinge = follow { command = position(move); }; slide = follow { command = position(move); };",
        "guide": "guide move = together { hinge.to = 0.2 rad; hinge.max_rate = 9 rad/s;"
        "  hinge.max_acceleration = 90 rad/s^2; slide.to = 3 cm; slide.max_rate = 1 m/s;"
        "  slide.max_acceleration = 9 m/s^2; }",
    },
    ("metric", "final"): {"metric": "final { of = hinge.q; }"},
    ("metric", "max"): {"metric": "max { of = hinge.qd; }"},
    ("metric", "min"): {"metric": "min { of = slide.qdd; }"},
    ("metric", "overshoot"): {"metric": "overshoot { of = slide.q; target = 0.1 m; }"},
    ("metric", "rms"): {"metric": "rms { of = hinge.tau; }", "servos": DRIVEN.format("rate(0.5 rad/s)")},
    ("metric", "settling_time"): {"metric": "settling_time { of = slide.q; target = 0.1 m; within = 5 cm; }"},
    **{("integrator", name): {"integrator": name} for name in models.find_own("integrator")},
    **{
        (kind, name): {
            "servos": DRIVEN.format("rate(0.5 rad/s)"), "substitute": f"substitute hinge {{ {kind} = {name}; }}"
        }
        for kind in ("bed", "law") for name in models.find_own(kind)
    },
}
PLAIN = {
    "more": "", "servos": "", "environment": "", "integrator": "modified_euler", "metric": "final { of = slide.q; }",
    "substitute": "", "guide": "",
}  # fmt: skip


def parameters(model: Any) -> tuple[Parameter, ...]:
    return (*getattr(model, "parameters", ()), *getattr(model, "of_joint", ()))


def test_every_model_has_a_small_deck() -> None:
    assert sorted(SMALLEST) == sorted(EVERY)


@pytest.mark.parametrize(("kind", "name"), EVERY)
def test_a_model_declares_what_its_numbers_are(kind: models.Kind, name: str) -> None:
    model = models.find(kind, name)
    assert model.name == name
    assert len(model.doc.split(". ")[0].split()) >= 3, "its own words begin with a sentence"
    words = {word: parse_unit("1") for word in ("joint", "effort", "command", "of")}
    held = [part for group in models.HELD for part in getattr(model, group, ())]
    for part in (*parameters(model), *held):
        assert part.doc, part.name
        parse_unit(part.unit, words)
    for parameter in parameters(model):
        if parameter.shape == "word" and parameter.words and parameter.default is not None:
            assert parameter.default in parameter.words, parameter.name
        if isinstance(parameter.default, float):
            assert parameter.above is None or parameter.default > parameter.above, parameter.name
            assert parameter.at_least is None or parameter.default >= parameter.at_least, parameter.name
    if kind == "servo":
        assert set(model.commands) <= set(COMMAND_UNIT)
        assert all(set(parameter.needed_for) <= set(model.commands) for parameter in parameters(model))
        assert (model.control is None) == (not model.outputs), "what a law gives, it has computed"
        assert model.control is not None or not model.commands, "a command reaches the law alone"
        known = {parameter.name: parameter.words for parameter in parameters(model)}
        for part in (*parameters(model), *held):
            assert part.only is None or set(part.only[1]) <= set(known[part.only[0]]), part.name


@pytest.mark.parametrize(("kind", "name"), EVERY)
def test_it_runs_from_a_small_deck_and_its_bits_depend_on_the_case_alone(
    kind: str, name: str, tmp_path: Path
) -> None:
    (tmp_path / "moves.csv").write_text("time [s], hinge [rad/s]\n0, 0\n0.1, 0.5\n0.2, 0.2\n", encoding="utf-8")
    sweep = experiment(tmp_path, DECK.format(**PLAIN | SMALLEST[kind, name]), select=["cases"])
    runs = [engine.run(sweep, threads=1, lanes=lanes) for lanes in (2, 8)]
    assert runs[0].cause == [""] * 7
    for one in runs[1:]:
        assert one.metrics["m"].tobytes() == runs[0].metrics["m"].tobytes()
        for channel, values in runs[0].signals.items():
            assert one.signals[channel].tobytes() == values.tobytes(), channel
    # plain floats: sines of the platform and no fused multiply-add, so some roundings apart, which 50 steps let grow
    inputs = {coordinate.path: float(coordinate.values[5]) for coordinate in sweep.cases.coordinates}
    rows, _ = execute(build(sweep), inputs, sweep.structure.schedule.ticks)
    kernel = np.concatenate([runs[0].signals[channel][5] for channel in ("q", "qd", "qdd", "tau")], axis=1)
    assert np.abs(kernel - rows).max() < 1e-10 * np.abs(rows).max()


@pytest.mark.parametrize("servo", [name for name, model in models.find_own("servo").items() if model.commands])
@pytest.mark.parametrize("course", sorted(COURSES))
def test_every_servo_takes_every_course_of_every_command_that_it_knows(
    servo: str, course: str, tmp_path: Path
) -> None:
    for command in models.find("servo", servo).commands:
        text = f"time [s], hinge [{UNITS[command]}]\n0, 0\n0.1, 0.5\n0.2, 0.2\n"
        (tmp_path / "moves.csv").write_text(text, encoding="utf-8")
        name = "gearbox" if servo == "rigid_gearbox" else "follow"
        uses = {"servos": f"hinge = {name} {{ command = {asked(command, course)}; }};"}
        deck = experiment(tmp_path, DECK.format(**PLAIN | uses), select=["it"])
        rows, _ = execute(build(deck), {}, deck.structure.schedule.ticks)
        assert np.isfinite(rows).all() and np.ptp(rows[:, 0]) > 0.0, command
