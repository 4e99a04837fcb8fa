"""Measures by which the host wakes in time, where they are allowed: scheduling priority, locked memory, and no garbage
collection. It is not hard real time: lateness is counted."""

from __future__ import annotations

import contextlib
import errno
import gc

from met.host import system

PRIORITY = 50
"""Priority of the process in real-time scheduling: above the threaded interrupts of most kernels."""


def take_precedence() -> list[str]:
    """Take precedence for this process. Returns measures that the system did not allow, in words, each with its
    remedy."""
    gc.collect()
    gc.freeze()
    gc.disable()
    refused = []
    try:
        system.put_first(0, PRIORITY, children=False)
    except OSError as reason:
        refused.append(_refusal("no precedence over other processes", reason, f"rtprio {PRIORITY}"))
    try:
        system.keep_in_memory()
    except OSError as reason:
        refused.append(_refusal("memory may be swapped out", reason, "memlock unlimited"))
    return refused


def put_first(process: int) -> None:
    """Let another process, and threads that it will start, run before this one, where that is allowed. It is for a
    bed's firmware that runs here: on a busy machine its deadman would act."""
    with contextlib.suppress(OSError):
        system.put_first(process, PRIORITY + 1)


def _refusal(lacking: str, reason: OSError, limit: str) -> str:
    """The measure that the host does without, in words, with the line of limits.conf that allows it, or the system
    that has it."""
    if reason.errno == errno.ENOSYS:
        return f"{lacking} (this system has no such call): exchanges may be late; drive motors from Linux"
    return f"{lacking} ({str(reason.strerror).lower()}): exchanges may be late; `@GROUP - {limit}` allows it"
