"""Mistakes in a guide, each with its place and a remedy."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.meaning.control.test_guides import ARM, RUN
from tests.ic.small_decks import changed, check, messages

MISTAKES = [
    (
        "guide tip = resolved_rate {",
        "guide tip {",
        """\
error[D270]: guide `tip` has no model
  --> deck.ic:11:5
   |
11 |     guide tip {
   |     ^^^^^^^^^
   = help: write `guide NAME = MODEL { ... }`
   = help: guide models: resolved_rate, together

1 error
""",
    ),
    (
        "guide tip = resolved_rate {",
        "guide tip = resolved_rat {",
        """\
error[D140]: no guide model `resolved_rat`
  --> deck.ic:11:17
   |
11 |     guide tip = resolved_rat {
   |                 ^^^^^^^^^^^^
   = help: did you mean `resolved_rate`?
   = help: guide models: resolved_rate, together

1 error
""",
    ),
    (
        "guide tip = resolved_rate {",
        "guide tip one = resolved_rate {",
        """\
error[D270]: `one` after the name of a guide
  --> deck.ic:11:15
   |
11 |     guide tip one = resolved_rate {
   |               ^^^
   = help: write `guide NAME = MODEL { ... }`
   = help: guide models: resolved_rate, together

1 error
""",
    ),
    (
        "guide tip = resolved_rate {",
        "guides tip = resolved_rate {",
        """\
error[D065]: no value `tip`
 --> deck.ic:7:66
  |
7 | servo follow { model = ideal; bandwidth = 20 1/s; command = rate(tip); }
  |                                                                  ^^^
  = help: define it: `let tip = ...;`

error[D108]: no `guides` in a run
  --> deck.ic:11:5
   |
11 |     guides tip = resolved_rate {
   |     ^^^^^^^^^^
   = help: did you mean `guide`?
   = help: a run has: arm, base, servos, initial, environment, rates, integrator, duration, record, tolerances, seed, guide NAME, substitute JOINT, sensor NAME, payload NAME, with PATH, signal NAME, metric NAME, linear NAME, require, allow

2 errors
""",
    ),
    (
        "link = two;",
        "link = tow;",
        """\
error[D159]: no link `tow` in arm `pair`
  --> deck.ic:12:16
   |
12 |         link = tow; point = [1, 0, 0] m; guides = xy; max_damping = 0.1 m; threshold = 0.2 m;
   |                ^^^
   = help: did you mean `two`?
   = help: links: one, two

1 error
""",
    ),
    (
        "link = two;",
        "link = one;",
        """\
error[D276]: joint `high` follows guide `tip`, and does not carry link `one`
  --> deck.ic:11:5
   |
11 |     guide tip = resolved_rate {
   |     ^^^^^^^^^
   = help: give it a command of its own, or guide a link that it carries

1 error
""",
    ),
    (
        "max_damping = 0.1 m;",
        "",
        """\
error[D075]: guide `tip` has no `max_damping`
  --> deck.ic:11:5
   |
11 |     guide tip = resolved_rate {
   |     ^^^^^^^^^
   = help: write `max_damping = ... m;` (damping lambda at a singularity; 0: no damping)

1 error
""",
    ),
    (
        "max_rate = 1 rad/s;",
        "max_rate = 1 m/s;",
        """\
error[D061]: `max_rate` of joint `low` of guide `tip` is in rad/s, and this is in m/s
  --> deck.ic:13:55
   |
13 |         x = ramp(to = -20 cm, over = 1 s); max_rate = 1 m/s;
   |                                                       ^^^^^
   = help: write it in rad/s, deg/s or rpm

1 error
""",
    ),
    (
        "max_rate = 1 rad/s;",
        "low.max_rate = 0 rad/s;",
        """\
error[D077]: `max_rate` of joint `low` of guide `tip` must be above 0 rad/s
  --> deck.ic:13:59
   |
13 |         x = ramp(to = -20 cm, over = 1 s); low.max_rate = 0 rad/s;
   |                                                           ^^^^^^^ this is 0 rad/s
   = help: write a number above 0 rad/s (largest rate)

1 error
""",
    ),
    (
        "max_rate = 1 rad/s;",
        "lo.max_rate = 1 rad/s;",
        """\
error[D141]: guide `tip` has no `lo.max_rate`
  --> deck.ic:13:44
   |
13 |         x = ramp(to = -20 cm, over = 1 s); lo.max_rate = 1 rad/s;
   |                                            ^^^^^^^^^^^
   = help: did you mean `low.max_rate`?
   = help: it has: link, point, guides, max_damping, threshold, gain, length, loop, jacobian, rate, x, y, z, roll, pitch, yaw, max_rate, low.max_rate, high.max_rate

1 error
""",
    ),
    (
        "x = ramp(",
        "z = ramp(",
        """\
error[D274]: `z` is not guided by guide `tip`
  --> deck.ic:13:9
   |
13 |         z = ramp(to = -20 cm, over = 1 s); max_rate = 1 rad/s;
   |         ^
   = help: it guides x, y
   = help: leave it out, or guide more

1 error
""",
    ),
    (
        "x = ramp(to = -20 cm, over = 1 s);",
        "x { to = 1 m; }",
        """\
error[D274]: `x` of guide `tip` is a value or a course in time
  --> deck.ic:13:9
   |
13 |         x { to = 1 m; } max_rate = 1 rad/s;
   |         ^
   = help: write `x = ramp(to = 1 m, over = 10 s);`

1 error
""",
    ),
    (
        "guides = xy;",
        "guides = pose;",
        """\
error[D275]: guide `tip` moves 2 joints and guides 6 components: x, y, z, roll, pitch, yaw
  --> deck.ic:11:5
   |
11 |     guide tip = resolved_rate {
   |     ^^^^^^^^^
   = help: let more joints follow it, or guide less
   = help: `guides` may be: pose, position, xy, xz, yz

1 error
""",
    ),
    (
        "guides = xy;",
        "guides = xy; rate = 2 kHz;",
        """\
error[D277]: guide `tip` ticks at 2000 Hz, between the steps of the dynamics
  --> deck.ic:12:62
   |
12 |         link = two; point = [1, 0, 0] m; guides = xy; rate = 2 kHz; max_damping = 0.1 m; threshold = 0.2 m;
   |                                                              ^^^^^
  ::: deck.ic:17:24  1000 Hz
   = help: give the guide a `rate` that divides 1000 Hz, or quicken the dynamics

1 error
""",
    ),
    (
        "servos = 500 Hz;",
        "servos = continuous;",
        """\
error[D277]: guide `tip` has no rate, and the servos are continuous
  --> deck.ic:11:5
   |
11 |     guide tip = resolved_rate {
   |     ^^^^^^^^^
   = help: write `rate = 100 Hz;` in the guide

1 error
""",
    ),
    (
        "low = follow; high = follow;",
        "low = follow { command = rate(0 rad/s); }; high = follow { command = rate(0 rad/s); };",
        """\
error[D272]: no joint follows guide `tip`
  --> deck.ic:11:5
   |
11 |     guide tip = resolved_rate {
   |     ^^^^^^^^^
   = help: write `command = rate(tip);` in the servo of each joint that it moves, or leave the guide out

1 error
""",
    ),
    (
        "low = follow; high = follow;",
        "low = follow { command = acceleration(tip); }; high = follow;",
        """\
error[D273]: guide `tip` (resolved_rate) commands no acceleration
  --> deck.ic:10:14
   |
10 |     servos { low = follow { command = acceleration(tip); }; high = follow; }
   |              ^^^
  ::: deck.ic:11:5  the guide
   = help: write `command = rate(tip);` for joint `low`

1 error
""",
    ),
    (
        "low = follow; high = follow;",
        "low = follow { command = rate(tp); }; high = follow;",
        """\
error[D278]: no guide, value or course in time `tp`
  --> deck.ic:10:44
   |
10 |     servos { low = follow { command = rate(tp); }; high = follow; }
   |                                            ^^
   = help: did you mean `tip`?
   = help: guides of this run: tip

1 error
""",
    ),
    (
        "guides.tip.error",
        "guides.tip.eror",
        """\
error[D125]: no channel `guides.tip.eror`
  --> deck.ic:19:18
   |
19 |     record = [q, guides.tip.eror];
   |                  ^^^^^^^^^^^^^^^
   = help: did you mean `guides.tip.error`?
   = help: channels of `guides`: guides.tip.error, guides.tip.turn_error, guides.tip.manipulability, guides.tip.damping, guides.tip.share

1 error
""",
    ),
    (
        "guides = xy;",
        "guides = xy; gain = 1000 1/s;",
        """\
error[D279]: guide `tip` is unstable at 500 Hz
  --> deck.ic:11:5
   |
11 |     guide tip = resolved_rate {
   |     ^^^^^^^^^ 2 times the error is taken off at each tick
   = help: what it takes off in a second, its gain, must stay below twice its rate, 1000/s, and well below what its servos can follow

1 error
""",
    ),
    (
        "run it {",
        "let tip = 3;\nrun it {",
        """\
error[D271]: `tip` is a value, so no guide can be called so
  --> deck.ic:12:5
   |
12 |     guide tip = resolved_rate {
   |     ^^^^^^^^^
  ::: deck.ic:8:5  the value
   = help: give the guide another name: `rate(NAME)` is to mean one thing

1 error
""",
    ),
]


@pytest.mark.slow
@pytest.mark.parametrize(("text", "instead", "expected"), MISTAKES)
def test_a_mistake_is_told_with_its_place_and_a_remedy(tmp_path: Path, text: str, instead: str, expected: str) -> None:
    assert messages(check(tmp_path, ARM, changed(RUN, (text, instead)))) == expected


def test_a_run_that_guides_less_is_told_what_to_remove(tmp_path: Path) -> None:
    run = "run other like it { tip { guides = xz; } }\n"
    y = changed(RUN, ("x = ramp", "y = ramp"))
    assert (
        messages(check(tmp_path, ARM, y, run, select=["other"]))
        == """\
error[D274]: `y` is not guided by guide `tip`
  --> deck.ic:21:36
   |
21 | run other like it { tip { guides = xz; } }
   |                                    ^^
  ::: deck.ic:13:9  written here
   = help: it guides x, z
   = help: write `remove y;`, or guide more

1 error
"""
    )


def test_a_joint_is_not_called_as_a_component_of_the_path(tmp_path: Path) -> None:
    assert (
        messages(check(tmp_path, ARM.replace("high", "x"), RUN.replace("high", "x")))
        == """\
error[D274]: `x` of guide `tip` is a component of its path, and a joint that follows it
  --> deck.ic:13:9
   |
13 |         x = ramp(to = -20 cm, over = 1 s); max_rate = 1 rad/s;
   |         ^
   = help: give the joint another name

1 error
"""
    )


def test_a_guide_that_does_nothing_or_in_part_is_told(tmp_path: Path) -> None:
    assert (
        messages(check(tmp_path, ARM, changed(RUN, ("threshold = 0.2 m", "threshold = 0 m"))))
        == """\
warning[D301]: guide `tip` is never damped: no singular value is below a `threshold` of 0 m
  --> deck.ic:12:69
   |
12 |         link = two; point = [1, 0, 0] m; guides = xy; max_damping = 0.1 m; threshold = 0 m;
   |                                                                     ^^^^^
   = help: change `max_damping` or `threshold`

1 warning
"""
    )
    bare = changed(RUN, ("threshold = 0.2 m", "threshold = 0 m"), ("max_damping = 0.1 m", "max_damping = 0 m"))
    assert messages(check(tmp_path, ARM, bare)) == ""
    together = changed(
        RUN,
        (
            """\
        link = two; point = [1, 0, 0] m; guides = xy; max_damping = 0.1 m; threshold = 0.2 m;
        x = ramp(to = -20 cm, over = 1 s); max_rate = 1 rad/s;
""",
            "        to = 1 rad; max_rate = 1 rad/s; max_acceleration = 1 rad/s^2; begin = 1 s;\n",
        ),
        ("resolved_rate", "together"),
        (", guides.tip.error", ""),
    )
    (found,) = check(tmp_path, changed(ARM, ("rate(tip)", "position(tip)")), together).diagnostics
    assert (found.code, found.message) == (
        "D301",
        "guide `tip` moves nothing: it would begin at 1 s, and the run ends at 1 s",
    )
