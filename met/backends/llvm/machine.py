"""Machine code: IR text to object bytes to an address. The only file that knows llvmlite.

Nothing that could change results is left to the compiler (met/backends/llvm/emit.py); this module affects only speed.
"""

from __future__ import annotations

import platform
from functools import cache
from typing import Any

import llvmlite
import llvmlite.binding as llvm

from met.backends.llvm.entry import ENTRY
from met.frozen import frozen
from met.trace import check


@frozen
class Machine:
    """The target of machine code: LLVM's names of processor and features, the number of doubles in a register, and
    whether it has fma.

    triple   LLVM's name of architecture and system; "" for those of this process
    fixed    whether code may name places in memory; it is otherwise right wherever it is put
    """

    cpu: str
    features: str
    width: int
    fma: bool
    triple: str = ""
    fixed: bool = False


@cache
def _ready() -> None:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()


@cache
def _ready_for_all() -> None:
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()


@cache
def machine(cpu: str | None = None) -> Machine:
    """The machine we run on, or one of LLVM's processors of its kind (`haswell`, `skylake-avx512`)."""
    _ready()
    arm = platform.machine().lower() in ("arm64", "aarch64")
    if cpu is None:
        features = llvm.get_host_cpu_features()
        width = 2 if arm else 8 if features.get("avx512f") else 4 if features.get("avx") else 2
        return Machine(llvm.get_host_cpu_name(), features.flatten(), width, arm or bool(features.get("fma")))
    text = (
        "define <8 x double> @f(<8 x double> %a) #0 {\n"
        "  %b = call <8 x double> @llvm.fma.v8f64(<8 x double> %a, <8 x double> %a, <8 x double> %a)\n"
        "  ret <8 x double> %b\n}\ndeclare <8 x double> @llvm.fma.v8f64(<8 x double>, <8 x double>, <8 x double>)\n"
        'attributes #0 = { "prefer-vector-width"="512" }\n'
    )
    assembly = _target_machine(Machine(cpu, "", 2, True)).emit_assembly(llvm.parse_assembly(text))
    width = 2 if arm else 8 if "%zmm" in assembly else 4 if "%ymm" in assembly else 2
    return Machine(cpu, "", width, arm or "vfmadd" in assembly)


def arm64(cpu: str = "generic") -> Machine:
    """A Linux machine of the arm64 kind, whatever this machine is: its objects run elsewhere."""
    return Machine(cpu, "", 2, True, "aarch64-unknown-linux-gnu")


def wasm32() -> Machine:
    """WebAssembly with vectors of two doubles, which every browser has had since 2023; it has no exact fma."""
    return Machine("generic", "+simd128,+bulk-memory", 2, False, "wasm32-unknown-unknown", fixed=True)


def _target_machine(target: Machine, level: int | None = None) -> Any:
    """LLVM's machine for this target. level: of optimisation; None: the usual."""
    _ready()
    if target.triple:
        _ready_for_all()
    triple = llvm.Target.from_triple(target.triple or llvm.get_process_triple())
    opt = 2 if level is None else max(level, 0)
    reloc = "static" if target.fixed else "pic"
    return triple.create_target_machine(
        cpu=target.cpu, features=target.features, opt=opt, reloc=reloc, codemodel="small"
    )


def versions() -> str:
    """Versions of everything besides the text that determines the generated code."""
    return f"llvmlite {llvmlite.__version__} llvm {'.'.join(map(str, llvm.llvm_version_info))}"


QUICK = -1
"""A level of `assemble`: without the optimiser, and with the code generator's fastest settings. It takes half the time,
the code is a fifth longer and slower, and computes the same bits."""


def assemble(text: str, target: Machine, *, level: int | None = None) -> bytes:
    """The object file of a module.

    level  None: LLVM's optimiser is left out, its code generator works at its usual level. The graph has done what
           an optimiser would: the code is as fast, and made in half the time. 0 to 3: optimiser and code generator at
           that level. `QUICK`
    """
    machine_ = _target_machine(target, level)
    return bytes(machine_.emit_object(_prepared(text, machine_, level)))


def listing(text: str, target: Machine, *, level: int | None = None) -> str:
    """The assembly of a module, to look at."""
    machine_ = _target_machine(target, level)
    return str(machine_.emit_assembly(_prepared(text, machine_, level)))


def _prepared(text: str, machine_: Any, level: int | None) -> Any:
    """The module of an IR text, optimised for a machine. level: of optimisation; None or QUICK: only what must be
    inlined is."""
    module = llvm.parse_assembly(text)
    if check.wanted():
        module.verify()
    module.triple = machine_.triple
    module.data_layout = str(machine_.target_data)
    if level is None or level == QUICK:
        passes = llvm.create_new_module_pass_manager()
        passes.add_always_inliner_pass()
        passes.run(module, llvm.create_pass_builder(machine_, llvm.create_pipeline_tuning_options()))
        return module
    options = llvm.create_pipeline_tuning_options(speed_level=level)
    options.slp_vectorization = False
    options.loop_vectorization = False
    options.loop_interleaving = False
    options.loop_unrolling = False
    builder = llvm.create_pass_builder(machine_, options)
    builder.getModulePassManager().run(module, builder)
    return module


def size(code: bytes) -> int:
    """The number of bytes of instructions in an object file."""
    _ready()
    return sum(part.size() for part in llvm.ObjectFileRef.from_data(code).sections() if part.is_text())


class Loaded:
    """Machine code in memory; `address` is the entry's, `code` the object file that it came from."""

    def __init__(self, code: bytes, target: Machine) -> None:
        _ready()
        self.code = code
        self._compiler = llvm.create_lljit_compiler(_target_machine(target), use_jit_link=True)
        library = llvm.JITLibraryBuilder().add_object_img(code).add_current_process().export_symbol(ENTRY)
        self._tracker = library.link(self._compiler, "met")
        self.address: int = self._tracker[ENTRY]
