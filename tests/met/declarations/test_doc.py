"""`met doc` says of every parameter what the declaration says: in a terminal, for programs and on the page of docs."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import pytest

from met import cli, models
from met.parameter import Parameter
from tests.met.small_models import EVERY, smallest

PAGE = (Path(__file__).parents[3] / "docs" / "reference.md").read_text(encoding="utf-8")
GAP = re.compile(r" {2,}")


def printed(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert cli.main(["doc", *words]) == 0
    return capsys.readouterr().out


def in_full(value: float) -> str:
    """Six digits where those are all, else the digits that Python prints."""
    if float(f"{value:g}") == value:
        return f"{value:g}"
    digits = repr(value).split("e")[0].replace(".", "").replace("-", "").strip("0")
    return f"{value:.{len(digits)}g}"


def cells(parameter: Parameter) -> list[str]:
    """What a row says of a parameter, in words of this test's own."""
    unit = parameter.unit if parameter.unit != "1" else "-"
    default = parameter.default
    if parameter.of_servo:
        text = "the servo's" + (f" {parameter.of_servo}" if parameter.of_servo != parameter.name else "")
    elif default is None:
        text = "needed"
    elif default == ():
        text = "none"
    elif isinstance(default, tuple):
        text = f"[{', '.join(map(in_full, default))}]"
    else:
        text = default if isinstance(default, str) else in_full(default)
    text += f"; needed under {', '.join(parameter.needed_for)}" if parameter.needed_for else ""
    bounds = ["whole"] if parameter.whole else []
    signs = {"above": ">", "at_least": ">=", "below": "<", "at_most": "<="}
    bounds += [
        f"{sign} {in_full(getattr(parameter, name))}"
        for name, sign in signs.items()
        if getattr(parameter, name) is not None
    ]
    words = ((f"a {parameter.names}",) if parameter.names else ()) + parameter.words
    range_ = " | ".join(words) if words else ", ".join(bounds)
    if parameter.above_where_needed is not None:
        range_ += f"; > {in_full(parameter.above_where_needed)} where needed"
    shape = {"vector": "three numbers; ", "list": "a list; ", "text": "a text in quotes; "}.get(parameter.shape, "")
    shape = "the same in all cases; " if parameter.decides else shape
    only = f"; only with {parameter.only[0]} = {' or '.join(parameter.only[1])}" if parameter.only else ""
    return [cell for cell in (parameter.name, unit, text, range_, f"{shape}{parameter.doc}{only}") if cell]


def as_json(value: object) -> object:
    if isinstance(value, tuple):
        return [as_json(part) for part in value]
    return repr(value) if value in (math.inf, -math.inf) else value


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "name"), EVERY)
def test_a_row_says_all_that_is_declared_of_a_parameter(
    kind: models.Kind, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    parameters = models.written(models.find(kind, name))
    lines = printed(capsys, kind, name).split("\n\nParameters\n")
    rows = [GAP.split(line.strip()) for line in lines[1].split("\n\n")[0].splitlines()] if len(lines) > 1 else []
    assert rows[:1] in ([["name", "unit", "default", "range", "meaning"]], []) and bool(rows) == bool(parameters)
    assert rows[1:][: len(parameters)] == [cells(parameter) for parameter in parameters]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "name"), EVERY)
def test_a_program_is_told_all_that_is_declared_of_a_parameter(
    kind: models.Kind, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(word: str) -> float:
        raise AssertionError(f"{word} is no JSON")

    (told,) = json.loads(printed(capsys, kind, name, "--format", "json"), parse_constant=refuse)
    declared = models.written(models.find(kind, name))
    assert [each["name"] for each in told["parameters"]] == [parameter.name for parameter in declared]
    for each, parameter in zip(told["parameters"], declared, strict=True):
        # all that a declaration has: a field that it gets is told too
        assert each.keys() == vars(parameter).keys(), parameter.name
        for field, value in vars(parameter).items():
            assert each[field] == as_json(value), (parameter.name, field)


@pytest.mark.parametrize(("kind", "name"), EVERY)
def test_the_page_of_docs_says_the_same(kind: models.Kind, name: str) -> None:
    section = re.search(rf"^### {kind} {name}\n(.*?)(?=^##)", PAGE, re.DOTALL | re.MULTILINE)
    assert section is not None
    declared = models.written(models.find(kind, name))
    names = "|".join(dict.fromkeys(re.escape(parameter.name) for parameter in declared)) or "-"
    rows = [line for line in section[1].splitlines() if re.match(rf"\| `({names})` \|", line)]
    for parameter, row in zip(declared, rows[: len(declared)], strict=True):
        shown = re.split(r"(?<!\\)\|", row.strip("| "))
        plain = [re.sub(r"\\(.)", r"\1", cell).strip() for cell in shown]
        assert [cell for cell in plain if cell] == [f"`{parameter.name}`", *cells(parameter)[1:]]


def test_where_a_value_comes_from_is_told_to_programs_in_the_words_of_plan_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """JSON has no word for infinite: a lock that is never released is so in a plan, and here."""
    path = tmp_path / "deck.ic"
    path.write_text(smallest("servo", "locked").deck(without=["release"]), encoding="utf-8")
    assert cli.main(["explain", str(path), "hinge.servo.release", "--run", "it", "--format", "json"]) == 0
    (told,) = json.loads(capsys.readouterr().out)
    assert told["value"] == "inf" and told["origin"] == "default"
