"""The extension for VS Code: a package that is whole, and a client that shows what the server says."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import pytest
from click.testing import CliRunner
from textmate import grammar

from batch.cli.lsp import lsp
from ic.editor.extension import FOLDER, files, package, vsix
from ic.language import BLOCKS
from met import cli
from met.host import interpreter

ROOT = Path(__file__).parents[3]
DECK = """\
#include <two_link.ic>
servo motor like gearbox { kp = 0.01 V*s/rad; }
run more like nominal {
    servos { elbow = motor; }
    duration = 5 s;
}
"""
ENDS = {"json", "js", "vsixmanifest"}


def test_a_package_has_all_that_it_names(tmp_path: Path) -> None:
    target = tmp_path / "met.vsix"
    done = CliRunner().invoke(lsp, ["--vscode", str(target)])
    assert done.exit_code == 0 and f"code --install-extension {target}" in done.output
    with zipfile.ZipFile(target) as archive:
        assert archive.testzip() is None
        found = {name: archive.read(name) for name in archive.namelist()}
    described = json.loads(found["extension/package.json"])
    named = [described["main"], *(each["path"] for each in described["contributes"]["grammars"])]
    named += [each["configuration"] for each in described["contributes"]["languages"]]
    assert all(f"extension/{name.removeprefix('./')}" in found for name in named)
    assert json.loads(found["extension/met.tmLanguage.json"]) == grammar()
    assert vsix() == target.read_bytes(), "equal versions make equal bytes"


def test_only_an_extension_of_met_is_written_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "met.vsix"
    assert cli.main(["lsp", "--vscode", str(target)]) == cli.main(["lsp", "--vscode", str(target)]) == 0
    foreign = tmp_path / "other.vsix"
    with zipfile.ZipFile(foreign, "w") as archive:
        archive.writestr("extension.vsixmanifest", '<Identity Id="other" Version="1"/>')
    mine = tmp_path / "mine.txt"
    mine.write_text("what I wrote")
    capsys.readouterr()
    for path in (mine, foreign):
        before = path.read_bytes()
        assert cli.main(["lsp", "--vscode", str(path)]) == 2
        assert path.read_bytes() == before
        assert capsys.readouterr() == (
            "",
            f"error[E305]: {path} exists and is no extension of MET: it is not written over\n"
            " = help: give another name with `--vscode`, or remove the file\n\n1 error\n",
        )
    assert cli.main(["lsp", "--vscode", str(tmp_path / "none" / "met.vsix")]) == 2
    assert "error[E305]: cannot write" in capsys.readouterr().err


def test_a_manifest_says_what_the_package_says() -> None:
    found, described = files(), package()
    space = "{http://schemas.microsoft.com/developer/vsx-schema/2011}"
    manifest = ET.fromstring(found["extension.vsixmanifest"])
    identity = manifest.find(f"{space}Metadata/{space}Identity")
    assert identity is not None
    assert {identity.get("Id"), identity.get("Publisher")} == {described["name"], described["publisher"]}
    assert identity.get("Version") == described["version"]
    assets = [each.get("Path") for each in manifest.iter(f"{space}Asset")]
    assert assets == ["extension/package.json"] and set(assets) <= set(found)
    types = ET.fromstring(found["[Content_Types].xml"])
    assert {each.get("Extension") for each in types} == {f".{end}" for end in ENDS}
    assert {name.rpartition(".")[2] for name in found} - {"xml"} == ENDS


def test_colours_and_messages_are_those_of_the_folder_without_a_client() -> None:
    other = json.loads((ROOT / "docs" / "editors" / "package.json").read_text())
    described = json.loads((FOLDER / "package.json").read_text())
    for kind in ("languages", "grammars", "problemMatchers"):
        assert described["contributes"][kind] == other["contributes"][kind]


@pytest.mark.node
@pytest.mark.skipif(shutil.which("node") is None, reason="the client is JavaScript: node runs it")
def test_the_client_shows_what_the_server_says(tmp_path: Path) -> None:
    deck, met = tmp_path / "arm.ic", tmp_path / "met"
    deck.write_text(DECK)
    met.write_text(f'#!/bin/sh\nexec {sys.executable} -P -m met.cli "$@"\n')
    met.chmod(0o755)
    stub = Path(__file__).with_name("vscode_stub.js")
    done = subprocess.run(
        ["node", str(stub), str(FOLDER / "extension.js"), str(deck), str(met)],
        env=interpreter.environment(),
        capture_output=True,
        text=True,
        timeout=240,
    )
    assert done.returncode == 0, done.stderr
    shown = json.loads(done.stdout)
    assert shown["diagnostics"] == {deck.as_uri(): []}
    assert {"ki", "ratio", "kp"} <= set(shown["completed"])
    assert BLOCKS["run"]["duration"].doc in shown["hovered"]
    assert shown["defined"] == [{"line": 1, "character": 6}] and shown["used"] == 2
    assert shown["symbols"] == ["motor", "more"] and [2, 4] in shown["folds"] and shown["laid"] == 0
    assert shown["coloured"] > 50 and shown["coloured"] % 5 == 0
    assert shown["named"] == "motor" and shown["renamed"] == 2 and shown["wrong"] == "`kg` is a unit"
    assert shown["lenses"] == ["1 case", "run"]
    assert shown["refreshed"] >= 2, "colours and lenses are asked for again once the deck's files are known"
    assert shown["terminals"] == [[str(met), "run", str(deck), "more"], [str(met), "run", str(deck)]]
