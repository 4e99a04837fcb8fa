"""Frozen dataclasses that cost a fifth to define: `@frozen` for `@dataclass(frozen=True)`.

`dataclasses` compiles six methods for each frozen class, half a millisecond a class and a sixth of the start of
`met check`. Here only `__init__` is compiled; the other methods are shared and go by the fields. What is made is a
dataclass: `fields`, `replace` and `asdict` work on it, and type checkers see one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, Literal, TypeVar, dataclass_transform, overload

T = TypeVar("T")


def keyed(
    when: Literal["always", "never", "where set"], *, default: Any = dataclasses.MISSING, run_key: Any = None
) -> Any:
    """A field of a plan's dataclass, with when it is in a structure key.

    "always"     as a field is that is not declared so
    "never"      what changes no number: places, names and units for the reader
    "where set"  what plans have got since keys were first made: where it is its default keys are what they were
    run_key      the key of a run that it keeps (`met.plan.run_keys.RunKey`); None where it keeps none
    """
    return dataclasses.field(default=default, metadata={IN_KEY: when, **({RUN_KEY: run_key} if run_key else {})})


RUN_KEY = "keeps this key of a run"
"""Under which the metadata of a field has the key of a run that it keeps."""

IN_KEY = "in the structure key"
"""Under which the metadata of a field says when it is in a structure key; always where they say nothing."""


@overload
def frozen(cls: type[T], /) -> type[T]: ...
@overload
def frozen(*, kw_only: bool = ...) -> Callable[[type[T]], type[T]]: ...
@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field, keyed))
def frozen(cls: type[T] | None = None, /, *, kw_only: bool = False) -> type[T] | Callable[[type[T]], type[T]]:
    """Makes a class a frozen dataclass, compared and hashed by its fields."""

    def make(cls: type[T]) -> type[T]:
        cls.__doc__ = cls.__doc__ or ""  # else dataclasses writes one, from a signature that takes long to make
        made = dataclasses.dataclass(eq=False, repr=False, kw_only=kw_only)(cls)
        for method in (__setattr__, __delattr__, __eq__, __hash__, __repr__):
            if method.__name__ not in cls.__dict__ or method.__name__ == "__hash__":
                setattr(made, method.__name__, method)
        return made

    return make if cls is None else make(cls)


def _values(self: Any) -> tuple[Any, ...]:
    """The fields that count, in order."""
    return tuple(getattr(self, name) for name, field in self.__dataclass_fields__.items() if field.compare)


def __setattr__(self: Any, name: str, value: Any) -> None:
    """`__init__` sets each field once; nothing else sets anything."""
    own = self.__dict__
    if name in own or name not in self.__dataclass_fields__:
        raise dataclasses.FrozenInstanceError(f"cannot assign to {name!r} of a {type(self).__name__}")
    own[name] = value


def __delattr__(self: Any, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete {name!r} of a {type(self).__name__}")


def __eq__(self: Any, other: object) -> bool:
    return _values(self) == _values(other) if type(other) is type(self) else NotImplemented


def __hash__(self: Any) -> int:
    return hash(_values(self))


def __repr__(self: Any) -> str:
    shown = (f"{name}={getattr(self, name)!r}" for name, field in self.__dataclass_fields__.items() if field.repr)
    return f"{type(self).__qualname__}({', '.join(shown)})"
