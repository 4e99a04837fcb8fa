"""The only module that imports h5py, late and with the settings that archives need."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

SIGNATURE = b"\x89HDF\r\n\x1a\n"

LIBVER = ("earliest", "v110")
"""File format, which every reader of the last ten years opens."""


def h5py() -> Any:
    """The module h5py. Locks are off: they fail on network disks, and an archive gets its name only when it is
    whole."""
    os.environ.setdefault("HDF5_USE_FILE_LOCKING", "FALSE")
    import h5py as module

    return module


LONGEST_TEXT = 1 << 15
"""Most bytes of an attribute of fixed length: HDF5 takes 64 KiB for all of it. A longer text is of variable length."""


def put_attributes(node: Any, attributes: Mapping[str, Any]) -> None:
    """Write attributes of a group or dataset in their order.

    A text gets the length that it has, as netCDF writes texts: readers take it for characters. One of variable length
    is a string to netCDF, which NCO does not accept as CF's `coordinates`, and Octave's `ncreadatt` not at all.
    """
    h5t = h5py().h5t
    for name, value in attributes.items():
        data = value.encode() if isinstance(value, str) else b""
        if not isinstance(value, str) or len(data) > LONGEST_TEXT:
            node.attrs[name] = value
            continue
        kind = h5t.C_S1.copy()
        kind.set_size(max(1, len(data)))
        kind.set_strpad(h5t.STR_NULLTERM if not data else h5t.STR_NULLPAD)
        kind.set_cset(h5t.CSET_ASCII if data.isascii() else h5t.CSET_UTF8)
        node.attrs.create(name, data, dtype=h5py().Datatype(kind))
