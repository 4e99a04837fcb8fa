"""`met compile -o FILE.fmu`: its words, the archive that it writes, and what it refuses; without a compiler."""

from __future__ import annotations

import json
import re
import zipfile
from pathlib import Path

import pytest

from met import cli
from met.version import VERSION
from tests.batch.fmu.arms import SHORT

MARGIN = """
run held like nominal {
    duration = 0.4 s;  remove settle;
    linear loop { at = equilibrium();  open = shoulder.servo.voltage; }
    require phase_margin(loop) > 40 deg;
}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("batch.fmu.package.shutil.which", lambda name: None)
    (tmp_path / "deck.ic").write_text(SHORT + MARGIN, encoding="utf-8")
    return tmp_path


@pytest.mark.slow
def test_an_fmu_without_a_binary_has_its_sources_and_says_so(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["compile", "deck.ic", "tuned", "-o", "arm.fmu"]) == 0
    out, err = capsys.readouterr()
    assert re.sub(r"\([\d.]+ KiB\)", "(SIZE)", out) == (
        "arm.fmu  (SIZE)  2 parameters, 2 inputs, 10 outputs\n  C sources alone\n"
    )
    assert err == "no binary in arm.fmu: there is no C compiler `cc` here\n"
    with zipfile.ZipFile("arm.fmu") as archive:
        assert archive.namelist() == [
            "modelDescription.xml", "documentation/index.html", "documentation/licenses/license.txt",
            "sources/buildDescription.xml", "sources/CMakeLists.txt", "sources/model.h", "sources/fmu.h",
            "sources/fmi3.c",
        ]  # fmt: skip
        text = archive.read("modelDescription.xml").decode()
        token = re.search(r'instantiationToken="(\w+)"', text)
        assert token is not None and f'"{token[1]}"' in archive.read("sources/model.h").decode()
        assert f'generationTool="MET {VERSION}"' in text
        assert 'description="Ticks of 0.005 s from the start. Inputs act from the tick at which they are set. ' in text
        assert 'fixedInternalStepSize="0.02"' in text and 'stopTime="2.0" stepSize="0.04"' in text
    data = (folder / "arm.fmu").read_bytes()
    assert cli.main(["compile", "deck.ic", "tuned", "-o", "arm.fmu", "-q"]) == 0  # over its own
    assert (folder / "arm.fmu").read_bytes() == data


def test_json_tells_what_an_fmu_has(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["compile", "deck.ic", "held", "-o", "held.fmu", "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "fmu": "held.fmu", "fmi": "3.0", "platform": None, "parameters": 0, "inputs": 0, "outputs": 7,
        "not_computed": ["loop_phase_margin"],
    }  # fmt: skip


def test_fmi_2_is_chosen_for_an_fmu_alone(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["compile", "deck.ic", "held", "-o", "held.fmu", "--fmi", "2", "-q"]) == 0
    with zipfile.ZipFile("held.fmu") as archive:
        assert '<fmiModelDescription fmiVersion="2.0" ' in archive.read("modelDescription.xml").decode()
        assert [name for name in archive.namelist() if name.startswith("sources/fmi")] == ["sources/fmi2.c"]
        assert "add_library(fmu SHARED fmi2.c)" in archive.read("sources/CMakeLists.txt").decode()
    capsys.readouterr()
    for words in ([], ["-o", "held.wasm"]):
        assert cli.main(["compile", "deck.ic", "held", "--fmi", "2", *words]) == 2
        assert capsys.readouterr().err.endswith("Error: --fmi is for FMUs: `-o FILE.fmu` writes one\n")


LETS = """
let time = 2;
let half = 0.01 V*s/rad;
run scaled like nominal {
    duration = 2 s;  remove settle;
    servos { shoulder = gearbox { kp = 2 * half;  command = rate(slow * time); }; }
}
sweep lets of scaled { zip { time = [200, 300] %;  slow = [1, 2] deg/s;  half = [0.01, 0.02] V*s/rad; } }
"""


def test_bounds_of_a_model_hold_for_its_own_numbers_and_not_for_what_they_are_computed_from(folder: Path) -> None:
    (folder / "lets.ic").write_text("#include <two_link.ic>\n" + LETS, encoding="utf-8")
    assert cli.main(["compile", "lets.ic", "lets", "-o", "lets.fmu", "-q"]) == 0
    with zipfile.ZipFile("lets.fmu") as archive:
        text = archive.read("modelDescription.xml").decode()
    variables = [line.strip() for line in text.splitlines() if "<Float64 name=" in line][:4]
    assert [re.sub(r' (description|valueReference)="[^"]*"', "", line) for line in variables] == [
        '<Float64 name="time" causality="independent" variability="continuous" unit="s"/>',
        '<Float64 name="half" causality="parameter" variability="fixed" unit="V.s/rad" start="0.01"/>',
        '<Float64 name="coordinates.time" causality="input" variability="continuous" start="2.0"/>',
        '<Float64 name="slow" causality="input" variability="continuous" unit="rad/s" displayUnit="deg/s" '
        'start="0.017453292519943295"/>',
    ]  # fmt: skip


@pytest.mark.parametrize("content", [b"mine", b"PK\x03\x04" + bytes(99)])
def test_what_is_no_fmu_of_met_is_not_written_over(
    folder: Path, capsys: pytest.CaptureFixture[str], content: bytes
) -> None:
    (folder / "arm.fmu").write_bytes(content)
    assert cli.main(["compile", "deck.ic", "tuned", "-o", "arm.fmu"]) == 2
    assert (
        "error[E470]: arm.fmu exists and was not written by `met compile`: it is not written over\n"
    ) in capsys.readouterr().err
    assert (folder / "arm.fmu").read_bytes() == content
