"""How long it takes from a saved deck to the new picture in a browser: `python -m tests.batch.watching.latency [EDITS]`.

A number of the deck is another one at each edit, so that the program is, too, and is compiled anew. The picture is there
when the new run has taken the old one's place, two frames after it was drawn; cases and maps come behind it. Wall time;
and processor time of `met view`, of all its threads, and of the browser with all its processes.
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


def processor_seconds(name: str) -> float:
    """Of a process, and of those that it has begun: user and system time."""
    total, ticks = 0.0, os.sysconf("SC_CLK_TCK")
    waiting = [name]
    while waiting:
        pid = waiting.pop()
        try:
            fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
            children = [Path(each, "children").read_text().split() for each in Path(f"/proc/{pid}/task").iterdir()]
        except OSError:
            continue
        total += sum(map(int, fields[11:15])) / ticks
        waiting += [child for each in children for child in each]
    return total


def measure(text: str, first: float, edits: int) -> dict[str, list[float]]:
    """Seconds of each edit: until the picture, until all cases were run, and processor time until the picture."""
    found: dict[str, list[float]] = {name: [] for name in ("picture", "all", "cpu", "browser cpu")}
    with tempfile.TemporaryDirectory() as name, browser() as chromium:
        deck = Path(name, "deck.ic")
        deck.write_text(text % first)
        with viewing(deck, "-q") as view:
            page = chromium.open(view.address)
            for edit in range(edits + 1):
                own = os.getpid()
                if edit:
                    before = processor_seconds(str(view.process.pid)), processor_seconds(str(own)) - time.process_time()
                    beside = deck.with_name(".new")
                    beside.write_text(text % round(first * (1 + (edit + time.time() % 1) / 1000), 9))
                    os.replace(beside, deck)
                    began = time.time()
                shown = page.run(
                    f"new Promise(done => {{ const look = () => document.documentElement.dataset.shown == {edit + 1}"
                    " ? done(Date.now()) : setTimeout(look, 4); look(); })"
                )
                if edit:
                    after = processor_seconds(str(view.process.pid)), processor_seconds(str(own)) - time.process_time()
                    view_cpu = after[0] - before[0]
                    found["picture"].append(shown / 1000 - began)
                    found["cpu"].append(view_cpu)
                    found["browser cpu"].append(after[1] - before[1] - view_cpu)
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
