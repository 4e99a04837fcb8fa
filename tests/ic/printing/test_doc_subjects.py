"""`met doc` beyond models: shapes, motors on beds, units, codes of messages."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import textmate
from textmate import PARTS, STATEMENTS

from ic.grammar.declared_units import UNIT
from ic.grammar.parse import LETS
from ic.grammar.uses import USE
from ic.language import BLOCKS, HEADS, TOP_LEVEL
from ic.language.bodies import JOINT_KINDS
from ic.meaning.definitions.row_tables import CSV
from ic.meaning.expressions.evaluate import CONSTANTS, FUNCTIONS
from ic.meaning.mechanics.matter import SHAPES
from ic.printing import looked_up
from ic.printing.looked_up import entries, meaning
from ic.printing.models import KINDS
from ic.printing.requests import SUBJECTS, print_word
from ic.sweeps.designs import DESIGNS, DISTRIBUTIONS
from ic.text.preprocess import DIRECTIVES
from met import cli, models, units


def printed(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert cli.main(["doc", *words]) == 0
    return capsys.readouterr().out


def complained(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert cli.main(["doc", *words]) == 2
    return capsys.readouterr().err


def test_every_shape_has_its_sizes(capsys: pytest.CaptureFixture[str]) -> None:
    out = printed(capsys, "shapes")
    for name, shape in SHAPES.items():
        rows = out.split(f"\n\n{name}\n")[1].split("\n\n")[0].splitlines()[1:]
        assert [row.split()[0] for row in rows] == [parameter.name for parameter in shape.parameters]
    assert "extend along one of its axes" in out
    assert [each["name"] for each in json.loads(printed(capsys, "shapes", "--format", "json"))] == list(SHAPES)


def test_substitute_says_its_keys_defaults_models_and_what_is_the_servos(capsys: pytest.CaptureFixture[str]) -> None:
    out = printed(capsys, "substitute")
    assert "\nModels of a bed; the default is emulated\n" in out
    assert "\nModels of a law; the default is velocity_tracking\n" in out
    assert all(f"\n  {name} " in out for kind in ("bed", "law") for name in models.find_own(kind))
    assert "the servo's j_m " in out
    assert [each["name"] for each in json.loads(printed(capsys, "substitute", "--format", "json"))] == [
        "bed",
        "law",
        "scale",
    ]


def test_units_lists_them_all_with_what_they_are_in_si(capsys: pytest.CaptureFixture[str]) -> None:
    rows = {line.split()[0]: line.split() for line in printed(capsys, "units").splitlines() if line.startswith("  ")}
    assert set(units.ALL_UNITS) <= set(rows)
    assert rows["km"] == ["km", "kilometre", "1000", "m"] and rows["rpm"][-2:] == ["0.10471975511965978", "rad/s"]


def test_the_list_of_models_ends_with_what_else_there_is(capsys: pytest.CaptureFixture[str]) -> None:
    assert printed(capsys).endswith(
        "Blocks of a deck: arm, link, boom, joint, loop, run, rates, initial, payload, substitute, scale, linear, tolerances, sweep, search, tune.\n"
        "Also: designs, dh, distributions, functions, language, shapes, units; and the code of a message, as in `met doc D060`.\n"
    )


WORDS = {"functions": (*FUNCTIONS, CSV), "designs": DESIGNS, "distributions": tuple(DISTRIBUTIONS)}


@pytest.mark.parametrize("subject", WORDS)
def test_every_word_of_values_and_sweeps_is_said(subject: str, capsys: pytest.CaptureFixture[str]) -> None:
    told = {each["name"]: each for each in json.loads(printed(capsys, subject, "--format", "json"))}
    assert set(WORDS[subject]) <= set(told) <= {*WORDS[subject], *CONSTANTS}
    lines = printed(capsys, subject).splitlines()
    assert all(
        any(line.split() == [*each["written"].split(), *each["doc"].split()] for line in lines)
        for each in told.values()
    )


def test_distributions_are_shown_with_what_they_take(capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        printed(capsys, "distributions")
        == """\
distributions: the probability distributions of a parameter in a sample

In a deck: sample lhs(200) { PATH = uniform(0.09, 0.11) N*m/A; }

  uniform(from, to)                     uniform between two values
  loguniform(from, to)                  uniform in the logarithm between two values
  normal(mean, deviation)               normal, without bounds, by its mean and standard deviation
  truncated(mean, deviation, from, to)  normal, by its mean and standard deviation, cut off at two values

A unit behind the brackets applies to all numbers inside. Values are rounded to 12 digits in it.
"""
    )


ENTRY = """\
# A page

### D060: a unit is needed

A number where a [dimension](deck.md) belongs.
<!-- deck.ic (text)
hidden
-->
```c
let a = 1;
```

```text
error[D060]: no
```

## Another section

### D061: another
"""


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "diagnostics.md"
    path.write_text(ENTRY)
    monkeypatch.setattr(looked_up, "PAGE", path)
    return path


def test_a_code_is_explained_by_its_entry_on_the_page(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        printed(capsys, "d060")
        == """\
D060: a unit is needed

A number where a dimension belongs.

    let a = 1;

    error[D060]: no
"""
    )
    assert printed(capsys, "D061") == printed(capsys, "d61") == "D061: another\n"


def test_a_code_without_an_entry_or_a_page_is_told(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        complained(capsys, "D062")
        == """\
error[D171]: no message has the code `D062`, or none that needs an entry
 = help: did you mean `D061`?
 = help: a code is printed with its message, as in `error[D060]`

1 error
"""
    )
    page.unlink()
    assert (
        complained(capsys, "D060")
        == """\
error[D171]: the page that explains `D060` is not installed with MET
 = help: the entry of every code is in docs/diagnostics.md of a checkout

1 error
"""
    )


def test_a_code_that_no_deck_brings_about_is_explained_by_its_row(capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        printed(capsys, "E338")
        == "E338: the system refuses a file, in words of its own, or it is one that MET does not run on\n"
    )


@pytest.mark.parametrize(("words", "whole"), [(("channels", "q"), "channels"), (("ideal", "servo"), "servo ideal")])
def test_a_word_too_many_is_told(words: tuple[str, str], whole: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        complained(capsys, *words)
        == f"""\
error[D171]: `{words[0]}` takes no second word
 = help: `met doc {whole}` says it all

1 error
"""
    )


def test_the_page_of_this_checkout_is_found(capsys: pytest.CaptureFixture[str]) -> None:
    assert printed(capsys, "D060").startswith("D060: ")


def test_a_word_of_the_glossary_is_explained(capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        printed(capsys, "shard")
        == "task, shard: a group of cases that a worker runs together; the file of their results\n"
    )


def test_an_entry_of_a_block_is_explained(capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        printed(capsys, "allow")
        == """\
allow CODE because "REASON";  in a run
    suppresses an expected warning, by the code that is printed with it: `allow D105 because "the report's own rates";`
    default: none
allow CODE because "REASON";  in a sweep
    suppresses an expected warning, in addition to those that the run allows
    default: those that the run allows
allow CODE because "REASON";  in a search
    suppresses an expected warning, in addition to those that the run allows
    default: those that the run allows
allow CODE because "REASON";  in a tune
    suppresses an expected warning, in addition to those that the run allows
    default: those that the run allows
"""
    )
    assert printed(capsys, "exclude").startswith("exclude when CONDITION;  in a sweep\n")


def test_every_word_of_the_glossary_is_found() -> None:
    page = (Path(__file__).parents[3] / "docs" / "glossary.md").read_text(encoding="utf-8")
    rows = [line.split(" | ")[0].removeprefix("| ") for line in page.splitlines() if line.startswith("| ")]
    words = [word for row in rows if row != "word" for word in row.split(", ")]
    assert len(words) > 50
    assert not [word for word in words if not list(meaning(word.replace("**", "").removeprefix("the ")))]


@pytest.mark.slow
def test_met_doc_knows_every_word_of_the_language_and_of_the_glossary() -> None:
    grammar = ("like", "of", "from", "in", "by", "and", "or", "not", "as", "because", "default", "defined", "cases",
               "confidence", *LETS, UNIT, USE, "for")  # fmt: skip
    keys = [each.name.split()[0] for block in (*BLOCKS.values(), TOP_LEVEL) for each in block.entries]
    declared = [
        each.name for kind in KINDS for model in models.available(kind).values() for each in models.written(model)
    ]
    others = (*STATEMENTS, *PARTS, *textmate.WORDS, *HEADS, *DIRECTIVES, *JOINT_KINDS, *FUNCTIONS, *CONSTANTS, *DESIGNS)
    words = {*grammar, *keys, *declared, *others, *DISTRIBUTIONS, *units.ALL_UNITS, *entries()} - {*SUBJECTS, *KINDS}
    unknown = [word for word in sorted(words) if not list(print_word(word)) and word not in SUBJECTS]
    names = {name for kind in KINDS for name in models.available(kind)}
    assert [word for word in unknown if word not in names] == []


@pytest.mark.parametrize(("word", "told"), [
    ("between", "choose PATH = between(LOW, HIGH) UNIT;"), ("until_shown", "random(until_shown, at_most = n)"),
    ("percentile", "require percentile(METRIC, 99 %)"), ("classic", "dh = classic("), ("craig", "dh = craig("),
    ("roof", "use <FILE> as ROOF;"), ("edition", "deck 2;"), ("urdf", 'from urdf("FILE")'), ("drive", "servo"),
    ("continuous", "rate = 500 Hz;"), ("limits", "limits.margin"), ("#include", '#include "FILE"'),
    ("bench", "bench: the parts"), ("verdict", "verdict: what the cases"),
])  # fmt: skip
def test_a_word_that_others_are_written_with_is_found_with_them(word: str, told: str) -> None:
    assert next(print_word(word)).startswith(told) or told in next(print_word(word))


@pytest.mark.parametrize("word", ["the", "", "#", "kpp", "is", "mas"])
def test_a_word_that_says_nothing_is_not_found(word: str) -> None:
    assert not list(print_word(word))


def test_met_doc_shows_every_meaning_of_a_word(capsys: pytest.CaptureFixture[str]) -> None:
    out = printed(capsys, "tau_max")
    assert [line for line in out.splitlines() if not line.startswith(" ")] == [
        "tau_max = 87 N*m;  in a joint",
        "tau_max = ... N*m  in servo rigid_gearbox, compliant_gearbox",
        "tau_max = ... N*m  in bed emulated, torque_drive, rate_drive",
    ]
    assert "step: from one instant of the dynamics to the next" in printed(capsys, "step")
