"""Measures by which the host wakes in time, where they are allowed: scheduling priority, locked memory, and no garbage
collection. It is not hard real time: lateness is counted."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import signal

PRIORITY = 50
"""Priority of the process under SCHED_FIFO: above the threaded interrupts of most kernels."""

_MCL_CURRENT, _MCL_FUTURE = 1, 2
_PR_SET_PDEATHSIG = 1


def take_precedence() -> list[str]:
    """Take precedence for this process. Returns measures that the system did not allow, in words, each with its
    remedy."""
    gc.collect()
    gc.freeze()
    gc.disable()
    refused = []
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    except (AttributeError, OSError) as reason:
        refused.append(
            f"no precedence over other processes ({_why(reason)}): exchanges may be late; "
            f"`{_allow('rtprio', PRIORITY)}` allows it"
        )
    if _locked() != 0:
        refused.append(
            f"memory may be swapped out ({os.strerror(ctypes.get_errno()).lower()}): exchanges may be late; "
            f"`{_allow('memlock', 'unlimited')}` allows it"
        )
    return refused


def put_first(process: int) -> None:
    """Let another process, and threads that it will start, run before this one, where that is allowed. It is for a
    bed's firmware that runs here: on a busy machine its deadman would act."""
    with contextlib.suppress(AttributeError, OSError):
        os.sched_setscheduler(process, os.SCHED_FIFO, os.sched_param(PRIORITY + 1))


def end_with_parent(number: signal.Signals) -> None:
    """Let the system send this process a signal when its parent ends, where it can."""
    with contextlib.suppress(AttributeError, OSError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, number)


def _locked() -> int:
    try:
        library = ctypes.CDLL(None, use_errno=True)
        return int(library.mlockall(_MCL_CURRENT | _MCL_FUTURE))
    except (AttributeError, OSError):
        return -1


def _allow(what: str, how: object) -> str:
    return f"@GROUP - {what} {how}"


def _why(reason: Exception) -> str:
    return (getattr(reason, "strerror", None) or "not on this system").lower()
