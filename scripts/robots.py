"""Fetches the robots that slow tests read: the URDF files, and no more, of the packages in scripts/robots.lock.

    .venv/bin/python scripts/robots.py      prints the folder that they are in

230 MB are fetched by pip, once, and 4 MB kept, in .venv/robots-HASH, where HASH is that of the lock: where it changes,
they are fetched anew. The folder is whole or it is not there; of several starts at once, one fetches, the others wait.
Only the standard library is used here, and pip.
"""

from __future__ import annotations

import fcntl
import hashlib
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

LOCK = Path(__file__).with_suffix(".lock")
HOME = Path(__file__).parents[1] / ".venv"
# pybullet's one wheel of this version: what the tests want of it is the same text for every machine
WHEEL = ("--python-version", "3.11", "--implementation", "cp", "--abi", "cp311", "--platform", "manylinux2014_x86_64")


def folder() -> Path:
    """The folder with the files, fetched unless they are there. Raises SystemExit where that cannot be."""
    wanted = HOME / f"robots-{hashlib.sha256(LOCK.read_bytes()).hexdigest()[:12]}"
    with open(__file__) as turn:  # a lock that the kernel takes back from whoever dies
        fcntl.flock(turn, fcntl.LOCK_EX)
        if not wanted.is_dir():
            _fetch(wanted)
    return wanted


def _fetch(wanted: Path) -> None:
    HOME.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=HOME) as work:
        wheels, files = Path(work) / "wheels", Path(work) / "files"
        command = [sys.executable, "-P", "-m", "pip", "download", "--disable-pip-version-check", "--no-input",
                   "--no-deps", "--only-binary", ":all:", *WHEEL, "--require-hashes", "--requirement", str(LOCK),
                   "--dest", str(wheels)]  # fmt: skip
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)
        if done.returncode != 0:
            raise SystemExit(f"cannot fetch what {LOCK.name} names:\n{done.stderr}")
        for wheel in sorted(wheels.glob("*.whl")):
            with zipfile.ZipFile(wheel) as archive:
                for name in archive.namelist():
                    if name.endswith(".urdf"):
                        archive.extract(name, files)
        files.rename(wanted)


if __name__ == "__main__":
    print(folder())
