"""A page of `met doc` is written once, and says the same in a terminal and in Markdown."""

from __future__ import annotations

import re
from collections import Counter

import pytest
from reference import in_markdown

from ic.printing.page import Page, Table, in_json, in_terminal
from ic.printing.requests import SUBJECTS

PAGE = Page(
    subject="gears",
    title="Gears of joints",
    summary="what turns a joint slowly",
    prose="A gear has a ratio.\n\n    w = N qd\n",
    usage="gear = MODEL(...), in a servo",
    facts=("Order: 2",),
    parts=(
        Table(
            head=("name", "unit", "meaning"),
            rows=[("ratio", "1", "the ratio N, a factor > 1, of `w` and qd*")],
            caption="Numbers",
            notes=("Source of ratio: a [table]",),
            words=(("joint", "rad"), ("effort", "N*m")),
        ),
        Table(head=("name", "meaning"), rows=[], caption="Empty"),
        "",
        Table(head=("word", "meaning"), rows=[("none", "no gear")], headed=False),
        "That is all.",
    ),
    records=[{"name": "ratio"}],
)


def test_a_page_in_a_terminal() -> None:
    assert "\n".join(in_terminal(PAGE, None)) == (
        """\
gears: what turns a joint slowly
  A gear has a ratio.

      w = N qd

In a deck: gear = MODEL(...), in a servo
Order: 2

Numbers
  name   unit  meaning
  ratio  1     the ratio N, a factor > 1, of `w` and qd*
  Source of ratio: a [table]
  joint: rad
  effort: N*m

  none  no gear

That is all."""
    )


def test_a_page_in_markdown() -> None:
    assert "\n".join(in_markdown(PAGE, 3)) == (
        """\
### Gears of joints

What turns a joint slowly.

A gear has a ratio.

    w = N qd

In a deck: `gear = MODEL(...)`, in a servo

Order: 2

Numbers:

| name | unit | meaning |
|---|---|---|
| `ratio` | 1 | the ratio N, a factor > 1, of `w` and qd\\* |

Source of ratio: a \\[table\\]

`joint`: rad. `effort`: N\\*m.

| word | meaning |
|---|---|
| `none` | no gear |

That is all."""
    )


def test_programs_get_the_records_of_one_page_or_of_all() -> None:
    assert in_json([PAGE]) == [{"name": "ratio"}]
    assert in_json([PAGE, PAGE, Page(parts=["text"])]) == [{"name": "ratio"}, {"name": "ratio"}]
    assert in_json([Page(records={"schema": "one"})]) == {"schema": "one"}


@pytest.mark.parametrize("subject", [name for name in SUBJECTS if name != "language"])
def test_markdown_has_every_word_of_the_terminal(subject: str) -> None:
    page = SUBJECTS[subject]()
    words = [
        Counter(re.findall(r"[a-z0-9]+", "\n".join(lines).lower()))
        for lines in (in_terminal(page, None), in_markdown(page, 2))
    ]
    assert not words[0] - words[1] - Counter([subject])
