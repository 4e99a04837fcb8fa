"""The instruction sets that code is made for in tests: those of this machine's kind that its processor can run."""

from __future__ import annotations

import platform

from met.backends.llvm import machine as llvm

ARM = platform.machine().lower() in ("arm64", "aarch64")
WIDE = "skylake-avx512"

# LLVM's names of processors of each set: SSE and AVX2 with fma, AVX-512; on arm64 an old and a newer one.
CPUS = ("cortex-a53", "neoverse-n1") if ARM else ("haswell", "x86-64-v3", WIDE)
RUNNABLE = tuple(cpu for cpu in CPUS if cpu != WIDE or llvm.machine().width >= 8)


def header() -> str:
    """What pytest's header says of them, so that a log tells what was not run."""
    missing = [cpu for cpu in CPUS if cpu not in RUNNABLE]
    return f"machine code for: {', '.join(RUNNABLE)}" + (
        f"; this processor cannot run {', '.join(missing)}" if missing else ""
    )
