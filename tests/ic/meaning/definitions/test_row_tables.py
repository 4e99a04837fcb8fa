"""Values by the names of rows and columns of a CSV file: what they come to, where they come from, every mistake."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

import ic
from ic.driver.explain import explain
from met.plan import keys
from tests.ic.small_decks import check, experiment, messages
from tests.oracles.random_deck import in_a_table, random_deck

BODIES = """\
# measured on the bench
link,  mass [kg], com.x [m], com.y [m], com.z [m], inertia.xx [g*m^2], inertia.yy [g*m^2], inertia.zz [g*m^2], by
boom,  12.5,      0.4,       0,         0,         10,                 700,                700,                drawing
stick, 7.1,       0.3,       0,         0.02,      9,                  400,                400,                scale
spare, ,          0.3,       0,         0.02,      9,                  400,                400,                -
"""
JOINTS = "joint, qd_max [deg/s], q_max [deg], kp\na, 100, 170, 0.1\nb, 90.5, , 0.2\n"
TABLES = 'let bodies = csv("bodies.csv");\nlet lim = csv("joints.csv");\n'
ARM = """\
arm crane {
    for name in [boom, stick] {
        link {name} { mass = bodies.{name}.mass; com = bodies.{name}.com; inertia = bodies.{name}.inertia; }
    }
    joint a revolute { parent = base; child = boom; axis = y; qd_max = lim.a.qd_max; }
    joint b revolute { parent = boom; child = stick; axis = y; at = [2 * bodies.boom.com.x, 0 m, 0 m]; }
}
"""
RUN = """\
run fall {
    arm = crane;
    rates { dynamics = 1 kHz; record = 100 Hz; }
    duration = 1 s;
    record = [q];
}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "bodies.csv").write_text(BODIES, encoding="utf-8")
    (tmp_path / "joints.csv").write_text(JOINTS, encoding="utf-8")
    return tmp_path


def test_a_deck_with_tables_has_the_numbers_and_the_keys_of_one_that_writes_them_out(folder: Path) -> None:
    written = """\
arm crane {
    link boom { mass = 12.5 kg; com = [0.4, 0, 0] m; inertia = [10, 700, 700] g*m^2; }
    link stick { mass = 7.1 kg; com = [0.3, 0, 0.02] m; inertia = [9, 400, 400] g*m^2; }
    joint a revolute { parent = base; child = boom; axis = y; qd_max = 100 deg/s; }
    joint b revolute { parent = boom; child = stick; axis = y; at = [2 * 0.4 m, 0 m, 0 m]; }
}
"""
    tabled, plain = experiment(folder, TABLES, ARM, RUN), experiment(folder, written, RUN)
    assert {path: each.value for path, each in tabled.parameters.items()} == {
        path: each.value for path, each in plain.parameters.items()
    }
    assert keys.structure_key(tabled.structure) == keys.structure_key(plain.structure)


@pytest.mark.release
def test_a_cell_with_its_unit_is_rounded_as_the_deck_rounds_it(folder: Path) -> None:
    pick = random.Random(24)
    units = ["kg", "g", "mg", "t"]
    rows = [(f"r_{n}", f"{pick.uniform(0, 1e4):.{pick.randrange(12)}g}", pick.choice(units)) for n in range(200)]
    for unit in units:
        lines = [f"{name}, {text}" for name, text, of in rows if of == unit]
        (folder / f"{unit}.csv").write_text("\n".join(["row, mass [" + unit + "]", *lines]), encoding="utf-8")
    lets = "".join(f'let {unit}_table = csv("{unit}.csv");\n' for unit in units)
    arms = [
        "arm all {" + "".join(
            f"link {name} {{ mass = {mass}; shape = sphere(radius = 1 m); }} "
            f"joint j_{name} revolute {{ parent = base; child = {name}; axis = z; }}"
            for name, mass in each
        ) + "}"
        for each in (
            [(name, f"{unit}_table.{name}.mass") for name, _, unit in rows],
            [(name, f"{text} {unit}") for name, text, unit in rows],
        )
    ]  # fmt: skip
    run = RUN.replace("crane", "all")
    masses = [
        [each.value for path, each in experiment(folder, *parts).parameters.items() if path.endswith(".mass")]
        for parts in ((lets, arms[0], run), (arms[1], run))
    ]
    assert masses[0] == masses[1] and len(masses[0]) == len(rows)


def test_the_plan_says_the_cell_and_holds_the_file(folder: Path) -> None:
    compiled = check(folder, TABLES, ARM, RUN)
    assert compiled.plan is not None
    origin = compiled.plan.experiments[0].parameters["links.stick.mass"].origin
    assert origin.note.startswith("from `bodies.stick.mass` (") and origin.note.endswith("bodies.csv:4:8)")
    of_vector = compiled.plan.experiments[0].parameters["links.stick.com.z"].origin.place
    assert of_vector is not None and (of_vector.line, of_vector.column) == (4, 41)
    assert BODIES in [source.text for source in compiled.plan.sources]


def test_explain_leads_to_the_cell_and_knows_its_path(folder: Path) -> None:
    check(folder, TABLES, "let heavy = 2 * bodies.boom.mass;\n", ARM.replace("bodies.{name}.mass", "heavy"), RUN)
    (found,) = explain(folder / "deck.ic", "links.boom.mass")
    assert [(Path(label.place.file).name, label.place.line, label.text) for label in found.names] == [
        ("deck.ic", 3, "heavy = 2 * bodies.boom.mass"),
        ("bodies.csv", 3, "bodies.boom.mass = 12.5 kg"),
    ]
    (cell,) = explain(folder / "deck.ic", "bodies.boom.mass")
    assert (cell.value, cell.unit, cell.place and cell.place.line) == (12.5, "kg", 3)


def test_a_run_an_including_deck_and_the_command_line_take_another_file(folder: Path) -> None:
    (folder / "other.csv").write_text(BODIES.replace("12.5", "13"), encoding="utf-8")

    def mass(*parts: str, select: str, **options: object) -> object:
        compiled = check(folder, *parts, select=[select], **options)
        assert compiled.plan is not None, messages(compiled)
        return compiled.plan.experiments[0].parameters["links.boom.mass"].value

    other = 'run other like fall { with bodies = csv("other.csv"); }\n'
    assert mass(TABLES, ARM, RUN, other, select="other") == 13.0
    assert mass(TABLES, ARM, RUN, other, select="fall") == 12.5
    assert mass(TABLES, ARM, RUN, select="fall", set={"bodies": 'csv("other.csv")'}) == 13.0
    (folder / "part.ic").write_text(TABLES.replace("let bodies", "param bodies") + ARM + RUN, encoding="utf-8")
    assert mass('param bodies = csv("other.csv");\n#include "part.ic"\n', select="fall") == 13.0


def test_values_of_tables_stand_in_sweeps_conditions_signals_and_requirements(folder: Path) -> None:
    run = RUN.replace(
        "record = [q];",
        "record = [q]; signal share = a.qd / lim.a.qd_max; metric fast = peak { of = signals.share; }\n"
        "    require fast < lim.b.kp * 10;",
    )
    sweep = """\
sweep two of fall {
    vary links.boom.mass = [bodies.boom.mass, bodies.stick.mass, 1 kg];
    exclude when links.boom.mass > bodies.stick.mass;
}
"""
    found = experiment(folder, TABLES, ARM, run, sweep, select=["two"])
    (coordinate,) = found.cases.coordinates
    assert found.cases.count == 2 and list(coordinate.values) == [7.1, 1.0]
    assert found.requirements[0].limit == 2.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("entry", "whole"),
    [
        (
            "let z = bodies;",
            """\
error[D381]: `bodies` is a table, and a value is needed here
 --> deck.ic:3:9
  |
3 | let z = bodies;
  |         ^^^^^^
  = help: a value of it is `bodies.boom.mass`
  = help: rows: boom, stick, spare
""",
        ),
        (
            "let z = lim.a;",
            """\
error[D381]: `lim.a` is a row of a table, and a value is needed here
 --> deck.ic:3:9
  |
3 | let z = lim.a;
  |         ^^^^^
  = help: a value of it is `lim.a.qd_max`
  = help: columns: qd_max, q_max, kp
""",
        ),
        (
            'let z = 2 * csv("bodies.csv");',
            """\
error[D381]: `csv(...)` is a table of values, and no value
 --> deck.ic:3:13
  |
3 | let z = 2 * csv("bodies.csv");
  |             ^^^
  = help: write `let NAME = csv("FILE.csv");`
  = help: a value of it is `NAME.ROW.COLUMN`
""",
        ),
        (
            "let z = csv(bodies);",
            """\
error[D381]: a table by row name is made of the name of a file
 --> deck.ic:3:9
  |
3 | let z = csv(bodies);
  |         ^^^^^^^^^^^
  = help: write `let NAME = csv("FILE.csv");`
""",
        ),
        (
            "let z = bodies.bom.mass;",
            """\
error[D382]: `bodies.csv` has no row `bom`
 --> deck.ic:3:16
  |
3 | let z = bodies.bom.mass;
  |                ^^^
  = help: did you mean `boom`?
  = help: rows: boom, stick, spare
""",
        ),
        (
            "let z = lim.a.kq;",
            """\
error[D192]: `joints.csv` has no column `kq`
 --> deck.ic:3:15
  |
3 | let z = lim.a.kq;
  |               ^^
 ::: joints.csv:1:1  its first line
  = help: columns: joint, qd_max, q_max, kp
""",
        ),
        (
            "let z = lim.b.q_max;",
            """\
error[D383]: row `b` has no value here
 --> joints.csv:3:9
  |
3 | b, 90.5, , 0.2
  |         ^
 ::: deck.ic:3:9  `lim.b.q_max`
 ::: joints.csv:1:24  column `q_max`
  = help: fill it in, or leave the entry that asks for it out
""",
        ),
        (
            "let z = bodies.boom.by;",
            """\
error[D194]: `drawing` is not a number
 --> bodies.csv:3:112
  |
3 | boom,  12.5,      0.4,       0,         0,         10,                 700,                700,                drawing
  |                                                                                                                ^^^^^^^
 ::: bodies.csv:2:112  column `by`
  = help: a number is written as 12.5 or -1e-3, with a point and without a unit
""",
        ),
        (
            "arm other like crane { a { qd_max = lim.a.kp; } } default run z like fall { arm = other; }",
            """\
error[D060]: `qd_max` of joint `a` is in rad/s, and this is a bare number
 --> deck.ic:3:37
  |
3 | arm other like crane { a { qd_max = lim.a.kp; } } default run z like fall { arm = other; }
  |                                     ^^^^^^^^
 ::: joints.csv:2:14  `lim.a.kp` is read here
  = help: write the unit in square brackets behind the column's name: `[rad/s]`
""",
        ),
        (
            "arm other like crane { boom { mass = -bodies.boom.mass; } } default run z like fall { arm = other; }",
            """\
error[D077]: `mass` of link `boom` must be at least 0 kg
 --> deck.ic:3:38
  |
3 | arm other like crane { boom { mass = -bodies.boom.mass; } } default run z like fall { arm = other; }
  |                                      ^^^^^^^^^^^^^^^^^ this is -12.5 kg
  = help: write a number of at least 0 kg (mass of the link)
""",
        ),
    ],
)
def test_every_mistake_in_a_use_is_told_at_its_place(folder: Path, entry: str, whole: str) -> None:
    assert messages(check(folder, TABLES, entry + "\n", ARM, RUN)) == whole + "\n1 error\n"


@pytest.mark.parametrize(
    ("text", "whole"),
    [
        (
            "link, mass [kg]\nboom, 1\nboom, 2\n",
            """\
error[D382]: row `boom` is there twice
 --> it.csv:3:1
  |
3 | boom, 2
  | ^^^^
 ::: it.csv:2:1  first
 ::: deck.ic:1:14  read here
  = help: take one of the two out, or give it another name
""",
        ),
        (
            "link, mass [kg]\nupper boom, 1\n",
            """\
error[D382]: `upper boom` is no name of a row
 --> it.csv:2:1
  |
2 | upper boom, 1
  | ^^^^^^^^^^
 ::: deck.ic:1:14  read here
  = help: a name has letters, digits and `_`, and begins with no digit: `bodies.boom_2.mass` asks for one
""",
        ),
        (
            "mass [kg], length [m]\n1, 2\n",
            """\
error[D382]: column `mass` has a unit
 --> it.csv:1:1
  |
1 | mass [kg], length [m]
  | ^^^^^^^^^
 ::: deck.ic:1:14  read here
  = help: the first column names the rows: put one before this, such as `link`
""",
        ),
        (
            "link, mass [kg]\nboom, 1.5 kg\n",
            """\
error[D194]: `1.5 kg` is not a number
 --> it.csv:2:7
  |
2 | boom, 1.5 kg
  |       ^^^^^^
 ::: it.csv:1:7  column `mass`
  = help: a number is written as 12.5 or -1e-3, with a point and without a unit
""",
        ),
        (
            "link, mass [kgs]\nboom, 1\n",
            """\
error[D193]: `kgs` is not a unit
 --> it.csv:1:7
  |
1 | link, mass [kgs]
  |       ^^^^^^^^^^
  = help: did you mean `mass [kg]`?
""",
        ),
    ],
)
def test_every_mistake_in_a_file_is_told_at_its_row_and_column_once(tmp_path: Path, text: str, whole: str) -> None:
    (tmp_path / "it.csv").write_text(text, encoding="utf-8")
    deck = 'let it = csv("it.csv"); let one = it.boom.mass; let two = it.boom.mass * 2;\n'
    assert messages(check(tmp_path, deck)) == whole + "\n1 error\n"


def test_rows_that_nothing_uses_are_told_where_a_deck_asks_for_that(folder: Path) -> None:
    asking = TABLES.replace('csv("bodies.csv")', 'csv("bodies.csv", rows = all)')
    assert messages(check(folder, TABLES, ARM, RUN, select="all")) == ""
    assert messages(check(folder, asking, ARM, RUN, select=["fall"])) == ""
    assert (
        messages(check(folder, asking, ARM, RUN, select="all"))
        == """\
warning[D385]: nothing uses row `spare`
 --> bodies.csv:5:1
  |
5 | spare, ,          0.3,       0,         0.02,      9,                  400,                400,                -
  | ^^^^^
 ::: deck.ic:1:32  all are to be used
  = help: leave `rows = all` out, or use them

1 warning
"""
    )
    used = "run more like fall { with links.boom.mass = bodies.spare.com.x * (1 kg / (1 m)); }\n"
    assert messages(check(folder, asking, ARM, RUN, used, select="all")) == ""


def test_a_number_out_of_range_is_told_at_its_use_and_at_its_cell(folder: Path) -> None:
    (folder / "bodies.csv").write_text(BODIES.replace("7.1", "-7"), encoding="utf-8")
    found = messages(check(folder, TABLES, ARM, RUN))
    assert " ::: bodies.csv:4:8  `bodies.stick.mass` is read here\n" in found and found.endswith("1 error\n")


def test_a_word_that_names_a_servo_too_means_the_servo(folder: Path) -> None:
    servo = "servo lim { model = passive; damping = 2 N*m*s/rad; }\n"
    found = messages(check(folder, TABLES, servo, "let z = lim.damping;\n", ARM, RUN))
    assert "it hides the components of `let lim`: give one of the two another name" in found
    assert "no value" not in found


@pytest.mark.slow
def test_a_long_table_is_read_in_a_moment(tmp_path: Path) -> None:
    rows = "\n".join(f"row_{n}, {n}" for n in range(50_000))
    (tmp_path / "long.csv").write_text("row, mass [kg]\n" + rows, encoding="utf-8")
    deck = tmp_path / "deck.ic"
    deck.write_text('let long = csv("long.csv"); let one = long.row_49999.mass;' + RUN, encoding="utf-8")
    assert [each.code for each in ic.check(deck).diagnostics] == ["D041"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_random_decks_have_the_same_parameters_and_keys_with_their_values_in_a_table(seed: int, tmp_path: Path) -> None:
    written = random_deck(seed)
    tabled, rows = in_a_table(written, seed)
    assert ".mass;" in tabled or ".at;" in tabled
    (tmp_path / "bodies.csv").write_text(rows, encoding="utf-8")
    before, after = tmp_path / "before.ic", tmp_path / "after.ic"
    before.write_text(written, encoding="utf-8")
    after.write_text(tabled, encoding="utf-8")
    (one,), (other,) = (ic.compile(path, select="all").experiments for path in (before, after))
    assert {path: (each.value, each.unit) for path, each in one.parameters.items()} == {
        path: (each.value, each.unit) for path, each in other.parameters.items()
    }
    assert keys.structure_key(one.structure, keys.inputs(one)) == keys.structure_key(
        other.structure, keys.inputs(other)
    )
