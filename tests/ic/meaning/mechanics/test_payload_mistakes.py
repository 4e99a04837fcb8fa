"""Mistakes in a payload: whole messages."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.meaning.mechanics.test_payloads import ARM, BOX, FLIES, RUN
from tests.ic.small_decks import changed, check, messages

WRONG: dict[str, tuple[tuple[tuple[str, str], ...], str]] = {
    "no block": (
        ((BOX, "    payload box = hand;\n"),),
        """\
error[D260]: `payload` takes a name, and a block
 --> deck.ic:9:19
  |
9 |     payload box = hand;
  |                   ^^^^
  = help: write `payload NAME { mass = 20 kg;  shape = sphere(radius = 0.2 m);  on = LINK; }`

1 error
""",
    ),
    "two names": (
        (("payload box {", "payload box crate {"),),
        """\
error[D260]: `payload` takes a name, and a block
 --> deck.ic:9:17
  |
9 |     payload box crate {
  |                 ^^^^^
  = help: write `payload NAME { mass = 20 kg;  shape = sphere(radius = 0.2 m);  on = LINK; }`

1 error
""",
    ),
    "a link's name": (
        (("payload box {", "payload hand {"),),
        """\
error[D262]: `hand` is a link of arm `crane`, so no payload may be called so
 --> deck.ic:9:5
  |
9 |     payload hand {
  |     ^^^^^^^^^^^^
  = help: give the payload another name

1 error
""",
    ),
    "the ground's name": (
        (("payload box {", "payload world {"),),
        """\
error[D262]: `world` is the ground, so no payload may be called so
 --> deck.ic:9:5
  |
9 |     payload world {
  |     ^^^^^^^^^^^^^
  = help: give the payload another name

1 error
""",
    ),
    "the ground's name, beside who means the ground": (
        (
            ("payload box {", "payload world {"),
            ("environment {}", "environment { line = spring { link = bar; to = world; stiffness = 1 N/m; } }"),
        ),
        """\
error[D262]: `world` is the ground, so no payload may be called so
 --> deck.ic:9:5
  |
9 |     payload world {
  |     ^^^^^^^^^^^^^
  = help: give the payload another name

1 error
""",
    ),
    "on nothing": (
        (("        on    = hand;\n", ""),),
        """\
error[D261]: payload `box` is on no link
 --> deck.ic:9:5
  |
9 |     payload box {
  |     ^^^^^^^^^^^
  = help: write `on = LINK;`, the link that carries or grapples it
  = help: links: base, bar, hand

1 error
""",
    ),
    "on what is not there": (
        (("= hand", "= hnad"),),
        """\
error[D261]: no link `hnad` in arm `crane`
  --> deck.ic:12:17
   |
12 |         on    = hnad;
   |                 ^^^^
   = help: did you mean `hand`?
   = help: links: base, bar, hand

1 error
""",
    ),
    "on a number": (
        (("= hand", "= 3"),),
        """\
error[D261]: a link's name is needed for payload `box`
  --> deck.ic:12:17
   |
12 |         on    = 3;
   |                 ^
   = help: links: base, bar, hand

1 error
""",
    ),
    "an unknown key": (
        (("= hand;", "= hand; colour = 3;"),),
        """\
error[D141]: payload `box` has no `colour`
  --> deck.ic:12:23
   |
12 |         on    = hand; colour = 3;
   |                       ^^^^^^
   = help: it has: mass, com, inertia, shape, on, at, rpy, grapple, release, position, attitude, velocity, rate

1 error
""",
    ),
    "flight of what is held": (
        (("= hand;", "= hand; velocity = [1, 0, 0] m/s;"),),
        """\
error[D263]: payload `box` is held from the start, so `velocity` has no effect
  --> deck.ic:12:23
   |
12 |         on    = hand; velocity = [1, 0, 0] m/s;
   |                       ^^^^^^^^
   = help: leave `velocity` out: `at` and `rpy` say where on its link it is
   = help: or write `grapple = 3 s;` if it flies first

1 error
""",
    ),
    "attitude on the link of what flies": (
        (FLIES, ("position = [1, 2, 3] m;", "rpy = [1, 0, 0] deg; position = [1, 2, 3] m;")),
        """\
error[D263]: payload `box` is held as it is when it is grappled, so `rpy` has no effect
  --> deck.ic:15:9
   |
15 |         rpy = [1, 0, 0] deg; position = [1, 2, 3] m;
   |         ^^^
  ::: deck.ic:13:9  grappled here
   = help: leave `rpy` out: `attitude` and `rate` say how it flies before
   = help: or leave `grapple` out if it is held from the start

1 error
""",
    ),
    "no place to fly from": (
        (FLIES, ("        position = [1, 2, 3] m;\n", "")),
        """\
error[D075]: payload `box` has no `position`
 --> deck.ic:9:5
  |
9 |     payload box {
  |     ^^^^^^^^^^^
  = help: write `position = [...] m;` (origin of the payload's frame at the start, in world axes)

1 error
""",
    ),
    "released first": (
        (FLIES, ("grapple  = 3 s", "grapple  = 8 s")),
        """\
error[D264]: payload `box` is not released after it is grappled
  --> deck.ic:14:20
   |
14 |         release  = 8 s;
   |                    ^^^ 8 s is not after 8 s
   = help: write a later `release`, or an earlier `grapple`

1 error
""",
    ),
    "a rod that flies": (
        (FLIES, ("box(size = [0.2, 0.3, 0.4] m)", "rod(length = 1 m, along = x)")),
        """\
error[D265]: payload `box` is no body that could fly
  --> deck.ic:11:17
   |
11 |         shape = rod(length = 1 m, along = x);
   |                 ^^^^^^^^^^^^^^^^^^^^^^^^^^^^ its smallest principal moment is 0 kg*m^2
   = help: what flies has mass, and resists a turn about every axis: a box, a cylinder or a sphere does
   = help: or leave `grapple` and `release` out: then it is a part of its link

1 error
""",
    ),
    "nothing that flies": (
        (FLIES, ("5 kg", "0 kg")),
        """\
error[D265]: payload `box` is no body that could fly
  --> deck.ic:11:17
   |
11 |         shape = box(size = [0.2, 0.3, 0.4] m);
   |                 ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^ it has no mass
   = help: what flies has mass, and resists a turn about every axis: a box, a cylinder or a sphere does
   = help: or leave `grapple` and `release` out: then it is a part of its link

1 error
""",
    ),
    "no velocity products": (
        (FLIES, ("environment {}", "environment { velocity_products = off; }")),
        """\
error[D266]: payload `box` flies by velocity products, and they are off
 --> deck.ic:9:5
  |
9 |     payload box {
  |     ^^^^^^^^^^^
  = help: leave `velocity_products = off` out

1 error
""",
    ),
    "between instants": (
        (FLIES, ("grapple  = 3 s", "grapple  = 3.0005 s")),
        """\
warning[D267]: payload `box` is grappled at 3.001 s: 3.0005 s is no instant of the dynamics
  --> deck.ic:13:20
   |
13 |         grapple  = 3.0005 s;
   |                    ^^^^^^^^
   = help: a step of the dynamics is 0.001 s; write a multiple of it

1 warning
""",
    ),
    "after the end": (
        (FLIES, ("release  = 8 s", "release  = 12 s")),
        """\
warning[D268]: payload `box` is released at 12 s, and the run ends at 10 s
  --> deck.ic:14:20
   |
14 |         release  = 12 s;
   |                    ^^^^
   = help: leave `release` out, or let the run last longer

1 warning
""",
    ),
    "grappled after the end": (
        (FLIES, ("        release  = 8 s;\n", ""), ("grapple  = 3 s", "grapple  = 12 s")),
        """\
warning[D268]: payload `box` is grappled at 12 s, and the run ends at 10 s
  --> deck.ic:13:20
   |
13 |         grapple  = 12 s;
   |                    ^^^^
   = help: let the run last longer, or leave it: then the payload flies by

1 warning
""",
    ),
    "no body": (
        (("shape = box(size = [0.2, 0.3, 0.4] m);", "inertia = [1, 1, 3] kg*m^2;"),),
        """\
error[D087]: the inertia of payload `box` is no body's
  --> deck.ic:11:19
   |
11 |         inertia = [1, 1, 3] kg*m^2;
   |                   ^^^^^^^^^^^^^^^^ principal moments 1, 1 and 3 kg*m^2; no body has one above the sum of the others
   = help: inertia is about the centre of mass, in payload axes: [xx, yy, zz] or [xx, yy, zz, xy, xz, yz] kg*m^2
   = help: products have the sign of -sum(m x y)

1 error
""",
    ),
    "no inertia": (
        (("        shape = box(size = [0.2, 0.3, 0.4] m);\n", ""),),
        """\
error[D089]: payload `box` has no inertia
 --> deck.ic:9:5
  |
9 |     payload box {
  |     ^^^^^^^^^^^
  = help: write a shape, such as `shape = rod(length = 1 m, along = x);`
  = help: or `inertia = [xx, yy, zz] kg*m^2;`, about the centre of mass

1 error
""",
    ),
    "no channel": (
        (("record = [q]", "record = [payloads.box.positon]"),),
        """\
error[D125]: no channel `payloads.box.positon`
  --> deck.ic:17:15
   |
17 |     record = [payloads.box.positon];
   |               ^^^^^^^^^^^^^^^^^^^^
   = help: did you mean `payloads.box.position`?
   = help: channels of `payloads.box`: payloads.box.position, payloads.box.orientation, payloads.box.velocity, payloads.box.rate, payloads.box.distance, payloads.box.carried

1 error
""",
    ),
    "a wrench on what is not there": (
        (("environment {}", "environment { w = wrench { link = bix; force = [1, 0, 0] N; } }"),),
        """\
error[D159]: no link `bix` in arm `crane`
  --> deck.ic:14:39
   |
14 |     environment { w = wrench { link = bix; force = [1, 0, 0] N; } }
   |                                       ^^^
   = help: did you mean `box`?
   = help: links: bar, hand, box

1 error
""",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("mistake", WRONG)
def test_a_mistake_is_told_whole(tmp_path: Path, mistake: str) -> None:
    changes, message = WRONG[mistake]
    assert messages(check(tmp_path, ARM, changed(RUN, *changes))) == message


@pytest.mark.parametrize(
    ("sweep", "message"),
    [
        (
            "vary payloads.box.release = [3, 2.5, 4] s;",
            """\
error[D264]: payload `box` is not released after it is grappled; case #0 breaks it, and 1 more
  --> deck.ic:14:20
   |
14 |         release  = 8 s;
   |                    ^^^ 3 s is not after 3 s
   = help: case #0: payloads.box.release = 3 s
   = help: write a later `release`, or an earlier `grapple`

1 error
""",
        ),
        (
            "vary payloads.box.on = [1, 2];",
            """\
error[D122]: `payloads.box.on` cannot vary
  --> deck.ic:23:25
   |
23 | sweep many of it { vary payloads.box.on = [1, 2]; }
   |                         ^^^^^^^^^^^^^^^
   = help: it decides the program: write a run for each, `like` the first, and `sweep NAME = ONE + OTHER;`

1 error
""",
        ),
        (
            "vary payloads.box.size = [1, 2] m;",
            """\
error[D128]: no parameter `payloads.box.size` in this run
  --> deck.ic:23:25
   |
23 | sweep many of it { vary payloads.box.size = [1, 2] m; }
   |                         ^^^^^^^^^^^^^^^^^
   = help: did you mean `payloads.box.shape.size`? it is made of 3 numbers; vary one of them: \
`payloads.box.shape.size.x`, `payloads.box.shape.size.y`, `payloads.box.shape.size.z`

1 error
""",
        ),
    ],
)
def test_what_a_sweep_cannot_vary_is_told(tmp_path: Path, sweep: str, message: str) -> None:
    more = f"sweep many of it {{ {sweep} }}\n"
    assert messages(check(tmp_path, ARM, changed(RUN, FLIES), more, select=["many"])) == message


def test_a_block_that_looks_like_a_payload_is_told_how_to_be_one(tmp_path: Path) -> None:
    more = "run other like it { crate { mass = 3 kg; } }\n"
    assert (
        messages(check(tmp_path, ARM, RUN, more, select=["other"]))
        == """\
error[D109]: nothing named `crate` in run `other` to change
  --> deck.ic:19:21
   |
19 | run other like it { crate { mass = 3 kg; } }
   |                     ^^^^^
   = help: did you mean `rates`?
   = help: `payload crate { ... }` would add a payload

1 error
"""
    )


def test_a_load_on_what_the_ground_holds_is_told(tmp_path: Path) -> None:
    changes = (
        ("on    = hand", "on    = base"),
        ("environment {}", "environment { w = wrench { link = box; force = [1, 0, 0] N; } }"),
    )
    assert (
        messages(check(tmp_path, ARM, changed(RUN, *changes)))
        == """\
warning[D256]: environment `w` changes nothing: link `base` is part of the ground
  --> deck.ic:14:39
   |
14 |     environment { w = wrench { link = box; force = [1, 0, 0] N; } }
   |                                       ^^^
   = help: write `base = free;` in the run, or name a link that a joint moves

1 warning
"""
    )


def test_a_run_that_removes_where_a_payload_begins_is_told_so(tmp_path: Path) -> None:
    run = "run other like it { box { remove position; } }\n"
    assert (
        messages(check(tmp_path, ARM, changed(RUN, FLIES), run, select=["other"]))
        == """\
error[D075]: payload `box` has no `position`
  --> deck.ic:23:27
   |
23 | run other like it { box { remove position; } }
   |                           ^^^^^^ removed here
  ::: deck.ic:9:5  payload `box` stands here
   = help: write `position = [...] m;` (origin of the payload's frame at the start, in world axes)

1 error
"""
    )
