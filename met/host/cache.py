"""A cache of compiled objects on disk, each under the hash of all its inputs.

A file holds a hash of its name and object, and the object. Objects that do not match their hash are made anew, and so
are those that another user may have written, since they would run with our rights. Files are written under another name
and renamed, so that any number of processes may share the folder. If the cache fails in any way, the object is made and
the run goes on.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import pwd
import stat
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

# bytes above which the least recently used files are removed
LIMIT = 1 << 30

_MARK = b"met object 2\n"


def folder() -> Path | None:
    """The folder of compiled objects: $MET_CACHE_DIR, else ~/.cache/met (under $XDG_CACHE_HOME where that is set). None
    for a user without a home; HOME counts only as an absolute path."""
    own = os.environ.get("MET_CACHE_DIR")
    if own:
        return Path(own)
    home = os.environ.get("HOME", "")
    if not os.path.isabs(home):
        try:
            home = pwd.getpwuid(os.getuid()).pw_dir
        except KeyError:
            home = ""
    base = os.environ.get("XDG_CACHE_HOME", "")
    if not os.path.isabs(base):
        base = os.path.join(home, ".cache")
    return Path(base) / "met" if os.path.isabs(base) else None


def within(*parts: str) -> Path | None:
    """A folder of the cache, made where it does not exist. None where it cannot be made, or where another user could
    write into it, which stderr reports."""
    path = folder()
    for part in ("", *parts):
        if path is None:
            return None
        path = path / part
        try:
            path.mkdir(mode=0o700, parents=True, exist_ok=True)
            status = path.lstat() if part else path.stat()
        except OSError:
            return None
        if not stat.S_ISDIR(status.st_mode) or not _is_ours(path, status):
            return None
    return path


def _is_ours(path: Path, status: os.stat_result) -> bool:
    """True where only this user, and the machine's administrator, can have written the file with this status; otherwise
    stderr reports it."""
    if status.st_uid != os.geteuid():
        _tell(path, "it is another user's")
        return False
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        _tell(path, "others may write it")
        return False
    return True


@functools.cache
def _tell(path: Path, why: str) -> None:
    """Report once that a part of the cache is not used."""
    print(
        f"met: {path} of the cache is not used: {why}; what is in it is compiled anew (MET_CACHE_DIR names another "
        "cache)",
        file=sys.stderr,
    )


TRIMMED = "0"
"""Third letters of the names of objects after whose writing the cache's size is checked: that looks at some thousands
of files, which takes as long as to compile a small program."""


def key(*parts: str) -> str:
    """The name of the object that is determined by these texts."""
    digest = hashlib.sha256()
    for part in parts:
        data = part.encode()
        digest.update(len(data).to_bytes(8, "little"))
        digest.update(data)
    return digest.hexdigest()


def cached(name: str, make: Callable[[], bytes]) -> tuple[bytes, bool]:
    """The object of that name, made and kept where it was missing; and whether it was there."""
    place = within(name[:2])
    if place is None:
        return make(), False
    path = place / f"{name}.o"
    code = _read(path)
    if code is not None:
        with contextlib.suppress(OSError):
            os.utime(path)
        return code, True
    code = make()
    with contextlib.suppress(OSError):
        _write(path, code)
        if name[2] in TRIMMED:
            _trim(place.parent)
    return code, False


def digest_of(name: str, data: bytes) -> bytes:
    """The hash by which an object is recognised as the one kept under that name."""
    return hashlib.sha256(name.encode() + b"\0" + data).digest()


def read(path: Path) -> bytes | None:
    """The contents of a file of the cache, if it exists and is one of ours."""
    try:
        with open(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
            status = os.fstat(file.fileno())
            if stat.S_ISREG(status.st_mode) and _is_ours(path, status):
                return file.read()
    except OSError:
        pass
    return None


def _read(path: Path) -> bytes | None:
    """The code of a cached file; None where the file is missing, not ours, or damaged."""
    data = read(path)
    if data is None or not data.startswith(_MARK):
        return None
    digest, code = data[len(_MARK) : len(_MARK) + 32], data[len(_MARK) + 32 :]
    return code if digest_of(path.stem, code) == digest else None


def _write(path: Path, code: bytes) -> None:
    """Write compiled code into the cache whole or not at all, with a mark and a checksum."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=".new-")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(_MARK + digest_of(path.stem, code) + code)
        os.replace(name, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(name)
        raise


def _trim(root: Path) -> None:
    """Remove the least recently used files while all together exceed `LIMIT` bytes."""
    files = [(stat.st_mtime, stat.st_size, path) for path in root.glob("*/*.o") if (stat := path.stat())]
    total = sum(size for _, size, _ in files)
    for _, size, path in sorted(files):
        if total <= LIMIT:
            break
        path.unlink()
        total -= size
