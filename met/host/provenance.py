"""The provenance of results, in the archive and beside it.

The archive holds everything that decides the numbers: deck, plan, versions, git commit of MET and whether it was
changed. The file `<archive>.run.json` beside it holds what differs between runs: dates, host, CPU, wall times.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

from met.host import system

UNKNOWN = "unknown"


class Revision:
    """Git's answer about MET's own source, asked for at once and read later."""

    def __init__(self) -> None:
        """Start `git describe` on MET's own source; nothing is started where that is no checkout."""
        self._process: subprocess.Popen[str] | None = None
        home = Path(__file__).resolve().parents[2]
        if not (home / ".git").exists():
            return
        # git refuses a folder of another user, whose settings may name programs; its code runs here anyway
        trusted = ("-c", f"safe.directory={home}", "-c", "core.fsmonitor=false")
        command = ["git", *trusted, "-C", str(home), "describe", "--always", "--dirty", "--abbrev=40", "--exclude", "*"]
        quiet = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}  # a hook sets
        quiet["GIT_OPTIONAL_LOCKS"] = "0"
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                env=quiet,
            )
        except OSError:
            self._process = None

    def read(self) -> tuple[str, str]:
        """The commit, and "yes" or "no": whether tracked files differ from it; both "unknown" outside a repository."""
        if self._process is None:
            return UNKNOWN, UNKNOWN
        try:
            revision = self._process.communicate(timeout=10)[0].strip()
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()
            return UNKNOWN, UNKNOWN
        if self._process.returncode != 0 or not revision:
            return UNKNOWN, UNKNOWN
        commit, _, dirty = revision.partition("-")
        return commit, "yes" if dirty else "no"

    def close(self) -> None:
        """End the process, whether or not its answer was read."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None


def version(package: str) -> str:
    """The version of an installed package; `UNKNOWN` where it is not installed, or says none."""
    try:
        return metadata.version(package) or UNKNOWN  # None where its metadata is missing
    except metadata.PackageNotFoundError:
        return UNKNOWN


def machine() -> dict[str, Any]:
    """Host, CPU and software on which the numbers do not depend."""
    return {
        "host": platform.node(),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "cpu": system.cpu() or UNKNOWN,
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "h5py": getattr(sys.modules.get("h5py"), "__version__", UNKNOWN),
    }
