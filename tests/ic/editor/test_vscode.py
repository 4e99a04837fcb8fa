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
from textmate import grammar
from vsix import FOLDER, files, main, package, vsix

from ic.language import BLOCKS
from met.host import interpreter

ROOT = Path(__file__).parents[3]
SCRIPT = ROOT / "scripts" / "vsix.py"
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
    done = subprocess.run([SCRIPT, target], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "") and f"code --install-extension {target}" in done.stdout
    with zipfile.ZipFile(target) as archive:
        assert archive.testzip() is None
        found = {name: archive.read(name) for name in archive.namelist()}
    described = json.loads(found["extension/package.json"])
    named = [described["main"], *(each["path"] for each in described["contributes"]["grammars"])]
    named += [each["configuration"] for each in described["contributes"]["languages"]]
    assert all(f"extension/{name.removeprefix('./')}" in found for name in named)
    assert json.loads(found["extension/met.tmLanguage.json"]) == grammar()
    assert vsix() == target.read_bytes(), "equal versions make equal bytes"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("mine.txt", "{} exists: it is not written over; give another name, or remove it\n"),
        ("none/met.vsix", "cannot write {}: No such file or directory\n"),
    ],
)
def test_a_package_is_a_new_file(tmp_path: Path, name: str, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    mine = tmp_path / "mine.txt"
    mine.write_text("what I wrote")
    assert main(tmp_path / name) == 2
    assert mine.read_text() == "what I wrote"
    assert capsys.readouterr() == ("", message.format(tmp_path / name))


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
