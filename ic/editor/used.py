"""Decks that a text uses: which of a deck's texts a roof's definitions stand in."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator

from ic.editor.structure import DeckText
from ic.grammar.uses import AS, USE
from ic.text.lexer import NAME, STRING, Token
from met.frozen import frozen

DEFINED = ("let", "servo", "arm")
"""The kinds of names that stand under a roof."""

_INCLUDE = re.compile(r'[ \t]*#[ \t]*include[ \t]*(?:"([^"\n]*)"|<([^>\n]*)>)', re.MULTILINE)
_USE = re.compile(rf'\b{USE}\s*(?:"([^"\n]*)"|<([^>\n]*)>)\s*{AS}\b')


@frozen
class UseInText:
    """`use <panda.ic> as panda;` in a text: the file as it is asked for, the tokens around its name, and the roof's."""

    file: str
    angled: bool
    first: Token
    last: Token
    roof: Token


def uses_in(text: DeckText) -> Iterator[UseInText]:
    """The uses of decks that a text writes, as far as they are whole."""
    for entry in text.entries:
        words = entry.words
        end = next((n for n, word in enumerate(words) if word.text == AS), 0)
        if not words or words[0].text != USE or end < 2 or len(words) <= end + 1 or words[end + 1].kind != NAME:
            continue
        first, last = words[1], words[end - 1]
        if first.kind != STRING and (first.text, last.text) != ("<", ">"):
            continue
        file = text.source.text[first.offset + 1 : last.end - 1]
        yield UseInText(file, first.text == "<", first, last, words[end + 1])


def used_files(text: str) -> set[str]:
    """The names, without their folders, of the files that a text uses, whose runs are none of the deck's."""
    return {os.path.basename(quoted or angled) for quoted, angled in _USE.findall(text)}


def texts_under(text: DeckText, roof: str, texts: Iterable[DeckText]) -> set[str]:
    """The names of the texts that a roof of a text stands for: the deck that it uses, and what that includes."""
    known = {each.source.name: each for each in texts}
    waiting = [use.file for use in uses_in(text) if use.roof.text == roof]
    found: set[str] = set()
    while waiting:
        file = waiting.pop().removeprefix("./")
        for name, each in known.items():
            if name not in found and re.fullmatch(rf"<?(?:.*/)?{re.escape(file)}>?", name):
                found.add(name)
                waiting += [one or other for one, other in _INCLUDE.findall(each.source.text)]
    return found
