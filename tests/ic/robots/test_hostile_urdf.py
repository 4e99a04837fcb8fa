"""Broken and hostile URDF files end in a diagnostic, soon and in little memory, and never in anything else."""

from __future__ import annotations

import random
import tracemalloc
from pathlib import Path

import pytest

from ic.robots.entries import arm_entries
from ic.robots.urdf import read
from met.diagnostic import Problem
from met.messages.render import render
from tests.ic.robots.test_arms_from_urdf import RICH
from tests.ic.robots.two import TWO, check
from tests.oracles.random_urdf import random_urdf

SEED = 7
BITS = ("", " ", '"', "<", ">", "/", "&", "=", "-", "nan", "1e999", "\n", "é", "<a>", "<origin/>", "\u0000")
LOLS = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10 if i else "lol"}">' for i in range(12))
HOSTILE = {
    "an entity that expands without end": f"<!DOCTYPE a [{LOLS}]><robot>&l11;</robot>",
    "a file of this machine": '<!DOCTYPE robot [<!ENTITY f SYSTEM "file:///etc/hostname">]><robot name="&f;"/>',
    "elements without end": "<robot>" + "<link name='a'/>" * 400_000,
    "depth without end": "<robot>" * 500_000,
    "a name without end": f"<robot name='{'x' * 4_000_000}'/>",
    "a number without end": TWO.replace('"2"', f'"{"9" * 1_000_000}"'),
    "an attribute without end": f"<robot {'a' * 4_000_000}",
    "links of one name": "<robot>" + "<link name='a'/>" * 900 + "</robot>",
    "spaces": " " * 8_000_000,
    "an open comment": "<robot><!--" + "-" * 4_000_000,
    "attributes": "<robot " + " ".join(f"a{i}=''" for i in range(100_000)) + "/>",
    "a chain without end": "<robot>" + "".join(
        f"<link name='l{i}'/><joint name='j{i}' type='fixed'><parent link='l{i - 1}'/><child link='l{i}'/></joint>"
        for i in range(10_000)) + "</robot>",
}  # fmt: skip

LONGEST = (
    "<robot><link name='l0'/>"
    + "".join(
        f"<link name='l{i}'/><joint name='j{i}' type='revolute'><parent link='l{i - 1}'/><child link='l{i}'/></joint>"
        for i in range(1, 1_000)
    )
    + "</robot>"
)


def outcome(text: str) -> str | None:
    """The codes of what is said, None where the file is a robot."""
    try:
        arm_entries(read("a.urdf", text))
    except Problem as problem:
        assert render(problem.diagnostics, {"a.urdf": text})
        return " ".join(sorted({diagnostic.code for diagnostic in problem.diagnostics}))
    return None


@pytest.mark.slow
@pytest.mark.parametrize("what", HOSTILE)
def test_a_hostile_file_ends_in_a_diagnostic_within_bounded_memory(what: str) -> None:
    tracemalloc.start()
    try:
        assert outcome(HOSTILE[what]) is not None
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 400e6


@pytest.mark.release
def test_the_longest_robot_that_is_read_is_told_of(tmp_path: Path) -> None:
    assert [each.code for each in check(tmp_path, LONGEST).diagnostics] == ["D217"]


def test_a_file_cut_anywhere_is_told() -> None:
    for end in range(len(TWO.rstrip())):
        assert outcome(TWO[:end]) is not None, end


@pytest.mark.release
def test_a_mutilated_file_is_a_robot_or_told_and_never_a_traceback() -> None:
    pick = random.Random(SEED)
    texts = [TWO, RICH, random_urdf(1), random_urdf(4)]
    seen = set()
    for _ in range(3000):
        text = pick.choice(texts)
        for _ in range(pick.randint(1, 4)):
            at, length = pick.randrange(len(text)), pick.randint(0, 20)
            other = pick.choice(BITS)
            at_other = pick.randrange(len(text))
            piece = pick.choice([other, text[at_other : at_other + length]])
            text = text[:at] + piece + text[at + length :]
        seen.add(outcome(text))
    assert {None, "D200", "D205", "D206", "D207", "D208"} <= seen, (SEED, seen)
