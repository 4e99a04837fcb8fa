"""Texts as HTML: escaped, with a program's text set as such, and long names that break where a reader would."""

from __future__ import annotations

import pytest

from batch.report.html.markup import breaking, el, prose
from tests.batch.report.archives import HOSTILE


@pytest.mark.parametrize(
    ("raw", "expected"),
    [
        ("the program of `tuning` is another", "the program of <code>tuning</code> is another"),
        ("`a` and `b`", "<code>a</code> and <code>b</code>"),
        ("`<b>`", "<code>&lt;b&gt;</code>"),
        ("one ` alone", "one ` alone"),
        ("none", "none"),
    ],
)
def test_what_stands_between_backticks_is_set_as_a_programs_text(raw: str, expected: str) -> None:
    assert prose(raw) == expected
    assert el("p", raw) == f"<p>{expected}</p>"


def test_the_text_of_a_deck_keeps_its_backticks() -> None:
    assert el("code", "// `a`") == "<code>// `a`</code>"


def test_an_attribute_is_no_markup() -> None:
    assert el("p", title="`a`") == '<p title="`a`"></p>'


def test_a_hostile_name_between_backticks_is_text() -> None:
    assert "<script" not in prose(f"`{HOSTILE}`") and "<img" not in prose(f"`{HOSTILE}`")


def test_a_long_name_may_break_after_dots_and_underscores_and_a_short_one_not() -> None:
    assert breaking("a_gearbox_with_a_long_name.kp") == "a_<wbr>gearbox_<wbr>with_<wbr>a_<wbr>long_<wbr>name.<wbr>kp"
    assert breaking("gearbox.kp") == "gearbox.kp"
