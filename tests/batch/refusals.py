"""What is said where something is refused, and a system that refuses."""

from __future__ import annotations

import os
import stat

import pytest

from met.diagnostic import Problem
from met.messages.render import render


def refused(caught: pytest.ExceptionInfo[Problem]) -> str:
    """A message whole, as the user reads it."""
    return render(caught.value.diagnostics)


def fail_for_folders(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    """Let the system refuse to flush folders, as CIFS, VirtualBox and some file systems of FUSE do."""
    flush = os.fsync

    def refuse(file: int) -> None:
        if stat.S_ISDIR(os.fstat(file).st_mode):
            raise OSError(number, os.strerror(number))
        flush(file)

    monkeypatch.setattr(os, "fsync", refuse)
