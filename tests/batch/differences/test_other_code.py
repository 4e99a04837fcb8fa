"""What a diff says of programs: another motion, a metric that is computed otherwise, keys that cannot be compared."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import pytest

from batch.differences.provenance import provenance_changes
from met.plan import Plan

ONE, OTHER = f"2:{'0' * 64}", f"2:{'1' * 64}"


def said(a: Mapping[str, Any], b: Mapping[str, Any]) -> tuple[tuple[str, ...], tuple[tuple[str, str], ...]]:
    """What is told of the programs of two groups, each a key of the state and keys of what is in it by name."""

    def side(keys: Mapping[str, Any]) -> Any:
        own = dict(keys)
        state = own.pop("", None)
        attributes = {} if state is None else {"code_key": state}
        variables = {
            name: SimpleNamespace(attributes={} if key is None else {"code_key": key}) for name, key in own.items()
        }
        return SimpleNamespace(name="nominal", attributes=attributes, variables=variables, single=False)

    group_a, group_b = side(a), side(b)
    files: Any = [SimpleNamespace(provenance={}, sources=dict) for _ in range(2)]
    found = provenance_changes(*files, [(group_a, group_b)], [Plan("d.ic", ()), Plan("d.ic", ())])
    return found.code, found.results


@pytest.mark.parametrize(
    ("a", "b", "code", "results"),
    [
        ({"": ONE, "volts": ONE}, {"": ONE, "volts": ONE}, (), ()),
        ({"": ONE, "volts": ONE}, {"": OTHER, "volts": OTHER}, ("nominal",), ()),
        ({"": ONE, "volts": ONE, "q": ONE}, {"": ONE, "volts": OTHER, "q": ONE}, (), (("nominal", "volts"),)),
        ({"": ONE, "volts": ONE}, {"": ONE}, (), ()),
        ({"": ONE, "volts": ONE}, {"": ONE, "volts": None}, (), ()),
        ({"": "0" * 64}, {"": ONE}, (), ()),
        ({"": "0" * 64}, {"": "1" * 64}, ("nominal",), ()),
        ({"": ONE}, {"": None}, (), ()),
    ],
)
def test_programs_are_told_apart_where_their_keys_are_of_a_kind(
    a: dict[str, Any], b: dict[str, Any], code: tuple[str, ...], results: tuple[tuple[str, str], ...]
) -> None:
    assert said(a, b) == (code, results)
