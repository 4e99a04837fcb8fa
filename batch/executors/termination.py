"""An end by SIGTERM, as `kill` and batch systems send it: what was begun is cleaned up, as after Ctrl-C."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

TERMINATED = 128 + signal.SIGTERM
"""The exit status, as a shell counts."""


class Terminated(KeyboardInterrupt):
    """SIGTERM came; whatever looks for an interrupt sees one."""


@contextmanager
def terminable() -> Iterator[None]:
    """A block in which SIGTERM raises Terminated, once: what follows it is cleaning up, which a second one does not
    disturb."""
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
