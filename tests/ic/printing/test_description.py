"""The language as one JSON object is whole: all that the compiler knows is in it, and its keys stay."""

from __future__ import annotations

import json
import re
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

import ic
from ic.language import BLOCKS
from ic.meaning.definitions.row_tables import CSV
from ic.meaning.expressions.evaluate import FUNCTIONS
from ic.meaning.mechanics.matter import SHAPES
from ic.printing.models import KINDS
from ic.sweeps.designs import DESIGNS, DISTRIBUTIONS
from met import cli, models, units
from met.parameter import Parameter

ROOT = Path(ic.__file__).parents[1]
PARAMETER = {field.name for field in fields(Parameter)}

KEYS = {
    "": {
        "schema", "version", "met", "definitions", "blocks", "top_level", "anywhere", "models", "shapes", "dh", "joint_kinds", "base_kinds",
        "channels", "units", "unit_words", "functions", "constants", "comparisons", "designs", "distributions",
        "directives", "taken_names", "editions", "diagnostics", "library",
    },
    "blocks": {"name", "doc", "written", "within", "head", "free", "entries"},
    "top_level": {"name", "written", "doc"},
    "anywhere": {"name", "written", "doc"},
    "editions": {"edition", "taken_names"},
    "models": {"kind", "name", "doc", "written", "parameters"},
    "shapes": {"name", "parameters"},
    "dh": {"name", "unit", "doc", "default"},
    "channels": {"path", "unit", "components", "meaning", "frame"},
    "units": {"name", "word", "scale", "si"},
    "functions": {"name", "written", "doc", "arguments"},
    "designs": {"name", "written", "doc"},
    "distributions": {"name", "written", "doc"},
    "diagnostics": {"code", "title", "may_be_allowed"},
}  # fmt: skip
"""Keys of version 1, at the top and in each entry of its lists: one that goes raises the version."""

ENTRY = {"name", "form", "written", "doc", "default", "type", "unit", "varies", "path", "parameter"}


@pytest.fixture
def found(capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    assert cli.main(["doc", "language", "--format", "json"]) == cli.YES

    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is no JSON")

    read: dict[str, Any] = json.loads(capsys.readouterr().out, parse_constant=refuse)
    return read


def names(listed: list[dict[str, Any]], key: str = "name") -> list[str]:
    return [each[key] for each in listed]


def test_the_description_says_which_schema_it_has_and_keeps_its_keys(found: dict[str, Any]) -> None:
    assert (found["schema"], found["version"]) == ("met.language", 1)
    assert set(found) >= KEYS[""]
    for part, keys in KEYS.items():
        assert all(set(each) >= keys for each in found.get(part, [])), part


def test_every_block_has_all_of_its_entries_with_all_that_is_declared_of_their_numbers(found: dict[str, Any]) -> None:
    assert names(found["blocks"]) == list(BLOCKS)
    for written, block in zip(found["blocks"], BLOCKS.values(), strict=True):
        assert names(written["entries"]) == [entry.name for entry in block.entries]
        assert written["doc"] and all(set(each) == ENTRY and each["doc"] for each in written["entries"])
        for each, entry in zip(written["entries"], block.entries, strict=True):
            assert (each["parameter"] is None) == (entry.parameter is None)
            if entry.parameter is not None:
                assert set(each["parameter"]) == PARAMETER and each["parameter"]["unit"] == entry.parameter.unit


def test_every_model_has_all_of_its_parameters(found: dict[str, Any]) -> None:
    there = {(each["kind"], each["name"]): each for each in found["models"]}
    for kind in KINDS:
        for model in models.available(kind).values():
            written = there.pop((kind, model.name))
            assert names(written["parameters"]) == [each.name for each in models.written(model)]
            assert written["doc"] and all(set(each) == PARAMETER and each["doc"] for each in written["parameters"])
    assert not there


def test_every_word_that_a_value_may_use_is_there(found: dict[str, Any]) -> None:
    assert sorted(names(found["functions"])) == sorted((*FUNCTIONS, CSV))
    assert all(each["arguments"] for each in found["functions"])
    assert names(found["units"]) == list(units.ALL_UNITS)
    assert sorted(names(found["shapes"])) == sorted(SHAPES)
    assert set(names(found["designs"])) == set(DESIGNS)
    assert set(names(found["distributions"])) >= set(DISTRIBUTIONS)
    assert set(found["definitions"]) == {"arm", "servo", "run", "sweep", "search", "tune"}
    assert found["constants"]["pi"] == 3.141592653589793


def test_every_code_of_the_source_is_there(found: dict[str, Any]) -> None:
    files = [file for room in ("met", "ic", "batch", "hw") for file in (ROOT / room).rglob("*.py")]
    used = {code for file in files for code in re.findall(r'"([A-Z]\d{3})"', file.read_text(encoding="utf-8"))}
    assert set(names(found["diagnostics"], "code")) == used
    assert all(each["title"] for each in found["diagnostics"])


def test_every_deck_of_the_library_can_be_included(found: dict[str, Any], tmp_path: Path) -> None:
    assert "servos/rigid_gearbox.ic" in found["library"] and "two_link.ic" in found["library"]
    deck = tmp_path / "all.ic"
    deck.write_text("".join(f"#include <{name}>\n" for name in found["library"] if "/" in name))
    assert ic.check(deck).plan is not None


def test_a_name_that_is_taken_is_no_name_of_a_value(found: dict[str, Any], tmp_path: Path) -> None:
    assert found["taken_names"] == found["editions"][0]["taken_names"]
    for edition in found["editions"]:
        for name in (*found["taken_names"], "free_name"):
            deck = tmp_path / "deck.ic"
            deck.write_text(f"deck {edition['edition']};\nlet {name} = 2;\n")
            errors = [each for each in ic.check(deck).diagnostics if each.severity == "error"]
            assert bool(errors) == (name in edition["taken_names"]), name


def test_the_overview_counts_what_is_there(capsys: pytest.CaptureFixture[str], found: dict[str, Any]) -> None:
    assert cli.main(["doc", "language"]) == cli.YES
    said = capsys.readouterr().out
    assert said.startswith("language: all of it, for programs: `met doc language --format json`, met.language 1\n")
    assert re.search(rf"^ *units +{len(units.ALL_UNITS)} entries$", said, re.MULTILINE)
