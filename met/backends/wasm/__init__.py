"""The WebAssembly back end: a program as a module that browsers and node run, with the bits of every other back end.

module     the LLVM back end's text compiled for wasm32, and what a caller must know of the module
fma        an exact multiply-add, for machines without;  link: an object file made a module
kernel.js  runs a module in a page or in node;  node: running it here, by way of node
"""

from __future__ import annotations

from collections.abc import Mapping

from met.backends.backend import Kernel
from met.frozen import frozen
from met.trace.program import Recording


@frozen
class Wasm:
    """WebAssembly, as a `met.backends.backend.Backend`."""

    name: str = "wasm"
    version: int = 1

    def emit(self, recording: Recording) -> str:
        from met.backends.wasm.module import text

        return text(recording)

    def load(self, recording: Recording, *, lanes: int | None = None, inline: bool = True) -> Kernel:
        """The program, compiled, always with two lanes; running it raises RuntimeError where there is no node."""
        from met.backends.wasm.module import WasmKernel, compiled

        return WasmKernel(compiled(recording))

    def libraries(self) -> Mapping[str, str]:
        from importlib.metadata import version

        return {"llvmlite": version("llvmlite")}


BACKEND = Wasm()
