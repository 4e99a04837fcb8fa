"""Reasons why a path of a run cannot vary over numbers, or be set alone, and the text to write instead, as data."""

from __future__ import annotations

from collections.abc import Sequence

from met.frozen import frozen

A_RUN_FOR_EACH = "write a run for each, `like` the first, and `sweep NAME = ONE + OTHER;`"

BY_MACRO = "write a name in its place in the deck, and give its value by `-D NAME=VALUE`"


@frozen
class NotSweepable:
    """A path that is known and cannot vary over numbers.

    reason  what it is, to go on after "it"
    sweep   what a sweep writes instead; "" where it varies over choices, by its own path
    one_of  the numbers that it is made of, any of which varies and can be set, in words; "" of what has none
    setting what to do where it is to be set from the command line and has no such numbers
    """

    reason: str
    sweep: str = ""
    one_of: str = ""
    setting: str = BY_MACRO

    @property
    def is_choice(self) -> bool:
        """Return True if a sweep may choose among its values, each of which makes a program of its own."""
        return not self.sweep and not self.one_of

    def to_vary(self, path: str) -> str:
        """The help for varying it."""
        if self.one_of:
            return f"it {self.reason}; vary {self.one_of}"
        return f"it {self.reason}: {self.sweep or f'write `vary {path} = [...];`'}"

    def to_set(self) -> str:
        """The help for setting it from the command line."""
        if self.one_of:
            return f"it {self.reason}; set {self.one_of}"
        return f"it {self.reason}: {self.setting}"


DECIDES = "decides the program"

COMPILED = NotSweepable(DECIDES)
"""A compile-time constant: another value is another program."""

COMPILED_ALONE = NotSweepable(DECIDES, A_RUN_FOR_EACH)
"""A compile-time constant that no sweep can choose."""

LIST = NotSweepable("is a list", A_RUN_FOR_EACH, setting="write it in the deck as a `let`, which can be set")
WORD = NotSweepable("is a word", "vary it over words")
FILE = NotSweepable("is read from a file", "it is one for the whole sweep")


def several(paths: Sequence[str]) -> NotSweepable:
    """The reason for a path that is made of several numbers, which have these paths."""
    return NotSweepable(f"is made of {len(paths)} numbers", one_of=_one_of_them(paths))


def follows(other: str, paths: Sequence[str]) -> NotSweepable:
    """The reason for a path that follows from another one, made of numbers with these paths."""
    return NotSweepable(f"follows from `{other}`", one_of=f"one of: {_listed(paths)}")


def model(kind: str, path: str) -> NotSweepable:
    """The reason for a model, `kind` in words, whose parameters vary."""
    parameter = f"a parameter of it, `{path}.PARAMETER`"
    return NotSweepable(f"is {kind}", f"vary {parameter}", setting=f"set {parameter}")


def chosen(path: str, choices: str) -> NotSweepable:
    """The reason for what a sweep chooses by another `path`, over `choices` in words, and what is set by it."""
    return NotSweepable(DECIDES, f"vary `{path}` over {choices}", setting=f"set `{path}`")


def _one_of_them(paths: Sequence[str]) -> str:
    return f"one of them: {_listed(paths)}"


def _listed(paths: Sequence[str]) -> str:
    return ", ".join(f"`{path}`" for path in paths)
