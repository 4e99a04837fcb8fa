"""Plugins that were written with names of MET 0.1.0 work on, with a warning that says the new name."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from met.environments.environment import Environment
from met.parameter import State
from met.servos.servo import Drive, Seen, Setpoint


@pytest.mark.parametrize(
    ("module", "old", "new"),
    [
        ("met.servos.servo", "Asked", "Setpoint"),
        ("met.substitution.law", "Told", "LawInput"),
        ("met.substitution.law", "Given", "LawOutput"),
    ],
)
def test_a_class_is_found_by_its_old_name(module: str, old: str, new: str) -> None:
    place = importlib.import_module(module)
    with pytest.warns(DeprecationWarning, match=f"`{module}.{old}` is now `{module}.{new}`"):
        found = getattr(place, old)
    assert found is getattr(place, new)


def test_a_name_that_never_was_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match=r"module 'met.servos.servo' has no attribute 'Wanted'"):
        importlib.import_module("met.servos.servo").Wanted  # noqa: B018


def test_a_setpoint_is_read_and_given_by_its_old_name() -> None:
    setpoint, other = Setpoint("rate", 1.0, 0.0), Setpoint("rate", 2.0, 0.0)
    seen = Seen(q=0.0, qd=0.0, setpoint=setpoint, period=0.001)
    with pytest.warns(DeprecationWarning, match=r"`Seen.asked` is now `Seen.setpoint`"):
        assert seen.asked is setpoint  # type: ignore[attr-defined]
    with pytest.warns(DeprecationWarning, match=r"`Seen\(asked=...\)` is now `Seen\(setpoint=...\)`"):
        assert Seen(q=0.0, qd=0.0, asked=setpoint, period=0.001) == seen  # type: ignore[call-arg]
    with pytest.warns(DeprecationWarning, match="the old name goes with MET 0.2"):
        assert replace(seen, asked=other).setpoint is other  # type: ignore[call-arg]


def hook(*_: Any) -> Any:
    """Stands for any function of a model."""


OLD_HOOKS = {
    "pushes": "pushed_links",
    "between": "initial_range",
    "rubs": "friction_joint",
    "loose": "decoupling",
    "gives": "replaced_outputs",
    "sees": "replaced_reading",
    "falls": "free_fall",
    "turns": "world_rate",
}


@pytest.mark.parametrize(("old", "new"), OLD_HOOKS.items())
def test_a_hook_of_an_environment_may_have_its_old_name(old: str, new: str) -> None:
    with pytest.warns(DeprecationWarning, match=rf"`Environment\({old}=...\)` is now `Environment\({new}=...\)`"):
        model = Environment(name="wind", doc="", **{old: hook})  # type: ignore[arg-type]
    assert getattr(model, new) is hook
    assert model == Environment(name="wind", doc="", **{new: hook})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("make", "new"),
    [
        (lambda: Drive(astray=True), "state_out_of_range"),
        (lambda: State(name="deflection", unit="joint", doc="", between=True), "in_transmission"),
    ],
)
def test_a_field_of_a_servo_may_have_its_old_name(make: Callable[[], Any], new: str) -> None:
    with pytest.warns(DeprecationWarning, match=f"is now `.*{new}"):
        assert getattr(make(), new) is True
