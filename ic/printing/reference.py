"""The page docs/reference.md: the pages of `met doc` about MET's own models and the language, as Markdown."""

from __future__ import annotations

from collections.abc import Iterator

from ic.language import BLOCKS
from ic.printing.models import KINDS, WHERE_WRITTEN, model_page
from ic.printing.page import Page, in_markdown
from ic.printing.subjects import BLOCK_PAGES, OTHER_PAGES, substitute_page
from met import models

HEAD = """\
# Models, their parameters, channels, units

This page lists everything that a deck can contain: the blocks of the deck language, the models with their parameters
and channels, and the units, functions and distributions. [Writing decks](deck.md) explains how to use them, and
[models](models.md) how to add a model. `met doc` prints the same in a terminal, also for models of other packages.
`met doc --markdown` writes this page from the declarations in the code, and a test keeps it up to date.

Defaults and ranges are in SI units. A parameter whose default is `needed` must be written. The unit `-` means a pure
number.
"""


def sections() -> list[tuple[Page, list[Page]]]:
    """The sections of the page: what stands at its head, and the pages in it."""
    blocks = [substitute_page(models.find_own) if name == "substitute" else BLOCK_PAGES[name]() for name in BLOCKS]
    kinds = [
        (
            Page(title=f"{kind.capitalize()}s", usage=WHERE_WRITTEN[kind]),
            [model_page(kind, model) for model in models.find_own(kind).values()],
        )
        for kind in KINDS
    ]
    return [
        (Page(title="Blocks of a deck"), blocks),
        *kinds,
        *((make_page(), []) for make_page in OTHER_PAGES.values()),
    ]


def page() -> Iterator[str]:
    """The lines of the page, about MET's own models."""
    yield from HEAD.splitlines()
    yield ""
    whole = sections()
    for section, pages in whole:
        names = ", ".join(_link(each.subject, each) for each in pages)
        yield f"- {_link(section.title, section)}{': ' if names else ''}{names}"
    for section, pages in whole:
        for level, each in ((2, section), *((3, each) for each in pages)):
            yield from ("", *in_markdown(each, level))


def _link(text: str, page: Page) -> str:
    return f"[{text}](#{page.title.lower().replace(' ', '-')})"
