"""What the declaration of the deck language says is what the compiler takes, and what `met doc` prints."""

from __future__ import annotations

import json

import pytest

import ic
from ic.language import BLOCKS, DEFINITIONS, HEADS, BlockDeclaration, Entry, choices
from met import cli
from met.plan import Experiment
from tests.ic.small_decks import ARM, RUN, SERVO

ENTRIES = [(block, entry) for block in BLOCKS.values() for entry in block.entries]


def named(value: tuple[BlockDeclaration, Entry]) -> str:
    return f"{value[0].name}-{value[1].name}"


@pytest.mark.parametrize("name", BLOCKS)
def test_every_block_has_a_page(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["doc", name]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert out.startswith(f"{name}: ")
    for entry in BLOCKS[name].entries:
        assert " ".join(entry.written.split()) in out


@pytest.mark.parametrize("name", ["run", "joint", "payload", "sweep", "substitute"])
def test_programs_are_told_the_same(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["doc", name, "--format", "json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [each["name"] for each in told] == [entry.name for entry in BLOCKS[name].entries]
    assert {each["varies"] for each in told} <= {"number", "choice", "never"}


@pytest.mark.parametrize("of", ENTRIES, ids=named)
def test_an_entry_is_declared_whole(of: tuple[BlockDeclaration, Entry]) -> None:
    block, entry = of
    assert entry.doc and entry.default and entry.written.startswith(entry.name.split()[0])
    assert (entry.varies == "never") or entry.path
    assert [each.name for each in block.entries].count(entry.name) == 1
    if entry.varies == "number":
        assert entry.parameter is not None or entry.name in ("q", "qd")


LIMITED = ARM.replace("axis = z;", "axis = z; q_min = -9 rad; q_max = 9 rad; qd_max = 9 rad/s; tau_max = 99 N*m;")
FOLLOWED = (
    LIMITED.removesuffix("}\n")
    + """\
    link led { mass = 1 kg;  shape = sphere(radius = 1 cm); }
    joint after revolute { parent = base;  child = led;  axis = z;  follows = hinge; }
}
"""
)
"""The arm with everything that its joints may have."""


def experiment(more: str = "") -> Experiment:
    return ic.compile(text=FOLLOWED + SERVO + RUN + more, select=["hold"]).experiments[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    "of", [each for each in ENTRIES if each[1].varies == "number" and each[0].name in ("link", "joint")], ids=named
)
def test_numbers_of_arms_vary_by_their_declared_paths(of: tuple[BlockDeclaration, Entry]) -> None:
    _, entry = of
    known = experiment().parameters
    structure = experiment().structure
    head = entry.path.replace("LINK", structure.links[0].name).replace(
        "JOINT", structure.moving[entry.name in ("ratio", "offset")].name
    )
    path = next(each for each in known if each == head or each.startswith(f"{head}."))
    value = known[path].value
    assert isinstance(value, float)
    written = f"{value!r} {known[path].unit}".removesuffix(" 1")
    sweep = f"sweep some of hold {{ vary {path} = [{written}]; }}"
    # one value in the place of itself; of some, such as the place of a hinge at the origin, nothing here depends
    told = ic.check(text=FOLLOWED + SERVO + RUN + sweep, select=["some"]).diagnostics
    assert {each.code for each in told if each.severity == "error"} <= {"D137"}


def test_paths_begin_with_what_is_declared() -> None:
    heads = {path.partition(".")[0] for path in experiment().parameters}
    joints = {joint.name for joint in experiment().structure.joints}
    assert heads - joints <= set(HEADS)


def test_what_decides_the_program() -> None:
    assert set(choices("")) == {"arm", "base", "integrator", "duration"}
    assert set(choices("JOINT")) == {"servo", "bed", "law"}
    assert set(choices("SERVO")) == {"model", "command", "rate"}
    assert set(choices("rates")) == set(BLOCKS["rates"].keys)
    assert DEFINITIONS == ("arm", "servo", "run", "sweep", "search", "tune")
