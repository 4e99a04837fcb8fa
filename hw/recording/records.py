"""Records: the command and the answer of every exchange with a bed, one record each. A run is made again from them.

    line       MET bed records 1
    8 bytes    length of the head, little-endian
    head       JSON, of whoever writes it
    records    `LAYOUT` each, little-endian; the last four bytes are the CRC-32 of those before

Records are appended, so a file that was cut short lacks its end and nothing else.
"""

from __future__ import annotations

import json
import math
import struct
import zlib
from pathlib import Path
from typing import IO, Any

import numpy as np

from hw.bed import BedSample
from met.frozen import frozen
from met.host.files import parse_json, read_regular

MAGIC = b"MET bed records 1\n"

LAYOUT = np.dtype(
    [
        ("exchange", "<u4"),
        ("bed", "<u2"),
        ("flags", "<u2"),
        ("status", "<u4"),
        ("tick", "<u4"),
        ("due", "<i8"),
        ("began", "<i8"),
        ("ended", "<i8"),
        ("computed", "<i8"),
        ("voltage", "<f8"),
        ("current", "<f8"),
        ("rate", "<f8"),
        ("angle", "<f8"),
        ("drive_current", "<f8"),
        ("acceleration", "<f8"),
        ("crc", "<u4"),
    ]
)
"""exchange, bed: their numbers from 0;  flags: `ANSWERED` and others;  status: state and faults;  tick: the bed's
due, began, ended, computed: ns of the host's clock from the first exchange: when it was to begin, began, was answered,
and when the kernel was done with the answer before it
voltage V, current A: as told;  the rest as answered, not-a-number where there is none."""

_BODY = struct.Struct("<IHHIIqqqqdddddd")
SIZE = LAYOUT.itemsize
assert _BODY.size + 4 == SIZE

ANSWERED, LATE_WOKEN, LATE_COMPUTED, LATE_ANSWERED = 1, 2, 4, 8
"""Flags: an answer came; the exchange began a period late or more, for the host woke too late, computed too long, or
waited for the answer before."""

_NONE = math.nan


def packed(
    exchange: int,
    bed: int,
    flags: int,
    times: tuple[int, int, int, int],
    voltage: float,
    current: float,
    sample: BedSample | None,
) -> bytes:
    """The bytes of a record. times: due, began, ended, computed, in ns from the first exchange."""
    if sample is None:
        body = _BODY.pack(exchange, bed, flags, 0, 0, *times, voltage, current, _NONE, _NONE, _NONE, _NONE)
    else:
        body = _BODY.pack(
            exchange,
            bed,
            flags | ANSWERED,
            sample.state | sample.faults,
            sample.tick,
            *times,
            voltage,
            current,
            sample.rate,
            _NONE if sample.angle is None else sample.angle,
            _NONE if sample.drive_current is None else sample.drive_current,
            _NONE if sample.acceleration is None else sample.acceleration,
        )
    return body + zlib.crc32(body).to_bytes(4, "little")


def begin(file: IO[bytes], head: dict[str, Any]) -> None:
    """Write the magic line and the head, which stand before the records."""
    text = json.dumps(head).encode()
    file.write(MAGIC + len(text).to_bytes(8, "little") + text)


@frozen
class Records:
    """The contents of a file of records. cut: bytes at its end that are no whole record, which a killed writer
    leaves."""

    head: dict[str, Any]
    rows: np.ndarray
    cut: int


class UnsoundRecords(Exception):
    """A file that holds no records. Its text is the reason, in words that go on after the file's name."""


def read(path: Path) -> Records:
    """Read all records up to the first that is not sound. A file that ends before the first has none, and an empty
    head. Raises UnsoundRecords, OSError."""
    data = read_regular(path)
    if not data.startswith(MAGIC[: len(data)]):
        raise UnsoundRecords("holds no records of a bed")
    head_start = len(MAGIC) + 8
    end = head_start + int.from_bytes(data[len(MAGIC) : head_start], "little")
    if len(data) < max(head_start, end):
        return Records({}, np.empty(0, LAYOUT), len(data))
    try:
        head = parse_json(data[head_start:end])
        if not isinstance(head, dict):
            raise ValueError
    except ValueError as reason:
        raise UnsoundRecords("has a head that is damaged") from reason
    count = (len(data) - end) // SIZE
    rows = np.frombuffer(data, LAYOUT, count, end)
    for n in range(count):
        start = end + n * SIZE
        if zlib.crc32(data[start : start + SIZE - 4]) != rows["crc"][n]:
            rows = rows[:n]
            break
    return Records(head, rows, len(data) - end - len(rows) * SIZE)
