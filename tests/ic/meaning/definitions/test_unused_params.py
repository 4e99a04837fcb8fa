"""Warnings of a `param` that nothing uses and that was meant for one of an included file; which values the others keep."""

from __future__ import annotations

from pathlib import Path

import pytest

import ic
from tests.ic.small_decks import ARM, RUN, SERVO

PART = "#pragma once\nparam reach = 0.5 m;\n" + ARM + SERVO


def codes(folder: Path, *, before: str = "", behind: str = "", part: str = PART) -> list[str]:
    (folder / "part.ic").write_text(part)
    (folder / "deck.ic").write_text(f'{before}\n#include "part.ic"\n{behind}\n{RUN}')
    return [each.code for each in ic.check(str(folder / "deck.ic")).diagnostics]


@pytest.mark.parametrize(
    ("before", "behind", "expected"),
    [
        ("param raech = 0.9 m;", "", ["D386"]),
        ("", "param raech = 0.9 m;", ["D386"]),
        ("param reach = 0.9 m;", "", []),
        ("param depth = 0.9 m;", "", []),
        ("let raech = 0.9 m;", "", []),
        ("param reach_2 = 0.9 m;\nlet twice = 2 * reach_2;", "", []),
    ],
)
def test_a_param_that_nothing_uses_is_told_where_an_included_file_has_one_like_it(
    tmp_path: Path, before: str, behind: str, expected: list[str]
) -> None:
    assert codes(tmp_path, before=before, behind=behind) == expected


def test_an_included_file_may_have_params_that_a_deck_does_not_use(tmp_path: Path) -> None:
    part = PART.replace("param reach", "param reach_2 = 0.7 m;\nparam reach")
    assert codes(tmp_path, part=part) == []


def test_a_param_of_another_dimension_is_one_error(tmp_path: Path) -> None:
    part = PART.replace("arm ", "let twice = reach + 1 m;\narm ", 1)
    other = "run other like hold { with reach = 0.9 m; }"
    assert codes(tmp_path, before="param reach = 0.7 s;", behind=other, part=part) == ["D061"]


@pytest.mark.parametrize(
    ("lets", "expected"),
    [
        ("for i in 1 .. 2 { let x_{i} = spans[i]; }", ["D388"]),
        ("for i in 2 .. 3 { let x_{i} = 2 * spans[i - 1]; }", ["D388"]),
        ("for i in 1 .. 2 { let x_{i} = spans[i - 1]; }", []),  # the remedy
        ("for i in 0 .. 1 { let x_{i} = spans[i]; }", []),  # more may be for another count
        ("for i in 1 .. 2 { let x_{i} = spans[i]; }\nlet last = spans[2];", []),
        ("for i in 1 .. 2 { let x_{i} = spans[i]; }\nlet all = 2 * spans;", []),
        ("for i in 1 .. 2 { let x_{i} = spans[2]; }", []),
        ("let one = spans[1];\nlet two = spans[2];", []),
    ],
)
def test_the_first_element_of_a_list_that_loops_pass_over_is_told(
    tmp_path: Path, lets: str, expected: list[str]
) -> None:
    assert codes(tmp_path, before="let spans = [0.5, 0.4, 0.3] m;", behind=lets) == expected
    assert codes(tmp_path, before="let spans = [0, 0.4, 0.3] m;", behind=lets) == []
