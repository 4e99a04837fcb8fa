"""The only module that imports h5py, late and with the settings that archives need."""

from __future__ import annotations

import os
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
