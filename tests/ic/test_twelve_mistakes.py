"""Mistakes of different stages are told in one run, and none of them is told of another: not even one of syntax."""

from __future__ import annotations

import pytest

import ic

DECK = """\
#include <servos/rigid_gearbox.ic>
#define HEAVY(MASS) mass = MASS

let reach = {0};
let slow  = 0.03 rad/s{1}

arm two_link {{
    link upper {{ mass = {2};  shape = rod(length = reach, along = x); }}
    link lower {{ mass = 20 kg;  {3} = rod(length = reach, along = x); }}
    link hook  {{ {12};  shape = sphere(radius = 1 cm); }}
    joint shoulder revolute {{ parent = base;  child = upper;  axis = z; }}
    joint elbow    revolute {{ parent = upper;  child = lower;  axis = {4};  at = [reach, 0 m, 0 m]; }}
    joint tip      fixed    {{ parent = lower;  child = hook;  at = {13} m; }}
}}

servo gearbox like rigid_gearbox {{ command = rate(slow);  kp = 3 {5}; }}
servo other like {6} {{ command = rate(slow); }}

default run nominal {{
    arm         = two_link;
    servos      {{ shoulder = gearbox;  elbow = {7}; }}
    environment {{ velocity_products = {8}; }}
    rates       {{ dynamics = 25 Hz;  servos = {9};  record = 25 Hz; }}
    duration    = 20 s;
    record      = [q, qd, tau];
    metric settle = settling_time {{ of = shoulder.qd;  target = slow;  band = {10}; }}
    require {11} < 10 s;
}}
"""
# right, wrong, and the code of what is said of it
MISTAKES = [
    ("2.0 m", "2.0 metre", "D028"), (";", "", "D021"), ("40 kg", "40 kgs", "D028"), ("shape", "shap", "D141"),
    ("z", "w", "D065"), ("V*s/rad", "m", "D061"), ("rigid_gearbox", "rigid_gearbx", "D041"),
    ("gearbox", "gearbx", "D041"), ("off", "offf", "D076"), ("100 Hz", "100", "D060"), ("2 %", "", "D020"),
    ("settle", "setle", "D132"), ("HEAVY(1 kg)", "HEAVY(1 kg, 2)", "D012"), ("[1, 0, 0]", "[1, 0 0]", "D024"),
]  # fmt: skip


def told(wrong: set[int]) -> list[tuple[str, int]]:
    """The errors of the deck with these mistakes in it: codes and lines."""
    pieces = [mistake[i in wrong] for i, mistake in enumerate(MISTAKES)]
    errors = [d for d in ic.check(text=DECK.format(*pieces)).diagnostics if d.severity == "error"]
    return sorted((d.code, d.at.place.line) for d in errors if d.at is not None)


def expected(wrong: set[int]) -> list[tuple[str, int]]:
    lines = {i: n for n, line in enumerate(DECK.splitlines(), 1) for i in range(len(MISTAKES)) if f"{{{i}}}" in line}
    return sorted((MISTAKES[i][2], lines[i]) for i in wrong)


@pytest.mark.slow
def test_the_deck_without_mistakes_is_sound() -> None:
    assert told(set()) == []


def test_all_mistakes_are_told_in_one_run_and_nothing_else() -> None:
    everything = set(range(len(MISTAKES)))
    assert len(everything) >= 12
    assert told(everything) == expected(everything)


@pytest.mark.slow
@pytest.mark.parametrize("mended", range(len(MISTAKES)), ids=[wrong or "nothing" for _, wrong, _ in MISTAKES])
def test_to_mend_a_mistake_takes_just_its_message_away(mended: int) -> None:
    others = set(range(len(MISTAKES))) - {mended}
    assert told(others) == expected(others)


@pytest.mark.slow
@pytest.mark.parametrize("alone", range(len(MISTAKES)), ids=[wrong or "nothing" for _, wrong, _ in MISTAKES])
def test_a_mistake_alone_is_told_once(alone: int) -> None:
    assert told({alone}) == expected({alone})


HIDING = """\
#include <two_link.ic>
run first like nominal {{ integrator = {integrator};  {extra}  metric peak = {metric} {{ of = {channel}; }}
    require peak < {limit}; }}
run second like first {{ duration = 10 s; }}
sweep masses of first {{ vary links.upper.mass = [40, 60] kg;  exclude when links.upper.mass > {most}; }}
sweep all = masses + {part};
"""
SOUND = {
    "integrator": "rk4",
    "extra": "",
    "metric": "max",
    "channel": "elbow.qd",
    "limit": "1 rad/s",
    "most": "50 kg",
    "part": "second",
}


@pytest.mark.release
@pytest.mark.parametrize(("wrong", "codes"), [
    ({"integrator": "rk5", "metric": "mux"}, ["D140", "D140"]),
    ({"integrator": "rk5", "channel": "elbw.qd"}, ["D125", "D140"]),
    ({"integrator": "rk5", "limit": "1 kg"}, ["D061", "D140"]),
    ({"integrator": "rk5", "most": "50 m"}, ["D063", "D140"]),
    ({"integrator": "rk5", "part": "secnd"}, ["D041", "D140"]),
    ({"channel": "elbw.qd", "part": "secnd"}, ["D041", "D125"]),
    ({"extra": "tolerancs { }"}, ["D109"]),
])  # fmt: skip
def test_a_wrong_word_of_a_run_hides_no_other_mistake(wrong: dict[str, str], codes: list[str]) -> None:
    assert (
        sorted(d.code for d in ic.check(text=HIDING.format(**{**SOUND, **wrong})).diagnostics if d.severity == "error")
        == codes
    )
