"""Plugins that were written with names of MET 0.1.0 work on, with a warning that says the new name."""

from __future__ import annotations

import importlib
from dataclasses import replace

import pytest

from met.servos.servo import Seen, Setpoint


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
