"""Decks of random arms, as text: trees of revolute and prismatic joints with servos, loads and rates, from a seed."""

from __future__ import annotations

import random
import re

from met import units

GEARBOX = """servo {name} {{
    model = rigid_gearbox;
    ratio = {ratio} {ratio_unit};  kp = {kp} V*s/rad;  ki = {ki} V/rad;  v_max = 20 V;
    resistance = 2 ohm;  kt = 0.06 N*m/A;  tau_max = {tau_max} N*m;  j_m = 5e-4 kg*m^2;
    f_c = {f_c} N*m;  f_v = 1e-5 N*m*s/rad;  k_position = 2 Hz;
    command = {command};
}}
"""


def random_loops(seed: int) -> tuple[str, str]:
    """A deck with loops, lists by index and names taken together, and one of the same meaning without; each has a run.

    Chains of 1 to 4 links on each of 1 to 3 sides, revolute or prismatic, of which some joints have servos.
    """
    pick = random.Random(seed)
    sides = pick.sample(["left", "right", "mid"], pick.randint(1, 3))
    count, first = pick.randint(1, 4), pick.randint(-1, 3)
    lengths = [round(pick.uniform(0.2, 0.9), 3) for _ in range(count)]
    masses = pick.choice([f"(5 + i * {pick.randint(1, 3)}) kg", "2.5 kg"])
    kind = pick.choice(["revolute", "prismatic"])
    unit = "rad" if kind == "revolute" else "m"
    last, step = first + count - 1, pick.choice([1, -1])
    shift = 1 - first  # names count from 1
    turns = [first + n for n in range(count)]
    link = "link {name} {{ mass = {mass};  shape = rod(length = {length}, along = x); }}"
    joint = "joint {name} " + kind + " {{ parent = {parent};  child = {child};  axis = z;  at = {at}; }}"
    with_loops, without = [], []
    with_loops.append(f"for i in {first} .. {last} {{ for side in [{', '.join(sides)}] {{")
    with_loops.append(link.format(name=f"{{side}}_{{i+{shift}}}", mass=masses, length=f"lengths[i + {shift - 1}]"))
    with_loops.append("} }")
    for i in turns:
        for side in sides:
            mass = masses.replace("i *", f"{i} *")
            without.append(link.format(name=f"{side}_{i + shift}", mass=mass, length=f"{lengths[i - first]} m"))
    with_loops.append(f"for side in [{', '.join(sides)}] {{")
    with_loops.append(joint.format(name="j_{side}_1", parent="base", child="{side}_1", at="[0 m, 0 m, 0 m]"))
    with_loops.append(f"for n in 2 .. {count} {{")
    with_loops.append(
        joint.format(
            name="j_{side}_{n}", parent="{side}_{n-1}", child="{side}_{n}", at="[lengths[n - 2], 0 m, (n * 5) cm]"
        )
    )
    with_loops.append("} }")
    for side in sides:
        without.append(joint.format(name=f"j_{side}_1", parent="base", child=f"{side}_1", at="[0 m, 0 m, 0 m]"))
        for n in range(2, count + 1):
            at = f"[{lengths[n - 2]} m, 0 m, {n * 5} cm]"
            parent, child = f"{side}_{n - 1}", f"{side}_{n}"
            without.append(joint.format(name=f"j_{side}_{n}", parent=parent, child=child, at=at))
    joints = [f"j_{side}_{n}" for side in sides for n in range(1, count + 1)]
    own = pick.sample(joints, pick.randint(0, len(joints) - 1))
    order = range(count, 0, -1) if step < 0 else range(1, count + 1)
    ends = f"{count} .. 1 by -1" if step < 0 else f"1 .. {count}"
    peaks = "metric peak_{0} = max {{ of = j_{1}_{0}.q; }} require peak_{0} < {0} {2};"
    run = "rates {{ dynamics = 500 Hz;  servos = 250 Hz;  record = 50 Hz; }} duration = 0.2 s;  record = [q]; {}"
    servo = f"servo {{}} {{{{ model = ideal;  bandwidth = 20 1/s;  command = rate({{}} {unit}/s); }}}}"
    servos = [servo.format("one", 0.1), servo.format("two", 0.2)]
    start = f"0.1 {unit}"
    looped = peaks.format("{n}", sides[0], unit).replace("{n} " + unit, f"n {unit}")
    named = f"[{', '.join(own)}]"
    two, begun = (f"{named} = two;", f"{named}.q = {start};") if own else ("", "")
    one = "\n".join([
        f"let lengths = [{', '.join(map(str, lengths))}] m;", *servos, "arm made {", *with_loops, "}",
        f"run it {{ arm = made;  servos {{ * = one;  {two} }}",
        f"initial {{ {begun} }}", run.format(f"for n in {ends} {{ {looped} }}"), "}", "",
    ])  # fmt: skip
    uses = " ".join(f"{each} = {'two' if each in own else 'one'};" for each in joints)
    begins = " ".join(f"{each}.q = {start};" for each in own)
    other = "\n".join([
        *servos, "arm made {", *without, "}", f"run it {{ arm = made;  servos {{ {uses} }} initial {{ {begins} }}",
        run.format(" ".join(peaks.format(n, sides[0], unit) for n in order)), "}", "",
    ])  # fmt: skip
    return one, other


def random_deck(seed: int, *, friction: bool = True) -> str:
    """A deck with one run; the same text for the same seed.

    1 to 5 joints on 1 to 5 links (a link may carry several), some without a servo, gravity or none, velocity products
    on or off, joints that begin anywhere or as their commands do, dynamics from 250 Hz to 1 kHz, servos slower or
    faster; 0.4 s long. The gear and rotor are such that the stability figure stays below 0.5 at 250 Hz.
    """
    pick = random.Random(seed)
    newer = random.Random(f"{seed}: words that came later")  # of its own, so that all else stays as it was

    def number(low: float, high: float) -> str:
        return f"{pick.uniform(low, high):.4f}"

    def pulse(unit: str) -> str:
        to, over, rise = newer.uniform(-1, 1), newer.uniform(0.1, 0.2), newer.uniform(0.02, 0.05)
        return f"pulse(to = {to:.4f} {unit}, slope = {abs(to) / rise + 1:.4f} {unit}/s, over = {over:.4f} s)"

    def start(joint: int, unit: str, kind: str) -> str:
        """Where a joint begins; kind: of its command, if it has one."""
        q, qd = f"{number(-1, 1)} {unit}", f"{number(-1, 1)} {unit}/s"
        if kind == "position" and newer.random() < 0.5:
            q = "command"
        if kind in ("position", "rate") and newer.random() < 0.5:
            qd = "command"
        return f"j{joint}.q = {q}; j{joint}.qd = {qd};"

    def vector(size: float, unit: str) -> str:
        return "[" + ", ".join(number(-size, size) for _ in range(3)) + f"] {unit}"

    count = pick.randint(1, 5)
    arm, servos, uses = [], [], []
    joint_units, commands = [], {}
    for i in range(count):
        prismatic = pick.random() < 0.3
        parent = "base" if i == 0 else pick.choice([f"link{j}" for j in range(i)])
        kind = "prismatic" if prismatic else "revolute"
        shape = pick.choice(
            [
                f"rod(length = {number(0.2, 1)} m, along = {pick.choice('xyz')})",
                f"box(size = [{number(0.1, 1)}, {number(0.1, 1)}, {number(0.1, 1)}] m)",
                f"cylinder(radius = {number(0.05, 0.2)} m, length = {number(0.2, 1)} m, along = {pick.choice('xyz')})",
            ]
        )
        arm.append(f"    link link{i} {{ mass = {number(0.5, 10)} kg; shape = {shape}; }}")
        arm.append(
            f"    joint j{i} {kind} {{ parent = {parent}; child = link{i}; axis = {pick.choice(['x', 'y', 'z', '-x'])};"
            f" at = {vector(0.6, 'm')}; rpy = {vector(3, 'rad')}; }}"
        )
        joint, effort = ("m", "N") if prismatic else ("rad", "N*m")
        joint_units.append(joint)
        if pick.random() < 0.85:
            commands[i] = kind = pick.choice(["rate", "rate", "position", "torque"])
            unit = {"rate": f"{joint}/s", "position": joint, "torque": effort}[kind]
            course = pick.choice(
                [
                    f"{number(-1, 1)} {unit}",
                    f"sine(amplitude = {number(0.1, 1)} {unit}, frequency = {number(1, 4)} Hz)",
                    f"ramp(to = {number(-1, 1)} {unit}, begin = 0.05 s, over = 0.2 s)",
                    f"step(to = {number(-1, 1)} {unit}, at = 0.1 s)",
                    f"table(times = [0, 0.1, 0.25] s, values = [0, {number(-1, 1)}, {number(-1, 1)}] {unit})",
                ]
            )
            course = pulse(unit) if newer.random() < 0.25 else course
            f_c = number(0.001, 0.05) if friction and pick.random() < 0.6 else "0"
            servos.append(
                GEARBOX.format(
                    name=f"servo{i}",
                    ratio=number(60, 150),
                    ratio_unit="rad/m" if prismatic else "",
                    kp=number(0.02, 0.2),
                    ki=number(0.1, 1),
                    tau_max=number(0.1, 0.5),
                    f_c=f_c,
                    command=f"{kind}({course})",
                )
            )
            uses.append(f"j{i} = servo{i};")
    gravity = f"gravity = {vector(9.81, 'm/s^2')};" if pick.random() < 0.7 else ""
    damping = "drag = joint_damping { damping = 0.3 N*m*s/rad; sliding = 4 N*s/m; };" if pick.random() < 0.3 else ""
    dynamics = pick.choice(["250 Hz", "500 Hz", "1 kHz"])
    initial = " ".join(start(i, unit, commands.get(i, "")) for i, unit in enumerate(joint_units) if pick.random() < 0.5)
    return "\n".join(
        [
            *servos,
            "arm random {",
            *arm,
            "}",
            "run it {",
            f"    arm = random;  servos {{ {' '.join(uses)} }}",
            f"    initial {{ {initial} }}",
            f"    environment {{ {gravity} {damping} velocity_products = {pick.choice(['on', 'on', 'off'])}; }}",
            f"    rates {{ base = 1 kHz; dynamics = {dynamics}; servos = {pick.choice(['250 Hz', '1 kHz'])};"
            f" record = 250 Hz; }}",
            "    duration = 0.4 s;",
            "    record = [q, qd, qdd, tau];",
            "    metric peak = max { of = j0.q; }",
            "    metric size = rms { of = j0.qd; }",
            "}",
            "",
        ]
    )


def in_edition_2(text: str, seed: int) -> str:
    """A deck of edition 1 in edition 2, with the same parameters: some of its values have names of units, and some are
    in units that it declares; at least one of each, the first two values that are written so."""
    pick = random.Random(seed)
    behind = {"min", *re.findall(r"[*/(]\s*([A-Za-z]+)", text)}  # units that could be values where they stand
    names = [name for name in units.ALL_UNITS if name.isalpha() and name not in behind]
    pick.shuffle(names)
    head: list[str] = []

    def changed(found: re.Match[str]) -> str:
        number, unit = found["number"], found["unit"]
        named, declared = pick.random() < 0.3, pick.random() < 0.4
        if not head or (len(head) > 1 and named and names):
            head.append(f"let {names.pop()} = {number} ({unit});")
            return f"= {head[-1].split()[1]};"
        if len(head) == 1 or declared:
            head.append(f"unit own_{len(head)} = 1 {unit};")
            return f"= {number} own_{len(head) - 1};"
        return found[0]

    body = re.sub(r"= (?P<number>\d[\d.]*(?:e-?\d+)?) (?P<unit>[A-Za-z][A-Za-z*/^0-9]*);", changed, text)
    pick.shuffle(head)
    return "deck 2;\n" + "\n".join(head) + "\n" + body


def in_a_table(text: str, seed: int) -> tuple[str, str]:
    """A deck with the same parameters, whose masses and places of joints stand in `bodies.csv`, and that file's text:
    some of them, their rows in any order, with rows that nothing uses."""
    pick = random.Random(seed)
    rows = {"unused": ["9", "", "", ""]}

    def mass(found: re.Match[str]) -> str:
        if pick.random() < 0.2:
            return found[0]
        rows[found[1]] = [found[2], "", "", ""]
        return f"link {found[1]} {{ mass = bodies.{found[1]}.mass;"

    def place(found: re.Match[str]) -> str:
        if pick.random() < 0.2:
            return found[0]
        rows[found[1]] = ["", *found[3].split(", ")]
        return f"joint {found[1]} {found[2]} at = bodies.{found[1]}.at;"

    body = re.sub(r"link (\w+) \{ mass = (\S+) kg;", mass, text)
    body = re.sub(r"joint (\w+) ([^\n]*?) at = \[([^\]]*)\] m;", place, body)
    order = pick.sample(list(rows), len(rows))
    head = "name, mass [kg], at.x [m], at.y [m], at.z [m]"
    return f'let bodies = csv("bodies.csv");\n{body}', "\n".join([head, *(", ".join([n, *rows[n]]) for n in order), ""])
