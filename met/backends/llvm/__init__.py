"""The LLVM back end, the default: vector code that runs as many cases at once as a register has lanes.

emit      a recorded program as LLVM IR, as text;  entry: the function around its sections
pieces    long sections cut into functions;  philox: the generator under the noise
machine   IR to machine code in memory, by llvmlite
kernel    running it: blocks of cases, threads, single steps
"""

from __future__ import annotations

from collections.abc import Mapping

from met.backends.backend import Kernel
from met.frozen import frozen
from met.trace.program import Recording


@frozen
class Llvm:
    """LLVM, as a `met.backends.backend.Backend`."""

    name: str = "llvm"
    version: int = 1

    def emit(self, recording: Recording) -> str:
        from met.backends.llvm import kernel, machine

        return kernel.written(recording, machine.machine())[1]

    def load(self, recording: Recording, *, lanes: int | None = None, inline: bool = True) -> Kernel:
        from met.backends.llvm import kernel

        return kernel.from_recording(recording, lanes, inline=inline)

    def libraries(self) -> Mapping[str, str]:
        from importlib.metadata import version

        return {"llvmlite": version("llvmlite")}


BACKEND = Llvm()
