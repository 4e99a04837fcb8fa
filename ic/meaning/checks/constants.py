"""Values of a run's parameters that are the same in all cases, for checks that need them before the cases are known."""

from __future__ import annotations

from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

from ic.meaning.parameters.owner import XYZ
from ic.meaning.parameters.scope import Scope
from met.parameter import Parameter
from met.trace import Scalar


def constant_value(scope: Scope, path: str) -> Any:
    """A parameter's value: a number or a word; None where it varies, or is unknown."""
    settled = scope.settled(path)
    return None if settled is None or isinstance(settled.value, Scalar) else settled.value


def constant_values(scope: Scope, head: str, declared: Iterable[Parameter]) -> SimpleNamespace | None:
    """The values of a model's parameters, as attributes of their names; None where one varies, or is unknown.
    Those that are there only under some words are left out.

    head  path of the model's use, such as `environment.stop`
    """
    values: dict[str, Any] = {}
    for parameter in (parameter for parameter in declared if parameter.only is None):
        path = f"{head}.{parameter.name}"
        if parameter.shape == "vector":
            parts = tuple(constant_value(scope, f"{path}.{axis}") for axis in XYZ)
            values[parameter.name] = None if None in parts else parts
        else:
            values[parameter.name] = constant_value(scope, path)
    return None if None in values.values() else SimpleNamespace(**values)
