"""The first screen of a report, wide and on a telephone: the answer, and the command that runs it again."""

from __future__ import annotations

from pathlib import Path

import pytest

import batch
import ic
from batch.report import report
from tests.batch.report.browser import Chromium, quiet

pytestmark = pytest.mark.browser

DECK = """
#include <two_link.ic>
run brief like nominal { duration = 12 s;  require volts < 6 V in 90 % of cases with 80 % confidence; }
sweep chosen of brief { vary gearbox.kp = linspace(0.01, 0.03, 4) V*s/rad;  vary gearbox.ki = [0.125, 0.25] V/rad; }
sweep drawn of brief { seed = 1;  sample random(12) { links.upper.mass = uniform(40, 50) kg; } }
tune tuned of brief {
    choose gearbox.kp = between(0.01, 0.03) V*s/rad;
    minimise settle;
    at_most = 20;
}
"""

ANSWERS = {
    "chosen": (".answered .pick", ".answered .command", ".answered .note"),
    "tuned": (".answered .pick", ".answered .command"),
    "drawn": ("#verdict .word", "#verdict .share", "#verdict .answer .command"),
    "against": (".against .word", ".against .share", ".against .answer .command"),
    "brief": ("#verdict .word", "#verdict .answer .command"),
}
"""Of each report, what its first screen holds."""


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a report on a sweep that chooses, a tuning, a sample, a comparison and a run."""
    folder = tmp_path_factory.mktemp("screens")
    (folder / "arm.ic").write_text(DECK, encoding="utf-8")
    for name in ("chosen", "tuned", "drawn", "brief"):
        batch.run(ic.compile(folder / "arm.ic", select=[name]), output=folder / f"{name}.h5")
        report(folder / f"{name}.h5", folder / f"{name}.html")
    batch.run(ic.compile(folder / "arm.ic", select=["drawn"], set=["gearbox.kp=0.02 V*s/rad"]), output=folder / "b.h5")
    report(folder / "b.h5", folder / "against.html", against=folder / "drawn.h5")
    return folder


@pytest.mark.parametrize("width", [1280, 400])
@pytest.mark.parametrize("name", ANSWERS)
def test_the_first_screen_holds_the_answer_and_the_command(
    chromium: Chromium, reports: Path, name: str, width: int
) -> None:
    page = chromium.open(reports / f"{name}.html", width=width, height=800)
    page.settle()
    for selector in ANSWERS[name]:
        bottoms = page.run(f"[...document.querySelectorAll('{selector}')].map(e => e.getBoundingClientRect().bottom)")
        assert bottoms and bottoms[0] <= 800, selector
    assert page.run("document.documentElement.scrollWidth") <= width
    quiet(page)
    page.close()
