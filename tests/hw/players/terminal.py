"""A pseudo-terminal in the place of a serial line, to which a link leads."""

from __future__ import annotations

import contextlib
import fcntl
import os
import termios
import time
import tty

from met.diagnostic import Problem, error

FREE = 1.0
"""Time without a byte after which another host may open a line, s: one that was killed has it open for itself alone."""


class Terminal:
    """The far end of a serial line, whose near end is a pseudo-terminal at a path. Making it raises Problem E400 where
    something else is at that path.

    what, key  what is played there, and the bench file's key of the path, in words;  file: number of its file
    """

    def __init__(self, path: str, what: str, key: str) -> None:
        self._path = path
        if os.path.lexists(path) and not os.path.islink(path):
            helps = f"{key} is where its pseudo-terminal will be: a path that is free"
            raise Problem(error("E400", f"no {what} can be played at {path}: something is there", help=helps))
        self.file, self._near = os.openpty()  # the near end stays open: else a host that leaves ends the line
        tty.setraw(self._near)
        os.set_blocking(self.file, False)
        with contextlib.suppress(FileNotFoundError):
            os.unlink(path)
        os.symlink(os.ttyname(self._near), path)
        self._heard = time.monotonic()

    def read(self) -> bytes:
        """Read pending input."""
        now = time.monotonic()
        with contextlib.suppress(BlockingIOError):
            data = os.read(self.file, 4096)
            self._heard = now
            return data
        if now > self._heard + FREE:
            self._heard = now
            fcntl.ioctl(self._near, termios.TIOCNXCL)
        return b""

    def write(self, data: bytes) -> None:
        """Write output. Without a reader, bytes that do not fit are lost, as in a device."""
        with contextlib.suppress(BlockingIOError):
            os.write(self.file, data)

    def close(self) -> None:
        with contextlib.suppress(OSError):
            os.unlink(self._path)
        for each in (self.file, self._near):
            os.close(each)
