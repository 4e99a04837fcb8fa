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


def shown(given: Any) -> str:
    """A value in a message, shortened."""
    try:
        return reprlib.repr(given)
    except ValueError:  # Python prints no whole number of more than 4,300 digits
        return f"<{type(given).__name__}>"


def whole(given: Any, name: str, *, least: int) -> int:
    """An argument that is a whole number. Raises Problem E431."""
    if not isinstance(given, Integral) or isinstance(given, bool) or not least <= int(given) < BELOW:
        said = f"`{name}` is a whole number, at least {least} and below 2^32, and not {shown(given)}"
        raise Problem(error("E431", said, help=f"write `{name}={max(least, 1)}`, or leave it out"))
    return int(given)


def texts(given: Any, name: str, code: str, example: str, kinds: Any = str) -> tuple[Any, ...]:
    """An argument that is one text or a list of texts, but not a set, which has no order. Raises Problem of this
    code."""
    if isinstance(given, np.ndarray):
        given = given.tolist()
    if isinstance(given, kinds):
        return (given,)
    if isinstance(given, Iterable) and not isinstance(given, set | frozenset | Mapping):
        listed = tuple(given)
        if all(isinstance(each, kinds) for each in listed):
            return listed
    message = f"`{name}` is one text or a list of texts, and not {shown(given)}"
    raise Problem(error(code, message, help=f"write `{name}={example}`"))


def text_or_none(given: Any, name: str, kinds: Any = str) -> Any:
    """An argument that is a text, or None. Raises Problem E431."""
    if given is not None and not isinstance(given, kinds):
        raise Problem(error("E431", f"`{name}` is a text, and not {shown(given)}", help=f'write `{name}="..."`'))
    return given


def settings(given: Any) -> tuple[str, ...]:
    """The argument `set`, each entry as `PATH=VALUE`. Raises Problem E431."""
    example = '{"duration": "5 s"}'
    if not isinstance(given, Mapping):
        return texts(given, "set", "E431", example)
    return tuple(f"{path}={given[path]}" for path in texts(list(given), "set", "E431", example))


PATHS = (str, os.PathLike)
"""Types of the path of a file or folder."""
