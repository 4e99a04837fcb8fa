"""What operating systems differ in: cores, memory files, processes, precedence. MET runs on Linux and macOS.

Whatever one of them lacks is named in this file alone, with another way, or with an OSError of errno ENOSYS that says
that there is none.
"""

from __future__ import annotations

import ctypes
import errno
import os
import platform
import signal
import tempfile

_MCL_CURRENT, _MCL_FUTURE = 1, 2
_PR_SET_PDEATHSIG = 1


def cores() -> int:
    """The number of cores that this process may run on; where the system does not say, that of the machine."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def cpu() -> str:
    """The processor's name, as the system gives it; "" where it gives none."""
    names = (text for name, text in _cpu_facts() if name.startswith(("model name", "Model")))
    return next(names, "") or platform.processor()


def cpu_flags() -> tuple[str, ...]:
    """The extensions that an x86 processor has, by Linux's names (`fma`, `avx2`); none where the system does not
    say."""
    return next((tuple(text.split()) for name, text in _cpu_facts() if name == "flags"), ())


def _cpu_facts() -> list[tuple[str, str]]:
    """Names and texts of what Linux says of each core."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
            lines = [line.partition(":") for line in file]
    except OSError:
        return []
    return [(name.strip(), text.strip()) for name, _, text in lines]


def is_running(pid: int) -> bool:
    """True where there is a process of this number on this machine, whoever owns it."""
    try:
        os.kill(pid, 0)
    except PermissionError:
        pass
    except (OSError, OverflowError):
        return False
    return pid > 0


def nameless_file() -> int:
    """A new empty file without a name, as a descriptor: in memory on Linux, else in the folder of temporary files. It
    is gone with the last process that has it open. Raises OSError."""
    if hasattr(os, "memfd_create"):
        return os.memfd_create("met")
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())


def end_with_parent(number: signal.Signals) -> None:
    """Let the system send this process a signal when its parent ends. Only Linux can: elsewhere it does nothing."""
    try:
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, number)
    except (AttributeError, OSError):
        pass


def put_first(process: int, priority: int, *, children: bool = True) -> None:
    """Let a process, and where asked for its children, run before all of usual priority (SCHED_FIFO). process: its
    number, 0 this one. Raises OSError."""
    reset = getattr(os, "SCHED_RESET_ON_FORK", None)
    if reset is None or not hasattr(os, "sched_setscheduler"):
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    policy = os.SCHED_FIFO | (0 if children else reset)
    os.sched_setscheduler(process, policy, os.sched_param(priority))


def keep_in_memory() -> None:
    """Keep all memory of this process from being swapped out, also what it takes later. Raises OSError."""
    try:
        lock = ctypes.CDLL(None, use_errno=True).mlockall
    except (AttributeError, OSError):
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS)) from None
    if lock(_MCL_CURRENT | _MCL_FUTURE) != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
