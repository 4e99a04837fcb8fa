"""Checks of a simulation's arguments other than parameter values: whole numbers, names, texts."""

from __future__ import annotations

import os
import reprlib
from collections.abc import Iterable, Mapping
from numbers import Integral
from typing import Any

import numpy as np

from met.diagnostic import Problem, error

BELOW = 2**32
"""Upper bound of numbers of repeats, as in a plan (met/plan/check.py)."""


def short_repr(argument: Any) -> str:
    """A value in a message, shortened."""
    try:
        return reprlib.repr(argument)
    except ValueError:  # Python prints no whole number of more than 4,300 digits
        return f"<{type(argument).__name__}>"


def whole(argument: Any, name: str, *, least: int) -> int:
    """An argument that is a whole number. Raises Problem E431."""
    if not isinstance(argument, Integral) or isinstance(argument, bool) or not least <= int(argument) < BELOW:
        message = f"`{name}` is a whole number, at least {least} and below 2^32, and not {short_repr(argument)}"
        raise Problem(error("E431", message, help=f"write `{name}={max(least, 1)}`, or leave it out"))
    return int(argument)


def texts(argument: Any, name: str, code: str, example: str, kinds: Any = str) -> tuple[Any, ...]:
    """An argument that is one text or a list of texts, but not a set, which has no order. Raises Problem of this
    code."""
    if isinstance(argument, np.ndarray):
        argument = argument.tolist()
    if isinstance(argument, kinds):
        return (argument,)
    if isinstance(argument, Iterable) and not isinstance(argument, set | frozenset | Mapping):
        listed = tuple(argument)
        if all(isinstance(entry, kinds) for entry in listed):
            return listed
    message = f"`{name}` is one text or a list of texts, and not {short_repr(argument)}"
    raise Problem(error(code, message, help=f"write `{name}={example}`"))


def text_or_none(argument: Any, name: str, kinds: Any = str) -> Any:
    """An argument that is a text, or None. Raises Problem E431."""
    if argument is not None and not isinstance(argument, kinds):
        raise Problem(
            error("E431", f"`{name}` is a text, and not {short_repr(argument)}", help=f'write `{name}="..."`')
        )
    return argument


def settings(argument: Any) -> tuple[str, ...]:
    """The argument `set`, each entry as `PATH=VALUE`. Raises Problem E431."""
    example = '{"duration": "5 s"}'
    if not isinstance(argument, Mapping):
        return texts(argument, "set", "E431", example)
    return tuple(f"{path}={argument[path]}" for path in texts(list(argument), "set", "E431", example))


PATHS = (str, os.PathLike)
"""Types of the path of a file or folder."""
