"""Compiled objects on disk, each under the hash of everything that made it.

A file is a hash of its object and the object; what does not agree with its hash is made anew. Files are written
under another name and renamed, so that any number of processes may share the folder. It is a cache: whatever goes
wrong with it, the object is made and the run goes on.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

# bytes above which the files longest unused are removed
LIMIT = 1 << 30

_MARK = b"met object 1\n"


def folder() -> Path:
    """Where objects are kept: $MET_CACHE_DIR, else ~/.cache/met (under $XDG_CACHE_HOME where that is set)."""
    own = os.environ.get("MET_CACHE_DIR")
    if own:
        return Path(own)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "met"


def key(*parts: str) -> str:
    """The name of an object that these texts decide."""
    digest = hashlib.sha256()
    for part in parts:
        data = part.encode()
        digest.update(len(data).to_bytes(8, "little"))
        digest.update(data)
    return digest.hexdigest()


def kept(name: str, make: Callable[[], bytes]) -> tuple[bytes, bool]:
    """The object of that name and whether it was there; made, and kept, where it was not."""
    path = folder() / name[:2] / f"{name}.o"
    code = _read(path)
    if code is not None:
        with contextlib.suppress(OSError):
            os.utime(path)
        return code, True
    code = make()
    with contextlib.suppress(OSError):
        _write(path, code)
        _trim(path.parent.parent)
    return code, False


def _read(path: Path) -> bytes | None:
    try:
        data = path.read_bytes()
    except OSError:
        return None
    digest, code = data[len(_MARK):len(_MARK) + 32], data[len(_MARK) + 32:]
    if not data.startswith(_MARK) or hashlib.sha256(code).digest() != digest:
        return None
    return code


def _write(path: Path, code: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=".new-")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(_MARK + hashlib.sha256(code).digest() + code)
        os.replace(name, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(name)
        raise


def _trim(root: Path) -> None:
    """Removes the files longest unused while all are more than `LIMIT` bytes."""
    files = [(stat.st_mtime, stat.st_size, path) for path in root.glob("*/*.o") if (stat := path.stat())]
    total = sum(size for _, size, _ in files)
    for _, size, path in sorted(files):
        if total <= LIMIT:
            break
        path.unlink()
        total -= size
