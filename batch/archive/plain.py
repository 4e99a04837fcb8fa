"""A check, before anything is read, that an archive is one file that refers to no other.

HDF5 follows references in a file. External storage could make any file of this machine a dataset's values, which `met
export` would then write; external links and virtual datasets open other files, filters load foreign code, and a named
pipe among these blocks. MET writes none of them, and refuses them all for every reader. The check opens nothing: HDF5
follows references only when values or sizes are read.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from io import BufferedReader
from pathlib import Path
from typing import Any

from batch.archive import room
from batch.archive.hdf5 import h5py
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
        room.check_heaps(raw, os.fstat(raw.fileno()).st_size)
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
            why = _dataset(node) or room.check(node, size, raw.fileno())
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
    for code in (creation.get_filter(number)[0] for number in range(creation.get_nfilters())):
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
