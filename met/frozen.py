"""Frozen dataclasses that cost a fifth to define: `@frozen` for `@dataclass(frozen=True)`.

`dataclasses` compiles six methods for each frozen class, half a millisecond a class and a sixth of the start of `met
check`. Here only `__init__` is compiled, when the first instance is made; the other methods are shared and use the list
of fields. The result is a dataclass: `fields`, `replace` and `asdict` work on it, and type checkers see one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal, TypeVar, dataclass_transform, overload

if TYPE_CHECKING:
    import inspect

T = TypeVar("T")


def keyed(
    when: Literal["always", "never", "where set"], *, default: Any = dataclasses.MISSING, run_key: Any = None
) -> Any:
    """A field of a plan's dataclass, declared with its part in the structure key.

    "always"     as a field is that is not declared so
    "never"      what changes no number: places, names and units for the reader
    "where set"  what plans have got since keys were first made: where it is its default keys are what they were
    run_key      the key of a run that it keeps (`met.plan.run_keys.RunKey`); None where it keeps none
    """
    return dataclasses.field(default=default, metadata={IN_KEY: when, **({RUN_KEY: run_key} if run_key else {})})


RUN_KEY = "keeps this key of a run"
"""Key of a field's metadata that holds the key of a run that the field keeps."""

IN_KEY = "in the structure key"
"""Key of a field's metadata that says when the field is in a structure key; without it, always."""


@overload
def frozen(cls: type[T], /) -> type[T]: ...
@overload
def frozen(*, kw_only: bool = ...) -> Callable[[type[T]], type[T]]: ...
@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field, keyed))
def frozen(cls: type[T] | None = None, /, *, kw_only: bool = False) -> type[T] | Callable[[type[T]], type[T]]:
    """Make a class a frozen dataclass, compared and hashed by its fields."""

    def make(cls: type[T]) -> type[T]:
        """The class as a frozen dataclass, with methods that compare and hash by its fields."""
        cls.__doc__ = cls.__doc__ or ""  # else dataclasses writes one, from a signature that is slow to make
        frozen_class = dataclasses.dataclass(init=False, eq=False, repr=False, kw_only=kw_only)(cls)
        _compile_later(frozen_class)
        for method in (__setattr__, __delattr__, __eq__, __hash__, __repr__):
            if method.__name__ not in cls.__dict__ or method.__name__ == "__hash__":
                setattr(frozen_class, method.__name__, method)
        return frozen_class

    return make if cls is None else make(cls)


def _compile_later(cls: type) -> None:
    """Give a class an `__init__` that is compiled when it is first called."""

    compiled: list[Callable[..., None]] = []

    def __init__(self: Any, *positional: Any, **named: Any) -> None:
        if not compiled:
            compiled.append(_compiled_init(cls))
        if cls.__dict__["__init__"] is __init__:  # a decorator may have wrapped it: the wrapper stays
            cls.__init__ = compiled[0]  # type: ignore[misc]
        compiled[0](self, *positional, **named)

    cls.__init__ = __init__  # type: ignore[misc]
    cls.__signature__ = _LazySignature()  # type: ignore[attr-defined]


def _compiled_init(cls: type) -> Callable[..., None]:
    """The `__init__` of a dataclass, which stores its parameters as the fields.

    Names of its own begin with an underscore and a verb, as `_set_on`, so that a field may have any usual name.
    """
    fields = [field for field in dataclasses.fields(cls) if field.init]
    namespace: dict[str, Any] = {"_MISSING": dataclasses.MISSING}
    head = {False: ["_set_on"], True: ["*"]}
    body = ["_keep_in = _set_on.__dict__"]
    for field in fields:
        name, value = field.name, field.name
        default = ""
        if field.default is not dataclasses.MISSING:
            namespace[f"_default_{name}"], default = field.default, f"=_default_{name}"
        elif field.default_factory is not dataclasses.MISSING:
            namespace[f"_make_{name}"], default = field.default_factory, "=_MISSING"
            value = f"_make_{name}() if {name} is _MISSING else {name}"
        head[bool(field.kw_only)].append(f"{name}{default}")
        body.append(f"_keep_in[{name!r}] = {value}")
    if hasattr(cls, "__post_init__"):
        body.append("_set_on.__post_init__()")
    parameters = [*head[False], *(head[True] if len(head[True]) > 1 else [])]
    text = f"def __init__({', '.join(parameters)}):\n" + "".join(f"    {line}\n" for line in body)
    exec(compile(text, f"<{cls.__qualname__}.__init__>", "exec"), namespace)
    compiled: Callable[..., None] = namespace["__init__"]
    return compiled


class _LazySignature:
    """The signature of a frozen class for introspection: that of the compiled `__init__`."""

    def __get__(self, instance: object, owner: type) -> inspect.Signature:
        import inspect

        signature = inspect.signature(_compiled_init(owner))
        return signature.replace(parameters=list(signature.parameters.values())[1:])


def _values(self: Any) -> tuple[Any, ...]:
    """The values of the compared fields, in order."""
    return tuple(getattr(self, name) for name, field in self.__dataclass_fields__.items() if field.compare)


def __setattr__(self: Any, name: str, value: Any) -> None:
    """Store a field that only a `__post_init__` may set; all other assignments raise."""
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
    fields = (f"{name}={getattr(self, name)!r}" for name, field in self.__dataclass_fields__.items() if field.repr)
    return f"{type(self).__qualname__}({', '.join(fields)})"
