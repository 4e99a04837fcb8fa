"""Payloads in a deck: what they are made of, when they are grappled and released, and every mistake's whole message."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from tests.ic.small_decks import changed, check, experiment, messages

ARM = """\
arm crane {
    link bar  { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link hand { mass = 1 kg; shape = sphere(radius = 0.1 m); }
    joint hinge revolute { parent = base; child = bar;  axis = z; }
    joint wrist revolute { parent = bar;  child = hand; axis = z; at = [1, 0, 0] m; }
}
"""
BOX = """\
    payload box {
        mass  = 5 kg;
        shape = box(size = [0.2, 0.3, 0.4] m);
        on    = hand;
    }
"""
RUN = f"""\
run it {{
    arm = crane;
{BOX}\
    environment {{}}
    rates {{ dynamics = 1 kHz; record = 100 Hz; }}
    duration = 10 s;
    record = [q];
}}
"""
FLIGHT = """\
on    = hand;
        grapple  = 3 s;
        release  = 8 s;
        position = [1, 2, 3] m;
        velocity = [0, -1, -1] m/s;
"""
FLIES = ("on    = hand;\n", FLIGHT)

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


def found(
    folder: Path, *changes: tuple[str, str], more: str = "", select: list[str] | None = None
) -> dict[str, object]:
    """Values of what a deck says of payloads, by path."""
    parameters = experiment(folder, ARM, changed(RUN, *changes), more, select=select).parameters
    return {path: each.value for path, each in parameters.items() if path.startswith("payloads.")}


def test_a_payload_is_held_from_the_start_unless_it_is_grappled(tmp_path: Path) -> None:
    one = found(tmp_path, ("= hand;", "= hand; at = [0, 0, 10] cm; rpy = [180, 0, 0] deg;"))
    assert one == {
        "payloads.box.mass": 5.0,
        **{f"payloads.box.com.{axis}": x for axis, x in zip("xyz", (0.1, 0.0, 0.0), strict=True)},
        **{
            f"payloads.box.inertia.{name}": pytest.approx(x)
            for name, x in zip(
                ("xx", "yy", "zz", "xy", "xz", "yz"), (0.104166666, 0.083333333, 0.054166666, 0, 0, 0), strict=True
            )
        },
        "payloads.box.at.x": 0.0,
        "payloads.box.at.y": 0.0,
        "payloads.box.at.z": 0.1,
        "payloads.box.rpy.x": pytest.approx(3.141592653589793),
        "payloads.box.rpy.y": 0.0,
        "payloads.box.rpy.z": 0.0,
    }
    (box,) = experiment(tmp_path, ARM, RUN).structure.payloads
    assert (box.name, box.link, box.grappled, box.released, box.flies) == ("box", "hand", False, False, False)
    assert box.shape == ("box", (("size_x", 0.2), ("size_y", 0.3), ("size_z", 0.4), ("along", 0.0)))


def test_one_that_is_grappled_says_how_it_flies(tmp_path: Path) -> None:
    values = found(tmp_path, FLIES)
    names = dict.fromkeys(path.split(".")[2] for path in values)
    assert list(names) == [
        "mass",
        "com",
        "inertia",
        "at",
        "position",
        "attitude",
        "velocity",
        "rate",
        "grapple",
        "release",
    ]
    assert [values[f"payloads.box.velocity.{axis}"] for axis in "xyz"] == [0.0, -1.0, -1.0]
    assert (values["payloads.box.grapple"], values["payloads.box.release"]) == (3.0, 8.0)
    (box,) = experiment(tmp_path, ARM, changed(RUN, FLIES)).structure.payloads
    assert (box.grappled, box.released) == (True, True)


def test_another_run_changes_and_removes_payloads(tmp_path: Path) -> None:
    more = """\
run other like it {
    box { mass = 7 kg;  release = 2 s; }
    payload ball { mass = 1 kg;  shape = sphere(radius = 0.1 m);  on = base; }
}
run without like it { remove box; }
"""
    payloads = {
        name: experiment(tmp_path, ARM, RUN, more, select=[name]).structure.payloads
        for name in ("it", "other", "without")
    }
    told_of = {name: [(each.name, each.link, each.released) for each in some] for name, some in payloads.items()}
    assert told_of == {
        "it": [("box", "hand", False)],
        "other": [("box", "hand", True), ("ball", "base", False)],
        "without": [],
    }
    assert found(tmp_path, more=more, select=["other"])["payloads.box.mass"] == 7.0


def test_a_sweep_varies_what_a_payload_is_and_when(tmp_path: Path) -> None:
    more = "sweep many of it { vary payloads.box.mass = [5, 10] kg;  vary payloads.box.grapple = [3, 4, 5] s; }\n"
    made = experiment(tmp_path, ARM, changed(RUN, FLIES), more, select=["many"])
    assert made.cases.count == 6
    (heavy,) = (each for each in made.cases.coordinates if each.path == "payloads.box.mass")
    assert heavy.sets == ("payloads.box.mass",)
    assert {path for path, each in made.parameters.items() if each.origin.kind == "case"} == {
        "payloads.box.mass",
        "payloads.box.grapple",
    }


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


BARE = changed(ARM, ("link hand { mass = 1 kg; shape = sphere(radius = 0.1 m); }", "link hand { mass = 0 kg; }"))


def test_a_payload_that_is_carried_throughout_is_mass_to_its_joint_and_one_that_goes_is_named(tmp_path: Path) -> None:
    """And its motion is that of a link behind a fixed joint."""
    merged = changed(
        BARE,
        (
            "    joint hinge",
            "    link box { mass = 5 kg; shape = box(size = [0.2, 0.3, 0.4] m); }\n"
            "    joint grip fixed { parent = hand; child = box; }\n    joint hinge",
        ),
    )
    falls = ("environment {}", "initial { wrist.q = 1 rad; } environment { gravity = [1, -9, 0] m/s^2; }")
    found, wanted = (
        engine.run(experiment(tmp_path, arm, changed(run, falls, ("duration = 10 s", "duration = 1 s"))))
        for arm, run in ((BARE, RUN), (merged, RUN.replace(BOX, "")))
    )
    assert found.cause == wanted.cause == [""]
    np.testing.assert_allclose(found.signals["q"], wanted.signals["q"], rtol=0, atol=1e-12)
    goes = changed(RUN, ("    }\n    env", "        release = 3 s;\n    }\n    env"))
    assert (
        messages(check(tmp_path, BARE, goes))
        == """\
error[D217]: joint `wrist` moves nothing that has mass
 --> deck.ic:5:5
  |
5 |     joint wrist revolute { parent = bar;  child = hand; axis = z; at = [1, 0, 0] m; }
  |     ^^^^^^^^^^^^^^^^^^^^
  = help: write the mass of link `hand`, or of one that it carries
  = help: or make the joint fixed
  = help: payload `box` is not always there: one without `release` would count

1 error
"""
    )
    sweep = "sweep light of it { vary payloads.box.mass = [5, 0] kg; }"
    run = changed(RUN, ("shape = box(size = [0.2, 0.3, 0.4] m);", "inertia = [0, 0, 0] kg*m^2;"))
    assert [each.code for each in check(tmp_path, BARE, run, sweep, select=["light"]).diagnostics] == ["D217"]


def test_a_payload_that_a_free_base_carries_throughout_is_its_mass(tmp_path: Path) -> None:
    run = changed(
        RUN, ("    arm = crane;\n", "    arm = crane;\n    base = free;\n"), ("on    = hand;", "on    = base;")
    )
    assert messages(check(tmp_path, ARM, run)) == ""
    goes = changed(run, ("on    = base;\n", "on    = base;\n        release = 3 s;\n"))
    assert (
        messages(check(tmp_path, ARM, goes))
        == """\
error[D254]: the base moves freely and has no mass
 --> deck.ic:9:5
  |
9 |     base = free;
  |     ^^^^
  = help: give the arm the base's body: `link base { mass = 400 kg; shape = sphere(radius = 0.5 m); }`
  = help: or write the mass of a link that is fixed to the base
  = help: payload `box` is not always there: one without `release` would count

1 error
"""
    )


def test_a_payload_that_spins_too_fast_for_the_step_is_warned_of(tmp_path: Path) -> None:
    spun = changed(RUN, FLIES, ("velocity = [0, -1, -1] m/s;", "rate = [0, 9, 250] rad/s;"))
    assert messages(check(tmp_path, ARM, spun)).startswith("""\
warning[D300]: payload `box` turns by 0.25 rad in a step of the dynamics
  --> deck.ic:16:16
   |
16 |         rate = [0, 9, 250] rad/s;
   |                ^^^^^^^^^^^^^^^^^ h = 0.001 s
""")


def test_a_time_that_is_not_written_does_not_vary_and_the_remedy_says_why(tmp_path: Path) -> None:
    sweep = "sweep late of it { vary payloads.box.release = [1, 2] s; }"
    assert (
        messages(check(tmp_path, ARM, RUN, sweep, select=["late"]))
        == """\
error[D122]: `payloads.box.release` cannot vary
  --> deck.ic:19:25
   |
19 | sweep late of it { vary payloads.box.release = [1, 2] s; }
   |                         ^^^^^^^^^^^^^^^^^^^^
   = help: it is not written, and so decides the program: write `release = ...;` in the payload, and it varies

1 error
"""
    )
