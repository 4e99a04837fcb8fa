"""Independent mistakes in one deck are all told at once, and nothing besides that follows from them."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.ic.fuzz.planted import decks, planted
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes

SEEDS = (1, 6, 10, 14)
"""Of `tests.ic.fuzz.planted`, with decks that told of half of their mistakes or less."""


@pytest.mark.release
@pytest.mark.parametrize("seed", SEEDS)
def test_a_dozen_mistakes_planted_in_a_standard_deck_are_all_told(tmp_path: Path, seed: int) -> None:
    rng = random.Random(seed)
    name, text = rng.choice(sorted(decks().items()))
    _, alone, together = planted(text, name, str(tmp_path), rng, rng.randint(12, 20))
    assert alone.total() >= 12
    assert together == alone


HIDING = {
    "duration": ("duration = 1 s;", "durations = 1 s;", "D109"), "no duration": ("duration = 1 s;", "", "D107"),
    "a bare duration": ("duration = 1 s;", "duration = 1;", "D060"), "servos": ("servos {", "servs {", "D109"),
    "arm": ("arm = swing;", "am = swing;", "D109"), "the arm's name": ("arm = swing;", "arm = swng;", "D041"),
    "the kind of definition": ("run hold {", "rnu hold {", "D045"), "rates": ("rates {", "rate {", "D109"),
    "a rate's unit": ("dynamics = 1 kHz", "dynamics = 1 s", "D061"),
    "no rate of the dynamics": ("dynamics = 1 kHz; ", "", "D117"), "default": ("run hold", "defalt run hold", "D045"),
    "the joint's kind": ("joint hinge revolute", "joint hinge revolut", "D090"),
    "the joint's word": ("joint hinge revolute", "jont hinge revolute", "D082"),
    "a bracket": ("record = [q];", "record = [q;", "D022"),
}  # fmt: skip


@pytest.mark.parametrize("name", HIDING)
def test_what_is_wrong_with_a_run_hides_no_mistake_in_its_metric(tmp_path: Path, name: str) -> None:
    right, wrong, code = HIDING[name]
    text = changed(ARM + SERVO + RUN, (right, wrong)).rstrip("}\n")
    metric = "\n    metric most = max { off = hinge.q; }\n    metric least = mni { of = hinge.q; }\n}\n"
    assert sorted(codes(tmp_path, text + metric, select="all")) == sorted([code, "D140", "D141"])


def test_a_misspelt_base_hides_no_mistake_in_what_is_like_it(tmp_path: Path) -> None:
    like = "run again like hodl { seed = 1 m; metric most = max { off = hinge.q; } }\n"
    more = "servo other like drve { kp = 3; }\nrun third like again { servos { hinge = other; } integrator = rk5; }\n"
    found = check(tmp_path, ARM, SERVO, RUN, like, more, select="all").diagnostics
    assert sorted(each.code for each in found) == ["D041", "D041", "D060", "D061", "D140", "D141"]


@pytest.mark.parametrize("name", ["agin", "hol"])
def test_a_base_that_is_meant_is_never_what_is_like_it(tmp_path: Path, name: str) -> None:
    more = f"run again like {name} {{ seed = 1; }}\nrun gain like again {{ seed = 2; }}\n"
    assert codes(tmp_path, ARM, SERVO, RUN, more, select="all") == ["D041"]


def test_an_entry_of_a_sweep_hides_no_other(tmp_path: Path) -> None:
    sweep = """\
sweep gains of hold {
    vary drive.kpp = [0.1, 0.2] V*s/rad;
    vary drive.ki = [1, 2] kg;
    vary links.bar.mass = [1, 2 m] kg;
    zip { drive.kt = [1, 2] N*m/A; drive.v_max = [1, 2, 3] V; }
    exclude when links.bar.mass > 3 m;
    exclude when drive.kp > 3 m;
    exclude when drive.nothing > 3;
    reepeat 3;
}
"""
    told = codes(tmp_path, ARM, SERVO, RUN, sweep, select="all")
    assert told == ["D128", "D061", "D062", "D135", "D063", "D065", "D136"]


def test_a_misspelt_macro_hides_nothing_outside_of_its_arm(tmp_path: Path) -> None:
    macro = "#define ROD(NAME, MASS) link NAME { mass = MASS; shape = rod(length = 1 m, along = x); }\n"
    arm = changed(ARM, ("    joint", "    RDO(more, 2 kg)\n    joint"))
    run = changed(RUN, ("record = [q];", "record = [q, qdx];"))
    assert codes(tmp_path, macro, arm, SERVO, run, select="all") == ["D022", "D125"]
