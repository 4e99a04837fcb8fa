"""What loops, lists by index, and names taken together mean: the plan of what they stand for, and what is told."""

from __future__ import annotations

from pathlib import Path

import pytest

from ic.driver.compile import Compiled
from met.messages.edits import edits
from met.plan import Experiment
from tests.ic.small_decks import check, messages

ARM = """\
arm pair {
    for side in [left, right] {
        link {side} { mass = 1 kg;  shape = rod(length = 1 m, along = x); }
        joint j_{side} revolute { parent = base;  child = side;  axis = z; }
    }
}
servo one { model = passive;  damping = 1 N*m*s/rad; }
servo two { model = passive;  damping = 2 N*m*s/rad; }
"""
RUN = """\
run it {{
    arm = pair;
    servos {{ {} }}
    rates {{ dynamics = 500 Hz;  record = 50 Hz; }}
    duration = 1 s;
    record = [q];
    {}
}}
"""


def checked(folder: Path, text: str, select: str | None = None) -> Compiled:
    return check(folder, text, select=select)


def told(folder: Path, text: str) -> str:
    return messages(check(folder, text, select="all"))


def damping(experiment: Experiment) -> dict[str, object]:
    return {
        path.split(".")[0]: quantity.value
        for path, quantity in experiment.parameters.items()
        if path.endswith(".servo.damping")
    }


@pytest.mark.parametrize(("servos", "left", "right"), [
    ("* = one;", 1, 1),
    ("* = one;  j_right = two;", 1, 2),
    ("j_right = two;  * = one;", 1, 2),
    ("* = one { damping = 3 N*m*s/rad; };", 3, 3),
    ("* = one;  j_left { damping = 4 N*m*s/rad; }", 4, 1),
    ("* = one { damping = 3 N*m*s/rad; };  j_left { damping = 4 N*m*s/rad; }", 4, 3),
    ("[j_left, j_right] = two;", 2, 2),
    ("* = one;  [j_left] = two { damping = 5 N*m*s/rad; };", 5, 1),
    ("for side in [left, right] { j_{side} = two; }", 2, 2),
])  # fmt: skip
def test_a_joint_without_a_servo_of_its_own_has_that_of_the_others(
    tmp_path: Path, servos: str, left: float, right: float
) -> None:
    found = checked(tmp_path, ARM + RUN.format(servos, ""))
    assert found.plan is not None and found.diagnostics == ()
    assert damping(found.plan.experiments[0]) == {"j_left": left, "j_right": right}


@pytest.mark.parametrize(("base", "upon", "left", "right"), [
    ("* = one;", "j_left = two;", 2, 1),
    ("j_left = two;", "* = one;", 2, 1),
    ("* = one;", "* = two;", 2, 2),
    ("* = one;  j_left = two;", "remove j_left;", 1, 1),
])  # fmt: skip
def test_what_is_written_upon_a_base_changes_what_it_names(
    tmp_path: Path, base: str, upon: str, left: float, right: float
) -> None:
    text = ARM + RUN.format(base, "") + f"run other like it {{ servos {{ {upon} }} }}"
    found = checked(tmp_path, text, "other")
    assert found.plan is not None and found.diagnostics == ()
    assert damping(found.plan.experiments[0]) == {"j_left": left, "j_right": right}


def test_a_sweep_varies_the_servo_of_the_others(tmp_path: Path) -> None:
    text = ARM + RUN.format("* = one;", "") + "sweep s of it { vary one.damping = [1, 2] N*m*s/rad; }"
    text += "sweep by_joint of it { vary j_left.servo = [one, two]; }"
    found = checked(tmp_path, text, "all")
    assert found.plan is not None and found.diagnostics == ()
    chosen = [damping(each) for each in found.plan.experiments if each.sweep == "by_joint" or each.name == "by_joint"]
    assert {tuple(sorted(each.items())) for each in chosen} == {
        (("j_left", 1), ("j_right", 1)),
        (("j_left", 2), ("j_right", 1)),
    }


def test_initial_values_of_names_taken_together_and_of_loops(tmp_path: Path) -> None:
    initial = "initial { [j_left, j_right].q = 3 rad;  for side in [left, right] { j_{side}.qd = starts[0]; } }"
    found = checked(tmp_path, "let starts = [4, 5] rad/s;" + ARM + RUN.format("", initial))
    assert found.plan is not None and found.diagnostics == ()
    parameters = found.plan.experiments[0].parameters
    assert [parameters[f"initial.j_{side}.{part}"].value for side in ("left", "right") for part in ("q", "qd")] == [
        3, 4, 3, 4,
    ]  # fmt: skip


def test_a_vector_from_a_list_and_a_list_computed_from_lists(tmp_path: Path) -> None:
    lets = "let at = [[1, 2, 3] m, [4, 5, 6] m];\nlet sums = [1, 2] kg + [10, 20] kg;\n"
    text = ARM.replace("child = side;", "child = side;  at = at[1];").replace("1 kg", "sums[1]")
    found = checked(tmp_path, lets + text + RUN.format("", ""))
    assert found.plan is not None and found.diagnostics == ()
    parameters = found.plan.experiments[0].parameters
    assert parameters["links.left.mass"].value == 22
    assert [parameters[f"j_left.at.{axis}"].value for axis in "xyz"] == [4, 5, 6]


def test_the_origin_of_a_value_in_a_loop_is_its_line_and_turn(tmp_path: Path) -> None:
    found = checked(tmp_path, ARM + RUN.format("", ""))
    assert found.plan is not None
    place = found.plan.experiments[0].parameters["links.right.mass"].origin.place
    assert place is not None
    assert (place.line, [str(iteration) for iteration in place.iterations], place.macros) == (3, ["side = right"], ())


def test_the_same_joint_twice_is_told_as_ever(tmp_path: Path) -> None:
    assert told(tmp_path, ARM + RUN.format("[j_left, j_right] = one;  j_left = two;", "")).startswith("""\
error[D040]: `j_left` is written twice
  --> deck.ic:11:40
   |
11 |     servos { [j_left, j_right] = one;  j_left = two; }
   |                                        ^^^^^^ again
  ::: deck.ic:11:15  first
   = help: remove one of the two
""")


def test_a_name_that_every_turn_writes_is_told_with_the_remedy(tmp_path: Path) -> None:
    assert (
        told(tmp_path, "for i in 1 .. 4 {\n    let span = 3 m;\n}\n")
        == """\
error[D040]: let `span` is written twice
 --> deck.ic:2:9
  |
2 |     let span = 3 m;
  |         ^^^^ again
 ::: deck.ic:2:9  first
 ::: deck.ic:1:1  likewise where i = 3, 4
  = help: each iteration writes it: name it by the index, as in `span_{i}`
  = note: in `for i` at deck.ic:1:1, i = 2

1 error
"""
    )


@pytest.mark.parametrize(("value", "said"), [
    ("one[0]", "`one` is one number, and no list"),
    ("spans[0.5]", "`spans` has no value with the index 0.5"),
    ("spans[-1]", "`spans` has no value with the index -1"),
    ("spans[1 m]", "`spans` has no value with the index a quantity in m"),
])  # fmt: skip
def test_an_index_that_names_no_value_is_refused(tmp_path: Path, value: str, said: str) -> None:
    lines = told(tmp_path, f"let one = 1 m;\nlet spans = [1, 2] m;\nlet x_0 = {value};\n").split("\n")
    assert lines[0] == f"error[D286]: {said}"


def test_which_value_of_a_list_is_taken_cannot_vary(tmp_path: Path) -> None:
    text = "let spans = [1, 2] m;\nlet which = 0;\nlet span = spans[which];\n"
    text += ARM.replace("length = 1 m", "length = span") + RUN.format("", "") + "sweep s of it { vary which = [0, 1]; }"
    assert told(tmp_path, text).startswith("""\
error[D286]: which value of a list is taken cannot vary
 --> deck.ic:3:18
  |
3 | let span = spans[which];
  |                  ^^^^^
  = help: vary the values of the list, or a value of its own
""")


def test_a_mistake_in_some_iterations_is_told_of_the_first_of_them(tmp_path: Path) -> None:
    text = "let spans = [1, 2] m;\nfor i in 0 .. 4 {\n    let x_{i} = spans[i];\n}\n"
    assert (
        told(tmp_path, text)
        == """\
error[D286]: `spans` has no value with the index 2
 --> deck.ic:3:23
  |
3 |     let x_{i} = spans[i];
  |                       ^
 ::: deck.ic:2:1  likewise where i = 3, 4
  = help: `spans` has 2 values, `spans[0]` to `spans[1]`
  = note: in `for i` at deck.ic:2:1, i = 2

1 error
"""
    )


def test_a_deck_is_varied_over_the_number_of_its_iterations_by_a_macro(tmp_path: Path) -> None:
    text = "#ifndef COUNT\n#define COUNT 2\n#endif\narm row {\n    for i in 1 .. COUNT {\n"
    text += "        link l_{i} { mass = 1 kg;  shape = rod(length = 1 m, along = x); }\n"
    text += "        joint j_{i} revolute { parent = base;  child = l_{i};  axis = z; }\n    }\n}\n"
    text += RUN.format("", "").replace("pair", "row") + "sweep s of it { vary macro COUNT = [1, 3]; }"
    found = checked(tmp_path, text, "s")
    assert found.plan is not None and found.diagnostics == ()
    assert sorted(len(each.structure.joints) for each in found.plan.experiments) == [1, 3]


def test_the_remedy_for_a_bare_index_keeps_it_and_no_edit_is_of_one_turn_alone(tmp_path: Path) -> None:
    wrong = ARM.replace("for side in [left, right]", "for i in 1 .. 2").replace("{side}", "b_{i}")
    wrong = wrong.replace("mass = 1 kg", "mass = i").replace("child = side", "child = c_{i}")
    found = check(tmp_path, wrong + RUN.format("", ""))
    told = {each.code: each for each in found.diagnostics}
    assert told["D060"].help == ("write `i kg`",)
    assert [edit.text for _, edit in edits(told["D060"], found.sources)] == ["i kg"]
    assert told["D094"].help[0] == "did you mean `b_1`?"
    assert tuple(edits(told["D094"], found.sources)) == ()


def test_the_remedy_for_a_number_that_is_as_the_index_keeps_the_number(tmp_path: Path) -> None:
    wrong = ARM.replace("for side in [left, right]", "for i in 1 .. 2").replace("{side}", "b_{i}")
    wrong = wrong.replace("mass = 1 kg", "mass = 1").replace("child = side", "child = b_{i}")
    found = check(tmp_path, wrong + RUN.format("", ""))
    (told,) = found.diagnostics
    assert told.help == ("write `1 kg`",)
    assert [edit.text for _, edit in edits(told, found.sources)] == ["1 kg"]


def test_a_block_that_every_turn_writes_is_told_to_hold_the_loop(tmp_path: Path) -> None:
    text = ARM + RUN.format("", "for side in [left, right] {\n        initial { j_{side}.q = 1 rad; }\n    }")
    assert (
        told(tmp_path, text)
        == """\
error[D040]: `initial` is written twice
  --> deck.ic:16:9
   |
16 |         initial { j_{side}.q = 1 rad; }
   |         ^^^^^^^ again
  ::: deck.ic:16:9  first
   = help: each iteration writes it: put the loop inside, `initial { for side in ... { ... } }`
   = note: in `for side` at deck.ic:15:5, side = right

1 error
"""
    )


def test_values_of_lists_and_loops_stand_in_signals_requirements_and_sweeps(tmp_path: Path) -> None:
    inside = "for i in 0 .. 1 { signal lag_{i} = j_left.q - limits[i];  metric top_{i} = max { of = signals.lag_{i}; } "
    inside += "require top_{i} < limits[i]; }"
    text = "let limits = [3, 4] rad;\n" + ARM + RUN.format("", inside)
    text += "sweep s of it { for side in [left, right] { vary links.{side}.mass = [1, 2, 3] kg; } "
    text += "exclude when links.left.mass > 2 kg and limits[0] > 1 rad; }"
    found = checked(tmp_path, text, "all")
    assert found.plan is not None and found.diagnostics == ()
    run, sweep = found.plan.experiments
    assert [each.text for each in run.requirements] == ["top_0 < limits[0]", "top_1 < limits[1]"]
    assert [each.limit for each in run.requirements] == [3, 4]
    assert sweep.cases.count == 6


def test_a_star_that_a_run_takes_over_may_stand_for_no_joint_there(tmp_path: Path) -> None:
    text = ARM + RUN.format("* = one;", "") + "run other like it { servos { [j_left, j_right] = two; } }\n"
    assert told(tmp_path, text) == ""
    text = ARM + RUN.format("* = one; [j_left, j_right] = two;", "")
    assert "warning[D287]" in told(tmp_path, text)


def test_a_name_whose_braces_were_forgotten_is_told_with_them(tmp_path: Path) -> None:
    wrong = ARM.replace("for side in [left, right]", "for i in 1 .. 2").replace("link {side}", "link b_i")
    wrong = wrong.replace("{side}", "{i}").replace("child = side", "child = b_i")
    assert "error[D040]: link `b_i` is written twice" in told(tmp_path, wrong) and "as in `b_{i}`\n" in told(
        tmp_path, wrong
    )
