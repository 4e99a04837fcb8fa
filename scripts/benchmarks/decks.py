"""Decks of the measured arms; every joint has a `rigid_gearbox` with friction that sticks, or another servo."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import ic
from benchmarks.arms import GRAVITY, Arm
from met.plan import Experiment

CASES = 512
RATE = 0.5  # rad/s

# A drive of a robot's size: N^2 J_m = 0.6 kg m^2, 1 N m of friction at the joint, h lambda = 0.33 at 1 kHz; a torque
# limit that no arm here comes near, so that no joint falls and turns back unasked.
SERVO = """servo gearbox {
    model = rigid_gearbox;
    ratio = 100;  kp = 0.5 V*s/rad;  ki = 5 V/rad;  v_max = 1000 V;  resistance = 0.5 ohm;  kt = 0.1 N*m/A;
    tau_max = 100 N*m;  j_m = 6e-5 kg*m^2;  f_c = 0.01 N*m;  f_v = 1e-5 N*m*s/rad;
}
"""

COMMANDS = {
    # all joints turn on and on, and start as fast as they are told to
    "steady": (f"rate({RATE} rad/s)", RATE),
    # every joint turns back fifty times a second, no two joints of an arm at one time
    "reversing": (f"rate(sine(amplitude = {RATE} rad/s, frequency = 25 Hz, phase = {{phase}} rad))", 0.0),
}


@dataclass(frozen=True)
class Variant:
    """Differences of a deck from the usual one.

    servo        keys of the servo that each joint has, in the stead of the gearbox's
    like         whether these are besides the gearbox's
    command      what each joint is told, "" for a servo that takes no command
    environment  entries besides gravity;  base: of a run;  body: mass and inertia of the base's link
    payload      keys of a payload that the run has, "" for none;  sensor: a sensor of a link, likewise
    rate         of dynamics and servos;  run: further entries of the run
    """

    servo: str = ""
    like: bool = True
    command: str | None = None
    environment: str = ""
    base: str = "fixed"
    payload: str = ""
    sensor: str = ""
    rate: str = "1 kHz"
    run: str = ""
    body: str = "mass = 1000 kg; inertia = [900, 1000, 1100] kg*m^2;"


@cache
def experiment(arm: Arm, command: str, record: bool = False, variant: Variant | None = None) -> Experiment:
    """512 cases from 512 poses, 2 s in steps of 1 ms, servos at 1 kHz. command: `steady` or `reversing`.

    record   keeps q and qd of each step; else as little as a deck may
    variant  another servo, environment or base
    """
    text, start = COMMANDS[command]
    spec = variant or Variant()
    text = text if spec.command is None else spec.command
    command_line = f"command = {text};" if text else ""
    lines, uses, states, poses = [SERVO, f"servo used {'like gearbox ' * spec.like}{{ {spec.servo} }}"], [], [], []
    lines += ["arm measured {", *([f"    link base {{ {spec.body} }}"] if spec.base != "fixed" else [])]
    for i, body in enumerate(arm.bodies()):
        vectors = {
            "at": (body.at, "m"), "rpy": (body.rpy, "rad"), "com": (body.com, "m"), "inertia": (body.inertia, "kg*m^2"),
        }  # fmt: skip
        place, rpy, com, inertia = (
            f"[{', '.join(f'{x:.17g}' for x in values)}] {unit}" for values, unit in vectors.values()
        )
        parent = "base" if body.parent < 0 else arm.bodies()[body.parent].name
        axis = "" if body.kind == "fixed" else " axis = z;"
        lines.append(f"    link {body.name} {{ mass = {body.mass:.17g} kg; com = {com}; inertia = {inertia}; }}")
        lines.append(
            f"    joint {body.joint} {body.kind} {{ parent = {parent}; child = {body.name}; at = {place}; rpy = {rpy};"
            f"{axis} }}"
        )
        if body.kind != "fixed":
            uses.append(f"{body.joint} = used {{ {command_line.format(phase=f'{0.7 * i:.1f}')} }}")
            states.append(f"{body.joint}.qd = {start} rad/s;")
            poses.append(f"initial.{body.joint}.q = linspace({-3.0 + 0.1 * i:g}, {3.0 - 0.07 * i:g}, {CASES}) rad;")
    lines += [
        "}", "run one {", "    arm = measured;", f"    {spec.run}",
        f"    servos {{ {' '.join(uses)} }}",
        f"    initial {{ {' '.join(states)} }}",
        f"    environment {{ gravity = [{', '.join(map(str, GRAVITY))}] m/s^2; {spec.environment} }}",
        *([f"    base = {spec.base}"] if spec.base != "fixed" else []),
        *([f"    payload weight {{ {spec.payload} }}"] if spec.payload else []),
        *([f"    sensor reads = {spec.sensor}"] if spec.sensor else []),
        f"    rates {{ dynamics = {spec.rate}; servos = {spec.rate}; record = 1 kHz; }}",
        "    duration = 2 s;",
        "    record = [q, qd];" if record else f"    record = [{arm.joints[0]}.q];",
        "}",
        f"sweep poses of one {{ zip {{ {' '.join(poses)} }} }}",
    ]  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "measured.ic"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return ic.compile(path, select=["poses"]).experiments[0]
