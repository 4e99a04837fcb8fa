"""What a report of a defect needs: versions of MET and of what it stands on, and the computer."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys

from met.host import cache, system
from met.host.provenance import UNKNOWN, Revision, version
from met.version import VERSION

LIBRARIES = ("numpy", "scipy", "h5py", "pcpp", "click", "matplotlib", "xarray", "distributed")


def about() -> str:
    """A line for each fact, `NAME  TEXT`, aligned. What cannot be found out says so; nothing is raised."""
    commit, changed = Revision().read()
    facts = {
        "met": f"{VERSION}, commit {commit}{', changed' if changed == 'yes' else ''}",
        "python": f"{platform.python_implementation()} {platform.python_version()}, {sys.executable}",
        "system": platform.platform(),
        "processor": f"{system.cpu() or UNKNOWN}, {system.cores()} of {os.cpu_count()} cores",
        "code for": _code(),
        "libraries": ", ".join(f"{name} {version(name)}" for name in LIBRARIES),
        "compiler": _compiler(),
        "cache": str(cache.folder() or "none: no home, and no MET_CACHE_DIR"),
    }
    return "\n".join(f"{name:<10} {text}" for name, text in facts.items())


def _code() -> str:
    """The processor that machine code is made for, and the compiler that makes it."""
    try:
        from met.backends.llvm import machine

        target, versions = machine.machine(), machine.versions()
    except (ImportError, OSError, RuntimeError) as reason:
        return f"none: {' '.join(str(reason).split())}"
    return f"{target.cpu}, {target.width} doubles at once, {'' if target.fma else 'no '}fma; {versions}"


def _compiler() -> str:
    """The first line of what the C compiler says of itself."""
    if (compiler := shutil.which("cc")) is None:
        return "none: there is no `cc`"
    try:
        printed = subprocess.run([compiler, "--version"], stdin=subprocess.DEVNULL, capture_output=True, timeout=10)
    except (OSError, subprocess.TimeoutExpired) as reason:
        return f"{compiler}: {reason}"
    return f"{compiler}: {printed.stdout.decode(errors='replace').partition(chr(10))[0].strip() or 'it says nothing'}"
