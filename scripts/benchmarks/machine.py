"""The machine and the version of MET of a measurement."""

from __future__ import annotations

import os
import platform
import subprocess
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]


def machine() -> dict[str, Any]:
    """Processor, cores that this process may use, load before the first figure, versions and MET's commit."""
    from met.backends.llvm import machine as llvm

    target = llvm.machine()
    return {
        "processor": _processor(),
        "code_for": target.cpu,
        "avx512": _has_flag("avx512f"),
        "cores": len(os.sched_getaffinity(0)),
        "load": round(os.getloadavg()[0], 2),
        "system": platform.platform(),
        "python": platform.python_version(),
        "compiler": llvm.versions(),
        "commit": _git("rev-parse", "--short", "HEAD"),
        "changed": bool(_git("status", "--porcelain", "--untracked-files=no")),
    }


SAME = ("processor", "code_for", "avx512", "cores")
"""Entries that must be equal in two reports for their figures to be from one machine."""


def in_words(facts: dict[str, Any]) -> str:
    """The machine in two lines."""
    vectors = "AVX-512" if facts["avx512"] else "no AVX-512"
    cores = f"{facts['cores']} core{'' if facts['cores'] == 1 else 's'}"
    commit = f"commit {facts['commit'] or 'unknown'}{', changed since' if facts['changed'] else ''}"
    return (
        f"{facts['processor']} ({facts['code_for']}), {cores}, {vectors}, load {facts['load']:g}\n"
        f"{facts['system']}, Python {facts['python']}, {facts['compiler']}; {commit}"
    )


def _processor() -> str:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        key, _, value = line.partition(":")
        if key.strip() in ("model name", "Processor", "Model"):
            return value.strip()
    return platform.processor() or platform.machine()


def _has_flag(name: str) -> bool:
    """True where the processor has this feature; architectures other than x86 list other words."""
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        key, _, value = line.partition(":")
        if key.strip() == "flags":
            return name in value.split()
    return False


def _git(*words: str) -> str:
    """The output of git about the checkout; empty without git or a checkout."""
    try:
        done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True)
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
