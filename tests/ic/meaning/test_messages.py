"""Whole messages, as a terminal without colours shows them."""

from __future__ import annotations

from pathlib import Path

import pytest

from ic.meaning.expressions import conditions
from tests.ic.small_decks import ARM, LIGHT, RUN, SERVO, changed, check, messages, shown

MISTAKES: dict[str, tuple[tuple[str, str], str]] = {
    "an unknown key": (
        ("ratio = 100;", "ratio = 100; kpp = 3;"),
        """\
error[D141]: servo `drive` has no `kpp`
 --> deck.ic:7:18
  |
7 |     ratio = 100; kpp = 3; kp = 0.1 V*s/rad; ki = 1 V/rad; v_max = 24 V; resistance = 1 ohm; kt = 0.05 N*m/A;
  |                  ^^^
  = help: did you mean `kp`?
  = help: it has: ratio, kp, ki, v_max, k_position, resistance, kt, tau_max, j_m, f_c, f_v, friction, model, command, rate
""",
    ),
    "a wrong unit": (
        ("ratio = 100", "ratio = 36 mm"),
        """\
error[D061]: `ratio` of servo `drive` is a pure number, and this is in m
 --> deck.ic:7:13
  |
7 |     ratio = 36 mm; kp = 0.1 V*s/rad; ki = 1 V/rad; v_max = 24 V; resistance = 1 ohm; kt = 0.05 N*m/A;
  |             ^^^^^
  = help: leave the unit out; `%` is the only unit of a pure number
""",
    ),
    "a bare number": (
        ("0.1 V*s/rad", "0.1"),
        """\
error[D060]: `kp` of servo `drive` is in V*s/rad, and this is a bare number
 --> deck.ic:7:23
  |
7 |     ratio = 100; kp = 0.1; ki = 1 V/rad; v_max = 24 V; resistance = 1 ohm; kt = 0.05 N*m/A;
  |                       ^^^
  = help: write `0.1 V*s/rad`
""",
    ),
    "a unit inside brackets that have one": (
        ("axis = z;", "axis = z; at = [0, 1 mm, 0] m;"),
        """\
error[D062]: a unit inside brackets that have one after them, `m`
 --> deck.ic:3:77
  |
3 |     joint hinge revolute { parent = base; child = bar; axis = z; at = [0, 1 mm, 0] m; }
  |                                                                             ^^
 ::: deck.ic:3:84  this one is for all the bare numbers inside
  = help: give each number its own unit, or none of them
""",
    ),
    "rates that do not divide": (
        ("servos = 1 kHz", "servos = 300 Hz"),
        """\
error[D100]: `servos` at 300 Hz does not divide the base rate, 1000 Hz
  --> deck.ic:14:40
   |
14 |     rates { dynamics = 1 kHz; servos = 300 Hz; record = 100 Hz; }
   |                                        ^^^^^^ 1000/300 = 3.333
  ::: deck.ic:14:24  base rate set here: the fastest, `dynamics`
   = help: nearest that fit: 333.333 Hz, written (1000/3) Hz, 250 Hz (1000/4)
   = help: or a base rate that all divide: `base = 3000 Hz;` in `rates`
""",
    ),
    "a duration between steps": (
        ("1 s", "1.0005 s"),
        """\
error[D101]: a duration of 1.0005 s is 1000.5 steps of the dynamics
  --> deck.ic:15:16
   |
15 |     duration = 1.0005 s;
   |                ^^^^^^^^
  ::: deck.ic:14:24  a step is 0.001 s
   = help: nearest that fit: 1 s, 1.001 s
""",
    ),
    "a servo on no joint": (
        ("hinge = drive", "hing = drive"),
        """\
error[D144]: no joint `hing` in arm `swing`
  --> deck.ic:13:14
   |
13 |     servos { hing = drive; }
   |              ^^^^
   = help: did you mean `hinge`?
   = help: joints: hinge
""",
    ),
    "a model where a definition belongs": (
        ("hinge = drive", "hinge = rigid_gearbox"),
        """\
error[D147]: `rigid_gearbox` is a servo model; a servo definition is needed here
  --> deck.ic:13:22
   |
13 |     servos { hinge = rigid_gearbox; }
   |                      ^^^^^^^^^^^^^
   = help: a standard deck defines a servo of this name: add `#include <servos/rigid_gearbox.ic>`
   = help: `servo NAME { model = rigid_gearbox; ... }`, and `hinge = NAME;`
""",
    ),
    "an unknown model": (
        ("rigid_gearbox", "rigid_gearbx"),
        """\
error[D140]: no servo model `rigid_gearbx`
 --> deck.ic:6:13
  |
6 |     model = rigid_gearbx;
  |             ^^^^^^^^^^^^
  = help: did you mean `rigid_gearbox`?
  = help: servo models: cascade, compliant_gearbox, external, ideal, locked, passive, rigid_gearbox
""",
    ),
    "a model with its parameters behind its name": (
        ("model = rigid_gearbox;", "model = rigid_gearbox(f_c = 1 N*m);"),
        """\
error[D143]: `model = rigid_gearbox` takes neither parentheses nor braces
 --> deck.ic:6:13
  |
6 |     model = rigid_gearbox(f_c = 1 N*m);
  |             ^^^^^^^^^^^^^^^^^^^^^^^^^^
  = help: write `model = rigid_gearbox;`, and its parameters beside it
""",
    ),
    "an integrator with parameters": (
        ("duration", "integrator = rk4 { step = 1 ms; }  duration"),
        """\
error[D143]: `integrator = rk4` takes neither parentheses nor braces
  --> deck.ic:15:18
   |
15 |     integrator = rk4 { step = 1 ms; }  duration = 1 s;
   |                  ^^^
   = help: write `integrator = rk4;`: an integrator has no parameters
""",
    ),
    "a parent with arguments": (
        ("parent = base;", "parent = base(2);"),
        """\
error[D094]: a link's name is needed for parent
 --> deck.ic:3:37
  |
3 |     joint hinge revolute { parent = base(2); child = bar; axis = z; }
  |                                     ^^^^^^^
  = help: links: base, bar
""",
    ),
    "a shape with a value without a name": (
        ("rod(length = 1 m,", "rod(2 m, length = 1 m,"),
        """\
error[D153]: `rod` takes its values by name
 --> deck.ic:2:41
  |
2 |     link bar { mass = 2 kg; shape = rod(2 m, length = 1 m, along = x); }
  |                                         ^^^
  = help: write `rod(length = ..., along = ...)`
""",
    ),
    "a metric with a value without a name": (
        ("duration", "metric top = max(hinge.q, of = hinge.qd);\n    duration"),
        """\
error[D153]: `max` takes its values by name
  --> deck.ic:15:22
   |
15 |     metric top = max(hinge.q, of = hinge.qd);
   |                      ^^^^^^^
   = help: write `max(of = ..., after = ..., within = ...)`
""",
    ),
    "a metric of what is no channel": (
        ("duration", "metric top = max { of = [hinge.q]; }\n    duration"),
        """\
error[D071]: one number is needed here, and this is a list
  --> deck.ic:15:29
   |
15 |     metric top = max { of = [hinge.q]; }
   |                             ^^^^^^^^^
""",
    ),
    "a servo without a command": (
        ("    command = rate(0.1 rad/s);\n", ""),
        """\
error[D149]: servo `drive` has no command
  --> deck.ic:12:22
   |
12 |     servos { hinge = drive; }
   |                      ^^^^^
   = help: write `command = rate(...);`, in the definition or for this joint
   = help: rigid_gearbox takes rate(...), position(...), torque(...)
""",
    ),
    "a table without values": (
        ("0.1 rad/s", "table(times = [0, 2] s)"),
        """\
error[D075]: `table` has no `values`
 --> deck.ic:9:20
  |
9 |     command = rate(table(times = [0, 2] s));
  |                    ^^^^^
  = help: write `values = [...] rad/s` (values at `times`, one for each)
""",
    ),
    "an unknown channel": (
        ("[q]", "[q, hinge.servo.volts]"),
        """\
error[D125]: no channel `hinge.servo.volts`
  --> deck.ic:16:18
   |
16 |     record = [q, hinge.servo.volts];
   |                  ^^^^^^^^^^^^^^^^^
   = help: did you mean `hinge.servo.voltage`?
   = help: channels of `hinge`: hinge.q, hinge.qd, hinge.qdd, hinge.tau, hinge.tau_load, hinge.J_eff, hinge.b, hinge.mode, hinge.reaction, hinge.servo.command, hinge.servo.voltage, hinge.servo.integral, hinge.servo.motor_rate, hinge.servo.motor_torque
""",
    ),
    "an entry of a block written as a path": (
        ("duration", "rates.base = 2 kHz;\n    duration"),
        """\
error[D109]: a run has no `rates.base`
  --> deck.ic:15:5
   |
15 |     rates.base = 2 kHz;
   |     ^^^^^^^^^^
   = help: write `base = 2 kHz;` in the run's `rates { ... }`
""",
    ),
    "something appended to a list of a name that is not there": (
        ("record = [q];", "record = [q]; recrod += [qd];"),
        """\
error[D056]: nothing is in `recrod` yet to append to
  --> deck.ic:16:19
   |
16 |     record = [q]; recrod += [qd];
   |                   ^^^^^^
   = help: did you mean `record`?
""",
    ),
}
"""A change of the small deck, and what is said of it."""


@pytest.mark.parametrize(("change", "said"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_this_message(tmp_path: Path, change: tuple[str, str], said: str) -> None:
    assert shown(tmp_path, changed(ARM + SERVO + RUN, change)) == said


def test_hertz_where_an_angular_rate_belongs(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, "let slow = 0.1 Hz;\n", ARM, changed(SERVO, ("0.1 rad/s", "slow")), RUN)
        == """\
error[D061]: the command of servo `drive` is in rad/s, and this is in 1/s
  --> deck.ic:10:20
   |
10 |     command = rate(slow);
   |                    ^^^^
  ::: deck.ic:1:5  `slow` is defined here
   = help: Hz counts cycles without an angle: write rad/s, deg/s, rpm or cycle/s
"""
    )


def test_an_unknown_name(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, changed(ARM, ("2 kg", "mas")), "let mass = 2 kg;\n", SERVO, RUN)
        == """\
error[D065]: no value `mas`
 --> deck.ic:2:23
  |
2 |     link bar { mass = mas; shape = rod(length = 1 m, along = x); }
  |                       ^^^
  = help: did you mean `mass`?
"""
    )


def test_a_joint_loop(tmp_path: Path) -> None:
    deck = (
        changed(
            ARM,
            ("parent = base", "parent = tip"),
            (
                "axis = z; }",
                "axis = z; }\n    link tip { mass = 1 kg; shape = sphere(radius = 1 cm); }\n    joint wrist revolute { parent = bar; child = tip; axis = x; }",
            ),
        ),
        SERVO,
        RUN,
    )
    assert (
        shown(tmp_path, *deck)
        == """\
error[D086]: these joints make a loop, which hangs on no base: bar -> tip -> bar
 --> deck.ic:3:5
  |
3 |     joint hinge revolute { parent = tip; child = bar; axis = z; }
  |     ^^^^^^^^^^^^^^^^^^^^ joint `hinge` closes it
 ::: deck.ic:5:5  joint `wrist`
  = help: one of them should have `parent = base;`
"""
    )


def test_a_negative_mass_that_came_through_a_macro(tmp_path: Path) -> None:
    deck = (
        "#define BAR(MASS) link bar { mass = MASS; shape = sphere(radius = 1 cm); }\n",
        changed(ARM, ("link bar { mass = 2 kg; shape = rod(length = 1 m, along = x); }", "BAR(-2 kg)")),
        SERVO,
        RUN,
    )
    assert (
        shown(tmp_path, *deck)
        == """\
error[D077]: `mass` of link `bar` must be at least 0 kg
 --> deck.ic:3:9
  |
3 |     BAR(-2 kg)
  |         ^^^^^ this is -2 kg
  = help: write a number of at least 0 kg (mass of the link)
  = note: in expansion of macro BAR, used at deck.ic:3:5
"""
    )


def test_an_inertia_that_no_body_has(tmp_path: Path) -> None:
    deck = (changed(ARM, ("shape = rod(length = 1 m, along = x)", "inertia = [1, 1, 3] kg*m^2")), SERVO, RUN)
    assert (
        shown(tmp_path, *deck)
        == """\
error[D087]: the inertia of link `bar` is no body's
 --> deck.ic:2:39
  |
2 |     link bar { mass = 2 kg; inertia = [1, 1, 3] kg*m^2; }
  |                                       ^^^^^^^^^^^^^^^^ principal moments 1, 1 and 3 kg*m^2; no body has one above the sum of the others
  = help: inertia is about the centre of mass, in link axes: [xx, yy, zz] or [xx, yy, zz, xy, xz, yz] kg*m^2
  = help: products have the sign of -sum(m x y)
  = help: if it is of an identified set (base parameters), which need be no body's: write `lumped = on;` in the link
"""
    )


@pytest.mark.parametrize("at_once", [1, 3, 100])
def test_an_inertia_that_some_cases_have_is_told_by_the_first_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at_once: int
) -> None:
    monkeypatch.setattr(conditions, "PIECE", at_once)
    arm = changed(ARM, ("shape = rod(length = 1 m, along = x)", "inertia = [1, 1, turned] kg*m^2"))
    sweep = "default sweep many of hold { vary turned = linspace(1.5, 3, 7); }\n"
    said = shown(tmp_path, "let turned = 1;\n", arm, SERVO, RUN, sweep)
    assert "the inertia of link `bar` is no body's; case #3 breaks it, and 3 more\n" in said
    assert "principal moments 1, 1 and 2.25 kg*m^2; no body has one above the sum of the others\n" in said


def test_a_link_in_the_air(tmp_path: Path) -> None:
    deck = (
        changed(ARM, ("joint hinge", "link tip { mass = 1 kg; shape = sphere(radius = 1 cm); }\n    joint hinge")),
        SERVO,
        RUN,
    )
    assert (
        shown(tmp_path, *deck)
        == """\
error[D099]: link `tip` hangs in the air: no joint of arm `swing` has it for a child
 --> deck.ic:3:5
  |
3 |     link tip { mass = 1 kg; shape = sphere(radius = 1 cm); }
  |     ^^^^^^^^
  = help: write `joint NAME revolute { parent = base; child = tip; axis = z; }`
"""
    )


def test_an_unstable_step(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, LIGHT, changed(SERVO, ("1e-4", "1e-6")), RUN)
        == """\
error[D104]: servo `drive` is unstable with modified_euler at this rate of the dynamics
  --> deck.ic:14:24
   |
14 |     rates { dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }
   |                        ^^^^^ h * lambda = 2.5; the slowest rate that fits is 2000 Hz
   = help: h * lambda must stay below 2; lambda is the servo's fastest rate constant, on any arm
"""
    )


def test_an_environment_with_a_value_without_a_name(tmp_path: Path) -> None:
    run = changed(RUN, ("duration", "environment { oil = joint_damping(2, damping = 1 N*m*s/rad); }\n    duration"))
    assert (
        shown(tmp_path, ARM, SERVO, run)
        == """\
error[D153]: `joint_damping` takes its values by name
  --> deck.ic:15:39
   |
15 |     environment { oil = joint_damping(2, damping = 1 N*m*s/rad); }
   |                                       ^
   = help: write `joint_damping(damping = ..., sliding = ...)`
"""
    )


def test_a_table_whose_times_do_not_rise(tmp_path: Path) -> None:
    deck = (ARM, changed(SERVO, ("0.1 rad/s", "table(times = [0, 2, 1] s, values = [0, 1, 2] rad/s)")), RUN)
    assert (
        shown(tmp_path, *deck)
        == """\
error[D156]: `times` of `table` must rise, and number 3, 1 s, follows 2 s
 --> deck.ic:9:34
  |
9 |     command = rate(table(times = [0, 2, 1] s, values = [0, 1, 2] rad/s));
  |                                  ^^^^^^^^^^^
  = help: sort the points; for a jump, two times close together
"""
    )


def test_a_table_with_a_value_too_many(tmp_path: Path) -> None:
    deck = (ARM, changed(SERVO, ("0.1 rad/s", "table(times = [0, 2] s, values = [0, 1, 2] rad/s)")), RUN)
    assert (
        shown(tmp_path, *deck)
        == """\
error[D154]: `values` of `table` has 3 numbers, and `times` 2
 --> deck.ic:9:53
  |
9 |     command = rate(table(times = [0, 2] s, values = [0, 1, 2] rad/s));
  |                                                     ^^^^^^^^^^^^^^^
 ::: deck.ic:9:34  `times`
  = help: they go together, one to one
"""
    )


def test_an_unknown_metric(tmp_path: Path) -> None:
    deck = (
        ARM,
        SERVO,
        changed(RUN, ("duration", "metric top = max { of = hinge.qd; }\n    require tip < 1 rad/s;\n    duration")),
    )
    assert (
        shown(tmp_path, *deck)
        == """\
error[D132]: no metric `tip`
  --> deck.ic:16:13
   |
16 |     require tip < 1 rad/s;
   |             ^^^
   = help: did you mean `top`?
   = help: metrics of this run: top
"""
    )


def test_several_runs(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, ARM, SERVO, RUN, "run other like hold { duration = 2 s; }\n", select=None)
        == """\
error[D162]: this deck has 2 runs and sweeps, and none is marked `default`
::: deck.ic:11:1  hold
::: deck.ic:18:1  other
 = help: name one: hold, other
 = help: or write `default run ...` for one of them
"""
    )


def test_a_fast_servo(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, LIGHT, changed(SERVO, ("1e-4", "2.5e-6")), RUN)
        == """\
warning[D105]: servo `drive` is fast for the dynamics' step: h * lambda = 1
  --> deck.ic:14:24
   |
14 |     rates { dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }
   |                        ^^^^^ h = 0.001 s
   = help: stable below 2 with modified_euler, true to the motion below 0.5: the slowest rate that fits is 2000 Hz
"""
    )


def test_a_run_whose_block_is_missing(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, ARM, SERVO, RUN, "run longer like hold\nrun other like hold { duration = 3 s; }\n")
        == """\
error[D047]: the block of run `longer` is missing
  --> deck.ic:18:12
   |
18 | run longer like hold
   |            ^^^^
   = help: write `{ ... }` behind its base, or `;` where nothing differs
"""
    )


def test_a_block_of_a_run_with_a_name_of_its_own(tmp_path: Path) -> None:
    named = "run other like hold { rates fast { record = 50 Hz; } }\n"
    assert (
        messages(check(tmp_path, ARM, SERVO, RUN, named, select="all"))
        == """\
error[D108]: `fast` after `rates`, which takes no name
  --> deck.ic:18:23
   |
18 | run other like hold { rates fast { record = 50 Hz; } }
   |                       ^^^^^^^^^^
   = help: write `rates { ... }`

1 error
"""
    )


def test_a_metric_with_two_names(tmp_path: Path) -> None:
    run = changed(RUN, ("record = [q];", "record = [q];\n    metric top fast = max { of = hinge.qd; }"))
    assert (
        shown(tmp_path, ARM, SERVO, run)
        == """\
error[D129]: `fast` after the name of a metric
  --> deck.ic:17:16
   |
17 |     metric top fast = max { of = hinge.qd; }
   |                ^^^^
   = help: write `metric top = MODEL { of = CHANNEL; }`
"""
    )


def test_a_joint_that_is_set_to_something(tmp_path: Path) -> None:
    assert shown(tmp_path, changed(ARM, ("revolute {", "revolute = wheel {")), SERVO, RUN).startswith("""\
error[D091]: joint `hinge` needs a block
 --> deck.ic:3:""")


def test_a_block_of_a_run_that_is_set_to_a_word_with_a_block(tmp_path: Path) -> None:
    assert shown(tmp_path, ARM, SERVO, changed(RUN, ("rates {", "rates = quick {"))).startswith("""\
error[D111]: `rates` is a block, not a value
  --> deck.ic:14:5""")


def test_a_link_that_is_set_to_a_word_with_a_block(tmp_path: Path) -> None:
    assert shown(tmp_path, changed(ARM, ("link bar {", "link bar = beam {")), SERVO, RUN).startswith("""\
error[D085]: link `bar` needs a block
 --> deck.ic:2:5""")


def test_remove_with_a_kind(tmp_path: Path) -> None:
    run = "default run other like hold { metric top = max { of = hinge.qd; }\n    remove metric top; }\n"
    assert (
        shown(tmp_path, ARM, SERVO, RUN, run)
        == """\
error[D057]: `remove` takes a name, and nothing else
  --> deck.ic:19:5
   |
19 |     remove metric top; }
   |     ^^^^^^^^^^^^^
   = help: write `remove top;`
"""
    )
