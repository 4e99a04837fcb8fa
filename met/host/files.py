"""Safe reading of files that others may have written: only regular files are opened, and JSON is read as plain data.

A named pipe blocks its reader for ever, and a device may do anything. All input is read by these functions: archives,
plans, shards, sidecars, transcripts, decks. A refusal is an OSError (the file) or a ValueError (its contents), never a
wait and never an error of another kind.
"""

from __future__ import annotations

import contextlib
import errno
import json
import math
import os
import stat
from collections.abc import Iterator
from io import BufferedReader, BufferedWriter, FileIO
from typing import Any

MOST_JSON_BYTES = 64 << 20
"""Largest size of a JSON file, in bytes; a sidecar or a description of a campaign has some kilobytes."""

WHOLE_BITS = 64
"""Largest number of bits of a whole number: MET writes none with more, and they overflow in computations."""

KINDS = {
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


class _Raw(FileIO):
    """A file that does not wait, read without `None`s: where it has nothing to give yet, as files of the kernel may,
    reading raises OSError."""

    def readinto(self, buffer: Any) -> int:
        return self._ready(super().readinto(buffer))

    def readall(self) -> bytes:
        return self._ready(super().readall())

    def _ready(self, value: Any) -> Any:
        if value is None:
            raise BlockingIOError(errno.EAGAIN, "it has nothing to give, and no end")
        return value


def real_path(path: str) -> str:
    """The path without links; as it is where no file can have such a name."""
    try:
        return os.path.realpath(path)
    except (OSError, ValueError):
        return path


def open_regular(path: str | os.PathLike[str]) -> BufferedReader:
    """A regular file, open for reading. Raises OSError, at once, where it is none."""
    name = os.fspath(path)
    if "\0" in name:
        raise OSError(errno.EINVAL, "its name holds a null character", name)
    _check_regular(os.stat(name), name)
    # the file may have been replaced since: then it is closed again, without waiting
    file = os.open(name, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    try:
        _check_regular(os.fstat(file), name)
        return BufferedReader(_Raw(file, "rb"))
    except BaseException:
        os.close(file)
        raise


def read_regular(path: str | os.PathLike[str], most: int | None = None) -> bytes:
    """The contents of a regular file. most: its largest size in bytes; by default, what fits in memory. Raises
    OSError."""
    limit = memory() if most is None else most
    with open_regular(path) as file:
        large = os.fstat(file.fileno()).st_size > limit  # a sparse file may be larger than any disk
        data = b"" if large else file.read() if most is None else file.read(most + 1)
    if large or len(data) > limit:
        raise OSError(errno.EFBIG, f"it has more than {limit:,} bytes", os.fspath(path))
    return data


def memory() -> int:
    """Largest size, in bytes, of a file that is read as a whole: its reader takes several times as much of this
    machine's memory."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 4


def new_file(path: str | os.PathLike[str]) -> BufferedWriter:
    """A new file of this name, open for writing; a former file of the name is removed. A link or a pipe in its place is
    neither followed nor written to. Raises OSError."""
    with contextlib.suppress(FileNotFoundError):
        os.unlink(path)
    return open(path, "xb")


@contextlib.contextmanager
def whole_file(path: str | os.PathLike[str], *, mode: int | None = None) -> Iterator[BufferedWriter]:
    """A new file, open for writing, that replaces the file of this name once the block has ended and all is on the
    disk. If the block raises, nothing is left behind. Raises OSError.

    mode  its permissions; None: as of any new file
    """
    name = os.fspath(path)
    folder, base = os.path.split(name)
    from socket import gethostname  # late: reading a file, as every start does, needs no network

    # machines that share the folder may have processes of one number
    temporary = os.path.join(folder, f".{base}.{gethostname()}.{os.getpid()}.tmp")
    try:
        with new_file(temporary) as file:
            yield file
            file.flush()
            if mode is not None:
                _set_mode(file.fileno(), mode)
            settle(file.fileno())
        os.replace(temporary, name)
    except BaseException:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(temporary)
        raise


_UNSUPPORTED = frozenset({errno.EINVAL, errno.ENOSYS, errno.EOPNOTSUPP})
"""Errors of `fsync` by which a file system says that it does not have it."""

_UNSUPPORTED_OF_FOLDERS = _UNSUPPORTED | {errno.EBADF, errno.EPERM, errno.EACCES, errno.EISDIR}


def _set_mode(file: int, mode: int) -> None:
    """Set the permissions of a file of ours, unless its file system keeps none and refuses."""
    try:
        os.fchmod(file, mode)
    except OSError as reason:
        if reason.errno not in _UNSUPPORTED | {errno.EPERM}:
            raise


def settle(file: int) -> None:
    """Wait until the contents of an open file are on the disk, if its file system can tell. Raises OSError where the
    disk has failed."""
    try:
        os.fsync(file)
    except OSError as reason:
        if reason.errno not in _UNSUPPORTED:
            raise


def settle_folder(path: str | os.PathLike[str]) -> None:
    """Wait until the names of the files in a folder are on the disk, if its file system can tell: CIFS, VirtualBox and
    some of FUSE refuse, and a folder may be closed to readers. Raises OSError where the disk has failed."""
    try:
        folder = os.open(path, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    except OSError as reason:
        if reason.errno not in _UNSUPPORTED_OF_FOLDERS:
            raise


def read_json(path: str | os.PathLike[str], most: int = MOST_JSON_BYTES) -> Any:
    """The value of a file of JSON. Raises OSError; ValueError as `parse_json`."""
    return parse_json(read_regular(path, most))


def parse_json(text: str | bytes) -> Any:
    """Data from JSON, all of whose numbers are finite and fit into 64 bits; bytes may begin with a byte order mark.
    Raises ValueError for anything else, and for nesting of any depth."""
    try:
        if isinstance(text, bytes):
            text = text.decode("utf-8-sig")
        return json.loads(text, parse_constant=_no_number, parse_float=_finite, parse_int=_whole)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def is_count(value: Any, most: float = math.inf) -> bool:
    """True for a whole number from 0 to `most`."""
    return type(value) is int and 0 <= value <= most


def _check_regular(about: os.stat_result, name: str) -> None:
    """Raise OSError unless this status is that of a regular file."""
    if stat.S_ISDIR(about.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), name)
    if not stat.S_ISREG(about.st_mode):
        kind = KINDS.get(stat.S_IFMT(about.st_mode), "something else")
        raise OSError(errno.EINVAL, f"it is {kind}, not a regular file", name)


def _no_number(word: str) -> Any:
    raise ValueError(f"{word} is not JSON")


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text} is too large a number")
    return number


def _whole(text: str) -> int:
    number = int(text) if len(text) < WHOLE_BITS else 1 << WHOLE_BITS
    if number.bit_length() > WHOLE_BITS:
        raise ValueError(f"{text[:20]}... is too large a whole number")
    return number
