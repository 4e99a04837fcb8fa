"""One shard: a worker's results for some cases, in a file with its own checksum.

    line       MET shard 1
    8 bytes    length of the head, little-endian
    head       JSON: key, seconds, fates, arrays with their types and shapes
    arrays     outputs [case, output], history [case, row, column]; little-endian, one after the other
    32 bytes   SHA-256 of all before

It gets its name only when it is whole and on the disk. Still, `read` checks the sum, and its caller compares the key,
which covers everything that decided the numbers. A shard from another plan, cut short, or with a bit turned over, does
not count.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np

from met.frozen import frozen
from met.host.files import is_count, memory, open_regular, parse_json, whole_file
from met.run import FAILED, LOST, TIMED_OUT

MAGIC = b"MET shard 1\n"
SUM = hashlib.sha256
SUM_BYTES = SUM().digest_size
TYPES: dict[str, np.dtype[Any]] = {"f8": np.dtype("<f8"), "f4": np.dtype("<f4")}

HEAD_BYTES = 64 << 20
"""Largest size of a shard's head, bytes: the reasons why cases were not run take most of it."""


class UnsoundShard(Exception):
    """Raised for a file that does not count as a shard, with the reason, in words that follow its name."""


@frozen
class Shard:
    """The results of a task.

    key       of all that decided it (`tasks.CampaignSection.key`)
    outputs   [case, output]
    history   [case, row, column], float64 or float32; None where none is kept
    seconds   of computing
    fates     of cases that were not run, by their place here: status and why
    """

    key: str
    outputs: np.ndarray
    history: np.ndarray | None
    seconds: float
    fates: Mapping[int, tuple[int, str]] = field(default_factory=dict)

    @property
    def failed(self) -> int:
        """The number of cases that did not reach their end."""
        return self.failed_from(0)

    def failed_from(self, first: int) -> int:
        """The number of cases, from the `first` one on, that did not reach their end."""
        first = max(first, 0)
        return int(np.count_nonzero(self.outputs[first:, 0])) + sum(case >= first for case in self.fates)


def write(path: Path, shard: Shard) -> None:
    """Write a shard whole, or not at all. Raises OSError."""
    arrays = {"outputs": shard.outputs, **({} if shard.history is None else {"history": shard.history})}
    head = {
        "key": shard.key,
        "seconds": shard.seconds,
        "fates": [[case, *fate] for case, fate in shard.fates.items()],
        "arrays": [[name, _type(array), list(array.shape)] for name, array in arrays.items()],
    }
    text = json.dumps(head).encode()
    parts: list[Any] = [MAGIC, len(text).to_bytes(8, "little"), text]
    parts += [np.ascontiguousarray(a, TYPES[_type(a)]).data.cast("B") for a in arrays.values() if a.size]
    summed = SUM()
    with whole_file(path) as file:
        for part in parts:
            summed.update(part)
            _put(file.fileno(), part)
        _put(file.fileno(), summed.digest())


def read(path: Path, most: int | None = None) -> Shard:
    """The shard in a file; its arrays are writable. most: largest number of bytes. Raises UnsoundShard, OSError."""
    with open_regular(path) as file:
        size = os.fstat(file.fileno()).st_size
        if size > (memory() if most is None else most + HEAD_BYTES):
            raise UnsoundShard("is larger than its cases make it")
        data = bytearray(size)
        got = file.readinto(data)
    if got < len(data) or len(data) < len(MAGIC) + 8 + SUM_BYTES:
        raise UnsoundShard("is cut short")
    if not data.startswith(MAGIC):
        raise UnsoundShard("is no shard of this version of MET")
    body = memoryview(data)[:-SUM_BYTES]
    if SUM(body).digest() != data[-SUM_BYTES:]:
        raise UnsoundShard("is not what was written: its checksum differs")
    head_start = len(MAGIC) + 8
    end = head_start + int.from_bytes(data[len(MAGIC) : head_start], "little")
    try:
        return _shard_of(parse_json(bytes(body[head_start:end])), data, end)
    except (ValueError, LookupError, TypeError, AttributeError) as reason:
        raise UnsoundShard("has a head that does not go with what follows it") from reason


def _shard_of(head: Any, data: bytearray, start: int) -> Shard:
    """The shard with this head, whose arrays begin at a place of its file. Raises ValueError and the like for an
    invalid head, whose checksum may be right if it was forged."""
    arrays = {}
    for name, kind, shape in head["arrays"]:
        if not all(map(is_count, shape)):
            raise ValueError(shape)
        size = math.prod(shape)
        if start + size * TYPES[kind].itemsize > len(data) - SUM_BYTES:
            raise ValueError(shape)
        arrays[name] = np.frombuffer(data, TYPES[kind], size, start).reshape(shape)
        start += size * TYPES[kind].itemsize
    outputs, history, seconds = arrays.pop("outputs"), arrays.pop("history", None), float(head["seconds"])
    if arrays or start != len(data) - SUM_BYTES or outputs.ndim != 2 or outputs.dtype != TYPES["f8"] or seconds < 0.0:
        raise ValueError(head)
    if history is not None and (history.ndim != 3 or len(history) != len(outputs)):
        raise ValueError(head)
    fates = {case: (status, why) for case, status, why in head["fates"]}
    for case, (status, why) in fates.items():
        if not is_count(case, len(outputs) - 1) or status not in (FAILED, TIMED_OUT, LOST) or not isinstance(why, str):
            raise ValueError(case)
    if not isinstance(head["key"], str):
        raise ValueError(head)
    return Shard(head["key"], outputs, history, seconds, fates)


def cannot_keep(folder: Path, reason: OSError) -> str:
    """The error that a shard cannot be written."""
    return f"cannot keep what was computed in {folder}: {(reason.strerror or str(reason)).lower()}"


def _type(array: np.ndarray) -> str:
    return "f4" if array.dtype == np.float32 else "f8"


def _put(file: int, data: bytes | memoryview) -> None:
    left = memoryview(data)
    while len(left):
        left = left[os.write(file, left) :]
