"""Frozen classes are dataclasses that are called, compared and refused as others are."""

from __future__ import annotations

import dataclasses
import inspect
import pickle

import pytest

from met.frozen import frozen


@frozen
class Point:
    x: float
    y: float = 2.0
    names: list[str] = dataclasses.field(default_factory=list)


@frozen
class Named(Point):
    name: str = "p"


@frozen(kw_only=True)
class Keyed:
    first: int
    second: int = 2


def test_fields_are_taken_by_place_and_by_name_with_their_defaults() -> None:
    assert (Point(1.0).x, Point(1.0, y=3.0).y, Point(1.0).names) == (1.0, 3.0, [])
    assert Point(1.0).names is not Point(1.0).names
    assert (Named(1.0, 2.0, [], "q").name, Named(1.0).name) == ("q", "p")


@pytest.mark.parametrize("wrong", [lambda: Point(), lambda: Point(1.0, z=1.0), lambda: Keyed(1)])
def test_a_call_that_does_not_fit_is_a_type_error(wrong) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(TypeError):
        wrong()


def test_a_field_may_have_any_name_that_code_of_its_own_might_use() -> None:
    names = ["own", "self", "fields", "given", "cls", "value", "dict"]
    made = frozen(type("Named", (), {"__annotations__": dict.fromkeys(names, int)}))
    assert made(*range(7)).__dict__ == dict(zip(names, range(7), strict=True))  # type: ignore[call-arg]


def test_a_decorator_that_wraps_the_init_is_still_there_after_the_first_instance() -> None:
    made: list[str] = []

    @frozen
    class Wrapped:
        x: int

    inner = Wrapped.__init__
    Wrapped.__init__ = lambda self, x: made.append("wrapped") or inner(self, x)  # type: ignore[method-assign, func-returns-value]
    assert (Wrapped(1).x, Wrapped(2).x, made) == (1, 2, ["wrapped", "wrapped"])


def test_a_signature_is_that_of_the_fields_before_and_after_the_first_instance() -> None:
    before = str(inspect.signature(Keyed))
    assert before == "(*, first, second=2)"
    Keyed(first=1)
    assert str(inspect.signature(Keyed)) == before and list(inspect.signature(Point).parameters) == ["x", "y", "names"]


def test_an_instance_cannot_be_changed_and_is_compared_by_its_fields() -> None:
    point = Point(1.0)
    with pytest.raises(dataclasses.FrozenInstanceError):
        point.x = 2.0  # type: ignore[misc]
    with pytest.raises(dataclasses.FrozenInstanceError):
        del point.x
    assert point == Point(1.0) != Point(2.0) and Keyed(first=1) == Keyed(first=1, second=2)
    assert dataclasses.replace(Keyed(first=1), second=5) == Keyed(first=1, second=5)
    assert pickle.loads(pickle.dumps(point)) == point
