"""The process that checks decks, one after the other: `python -m tests.ic.fuzz.worker SEED FIRST DECKS SECONDS FOLDER`.

A line of JSON on standard output for each deck that is begun, each fault and the end. What kills this process, or
makes it hang where Python cannot stop it, is the deck that was begun last; the one that started it sees that.
"""

from __future__ import annotations

import faulthandler
import json
import os
import random
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from tests.ic.fuzz import corpus, mutations, one

BACKSTOP = 6 * one.MOST_SECONDS  # of wall time: a machine may be busy
TRIES, SECONDS_TO_SHORTEN = 300, 60.0


def main(seed: int, first: int, decks: int, seconds: float, directory: Path) -> None:
    os.chdir(directory)
    deck = Path("deck.ic")
    _companions(random.Random(0))
    corpus.words()
    deck.write_text("#include <two_link.ic>\n")
    one.fault_of(deck)  # so that what is imported late is there
    one.limit_memory()
    end = time.monotonic() + seconds
    number, slowest = first, (0.0, first)
    while number < first + decks and time.monotonic() < end:
        _say(begun=number)
        deck.write_bytes(mutations.deck(seed, number))
        _companions(random.Random(f"{seed}/{number}/companions"))
        started = time.process_time()
        faulthandler.dump_traceback_later(BACKSTOP, exit=True)
        fault = one.fault_of(deck)
        faulthandler.cancel_dump_traceback_later()
        slowest = max(slowest, (time.process_time() - started, number))
        if fault is not None:
            name, told = fault
            short = deck.read_bytes()
            if not name.startswith("Hung"):
                short = shortened(short, partial(_still, deck, name))
            _say(fault=name, number=number, traceback=told, deck=short.decode("utf-8", "backslashreplace"))
        number += 1
    _say(done=number, slowest=slowest)


def _companions(rng: random.Random) -> None:
    """Files that decks name, now and then with some bytes changed."""
    for name, data in corpus.companions():
        changed = rng.random() < 0.05
        path = Path(name)
        if changed or not path.exists() or path.stat().st_size != len(data):
            path.write_bytes(mutations.changed_bytes(rng, data) if changed else data)


def _still(deck: Path, name: str, data: bytes) -> bool:
    deck.write_bytes(data)
    fault = one.fault_of(deck)
    return fault is not None and fault[0] == name


def shortened(data: bytes, shows: Callable[[bytes], bool]) -> bytes:
    """A shorter deck that still shows the fault: lines, then pieces of lines, left out as long as that helps."""
    tries, end = 0, time.monotonic() + SECONDS_TO_SHORTEN
    for cut in (lambda b: b.splitlines(keepends=True), _in_pieces):
        pieces = cut(data)
        size = max(1, len(pieces) // 2)
        while size >= 1:
            at = 0
            while at < len(pieces):
                if tries >= TRIES or time.monotonic() > end:
                    return b"".join(pieces)
                tries += 1
                fewer = pieces[:at] + pieces[at + size :]
                if shows(b"".join(fewer)):
                    pieces = fewer
                else:
                    at += size
            size //= 2
        data = b"".join(pieces)
    return data


def _in_pieces(data: bytes) -> list[bytes]:
    return [
        piece.encode("utf-8", "surrogateescape")
        for piece in mutations.pieces_of(data.decode("utf-8", "surrogateescape"))
    ]


def _say(**what: object) -> None:
    print(json.dumps(what), flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:4]), float(sys.argv[4]), Path(sys.argv[5]))
