"""`met compile`: a module with its description, the bits of the archive that is run of it, and what is refused."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import xarray

from met import cli
from met.backends.wasm.module import KERNEL_JS

DECK = """\
#include <two_link.ic>
run brief like nominal {
    duration = 2 s;
    remove settle;
    record += [reaction.force];
    require volts < 20 V;
}
sweep tuned of brief { vary gearbox.kp = [0.005, 0.01, 0.02] V*s/rad; }
sweep ways of brief { vary integrator = [modified_euler, rk4]; }
"""


def met(*words: object) -> int:
    return cli.main([str(word) for word in words])


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "deck.ic").write_text(DECK, encoding="utf-8")
    return tmp_path


MARGINS = """\
#include <two_link.ic>
run held like nominal {
    duration = 0.4 s;  remove settle;
    linear loop { at = equilibrium();  open = shoulder.servo.voltage; }
    require phase_margin(loop) > 40 deg;
}
"""


@pytest.mark.slow
def test_a_module_says_which_metrics_it_does_not_compute(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "margins.ic").write_text(MARGINS, encoding="utf-8")
    assert met("compile", "margins.ic", "held") == 0
    assert "\n  not computed in it: loop_phase_margin, of linear answers\n" in capsys.readouterr().out
    told = json.loads((folder / "held.json").read_text())
    assert told["not_computed"] == [{"name": "loop_phase_margin", "unit": "rad"}]
    assert "loop_phase_margin" not in [each["name"] for each in told["metrics"]]


@pytest.mark.slow
def test_a_module_and_its_description_belong_together(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert met("compile", "deck.ic", "tuned") == 0
    said = re.sub(r"\([\d.]+ KiB\)", "(SIZE)", capsys.readouterr().out)
    assert said == (
        "tuned.wasm  (SIZE)  1 input, 13 recorded numbers, 1 metric\n"
        "tuned.json  (SIZE)\n"
    )  # fmt: skip
    module, told = (folder / "tuned.wasm").read_bytes(), json.loads((folder / "tuned.json").read_text())
    assert told["format"] == "met module 1" and told["name"] == "tuned"
    assert told["kernel"]["module"] == hashlib.sha256(module).hexdigest()
    assert told["inputs"] == [{"name": "gearbox.kp", "is": "coordinate", "unit": "V*s/rad", "scale": 1.0}]
    assert told["cases"] == {"count": 3, "inputs": [[0.005], [0.01], [0.02]]}
    columns = {each["channel"]: (each["signal"], each["unit"]) for each in told["columns"]}
    assert len(columns) == told["kernel"]["columns"] == 13
    assert columns["shoulder.qd"] == ("qd", "rad/s") and columns["elbow.reaction.force.z"] == ("reaction.force", "N")
    assert [each["name"] for each in told["metrics"]] == ["volts"]
    assert told["kernel"]["outputs"][told["metrics"][0]["output"]] == "metric:volts"
    assert told["requirements"] == [
        {"text": "volts < 20 V", "metric": "volts", "comparison": "<", "limit": 20.0}
    ]  # fmt: skip
    assert met("compile", "deck.ic", "tuned", "-q") == 0  # over its own
    assert (folder / "tuned.wasm").read_bytes() == module


@pytest.mark.release
def test_an_archive_and_a_plan_give_the_module_of_their_deck(folder: Path) -> None:
    assert met("compile", "deck.ic", "tuned", "-q") == 0
    assert met("run", "deck.ic", "tuned", "-q", "--no-picture") == 0
    assert met("plan", "deck.ic", "tuned", "-q", "-o", "plan.json") == 0
    for source in ("deck.tuned.h5", "plan.json"):
        assert met("compile", source, "-q", "-o", "again.wasm") == 0
        for ending in (".wasm", ".json"):
            assert (folder / f"again{ending}").read_bytes() == (folder / f"tuned{ending}").read_bytes()


SCRIPT = """
const { readFileSync, writeFileSync } = require("fs");
const METKernel = require(process.argv[2]);
const told = JSON.parse(readFileSync("tuned.json"));
const kernel = METKernel.make(new Uint8Array(readFileSync("tuned.wasm")), told.kernel);
const { rows, outputs } = kernel.run(told.cases.inputs, told.ticks);
writeFileSync("rows", rows);
writeFileSync("outputs", outputs);
"""


@pytest.mark.node
def test_the_files_alone_give_an_archives_numbers_bit_for_bit(folder: Path) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node; on Debian or Ubuntu: apt-get install nodejs")
    assert met("compile", "deck.ic", "tuned", "-q") == 0
    assert met("run", "deck.ic", "tuned", "-q", "--no-picture") == 0
    (folder / "run.js").write_text(SCRIPT)
    subprocess.run([node, "run.js", str(KERNEL_JS)], check=True)
    told = json.loads((folder / "tuned.json").read_text())
    rows = np.frombuffer((folder / "rows").read_bytes()).reshape(3, told["rows"], -1)
    outputs = np.frombuffer((folder / "outputs").read_bytes()).reshape(3, -1)
    with xarray.open_dataset("deck.tuned.h5") as data:
        signals = {name: data[name].values.reshape(3, told["rows"], -1) for name in ("q", "qd", "reaction.force")}
        for name, values in signals.items():
            places = [n for n, each in enumerate(told["columns"]) if each["signal"] == name]
            assert rows[..., places].tobytes() == values.tobytes(), name
        assert outputs[:, told["metrics"][0]["output"]].tobytes() == data["volts"].values.tobytes()


def test_what_met_did_not_write_is_not_written_over(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "tuned.json").write_text('{"mine": 1}')
    assert met("compile", "deck.ic", "tuned") == 2
    assert (
        "error[E470]: tuned.json exists and was not written by `met compile`: it is not written over\n"
        " = help: give another name with `-o`, or remove the file\n"
    ) in capsys.readouterr().err
    assert not (folder / "tuned.wasm").exists()


@pytest.mark.parametrize(
    ("place", "file"), [(".", "module.wasm"), ("/", "/module.wasm"), ("new.fmu", "new.fmu/arm.fmu")]
)
def test_a_folder_is_no_place_for_a_module(
    folder: Path, capsys: pytest.CaptureFixture[str], place: str, file: str
) -> None:
    (folder / "new.fmu").mkdir()
    assert met("compile", "deck.ic", "tuned", "-o", place) == 2
    assert capsys.readouterr().err == (
        f"error[E470]: cannot write {place}: it is a folder\n = help: name a file in it: `-o {file}`\n\n1 error\n"
    )


@pytest.mark.slow
def test_a_sweep_of_several_structures_has_no_one_module(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert met("compile", "deck.ic", "ways") == 2
    assert (
        "error[E472]: `ways` has 2 structures, and a module or an FMU is of one\n"
        " = help: `met plan deck.ic ways -o plan.json`, then `met compile plan.json GROUP`: "
        "ways.modified_euler, ways.rk4\n"
    ) in capsys.readouterr().err
    assert met("compile", "deck.ic", "ways", "-o", "arm.fmu") == 2
    assert "`met compile plan.json GROUP -o arm.fmu`: ways.mod" in capsys.readouterr().err
    assert met("plan", "deck.ic", "ways", "-q", "-o", "plan.json") == 0
    assert met("compile", "plan.json") == 2
    assert " = help: name a group: ways.modified_euler, ways.rk4\n" in capsys.readouterr().err
    assert met("compile", "plan.json", "ways.rk4", "-q") == 0
    assert json.loads((folder / "ways.rk4.json").read_text())["name"] == "ways.rk4"
    assert met("plan", "deck.ic", "--all", "-q", "-o", "plan.json") == 0
    assert met("compile", "plan.json") == 2
    assert "error[E472]: plan.json has " in capsys.readouterr().err
