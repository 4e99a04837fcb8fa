"""Text of `met doc` in a terminal: within its width, with every word, formulas and code as they are."""

from __future__ import annotations

from collections import Counter

import pytest

from ic.language import BLOCKS
from ic.printing.columns import columns
from ic.printing.models import model_page, sources
from ic.printing.page import described, fitted, in_terminal, paragraphs
from ic.printing.subjects import block_page
from met import models

ROWS = [
    ("name", "unit", "meaning"),
    ("kp", "V*s/rad", "gain of the loop on the error of a rate, as in `a = b + c`, and more"),
]


def test_a_table_that_fits_is_as_columns_has_it() -> None:
    assert described(ROWS, width=None) == described(ROWS, width=200, head=True) == columns(ROWS)


def test_text_is_wrapped_in_its_column() -> None:
    assert described(ROWS, width=60, head=True) == [
        "  name  unit     meaning",
        "  kp    V*s/rad  gain of the loop on the error of a rate, as",
        "                 in `a = b + c`, and more",
    ]


def test_text_stands_below_its_row_where_its_column_would_be_narrow() -> None:
    assert described(ROWS, width=40, head=True) == [
        "  name  unit",
        "  kp    V*s/rad",
        "      gain of the loop on the error of a",
        "      rate, as in `a = b + c`, and more",
    ]


def test_paragraphs_are_filled_and_formulas_kept() -> None:
    text = "One two three\nfour five six.\n\n    a = b + c + d + e + f + g\n\nSeven eight nine ten."
    assert list(paragraphs(text, width=20)) == [
        "One two three four",
        "five six.",
        "",
        "    a = b + c + d + e + f + g",
        "",
        "Seven eight nine",
        "ten.",
    ]
    assert list(paragraphs(text, width=None)) == text.splitlines()


def test_a_line_keeps_its_indent_where_it_is_filled() -> None:
    assert list(fitted(["  one two three", "    a = b + c + d"], width=10)) == [
        "  one two",
        "  three",
        "    a = b + c + d",
    ]


@pytest.mark.parametrize("width", [90, 110])
@pytest.mark.parametrize("kind", models.GROUPS)
def test_pages_of_models_fit_a_terminal_and_lose_no_word(kind: models.Kind, width: int) -> None:
    for model in models.find_own(kind).values():
        whole = list(in_terminal(model_page(kind, model), None))
        shown = list(fitted(in_terminal(model_page(kind, model), width), width=width))
        formulas = {line for line in whole if line.startswith("      ")}
        assert [line for line in shown if len(line) > width and line not in formulas] == []
        lost = Counter(" ".join(whole).split()) - Counter(" ".join(shown).split())
        assert set(lost) <= {"meaning"}, model.name  # the head of the column, where text stands below its row
        assert not Counter(" ".join(shown).split()) - Counter(" ".join(whole).split()), model.name


@pytest.mark.parametrize("name", BLOCKS)
def test_pages_of_blocks_fit_eighty_columns(name: str) -> None:
    lines = list(fitted(in_terminal(block_page(BLOCKS[name]), 80), width=80))
    assert [line for line in lines if len(line) > 80 and not line.startswith("  ")] == []
    assert [line for line in lines if len(line) > 80 and line.startswith("      ") and "`" not in line] == []


def test_a_source_is_said_once_for_all_its_parameters() -> None:
    model = models.find_own("servo")["rigid_gearbox"]
    (source,) = sources(model.parameters)
    assert source.endswith(": Hill, Hopping, Price 1989, table 1")
    assert source.startswith("Source of ratio, kp, ki, v_max, ") and source.count("f_c") == 1
    assert sum("Hopping, Price" in line for line in in_terminal(model_page("servo", model), None)) == 1
