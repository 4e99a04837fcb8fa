"""Handling of SIGTERM, as sent by `kill` and batch systems: the process cleans up, as after Ctrl-C."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

TERMINATED = 128 + signal.SIGTERM
"""The exit status, as a shell counts."""


class Terminated(KeyboardInterrupt):
    """Raised for SIGTERM; handlers of interrupts catch it."""


@contextmanager
def terminable() -> Iterator[None]:
    """A block in which SIGTERM raises Terminated, once: a second one does not disturb the cleaning up."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(*_: Any) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise Terminated

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
