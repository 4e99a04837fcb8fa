"""Pictures of docs/report.md: the reports of real runs, as a browser shows them.

python -m tests.batch.report.figures          writes docs/figures/report_*.png

report_page.png       the head of a report: the Panda's payload sweep
report_points.png     its cases, one of which is chosen, and two parameters at once
report_signals.png    its arm, and its worst cases near to
report_stability.png  a motor on a bed, under arms of ten weights
report_narrow.png     the head of the same on a telephone, dark
report_designs.png    which design to use: the crane of docs/best.md
report_against.png           the story of docs/diff.md: the head of after.h5 against before.h5
report_against_signals.png   what was before under what is now
report_against_points.png    the metric of each case, and where it was; a map of the change
"""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

import batch
import ic
from batch.report import report
from tests.batch.report.browser import GATHERED, Page, browser
from tests.docs import mended_servo

FOLDER = Path(__file__).parents[3] / "docs" / "figures"

BENCH = """
#include <two_link.ic>
run bench like nominal {
    substitute shoulder { bed = emulated(delay = 1);  law = measured_acceleration; }
    rates    { base = 1 kHz;  dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    duration = 6 s;
}
sweep loads of bench { vary links.lower.mass = linspace(10, 100, 10) kg; }
"""


def draw(folder: Path) -> list[Path]:
    """All pictures, in `folder`; gives back their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name, browser() as chromium:
        home = Path(name)
        batch.run(ic.compile("panda.ic", select=["payload"]), output=home / "panda.payload.h5")
        payload = report(home / "panda.payload.h5", title="Panda: payload against gain")
        (home / "bench.ic").write_text(BENCH, encoding="utf-8")
        batch.run(ic.compile(home / "bench.ic", select=["loads"]), output=home / "bench.loads.h5")
        loads = report(home / "bench.loads.h5")
        page = chromium.open(payload, width=1180, height=960, scale=1.5)
        page.settle()
        written = [_window(page, folder / "report_page.png")]
        page.run("MET.models[0].choose(11)")
        page.settle()
        written.append(page.picture(folder / "report_points.png", "section.overview"))
        page.run(GATHERED)
        left, top, width, height = page.box(".signals .u-over", 2)
        page.drag([(left + 0.66 * width, top + 30), (left + 0.7 * width, top + 30), (left + 0.84 * width, top + 40)])
        left, top, width, height = page.box(".signals .u-over", 2)
        page.mouse("mouseMoved", left + 0.4 * width, top + 0.5 * height)
        page.run(
            "new Promise(d => { const f = () => MET.models[0].stage().isStill() ? d() : setTimeout(f, 20); f(); })"
        )
        page.settle()
        written.append(page.picture(folder / "report_signals.png", "section.signals"))
        page = chromium.open(loads, width=1180, height=960, scale=1.5)
        page.settle()
        written.append(page.picture(folder / "report_stability.png", "section.stability"))
        page = chromium.open(payload, width=390, height=844, dark=True, scale=2)
        page.settle()
        written.append(_window(page, folder / "report_narrow.png"))
        deck = re.search(r"<!-- crane\.ic -->\n```c\n(.*?)```", (FOLDER.parent / "best.md").read_text(), re.DOTALL)
        assert deck is not None
        (home / "crane.ic").write_text(deck[1], encoding="utf-8")
        batch.run(ic.compile(home / "crane.ic", select=["gains"]), output=home / "crane.gains.h5", histories="none")
        page = chromium.open(report(home / "crane.gains.h5"), width=1180, height=960, scale=1.5)
        page.settle()
        written.append(page.picture(folder / "report_designs.png", "section.designs"))
        mended_servo.told(home)
        against = report(home / "after.h5", against=home / "before.h5", title="Drive 2 against drive 1")
        page = chromium.open(against, width=1180, height=1150, scale=1.5)
        page.settle()
        written.append(_window(page, folder / "report_against.png"))
        left, top, width, height = page.box(".signals .u-over", 1)
        page.mouse("mouseMoved", left + 0.58 * width, top + 0.5 * height)
        page.settle()
        written.append(page.picture(folder / "report_against_signals.png", "section.signals"))
        page.mouse("mouseMoved", 1, 1)
        page.settle()
        written.append(page.picture(folder / "report_against_points.png", "section.overview"))
    return written


def _window(page: Page, path: Path) -> Path:
    """What is seen without scrolling."""
    import base64

    path.write_bytes(base64.b64decode(page.ask("Page.captureScreenshot", format="png")["data"]))
    return path


if __name__ == "__main__":
    for path in draw(FOLDER):
        print(path)
