"""Whether a file has room for what it says it holds: asked of every dataset before its values are.

HDF5 unpacks a chunk until its packer's stream ends, however little the chunk should hold, packers may be stacked, and
any number of strings may be the same bytes of the file. So some kilobytes could fill the memory of a machine. Here a
chunk is unpacked no further than to what it should hold, and strings are counted by their lengths. And where strings
lie is walked through once, for HDF5 itself does so without an end in a heap that is damaged.
"""

from __future__ import annotations

import math
import mmap
import os
import zlib
from collections.abc import Iterator
from io import BufferedReader
from typing import Any

import numpy as np

from batch.archive.hdf5 import h5py
from batch.archive.stored import Unlike

PACKED = 1100
"""Bytes that a byte of a file may hold, at most: what deflate makes of zeros, 1032, and a little."""

SMALL = 1 << 20
"""Bytes that a dataset may have in any file."""

CHECKSUM = 4
"""Bytes that fletcher32 puts behind a chunk."""

HEAP = b"GCOL\x01\0\0\0"
"""The bytes that a global heap, HDF5's store of strings, begins with."""

SEARCHED = 64 << 20
"""Bytes at either end of a file in which heaps are looked for: more would take seconds of a large archive."""

PIECE = 16 << 16
"""Bytes of a dataset that are looked at together, a whole number of strings."""

REFERENCE = np.dtype([("length", "<u4"), ("address", "<u8"), ("index", "<u4")])
"""A string of any length, as a dataset has it: its length, and where it is."""


def check_heaps(raw: BufferedReader, size: int) -> None:
    """Refuse heaps of strings in which HDF5 would go round for ever: those with a gap of no bytes, as a damaged disk
    leaves them. size: of the file. Raises Unlike."""
    if not size:
        return
    with mmap.mmap(raw.fileno(), 0, access=mmap.ACCESS_READ) as data:
        for first, last in {(0, min(size, SEARCHED)), (max(0, size - SEARCHED), size)}:
            at = data.find(HEAP, first, last)
            while at >= 0:
                if _endless(data, at, size):
                    raise Unlike("its strings are not where they should be")
                at = data.find(HEAP, at + 1, last)


def _endless(data: mmap.mmap, start: int, size: int) -> bool:
    """True if a heap that begins here has a gap of no bytes, over which a reader would never get on."""
    if start + 16 > size:
        return False
    end = min(size, start + int.from_bytes(data[start + 8 : start + 16], "little"))
    at = start + 16
    while at + 16 <= end:
        used = data[at : at + 2] != b"\0\0"
        length = int.from_bytes(data[at + 8 : at + 16], "little")
        if not used and not length:
            return True
        at += 16 + -(-length // 8) * 8 if used else length
    return False


def check(node: Any, size: int, file: int) -> str:
    """Why a dataset (h5py.h5d.DatasetID) holds more than its file has room for; empty where it does not.

    size   of the file, in bytes
    file   the same file's descriptor, to read what HDF5 does not tell
    """
    module = h5py()
    kind = node.get_type()
    packers = _packers(node)
    if len(set(packers)) < len(packers):
        return "is packed twice over"
    claimed = math.prod(node.shape or ()) * kind.get_size()
    if claimed > max(SMALL, PACKED * min(size, node.get_storage_size())):
        return "has more values than the file has room for"
    words = kind.get_class() == module.h5t.STRING and kind.is_variable_str()
    width = REFERENCE.itemsize if words else kind.get_size()
    letters = 0
    try:
        if words or module.h5z.FILTER_DEFLATE in packers:
            for stored in _stored(node, packers, file, width):
                letters += _lengths(stored) if words else 0
                if letters > size:
                    return "has more letters than the file has room for"
    except _Overfull:
        return "has a chunk that is packed to more than it should hold"
    return ""


class _Overfull(Exception):
    """A chunk's stream goes on when the chunk is full, or is no such stream."""


def _packers(node: Any) -> list[int]:
    """HDF5's numbers of the filters of a dataset, in the order in which they pack."""
    made = node.get_create_plist()
    return [made.get_filter(number)[0] for number in range(made.get_nfilters())]


def _stored(node: Any, packers: list[int], file: int, width: int) -> Iterator[bytes]:
    """The bytes of a dataset's values as the file has them, unpacked, part by part. width: of a value, in bytes."""
    module = h5py()
    made = node.get_create_plist()
    layout = made.get_layout()
    if layout == module.h5d.CONTIGUOUS:
        offset, size = node.get_offset(), node.get_storage_size()
        for at in range(0, size, PIECE) if offset is not None else ():
            piece = os.pread(file, min(PIECE, size - at), offset + at)
            if not piece:  # the file ends before its own words say so
                break
            yield piece
    elif layout == module.h5d.COMPACT:  # a few values, in the file's own words about the dataset: one by one
        read = module.Dataset(node)
        for place in np.ndindex(node.shape):
            yield np.array((len(read[place]), 0, 0), REFERENCE).tobytes()
    elif layout == module.h5d.CHUNKED:
        full = math.prod(made.get_chunk()) * width
        places: list[tuple[tuple[int, ...], int]] = []

        def take(chunk: Any) -> None:
            places.append((chunk.chunk_offset, chunk.size))

        node.chunk_iter(take)
        for place, stored in places:
            if stored > full + SMALL:
                raise _Overfull
            mask, data = node.read_direct_chunk(place)
            yield _unpacked(data, packers, mask, full, width)


def _unpacked(data: bytes, packers: list[int], mask: int, full: int, width: int) -> bytes:
    """A chunk's bytes, `full` of them. mask: bits of the packers that this chunk went without. Raises _Overfull."""
    module = h5py()
    for number in reversed(range(len(packers))):
        if mask >> number & 1:
            continue
        if packers[number] == module.h5z.FILTER_DEFLATE:
            stream = zlib.decompressobj()
            try:
                data = stream.decompress(data, full + CHECKSUM + 1)
            except zlib.error:
                raise _Overfull from None
            if len(data) > full + CHECKSUM:
                raise _Overfull
        elif packers[number] == module.h5z.FILTER_FLETCHER32:
            data = data[:-CHECKSUM]
        elif len(data) == full:  # shuffled: first bytes of all values, then second ones
            data = np.frombuffer(data, np.uint8).reshape(width, -1).T.tobytes()
    return data


def _lengths(stored: bytes) -> int:
    """The letters of the strings that these bytes refer to."""
    count = len(stored) // REFERENCE.itemsize
    return int(np.frombuffer(stored, REFERENCE, count)["length"].sum(dtype=np.uint64))
