"""How fast a page plays the Panda among a hundred ghosts, where a processor draws: the figures of docs/webassembly.md.

python -m tests.batch.portable.pace

It says frames a second while it plays, and the processor's time that a frame takes, by process of the browser, the
median of several stretches, with the machine's load. SwiftShader's threads wait for work by spinning: under load its
time is more.
"""

from __future__ import annotations

import os
import statistics
import tempfile
from pathlib import Path

import batch
import ic
from met import cli
from tests.batch.portable.figures import HUNDRED, READY
from tests.batch.report.browser import browser

STRETCHES, MILLISECONDS = 7, 2000

PLAY = """(length => new Promise(done => { MET.shown.seek(0); MET.shown.play(true);
    let frames = 0; const begun = performance.now();
    (function frame() { if (performance.now() - begun < length) { frames++; requestAnimationFrame(frame); }
        else { MET.shown.play(false); done([frames, performance.now() - begun]); } })(); }))"""


def main() -> None:
    with tempfile.TemporaryDirectory() as name, browser() as chromium:
        home = Path(name)
        batch.run(ic.compile(text=HUNDRED, select=["hundred"]), output=home / "hundred.h5", histories="none")
        assert cli.main(["view", str(home / "hundred.h5"), "-q"]) == 0
        for width, height in ((1280, 900), (400, 800)):
            page = chromium.open(home / "hundred.view.html", width=width, height=height)
            page.run(READY)
            page.run(f"{PLAY}({MILLISECONDS})")  # until it has as few dots as it takes
            rates, spent = [], []
            for _ in range(STRETCHES):
                before = chromium.cpu_seconds()
                frames, milliseconds = page.run(f"{PLAY}({MILLISECONDS})")
                after = chromium.cpu_seconds()
                rates.append(1000.0 * frames / milliseconds)
                spent.append({kind: 1000.0 * (after[kind] - before.get(kind, 0.0)) / frames for kind in after})
            told = ", ".join(
                f"{kind} {statistics.median(each.get(kind, 0.0) for each in spent):.0f}" for kind in ("renderer", "GPU")
            )
            print(
                f"{page.run('MET.shown.ghosts()')} ghosts, {width} px, load {os.getloadavg()[0]:.0f}: "
                f"{statistics.median(rates):.0f} frames a second, at most {max(rates):.0f}; "
                f"ms of processor a frame: {told}"
            )
            page.close()


if __name__ == "__main__":
    main()
