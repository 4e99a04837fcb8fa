"""Messages of our own say to protobuf's own reader what was put into them, whatever joints are called."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory

from batch.export.wire import MessageField, message, plain, rows, schema, tree, varint

NAMES = ("self", "None", "DESCRIPTOR", "Part1", "Part1_", "a_b", "aB", "a__b", "class", "data", "constructor", "x")


def read(name: str, fields: tuple[MessageField, ...], data: bytes) -> Any:
    """A message by the official decoder."""
    given = Schema(id=1, name=f"met.{name}", encoding="protobuf", data=schema(name, fields))
    decode = DecoderFactory().decoder_for("protobuf", given)
    assert decode is not None
    return decode(data)


def as_data(found: Any) -> dict[str, Any]:
    """A message's fields by name, messages within it too."""
    return {field.name: as_data(value) if field.message_type else value for field, value in found.ListFields()}


@pytest.mark.parametrize("components", [(), ("x", "y", "z")], ids=["numbers", "vectors"])
def test_every_number_comes_back_by_its_name(components: tuple[str, ...]) -> None:
    paths = [(name, *each) for name in NAMES for each in ([(c,) for c in components] or [()])]
    values = np.random.default_rng(1).normal(size=(5, len(paths)))
    fields = tree(paths)
    for row, data in zip(values, rows(fields, values), strict=True):
        found = as_data(read("q", fields, data))
        assert list(found) == list(NAMES)
        flat = [found[path[0]][path[1]] if components else found[path[0]] for path in paths]
        assert flat == row.tolist()


def test_fields_beyond_the_fifteenth_and_long_messages_come_back() -> None:
    paths = [(f"joint{n}", axis) for n in range(300) for axis in "xyz"]
    values = np.arange(1.0, 901.0)[None, :]
    found = as_data(read("q", tree(paths), rows(tree(paths), values)[0]))
    assert [found[joint][axis] for joint, axis in paths] == values[0].tolist()


def test_what_is_no_finite_number_comes_back_too() -> None:
    fields = tree([("a",), ("b",), ("c",), ("d",)])
    [data] = rows(fields, np.array([[math.inf, -math.inf, math.nan, -0.0]]))
    found = read("q", fields, data)
    assert (found.a, found.b, math.isnan(found.c), math.copysign(1.0, found.d)) == (math.inf, -math.inf, True, -1.0)


def test_numbers_of_four_bytes_are_widened() -> None:
    [data] = rows(tree([("a",)]), np.array([[0.1]], np.float32))
    assert read("q", tree([("a",)]), data).a == float(np.float32(0.1))


def test_no_rows_are_no_messages() -> None:
    assert rows(tree([("a",)]), np.empty((0, 1))) == []


ALL = (
    MessageField("count", "int64"),
    MessageField("text", "string"),
    MessageField("number"),
    MessageField("one", within=(MessageField("a"), MessageField("b", "string"))),
    MessageField("many", within=(MessageField("a"), MessageField("b", "string")), many=True),
    MessageField("words", "string", many=True),
)


@given(
    st.integers(-(2**63), 2**63 - 1),
    st.text(),
    st.floats(allow_nan=False),
    st.lists(st.text()),
    st.lists(st.fixed_dictionaries({"a": st.floats(allow_nan=False), "b": st.text()})),
)
@pytest.mark.slow
def test_a_message_of_any_kind_comes_back(
    count: int, text: str, number: float, words: list[str], many: list[dict[str, Any]]
) -> None:
    one = {"a": number, "b": text}
    data = {"count": count, "text": text, "number": number, "one": one, "many": many, "words": words}
    found = read("result", ALL, message(ALL, data))
    assert (found.count, found.text, found.number, found.one.b) == (count, plain(text), number, plain(text))
    assert list(found.words) == [plain(word) for word in words]
    assert [(each.a, each.b) for each in found.many] == [(each["a"], plain(each["b"])) for each in many]


def test_text_that_has_no_encoding_is_replaced() -> None:
    assert plain("a\udcffb") == "a?b"


def test_whole_numbers_are_in_groups_of_seven_bits() -> None:
    assert [varint(value) for value in (0, 127, 128, 300)] == [b"\0", b"\x7f", b"\x80\x01", b"\xac\x02"]
