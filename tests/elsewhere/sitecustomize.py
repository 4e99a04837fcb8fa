"""A Python as on macOS, as far as Linux can show it.

`os`, `select` and the C library lack what macOS lacks, and nothing in /proc can be opened or listed. Python imports
this file at its start, and so do those that tests start:

    PYTHONPATH=$PWD/tests/elsewhere .venv/bin/python -m pytest -m "not (slow or release or alone ...)"

Files below /proc still exist for `os.stat`. The library psutil, which has its own ways elsewhere, may read them.
"""

from __future__ import annotations

import ctypes
import errno
import os
import re
import select
import sys
from typing import Any

LACKING = re.compile(
    r"sched_|SCHED_(FIFO|RR|BATCH|IDLE|OTHER|RESET)|memfd_|MFD_|eventfd|EFD_|timerfd|TFD_|getrandom|GRND_|pipe2|"
    r"posix_fadvise|POSIX_FADV_|posix_fallocate|fdatasync|splice|SPLICE_|copy_file_range|[gs]etres[ug]id|pidfd_open|"
    r"P_PIDFD|(get|set|list|remove)xattr|XATTR_|O_(TMPFILE|PATH|DIRECT|NOATIME|RSYNC|LARGEFILE)$|unshare|setns|CLONE_"
)
"""Names of `os` that Python has on Linux and not on macOS. sched_yield and sched_get_priority_* are there on both."""

ON_BOTH = ("sched_yield", "sched_get_priority_min", "sched_get_priority_max")


def without_linux() -> None:
    """Take away what macOS lacks, from this process, for good."""
    for module, names in ((os, [name for name in dir(os) if LACKING.match(name)]), (select, ["epoll"])):
        for name in names:
            if name not in ON_BOTH and hasattr(module, name):
                delattr(module, name)
    of_library = ctypes.CDLL.__getattr__

    def without_prctl(library: ctypes.CDLL, name: str) -> Any:
        if name == "prctl":
            raise AttributeError(f"no symbol `{name}`")
        return of_library(library, name)

    ctypes.CDLL.__getattr__ = without_prctl  # type: ignore[method-assign]
    sys.addaudithook(_refuse_proc)


def _refuse_proc(event: str, arguments: tuple[Any, ...]) -> None:
    if event not in ("open", "os.listdir", "os.scandir") or not isinstance(arguments[0], str | bytes | os.PathLike):
        return
    name = os.fsdecode(arguments[0])
    if name != "/proc" and not name.startswith("/proc/"):
        return
    frame = sys._getframe()
    while frame is not None:
        if f"{os.sep}psutil{os.sep}" in frame.f_code.co_filename:
            return
        frame = frame.f_back  # type: ignore[assignment]
    raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), name)


without_linux()
