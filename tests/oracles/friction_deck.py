"""Decks in which friction has much to do: arms whose every servo swings, sticks and slips under gravity, in a sweep."""

from __future__ import annotations

import random

SERVO = """
let level = 0.02 N*m;
let swing = 0.5 rad/s;
let away = 0.1 rad;
servo swinging {
    model = rigid_gearbox;
    ratio = 120;  kp = 0.1 V*s/rad;  ki = 0.5 V/rad;  v_max = 20 V;  resistance = 2 ohm;  kt = 0.06 N*m/A;
    tau_max = 0.3 N*m;  j_m = 5e-4 kg*m^2;  f_c = level;  f_v = 1e-5 N*m*s/rad;
    command = rate(sine(amplitude = swing, frequency = 1.3 Hz));
}
"""


def friction_deck(joints: int, cases: int, *, duration: str = "1.6 s", limbs: bool = False) -> str:
    """A deck with the sweep `many` of a chain, or with `limbs` of a trunk of six joints with limbs of six.

    400 steps at 250 Hz with servos at 1 kHz. The sweep varies the level of friction (a fifth of the cases has none, so
    no events), how far and from where the arm swings, and the mass at a tip.
    """
    pick = random.Random(joints)
    lines = ["arm swung {"]
    for i in range(joints):
        parent = 5 if limbs and i > 5 and not i % 6 else i - 1
        lines.append(
            f"    link link{i} {{ mass = {pick.uniform(0.3, 0.8):.3f} kg;"
            f" shape = rod(length = 0.2 m, along = {pick.choice('xyz')}); }}"
        )
        lines.append(
            f"    joint j{i} revolute {{ parent = {'base' if parent < 0 else f'link{parent}'}; child = link{i};"
            f" axis = {pick.choice(['z', 'y', '-x'])}; at = [{pick.uniform(0, 0.2):.3f}, 0, {0.1 * (i % 2)}] m;"
            f" rpy = [{90 * (i % 2)}, 0, {15 * (i % 3)}] deg; }}"
        )
    lines.append("}")

    def listed(values: list[float], unit: str) -> str:
        return "[" + ", ".join(f"{x:.4f}" for x in values) + f"] {unit}"

    levels = [0.0 if case % 5 == 2 else pick.uniform(0.005, 0.05) for case in range(cases)]
    return SERVO + "\n".join(
        [
            *lines,
            "run back_and_forth {",
            f"    arm = swung;  servos {{ {' '.join(f'j{i} = swinging;' for i in range(joints))} }}",
            "    initial { j0.q = away; }",
            "    environment { gravity = [0, 0, -9.81] m/s^2; }",
            "    rates { base = 1 kHz; dynamics = 250 Hz; servos = 1 kHz; record = 50 Hz; }",
            f"    duration = {duration};",
            "    record = [q, qd, qdd, tau];",
            "    metric top = max { of = j0.qd; }",
            "}",
            "sweep many of back_and_forth {",
            "    zip {",
            f"        level = {listed(levels, 'N*m')};",
            f"        swing = {listed([pick.uniform(0.0, 1.5) for _ in range(cases)], 'rad/s')};",
            f"        away = {listed([pick.uniform(-1.0, 1.0) for _ in range(cases)], 'rad')};",
            f"        links.link{joints - 1}.mass = {listed([pick.uniform(0.2, 1.0) for _ in range(cases)], 'kg')};",
            "    }",
            "}",
            "",
        ]
    )
