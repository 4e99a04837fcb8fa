"""`use <panda.ic> as panda;`: definitions of another deck under a roof."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import ic
from ic.driver.compile import Compiled
from ic.driver.explain import explanations_of
from met.plan import Experiment
from met.plan.file import dumps, loads
from met.plan.keys import case_ids, case_keys, inputs, structure_key
from tests.ic.small_decks import messages

PART = """\
#pragma once
#ifdef LEAKED
#error a macro of the deck that uses this one is known here
#endif
#define HEAVY 3
param reach = 0.8 m;
let bar   = 2 kg;                     // as the link is called
let slow  = 0.2 rad/s;
let place = [reach, 0 m, 0.1 m];
let spans = [0.3 m, reach];
arm swing {
    link bar { mass = bar;  shape = rod(length = reach, along = x); }
    link tip { mass = HEAVY * 1 kg;  shape = rod(length = spans[1], along = z); }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
    joint wrist revolute { parent = bar;  child = tip;  axis = y;  at = [place.x, place.y, place.z]; }
}
servo drive {
    model = rigid_gearbox;  ratio = 100;  kp = 0.1 V*s/rad;  ki = 1 V/rad;  v_max = 24 V;  resistance = 1 ohm;
    kt = 0.05 N*m/A;  tau_max = 1 N*m;  j_m = 1e-4 kg*m^2;  command = rate(slow);
}
servo fast like drive { kp = drive.kp * 2;  command = rate(step(to = slow, at = 0.1 s)); }
servo guided like drive { k_position = 10 1/s;  command = position(pen); }
"""
OWN = """\
default run own {
    arm = swing;  servos { hinge = drive;  wrist = fast; }
    rates { dynamics = 1 kHz;  servos = 500 Hz;  record = 100 Hz; }  duration = 1 s;  record = [q];
}
sweep reaches of own { vary reach = [0.8, 1] m; }
"""
RUN = """\
run hold {
    arm = ROOF.swing;
    servos { hinge = ROOF.drive;  wrist = ROOF.fast { ki = ROOF.drive.ki * 2; } }
    rates { dynamics = 1 kHz;  servos = 500 Hz;  record = 100 Hz; }
    duration = 1 s;
    record = [q, hinge.servo.voltage];
    metric top = max { of = hinge.qd; }
    require top < ROOF.slow * 2;
}
run guided like hold {
    guide pen = together { max_rate = 1 rad/s;  max_acceleration = 2 rad/s^2;  hinge.to = 1 rad; }
    servos { hinge = ROOF.guided; }
}
run longer like hold { with ROOF.reach = 1 m;  with ROOF.drive.kp = 0.2 V*s/rad; }
arm heavier like ROOF.swing { bar { mass = ROOF.bar * 2; } }
run heavy like hold { arm = heavier; }
sweep some of hold {
    vary ROOF.drive.ki = [1, 2] V/rad;
    vary ROOF.reach = [0.5, 1] m;
    exclude when ROOF.reach > 0.7 m and ROOF.drive.ki > 1.5 V/rad;
}
sweep servos of hold { vary wrist.servo = [ROOF.drive, ROOF.fast]; }
"""
USE = 'use "part.ic" as part;\n'
HOLD = RUN[: RUN.index("run guided")].replace("ROOF", "part")


def compiled(folder: Path, text: str, *, part: str = PART + OWN, **options: object) -> Compiled:
    """The deck of this text beside `part.ic`."""
    (folder / "part.ic").write_text(part, encoding="utf-8")
    (folder / "deck.ic").write_text(text, encoding="utf-8")
    return ic.check(folder / "deck.ic", **{"select": "all", **options})  # type: ignore[arg-type]


def experiments(found: Compiled) -> dict[str, Experiment]:
    assert found.plan is not None, messages(found)
    return {each.name: each for each in found.plan.experiments}


def numbers(experiment: Experiment) -> dict[str, object]:
    return {path: each.value for path, each in experiment.parameters.items()}


@pytest.mark.slow
def test_an_arm_that_is_used_is_the_one_that_is_included(tmp_path: Path) -> None:
    used = experiments(compiled(tmp_path, USE + RUN.replace("ROOF", "part")))
    included = experiments(compiled(tmp_path, '#include "part.ic"\n' + RUN.replace("ROOF.", ""), part=PART))
    assert list(used) == [name.replace("drive", "part_drive").replace("fast", "part_fast") for name in included]
    for one, other in zip(used.values(), included.values(), strict=True):
        assert structure_key(one.structure) == structure_key(other.structure)
        assert numbers(one) == numbers(other)
        assert case_keys(one) == case_keys(other) or one.cases.coordinates or one.cases.choices
        plain = [each.path.removeprefix("part.") for each in one.cases.coordinates]
        assert plain == [each.path for each in other.cases.coordinates]
        table = [each.values.tolist() for each in one.cases.coordinates]
        assert table == [each.values.tolist() for each in other.cases.coordinates]
        assert one.formulas.nodes == other.formulas.nodes or one.cases.coordinates
    for name in ("hold", "guided", "longer", "heavy"):
        one, other = used[name], included[name]
        assert structure_key(one.structure, inputs(one)) == structure_key(other.structure, inputs(other))
        assert case_ids(one) == case_ids(other)


@pytest.mark.slow
@pytest.mark.parametrize(
    "deck", ["panda", "two_link", "puma_560", "shuttle_arm", "stanford_arm", "manutec_r3", "ets_vii"]
)
def test_a_librarys_arm_is_the_same_used_and_included(deck: str, tmp_path: Path) -> None:
    run = "run fall {{ arm = {}{}; rates {{ dynamics = 1 kHz; }} duration = 0.1 s; record = [q]; }}\n"
    used = experiments(compiled(tmp_path, f"use <{deck}.ic> as other;\n" + run.format("other.", deck)))
    included = experiments(compiled(tmp_path, f"#include <{deck}.ic>\n" + run.format("", deck), select=["fall"]))
    one, other = used["fall"], included["fall"]
    assert list(used) == ["fall"]
    assert structure_key(one.structure, inputs(one)) == structure_key(other.structure, inputs(other))
    assert numbers(one) == numbers(other)


def test_one_file_under_two_roofs_is_two_sets_of_definitions_beside_the_decks_own(tmp_path: Path) -> None:
    text = f"""{USE}use "part.ic" as other;
let reach = 7 m;  let slow = 3 m;  servo drive {{ model = passive; }}
{HOLD.replace("part.fast", "other.fast")}
run longer like hold {{ with other.drive.kp = 0.5 V*s/rad;  with part.reach = 1 m; }}
"""
    found = experiments(compiled(tmp_path, text))
    assert found["hold"].parameters["links.bar.com.x"].value == 0.4
    assert found["hold"].parameters["hinge.servo.kp"].value == 0.1
    longer = found["longer"].parameters
    assert [longer[f"{joint}.servo.kp"].value for joint in ("hinge", "wrist")] == [0.1, 1.0]
    assert longer["links.bar.com.x"].value == 0.5
    assert longer["links.tip.com.z"].value == 0.5  # through `spans`


def test_a_name_in_a_used_deck_is_never_that_of_the_deck_that_uses_it(tmp_path: Path) -> None:
    part = PART.replace("let slow  = 0.2 rad/s;", "")
    hold = HOLD.replace("require top < part.slow * 2;", "")
    found = compiled(tmp_path, f"{USE}let slow = 0.2 rad/s;\n{hold}", part=part)
    assert {each.code for each in found.diagnostics} == {"D065"}
    assert found.diagnostics[0].help == (
        "define it there: `let slow = ...;`",
        "`slow` of the deck that uses this one is not known here: `with part.NAME = ...;` sets a value",
    )


def test_macros_go_neither_in_nor_out(tmp_path: Path) -> None:
    text = f"#define LEAKED\n{USE}#ifdef HEAVY\n#error known here\n#endif\n{HOLD}"
    assert experiments(compiled(tmp_path, text))
    found = compiled(tmp_path, USE + HOLD, defines=["LEAKED"])
    assert [each.code for each in found.diagnostics] == ["D037"]  # nothing in the deck itself asks for it


def test_runs_and_sweeps_stay_away(tmp_path: Path) -> None:
    assert list(experiments(compiled(tmp_path, USE + HOLD))) == ["hold"]
    text = f"{USE}run hold like part.own {{ }}\nsweep two of part.own {{ vary part.reach = [1, 2] m; }}\n"
    for each in compiled(tmp_path, text).diagnostics:
        assert each.code == "D041"
        assert each.help[0] == (
            "`own` is a run of the deck that is used, and its runs and sweeps stay away: write one of your own, or "
            "include `part.ic`"
        )


@pytest.mark.slow
def test_a_value_is_set_by_a_run_a_sweep_and_the_command_line(tmp_path: Path) -> None:
    text = USE + HOLD + "run far like hold { with part.reach = 1 m; }\n"
    far = experiments(compiled(tmp_path, text, set=["part.reach=1.2 m"]))["far"]
    assert far.parameters["links.bar.com.x"].value == 0.6
    found = compiled(tmp_path, text, set=["part.reach=1.2 m"])
    told = next(explanations_of(found, "part.reach"))
    assert told.value == 1.2
    varied = experiments(compiled(tmp_path, text, select=["far"], vary=["part.drive.kp=[0.1, 0.2] V*s/rad"]))
    (coordinate,) = varied["far_varied"].cases.coordinates
    assert coordinate.path == "part.drive.kp"
    assert coordinate.sets == ("hinge.servo.kp",)


def test_each_file_has_its_edition_and_its_units(tmp_path: Path) -> None:
    part = "deck 2;\nunit stone = 6.35 kg;\nlet h = 2 stone;\n" + PART.replace("mass = bar;", "mass = h;").replace(
        "#pragma once\n", ""
    )
    found = experiments(compiled(tmp_path, USE + HOLD + "let wait = 1 h;\n", part=part))
    assert found["hold"].parameters["links.bar.mass"].value == pytest.approx(12.7)
    refused = compiled(tmp_path, USE + HOLD + "let heavy = 1 stone;\n", part=part)
    assert refused.plan is None


def test_used_decks_use_others(tmp_path: Path) -> None:
    (tmp_path / "cell.ic").write_text(
        'use "part.ic" as left;\nlet twice = left.reach * 2;\narm swing like left.swing { bar { mass = left.bar; } }\n'
        "servo drive like left.drive { kp = left.drive.kp * 3; }\nservo fast like drive { }\nlet slow = left.slow;\n"
    )
    text = (
        'use "cell.ic" as cell;\n'
        + HOLD.replace("part.", "cell.")
        + ("sweep two of hold { vary cell.left.drive.kp = [0.1, 0.2] V*s/rad; vary cell.left.reach = [1, 2] m; }\n")
    )
    found = experiments(compiled(tmp_path, text))
    assert found["hold"].parameters["hinge.servo.kp"].value == pytest.approx(0.3)
    assert [each.path for each in found["two"].cases.coordinates] == ["cell.left.drive.kp", "cell.left.reach"]


def test_a_table_of_a_used_deck_is_found_beside_it(tmp_path: Path) -> None:
    (tmp_path / "bodies.csv").write_text("link, mass [kg]\nbar, 3\ntip, 4\n")
    part = PART.replace("let bar   = 2 kg;", 'let bodies = csv("bodies.csv", rows = all);').replace(
        "mass = bar;", "mass = bodies.bar.mass;"
    )
    text = USE + HOLD + "run other like hold { with links.tip.mass = part.bodies.tip.mass * 2; }\n"
    found = compiled(tmp_path, text, part=part)
    assert not found.diagnostics, messages(found)
    plan = experiments(found)
    assert plan["hold"].parameters["links.bar.mass"].value == 3.0
    assert plan["other"].parameters["links.tip.mass"].value == 8.0


def test_a_plan_keeps_how_a_place_was_led_to(tmp_path: Path) -> None:
    found = compiled(tmp_path, USE + HOLD)
    assert found.plan is not None
    place = found.plan.experiments[0].parameters["hinge.servo.ki"].origin.place
    assert place is not None
    assert [word for _, _, word in place.came_by] == ["used at"]
    text = dumps(found.plan)
    assert dumps(loads(text)) == text


BOTH = 'use "part.ic" as part;  use "part.ic" as other;\n'


@pytest.mark.slow
@pytest.mark.parametrize("text, code, message", [
    ("use <pandda.ic> as p;", "D005", "cannot find <pandda.ic>"),
    ('use "part.ic";', "D395", "expected `as`, found `;`"),
    ('use "part.ic" as 3;', "D395", "expected a name for the roof, found `3`"),
    ("use part.ic as part;", "D395", "expected a file, found `part`"),
    ("use <part.ic as part;", "D395", "`use <` without its `>`"),
    ('use " " as part;', "D395", "`use` needs a file, and this name is empty"),
    ('run r { use "part.ic" as part; }', "D395", "a deck is used outside of blocks and loops"),
    ('for i in 1 .. 2 { use "part.ic" as part; }', "D395", "a deck is used outside of blocks and loops"),
    (f'{USE}use <panda.ic> as part;', "D396", "there is a roof `part` already"),
    ('use "part.ic" as m;', "D396", "`m` is the unit metre, so no roof may be called so"),
    ('use "part.ic" as links;', "D396", "`links` begins paths of its own, so no roof may be called so"),
    (f"{USE}let part = 3;", "D396", "`part` is defined in this deck, so no roof may be called so"),
    ('use "deck.ic" as part;', "D397", "a deck that uses itself: `deck.ic` uses `deck.ic`"),
    (USE + HOLD.replace("part.drive;", "part.driv;"), "D041", "no servo `part.driv`"),
    (USE + HOLD.replace("part.swing", "prt.swing"), "D041", "no arm `prt.swing`"),
    (USE + HOLD.replace("part.slow", "part.slw"), "D065", "no value `part.slw`"),
    (USE + "let x = part.reech;\n" + HOLD, "D065", "no value `part.reech`"),
    (USE + HOLD + "run z like hold { with part.reech = 1 m; }", "D234", "nothing in `z` is called `part.reech`"),
    (USE + HOLD + "run z like hold { with part.reach = 1 kg; }", "D061", "`part.reach` is in m, and this is in kg"),
    (USE + HOLD + "sweep z of hold { vary part.reech = [1, 2] m; }", "D128", "no parameter `part.reech` in this run"),
    (USE + HOLD + "sweep z = hold + part.own;", "D041", "no run or sweep `part.own`"),
    (USE + "param part.reach = 1 m;\n" + HOLD, "D020", "`param` gives a value to one name, without points"),
    ('use "part.ic" as hinge;\n' + HOLD.replace("part.", "hinge."), "D166",
     "`hinge` begins paths of its own, so no joint may be called so"),
])  # fmt: skip
def test_what_cannot_be_is_told(text: str, code: str, message: str, tmp_path: Path) -> None:
    found = compiled(tmp_path, text)
    told = [each for each in found.diagnostics if each.severity == "error"]
    said = {(each.code, re.sub(r"`[^` ]*/", "`", each.message)) for each in told}
    assert (code, message) in said, messages(found)
    assert all(each.help for each in told)
    assert all(each.at is not None for each in told)


def test_a_mistake_of_a_file_under_several_roofs_is_told_once(tmp_path: Path) -> None:
    part = PART.replace("length = reach", "lenght = reach").replace(
        "servo fast like drive { kp", "servo fast like drive { kpp"
    )
    uses = [f'use "part.ic" as roof_{n};\n' for n in range(6)]
    found = compiled(tmp_path, "".join(uses) + HOLD.replace("part.", "roof_0."), part=part)
    once = compiled(tmp_path, uses[0] + HOLD.replace("part.", "roof_0."), part=part)
    assert len(found.diagnostics) == len(once.diagnostics) == 2
    for one, other in zip(found.diagnostics, once.diagnostics, strict=True):
        assert one.at is not None and other.at is not None and one.message == other.message
        said = [(Path(each.place.file).name, each.place.line, each.text) for each in one.also[len(other.also) :]]
        assert said == [
            ("deck.ic", 2, "likewise where it is used here"),
            ("deck.ic", 3, "likewise where it is used here"),
            ("deck.ic", 4, "likewise where it is used here"),
            ("deck.ic", 5, "likewise where it is used here, and in 1 more"),
        ]


def test_a_mistake_in_a_used_deck_is_placed_there_with_the_line_that_uses_it(tmp_path: Path) -> None:
    found = compiled(tmp_path, f"\n{USE}{HOLD}", part=PART.replace("like drive { kp", "like driv { kp"))
    assert messages(found).startswith("""\
error[D041]: no servo `driv`
  --> part.ic:21:17
   |
21 | servo fast like driv { kp = drive.kp * 2;  command = rate(step(to = slow, at = 0.1 s)); }
   |                 ^^^^
   = help: did you mean `drive`?
   = help: servos of this deck: drive, fast, guided
   = note: used at deck.ic:2
""")
