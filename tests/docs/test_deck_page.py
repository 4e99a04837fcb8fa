"""docs/deck.md and README.md are true: their decks compile and run, their tables are those of the code.

Before a deck a hidden comment says where it belongs: `picker.ic` (the next piece of the tutorial's deck), `alone` (a
deck of its own), `more` (definitions after the tutorial's), `in arm`, `in servo`, `in run`, `in sweep` (the body of a
definition built on the tutorial's). A code after a colon is the error that it must give.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
import xarray

import batch
import ic
from ic.grammar.syntax import Name
from ic.language.bodies import JOINT, LINK, PAYLOAD
from ic.language.runs import RATES, RUN
from ic.meaning.control.substitution import DEFAULTS
from ic.meaning.definitions.resolve import Definitions
from ic.meaning.expressions.evaluate import FUNCTIONS
from ic.meaning.expressions.quantity import ValueList
from ic.meaning.mechanics.matter import SHAPES
from ic.meaning.parameters.scope import Scope
from ic.read import read
from ic.text.complaints import Complaints
from met import models, units
from met.messages import render

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "deck.md").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")

PIECES = re.findall(r"<!-- (?P<where>[\w. ]+?)(?:: (?P<code>D\d+))? -->\n```c\n(?P<text>.*?)```", PAGE, re.DOTALL)
PICKER = "\n".join(text for where, _, text in PIECES if where == "picker.ic")
TABLES = dict(re.findall(r"<!-- (\w+\.csv) -->\n```csv\n(.*?)```", PAGE, re.DOTALL))
WHOLE = ("picker.ic", "chain.ic", "stick.ic", "swing.ic", "two_sticks.ic", "twins.ic", "alone")
FRAGMENTS = [piece for piece in PIECES if piece[0] not in WHOLE]
AROUND = {
    "more": "{}",
    "in arm": "arm another like picker {{ {} }} run other like pick {{ arm = another; }}",
    "in servo": "servo another like spindle {{ {} }} run other like pick {{ servos {{ lift = another; }} }}",
    "in run": "run another like pick {{ {} }}",
    "in sweep": "sweep another of pick {{ {} }}",
}


def checked(path: Path, text: str):  # type: ignore[no-untyped-def]
    path.write_text(text, encoding="utf-8")
    compiled = ic.check(path)
    return compiled, render.render(compiled.diagnostics, compiled.sources)


def table(heading: str) -> list[list[str]]:
    """Cells of the rows of the page's table that begins with this cell."""
    body = re.search(rf"^\| {re.escape(heading)} \|.*\n\|[-|]+\n((?:\|.*\n)+)", PAGE, re.MULTILINE)
    assert body is not None, heading
    return [[cell.strip() for cell in row.strip("|").split(" | ")] for row in body[1].splitlines()]


def with_tables(folder: Path) -> None:
    for name, text in TABLES.items():
        (folder / name).write_text(text, encoding="utf-8")


def ticked(text: str) -> set[str]:
    return set(re.findall(r"`([^`]+)`", text))


def test_every_deck_of_the_page_says_where_it_belongs() -> None:
    assert PAGE.count("```c\n") == len(PIECES)
    assert {where for where, _, _ in PIECES} == {
        "picker.ic",
        "chain.ic",
        "stick.ic",
        "two_sticks.ic",
        "swing.ic",
        "twins.ic",
        "alone",
        *AROUND,
    }
    assert set(TABLES) == {"moves.csv", "cases.csv", "bodies.csv"}


def test_the_tutorials_deck_has_neither_errors_nor_warnings_and_as_many_cases_as_the_page_says(tmp_path: Path) -> None:
    compiled, said = checked(tmp_path / "picker.ic", PICKER)
    assert said == ""
    assert [experiment.cases.count for experiment in compiled.plan.experiments] == [1, 14]
    assert "1 run, 1 sweep, 15 cases: no errors" in PAGE and "the sweep's 14 cases" in PAGE


@pytest.mark.slow
def test_the_tutorials_run_meets_its_requirements_and_its_sweep_fails_in_two_cases_as_the_page_says(
    tmp_path: Path,
) -> None:
    deck = tmp_path / "picker.ic"
    deck.write_text(PICKER, encoding="utf-8")
    archive = batch.run(ic.compile(deck), output=tmp_path / "pick.h5")
    assert archive.ok
    with archive.open() as data:
        # what the deck is about: the boom turns at the rate asked, the carriage follows its sine
        assert data["qd"].sel(joint="swing").isel(time=-1) == pytest.approx(0.5236, rel=0.02)  # the metric's band
        assert data["q"].sel(joint="lift").max() == pytest.approx(0.1, rel=0.1)  # its rate loop lags
    archive = batch.run(ic.compile(deck, select=["tuning"]), output=tmp_path / "tuning.h5")
    with archive.open() as data:
        assert (data["status"] == 0).all()
        assert dict(zip(data["requirement"].values.tolist(), (data["met"] == 0).sum("case").values.tolist(),
                        strict=True)) == {"settle < 2 s": 2, "beyond < 25 %": 0, "volts < 48 V": 0}  # fmt: skip
    assert "2 of the cases settle too late" in PAGE


@pytest.mark.slow
@pytest.mark.parametrize(("where", "code", "text"), FRAGMENTS, ids=[f"{w} {t.split()[0]}" for w, _, t in FRAGMENTS])
def test_a_fragment_compiles_where_it_belongs_or_gives_the_error_it_shows(
    where: str, code: str, text: str, tmp_path: Path
) -> None:
    with_tables(tmp_path)
    before = ""
    if where == "more":  # which may use what earlier ones define
        earlier = FRAGMENTS[: next(n for n, piece in enumerate(FRAGMENTS) if piece[2] == text)]
        before = "".join(piece for where, code, piece in earlier if where == "more" and not code)
    compiled, said = checked(tmp_path / "picker.ic", PICKER + before + AROUND[where].format(text))
    if code:
        assert compiled.plan is None and {diagnostic.code for diagnostic in compiled.diagnostics} == {code}, said
    else:
        assert compiled.plan is not None and said == "", said


@pytest.mark.slow
def test_the_sweep_of_the_page_counts_with_its_last_axis_fastest(tmp_path: Path) -> None:
    (text,) = (text for where, _, text in FRAGMENTS if text.startswith("sweep loads"))
    compiled, _ = checked(tmp_path / "picker.ic", PICKER + text)
    (loads,) = (e for e in compiled.plan.experiments if e.name == "loads")
    columns = {c.path: c.values.tolist() for c in loads.cases.coordinates}
    assert columns["environment.gravity.g.z"] == [-9.81, -1.62] * 6
    assert columns["links.boom.com.x"] == [0.35] * 12


@pytest.mark.slow
def test_the_sweeps_of_the_page_have_the_cases_and_structures_that_it_says(tmp_path: Path) -> None:
    with_tables(tmp_path)
    more = "".join(text for where, code, text in FRAGMENTS if where == "more" and not code)
    compiled, said = checked(tmp_path / "picker.ic", PICKER + more)
    assert said == ""
    counts: dict[str, list[int]] = {}
    for experiment in compiled.plan.experiments:
        counts.setdefault(experiment.name_in_deck, []).append(experiment.cases.count)
    assert counts["drives"] == [2, 2, 2]
    assert counts["everything"] == [2, 2, 2, 12, 1]
    assert counts["measured"] == [2, 1]
    assert counts["spread"] == [1000]
    (text,) = (text for where, _, text in PIECES if where == "chain.ic")
    compiled, said = checked(tmp_path / "chain.ic", text)
    assert said == ""
    sizes = [each for each in compiled.plan.experiments if each.name_in_deck == "sizes"]
    assert [(len(each.structure.joints), each.cases.count) for each in sizes] == [(1, 3), (2, 3)]


@pytest.mark.slow
def test_what_the_page_builds_on_the_tutorial_runs(tmp_path: Path) -> None:
    (text,) = (text for where, _, text in FRAGMENTS if text.startswith("arm long_picker"))
    (tmp_path / "picker.ic").write_text(PICKER + text, encoding="utf-8")
    archive = batch.run(ic.compile(tmp_path / "picker.ic", select=["gentle"]), output=tmp_path / "gentle.h5")
    with archive.open() as data:
        assert data["status"] == [0]
        assert data["requirement"].values.tolist() == ["settle < 2 s", "volts < 48 V"]


@pytest.mark.slow
def test_what_the_page_reads_from_a_file_is_followed(tmp_path: Path) -> None:
    (text,) = (text for where, _, text in FRAGMENTS if text.startswith("servo replay"))
    with_tables(tmp_path)
    (tmp_path / "picker.ic").write_text(PICKER + text, encoding="utf-8")
    archive = batch.run(ic.compile(tmp_path / "picker.ic", select=["recorded"]), output=tmp_path / "recorded.h5")
    with archive.open() as data:
        # half a second after the last row, at k_position of 10 1/s and 15 1/s: e^-5 of what was left
        end = data["q"].isel(time=-1)
        assert end.sel(joint="swing") == pytest.approx(math.radians(25.0), abs=math.radians(0.5))
        assert end.sel(joint="lift") == pytest.approx(0.02, abs=2e-3)
    with xarray.open_dataset(tmp_path / "recorded.h5", group="provenance") as kept:
        assert [Path(str(name)).name for name in kept["source"].values] == ["picker.ic", "moves.csv"]


def test_the_deck_that_sets_a_param_has_the_reaches_that_it_says(tmp_path: Path) -> None:
    for where, _, text in PIECES:
        if where in ("stick.ic", "swing.ic"):
            (tmp_path / where).write_text(text, encoding="utf-8")
    swing, farther, reaches = ic.compile(tmp_path / "swing.ic", select="all").experiments
    middles = [each.parameters["links.bar.com.x"].value for each in (swing, farther)]
    assert middles == [0.45, 0.6]
    assert reaches.cases.coordinates[0].values.tolist() == [0.8, 1.0, 1.2]


def test_the_deck_that_uses_others_has_each_value_under_its_roof(tmp_path: Path) -> None:
    for where, _, text in PIECES:
        if where in ("stick.ic", "two_sticks.ic"):
            (tmp_path / where).write_text(text, encoding="utf-8")
    turn, lengths = ic.compile(tmp_path / "two_sticks.ic", select="all").experiments
    found = [turn.parameters[path].value for path in ("links.bar.com.x", "links.rod.com.x", "elbow.at.x")]
    assert found == [0.55, 0.4, 1.1]
    assert turn.parameters["hinge.servo.kp"].value == 0.025
    assert [each.path for each in lengths.cases.coordinates] == ["right.reach", "panda.panda_large.ki"]


@pytest.mark.slow
@pytest.mark.parametrize("links", [None, 1, 2])
def test_the_deck_with_macros_runs_with_and_without_its_switch(links: int | None, tmp_path: Path) -> None:
    (text,) = (text for where, _, text in PIECES if where == "alone")
    (tmp_path / "chain.ic").write_text(text, encoding="utf-8")
    plan = ic.compile(tmp_path / "chain.ic", defines=[] if links is None else [f"LINKS={links}"])
    assert len(plan.experiments[0].structure.joints) == (links or 2)
    assert batch.run(plan, output=tmp_path / "chain.h5").ok


def test_a_let_that_takes_a_macro_is_set_from_the_command_line_as_the_page_says(tmp_path: Path) -> None:
    assert "`let span = SPAN * 1 m;`, with `-D SPAN=0.7`" in PAGE
    (text,) = (text for where, _, text in PIECES if where == "alone")
    (tmp_path / "chain.ic").write_text(text.replace("let span  = 0.5 m;", "let span = SPAN * 1 m;"), encoding="utf-8")
    plan = ic.compile(tmp_path / "chain.ic", defines=["SPAN=0.7"])
    assert plan.experiments[0].parameters["two.at.x"].value == 0.7


@pytest.mark.parametrize("row", table("written"), ids=lambda row: row[0])
def test_a_value_is_what_its_row_says(row: list[str], tmp_path: Path) -> None:
    (written,), (numbers, unit) = ticked(row[0]), row[1].rsplit(" ", 1)
    (tmp_path / "one.ic").write_text(f"let it = {written};\n", encoding="utf-8")
    complaints = Complaints(())
    scope = Scope(Definitions(read(tmp_path / "one.ic", [], []), complaints), complaints)
    place = scope.definitions.lets["it"].name
    found = scope.names.find(Name((place,), place.place))
    values = found.items if isinstance(found, ValueList) else (found,)
    assert ", ".join(f"{value.number:g}" for value in values) == numbers  # type: ignore[union-attr]
    assert {units.text(value.dimension) for value in values} == {unit}  # type: ignore[union-attr]


def test_the_table_of_units_is_whole() -> None:
    listed = [name for row in table("of") for name in re.findall(r"`([^`/*, ]+)`", row[1])]
    assert sorted(listed) == sorted(units.ALL_UNITS)


def test_every_function_shape_key_and_model_is_on_the_page() -> None:
    assert {name.partition("(")[0] for row in table("function") for name in ticked(row[0])} == {*FUNCTIONS, "pi"}
    shapes = {row[0].strip("`"): {word.split()[0] for word in ticked(row[1])} for row in table("shape")}
    assert shapes == {name: {p.name for p in shape.parameters} for name, shape in SHAPES.items()}
    assert {word for row in table("key of a link") for word in ticked(row[0])} == set(LINK.keys)
    assert {word for row in table("key of a joint") for word in ticked(row[0])} == set(JOINT.keys)
    entries = {entry.split()[0] for row in table("entry of a run") for entry in ticked(row[0])}
    assert {word for row in table("key of a substitute") for word in ticked(row[0])} == {*DEFAULTS, "scale"}
    assert {word for row in table("key of a payload") for word in ticked(row[0])} == set(PAYLOAD.keys)
    assert entries == {*RUN.keys, *RUN.named, *RUN.statements}
    words = ticked(re.sub(r"```.*?```", "", PAGE, flags=re.DOTALL))
    assert set(RATES.keys) <= words
    for kind in ("servo", "environment", "guide", "metric", "integrator"):
        assert set(models.find_own(kind)) <= words, kind
    assert set(models.find_own("command")) - {"constant"} <= words


PATHS = [path for row in table("path") for path in re.findall(r"`([^`]+)`", row[0])]


def test_the_deck_with_a_table_takes_its_numbers_from_there(tmp_path: Path) -> None:
    with_tables(tmp_path)
    (text,) = (text for where, _, text in PIECES if where == "twins.ic")
    path = tmp_path / "twins.ic"
    path.write_text(text, encoding="utf-8")
    fall, heavy = ic.compile(path, select=["fall", "heavy"]).experiments
    masses = [fall.parameters[f"links.{name}.mass"].value for name in ("pylon", "left_arm", "right_arm")]
    assert masses == [6.0, 2.4, 2.5] and heavy.parameters["links.left_arm.mass"].value == 4.8


@pytest.mark.slow
def test_every_path_of_the_page_can_vary(tmp_path: Path) -> None:
    deck, values = tmp_path / "picker.ic", {}
    deck.write_text(PICKER, encoding="utf-8")
    parameters = ic.compile(deck).experiments[0].parameters
    for path in PATHS:
        own = {"motor.kp": "swing.servo.kp", "turner.command.to": "swing.servo.command.to",
               "picker.links.boom.mass": "links.boom.mass", "reach": "links.boom.com.x"}.get(path, path)  # fmt: skip
        settled = parameters.get(own)
        number, unit = (settled.value, settled.unit) if settled else (0.8, "m")
        assert isinstance(number, float)
        # the moments of a boom obey the triangle inequality, so theirs is varied a little only
        values[path] = f"[{number * 1.001 + 0.0001:.9g}, {number * 1.002 + 0.0002:.9g}] {'' if unit == '1' else unit}"
    for path, listed in values.items():
        compiled, said = checked(deck, PICKER + f"sweep one of pick {{ vary {path} = {listed}; }}")
        idle = "nothing that the run computes depends on it" in said  # a carriage that does not turn: where its boom is
        assert compiled.plan is not None or (idle and path in ("swing.at.x", "swing.rpy.z")), said


@pytest.mark.slow
def test_the_readmes_deck_runs_and_its_lines_of_python_open_what_they_wrote(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (deck,) = re.findall(r"```c\n(.*?)```", README, re.DOTALL)
    (lines,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    Path("deck.ic").write_text(deck, encoding="utf-8")
    archive = batch.run(ic.compile("deck.ic", select=["gains"]), histories="none")
    with archive.open() as data:
        assert data.sizes["case"] == 2 * 21 - 2 * 3 and (data["status"] == 0).all()
    told: dict[str, object] = {}
    exec(compile(lines, "README.md", "exec"), told)  # what a reader would type
    assert told["archive"].ok  # type: ignore[attr-defined]
    for name in ("data", "same"):
        assert told[name]["qd"].sel(joint="elbow").isel(time=-1) == pytest.approx(0.03, rel=1e-3)  # type: ignore[index]
        told[name].close()  # type: ignore[attr-defined]


def test_the_metrics_of_the_page_are_those_there_are() -> None:
    listed = " ".join(PAGE.split()).split("The metrics are ")[1].split(", and those of")[0]
    assert re.findall(r"`(\w+)`", listed) == sorted(models.find_own("metric"))
