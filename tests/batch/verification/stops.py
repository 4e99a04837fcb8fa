"""Decks of random arms that meet stops, with dry friction and delayed tachometers, as text, from a seed."""

from __future__ import annotations

import random

METRICS = """metric m_final{0} = final {{ of = j{0}.q; }}  metric m_rms{0} = rms {{ of = j{0}.qd; }}
    metric m_max{0} = max {{ of = j{0}.q; }}  metric m_min{0} = min {{ of = j{0}.qd; }}
    metric m_peak{0} = peak {{ of = j{0}.qd; }}  metric m_tau{0} = peak {{ of = j{0}.tau; }}
    metric m_always{0} = always {{ of = abs(j{0}.qd) < 2 rad/s;  after = 0.2 s; }}
    metric m_never{0} = never {{ of = j{0}.q > 0.3 rad;  after = 0.1 s;  within = 1 s; }}
    metric m_share{0} = share_of_time {{ of = abs(j{0}.qd) > 0.1 rad/s; }}
    metric m_over{0} = overshoot {{ of = j{0}.q;  target = 0.3 rad; }}"""

INSTANTS = """metric m_rest = settling_time { of = j0.qd;  target = 0 rad/s;  within = 0.05 rad/s; }
    metric m_hold = holds_for { of = abs(j0.qd) < 0.3 rad/s;  time = 0.2 s; }"""


def deck(seed: int) -> str:
    """A deck with one run of 2 s of 1 to 3 revolute joints, most of them with gravity and stops; the same text for the
    same seed. Dynamics at 500 Hz to 2 kHz, servos at 250 or 500 Hz."""
    pick = random.Random(seed)

    def number(low: float, high: float) -> str:
        return f"{pick.uniform(low, high):.4g}"

    count = pick.choice([1, 1, 2, 2, 3])
    lengths = [number(0.2, 0.8) for _ in range(count)]
    arm, servos, stops = [], [], []
    for i in range(count):
        at, axis = (lengths[i - 1], pick.choice(["-y", "z", "y", "x"])) if i else ("0", pick.choice(["-y", "z"]))
        arm.append(f"link l{i} {{ mass = {number(0.5, 6)} kg;  shape = rod(length = {lengths[i]} m, along = x); }}")
        parent = f"l{i - 1}" if i else "base"
        arm.append(f"joint j{i} revolute {{ parent = {parent}; child = l{i}; axis = {axis}; at = [{at}, 0, 0] m; }}")
        command = pick.choice([
            f"rate({number(0.2, 0.8)} rad/s)",
            f"rate(-{number(0.2, 0.8)} rad/s)",
            f"rate(sine(amplitude = {number(0.2, 0.8)} rad/s, frequency = {number(0.2, 2)} Hz))",
            f"position({number(-0.8, 0.8)} rad);  k_position = {number(2, 8)} 1/s",
            f"position(sine(amplitude = {number(0.1, 0.5)} rad, frequency = {number(0.3, 2)} Hz));  k_position = 4 1/s",
        ])  # fmt: skip
        filtered = f"filter = butterworth;  cutoff = {number(30, 100)} Hz;  delay = {pick.choice([0, 1, 2])};"
        sensor = f"sensor qd = tachometer {{ {filtered} }}" if pick.random() < 0.4 else ""
        friction = f"f_c = {number(0.005, 0.05)} N*m;" if pick.random() < 0.7 else ""
        servos.append(
            f"servo s{i} {{ model = rigid_gearbox;  ratio = {number(40, 110)};  kp = {number(0.02, 0.1)} V*s/rad;\n"
            f"    ki = {number(0.1, 0.5)} V/rad;  v_max = {pick.choice([4, 24, 60])} V;  resistance = 1.2 ohm;\n"
            f"    kt = 0.08 N*m/A;  tau_max = {pick.choice([1, 8])} N*m;  j_m = {number(1e-4, 3e-4)} kg*m^2;\n"
            f"    {friction} {sensor} command = {command}; }}"
        )
        if pick.random() < (0.9 if i == 0 else 0.3):
            stops.append(
                f"st{i} = joint_stop {{ joint = j{i};  upper = {number(0.1, 0.6)} rad;\n"
                f"    lower = -{number(0.1, 0.6)} rad;  stiffness = {number(1000, 9000)} N*m/rad;\n"
                f"    dissipation = {number(0.05, 0.9)} s/rad; }}"
            )
    gravity = "g = gravity { g = [0, 0, -9.81] m/s^2; }" if pick.random() < 0.8 else ""
    return "\n".join([
        *servos, "arm a {", *arm, "}", "run r {",
        f"    arm = a;  servos {{ {' '.join(f'j{i} = s{i};' for i in range(count))} }}",
        f"    environment {{ {gravity} {' '.join(stops)} }}",
        f"    rates {{ dynamics = {pick.choice([500, 1000, 2000])} Hz;  servos = {pick.choice([250, 500])} Hz;"
        "  record = 125 Hz; }",
        "    duration = 2 s;  record = [q];", *(METRICS.format(i) for i in range(count)), INSTANTS, "}", "",
    ])  # fmt: skip
