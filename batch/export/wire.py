"""Protobuf messages of MET's own: their schemas, and their bytes.

The fields of these messages are joints, components and metrics, so they differ from deck to deck and no compiler made
them. The encoding (protobuf.dev/programming-guides/encoding) is small: a key, which is the field's number and how it is
written, then a double's eight bytes, an integer's groups of seven bits, or a length and what is so long.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

import numpy as np

from met.frozen import frozen

PACKAGE = "met"
DOUBLE, VARINT, LENGTH = 1, 0, 2
"""Protobuf's wire types: 8 bytes, a varint, and bytes after their length."""

Kind = Literal["double", "int64", "string"]


@frozen
class MessageField:
    """A field of a message. within: the fields of a message field; many: True for a repeated field"""

    name: str
    kind: Kind = "double"
    within: tuple[MessageField, ...] = ()
    many: bool = False


def tree(paths: Sequence[tuple[str, ...]]) -> tuple[MessageField, ...]:
    """Fields of numbers by their paths: `("elbow", "x")` is `elbow.x`."""
    inner: dict[str, list[tuple[str, ...]]] = {}
    for name, *rest in paths:
        inner.setdefault(name, []).extend([tuple(rest)] if rest else [])
    return tuple(MessageField(name, within=tree(rests)) for name, rests in inner.items())


def schema(name: str, fields: Sequence[MessageField]) -> bytes:
    """A FileDescriptorSet with the message `met.<name>`, which describes such messages to any reader."""
    from google.protobuf.descriptor_pb2 import FileDescriptorSet

    out = FileDescriptorSet()
    file = out.file.add(name=f"{PACKAGE}/{name}.proto", package=PACKAGE, syntax="proto3")
    _describe(file.message_type.add(name=name), fields, f".{PACKAGE}.{name}")
    return out.SerializeToString(deterministic=True)


def _describe(message: Any, fields: Sequence[MessageField], path: str) -> None:
    """Add fields to the description of a message; equal inner messages are described once."""
    from google.protobuf.descriptor_pb2 import FieldDescriptorProto as Of

    kinds = {"double": Of.TYPE_DOUBLE, "int64": Of.TYPE_INT64, "string": Of.TYPE_STRING}
    types: dict[tuple[MessageField, ...], str] = {}
    for number, field in enumerate(fields, 1):
        label = Of.LABEL_REPEATED if field.many else Of.LABEL_OPTIONAL
        # a name in JSON equal to the name itself: derived ones may coincide, as of `a_b` and `aB`
        description = message.field.add(name=field.name, number=number, label=label, json_name=field.name)
        if not field.within:
            description.type = kinds[field.kind]
            continue
        if field.within not in types:
            own = f"Part{len(types) + 1}"
            while any(own == field.name for field in fields):  # types and fields share their names
                own += "_"
            types[field.within] = own
            _describe(message.nested_type.add(name=own), field.within, f"{path}.{own}")
        description.type, description.type_name = Of.TYPE_MESSAGE, f"{path}.{types[field.within]}"


def rows(fields: Sequence[MessageField], values: np.ndarray) -> list[bytes]:
    """The message of each row of numbers (row, number), the numbers in the order of the fields: all are equally long
    and differ in their doubles alone."""
    template = bytearray()
    places: list[int] = []
    for part in _parts(fields):
        places += [len(template)] if part is None else []
        template += bytes(8) if part is None else part
    count, size = len(values), len(template)
    out = np.tile(np.frombuffer(bytes(template), np.uint8), (count, 1))
    doubles = np.ascontiguousarray(values, "<f8").view(np.uint8).reshape(count, len(places), 8)
    for column, place in enumerate(places):
        out[:, place : place + 8] = doubles[:, column]
    data = out.tobytes()
    return [data[start : start + size] for start in range(0, count * size, size)] if size else [b""] * count


def _parts(fields: Sequence[MessageField]) -> Iterator[bytes | None]:
    """A message of numbers in pieces: the parts that are the same in all, and None for each double."""
    for number, field in enumerate(fields, 1):
        if field.within:
            inner = list(_parts(field.within))
            yield _key(number, LENGTH) + varint(sum(8 if part is None else len(part) for part in inner))
            yield from inner
        else:
            yield _key(number, DOUBLE)
            yield None


def message(fields: Sequence[MessageField], data: Mapping[str, Any]) -> bytes:
    """One message: a value for each field by its name, a mapping for a message, a sequence where there may be many."""
    out = bytearray()
    for number, field in enumerate(fields, 1):
        for value in data[field.name] if field.many else (data[field.name],):
            if not field.within and field.kind == "double":
                out += _key(number, DOUBLE) + struct.pack("<d", value)
            elif not field.within and field.kind == "int64":
                out += _key(number, VARINT) + varint(int(value) & (1 << 64) - 1)
            else:
                content = message(field.within, value) if field.within else plain(value).encode()
                out += _key(number, LENGTH) + varint(len(content)) + content
    return bytes(out)


def plain(text: str) -> str:
    """Text that can be encoded: file names may contain characters that cannot."""
    return text.encode("utf-8", "replace").decode()


def _key(number: int, wire: int) -> bytes:
    return varint(number << 3 | wire)


def varint(value: int) -> bytes:
    """A whole number in groups of seven bits, the lowest first; all but the last group have the eighth bit set."""
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)
