"""Requests to `met doc`: the pages that its words ask for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from textwrap import indent
from types import MappingProxyType
from typing import Any

from ic.language import BLOCKS
from ic.printing.codes import is_code, print_code
from ic.printing.description import language_page
from ic.printing.glossary import entries
from ic.printing.models import KINDS, WHERE_WRITTEN, model_page, model_record, summary
from ic.printing.page import Page, Table
from ic.printing.subjects import BLOCK_PAGES, OTHER_PAGES
from ic.printing.words import print_word
from met import models
from met.diagnostic import Problem, did_you_mean, error

OF_LANGUAGE = tuple(name for name in BLOCKS if name not in KINDS)
"""Blocks of the deck language that have no models."""

SUBJECTS: Mapping[str, Callable[[], Page]] = MappingProxyType(
    {
        **{name: BLOCK_PAGES[name] for name in OF_LANGUAGE},
        **dict(sorted({**OTHER_PAGES, "language": language_page}.items())),
    }
)
"""The page of each word of `met doc` that is neither a model nor a kind of models."""


def requested_pages(words: tuple[str, ...]) -> list[Page]:
    """The pages of a request. Raises Problem D171."""
    word = words[0] if len(words) == 1 else ""
    kind = word.removesuffix("s")
    if is_code(word):
        return [Page(parts=["\n".join(print_code(word))])]
    if word in SUBJECTS:
        return [SUBJECTS[word]()]
    if not words or kind in KINDS:
        return [index_page(kind)]
    meanings = "\n".join(print_word(word))
    try:
        pages = [model_page(kind_of_model, model) for kind_of_model, model in named_models(*words)]
    except Problem:
        if not meanings:
            raise
        return [Page(parts=[meanings])]
    also = f"Also `{word}`\n{indent(meanings, '  ')}" if meanings else ""
    return [*pages, Page(parts=[also])]


def index_page(word: str) -> Page:
    """A list of the models of a kind, with its block if it has one; "": of the models of all kinds."""
    kinds = [kind for kind in KINDS if word in ("", kind)]
    tables = [
        Table(
            head=("name", "meaning"),
            rows=[(name, summary(model)) for name, model in models.available(kind).items()],
            headed=False,
            caption=f"{kind}: {WHERE_WRITTEN[kind]}",
        )
        for kind in kinds
    ]
    others = ", ".join(name for name in SUBJECTS if name not in (*OF_LANGUAGE, "channels"))
    end = (
        "`met doc MODEL` shows everything that a model declares, `met doc channels` everything that can be recorded.\n"
        f"Blocks of a deck: {', '.join(OF_LANGUAGE)}.\n"
        f"Also: {others}; and the code of a message, as in `met doc D060`."
    )
    block = BLOCK_PAGES.get(word, Page)()
    records = [model_record(kind, model) for kind in kinds for model in models.available(kind).values()]
    return replace(block, parts=(*block.parts, *tables, end), records=records)


def named_models(word: str, name: str = "") -> list[tuple[models.Kind, Any]]:
    """The models whose name is the only word, or the one of a kind and a name. Raises Problem D171."""
    for kind in KINDS:
        if word in (kind, f"{kind}s"):
            return [(kind, models.find(kind, name))]
    everything = [(kind, model) for kind in KINDS for model in models.available(kind).values()]
    named = [(kind, model) for kind, model in everything if model.name == word]
    if named and not name:
        return named
    if name and (word in SUBJECTS or named):
        whole = f"{named[0][0]} {word}" if named else word
        raise Problem(error("D171", f"`{word}` takes no second word", help=f"`met doc {whole}` says it all"))
    known = [*KINDS, *SUBJECTS, *(model.name for _, model in everything), *entries()]
    helps = [*did_you_mean(word, known), f"kinds: {', '.join(KINDS)}; also: {', '.join(SUBJECTS)}"]
    raise Problem(error("D171", f"no kind of model and no model `{word}`", help=helps))
