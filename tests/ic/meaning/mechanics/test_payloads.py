"""Payloads in a deck: what they are made of, and when they are grappled and released."""

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
