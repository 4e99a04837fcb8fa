"""`met diff` beside `h5diff` and `xarray.testing.assert_identical`: whole processes, from start to end.

Pairs of archives in three states: the same bytes; a few values of B changed; every number of B changed in its last
bit, which is what another build does and what leaves nothing to skip. Before every start both files are dropped from
the page cache, and nothing is started while a page of them is in memory; programs and libraries stay there. What a
host keeps of a virtual machine's disk is out of reach.

The three do not do the same. h5diff compares all that is in the files, by position, and says how many values differ;
xarray says which variables do, and takes both archives into memory; met diff matches cases by their keys and leaves out
what only follows or names: case_id, friction's counts, copies along recorded_case.
"""

from __future__ import annotations

import ctypes
import mmap
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np

from benchmarks.benchmark import Benchmark, Derived, Target, Untaken, ratio
from benchmarks.whole_process import MET, Used, run, timed

TITLE = "met diff, whole processes, both files dropped from the page cache before each"

DECK = """
#include <two_link.ic>
sweep varied of nominal {{
    vary gearbox.kp = linspace(0.010, 0.030, {gains}) V*s/rad;
    vary links.upper.mass = linspace(40, 60, {masses}) kg;
}}
"""


@dataclass(frozen=True)
class Pair:
    """A campaign of gains * masses cases of the two-link arm, and which histories are kept: 28 KB each."""

    name: str
    doc: str
    gains: int
    masses: int
    histories: str


MILLION = Pair("million", "a million cases, 1,000 histories", 1000, 1000, "every:1000")
HISTORIES = Pair("histories", "10,000 cases, all histories", 100, 100, "all")
SMALL = Pair("small", "28 cases, all histories", 7, 4, "all")
"""A pair whose processes are so short that they measure the start."""

STATES = {"same": "the same bytes", "few": "a few values differ", "all": "every number differs in its last bit"}


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    """The folder of the archives during this process."""
    return tempfile.TemporaryDirectory(prefix="met-benchmark-")


@cache
def archives(pair: Pair, state: str) -> tuple[Path, Path]:
    """A and B, made at the first call."""
    folder = Path(_folder().name)
    a, b = folder / f"{pair.name}.h5", folder / f"{pair.name}_{state}.h5"
    if not a.exists():
        deck = DECK.format(gains=pair.gains, masses=pair.masses)
        run("run", "deck.ic", "varied", "-o", str(a), "--no-picture", "--histories", pair.histories, deck=deck)
    shutil.copyfile(a, b)
    if state != "same":
        plant(b, few=state == "few")
    return a, b


FEW = 3
"""Number of cases of each metric and of each signal that differ in a pair with few changes."""


def plant(path: Path, *, few: bool) -> None:
    """Change the numbers of metrics and signals to the next double: in a few cases, or in all."""
    import h5py

    with h5py.File(path, "r+") as file:
        for dataset in file.values():
            if isinstance(dataset, h5py.Dataset) and dataset.attrs.get("role") in (b"metric", b"signal"):
                count = len(dataset)
                places = np.linspace(0, count - 1, FEW).astype(int) if few else range(0, count, BLOCK)
                for first in places:
                    some = slice(first, first + (1 if few else BLOCK))
                    dataset[some] = np.nextafter(dataset[some], np.inf)


BLOCK = 4096
"""Number of cases that are changed at a time."""


# The page cache


def resident(path: Path) -> int:
    """Pages of a file that are in memory."""
    size = path.stat().st_size
    pages = (ctypes.c_ubyte * -(-size // mmap.PAGESIZE))()
    with path.open("rb") as file, mmap.mmap(file.fileno(), size, prot=mmap.PROT_READ) as mapped:
        start = np.frombuffer(mapped, np.uint8)
        failed = ctypes.CDLL(None).mincore(ctypes.c_void_p(start.ctypes.data), ctypes.c_size_t(size), pages)
        del start  # the map cannot be closed before
    if failed:
        raise Untaken("this system does not say what of a file is in memory (mincore)")
    return int((np.frombuffer(pages, np.uint8) & 1).sum())


def drop(path: Path) -> None:
    """Drop a file from the page cache; raises Untaken where that cannot be done."""
    for _ in range(DROPS):
        with path.open("rb") as file:
            os.fsync(file.fileno())
            os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
        left = resident(path)
        if not left:
            return
    raise Untaken(
        f"{left} pages of a file stay in memory in {path.parent}: its file system may lie there; TMPDIR names another"
    )


DROPS = 5
"""Number of tries: pages that are being written or read stay."""


# What is measured


def _met() -> list[str | Path]:
    return [MET, "diff"]


def _h5diff() -> list[str | Path]:
    path_of_h5diff = shutil.which("h5diff")
    if path_of_h5diff is None:
        raise Untaken("`h5diff` is not installed; `apt install hdf5-tools`, or the package of the HDF5 tools here")
    return [path_of_h5diff]


XARRAY = "import sys, xarray; xarray.testing.assert_identical(*map(xarray.open_dataset, sys.argv[1:]))"


def _xarray() -> list[str | Path]:
    return [sys.executable, "-c", XARRAY]


TOOLS: dict[str, Callable[[], Sequence[str | Path]]] = {"met": _met, "h5diff": _h5diff, "xarray": _xarray}

TELLS = {"met": "different; no tolerance was given", "h5diff": "", "xarray": "AssertionError"}
"""The expected output of each tool for a pair that differs."""


def compared(command: Sequence[str | Path], tool: str, pair: Pair, state: str) -> Used:
    """A tool over a pair, cold; that it comes to the right answer."""
    paths = archives(pair, state)
    for path in paths:
        drop(path)
    used = timed([*command, *paths], _folder().name)
    if used.status != (state != "same") or (used.status and TELLS[tool] not in used.text):
        ending = f"it ended with {used.status}:\n{used.text}"
        raise SystemExit(f"{tool} was wrong over {pair.doc}, {STATES[state]}: {ending}")
    return used


def _prepared(tool: str, pair: Pair, state: str, which: Callable[[Used], float]) -> Callable[[], float]:
    command = TOOLS[tool]()
    for path in archives(pair, state):
        drop(path)
    return lambda: which(compared(command, tool, pair, state))


def _seconds(tool: str, pair: Pair, state: str) -> Benchmark:
    doc = f"{pair.doc}: {STATES[state]}" if tool == "met" else f"{tool} on the same pair"
    return Benchmark(f"diff.{pair.name}.{state}.{tool}", doc, "s",
                     partial(_prepared, tool, pair, state, lambda used: used.seconds), turns=5,
                     slow=pair is not SMALL)  # fmt: skip


def _pair(pair: Pair, state: str, target: Target | None) -> list[Benchmark | Derived]:
    name = f"diff.{pair.name}.{state}"
    return [
        *(_seconds(tool, pair, state) for tool in TOOLS),
        *(ratio(f"{name}.{tool}.ratio", f"times the time of {tool} that met diff takes", over=f"{name}.met",
                under=f"{name}.{tool}", target=target) for tool in TOOLS if tool != "met"),
    ]  # fmt: skip


def _cold() -> Callable[[], float]:
    """Pages of the pair of a million that are in memory at a start: none, or the measurement is refused."""
    paths = archives(MILLION, "same")

    def measure() -> float:
        for path in paths:
            drop(path)
        return float(sum(map(resident, paths)))

    return measure


BENCHMARKS: tuple[Benchmark | Derived, ...] = (
    Benchmark("diff.cold", "pages of both files of a million cases that are in memory at a start", "", _cold,
              Target(0.0), turns=1, slow=True),
    *(benchmark for state in STATES for benchmark in _pair(MILLION, state, Target(1.0))),
    *(Benchmark(f"diff.million.{state}.memory", f"memory that met diff has in use: {STATES[state]}", "MiB",
                partial(_prepared, "met", MILLION, state, lambda used: used.memory), Target(1024.0), 1, True)
      for state in STATES),
    Benchmark("diff.million.same.read", "what met diff reads from the disk, of 2 * 250 MiB", "MiB",
              partial(_prepared, "met", MILLION, "same", lambda used: used.read), turns=1, slow=True),
    *(benchmark for state in STATES for benchmark in _pair(HISTORIES, state, Target(1.0))),
    *_pair(SMALL, "few", None),
)  # fmt: skip
