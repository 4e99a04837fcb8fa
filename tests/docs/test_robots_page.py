"""docs/robots.md is true: its file, deck and commands work as it says. Its last table: test_published_robots.py."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
import xarray

import ic
from ic.find import standard_decks
from ic.robots.robot import TYPES
from met import cli

PAGE = (Path(__file__).parents[2] / "docs" / "robots.md").read_text(encoding="utf-8")
FILES = dict(re.findall(r"<!-- (\S+) -->\n```\w+\n(.*?)```", PAGE, re.DOTALL))
COMMANDS = [line.partition("#")[0].strip() for line in re.findall(r"^    (met .*)$", PAGE, re.MULTILINE)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the page's files, in which all its commands have been run."""
    folder = tmp_path_factory.mktemp("robots")
    for name, text in FILES.items():
        (folder / name).write_text(text, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for command in COMMANDS:
            assert cli.main(shlex.split(command)[1:]) == 0, command
    return folder


@pytest.mark.slow
def test_the_imported_deck_holds_the_arm_and_lets_it_fall(folder: Path) -> None:
    assert set(FILES) == {"swing.urdf", "deck.ic"} and len(COMMANDS) == 6
    with xarray.open_dataset(folder / "swing.h5") as data:
        # 2 kg, half a metre out; the hinge's y points into the page, so weight turns it forward
        assert data["tau"].sel(joint="hinge").isel(time=-1) == pytest.approx(-9.81, rel=1e-12)
    with xarray.open_dataset(folder / "swing.fall.h5") as data:
        assert data["q"].sel(joint="hinge").isel(time=-1) > 0.5


@pytest.mark.slow
def test_the_deck_made_from_the_file_sweeps_what_hangs_on_it(folder: Path) -> None:
    with xarray.open_dataset(folder / "deck.loads.h5") as data:
        assert data["links.load.mass"].values.tolist() == [0.0, 0.5, 1.0]
        assert (data["status"] == 0).all()


@pytest.mark.slow
def test_explain_prints_the_files_line(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    (command,) = (each for each in COMMANDS if "explain" in each)
    assert cli.main(shlex.split(command)[1:]) == 0
    assert (
        capsys.readouterr().out
        == """\
links.bar.com.x = 0.5 m
 --> swing.urdf:5:20
  |
5 |       <origin xyz="0.5 0 0"/>
  |                    ^^^^^^^ written here
"""
    )


def test_every_type_of_joint_that_is_read_is_on_the_page() -> None:
    assert all(f"`{kind}`" in PAGE for kind in TYPES)


@pytest.mark.slow
def test_the_arms_that_come_with_met_are_those_and_have_these_joints_and_this_mass() -> None:
    section = PAGE.partition("## Arms that come with MET")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| `(\w+\.ic)` \| (\d+) \| ([\d.]+) \|", section, re.MULTILINE)
    assert sorted(deck for deck, _, _ in rows) == standard_decks()
    for deck, joints, mass in rows:
        made = ic.compile(deck).experiments[0]
        assert len(made.structure.straight.moving) == int(joints)
        held = {"base", *(j.child for j in made.structure.joints if j.parent == "base" and j.kind == "fixed")}
        moved = [link.name for link in made.structure.straight.links if link.name not in {*held, "load"}]
        weighed = sum(made.parameters[f"links.{name}.mass"].value for name in moved)
        assert weighed == pytest.approx(float(mass), abs=0.05)
