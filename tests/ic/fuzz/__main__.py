"""Decks that nobody would write, for some time: `python -m tests.ic.fuzz --seconds 3600`, from the project's root.

Every deck goes through all of `ic.check` with every run and sweep, its messages and its plan are printed, the plan is
written and read again. A fault is a traceback, a deck that takes more than 20 s of processor time, one that takes more
than 1 GiB, an error without a place, or a plan that reads back differently. Each kind of fault is told when it is first
found, and again in the end, then with the shortest deck found that shows it. Exit status 1 where there was one.

    --seconds N     how long [60]
    --seed N        of the series [the time]; the same seed on the same tree makes the same decks
    --first N       number of the first deck of the series [0]
    --keep FOLDER   write there what is found, as it comes: NUMBER.ic, the shortest deck so far, and NUMBER.txt
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from met.frozen import frozen

ROOT = Path(__file__).parents[3]


@frozen
class Fault:
    name: str
    number: int
    deck: str
    traceback: str


@frozen
class Findings:
    """What a stretch of the series gave: how many decks, the faults by name, the slowest deck's seconds and number."""

    decks: int
    faults: tuple[Fault, ...]
    slowest: tuple[float, int]


def fuzz(
    seed: int,
    seconds: float,
    first: int = 0,
    tell: Callable[[int, Fault], None] | None = None,
    decks: int = sys.maxsize,
) -> Findings:
    """Checks decks of the series from number `first` on, in processes of their own that may die.

    Ends after so many seconds of wall time, or after so many decks, whatever comes first.

    tell  is called with each fault as it comes, and with the number of its kind, from 0; again with a shorter deck
    """
    end = time.monotonic() + seconds
    faults: dict[str, Fault] = {}
    number, slowest = first, (0.0, first)

    def take(fault: Fault) -> None:
        if fault.name not in faults or len(fault.deck) < len(faults[fault.name].deck):
            faults[fault.name] = fault
            if tell is not None:
                tell(list(faults).index(fault.name), fault)

    while number < first + decks and time.monotonic() < end:
        with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile("w+") as complaints:
            stretch = (seed, number, first + decks - number, end - time.monotonic())
            words = [sys.executable, "-m", "tests.ic.fuzz.worker", *map(str, stretch)]
            last: dict[str, object] = {}
            with subprocess.Popen(
                [*words, folder], cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=complaints
            ) as worker:
                for line in worker.stdout or ():
                    last = json.loads(line)
                    if "fault" in last:
                        name, deck, told_of = (str(last[key]) for key in ("fault", "deck", "traceback"))
                        take(Fault(name, int(str(last["number"])), deck, told_of))
                    number = int(str(last.get("done", last.get("begun", number))))
            complaints.seek(0)
            if "done" in last:
                slowest = max(slowest, tuple(last["slowest"]))  # type: ignore[arg-type, call-overload]
            elif not last:
                raise RuntimeError(f"the worker did not begin: {complaints.read()}")
            else:
                deck = Path(folder, "deck.ic").read_bytes().decode("utf-8", "backslashreplace")
                take(Fault(f"the process ended with {worker.returncode}", number, deck, complaints.read()[-4000:]))
                number += 1
    return Findings(number - first, tuple(faults.values()), slowest)


def told(found: Findings, seed: int) -> str:
    """The findings as text."""
    seconds, slowest = found.slowest
    lines = [f"{found.decks} decks of seed {seed}; the slowest, number {slowest}, took {seconds:.1f} s"]
    return "\n".join([*lines, *map(_fault_told, found.faults)])


def _fault_told(fault: Fault) -> str:
    return "\n".join(["", f"=== {fault.name} (deck {fault.number})", fault.traceback, "--- the deck", fault.deck])


def main() -> int:
    about = "Checks decks that nobody would write. Exit status 1 where one shows a fault."
    parser = argparse.ArgumentParser(prog="python -m tests.ic.fuzz", description=about)
    parser.add_argument("--seconds", type=float, default=60.0, help="how long [60]")
    parser.add_argument("--seed", type=int, default=None, help="of the series of decks [the time]")
    parser.add_argument("--first", type=int, default=0, help="number of the first deck [0]")
    parser.add_argument("--keep", type=Path, default=None, metavar="FOLDER", help="write there what was found")
    asked = parser.parse_args()
    seed = asked.seed if asked.seed is not None else int(time.time())
    print(f"seed {seed}", flush=True)
    if asked.keep is not None:
        asked.keep.mkdir(parents=True, exist_ok=True)

    def tell(kind: int, fault: Fault) -> None:
        print(_fault_told(fault), flush=True)
        if asked.keep is not None:
            (asked.keep / f"{kind}.ic").write_text(fault.deck, encoding="utf-8")
            (asked.keep / f"{kind}.txt").write_text(f"{fault.name}\n{fault.traceback}", encoding="utf-8")

    found = fuzz(seed, asked.seconds, asked.first, tell)
    print(told(found, seed))
    return 1 if found.faults else 0


if __name__ == "__main__":
    sys.exit(main())
