"""What the commands print of motors on beds: a deck in, the text that a user reads out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from met import cli
from tests.ic.small_decks import ARM, RUN, SERVO

DECK = (
    ARM
    + SERVO
    + RUN
    + """\
default run hybrid like hold {
    substitute hinge {
        bed = emulated(faults = typical, kt = 0.06 N*m/A);
        law = torque_balance;
    }
}
sweep motors of hybrid { vary hinge.bed.inertia = [1e-4, 2e-4] kg*m^2;  vary hinge.law.band = [0.4, 0.5] rad/s; }
"""
)


@pytest.fixture(autouse=True)
def deck(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.ic").write_text(DECK, encoding="utf-8")


def printed(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert cli.main(list(words)) == 0
    return capsys.readouterr().out


def test_the_plan_tells_what_was_chosen_of_bed_and_law(capsys: pytest.CaptureFixture[str]) -> None:
    assert """

On a bed: the motor of hinge; what is not told here is the servo's, or the default
  hinge  bed  emulated        kt = 0.06 N*m/A, unevenness = 0.02, once = 0.002 N*m, twice = 0.001 N*m,
                              tachometer = 0.1 rad/s, converter_in = 0.1953125 rad/s,
                              converter_voltage = 0.009765625 V, converter_current = 0.00146484375 A
         law  torque_balance

Environment""" in printed(capsys, "plan", "a.ic")
    swept = printed(capsys, "plan", "a.ic", "motors")
    assert "kt = 0.06 N*m/A, inertia = 0.0001 to 0.0002 kg*m^2, unevenness" in swept
    assert "         law  torque_balance  band = 0.4 to 0.5 rad/s\n" in swept
    assert "On a bed" not in printed(capsys, "plan", "a.ic", "hold")


def test_a_plan_file_is_told_as_its_deck(capsys: pytest.CaptureFixture[str]) -> None:
    from_deck = printed(capsys, "plan", "a.ic")
    printed(capsys, "plan", "a.ic", "-o", "p.json")
    assert printed(capsys, "plan", "p.json") == from_deck


def test_the_model_of_a_deck_shows_the_block(capsys: pytest.CaptureFixture[str]) -> None:
    (at,) = (number for number, line in enumerate(DECK.splitlines(), 1) if "substitute" in line)
    assert f"""\
    substitute hinge {{    // a.ic:{at}:5
        bed = emulated {{    // a.ic:{at + 1}:9
            faults = typical    // a.ic:{at + 1}:24
            kt = 0.06 N*m/A    // a.ic:{at + 1}:42
        }}
        law = torque_balance    // a.ic:{at + 2}:9
    }}
""" in printed(capsys, "dump", "model", "a.ic")
    assert '"substitutions":[{"bed":"emulated","joint":"hinge","law":"torque_balance",' in printed(
        capsys, "dump", "plan", "a.ic"
    )


@pytest.mark.parametrize("kind", ["bed", "law"])
def test_models_of_beds_and_laws_can_be_asked_for(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    names = {
        "bed": ["emulated", "rate_drive", "torque_drive"],
        "law": ["bare", "measured_acceleration", "torque_balance", "torque_balance_observer", "velocity_tracking"],
    }[kind]
    lines = printed(capsys, "doc", f"{kind}s").splitlines()
    assert lines[0] == f"{kind}: substitute JOINT {{ {kind} = MODEL(...); ... }}, in a run"
    assert sorted(line.split()[0] for line in lines[1:] if line.startswith("  ")) == names
    assert not any(line.endswith("eq") for line in lines), "a sentence does not end with `eq.`"


def test_a_bed_tells_what_is_the_servos_and_which_words_its_faults_have(capsys: pytest.CaptureFixture[str]) -> None:
    rows = {line.split()[0]: line for line in printed(capsys, "doc", "emulated").splitlines() if line.startswith("  ")}
    assert "  the servo's  " in rows["kt"] and "  the servo's j_m  " in rows["inertia"]
    assert "  none  " in rows["faults"] and "  none | typical  " in rows["faults"] and "in quotes" not in rows["faults"]
    assert rows["load_current"].split() == ["load_current", "A", "current", "in", "the", "load", "motor"]
    (told,) = json.loads(printed(capsys, "doc", "emulated", "--format", "json"))
    faults = next(parameter for parameter in told["parameters"] if parameter["name"] == "faults")
    assert (faults["shape"], faults["words"]) == ("word", ["none", "typical"])


@pytest.mark.slow
@pytest.mark.parametrize(("path", "value", "note"), [
    ("hinge.bed.model", "emulated", ""),
    ("hinge.law.model", "torque_balance", ""),
    ("hinge.bed.faults", "typical", ""),
    ("hinge.bed.kt", 0.06, ""),
    ("hinge.bed.inertia", 1e-4, "that of `hinge.servo.j_m`"),
    ("hinge.bed.twice", 0.001, "by `faults`"),
    ("hinge.law.band", 0.5, ""),
])  # fmt: skip
def test_what_decides_a_bed_and_its_numbers_can_be_asked_for(
    path: str, value: object, note: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (told,) = json.loads(printed(capsys, "explain", "a.ic", path, "--format", "json"))
    assert (told["path"], told["value"], told["note"]) == (path, value, note)
