"""The file under an archive that is being written.

HDF5 does not survive a write that fails: its caches stay dirty, every close fails again, and the process may die at
exit. So it writes through this object, which remembers the first failure, silently accepts everything after it, and
lets the writer raise it.

The file has a temporary name that follows from the archive's, and is locked while it is written: two runs into one
archive cannot both have it, and the file of a killed run is taken over by the next.
"""

from __future__ import annotations

import errno
import fcntl
import os
from pathlib import Path

from met.host.files import settle


class FileBusy(Exception):
    """Raised where another run has the file, in this process or in another."""


def temporary_of(target: Path) -> Path:
    """The hidden name beside `target` under which a file is written until it is whole."""
    return target.with_name(f".{target.name}.tmp")


class Sink:
    """A new file with the interface that HDF5 needs: seek, then read or write. Raises FileBusy where it is being
    written already."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = _locked(path)
        os.ftruncate(self._file, 0)
        self._position = 0
        self._size = 0
        self.failure: OSError | None = None

    def check(self) -> None:
        """Raise the first failure since the file was made."""
        if self.failure is not None:
            raise self.failure

    def tell(self) -> int:
        return self._position

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        self._position = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: self._size}[whence]
        return self._position

    def readinto(self, buffer: memoryview) -> int:
        """Read into a buffer; bytes beyond the end, and all after a failure, are zeros."""
        view = memoryview(buffer).cast("B")
        got = 0
        if self.failure is None:
            try:
                got = os.preadv(self._file, [view], self._position)
            except OSError as reason:
                self.failure = reason
        view[got:] = bytes(len(view) - got)
        self._position += len(view)
        return len(view)

    def read(self, size: int = -1) -> bytes:
        """Read bytes, as `readinto` does; h5py takes an object with this method for a file."""
        buffer = bytearray(self._size - self._position if size < 0 else size)
        self.readinto(memoryview(buffer))
        return bytes(buffer)

    def write(self, data: memoryview) -> int:
        """Write bytes at the present position. A failure is kept in `failure`, and raises nothing, which HDF5 would not
        survive."""
        view = memoryview(data).cast("B")
        left = view
        while len(left) and self.failure is None:
            try:
                wrote = os.pwrite(self._file, left, self._position + len(view) - len(left))
            except OSError as reason:
                self.failure = reason
                break
            left = left[wrote:]
        self._position += len(view)
        self._size = max(self._size, self._position)
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        """Set the file's length. A failure is kept in `failure`, and raises nothing."""
        size = self._position if size is None else size
        if self.failure is None:
            try:
                os.ftruncate(self._file, size)
            except OSError as reason:
                self.failure = reason
        self._size = size
        return size

    def flush(self) -> None:
        """Do nothing: no bytes are buffered."""

    def settle(self) -> None:
        """Write everything to the disk."""
        self.check()
        settle(self._file)

    def remove(self) -> None:
        """Remove the file of the temporary name, unless that is another's by now."""
        if self._file >= 0 and is_at(self._file, self._path):
            self._path.unlink()

    def close(self) -> None:
        """Close the file, and with it the lock: only after it has got its name, or is removed."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1


def _locked(path: Path) -> int:
    """A file of this name, locked, as a descriptor; made where there is none."""
    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
        try:
            lock_at_once(file, fcntl.LOCK_EX)
        except BlockingIOError:
            raise FileBusy from None
        if is_at(file, path):
            return file
        os.close(file)  # it was renamed or removed before it was locked


def lock_at_once(file: int, kind: int) -> None:
    """Lock an open file, by its descriptor, without waiting; a file that cannot be locked is closed. On a disk without
    locks none is used. kind: fcntl.LOCK_EX, for one alone, or LOCK_SH. Raises BlockingIOError where it is locked by
    another, OSError."""
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except OSError as reason:
        if reason.errno not in (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS):
            os.close(file)
            raise


def is_at(file: int, path: Path) -> bool:
    """True if an open file is still the one that has this name."""
    try:
        return os.path.samestat(os.fstat(file), os.stat(path, follow_symlinks=False))
    except FileNotFoundError:
        return False
