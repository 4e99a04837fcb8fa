"""The reference back end: it runs a recording operation by operation over numpy arrays, with the bits of the others.

listing    a recording as text
interpret  running it;  plain: a program by itself, phase by phase over floats
"""

from __future__ import annotations

from collections.abc import Mapping

from met.backends.backend import Kernel
from met.frozen import frozen
from met.trace.program import Recording


@frozen
class Reference:
    """The interpreter, as a `met.backends.backend.Backend`. It is thousands of times slower than machine code."""

    name: str = "reference"
    version: int = 1

    def emit(self, recording: Recording) -> str:
        from met.backends.reference.listing import lines

        return "\n".join([*lines(recording), ""])

    def load(self, recording: Recording, *, lanes: int | None = None, inline: bool = True) -> Kernel:
        from met.backends.reference.interpret import Interpreter

        return Interpreter(recording, lanes or 1)

    def libraries(self) -> Mapping[str, str]:
        return {}


BACKEND = Reference()
