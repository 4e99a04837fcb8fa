"""`met check` of one deck and of several, for people and for programs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from met import cli
from met.messages.edits import Edit, apply
from tests.met.analysis.test_step_map import SWING

GOOD = "#include <two_link.ic>\n"
BAD = '#include "part.ic"\nrun long like nominal { duration = 2; }\n'
PART = "#pragma once\n#include <two_link.ic>\nrun short like nominal { recrod = [q]; }\n"


@pytest.fixture(autouse=True)
def decks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in (("good.ic", GOOD), ("bad.ic", BAD), ("worse.ic", BAD), ("part.ic", PART)):
        Path(name).write_text(text, encoding="utf-8")


def asked(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    status = cli.main(["check", *arguments])
    return status, *capsys.readouterr()


@pytest.mark.slow
def test_several_decks_are_checked_one_after_the_other(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = asked(capsys, "good.ic", "bad.ic", "good.ic")
    assert status == cli.BAD_INPUT
    assert [line.partition(":")[0] for line in out.splitlines()] == ["good.ic", "good.ic"]
    assert "error[D060]" in err and "error[D109]" in err
    assert asked(capsys, "good.ic", "good.ic", "-q") == (cli.YES, "", "")


def test_an_arm_too_large_for_the_analysis_of_its_steps_is_told(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("met.analysis.step_size.MOST_STATES", 1)
    Path("large.ic").write_text(f"{SWING}run longer like hold {{ duration = 6 s; }}\n")
    assert asked(capsys, "large.ic") == (
        cli.YES,
        "hold, longer: step size: not looked at, the arm is too large: 2 states, and 1 is the most\n"
        "large.ic: 2 runs, 2 cases: no errors\n",
        "",
    )
    assert asked(capsys, "large.ic", "--quiet") == (cli.YES, "", "")


@pytest.mark.slow
def test_a_deck_that_is_not_there_hides_nothing_of_the_others(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = asked(capsys, "none.ic", "bad.ic", "good.ic")
    assert status == cli.BAD_INPUT and out.startswith("good.ic: ")
    assert "error[D173]: no deck `none.ic`" in err and "error[D060]" in err


@pytest.mark.slow
def test_programs_are_told_what_several_decks_have_in_common_once(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = asked(capsys, "bad.ic", "worse.ic", "--format", "json")
    found = json.loads(out)
    assert (status, err, found["errors"]) == (cli.BAD_INPUT, "", 3)
    assert [each["shown"]["file"] for each in found["diagnostics"]] == ["bad.ic", "part.ic", "worse.ic"]
    _, out, _ = asked(capsys, "bad.ic", "bad.ic", "--format", "json")
    assert json.loads(out)["errors"] == 2


@pytest.mark.release
def test_a_mistake_of_an_include_is_told_once_whatever_line_includes_it(capsys: pytest.CaptureFixture[str]) -> None:
    """Also through one more file, and in every form for programs; its place in a macro is the same mistake's, too."""
    part = PART.replace("recrod = [q];", "BAD").replace("#include <", "#define BAD recrod = [q];\n#include <")
    Path("part.ic").write_text(part, encoding="utf-8")
    Path("one.ic").write_text('#include "part.ic"\n', encoding="utf-8")
    Path("two.ic").write_text('// the part\n#include "part.ic"\n', encoding="utf-8")
    Path("three.ic").write_text('#include "one.ic"\n', encoding="utf-8")
    decks = ("one.ic", "two.ic", "three.ic")
    _, out, _ = asked(capsys, *decks, "--format", "json")
    assert [each["code"] for each in json.loads(out)["diagnostics"]] == ["D109"]
    _, out, _ = asked(capsys, *decks, "--format", "github")
    assert out.count("::error ") == 1
    _, out, _ = asked(capsys, *decks, "--format", "sarif")
    assert len(json.loads(out)["runs"][0]["results"]) == 1


@pytest.mark.slow
def test_the_edits_of_the_json_mend_the_deck(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = asked(capsys, "bad.ic", "--format", "json")
    for each in json.loads(out)["diagnostics"]:
        [edit] = each["edits"]
        assert each["help"][edit.pop("help")].endswith(("`2 s`", "`record`?"))
        file = Path(edit["file"])
        file.write_text(apply(Edit(**edit), file.read_text(encoding="utf-8")), encoding="utf-8")
    assert Path("bad.ic").read_text(encoding="utf-8") == BAD.replace("= 2;", "= 2 s;")
    assert Path("part.ic").read_text(encoding="utf-8") == PART.replace("recrod", "record")
    assert asked(capsys, "bad.ic")[0] == cli.YES


@pytest.mark.slow
def test_sarif_has_the_headings_of_the_codes_and_is_written_of_a_sound_deck_too(
    capsys: pytest.CaptureFixture[str],
) -> None:
    status, out, _ = asked(capsys, "bad.ic", "--format", "sarif")
    [run] = json.loads(out)["runs"]
    assert status == cli.BAD_INPUT and len(run["results"]) == 2
    assert [rule["shortDescription"]["text"] for rule in run["tool"]["driver"]["rules"]] == [
        "a bare number where there is a unit",
        "a key that no run has",
    ]
    status, out, _ = asked(capsys, "good.ic", "--format=sarif")
    results = json.loads(out)["runs"][0]["results"]
    assert status == cli.YES and [(each["ruleId"], each["level"]) for each in results] == [("D105", "warning")]


def test_a_mistake_of_usage_is_said_in_the_form_that_was_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = asked(capsys, "--format", "sarif")
    assert (status, err) == (cli.BAD_INPUT, "")
    assert json.loads(out)["runs"][0]["results"][0]["ruleId"] == "U001"
    status, out, err = asked(capsys, "none.ic", "--format", "github")
    assert (status, err) == (cli.BAD_INPUT, "") and out.startswith("::error title=D173::no deck `none.ic`%0Ahelp: ")


@pytest.mark.slow
def test_github_has_a_line_for_each_message(capsys: pytest.CaptureFixture[str]) -> None:
    assert asked(capsys, "bad.ic", "--format", "github") == (
        cli.BAD_INPUT,
        "::error file=bad.ic,line=2,endLine=2,col=36,endColumn=37,title=D060::"
        "`duration` of run `long` is in s, and this is a bare number%0Ahelp: write `2 s`\n"
        "::error file=part.ic,line=3,endLine=3,col=26,endColumn=32,title=D109::"
        "a run has no `recrod`%0Ahelp: did you mean `record`?%0Ahelp: a run has: arm, base, servos, initial, "
        "environment, rates, integrator, duration, record, tolerances, seed\n",
        "",
    )


def test_other_commands_have_no_such_forms(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["plan", "good.ic", "--format", "sarif"]) == cli.BAD_INPUT
    out, err = capsys.readouterr()
    assert out == "" and "Invalid value for '--format'" in err


ADDRESSES = {
    "run here like nominal { shoulder.servo.kp = 3 V*s/rad; }": "servos { shoulder { kp = 3 V*s/rad; } }",
    "run here like nominal { elbow.q = 3 deg; }": "initial { elbow.q = 3 deg; }",
    "run here like nominal { dynamics = 100 Hz; }": "rates { dynamics = 100 Hz; }",
    "arm here like two_link { links.upper.mass = 4 kg; }": "upper { mass = 4 kg; }",
}


@pytest.mark.release
@pytest.mark.parametrize("text", ADDRESSES)
def test_a_path_that_stands_as_an_entry_is_written_as_the_block_that_it_means(
    text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("path.ic").write_text(f"#include <two_link.ic>\n{text}\n", encoding="utf-8")
    _, out, _ = asked(capsys, "path.ic", "--format", "json")
    made = [edit for each in json.loads(out)["diagnostics"] for edit in each["edits"]]
    (edit,) = made
    assert edit["text"] == ADDRESSES[text] and edit.pop("help") == 0
    Path("path.ic").write_text(apply(Edit(**edit), Path("path.ic").read_text(encoding="utf-8")), encoding="utf-8")
    assert asked(capsys, "path.ic", "-q") == (cli.YES, "", "")
