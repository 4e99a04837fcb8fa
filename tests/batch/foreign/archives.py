"""An archive of two runs and a sweep, small and real, and what every command says of a copy of it that was changed."""

from __future__ import annotations

import contextlib
import io
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py

import batch
import ic
from met import cli
from tests.batch.door import ARM

DECK = (
    ARM
    + """
run open {
    arm = door;
    initial { hinge.qd = 0.1 rad/s; }
    rates { dynamics = 100 Hz;  record = 20 Hz; }
    duration = 0.2 s;
    record = [q, qd, links.handle.position];
    metric end = final { of = hinge.q; }
    require end < 2 deg;
}
sweep masses of open { vary links.leaf.mass = [3, 4, 5] kg;  vary integrator = [modified_euler, rk4]; }
"""
)

CASES = 3


def made(folder: Path, *select: str) -> Path:
    """The archive of this deck, `door.h5`."""
    (folder / "door.ic").write_text(DECK, encoding="utf-8")
    with contextlib.chdir(folder):
        batch.run(ic.compile("door.ic", select=list(select) or "all"), output=folder / "door.h5")
    return folder / "door.h5"


@contextlib.contextmanager
def changed(archive: Path, folder: Path) -> Iterator[tuple[Path, Any]]:
    """A copy of an archive in a folder, open to be changed."""
    copy = folder / "given.h5"
    shutil.copy(archive, copy)
    with h5py.File(copy, "r+") as file:
        yield copy, file


def replaced(group: Any, name: str, make: Callable[[], Any]) -> None:
    """Something else under the name of a dataset, with its attributes."""
    before = dict(group[name].attrs)
    del group[name]
    make()
    with contextlib.suppress(OSError, KeyError):
        for key, value in before.items():
            if key not in ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"):
                group[name].attrs[key] = value


@dataclass
class Said:
    """status, text: of a command, both of its streams."""

    status: int
    text: str


def met(*words: str) -> Said:
    """`met` with these words, in this process."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        status = cli.main(list(words))
    return Said(status, out.getvalue())


def readers(archive: Path, folder: Path, other: Path | None = None) -> dict[str, tuple[str, ...]]:
    """Commands that read an archive, by what they are called. other: an archive that is compared with it."""
    name = str(archive)
    beside = str(other or archive)
    return {
        "show": ("show", name),
        "show --format json": ("show", name, "--format", "json"),
        "show --evidence": ("show", name, "--evidence"),
        "show --case": ("show", name, "--case", "#0"),
        "diff": ("diff", beside, name),
        "diff back": ("diff", name, beside),
        "plot": ("plot", name, "-o", str(folder / "plot.svg")),
        "report": ("report", name, "-o", str(folder / "report.html")),
        "report --against": ("report", name, "--against", beside, "-o", str(folder / "report.html")),
        "export mcap": ("export", name, "-o", str(folder / "out.mcap"), "--case", "#0", "--force"),
        "export csv": ("export", name, "-o", str(folder / "out.csv"), "--force"),
        "export --evidence": ("export", name, "-o", str(folder / "evidence.csv"), "--evidence", "--force"),
        "run --case": ("run", name, "--case", "#0", "-o", str(folder / "again.h5"), "--no-picture"),
        "status": ("status", name),
    }
