"""What a sweep is told: the caret on the value that is meant, a cause that is true, a remedy that works."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, messages


def said(folder: Path, *parts: str) -> list[str]:
    """Message, first place and remedies of every diagnostic of a deck that ends with these parts."""
    compiled = check(folder, ARM, SERVO, RUN, *parts, select="all")
    lines = []
    for each in compiled.diagnostics:
        assert each.at is not None
        sources = {name: text.split("\n") for name, text in compiled.sources.items()}
        place = each.at.place
        shown = sources[place.file][place.line - 1][place.column - 1 : place.column - 1 + place.length]
        lines.append(f"{each.code} [{shown}] {each.message}" + "".join(f" | {remedy}" for remedy in each.help))
    return lines


def swept(folder: Path, body: str, *before: str) -> list[str]:
    return said(folder, *before, f"sweep it of hold {{ {body} }}\n")


TWICE = "leave one out: each case stands in the table once"
EACH = "write a run for each, `like` the first, and `sweep NAME = ONE + OTHER;`"


@pytest.mark.slow
@pytest.mark.parametrize(("body", "message"), [
    ("vary links.bar.mass = [1, 2, 1.0] kg;", f"D133 [1.0] values number 1 and 3 are the same | {TWICE}"),
    ("vary integrator = [rk4, midpoint, rk4];", f"D133 [rk4] values number 1 and 3 are the same | {TWICE}"),
    ("vary record = [q, qd];", "D122 [record] `record` cannot vary | record all that any case needs"),
    ("vary links.bar.shape = [rod(length = 1 m, along = x), rod(length = 2 m, along = x)];",
     "D122 [rod(length = 1 m, along = x)] `links.bar.shape` cannot vary over `rod` and the like | "
     f"vary a parameter of it: `vary links.bar.shape.PARAMETER = [...];` | {EACH}"),
    ("vary links.bar.shape.along = [x, y];", f"D122 [x] `links.bar.shape.along` cannot vary over words | {EACH}"),
    ("vary rates = [1, 2] kHz;", "D122 [rates] `rates` cannot vary | vary one of its parts, or what it names"),
    ("vary links.bar.com = [[1, 2, 3], [3, 4, 5]] m;",
     "D126 [[[1, 2, 3], [3, 4, 5]]] a list inside a list | a vector varies by its parts: "
     "`vary links.bar.com.x = [...];`"),
    ("vary drive.kp = [drive.kp, 2 * drive.kp];",
     "D121 [[drive.kp, 2 * drive.kp]] the values of `drive.kp` depend on `drive.kp` itself, which varies | "
     "write numbers that stand still"),
    ("vary drive.kp = [1, 2] V*s/rad; vary drive.ki = [drive.kp * 6 1/s, 1 V/rad];",
     "D121 [[drive.kp * 6 1/s, 1 V/rad]] the values of `drive.ki` depend on `drive.kp`, which varies too | "
     "write numbers that stand still | or compute it from `drive.kp` where it is defined, and vary `drive.kp` alone"),
    ("vary links.bar.mass = [links.bar.mass, 2 kg];",
     "D065 [links.bar.mass] no value `links.bar.mass` | a value names a `let`, or what a servo's definition writes, "
     "such as `SERVO.kp`"),
    ("sample lhs(5) { duration = uniform(1, 2) s; }",
     "D122 [duration] `duration` cannot vary like this | it decides the program: write `vary duration = [...];`"),
    ("sample lhs(5) { hinge.servo = uniform(1, 2); }",
     "D122 [hinge.servo] `hinge.servo` cannot vary over numbers | it varies over names: `vary hinge.servo = [...];`"),
    ("sample lhs(5) { vary drive.kp = uniform(1, 2) V*s/rad; }",
     "D224 [vary drive.kp] a sample holds `PATH = DISTRIBUTION(...);` and nothing else | leave out `vary` | "
     "distributions: uniform, loguniform, normal, truncated"),
    ("sample 200 { drive.kp = uniform(1, 2) V*s/rad; }",
     "D020 [{] expected `;`, found `{` | a sample names its design: `sample lhs(200) { ... }`"),
    ("sample lhs(5) { links.bar.mass = normal(1, 1e-15) kg; }",
     "D225 [links.bar.mass] `links.bar.mass` hardly varies: 5 samples have 1 value | values have 12 digits: draw it "
     "from a wider distribution | or leave it out"),
    ("zip { links.bar.mass = [1, 2] kg; repeat 5; }",
     "D136 [repeat] a zip holds `PATH = [...];` and nothing else | all else stands in the sweep, beside the zip"),
    ("vary links.bar.mass = [1, 2] kg; duration = 3 s;",
     "D136 [duration] `duration = ...` in a sweep | `vary duration = [...];` to vary it | or set it in a run "
     "`like hold`, and sweep that"),
    ("vary links.bar.mass = [1, 2] kg; seeds = independent;",
     "D230 [seeds] there is no noise in this run, so no case has noise of its own | leave `seeds` out"),
    ("vary hinge.at.x = 1 mm .. 2 mm by 0.3 mm;",
     "D220 [2 mm] the steps do not meet the end: they reach 1.9 mm, and 2 mm is not a whole number of steps from the "
     "first | end where the steps do, or `linspace(from, to, count)`, whose ends are met"),
    ("vary integrator = [rk4, midpoint]; exclude when integrator == rk;",
     "D130 [rk] `integrator` is never `rk` in this sweep | did you mean `rk4`? | it varies over: rk4, midpoint"),
    ("vary links.bar.mass = [1, 2] kg; exclude when hinge.qd > 1 rad/s;",
     "D065 [hinge.qd] `hinge.qd` is a channel, which has no value before a case has run | exclude by what varies, or "
     "by parameters of the run"),
    ("vary hinge.at.x = [-1, 2] m; exclude when sqrt(hinge.at.x * 1 m) > 1 m;",
     "D066 [>] a side of this comparison has no value in 1 of 2 cases | it is the root of a negative number, or zero "
     "divided by zero | ask before whether there is one: `exclude when x >= 0 m^2 and sqrt(x) > 1 m;`"),
])  # fmt: skip
def test_the_caret_the_cause_and_the_remedy(tmp_path: Path, body: str, message: str) -> None:
    assert swept(tmp_path, body) == [message]


def test_a_rate_of_a_list_is_shown_alone(tmp_path: Path) -> None:
    (one,) = swept(tmp_path, "vary rates.servos = [300, 500] Hz;")
    assert one.startswith("D100 [300] `servos` at 300 Hz does not divide the base rate, 1000 Hz")


def test_a_metric_has_no_value_before_a_case_has_run(tmp_path: Path) -> None:
    run = "run watched like hold { metric top = max { of = hinge.qd; } }\n"
    sweep = "sweep it of watched { vary links.bar.mass = [1, 2] kg; exclude when top > 1 rad/s; }"
    (one,) = said(tmp_path, run, sweep)
    assert one.startswith("D065 [top] `top` is a metric, which has no value before a case has run")


MOST = (
    "sweep it of hold {\n    vary links.bar.mass = [1, 2] kg;\n"
    "    exclude when links.bar.mass > most;\n    exclude when most > 3 kg;\n}\n"
)


@pytest.mark.parametrize(("value", "message"), [
    ("2 kg +", "D020 [;] expected a value, found `;` | the value is missing"),
    ("gone * 2 kg", "D065 [gone] no value `gone` | define it: `let gone = ...;`"),
])  # fmt: skip
def test_of_a_name_with_a_wrong_value_its_value_is_told_and_once(tmp_path: Path, value: str, message: str) -> None:
    assert said(tmp_path, f"let most = {value};\n", MOST) == [message]


@pytest.mark.parametrize(
    "condition",
    [
        "hinge.at.x >= 0 m and sqrt(hinge.at.x * 1 m) > 1 m",
        "not (hinge.at.x < 0 m or sqrt(hinge.at.x * 1 m) <= 1 m)",
    ],
)
def test_a_root_that_is_asked_for_where_there_is_one_is_one(tmp_path: Path, condition: str) -> None:
    turned = changed(RUN, ("record = [q]", "record = [q, links.bar.position]"))
    body = f"vary hinge.at.x = [-1, 2, 0.5] m; exclude when {condition};"
    compiled = check(tmp_path, ARM, SERVO, turned, f"sweep it of hold {{ {body} }}", select=["it"])
    assert compiled.plan is not None, messages(compiled)
    assert compiled.plan.experiments[0].cases.coordinates[0].values.tolist() == [-1.0, 0.5]


def test_the_sides_of_a_rounding_edge_are_shown_as_numbers(tmp_path: Path) -> None:
    body = "vary links.bar.mass = [0.1, 0.3, 0.5] kg; exclude when links.bar.mass < (0.1 + 0.2) kg;"
    (one,) = check(tmp_path, ARM, SERVO, RUN, f"sweep it of hold {{ {body} }}", select=["it"]).diagnostics
    assert [label.text for label in one.also] == ["0.3", "0.30000000000000004"]


def test_a_limit_that_varies_is_told_once(tmp_path: Path) -> None:
    run = "run judged like hold { metric top = max { of = hinge.qd; } require top < limit; }\nlet limit = 1 rad/s;\n"
    (one,) = said(tmp_path, run, "sweep it of judged { vary limit = [1, 2] rad/s; }")
    assert one.startswith("D122 [limit] the limit of a requirement varies with the sweep")


def test_a_value_that_becomes_infinite_in_one_case_is_told_without_a_unit(tmp_path: Path) -> None:
    run = "let share = 2;\nrun tilted like hold { initial { hinge.q = 1 rad / share; } }\n"
    (one,) = said(tmp_path, run, "sweep it of tilted { vary share = [1, 0]; }")
    assert "must be finite; case #1 breaks it" in one


def test_a_requirement_of_a_channel_is_told_of_metrics(tmp_path: Path) -> None:
    (one,) = said(tmp_path, "run judged like hold { require hinge.qd < 1 rad/s; }\n")
    assert one == (
        "D132 [hinge.qd] no metric `hinge.qd` | metrics of this run: none | a metric of a channel is "
        "`metric NAME = max { of = hinge.qd; }`, and `require NAME < ...;`"
    )


# Tables


def test_a_row_that_is_there_twice_is_shown(tmp_path: Path) -> None:
    (tmp_path / "cases.csv").write_text("drive.kp [V*s/rad], links.bar.mass [kg]\n1, 2\n2, 3\n1, 2\n")
    assert swept(tmp_path, 'from "cases.csv";') == [f"D133 [1, 2] values number 1 and 3 are the same | {TWICE}"]


def test_a_column_without_its_unit_is_told_where_the_unit_stands(tmp_path: Path) -> None:
    (tmp_path / "cases.csv").write_text("links.bar.mass\n1\n2\n")
    (one,) = swept(tmp_path, 'from "cases.csv";')
    assert one.endswith("| write the unit in square brackets behind the column's name: `[kg]`")


def test_values_that_depend_on_a_column_of_a_table_are_an_error(tmp_path: Path) -> None:
    (tmp_path / "cases.csv").write_text("heavy [kg]\n1\n2\n")
    run = "let heavy = 3 kg;\narm loaded like swing { bar { mass = heavy; } }\nrun lift like hold { arm = loaded; }\n"
    sweep = 'sweep it of lift { from "cases.csv"; vary links.bar.shape.length = [heavy * 1 m/kg, 2 m]; }'
    (one,) = said(tmp_path, run, sweep)
    assert "the values of `links.bar.shape.length` depend on `heavy`, which varies too" in one


# Sums


def test_runs_that_differ_in_their_program_alone_make_a_sum(tmp_path: Path) -> None:
    fine = "run fine like hold { integrator = rk4; }\nrun long like hold { duration = 2 s; }\n"
    assert said(tmp_path, fine, "sweep all_of_it = hold + fine + long;") == []


def test_the_same_run_under_another_name_is_told(tmp_path: Path) -> None:
    (one,) = said(tmp_path, "run same like hold { }\n", "sweep both = hold + same;")
    assert one == (
        "D227 [same] case #0 of `same` is in `hold` too | exclude it in one of the two: each case stands in "
        "the table once | `met cases DECK same` prints it"
    )


def test_a_sum_of_what_is_wrong_says_no_more(tmp_path: Path) -> None:
    (one,) = said(tmp_path, "run bad like hold { durtion = 2 s; }\n", "sweep both = hold + bad;")
    assert one.startswith("D109")


# Macros

COUNT = "#ifndef COUNT\n#define COUNT 1\n#endif\nrun counted like hold { duration = COUNT * 1 s; }\n"


def test_a_macro_may_bring_exclusions_of_its_own(tmp_path: Path) -> None:
    body = (
        "vary macro COUNT = [1, 2]; vary links.bar.mass = [1, 2, 3, 4] kg; exclude when links.bar.mass < 1.5 kg;\n"
        "#if COUNT > 1\nexclude when links.bar.mass == 2 kg;\nexclude when links.bar.mass > 3.5 kg;\n#endif\n"
    )
    compiled = check(tmp_path, ARM, SERVO, RUN, COUNT, f"sweep it of counted {{ {body} }}\n", select=["it"])
    assert compiled.plan is not None, messages(compiled)
    masses = [group.cases.coordinates[0].values.tolist() for group in compiled.plan.experiments]
    assert masses == [[2.0, 3.0, 4.0], [3.0]]
    assert compiled.diagnostics == ()


def test_what_is_chosen_must_not_depend_on_a_macro(tmp_path: Path) -> None:
    other = "#if COUNT > 1\n#define OTHER rk4\n#else\n#define OTHER midpoint\n#endif\n"
    sweep = "sweep it of counted { vary macro COUNT = [1, 2]; vary integrator = [OTHER, modified_euler]; }\n"
    (one,) = said(tmp_path, COUNT, other, sweep)
    assert one.startswith("D226 [sweep it] with this macro sweep `it` varies something else")


def test_a_macro_in_a_condition_is_its_name_alone(tmp_path: Path) -> None:
    body = "vary macro COUNT = [1, 2]; exclude when macro COUNT > 1;"
    (one,) = said(tmp_path, COUNT, f"sweep it of counted {{ {body} }}\n")
    assert one == (
        "D136 [exclude when macro] a condition names a macro by its name alone | leave out the word "
        "`macro`: the macro's value is put in as text"
    )
