"""Values that a deck lets others set: `param`, and `with PATH = VALUE;` in a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import ic
from ic.driver.compile import Select
from ic.driver.explain import explain, explanations_of
from met import cli
from met.messages.render import render
from met.plan import Experiment, keys
from tests.ic.small_decks import ARM, RUN, SERVO, changed

SWING = "#pragma once\nparam reach = 1 m;\n" + ARM.replace("length = 1 m", "length = reach") + SERVO + RUN


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("swing.ic").write_text(SWING, encoding="utf-8")


def compiled(text: str, select: Select = None, **options: object) -> tuple[Experiment, ...]:
    Path("deck.ic").write_text(text, encoding="utf-8")
    return ic.compile("deck.ic", select=select, **options).experiments  # type: ignore[arg-type]


def length(text: str, select: Select = None, **options: object) -> float:
    """The length of the bar, from its centre of mass, m."""
    return 2.0 * compiled(text, select, **options)[0].parameters["links.bar.com.x"].value  # type: ignore[operator]


def identity(each: Experiment) -> tuple[object, ...]:
    return keys.structure_key(each.structure, keys.inputs(each)), keys.case_ids(each)


def refused(text: str) -> str:
    Path("deck.ic").write_text(text, encoding="utf-8")
    found = ic.check("deck.ic")
    assert found.plan is None
    return render(found.diagnostics, found.sources)


# param


def test_a_param_is_a_let_until_it_is_set() -> None:
    (made,) = compiled(SWING)
    (plain,) = compiled(SWING.replace("param", "let"))
    assert identity(made) == identity(plain)


def test_an_including_deck_sets_it_before_the_include() -> None:
    assert length('param reach = 2 m;\n#include "swing.ic"\n') == 2.0


def test_the_outermost_deck_counts() -> None:
    Path("middle.ic").write_text('param reach = 2 m;\n#include "swing.ic"\n', encoding="utf-8")
    assert length('param reach = 3 m;\n#include "middle.ic"\n') == 3.0


@pytest.mark.slow
def test_what_sets_it_counts_in_this_order() -> None:
    text = 'param reach = 2 m;\n#include "swing.ic"\nrun far like hold { with reach = 3 m; }\n'
    text += "run farther like far { with reach = 4 m; }\nsweep them of farther { vary reach = [5, 6] m; }\n"
    assert [length(text, [run]) for run in ("hold", "far", "farther")] == [2.0, 3.0, 4.0]
    assert length(text, ["farther"], set=["reach=7 m"]) == 7.0
    (swept,) = compiled(text, ["them"])
    assert swept.cases.coordinates[0].values.tolist() == [5.0, 6.0]
    (varied,) = compiled(text, ["farther"], vary=["reach=[5, 6] m"])
    assert identity(varied)[1] == identity(swept)[1]


def test_explain_says_where_it_comes_from(capsys: pytest.CaptureFixture[str]) -> None:
    text = 'param reach = 2 m;\n#include "swing.ic"\nrun far like hold { with reach = 3 m; }\n'
    Path("deck.ic").write_text(text, encoding="utf-8")
    assert cli.main(["explain", "deck.ic", "reach", "--run", "far"]) == cli.YES
    assert (
        capsys.readouterr().out
        == """\
reach = 3 m
 --> deck.ic:3:34
  |
3 | run far like hold { with reach = 3 m; }
  |                                  ^^^ written here
 ::: deck.ic:1:7  overrides `reach = 2 m`
 ::: swing.ic:2:7  overrides `reach = 1 m`
"""
    )
    (found,) = explain("deck.ic", "links.bar.shape.length", select=["far"])
    assert [label.text for label in found.names] == ["reach = 3 m"]
    assert found.names[0].place.line == 3


@pytest.mark.parametrize(("text", "message"), [
    ('#include "swing.ic"\nparam reach = 2 m;\n', """\
error[D040]: param `reach` is written twice
 --> deck.ic:2:7
  |
2 | param reach = 2 m;
  |       ^^^^^ again
 ::: swing.ic:2:7  first
  = help: a deck sets a `param` of a file before it includes it: move this line up
"""),
    ('#include "swing.ic"\nlet reach = 2 m;\n', """\
error[D040]: let `reach` is written twice
 --> deck.ic:2:5
  |
2 | let reach = 2 m;
  |     ^^^^^ again
 ::: swing.ic:2:7  first
  = help: a deck sets a `param` of a file before it includes it: write `param reach = ...;` there
"""),
    ('let reach = 2 m;\n#include "swing.ic"\n', """\
error[D040]: param `reach` is written twice
 --> swing.ic:2:7
  |
2 | param reach = 1 m;
  |       ^^^^^ again
 ::: deck.ic:1:5  first
  = help: write `param reach` to set it
  = note: included from deck.ic:2
"""),
    ('param long = 1 m;\nparam long = 2 m;\n#include "swing.ic"\n', """\
error[D040]: param `long` is written twice
 --> deck.ic:2:7
  |
2 | param long = 2 m;
  |       ^^^^ again
 ::: deck.ic:1:7  first
  = help: remove one of the two
  = help: or give one of the two another name
"""),
    ('#include "swing.ic"\nrun far like hold { param reach = 2 m; }\n', """\
error[D051]: `param` stands inside a definition
 --> deck.ic:2:21
  |
2 | run far like hold { param reach = 2 m; }
  |                     ^^^^^^^^^^^
  = help: move it out: a `param` belongs to the whole deck
"""),
    ('#include "swing.ic"\nparam n = 2;\nrun a like hold { rates { dynamics = n * 1 kHz; } }\n'
     "sweep it of a { vary n = [1, 2]; }\n", """\
error[D122]: `dynamics` of `rates` varies with the sweep
 --> deck.ic:3:38
  |
3 | run a like hold { rates { dynamics = n * 1 kHz; } }
  |                                      ^^^^^^^^^
  = help: it decides the program: vary `rates.dynamics` itself
"""),
])  # fmt: skip
def test_what_cannot_be_is_refused(text: str, message: str) -> None:
    assert refused(text) == f"{message}\n1 error\n"


def test_another_dimension_than_that_of_its_file_is_refused() -> None:
    assert refused('param reach = 2 s;\n#include "swing.ic"\n').startswith(
        """\
error[D061]: `reach` is in m, and this is in s
 --> deck.ic:1:15
  |
1 | param reach = 2 s;
  |               ^^^
 ::: swing.ic:2:7  defined here
  = help: write it in m, km, cm, mm, um, inch or ft
"""
    )


def test_two_files_that_do_not_include_each_other_do_not_set_each_others() -> None:
    Path("other.ic").write_text("param reach = 3 m;\n", encoding="utf-8")
    assert "error[D040]: param `reach` is written twice" in refused('#include "other.ic"\n#include "swing.ic"\n')


# with


@pytest.mark.slow
@pytest.mark.parametrize(("entry", "old", "new"), [
    ("drive.kp = 0.2 V*s/rad", "kp = 0.1", "kp = 0.2"),
    ("hinge.servo.kp = 0.2 V*s/rad", "hinge = drive;", "hinge = drive { kp = 0.2 V*s/rad; };"),
    ("links.bar.mass = 3 kg", "mass = 2 kg", "mass = 3 kg"),
    ("hinge.axis.x = 2", "axis = z", "axis = [2, 0, 1]"),
    ("initial.hinge.q = 10 deg", "duration", "initial { q = 10 deg; } duration"),
    ("hinge.servo.command = rate(ramp(to = 1 rad/s, over = 1 s))", "hinge = drive;",
     "hinge = drive { command = rate(ramp(to = 1 rad/s, over = 1 s)); };"),
    ("rates.dynamics = 2 kHz", "dynamics = 1 kHz", "dynamics = 2 kHz"),
    ("reach = 2 m", "param reach = 1 m", "param reach = 2 m"),
])  # fmt: skip
def test_a_run_sets_what_vary_and_set_name(entry: str, old: str, new: str) -> None:
    text = f'#include "swing.ic"\nrun other like hold {{ with {entry}; }}\n'
    (made,) = compiled(text, ["other"])
    (edited,) = compiled(changed(SWING, (old, new)), ["hold"])
    assert identity(made) == identity(edited)
    assert identity(made) == identity(compiled(SWING, ["hold"], set=[entry.replace(" = ", "=", 1)])[0])
    assert identity(compiled(text, ["hold"])[0]) == identity(compiled(SWING)[0])


@pytest.mark.parametrize("word", ["rk4", "midpoint"])
def test_what_no_run_writes_otherwise_may_be_set(word: str) -> None:
    text = f'#include "swing.ic"\nrun other like hold {{ with integrator = {word}; }}\n'
    assert compiled(text, ["other"])[0].structure.integrator == word
    text += (
        "run again like other { with integrator = semi_implicit_euler; }\nrun plain like again { remove integrator; }\n"
    )
    assert compiled(text, ["again"])[0].structure.integrator == "semi_implicit_euler"
    assert compiled(text, ["plain"])[0].structure.integrator == "modified_euler"


def test_a_metric_may_be_called_as_what_is_set() -> None:
    text = '#include "swing.ic"\nrun far like hold { with reach = 2 m; metric reach = final { of = hinge.q; } }\n'
    text += "run later like far { reach { of = hinge.qd; } }\n"
    (made,) = compiled(text, ["later"])
    assert [each.of for each in made.structure.metrics] == ["hinge.qd"]
    assert length(text, ["later"]) == 2.0


def test_remove_takes_away_what_is_set_before_what_is_written() -> None:
    text = '#include "swing.ic"\nrun far like hold { with duration = 2 s; }\nrun near like far { remove duration; }\n'
    far, near = (identity(compiled(text, [run])[0]) for run in ("far", "near"))
    assert far != near == identity(compiled(text, ["hold"])[0])


IN_VAIN = [
    ("duration = 3 s; with duration = 2 s;", """\
error[D232]: this counts for nothing: `with` sets `duration`
 --> deck.ic:2:20
  |
2 | run it like hold { duration = 3 s; with duration = 2 s; }
  |                    ^^^^^^^^
 ::: deck.ic:2:36  set here
  = help: leave one of the two out
"""),
    ("with hinge.servo.kp = 2 V*s/rad; } run them like it { servos { hinge { kp = 3 V*s/rad; } }", """\
error[D232]: this counts for nothing: `with` sets `hinge.servo.kp`
 --> deck.ic:2:96
  |
2 | run it like hold { with hinge.servo.kp = 2 V*s/rad; } run them like it { servos { hinge { kp = 3 V*s/rad; } } }
  |                                                                                                ^^^^^^^^^
 ::: deck.ic:2:20  set here
  = help: write `with hinge.servo.kp = ...;` here, or leave it out
"""),
    ("initial { hinge.q = 1 deg; } with initial.hinge.q = 2 deg;", """\
error[D232]: this counts for nothing: `with` sets `initial.hinge.q`
 --> deck.ic:2:40
  |
2 | run it like hold { initial { hinge.q = 1 deg; } with initial.hinge.q = 2 deg; }
  |                                        ^^^^^
 ::: deck.ic:2:49  set here
  = help: leave one of the two out
"""),
    ("for i in 1 .. 2 { with links.bar.mass = i * 1 kg; }", """\
error[D040]: with `links.bar.mass` is written twice
 --> deck.ic:2:38
  |
2 | run it like hold { for i in 1 .. 2 { with links.bar.mass = i * 1 kg; } }
  |                                      ^^^^^^^^^^^^^^^^^^^ again
 ::: deck.ic:2:38  first
  = help: each iteration writes it: put the index into the path, `{i}`, or write it outside of the loop
  = note: in `for i` at deck.ic:2:20, i = 2
"""),
    ("with reach = 2 s;", """\
error[D061]: `reach` is in m, and this is in s
 --> deck.ic:2:33
  |
2 | run it like hold { with reach = 2 s; }
  |                                 ^^^
 ::: swing.ic:2:7  defined here
  = help: write it in m, km, cm, mm, um, inch or ft
"""),
    ("with links.bar.mass = 3 kg; } run them like it { links.bar.mass += 4 kg;", """\
error[D056]: nothing is in `links.bar.mass` yet to append to
 --> deck.ic:2:69
  |
2 | run it like hold { with links.bar.mass = 3 kg; } run them like it { links.bar.mass += 4 kg; }
  |                                                                     ^^^^^^^^^^^^^^
  = help: write `with links.bar.mass = ...;`
"""),
]  # fmt: skip


@pytest.mark.parametrize(("entries", "message"), IN_VAIN)
def test_what_a_run_writes_in_vain_is_refused(entries: str, message: str) -> None:
    assert refused(f'#include "swing.ic"\nrun it like hold {{ {entries} }}\n') == f"{message}\n1 error\n"


def test_a_sweep_is_told_of_what_its_run_writes_in_vain() -> None:
    text = '#include "swing.ic"\nrun it like hold { duration = 3 s; with duration = 2 s; }\n'
    Path("deck.ic").write_text(f"{text}sweep them of it {{ vary reach = [1, 2] m; }}\n", encoding="utf-8")
    found = ic.check("deck.ic", select=["them"])
    assert [each.code for each in found.diagnostics] == ["D232"]


def test_a_general_entry_may_stand_beside_what_is_set_of_one() -> None:
    two = ARM.replace("}\n}", "}\n link b { mass = 1 kg; shape = rod(length = 1 m, along = x); }\n"
                      " joint second revolute { parent = bar; child = b; axis = z; }\n}")  # fmt: skip
    text = two + SERVO + RUN.replace("hinge = drive;", "* = drive;")
    text += "run it like hold { initial { q = 1 rad; } with initial.hinge.q = 2 rad; }\n"
    (made,) = compiled(text, ["it"])
    assert [made.parameters[f"initial.{joint}.q"].value for joint in ("hinge", "second")] == [2.0, 1.0]


def test_a_sweep_of_the_run_has_it_and_varies_it() -> None:
    text = '#include "swing.ic"\nrun heavy like hold { with links.bar.mass = 3 kg; with drive.kp = 0.2 V*s/rad; }\n'
    (swept,) = compiled(f"{text}sweep it of heavy {{ vary links.bar.mass = [4, 5] kg; }}\n", ["it"])
    edited = changed(SWING, ("kp = 0.1", "kp = 0.2"))
    (other,) = compiled(f"{edited}sweep it of hold {{ vary links.bar.mass = [4, 5] kg; }}\n", ["it"])
    assert identity(swept) == identity(other)
    places = swept.parameters["links.bar.mass"].origin.overrides
    assert [place.file.rpartition("/")[2] for place in places] == ["deck.ic", "swing.ic"]


def test_what_was_replaced_is_listed_latest_first() -> None:
    text = '#include "swing.ic"\nrun far like hold { with reach = 2 m; with links.bar.mass = 3 kg; }\n'
    text += "run farther like far { with reach = 3 m; with links.bar.mass = 4 kg; }\n"
    Path("deck.ic").write_text(text, encoding="utf-8")

    def replaced(path: str, **options: Any) -> list[tuple[str, int]]:
        made = ic.check("deck.ic", select=["farther"], **options)
        (found,) = explanations_of(made, path)
        return [(place.file.rpartition("/")[2], place.line) for place in found.overrode]

    for path, key, unit in (("reach", "reach =", "m"), ("links.bar.mass", "mass =", "kg")):
        swing = next(n for n, line in enumerate(SWING.split("\n"), 1) if key in line)
        assert replaced(path) == [("deck.ic", 2), ("swing.ic", swing)]
        assert replaced(path, set={path: f"9 {unit}"}) == [("deck.ic", 3), ("deck.ic", 2), ("swing.ic", swing)]


def test_it_may_be_taken_away_again() -> None:
    text = '#include "swing.ic"\nrun far like hold { with reach = 2 m; }\nrun near like far { remove reach; }\n'
    assert length(text, ["near"]) == 1.0


@pytest.mark.parametrize(("entries", "message"), [
    ("with links.bar.mas = 3 kg;", """\
error[D234]: nothing in `it` is called `links.bar.mas`
 --> deck.ic:2:20
  |
2 | run it like hold { with links.bar.mas = 3 kg; }
  |                    ^^^^^^^^^^^^^^^^^^
  = help: did you mean `links.bar.mass`?
"""),
    ("with links.bar.com = [1, 0, 0] m;", """\
error[D235]: `links.bar.com` cannot be set
 --> deck.ic:2:20
  |
2 | run it like hold { with links.bar.com = [1, 0, 0] m; }
  |                    ^^^^^^^^^^^^^^^^^^
  = help: it is made of 3 numbers; set one of them: `links.bar.com.x`, `links.bar.com.y`, `links.bar.com.z`
"""),
    ("with links.bar.mass = 3 m;", """\
error[D061]: `mass` of link `bar` is in kg, and this is in m
 --> deck.ic:2:42
  |
2 | run it like hold { with links.bar.mass = 3 m; }
  |                                          ^^^
  = help: write it in kg, g, t or mg
"""),
    ("with links.bar.mass = 3 kg; with swing.links.bar.mass = 2 kg;", """\
error[D232]: this sets `links.bar.mass`, which is set already
 --> deck.ic:2:76
  |
2 | run it like hold { with links.bar.mass = 3 kg; with swing.links.bar.mass = 2 kg; }
  |                                                                            ^^^^
 ::: deck.ic:2:42  here
  = help: leave one of the two out
"""),
    ("with drive { kp = 1 V*s/rad; }", """\
error[D108]: `with` sets one path to one value
 --> deck.ic:2:20
  |
2 | run it like hold { with drive { kp = 1 V*s/rad; } }
  |                    ^^^^^^^^^^
  = help: write `with PATH = VALUE;`, such as `with links.boom.mass = 7 kg;`
"""),
])  # fmt: skip
def test_what_a_run_cannot_set_is_refused(entries: str, message: str) -> None:
    assert refused(f'#include "swing.ic"\nrun it like hold {{ {entries} }}\n') == f"{message}\n1 error\n"


def test_what_changes_nothing_is_refused() -> None:
    text = '#include "swing.ic"\nlet idle = 1 m;\nrun it like hold { with idle = 2 m; }\n'
    assert refused(text) == (
        """\
error[D236]: `idle` changes nothing in `it`
 --> deck.ic:3:20
  |
3 | run it like hold { with idle = 2 m; }
  |                    ^^^^^^^^^
 ::: deck.ic:2:5  defined here
  = help: nothing that is computed depends on it: leave it out, or name a run that uses it

1 error
"""
    )
