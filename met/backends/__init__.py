"""Back ends: each turns a recorded program into a form that a computer can run.

A back end is a folder here, and a line in `HOMES`; `met.backends.backend` has its protocol. All of them give the same
bits for the same recording, including the reference, which is for debugging.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from met.backends.backend import Backend, Kernel
    from met.trace.program import Recording

HOMES = {
    "llvm": "met.backends.llvm",
    "c": "met.backends.c",
    "wasm": "met.backends.wasm",
    "reference": "met.backends.reference",
}
"""The module of each back end, by name; its `BACKEND` is the back end."""

DEFAULT = "llvm"


def find(name: str = DEFAULT) -> Backend:
    """The back end of that name; it is imported when it is first asked for. Raises KeyError."""
    backend: Backend = import_module(HOMES[name]).BACKEND
    return backend


def load(recording: Recording, lanes: int | None = None, *, name: str = DEFAULT) -> Kernel:
    """A recorded program, ready to run. lanes: cases a block; None for the fastest number on this machine."""
    return find(name).load(recording, lanes=lanes)
