"""Programs that do not outlive who asked for them: `python keeper.py FOLDER`.

Each line of input is a program to start, as JSON: `[name, [word, ...]]`. What it prints goes to FOLDER/log/NAME.out;
when it ends, FOLDER/log/NAME.ended says how. When the input ends, every process below this one is killed, and FOLDER is
removed. The input ends also when its writer is killed, so a test that came to no good end leaves nothing behind.

While FOLDER/held is locked, its keeper lives.
"""

from __future__ import annotations

import ctypes
import fcntl
import json
import os
import select
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

# From linux/prctl.h.
PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER = 1, 36
PRCTL = ctypes.CDLL(None).prctl


def hold(folder: Path) -> int:
    """A lock on `folder`, for as long as this process lives; whoever sees the file finds it locked."""
    new = folder / "held.new"
    file = os.open(new, os.O_CREAT | os.O_RDWR | os.O_CLOEXEC)
    fcntl.flock(file, fcntl.LOCK_EX)
    new.rename(folder / "held")
    return file


def start(folder: Path, name: str, words: list[str]) -> int:
    """Starts a program, whose process id this is."""
    with (folder / "log" / f"{name}.out").open("ab") as out:
        return subprocess.Popen(
            words,
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=subprocess.STDOUT,
            cwd=folder,
            # Should this process be killed with -9, the programs end with it; their children stay (`slurm.sweep`).
            preexec_fn=lambda: PRCTL(PR_SET_PDEATHSIG, signal.SIGKILL),
        ).pid


def ended() -> dict[int, int]:
    """Exit codes of children that have ended, by process id. Raises ChildProcessError where there are no children."""
    found: dict[int, int] = {}
    while True:
        try:
            pid, status = os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            if found:
                return found
            raise
        if pid == 0:
            return found
        found[pid] = os.waitstatus_to_exitcode(status)


def below(root: int) -> list[int]:
    """Process ids of all descendants."""
    children: dict[int, list[int]] = {}
    for entry in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            # The name, in brackets, may hold anything; the state and the parent follow it.
            parent = int((entry / "stat").read_text(errors="replace").rpartition(")")[2].split()[1])
            children.setdefault(parent, []).append(int(entry.name))
    found = list(children.get(root, ()))
    for pid in found:
        found += children.get(pid, ())
    return found


def end_all() -> None:
    """Kills all descendants. None escapes: a process whose parent dies becomes our child (PR_SET_CHILD_SUBREAPER)."""
    while True:
        for pid in below(os.getpid()):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        try:
            ended()
        except ChildProcessError:
            return
        time.sleep(0.01)


def keep(folder: Path) -> None:
    """Starts what the input asks for and notes what ends, until the input ends."""
    names: dict[int, str] = {}
    waiting = b""
    while True:
        if select.select([0], [], [], 0.1)[0]:
            read = os.read(0, 65536)
            if not read:
                return
            *lines, waiting = (waiting + read).split(b"\n")
            for line in lines:
                name, words = json.loads(line)
                names[start(folder, name, words)] = name
        with suppress(ChildProcessError):
            for pid, code in ended().items():
                if pid in names:
                    (folder / "log" / f"{names.pop(pid)}.ended").write_text(f"{code}\n")


def main(folder: Path) -> None:
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    PRCTL(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    held = hold(folder)
    try:
        keep(folder)
    finally:
        end_all()
        shutil.rmtree(folder, ignore_errors=True)
        os.close(held)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
