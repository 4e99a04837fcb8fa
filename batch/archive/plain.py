"""A check, before anything is read, that an archive is one file that refers to no other.

HDF5 follows references in a file. External storage could make any file of this machine a dataset's values, which `met
export` would then write; external links and virtual datasets open other files, filters load foreign code, and a named
pipe among these blocks. MET writes none of them, and refuses them all for every reader. The check opens nothing: HDF5
follows references only when values or sizes are read.

HDF5 unpacks a chunk until its compressed stream ends, even beyond the chunk's size, filters may be stacked, and any
number of strings may share the same bytes of the file. So some kilobytes could fill the memory of a machine. Here a
chunk is unpacked only up to its size, and strings are counted by their lengths. The heaps of strings are walked through
once, since HDF5 itself would loop for ever in a damaged one.
"""

from __future__ import annotations

import math
import mmap
import os
import zlib
from collections.abc import Iterator
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np

from batch.archive.hdf5 import h5py
from batch.archive.stored import Unlike
from met.diagnostic import Problem, error
from met.host.files import open_regular

DEEPEST = 64
"""Largest depth of nested groups: a file of thousands takes minutes to open."""

MOST_ATTRIBUTES = 1000
"""Largest number of attributes of an object; MET writes some dozens. HDF5 searches for each anew: thousands take
minutes."""

SCALES = ("DIMENSION_LIST", "REFERENCE_LIST")
"""Attributes by which HDF5 itself records a dataset's dimensions: references to datasets of the same file."""


def check(file: Any, path: Path) -> None:
    """Refuse an open file (h5py.File) that refers to others, or holds objects that no archive has. Raises Problem E308,
    Unlike."""
    with open_regular(path) as raw:
        check_heaps(raw, os.fstat(raw.fileno()).st_size)
        for where, why in _wrong(file.id, raw):
            message = f"the archive {path} holds what MET writes into none: `{where}` {why}"
            helps = (
                "nothing of it was read: an archive is one file, leads to no other, and runs nothing",
                "ask whoever made it for the archive as `met run` wrote it",
            )
            raise Problem(error("E308", message, help=helps))


def _wrong(root: Any, raw: BufferedReader) -> Iterator[tuple[str, str]]:
    """Each object of a file that an archive must not have, with its name and the reason. raw: the file itself"""
    module = h5py()
    size = os.fstat(raw.fileno()).st_size
    seen = set()
    waiting = [("", root)]
    while waiting:
        where, node = waiting.pop()
        about = module.h5o.get_info(node)
        if (about.fileno, about.addr) in seen:
            continue
        seen.add((about.fileno, about.addr))
        yield from _attributes(where or "/", node)
        if isinstance(node, module.h5d.DatasetID):
            why = _dataset(node) or check_room(node, size, raw.fileno())
            if why:
                yield where, why
        elif isinstance(node, module.h5g.GroupID):
            if where.count("/") >= DEEPEST:
                yield where, f"is in more than {DEEPEST} groups, one in another"
            for name, kind in _links(node):
                inside = f"{where}/{name.decode('utf-8', 'replace')}".removeprefix("/")
                if kind != module.h5l.TYPE_HARD:
                    yield inside, "is a link to elsewhere"
                    return
                waiting.append((inside, module.h5o.open(node, name)))
        else:
            yield where, "is a type of numbers by itself"


def _links(group: Any) -> list[tuple[bytes, int]]:
    """The names of a group's links, with their kinds."""
    links: list[tuple[bytes, int]] = []

    def take(name: bytes, about: Any) -> None:
        links.append((name, about.type))

    group.links.iterate(take, info=True)
    return links


def _dataset(node: Any) -> str:
    """The reason why a dataset cannot be an archive's; empty where it can. Its values and size are not read before it
    is known where they are."""
    module = h5py()
    creation = node.get_create_plist()
    if creation.get_layout() == module.h5d.VIRTUAL:
        return "is put together from other files (a virtual dataset)"
    if creation.get_external_count():
        return "has its values in another file (external storage)"
    own = (module.h5z.FILTER_DEFLATE, module.h5z.FILTER_SHUFFLE, module.h5z.FILTER_FLETCHER32)
    for code in _packers(node):
        if code not in own:
            return f"is packed by other people's code (HDF5's filter {code})"
    kind = node.get_type()
    if kind.get_class() not in (module.h5t.INTEGER, module.h5t.FLOAT, module.h5t.STRING):
        return "is neither of numbers nor of strings"
    return ""


def _attributes(where: str, node: Any) -> Iterator[tuple[str, str]]:
    """The attributes of an object that are neither numbers nor strings, nor written by HDF5 itself."""
    module = h5py()
    plain = (module.h5t.INTEGER, module.h5t.FLOAT, module.h5t.STRING, module.h5t.ENUM)
    count = module.h5a.get_num_attrs(node)
    if count > MOST_ATTRIBUTES:
        yield where, f"has {count:,} attributes"
        return
    for number in range(count):
        attribute = module.h5a.open(node, index=number)
        kind = attribute.get_type()
        if kind.get_class() in plain:
            continue
        name = attribute.name.decode("utf-8", "replace")
        if name not in SCALES or not _refers(kind):
            yield f"{where}:{name}", "is neither of numbers nor of strings"


def _refers(kind: Any) -> bool:
    """True for the type of HDF5's attributes of dimension scales, whose references stay in the file."""
    module = h5py()
    if kind.get_class() == module.h5t.VLEN:
        kind = kind.get_super()
    elif kind.get_class() == module.h5t.COMPOUND:
        if any(kind.get_member_class(n) != module.h5t.INTEGER for n in range(1, kind.get_nmembers())):
            return False
        kind = kind.get_member_type(0)
    return bool(kind.equal(module.h5t.STD_REF_OBJ))


PACKED = 1100
"""Largest number of bytes that a byte of a file can hold: 1032 for deflated zeros, and a little more."""

SMALL = 1 << 20
"""Size of a dataset, in bytes, that is allowed in any file."""

CHECKSUM = 4
"""Number of bytes that fletcher32 appends to a chunk."""

HEAP = b"GCOL\x01\0\0\0"
"""The first bytes of a global heap, HDF5's store of strings."""

SEARCHED = 64 << 20
"""Size of the parts at both ends of a file in which heaps are searched for: more would take seconds for a large
archive."""

PIECE = 16 << 16
"""Bytes of a dataset that are examined together, a whole number of strings."""

REFERENCE = np.dtype([("length", "<u4"), ("address", "<u8"), ("index", "<u4")])
"""The stored reference of a variable-length string in a dataset: its length and place."""


def check_heaps(raw: BufferedReader, size: int) -> None:
    """Refuse heaps of strings in which HDF5 would loop for ever: those with a gap of no bytes, as on a damaged disk.
    size: of the file. Raises Unlike."""
    if not size:
        return
    with mmap.mmap(raw.fileno(), 0, access=mmap.ACCESS_READ) as data:
        for first, last in {(0, min(size, SEARCHED)), (max(0, size - SEARCHED), size)}:
            heap_start = data.find(HEAP, first, last)
            while heap_start >= 0:
                if _endless(data, heap_start, size):
                    raise Unlike("its strings are not where they should be")
                heap_start = data.find(HEAP, heap_start + 1, last)


def _endless(data: mmap.mmap, start: int, size: int) -> bool:
    """True if a heap that begins here has a gap of no bytes, which would stop a reader's progress."""
    if start + 16 > size:
        return False
    end = min(size, start + int.from_bytes(data[start + 8 : start + 16], "little"))
    entry_start = start + 16
    while entry_start + 16 <= end:
        used = data[entry_start : entry_start + 2] != b"\0\0"
        length = int.from_bytes(data[entry_start + 8 : entry_start + 16], "little")
        if not used and not length:
            return True
        entry_start += 16 + -(-length // 8) * 8 if used else length
    return False


def check_room(node: Any, size: int, file: int) -> str:
    """The reason why a dataset (h5py.h5d.DatasetID) declares more than its file has room for; empty where it does not.

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
    """Raised for a chunk whose stream goes on after the chunk is full, or is invalid."""


def _packers(node: Any) -> list[int]:
    """HDF5's numbers of the filters of a dataset, in the order in which they compress."""
    creation = node.get_create_plist()
    return [creation.get_filter(number)[0] for number in range(creation.get_nfilters())]


def _stored(node: Any, packers: list[int], file: int, width: int) -> Iterator[bytes]:
    """The bytes of a dataset's values as the file has them, unpacked, part by part. width: of a value, in bytes."""
    module = h5py()
    creation = node.get_create_plist()
    layout = creation.get_layout()
    if layout == module.h5d.CONTIGUOUS:
        offset, size = node.get_offset(), node.get_storage_size()
        for start in range(0, size, PIECE) if offset is not None else ():
            piece = os.pread(file, min(PIECE, size - start), offset + start)
            if not piece:  # the file ends before its declared end
                break
            yield piece
    elif layout == module.h5d.COMPACT:  # a few values, stored in the dataset's header: one by one
        read = module.Dataset(node)
        for place in np.ndindex(node.shape):
            yield np.array((len(read[place]), 0, 0), REFERENCE).tobytes()
    elif layout == module.h5d.CHUNKED:
        full = math.prod(creation.get_chunk()) * width
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
    """A chunk's bytes, `full` of them. mask: bits of the filters that this chunk skipped. Raises _Overfull."""
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
    """The total length of the strings to which these references point."""
    count = len(stored) // REFERENCE.itemsize
    return int(np.frombuffer(stored, REFERENCE, count)["length"].sum(dtype=np.uint64))
