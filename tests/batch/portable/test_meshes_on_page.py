"""Links drawn by their meshes on pages: in the place of their shapes, with a switch, and as shapes without WebGL."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import batch
import ic
from met import cli
from tests.batch.arms.solids import binary_stl, box, obj
from tests.batch.portable.test_arm_on_page import opened, pixels
from tests.batch.report.browser import Chromium, browser, browser_or_skip, quiet

DECK = """\
arm two {
    link base  { mass = 0 kg;  mesh = "box.obj"; }
    link bar   { mass = 1 kg;  shape = rod(length = 1 m, along = x);  mesh = "box.stl"; }
    link plain { mass = 1 kg;  shape = box(size = [0.3, 0.1, 0.1] m);  mesh = "gone.stl"; }
    joint hinge revolute { parent = base;  child = bar;  at = [0, 0, 0.2] m;  axis = y; }
    joint wrist revolute { parent = bar;  child = plain;  at = [1, 0, 0] m;  axis = z; }
}
servo held { model = ideal;  bandwidth = 20 1/s;  command = position(0.5 rad); }
default run hold {
    arm = two;  servos { hinge = held;  wrist = held; }
    rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    duration = 0.5 s;  record = [q];
}
sweep both of hold { vary links.bar.mass = [1, 2] kg; }
"""
SAID = "meshes of 2 links: 24 triangles, 0.3 kB; link plain without its mesh: gone.stl {}".format(
    "was not there when the deck was read"
)


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("meshed")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        Path("box.stl").write_bytes(binary_stl(box((1.0, 0.2, 0.4))))
        Path("box.obj").write_bytes(obj(box((0.3, 0.3, 0.2))))
        Path("deck.ic").write_text(DECK, encoding="utf-8")
        batch.run(ic.compile("deck.ic", select=["both"]), output="a.h5")
        yield folder


webgl = pytest.fixture(scope="module")(browser_or_skip)


def written(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[str, str]:
    """The page that a command writes, and what it says on stderr."""
    page = f"{words[0]}.html"
    assert cli.main([*words, "-o", page]) == 0
    return Path(page).read_text(encoding="utf-8"), capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("command", ["view", "report"])
def test_a_page_has_the_meshes_once_and_the_command_says_which(
    pages: Path, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    meshed, told = written(capsys, command, "a.h5")
    assert f"note: {SAID}\n" in told
    assert meshed.count('"edge":') == 2 and SAID in meshed
    plain, told = written(capsys, command, "a.h5", "--no-meshes")
    assert "meshes of" not in told and "meshes of 2 links" not in plain and '"edge":' not in plain
    assert 0 < len(meshed) - len(plain) < 2000


@pytest.mark.slow
def test_a_deck_that_is_watched_has_a_switch_instead(pages: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["view", "deck.ic", "--no-meshes"]) == 2
    assert "--no-meshes is for archives: the page of a deck has a switch for meshes" in capsys.readouterr().err


@pytest.mark.slow
def test_links_are_drawn_by_meshes_until_they_are_switched_off(pages: Path, webgl: Chromium) -> None:
    assert cli.main(["view", "a.h5", "-q"]) == 0
    page = opened(webgl, pages / "a.view.html")
    assert page.run("MET.shown.kept().meshed") is True
    assert SAID in page.run("document.querySelector('main').textContent")
    meshed = pixels(page, pages)
    page.run("document.querySelector('.view').focus()")
    page.key("m")
    assert page.run("MET.shown.kept().meshed") is False
    plain = pixels(page, pages)
    assert np.abs(meshed - plain).max() > 0.2 and (np.abs(meshed - plain).max(axis=2) > 0.05).mean() > 0.01
    page.key("m")
    np.testing.assert_allclose(pixels(page, pages), meshed, atol=0.02)
    quiet(page)


@pytest.mark.slow
def test_without_webgl_links_are_drawn_by_their_shapes(pages: Path) -> None:
    assert cli.main(["view", "a.h5", "-q"]) == 0
    with browser(webgl=False) as flat:
        page = opened(flat, pages / "a.view.html")
        assert page.run("MET.shown.drawsBy()") == "svg"
        assert len(re.findall("<path", page.run("document.querySelector('.paper').innerHTML"))) < 200
        quiet(page)
