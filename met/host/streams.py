"""Standard output and standard errors of a command, of which either may be closed, full, or read by nobody any more.

Errors that cannot be written are dropped: they change no answer. Output that cannot be written ends the command, as
Ctrl-C does: nothing that is done is lost, and no file that the command writes is taken for the cause.
"""

from __future__ import annotations

import contextlib
import io
import os
import select
import sys
from collections.abc import Iterator
from typing import Any


class OutputLost(KeyboardInterrupt):
    """Raised where standard output takes no more. Handlers of interrupts catch it; its text says what is kept."""


class StandardStream(io.FileIO):
    """The file of standard output or of standard errors, 1 or 2. Its first refusal is kept; what comes after it is
    dropped."""

    def __init__(self, number: int, *, closed: bool = False) -> None:
        """closed: whether the shell has closed it, as in `met ... >&-`; it then refuses all"""
        super().__init__(number, "w", closefd=False)
        self.refusal: OSError | None = None
        self._closed = closed

    def write(self, data: Any) -> int:
        """Write some of the data. Raises OutputLost, once, where standard output refuses it."""
        while self.refusal is None:
            try:
                if self._closed:
                    raise OSError("it is closed")
                wrote = super().write(data)
            except OSError as reason:
                self.refusal = reason
                if self.fileno() == 1:
                    raise OutputLost from None
            else:
                if wrote is not None:
                    return wrote
                select.select([], [self], [])  # a pipe that does not wait until it is read
        return len(data)


@contextlib.contextmanager
def standard_streams() -> Iterator[StandardStream | None]:
    """A block whose output and errors go through a StandardStream; gives that of the output, or None where Python's
    own is replaced already, as by tests."""
    _open_closed()
    before = sys.stdout, sys.stderr
    guarded = {
        name: StandardStream(number, closed=getattr(sys, name) is None)
        for name, number in (("stdout", 1), ("stderr", 2))
    }
    own = sys.stdout is None or sys.stdout is sys.__stdout__
    for name, file in guarded.items():
        stream = getattr(sys, name)
        if stream is None or stream is getattr(sys, f"__{name}__"):
            setattr(sys, name, _over(file, stream))
    try:
        yield guarded["stdout"] if own else None
    finally:
        with contextlib.suppress(OutputLost):
            sys.stdout.flush()
        sys.stderr.flush()
        sys.stdout, sys.stderr = before


@contextlib.contextmanager
def kept(words: str) -> Iterator[None]:
    """A block that prints what has been done. If the output is lost in it, these words say what is kept."""
    try:
        yield
    except OutputLost:
        raise OutputLost(words) from None


def _over(raw: StandardStream, stream: Any) -> io.TextIOWrapper:
    """Text into this file, as the given stream of Python's writes it; in UTF-8 where it is closed."""
    if stream is None:
        return io.TextIOWrapper(io.BufferedWriter(raw), encoding="utf-8", errors="backslashreplace")
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding=stream.encoding,
        errors=stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )


def _open_closed() -> None:
    """Open those of the files 0, 1 and 2 that the shell has closed, so that no file of ours gets their numbers."""
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(descriptor, True)
    os.close(descriptor)
