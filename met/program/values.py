"""Values exchanged with a model's functions: numbers by name, `p.kp`, `held.voltage`; and the functions' answers."""

from __future__ import annotations

import linecache
import traceback
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from met.diagnostic import Place, Problem, did_you_mean, error
from met.parameter import Parameter
from met.trace import Real

T = TypeVar("T")

Read = Callable[[str], Any]
"""A function from a parameter's path to its value: a number (float or traced), a list or a word."""


class NamedValues:
    """Numbers by name. Reading a name that the model does not declare is reported as a mistake of the model's author,
    with its place."""

    __slots__ = ("_numbers", "_owner")

    def __init__(self, owner: str, numbers: Mapping[str, Any]) -> None:
        self._owner = owner
        self._numbers = dict(numbers)

    def __getattr__(self, name: str) -> Any:
        try:
            return self._numbers[name]
        except KeyError:
            pass
        if name.startswith("__"):
            raise AttributeError(name)
        declared = ", ".join(self._numbers) or "nothing"
        message = f"{self._owner} reads `{name}`, which it does not declare"
        raise Problem(error("E211", message, help=f"declared: {declared}"))


def parameters(owner: str, prefix: str, declared: Iterable[Parameter], read: Read) -> NamedValues:
    """The declared parameters of a model in use under the path `prefix`."""
    numbers: dict[str, Any] = {}
    for parameter in declared:
        path = f"{prefix}.{parameter.name}"
        if parameter.shape == "vector":
            numbers[parameter.name] = tuple(read(f"{path}.{axis}") for axis in "xyz")
        else:
            numbers[parameter.name] = read(path)
    return NamedValues(owner, numbers)


class Passing(BaseException):
    """Raised by the engine to leave a model's function before its end: no mistake of the model's."""


def answer(owner: str, function: Callable[..., T], *arguments: Any) -> T:
    """The answer of a model's function. Whatever it raises is reported at the model's own line, Problem E213,
    `sys.exit` too; only an interrupt, which comes from the user, passes."""
    try:
        with np.errstate(all="ignore"):  # constants may give NaN or infinity, as runs may: they go into the program
            return function(*arguments)
    except (Problem, Passing, KeyboardInterrupt):
        raise
    except BaseException as reason:  # a model's errors, of whatever kind, are for its author to read
        frames = traceback.extract_tb(reason.__traceback__)
        # the first frame is this function's own, the next one the model's, unless it called nothing written in Python
        own = [frame for frame in frames[1:] if frame.filename == frames[1].filename] or frames
        frame = own[-1]
        place = Place(frame.filename, frame.lineno or 1, (frame.colno or 0) + 1)
        if frame.end_colno is not None and frame.colno is not None and frame.end_lineno == frame.lineno:
            place = replace(place, length=max(frame.end_colno - frame.colno, 1))
        name = getattr(getattr(function, "func", function), "__name__", type(function).__name__)
        message = f"{owner}: `{name}` raises {type(reason).__name__}{f': {reason}' if str(reason) else ''}"
        sources = {frame.filename: "".join(linecache.getlines(frame.filename))}
        raise Problem(error("E213", message, place, help="mend the model, or tell its author"), sources) from reason


def returned(
    owner: str, what: str, numbers: Mapping[str, Real], declared: Iterable[str], *, all_of_them: bool = True
) -> Mapping[str, Real]:
    """The answer of a model's function, checked to hold exactly the names that the model declares, or some of them."""
    names = list(declared)
    missing = [name for name in names if name not in numbers] if all_of_them else []
    unknown = [name for name in numbers if name not in names]
    if missing or unknown:
        listed = ", ".join(numbers) or "nothing"
        message = f"{owner}: {what} gave back {listed}; declared are {', '.join(names) or 'none'}"
        remedy = "give back every declared name and no other" if all_of_them else "give back declared names alone"
        raise Problem(
            error("E212", message, help=[*(near for name in unknown for near in did_you_mean(name, names)), remedy])
        )
    return numbers
