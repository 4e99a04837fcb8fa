"""Every deck of docs/loops.md has a plan, without a word, and the arms in two styles have the same plan."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from pathlib import Path

import pytest

import ic
from ic.formatting.formatter import formatted
from met.plan import Experiment
from met.plan.keys import structure_key
from tests.oracles.random_deck import random_loops

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "loops.md").read_text(encoding="utf-8")
DECKS = dict(re.findall(r"^<!-- (\S+) -->\n```c\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE))

JOIN = """\
#define LINK(n) link seg_##n { mass = 0.1 kg;  shape = rod(length = span, along = x); }
#define JOINT(p, n) joint j_##n revolute { parent = seg_##p;  child = seg_##n;  axis = y;  at = [span, 0 m, 0 m]; }
"""
DIGITS = "0123456789"


def lines(head: str, pieces: Sequence[str]) -> str:
    return f"#define {head} {' '.join(pieces)}\n"


def chain_of_macros() -> str:
    """The page's chain with macros of tens and hundreds in place of its loops."""
    tens = [f"d##{n}" for n in DIGITS]
    hundreds = [f"c##{n}" for n in DIGITS]
    steps = [f"JOINT({a}, {b})" for a, b in itertools.pairwise(tens)]
    made = JOIN + lines("LINKS_10(d)", [f"LINK({each})" for each in tens])
    made += lines("LINKS_100(c)", [f"LINKS_10({each})" for each in hundreds])
    made += lines("JOINTS_10(p, d)", ["JOINT(p, d##0)", *steps])
    before = ["p", *(f"c##{n}9" for n in DIGITS)]
    made += lines("JOINTS_100(p, c)", [f"JOINTS_10({a}, {b})" for a, b in zip(before, hundreds, strict=False)])
    links = [*(f"LINK({n})" for n in DIGITS), *(f"LINKS_10({n})" for n in DIGITS[1:])]
    links += [f"LINKS_100({n})" for n in DIGITS[1:5]]
    joints = [f"JOINT({n}, {n + 1})" for n in range(9)]
    joints += [f"JOINTS_10({10 * n - 1}, {n})" for n in range(1, 10)]
    joints += [f"JOINTS_100({100 * n - 1}, {n})" for n in range(1, 5)]
    arm = re.search(r"^arm chain \{\n.*?^\}\n", DECKS["chain.ic"], re.DOTALL | re.MULTILINE)
    first = re.search(r"joint j_0 .*", DECKS["chain.ic"])
    assert arm is not None and first is not None
    body = " ".join(links) + f"\n{first[0]}\n" + " ".join(joints)
    return made + DECKS["chain.ic"].replace(arm[0], f"arm chain {{\n{body}\n}}\n")


def experiment(folder: Path, name: str, text: str) -> Experiment:
    (folder / name).write_text(text, encoding="utf-8")
    compiled = ic.check(folder / name)
    assert compiled.diagnostics == () and compiled.plan is not None
    return compiled.plan.experiments[0]


def same(one: Experiment, other: Experiment) -> bool:
    """Whether two experiments are one to whoever runs them: structure, values and names, wherever these are written."""
    values = [
        {path: (quantity.value, quantity.unit) for path, quantity in each.parameters.items()} for each in (one, other)
    ]
    names = [[(joint.name, joint.parent, joint.child) for joint in each.structure.joints] for each in (one, other)]
    return (
        structure_key(one.structure) == structure_key(other.structure)
        and list(values[0].items()) == list(values[1].items())
        and names[0] == names[1]
    )


@pytest.mark.parametrize("name", [name for name in DECKS if name != "chain.ic"])
def test_a_deck_of_the_page_has_a_plan_and_no_message(tmp_path: Path, name: str) -> None:
    assert experiment(tmp_path, name, DECKS[name]).parameters


@pytest.mark.parametrize("name", DECKS)
def test_a_deck_of_the_page_is_laid_out(name: str) -> None:
    assert formatted(name, DECKS[name]) == DECKS[name]


def test_seven_joints_of_a_loop_are_those_of_a_list_of_macro_calls(tmp_path: Path) -> None:
    of_loop, of_macros = (experiment(tmp_path, name, DECKS[name]) for name in ("seven_loop.ic", "seven_macros.ic"))
    assert len(of_loop.structure.joints) == 7
    assert same(of_loop, of_macros)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_a_random_deck_of_loops_is_the_same_deck_without(tmp_path: Path, seed: int) -> None:
    one, other = (
        experiment(tmp_path, name, text) for name, text in zip(("a.ic", "b.ic"), random_loops(seed), strict=True)
    )
    assert same(one, other)
    assert one.requirements and [each.text for each in one.requirements] == [each.text for each in other.requirements]


@pytest.mark.release
def test_five_hundred_joints_of_ten_lines_are_those_of_macros(tmp_path: Path) -> None:
    assert DECKS["chain.ic"].count("\n") <= 10
    of_loop = experiment(tmp_path, "chain.ic", DECKS["chain.ic"])
    assert len(of_loop.structure.joints) == 500
    assert same(of_loop, experiment(tmp_path, "macros.ic", chain_of_macros()))


def test_a_message_in_a_loop_stands_as_well_as_one_in_a_macro(tmp_path: Path) -> None:
    """Place, cause, remedy and how it got there, of the same mistake in both."""
    told = []
    for name in ("seven_loop.ic", "seven_macros.ic"):
        wrong = DECKS[name].replace("along = x", "along = xx")
        (tmp_path / name).write_text(wrong, encoding="utf-8")
        told.append(ic.check(tmp_path / name).diagnostics)
    assert len(told[0]) == len(told[1]) == 1
    loop, macro = told[0][0], told[1][0]
    assert (loop.code, loop.message, loop.help) == (macro.code, macro.message, macro.help)
    assert (
        loop.at is not None
        and loop.at.place.iterations
        and [label.text for label in loop.also][-1:] == ["likewise where i = 2, 3, 4, 5 and 2 more"]
    )
