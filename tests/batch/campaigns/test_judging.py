"""Which designs are judged for their stability, in which cases, and what is said of it."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from batch.campaigns.judging import MOST_CASES, MOST_DESIGNS, judged_until_kept, telling_cases
from batch.queries.stability_words import margin_words, stability_texts
from met.plan.searches import JudgedDesign, LeastMargins


def margins(disk: float, **more: Any) -> LeastMargins:
    """Margins with this disk, at a joint and an instant."""
    known: dict[str, Any] = {
        "gain": 1.9, "delay": 0.0023, "joints": ("grip",), "case": 7, "time": 1.25, "loops": 3, "cases": 1, "poses": 12,
    }  # fmt: skip
    return LeastMargins(disk=disk, **{**known, **more})


@pytest.mark.parametrize(
    ("disks", "judged"),
    [
        ([0.5], [0]),
        ([0.1], [0]),
        ([0.1, 0.2, 0.5, 0.6], [0, 1, 2, 3]),
        ([0.1] * 5 + [0.5] * 20, [0, 1, 3, 4, 5, 7]),
        ([0.1] * 6, [0, 1, 3, 5]),
        ([], []),
    ],
)
def test_designs_are_judged_until_one_keeps_the_margin_and_nothing_before_it_does(
    disks: list[float], judged: list[int]
) -> None:
    """Numbers of the designs that were judged; the stride doubles, and ends where the last design is."""
    found = judged_until_kept(len(disks), lambda number: JudgedDesign(number, margins(disks[number])), 0.3)
    assert list(found) == judged
    assert all(found[number].case == number for number in judged)


def test_no_more_designs_are_judged_than_their_number_allows() -> None:
    asked: list[int] = []

    def judge(number: int) -> JudgedDesign:
        asked.append(number)
        return JudgedDesign(number, margins(0.5 if number > 1000 else 0.1))

    found = judged_until_kept(100_000, judge, 0.3)
    assert len(found) == len(asked) <= MOST_DESIGNS
    assert any(each.keeps(0.3) for each in found.values())


def test_a_design_without_a_margin_is_taken() -> None:
    found = judged_until_kept(3, lambda number: JudgedDesign(number, None, "no law closes a loop over the arm"), 0.3)
    assert list(found) == [0]


def test_of_many_cases_the_worst_and_those_at_ends_are_looked_at() -> None:
    values = np.random.default_rng(1).permutation(200).astype(float)
    coordinate: Any = SimpleNamespace(values=values)
    cases = np.arange(199, -1, -1)
    looked_at = telling_cases(cases, [coordinate])
    assert len(looked_at) == MOST_CASES and (np.diff(looked_at) > 0).all()
    assert {199, int(values.argmin()), int(values.argmax())} <= set(looked_at.tolist())
    assert telling_cases(cases[:5], [coordinate]).tolist() == [195, 196, 197, 198, 199]


def test_margins_are_said_with_what_they_allow_and_where_they_are_so() -> None:
    design = JudgedDesign(0, margins(0.6))
    assert stability_texts(design, 0.3) == [
        "stability: disk margin 0.6 (1.857 times the gain or 33.4 deg), gain margin 1.9, delay margin 2.3 ms: the loop "
        "of joint `grip` in case #7 at 1.25 s, the least of 3 loops in 1 case at 12 poses, dry friction released",
        "less than usual, which is a disk margin of 0.67: 2.008 times the gain or 37 deg",
    ]
    assert len(stability_texts(JudgedDesign(0, margins(0.7)), 0.3)) == 1
    assert margin_words(margins(0.0)) == "the loop of joint `grip` is unstable in case #7 at 1.25 s"
    both = margin_words(margins(0.0, joints=("slew", "luff")))
    assert both == "the servo loops are unstable in case #7 at 1.25 s"
    words = margin_words(margins(2.0, gain=math.inf, delay=math.nan, joints=("slew", "luff")))
    assert words == "disk margin 2 (any gain or 90 deg): the loops of all joints at once in case #7 at 1.25 s"


def test_what_was_not_judged_says_why() -> None:
    why = JudgedDesign(0, None, "the law of joint `elbow` is continuous")
    assert stability_texts(why, 0.3) == ["stability not judged: the law of joint `elbow` is continuous"]
    assert stability_texts(None, 0.0) == ["stability not judged: the least margin that is asked for is 0"]
