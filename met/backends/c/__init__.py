"""The C back end: a program as C, one case at a time, for computers without LLVM, such as a motor bed's controller.

emit       the text, and what its inputs and outputs are called there;  functions: what it calls
library    running it here, by way of the system's C compiler
"""

from __future__ import annotations

from collections.abc import Mapping

from met.backends.backend import Kernel
from met.frozen import frozen
from met.trace.program import Recording


@frozen
class C:
    """C11, as a `met.backends.backend.Backend`."""

    name: str = "c"
    version: int = 1

    def emit(self, recording: Recording) -> str:
        from met.backends.c.emit import emit

        return emit(recording).text

    def load(self, recording: Recording, *, lanes: int | None = None, inline: bool = True) -> Kernel:
        """The program, compiled by `cc`. Raises RuntimeError where there is no `cc`, or it fails."""
        from met.backends.c.library import Library

        return Library(recording)

    def libraries(self) -> Mapping[str, str]:
        return {}


BACKEND = C()
