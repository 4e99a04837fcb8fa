"""Old names in the interface for plugins: they work for one more version, each use with a DeprecationWarning."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

C = TypeVar("C", bound=type)


def old_names(module: str, names: Mapping[str, str], namespace: Mapping[str, Any]) -> Callable[[str], Any]:
    """The `__getattr__` of a module whose names were renamed.

    names      old name -> new name;  namespace: the module's `globals()`
    """

    def find(name: str) -> Any:
        if name not in names:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        _warn(f"{module}.{name}", f"{module}.{names[name]}")
        return namespace[names[name]]

    return find


def old_fields(**names: str) -> Callable[[C], C]:
    """Decorate a dataclass whose fields were renamed, old name=new name: the old names work as arguments and attributes
    too."""

    def decorate(cls: C) -> C:
        """The class with its fields' old names, to be given and read, each with a DeprecationWarning."""
        make = cls.__init__  # type: ignore[misc]

        @functools.wraps(make)
        def __init__(self: Any, *values: Any, **fields: Any) -> None:
            for old in names.keys() & fields.keys():
                _warn(f"{cls.__name__}({old}=...)", f"{cls.__name__}({names[old]}=...)")
                fields[names[old]] = fields.pop(old)
            make(self, *values, **fields)

        cls.__init__ = __init__  # type: ignore[misc]
        for old, new in names.items():
            read = functools.partial(_read, old=old, new=new)
            setattr(cls, old, property(read, doc=f"The old name of `{new}`."))
        return cls

    return decorate


def _read(record: Any, *, old: str, new: str) -> Any:
    _warn(f"{type(record).__name__}.{old}", f"{type(record).__name__}.{new}")
    return getattr(record, new)


def _warn(old: str, new: str) -> None:
    warnings.warn(f"`{old}` is now `{new}`; the old name goes with MET 0.2", DeprecationWarning, stacklevel=4)
