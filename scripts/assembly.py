"""Prints the processor's instructions of a deck's runs, as LLVM writes them for this machine.

.venv/bin/python scripts/assembly.py deck.ic [NAME]...      all runs and sweeps of the deck, or the named ones
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence

import ic
from met import backends
from met.backends.llvm import machine
from met.diagnostic import Problem
from met.messages.render import render
from met.program.build import build
from met.trace.recorder import record


def listings(deck: str, names: Sequence[str]) -> Iterator[str]:
    """The instructions of each run, as text. Raises Problem."""
    for experiment in ic.compile(deck, select=names or "all").experiments:
        text = backends.find("llvm").emit(record(build(experiment)))
        yield machine.listing(text, machine.machine())


def main(deck: str, names: Sequence[str]) -> int:
    """Print the instructions. Returns the exit status: 2 for a deck with mistakes."""
    try:
        for listing in listings(deck, names):
            print(listing)
    except Problem as problem:
        print(render(problem.diagnostics, problem.sources), file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    usage = "scripts/assembly.py DECK [NAME]..."
    sys.exit(main(sys.argv[1], sys.argv[2:]) if len(sys.argv) > 1 and sys.argv[1][0] != "-" else usage)
