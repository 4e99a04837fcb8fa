"""How long it takes from a saved deck to the new picture in a browser.

    python -m tests.batch.watching.latency [EDITS]

A number of the deck is another one at each edit, so that the program is another, too, and is compiled anew. The picture
is there when the new run has taken the old one's place, two frames after it was drawn; cases and maps come behind it.
Wall time; and processor time until the picture, of `met view` with all its threads, and of the browser with all its
processes, one of which draws what a graphics processor would.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tests.batch.report.browser import browser
from tests.batch.watching.watched import viewing

DECKS = {
    "two-link arm, a sweep of 6 cases": (
        "#include <two_link.ic>\nrun mine like nominal { with links.upper.mass = %s kg; }\n"
        "default sweep tuned of mine { vary gearbox.kp = [0.005, 0.01, 0.02] V*s/rad;"
        " vary links.lower.mass = [45, 50] kg; }\n",
        50.0,
    ),
    "Panda, one run of 5 s": (
        "#include <panda.ic>\ndefault run mine like reach { with links.load.mass = %s kg; }\n",
        1.0,
    ),
}
"""Decks with a number to be edited, and what that is at first."""

NEXT_SECONDS = 0.3
"""Between an edit of which all has come, and the next."""


def processor_seconds(pid: int, besides: int = 0) -> float:
    """Of a process, and of those that it has begun and that run: user and system time. besides: one that is left out,
    with its own."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        children = [Path(each, "children").read_text().split() for each in Path(f"/proc/{pid}/task").iterdir()]
    except OSError:
        return 0.0
    own = sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")
    return own + sum(
        processor_seconds(int(child), besides) for each in children for child in each if int(child) != besides
    )


def measure(text: str, first: float, edits: int) -> dict[str, list[float]]:
    """Seconds of each edit: until the picture, until all cases were run, and processor time until the picture."""
    found: dict[str, list[float]] = {name: [] for name in ("picture", "all", "cpu", "browser cpu")}
    with tempfile.TemporaryDirectory() as name, browser() as chromium:
        deck = Path(name, "deck.ic")
        deck.write_text(text % first)
        with viewing(deck, "-q") as view:
            page = chromium.open(view.address)
            watching, own = view.process.pid, os.getpid()
            for edit in range(edits + 1):
                began = time.time()
                before = processor_seconds(watching), processor_seconds(own, watching) - time.process_time()
                if edit:
                    beside = deck.with_name(".new")
                    beside.write_text(text % round(first * (1 + (edit + began % 1) / 1000), 9))
                    began = time.time()
                    os.replace(beside, deck)
                shown = page.run(
                    f"new Promise(done => {{ const look = () => document.documentElement.dataset.shown == {edit + 1}"
                    " ? done(Date.now()) : setTimeout(look, 4); look(); })"
                )
                after = processor_seconds(watching), processor_seconds(own, watching) - time.process_time()
                if edit:
                    found["picture"].append(shown / 1000 - began)
                    found["cpu"].append(after[0] - before[0])
                    found["browser cpu"].append(after[1] - before[1])
                view.whole(page=edit + 1)
                if edit:
                    found["all"].append(time.time() - began)
                time.sleep(NEXT_SECONDS)
    return found


def main(edits: int) -> None:
    for name, (text, first) in DECKS.items():
        load = os.getloadavg()[0]
        found = measure(text, first, edits)
        print(f"{name}, {edits} edits, load {load:.0f} to {os.getloadavg()[0]:.0f}")
        for what, seconds in found.items():
            middle, most = np.percentile(seconds, [50, 95])
            print(f"  {what:12} median {middle:.2f} s, p95 {most:.2f} s, least {min(seconds):.2f} s")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50)
