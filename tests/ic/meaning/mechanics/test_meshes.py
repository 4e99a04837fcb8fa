"""`mesh` of a link: files in their places, mistakes, and files that are not there, which cost a warning alone."""

from __future__ import annotations

from pathlib import Path

import pytest

import ic
from ic.driver.compile import compile_deck
from ic.read import read
from met.messages.render import render
from met.plan import Mesh

DECK = """\
let half = 0.5 m;
arm one {{
    link bar {{ mass = 1 kg;  shape = rod(length = 1 m, along = x);  {mesh} }}
    joint hinge revolute {{ parent = base;  child = bar;  axis = z; }}
}}
servo held {{ model = ideal;  bandwidth = 20 1/s;  command = position(0 rad); }}
default run hold {{
    arm = one;  servos {{ hinge = held; }}
    rates {{ dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }}
    duration = 0.1 s;  record = [q];
}}
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.stl").write_bytes(b"abc")
    return tmp_path


ABC = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
"""SHA-256 of "abc", FIPS 180-2, appendix B.1."""


def meshes(text: str, more: str = "") -> tuple[Mesh, ...]:
    (hold, *_) = ic.compile(text=DECK.format(mesh=text) + more).experiments
    return hold.structure.links[0].meshes


def messages(text: str, more: str = "") -> str:
    Path("deck.ic").write_text(DECK.format(mesh=text) + more, encoding="utf-8")
    done = compile_deck(read("deck.ic"), select="all")
    return render(done.diagnostics, done.sources)


def test_a_mesh_is_a_file_with_its_digest_and_its_place() -> None:
    assert meshes('mesh = "a.stl";') == (Mesh("a.stl", ABC),)
    turned = 'mesh = placed("a.stl", at = [half, 0 m, 1 m], rpy = [0, 0, 180] deg, scale = [0.001, 0.001, -0.001]);'
    (mesh,) = meshes(turned)
    assert (mesh.at, mesh.scale) == ((0.5, 0.0, 1.0), (0.001, 0.001, -0.001))
    assert mesh.rpy == pytest.approx((0.0, 0.0, 3.141592653589793))


def test_several_meshes_stand_in_a_list_and_may_be_appended() -> None:
    assert len(meshes('mesh = ["a.stl", placed("a.stl", at = [1, 0, 0] m)];')) == 2
    other = 'arm two like one { bar { mesh += ["a.stl"]; } }\nrun other like hold { arm = two; }\n'
    plan = ic.compile(text=DECK.format(mesh='mesh = ["a.stl"];') + other, select="all")
    assert [len(experiment.structure.links[0].meshes) for experiment in plan.experiments] == [1, 2]


def test_an_arm_like_another_has_its_meshes_unless_it_removes_them() -> None:
    other = "arm two like one { bar { remove mesh; } }\nrun other like hold { arm = two; }\n"
    plan = ic.compile(text=DECK.format(mesh='mesh = "a.stl";') + other, select="all")
    assert [experiment.structure.links[0].meshes for experiment in plan.experiments] == [(Mesh("a.stl", ABC),), ()]


def test_a_file_that_is_not_there_costs_a_warning() -> None:
    assert messages('mesh = "b.stl";') == (
        'warning[D219]: cannot find "b.stl"\n'
        " --> deck.ic:3:76\n"
        "  |\n"
        '3 |     link bar { mass = 1 kg;  shape = rod(length = 1 m, along = x);  mesh = "b.stl"; }\n'
        "  |                                                                            ^^^^^^^\n"
        "  = help: did you mean `a.stl`?\n"
        "  = help: looked in `.`, the standard library\n"
        "  = help: link `bar` is drawn without it\n"
        "\n"
        "1 warning\n"
    )
    assert meshes('mesh = "b.stl";') == (Mesh("b.stl"),)


def test_a_folder_of_that_name_costs_a_warning(folder: Path) -> None:
    (folder / "c.stl").mkdir()
    assert "warning[D219]: cannot read `c.stl`" in messages('mesh = "c.stl";')


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("mesh = 3;", "error[D076]: `mesh` of link `bar` is the name of a file, in quotes"),
        ("mesh = a.stl;", "error[D076]: `mesh` of link `bar` is the name of a file, in quotes"),
        ('mesh = turned("a.stl");', "error[D076]: `mesh` of link `bar` is the name of a file, in quotes"),
        ('mesh = placed("a.stl", "b.stl");', "error[D076]: `mesh` of link `bar` is the name of a file, in quotes"),
        ('mesh = ["a.stl", 3];', "error[D076]: `mesh` of link `bar` is the name of a file, in quotes"),
        ('mesh = placed("a.stl", att = [0, 0, 1] m);', "no `att`"),
        ('mesh = placed("a.stl", at = [0, 0, 1]);', "error[D060]"),
        ('mesh = placed("a.stl", scale = 0.001);', "error[D071]"),
    ],
)
def test_mistakes_have_a_message(written: str, message: str) -> None:
    assert message in messages(written)


def test_a_place_does_not_vary() -> None:
    text = messages('mesh = placed("a.stl", at = [half, 0 m, 0 m]);', "sweep s of hold { vary half = [0, 1] m; }\n")
    assert "error[D122]: `at` of a mesh of link `bar` varies with the sweep" in text
