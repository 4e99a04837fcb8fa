"""A model's parameters, memory and states as its functions see them: numbers by name, `p.kp`, `held.voltage`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from met.diagnostic import Problem, error
from met.parameter import Parameter
from met.trace import Real

Read = Callable[[str], Any]
"""From a parameter's path to its value: a number (float or traced), a list or a word."""


class Values:
    """Numbers by name. Reading a name that the model does not declare is a placed mistake of the model's author."""

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


def parameters(owner: str, prefix: str, declared: Iterable[Parameter], read: Read) -> Values:
    """The declared parameters of a model in use under the path `prefix`."""
    numbers: dict[str, Any] = {}
    for parameter in declared:
        path = f"{prefix}.{parameter.name}"
        if parameter.shape == "vector":
            numbers[parameter.name] = tuple(read(f"{path}.{axis}") for axis in "xyz")
        else:
            numbers[parameter.name] = read(path)
    return Values(owner, numbers)


def returned(owner: str, what: str, given: Mapping[str, Real], declared: Iterable[str]) -> Mapping[str, Real]:
    """What a model's function gave back, checked to hold just the names that the model declares."""
    names = list(declared)
    missing = [name for name in names if name not in given]
    unknown = [name for name in given if name not in names]
    if missing or unknown:
        message = f"{owner}: {what} gave back {', '.join(given) or 'nothing'}; declared are {', '.join(names) or 'none'}"
        raise Problem(error("E212", message, help="give back every declared name and no other"))
    return given
