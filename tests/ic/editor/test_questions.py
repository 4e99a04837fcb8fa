"""Answers about a position in a deck: what may stand there, what stands there, where it comes from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from ic.find import library_files
from ic.language import BLOCKS, DEFINITIONS, TOP_LEVEL
from ic.printing.models import summary
from ic.text.files import LIBRARY
from met import models
from met.units import UNITS
from tests.ic.editor.client import Editor, uri

ARM = """#include <servos/rigid_gearbox.ic>
#include "lengths.ic"
#define ROD(NAME, MASS) link NAME { mass = MASS; shape = rod(length = reach, along = x); }

arm two {
    ROD(upper, 40 kg)
    ROD(lower, 20 kg)
    joint shoulder revolute { parent = base;   child = upper;  axis = z; }
    joint elbow    revolute { parent = upper;  child = lower;  axis = z;  at = [reach, 0 m, 0 m]; }
}
servo gearbox like rigid_gearbox { kp = 0.03 V*s/rad;  command = rate(slow); }
let slow = 3 deg/s;
default run nominal {
    arm         = two;
    servos      { shoulder = gearbox;  elbow = gearbox; }
    initial     { q = 0 rad; }
    environment { velocity_products = off; }
    rates       { dynamics = 25 Hz;  servos = 100 Hz;  record = 25 Hz; }
    duration    = 20 s;
    record      = [q, shoulder.servo.voltage];
    allow D105 because "slow rates";
}
sweep gains of nominal { vary gearbox.kp = [0.02, 0.03] V*s/rad; }
"""
LENGTHS = "let reach = 2 m;\n"


def at(text: str, mark: str, n: int = 0) -> tuple[int, int]:
    """The line and column of a mark in a text."""
    where = -1
    for _ in range(n + 1):
        where = text.index(mark, where + 1)
    return text.count("\n", 0, where), where - (text.rfind("\n", 0, where) + 1)


@pytest.fixture
def deck(tmp_path: Path, editor: Editor) -> Path:
    """A deck that is open, and whose values are known."""
    (tmp_path / "lengths.ic").write_text(LENGTHS)
    path = tmp_path / "arm.ic"
    path.write_text(ARM)
    editor.open(path)
    assert editor.of(path) == []
    return path


def words(editor: Editor, deck: Path, text: str) -> list[str]:
    """The words that may stand at the `|` of a text."""
    line, column = at(text, "|")
    editor.change(deck, text.replace("|", ""))
    found: list[Any] = editor.about("textDocument/completion", deck, line, column)
    return [each["label"] for each in found]


def test_an_entry_of_a_block_begins_with_what_the_language_declares_for_it(editor: Editor, deck: Path) -> None:
    for written, kind in (
        ("run more like nominal { | }", "run"),
        ("arm other { link a { | } }", "link"),
        ("arm other { link a boom { | } }", "boom"),
    ):
        found = words(editor, deck, ARM + written)
        assert found[: len(BLOCKS[kind].entries)] == [entry.name for entry in BLOCKS[kind].entries]
    found = words(editor, deck, ARM + "run more like nominal { rates { dy|")
    assert found[:4] == ["dynamics", "servos", "record", "base"]
    assert words(editor, deck, ARM + "|")[: len(DEFINITIONS)] == list(DEFINITIONS)


def test_a_servo_has_the_parameters_of_its_model_through_what_it_is_like(editor: Editor, deck: Path) -> None:
    declared = [each.name for each in models.written(models.find("servo", "rigid_gearbox"))]
    found = words(editor, deck, ARM + "servo further like gearbox { | }")
    assert [name for name in found if name in declared] == list(dict.fromkeys(declared))


@pytest.mark.release
@pytest.mark.parametrize(
    ("written", "first"),
    [
        ("servo further like |", ["gearbox", "rigid_gearbox"]),
        ("sweep more of |", ["nominal"]),
        ("run more like nominal { servos { elbow = |", ["gearbox", "rigid_gearbox"]),
        ("run more like nominal { servos { |", ["shoulder", "elbow"]),
        ("run more like nominal { arm = |", ["two"]),
        ("joint wrist |", ["revolute", "prismatic", "fixed"]),
        ("arm b { link hand |", []),
        ("servo further |", ["like"]),
        ("sweep more |", ["of"]),
        ("servo further like gearbox { rate = 1 |", ["Hz", "kHz"]),
        ("arm b { joint a revolute { axis = |", ["x", "y", "z"]),
        ("arm b { joint a revolute { axis = -|", ["x", "y", "z"]),
        ("arm b { link a { shape = cylinder(|", ["radius", "length", "along"]),
        ("arm b { link a { shape = cylinder(along = x, |", ["radius", "length"]),
        ("arm b { link a { shape = cylinder(along = |", ["x", "y", "z"]),
        ("arm b { link a { shape = box(size = [1, 2, 3 |", ["m", "km"]),
        ("servo f like gearbox { command = rate(step(at = 1 s, |", ["start", "to"]),
        ("servo f like gearbox { command = rate(step(at = 1 s) |", []),
        ("arm b { link a { shape = rod(length = 1 m, along = x) |", []),
        ("run more like nominal { metric m = settling_time(of = q); require m < 1 |", ["s", "ms"]),
        ("arm b { link a { mass = max(|", ["slow"]),
        ("run more like nominal { metric m = max(|", ["of"]),
        ("run more like nominal { metric m = settling_time(|", ["of", "target", "band", "within"]),
        ("servo f { model = |", list(models.available("servo"))),
        ("run more like nominal { integrator = |", list(models.available("integrator"))),
        ("run more like nominal { duration = 5 |", ["s", "ms", "us", "min", "h"]),
        ("servo further like gearbox { kp = 5 |", ["V*s/rad"]),
        ("run more like nominal { metric m = |", list(models.available("metric"))),
        ("sweep s of nominal { vary links.|", ["upper", "lower"]),
        ("sweep s of nominal { vary links.upper.|", ["mass"]),
        ("sweep s of nominal { vary elbow.|", ["axis"]),
        ("run more like nominal { record = [elbow.|", ["q", "qd"]),
        ("// comment |", []),
        ('run more like nominal { allow D105 because "|" }', []),
        ("#|", ["if", "ifdef", "ifndef"]),
        ("#include <|", library_files()),
        ('#include "|"', ["lengths.ic"]),
    ],
)
def test_what_may_stand_here_comes_first(editor: Editor, deck: Path, written: str, first: list[str]) -> None:
    found = words(editor, deck, ARM + written)
    if "links" in written or "elbow." in written:
        assert set(first) <= set(found)
    else:
        assert found[: len(first)] == first and (first or not found)


def test_words_of_a_deck_itself_are_offered_and_shown_as_the_language_declares_them(
    editor: Editor, tmp_path: Path
) -> None:
    deck = tmp_path / "own.ic"
    text = "deck 2;\nunit ozin = 7.061552e-3 N*m;\n"
    editor.open(deck, text)
    declared = [entry.name for entry in TOP_LEVEL.entries]
    assert declared == ["deck", "let", "param", "use", "unit"]
    assert words(editor, deck, text + "|")[len(DEFINITIONS) :][: len(declared)] == declared
    assert words(editor, deck, "deck |") == ["1", "2"]
    assert "ozin" in words(editor, deck, text + "servo s { model = rigid_gearbox;  tau_max = 5 |")
    editor.change(deck, text + "let most = 5 ozin;\n")
    editor.settle()
    for mark, entry in (("deck", "deck"), ("unit", "unit")):
        shown = editor.about("textDocument/hover", deck, *at(text, mark))["contents"]["value"]
        assert f"`{TOP_LEVEL[entry].written}`" in shown and TOP_LEVEL[entry].doc in shown
    assert places(editor.about("textDocument/definition", deck, 2, 13)) == [(uri(deck), 1, 5)]
    outline = editor.ask("textDocument/documentSymbol", {"textDocument": {"uri": uri(deck)}})
    assert [each["name"] for each in outline] == ["ozin", "most"]


TABLE = "link, mass [kg], com.x [m], com.y [m], com.z [m]\nboom, 2, 0.1, 0, 0\nstick_left, 1, 0.2, 0, 0\n"


def test_only_what_may_be_varied_set_or_required_is_offered_there(editor: Editor, deck: Path) -> None:
    heads = {"links", "initial", "environment", "shoulder", "elbow", "gearbox", "reach", "arm"}
    signals = {"q", "tau", "energy", "momentum"}
    with_metric = ARM + "run last like nominal { metric settle = settling_time { of = elbow.qd;  target = slow; } }\n"
    editor.change(deck, with_metric)
    assert editor.of(deck) == []

    def offered(written: str) -> set[str]:
        return set(words(editor, deck, with_metric + written))

    varied = offered("sweep a of last { vary |")
    assert heads | {"macro"} <= varied and not varied & {*signals, "seed", "record", "settle", "sqrt", "pi"}
    assert offered("search a of last { vary |") == varied
    given = offered("run more like last { with |")
    assert heads | {"seed"} <= given and not given & {*signals, "settle", "macro", "sqrt"}
    excluded = offered("sweep a of last { exclude when |")
    assert heads | {"abs", "pi"} <= excluded and not excluded & {*signals, "settle"}
    values = offered("sweep a of last { vary gearbox.kp = |")
    assert {"linspace", "slow", "gearbox"} <= values and not values & {*signals, "links", "seed"}
    assert offered("search a of last { minimise |") == {"settle", "ROD"}
    required = offered("run more like last { require |")
    assert {"settle", "always", "step_error", "phase_margin"} <= required and not required & {*heads, *signals, "slow"}
    limit = offered("run more like last { require settle < |")
    assert {"slow", "abs", "gearbox"} <= limit and not limit & {*signals, "settle", "links"}
    assert {*signals, "settle", "elbow", "slow"} <= offered("run more like last { require always(|")


@pytest.mark.parametrize("token", ["(", "=", "[", "*", ".", "-", "when", "{"])
def test_an_entry_may_begin_with_anything_while_it_is_written(editor: Editor, deck: Path, token: str) -> None:
    for block in ("", "servo a {", "run a {", "run a { initial {", "run a { servos {", "sweep a of nominal {"):
        assert words(editor, deck, f"{ARM}{block} {token}|") is not None, block
        assert words(editor, deck, f"{ARM}{block} {token} |") is not None, block


def test_rows_and_columns_stand_behind_the_name_of_a_table(editor: Editor, tmp_path: Path) -> None:
    (tmp_path / "bodies.csv").write_text(TABLE)
    deck = tmp_path / "own.ic"
    text = 'let bodies = csv("bodies.csv");\n#include <two_link.ic>\n'
    editor.open(deck, text)
    assert editor.of(deck) == []
    columns = ["com", "mass", "com.x", "com.y", "com.z"]
    assert words(editor, deck, text + "arm a { link b { mass = bodies.|") == ["boom", "stick_left"]
    assert words(editor, deck, text + "arm a { link b { mass = bodies.boom.|") == columns[:2]
    assert words(editor, deck, text + "arm a { link b { mass = bodies.boom.com.|") == ["x", "y", "z"]
    looped = "arm a { for side in [left] { link b_{side} { mass = bodies.stick_{side}.|"
    assert words(editor, deck, text + looped) == columns[:2]


def test_signals_of_a_joint_are_offered_before_the_deck_was_ever_without_an_error(
    editor: Editor, tmp_path: Path
) -> None:
    deck = tmp_path / "new.ic"
    arm = "arm one { link upper { mass = 1 kg; }  joint swing revolute { parent = base; child = upper; axis = z; } }\n"
    editor.open(deck, arm)
    signals = ["q", "qd", "qdd", "tau", "tau_load", "J_eff", "b", "mode", "reaction"]
    for written in ("record = [swing.|", "metric m = final(of = swing.|", "require always(swing.|"):
        assert words(editor, deck, arm + "run a { arm = one; " + written) == signals, written
    assert "swing" in words(editor, deck, arm + "run a { arm = one; metric m = final(of = |")
    assert words(editor, deck, arm + "run a { arm = one; record = [upper.|") == [], "no joint"
    assert words(editor, deck, arm + "run a { arm = one; with swing.|") == [], "no signal varies"


def test_parts_of_a_signal_are_offered(editor: Editor, deck: Path) -> None:
    assert {"q", "qd", "tau", "servo"} <= set(words(editor, deck, ARM + "run more like nominal { record = [elbow.|"))


def hovered(editor: Editor, deck: Path, mark: str, n: int = 0) -> str:
    found = editor.about("textDocument/hover", deck, *at(ARM, mark, n))
    return "" if found is None else str(found["contents"]["value"])


def test_a_value_is_shown_with_its_path_in_si_and_what_it_overrode(editor: Editor, deck: Path) -> None:
    found = hovered(editor, deck, "kp = 0.03")
    declared = models.parameter(models.find("servo", "rigid_gearbox"), "kp")
    assert declared is not None and f"`kp` in V*s/rad: {declared.doc}" in found
    assert "`shoulder.servo.kp` = 0.03 V*s/rad" in found and "`elbow.servo.kp` = 0.03 V*s/rad" in found
    assert "overrides <servos/rigid_gearbox.ic>:" in found


def test_a_word_is_shown_with_what_it_means(editor: Editor, deck: Path) -> None:
    assert BLOCKS["run"]["duration"].doc in hovered(editor, deck, "duration")
    assert "unit `kg`: kilogram, 1 in SI" in hovered(editor, deck, "kg")
    assert f"unit `deg`: {UNITS['deg'].word}" in hovered(editor, deck, "deg/s")
    assert "let slow = 3 deg/s;" in hovered(editor, deck, "slow")
    assert "`slow` = 0.05235987755982989 rad/s" in hovered(editor, deck, "slow =")
    assert "#define ROD(NAME, MASS)" in hovered(editor, deck, "ROD(upper")
    assert "let reach = 2 m;" in hovered(editor, deck, "reach, 0")


def test_a_rate_is_shown_with_what_comes_at_that_rate(editor: Editor, deck: Path) -> None:
    for name in ("dynamics", "servos", "record"):
        shown = hovered(editor, deck, f"{name} = {100 if name == 'servos' else 25} Hz")
        assert shown.count(BLOCKS["rates"][name].doc) == 2, "of the key, and of its value"
        assert "ticks of the servos" in shown or "computer" not in shown


def test_a_model_is_shown_with_its_own_words(editor: Editor, deck: Path) -> None:
    profile = models.find("command", "pulse")
    editor.change(deck, ARM.replace("rate(slow)", "rate(pulse(to = slow, slope = 1 deg/s^2, over = 9 s))"))
    shown = editor.about("textDocument/hover", deck, *at(ARM, "slow);"))["contents"]["value"]
    assert f"command model `pulse`: {summary(profile)}" in shown and summary(profile) in " ".join(profile.doc.split())
    offered = editor.about("textDocument/completion", deck, *at(ARM, "slow);"))
    assert summary(profile) in {each["detail"] for each in offered if each["label"] == "pulse"}


def test_a_unit_of_the_deck_is_shown_with_its_size_wherever_it_stands(editor: Editor, deck: Path) -> None:
    declared = "unit turn = 360 deg;\nunit ozin = 7.061552e-3 N*m;\nlet slow = 0.01 turn/s;\nlet most = 2.5 ozin;"
    text = "deck 2;\n" + ARM.replace("let slow = 3 deg/s;", declared)
    editor.change(deck, text)
    assert editor.of(deck) == []
    for mark, size in (("turn =", "6.283185307 rad"), ("turn/s", "6.283185307 rad"), ("ozin;", "0.007061552 N*m")):
        shown = editor.about("textDocument/hover", deck, *at(text, mark))["contents"]["value"]
        assert shown.startswith(f"unit `{mark[:4]}`: {size} in SI\n\n```met\nunit {mark[:4]} = "), shown


def places(found: list[Any]) -> list[tuple[str, int, int]]:
    return [(each["uri"], *each["range"]["start"].values()) for each in found]


@pytest.mark.parametrize(
    ("mark", "n", "defined"),
    [
        ("gearbox;", 0, "gearbox like"),
        ("nominal {", 1, "nominal {"),
        ("slow)", 0, "slow ="),
        ("ROD(lower", 0, "ROD(NAME"),
        ("two;", 0, "two {"),
        ("elbow = gearbox", 0, "elbow    rev"),
        ("gearbox.kp", 0, "gearbox like"),
    ],
)
def test_a_word_leads_to_its_definition(editor: Editor, deck: Path, mark: str, n: int, defined: str) -> None:
    found = editor.about("textDocument/definition", deck, *at(ARM, mark, n))
    assert places(found) == [(uri(deck), *at(ARM, defined))]


def test_definitions_are_found_in_included_files_and_in_the_library(editor: Editor, deck: Path) -> None:
    lengths = deck.parent / "lengths.ic"
    assert places(editor.about("textDocument/definition", deck, *at(ARM, "reach, along"))) == [(uri(lengths), 0, 4)]
    library = LIBRARY / "servos" / "rigid_gearbox.ic"
    line, column = at(library.read_text(), "rigid_gearbox {")
    found = editor.about("textDocument/definition", deck, *at(ARM, "rigid_gearbox {"))
    assert places(found) == [(uri(library), line, column)]
    assert places(editor.about("textDocument/definition", deck, *at(ARM, "lengths.ic"))) == [(uri(lengths), 0, 0)]
    assert places(editor.about("textDocument/definition", deck, *at(ARM, "<servos"))) == [(uri(library), 0, 0)]


@pytest.mark.slow
def test_all_uses_of_a_name_are_found_in_all_files(editor: Editor, deck: Path) -> None:
    context = {"context": {"includeDeclaration": True}}
    found = editor.about("textDocument/references", deck, *at(ARM, "reach, 0"), **context)
    lengths = deck.parent / "lengths.ic"
    assert sorted(places(found)) == sorted(
        [(uri(lengths), 0, 4), (uri(deck), *at(ARM, "reach, along")), (uri(deck), *at(ARM, "reach, 0"))]
    )
    context = {"context": {"includeDeclaration": False}}
    found = editor.about("textDocument/references", deck, *at(ARM, "gearbox like"), **context)
    assert places(found) == [(uri(deck), *at(ARM, mark)) for mark in ("gearbox;", "gearbox; }", "gearbox.kp")]


@pytest.mark.release
def test_what_is_known_outlives_a_text_that_cannot_be_compiled(editor: Editor, deck: Path) -> None:
    editor.change(deck, ARM + "run broken like nominal { record = [q")
    assert editor.of(deck) != []
    assert "`shoulder.servo.kp` = 0.03 V*s/rad" in hovered(editor, deck, "kp = 0.03")
    assert "voltage" in words(editor, deck, ARM + "run broken like nominal { record = [elbow.servo.|")
