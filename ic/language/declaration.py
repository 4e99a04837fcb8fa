"""The declaration of a block of the deck language: its entries, declared as models declare their parameters."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from met.frozen import frozen
from met.parameter import Parameter
from met.plan.run_keys import RunKey

Varies = Literal["number", "choice", "never"]
"""The ways in which a sweep may vary an entry: over numbers, over choices (each makes a program of its own), or not at
all; entries inside a block or a model may vary all the same."""


@frozen(kw_only=True)
class Entry:
    """An entry that a block may have: a key (`mass = 2 kg;`, `rates { ... }`), something with a name of the deck's
    (`payload NAME { ... }`), or a statement (`require ...;`).

    name       the word it begins with
    form       "key", "named" or "statement"
    written    how a deck writes it
    doc        what it is, in a few words
    default    what holds where it is left out, in words; `needed` where it may not be
    parameter  its type, unit and bounds, where it is a number, numbers or a word
    varies     what a sweep may do with it;  path: what sweeps and `--set` call it; "" where they do not
    """

    name: str
    form: Literal["key", "named", "statement"] = "key"
    written: str
    doc: str
    default: str = "needed"
    parameter: Parameter | None = None
    varies: Varies = "never"
    path: str = ""

    @staticmethod
    def of_plan(key: RunKey, written: str, *, varies: Varies = "choice") -> Entry:
        """The declaration of an entry that a plan keeps as one word or number, whose name, type, default and meaning
        are declared there."""
        wanted = key.parameter
        default = (
            f"`{wanted.default}`" if wanted.shape == "word" else f"{wanted.default} {wanted.unit}".removesuffix(" 1")
        )
        return Entry(
            name=wanted.name, written=written, doc=wanted.doc, default=default, parameter=wanted, varies=varies,
            path=key.path,
        )  # fmt: skip

    @property
    def default_in_words(self) -> str:
        """`needed`, or what holds where it is left out, behind `default: `; "" where nothing is known of a default."""
        return self.default if self.default.startswith("needed") or not self.default else f"default: {self.default}"

    @property
    def unit(self) -> str:
        """The unit of its number; "" where it has none."""
        if self.parameter is None or self.parameter.shape in ("word", "words"):
            return ""
        return self.parameter.unit


@frozen(kw_only=True)
class BlockDeclaration:
    """A block of the deck language.

    name     the word it begins with;  written: how a deck writes it;  within: the block that it stands in, "" for a
             deck's own definitions
    doc      what it is, in a sentence
    head     the first word of the paths of what stands in it, such as `links`; "" where that is a name of the deck's
    called   what messages call it: `the environment`; "" of blocks with a name of the deck's
    free     what else may stand in it under names of the deck's or of models, in words
    """

    name: str
    written: str
    within: str = ""
    doc: str
    entries: tuple[Entry, ...] = ()
    head: str = ""
    called: str = ""
    free: str = ""

    def __getitem__(self, name: str) -> Entry:
        """The entry of that name. Raises KeyError."""
        for entry in self.entries:
            if entry.name == name:
                return entry
        raise KeyError(name)

    def _names(self, form: str) -> Iterator[str]:
        return (entry.name for entry in self.entries if entry.form == form)

    @property
    def keys(self) -> tuple[str, ...]:
        """The names of its keys, in order."""
        return tuple(self._names("key"))

    @property
    def named(self) -> tuple[str, ...]:
        """The words of its entries with names of the deck's, in order."""
        return tuple(self._names("named"))

    @property
    def statements(self) -> tuple[str, ...]:
        """The words of its statements, in order."""
        return tuple(self._names("statement"))
