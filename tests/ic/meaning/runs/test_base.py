"""The base in a deck: its three kinds, what goes with each, and every mistake's whole message."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.small_decks import changed, check, experiment, messages

ARM = """\
arm swing {
    link base { mass = 50 kg; shape = sphere(radius = 1 m); }
    link bar  { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base; child = bar; axis = z; }
}
"""
RUN = """\
run it {
    arm = swing;
    base = free;
    initial {}
    environment {}
    rates { dynamics = 1 kHz; record = 100 Hz; }
    duration = 1 s;
    record = [q];
}
"""
SHAKEN = "base = prescribed { x = sine(amplitude = 1 cm, frequency = 2 Hz); yaw = 10 deg; }"


def numbers(folder: Path, *changes: tuple[str, str], arm: str = ARM) -> dict[str, object]:
    parameters = experiment(folder, arm, changed(RUN, *changes)).parameters
    return {path: each.value for path, each in parameters.items() if path.startswith(("base.", "initial.base."))}


def test_a_base_is_fixed_unless_the_run_says_more(tmp_path: Path) -> None:
    for text in ("", "base = fixed;"):
        found = experiment(tmp_path, ARM, changed(RUN, ("base = free;", text)))
        assert found.structure.base is None
        assert not [path for path in found.parameters if "base." in path and not path.startswith("links.")]


def test_a_free_base_begins_where_initial_says(tmp_path: Path) -> None:
    begins = "initial { base.position = [1, 2, 3] m; base.rate = [0, 0, 1] rad/s; }"
    assert numbers(tmp_path, ("initial {}", begins)) == {
        "initial.base.position.x": 1.0,
        "initial.base.position.y": 2.0,
        "initial.base.position.z": 3.0,
        **{f"initial.base.{name}.{axis}": 0.0 for name in ("rpy", "velocity") for axis in "xyz"},
        "initial.base.rate.x": 0.0,
        "initial.base.rate.y": 0.0,
        "initial.base.rate.z": 1.0,
    }


def test_a_prescribed_base_has_a_course_for_each_component_that_is_written(tmp_path: Path) -> None:
    assert numbers(tmp_path, ("base = free;", SHAKEN)) == {
        "base.x.amplitude": 0.01,
        "base.x.frequency": 2.0,
        "base.x.offset": 0.0,
        "base.x.phase": 0.0,
        "base.yaw.value": pytest.approx(0.17453292519943295),
    }
    base = experiment(tmp_path, ARM, changed(RUN, ("base = free;", SHAKEN))).structure.base
    assert base is not None
    assert [(course.component, course.model) for course in base.courses] == [("x", "sine"), ("yaw", "constant")]


def test_a_course_may_come_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "deck.csv").write_text("time [s], x [cm], roll [deg]\n0, 0, 0\n1, 5, 20\n", encoding="utf-8")
    course = 'base = prescribed { x = trajectory("deck.csv", interpolation = cubic); '
    course += 'yaw = trajectory("deck.csv", column = "roll", interpolation = cubic); }'
    found = numbers(tmp_path, ("base = free;", course))
    assert found["base.x.values"] == (0.0, 0.05)
    assert found["base.yaw.values"] == (0.0, pytest.approx(0.3490658503988659))


def test_an_arm_without_a_base_link_gets_one_without_matter(tmp_path: Path) -> None:
    arm = changed(ARM, ("    link base { mass = 50 kg; shape = sphere(radius = 1 m); }\n", ""))
    found = experiment(tmp_path, arm, changed(RUN, ("base = free;", SHAKEN)))
    assert [link.name for link in found.structure.links] == ["bar", "base"]
    assert {each.value for path, each in found.parameters.items() if path.startswith("links.base.")} == {0.0}


def test_a_run_like_another_changes_one_number_of_a_course(tmp_path: Path) -> None:
    text = changed(RUN, ("base = free;", SHAKEN)) + "run more like it { base { x { amplitude = 3 cm; } } }\n"
    found = experiment(tmp_path, ARM, text, select=["more"])
    assert found.parameters["base.x.amplitude"].value == 0.03


def test_a_sweep_varies_the_kind_of_base(tmp_path: Path) -> None:
    compiled = check(tmp_path, ARM, RUN, "sweep kinds of it { vary base = [fixed, free]; }", select=["kinds"])
    assert compiled.plan is not None, messages(compiled)
    assert [each.structure.free for each in compiled.plan.experiments] == [False, True]


MISTAKES = [
    ("base = fre;", "", """\
error[D250]: no base `fre`
 --> deck.ic:8:12
  |
8 |     base = fre;
  |            ^^^
  = help: did you mean `free`?
  = help: write `base = fixed;`, `base = free;` or `base = prescribed { x = sine(amplitude = 1 cm, frequency = 2 Hz); }`

1 error
"""),
    ("base = 3;", "", """\
error[D250]: a base is fixed, prescribed or free
 --> deck.ic:8:12
  |
8 |     base = 3;
  |            ^
  = help: write `base = fixed;`, `base = free;` or `base = prescribed { x = sine(amplitude = 1 cm, frequency = 2 Hz); }`

1 error
"""),
    ("base = free { x = 1 m; }", "", """\
error[D250]: a free base takes no block
 --> deck.ic:8:5
  |
8 |     base = free { x = 1 m; }
  |     ^^^^
  = help: its state at the start stands in `initial`: base.position, base.rpy, base.velocity, base.rate

1 error
"""),
    ("base = prescribed;", "", """\
error[D250]: this base is prescribed, and nothing says how it moves
 --> deck.ic:8:5
  |
8 |     base = prescribed;
  |     ^^^^
  = help: write `base = fixed;`, `base = free;` or `base = prescribed { x = sine(amplitude = 1 cm, frequency = 2 Hz); }`

1 error
"""),
    ("base = free; base += fixed;", "", """\
error[D250]: a base is fixed, prescribed or free
 --> deck.ic:8:26
  |
8 |     base = free; base += fixed;
  |                          ^^^^^
  = help: write `base = fixed;`, `base = free;` or `base = prescribed { x = sine(amplitude = 1 cm, frequency = 2 Hz); }`

1 error
"""),
    ("base = prescribed(1 m, y = 2 m);", "", """\
error[D153]: `prescribed` takes its values by name
 --> deck.ic:8:23
  |
8 |     base = prescribed(1 m, y = 2 m);
  |                       ^^^
  = help: write `prescribed(x = ..., y = ..., z = ..., roll = ..., pitch = ..., yaw = ...)`

1 error
"""),
    ("base = prescribed { jaw = 10 deg; }", "", """\
error[D141]: a prescribed base has no `jaw`
 --> deck.ic:8:25
  |
8 |     base = prescribed { jaw = 10 deg; }
  |                         ^^^
  = help: did you mean `yaw`?
  = help: it has: x, y, z, roll, pitch, yaw

1 error
"""),
    ("base = prescribed { yaw = 10 cm; }", "", """\
error[D061]: `yaw` of the base is in rad, and this is in m
 --> deck.ic:8:31
  |
8 |     base = prescribed { yaw = 10 cm; }
  |                               ^^^^^
  = help: write it in rad, deg, mrad, arcmin, arcsec, cycle or rev

1 error
"""),
    ("base = prescribed { x = step(to = 1 m); }", "", """\
error[D251]: `x` of the base jumps, by `step`
 --> deck.ic:8:29
  |
8 |     base = prescribed { x = step(to = 1 m); }
  |                             ^^^^^^^^^^^^^^
  = help: a body moves from place to place in time
  = help: courses without a jump of the rate: constant, sine, trajectory(interpolation = cubic), trapezoid

1 error
"""),
    ("base = prescribed { x = ramp(to = 1 m, over = 1 s); }", "", """\
warning[D252]: the rate of `x` of the base jumps, by `ramp`: the blow that this is to the arm is left out
 --> deck.ic:8:29
  |
8 |     base = prescribed { x = ramp(to = 1 m, over = 1 s); }
  |                             ^^^^^^^^^^^^^^^^^^^^^^^^^^
  = help: courses without a jump of the rate: constant, sine, trajectory(interpolation = cubic), trapezoid

1 warning
"""),
    ("base = free;", "environment { velocity_products = off; }", """\
error[D253]: a free base moves by velocity products, and they are off
  --> deck.ic:10:39
   |
10 |     environment { velocity_products = off; }
   |                                       ^^^
  ::: deck.ic:8:5  a free base
   = help: leave `velocity_products = off` out

1 error
"""),
    ("base = prescribed { yaw = sine(amplitude = 1 deg, frequency = 1 Hz); }",
     "environment { velocity_products = off; }", """\
error[D253]: a base that turns moves by velocity products, and they are off
  --> deck.ic:10:39
   |
10 |     environment { velocity_products = off; }
   |                                       ^^^
  ::: deck.ic:8:5  a base that turns
   = help: leave `velocity_products = off` out

1 error
"""),
    ("base = fixed;", "initial { base.position = [1, 0, 0] m; }", """\
error[D255]: a fixed base stays at the world's origin, so `base.position` has no effect
 --> deck.ic:9:15
  |
9 |     initial { base.position = [1, 0, 0] m; }
  |               ^^^^^^^^^^^^^
  = help: write `base = free;`, or put the arm elsewhere: `at` and `rpy` of the joints on the base

1 error
"""),
    ("base = prescribed { x = 1 m; }", "initial { base.rate = [1, 0, 0] rad/s; }", """\
error[D255]: a prescribed base begins where its courses do, so `base.rate` has no effect
 --> deck.ic:9:15
  |
9 |     initial { base.rate = [1, 0, 0] rad/s; }
  |               ^^^^^^^^^
  = help: leave it out; `base = prescribed { ... }` says where it is: x, y, z, roll, pitch, yaw

1 error
"""),
    ("base = free;", "initial { base.pos = [1, 0, 0] m; }", """\
error[D114]: no initial `base.pos`
 --> deck.ic:9:15
  |
9 |     initial { base.pos = [1, 0, 0] m; }
  |               ^^^^^^^^
  = help: did you mean `base.position`?
  = help: there is: q, qd, hinge.q, hinge.qd, servos, base.position, base.rpy, base.velocity, base.rate

1 error
"""),
    ("base = fixed;", "environment { push = wrench { link = base; force = [1, 0, 0] N; } }", """\
warning[D256]: environment `push` changes nothing: link `base` is part of the ground
  --> deck.ic:10:42
   |
10 |     environment { push = wrench { link = base; force = [1, 0, 0] N; } }
   |                                          ^^^^
   = help: write `base = free;` in the run, or name a link that a joint moves

1 warning
"""),
]  # fmt: skip


@pytest.mark.parametrize(("base", "other", "expected"), MISTAKES)
def test_a_mistake_is_told_with_its_place_and_a_remedy(tmp_path: Path, base: str, other: str, expected: str) -> None:
    changes = [("base = free;", base)]
    if other:
        changes.append((f"{other.partition(' ')[0]} {{}}", other))
    assert messages(check(tmp_path, ARM, changed(RUN, *changes))) == expected


def test_a_free_base_without_mass_is_told(tmp_path: Path) -> None:
    arm = changed(ARM, ("    link base { mass = 50 kg; shape = sphere(radius = 1 m); }\n", ""))
    assert (
        messages(check(tmp_path, arm, RUN))
        == """\
error[D254]: the base moves freely and has no mass
 --> deck.ic:7:5
  |
7 |     base = free;
  |     ^^^^
  = help: give the arm the base's body: `link base { mass = 400 kg; shape = sphere(radius = 0.5 m); }`
  = help: or write the mass of a link that is fixed to the base

1 error
"""
    )


def test_a_free_base_whose_body_is_written_without_mass_needs_a_mass_and_no_second_body(tmp_path: Path) -> None:
    arm = changed(ARM, ("mass = 50 kg; shape = sphere(radius = 1 m)", "mass = 0 kg"))
    (found,) = check(tmp_path, arm, RUN).diagnostics
    assert (found.code, found.help[0]) == ("D254", "write a mass above 0 kg for link `base`")


def test_a_free_base_that_loses_its_mass_in_a_case_is_told(tmp_path: Path) -> None:
    sweep = "sweep light of it { vary links.base.mass = [1, 0] kg; }"
    arm = changed(ARM, ("shape = sphere(radius = 1 m)", "inertia = [0, 0, 0] kg*m^2"))
    assert [d.code for d in check(tmp_path, arm, RUN, sweep, select=["light"]).diagnostics] == ["D254"]


def test_a_link_fixed_to_the_base_is_its_mass_as_well(tmp_path: Path) -> None:
    arm = changed(
        ARM,
        ("    link base", "    link hull"),
        ("    joint hinge", "    joint mount fixed { parent = base; child = hull; }\n    joint hinge"),
    )
    assert messages(check(tmp_path, arm, RUN)) == ""


def test_no_joint_is_called_base_and_none_has_it_for_a_child(tmp_path: Path) -> None:
    text = changed(ARM, ("joint hinge", "joint base"))
    assert (
        messages(check(tmp_path, text, RUN)).partition("\n\n")[0]
        == """\
error[D166]: `base` begins paths of its own, so no joint may be called so
 --> deck.ic:4:5
  |
4 |     joint base revolute { parent = base; child = bar; axis = z; }
  |     ^^^^^^^^^^^^^^^^^^^
  = help: give the joint another name"""
    )
    text = changed(ARM, ("child = bar", "child = base"))
    assert "error[D093]: the base cannot be a child\n" in messages(check(tmp_path, text, RUN))


def test_a_component_varies_by_its_parameters(tmp_path: Path) -> None:
    sweep = "sweep some of it { vary base.x = [1, 2] cm; }"
    assert (
        messages(check(tmp_path, ARM, changed(RUN, ("base = free;", SHAKEN)), sweep, select=["some"]))
        == """\
error[D122]: `base.x` cannot vary
  --> deck.ic:15:25
   |
15 | sweep some of it { vary base.x = [1, 2] cm; }
   |                         ^^^^^^
   = help: it is a course in time: vary a parameter of it, `base.x.PARAMETER`

1 error
"""
    )


def test_a_spin_that_the_step_does_not_follow_is_warned_of(tmp_path: Path) -> None:
    spun = changed(RUN, ("initial {}", "initial { base.rate = [150, 0, 200] rad/s; }"))
    assert (
        messages(check(tmp_path, ARM, spun))
        == """\
warning[D300]: the base turns by 0.25 rad in a step of the dynamics
 --> deck.ic:9:27
  |
9 |     initial { base.rate = [150, 0, 200] rad/s; }
  |                           ^^^^^^^^^^^^^^^^^^^ h = 0.001 s
  = help: below 0.2 rad a step a body that tumbles keeps its energy to 1% a turn with modified_euler: the slowest rate that fits is 2000 Hz
  = help: a steady spin about a principal axis through the frame's origin needs less

1 warning
"""
    )
    assert messages(check(tmp_path, ARM, changed(spun, ("duration", "integrator = rk4; duration")))) == ""
    sweep = "sweep some of it { vary initial.base.rate.x = [100, 300] rad/s; }"
    found = check(
        tmp_path, ARM, changed(RUN, ("initial {}", "initial { base.rate = [0, 0, 10] rad/s; }")), sweep, select=["some"]
    )
    assert [d.message for d in found.diagnostics] == ["the base turns by 0.3 rad in a step of the dynamics"]


def test_a_kind_of_command_is_no_course_of_a_base(tmp_path: Path) -> None:
    text = changed(RUN, ("base = free;", "base = prescribed { yaw = rate(1 rad/s); }"))
    assert (
        messages(check(tmp_path, ARM, text))
        == """\
error[D250]: `yaw` of the base is told its positions, and `rate` is a kind of command of servos
 --> deck.ic:8:31
  |
8 |     base = prescribed { yaw = rate(1 rad/s); }
  |                               ^^^^^^^^^^^^^
  = help: write the course alone: `yaw = trapezoid(to = 10 deg, max_rate = 10 deg/s, max_acceleration = 10 deg/s^2);`

1 error
"""
    )


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ([("base = free;", "")], ["D257"]),
        ([("base = free;", "base = fixed;")], []),
        ([("base = free;", ""), ("mass = 50 kg", "mass = 0 kg")], []),  # there for the picture alone
        ([("base = free;", ""), ("environment {}", "environment { gravity = [0, 0, -9.81] m/s^2; }")], []),
        ([("base = free;", ""), ("run ", "run other like RUN { base = free; }\nrun ")], []),
    ],
)
def test_a_body_of_a_base_that_is_held_where_nothing_weighs_is_told(
    tmp_path: Path, changes: list[tuple[str, str]], expected: list[str]
) -> None:
    name = RUN.split()[1]
    text = changed(ARM + RUN, *((old, new.replace("RUN", name)) for old, new in changes))
    assert [each.code for each in check(tmp_path, text, select="all").diagnostics] == expected
