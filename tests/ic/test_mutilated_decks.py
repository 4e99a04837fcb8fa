"""Decks with words changed, dropped, added or swapped end in diagnostics: never in a traceback, never in a hang."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

import ic

DECKS = Path(ic.__file__).parent / "decks"
TEXT = (DECKS / "two_link.ic").read_text() + (DECKS / "servos" / "rigid_gearbox.ic").read_text().replace(
    "#pragma once", ""
).replace("servo rigid_gearbox", "servo again")
WORDS = re.findall(r"//[^\n]*\n|[A-Za-z_]\w*|\d[\d.e-]*|\s+|.", TEXT)
STRANGE = """
shape inertia com sphere table step ramp pulse sine times values remove like gravity 1e308 -1 0 1e-308 [ ] rpm m s
zip vary joint_damping base none substitute sample linspace logspace ^ += and or not - + * / fixed prismatic continuous
seed on off link joint record servos
"""
OTHERS = sorted({word for word in WORDS if word.strip() and not word.startswith("//")} | set(STRANGE.split()))


def kind(word: str) -> tuple[bool, bool]:
    return word[0].isalpha() or word[0] == "_", word[0].isdigit()


def mutilated(seed: int) -> str:
    pick, words = random.Random(seed), list(WORDS)
    in_kind = pick.random() < 0.5
    for _ in range(pick.choice([1, 1, 2, 3, 6])):
        i, how = pick.randrange(len(words)), pick.random()
        if not words[i].strip() or words[i].startswith("//"):
            continue
        if in_kind:
            words[i] = pick.choice([word for word in OTHERS if kind(word) == kind(words[i])])
        elif how < 0.35:
            words[i] = pick.choice(OTHERS)
        elif how < 0.5:
            words[i] = ""
        elif how < 0.75:
            words[i] += f" {pick.choice(OTHERS)} "
        else:
            j = pick.randrange(len(words))
            if words[j].strip() and not words[j].startswith("//"):
                words[i], words[j] = words[j], words[i]
    return "".join(words)


def check(folder: Path, seed: int) -> None:
    deck = folder / "deck.ic"
    deck.write_text(mutilated(seed))
    compiled = ic.check(deck, select="all")
    errors = [d for d in compiled.diagnostics if d.severity == "error"]
    assert (compiled.plan is None) == bool(errors), seed
    assert all(d.at is not None for d in errors), (seed, errors)


@pytest.mark.release
@pytest.mark.parametrize("first", range(0, 200, 20))
def test_a_mutilated_deck_ends_in_placed_diagnostics(tmp_path: Path, first: int) -> None:
    for seed in range(first, first + 20):
        check(tmp_path, seed)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(1000, 1300, 100))
def test_hundreds_of_mutilated_decks_end_in_placed_diagnostics(tmp_path: Path, first: int) -> None:
    for seed in range(first, first + 100):
        check(tmp_path, seed)


def test_a_rate_of_zero_is_one_diagnostic(tmp_path: Path) -> None:
    deck = tmp_path / "deck.ic"
    deck.write_text("#include <two_link.ic>\nrun r like nominal { rates { record = 0 Hz; } }\n")
    assert [d.code for d in ic.check(deck, select="all").diagnostics] == ["D077"]
