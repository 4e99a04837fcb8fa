"""The file under an archive that is being written.

HDF5 does not survive a write that fails: its caches stay dirty, every close fails again, and the process may die at
exit. So it writes through this object, which remembers the first failure, takes everything after it without a word,
and lets the writer raise what happened.
"""

from __future__ import annotations

import os
from pathlib import Path


class Sink:
    """A new file, as HDF5 wants it: seek, then read or write."""

    def __init__(self, path: Path) -> None:
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
        self._at = 0
        self._size = 0
        self.failure: OSError | None = None

    def check(self) -> None:
        """Raise what went wrong since the file was made."""
        if self.failure is not None:
            raise self.failure

    def tell(self) -> int:
        return self._at

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        self._at = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._size}[whence]
        return self._at

    def readinto(self, buffer: memoryview) -> int:
        """Bytes beyond the end, and all after a failure, are zeros."""
        view = memoryview(buffer).cast("B")
        got = 0
        if self.failure is None:
            try:
                got = os.preadv(self._file, [view], self._at)
            except OSError as reason:
                self.failure = reason
        view[got:] = bytes(len(view) - got)
        self._at += len(view)
        return len(view)

    def read(self, size: int = -1) -> bytes:
        """As `readinto`; h5py takes what has it for a file."""
        buffer = bytearray(self._size - self._at if size < 0 else size)
        self.readinto(memoryview(buffer))
        return bytes(buffer)

    def write(self, data: memoryview) -> int:
        view = memoryview(data).cast("B")
        left = view
        while len(left) and self.failure is None:
            try:
                wrote = os.pwrite(self._file, left, self._at + len(view) - len(left))
            except OSError as reason:
                self.failure = reason
                break
            left = left[wrote:]
        self._at += len(view)
        self._size = max(self._size, self._at)
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        size = self._at if size is None else size
        if self.failure is None:
            try:
                os.ftruncate(self._file, size)
            except OSError as reason:
                self.failure = reason
        self._size = size
        return size

    def flush(self) -> None:
        """Nothing is held back."""

    def settle(self) -> None:
        """See everything on the disk."""
        self.check()
        os.fsync(self._file)

    def close(self) -> None:
        if self._file >= 0:
            os.close(self._file)
            self._file = -1
