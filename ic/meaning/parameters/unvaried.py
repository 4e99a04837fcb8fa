"""Why a path of a run cannot vary over numbers, nor be set by itself, and what to write instead: as data."""

from __future__ import annotations

from collections.abc import Sequence

from met.frozen import frozen

A_RUN_FOR_EACH = "write a run for each, `like` the first, and `sweep NAME = ONE + OTHER;`"


@frozen
class Unvaried:
    """A path that is known and cannot vary over numbers.

    is_     what it is, to go on after "it"
    sweep   what a sweep writes instead; "" where it varies over choices, by its own path
    one_of  the numbers that it is made of, any of which varies and can be set, in words; "" of what has none
    """

    is_: str
    sweep: str = ""
    one_of: str = ""

    @property
    def is_choice(self) -> bool:
        """Whether a sweep may choose among values of it, each of which makes a program of its own."""
        return not self.sweep and not self.one_of

    def to_vary(self, path: str) -> str:
        """The help for who would vary it."""
        if self.one_of:
            return f"it {self.is_}; vary {self.one_of}"
        return f"it {self.is_}: {self.sweep or f'write `vary {path} = [...];`'}"

    def to_set(self) -> str:
        """The help for who would set it from the command line."""
        if self.one_of:
            return f"it {self.is_}; set {self.one_of}"
        return f"it {self.is_}: write it in the deck, with a `let` that can be set"


DECIDES = "decides the program"

COMPILED = Unvaried(DECIDES)
"""A compile-time constant: another value is another program."""

COMPILED_ALONE = Unvaried(DECIDES, A_RUN_FOR_EACH)
"""A compile-time constant that no sweep can choose."""

LIST = Unvaried("is a list", A_RUN_FOR_EACH)
WORD = Unvaried("is a word", "vary it over words")
FILE = Unvaried("is read from a file", "it is one for the whole sweep")


def several(paths: Sequence[str]) -> Unvaried:
    """What is made of several numbers, which have these paths."""
    return Unvaried(f"is made of {len(paths)} numbers", one_of=_one_of_them(paths))


def follows(other: str, paths: Sequence[str]) -> Unvaried:
    """What follows from what is written elsewhere, which is made of numbers that have these paths."""
    return Unvaried(f"follows from `{other}`", one_of=f"one of: {_listed(paths)}")


def model(kind: str, path: str) -> Unvaried:
    """A model, `kind` in words, whose parameters vary."""
    return Unvaried(f"is {kind}", f"vary a parameter of it, `{path}.PARAMETER`")


def chosen(instead: str) -> Unvaried:
    """What a sweep chooses by another path, or in words of its own."""
    return Unvaried(DECIDES, instead)


def _one_of_them(paths: Sequence[str]) -> str:
    return f"one of them: {_listed(paths)}"


def _listed(paths: Sequence[str]) -> str:
    return ", ".join(f"`{path}`" for path in paths)
