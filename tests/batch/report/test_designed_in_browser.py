"""What a reader sees in a browser: dense maps, values that stray, long names on a wide and on a narrow screen."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import batch
import ic
from batch.report import report
from met import run as engine
from tests.batch import plans
from tests.batch.report import archives
from tests.batch.report.browser import Chromium, Page, quiet

pytestmark = pytest.mark.browser

DECK = """
#include <two_link.ic>
servo a_gearbox_with_a_rather_long_name like gearbox { }
run a_run_with_quite_a_long_name_of_its_own like nominal {
    servos { shoulder = a_gearbox_with_a_rather_long_name;  elbow = a_gearbox_with_a_rather_long_name; }
    duration = 4 s;
    metric far_from_home_as_it_may_be = max { of = shoulder.q; }
    require far_from_home_as_it_may_be < 5 deg;
    metric peak = overshoot { of = shoulder.qd;  target = slow; }
    require peak < 5 %;
}
sweep tuning of a_run_with_quite_a_long_name_of_its_own {
    vary a_gearbox_with_a_rather_long_name.kp = linspace(0.002, 0.040, 9) V*s/rad;
    vary a_gearbox_with_a_rather_long_name.ki = linspace(0.02, 0.40, 8) V/rad;
}
"""

CLIPPED = """(() => {
    const out = [];
    const wide = document.documentElement.clientWidth;
    for (const e of document.querySelectorAll("body *")) {
        const box = e.getBoundingClientRect();
        if (!box.width || e.closest(".skip, .quiet, .source, .head, #tip")) continue;
        const style = getComputedStyle(e);
        const hides = style.overflowX !== "visible" && e.clientWidth && e.tagName !== "CODE";
        const words = `${e.tagName} ${e.className} ${e.textContent.slice(0, 60)}`;
        if (hides && e.scrollWidth > e.clientWidth + 1) out.push(`hidden: ${words}`);
        if (box.right > wide + 1) out.push(`beyond: ${words}`);
        if (e.tagName === "SELECT" && e.selectedOptions.length) {
            const context = document.createElement("canvas").getContext("2d");
            context.font = style.font;
            if (context.measureText(e.selectedOptions[0].text).width + 24 > e.clientWidth) out.push(`select: ${words}`);
        }
    }
    return out;
})()"""
"""What is wider than its box, and what sticks out of the page; the deck's own text scrolls."""


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report against another archive, in which everything has a long name."""
    folder = tmp_path_factory.mktemp("designed")
    (folder / "arm.ic").write_text(DECK, encoding="utf-8")
    names = [folder / f"{which}_with_a_long_name_of_its_own.h5" for which in ("before", "after")]
    for name, kt in zip(names, ("0.061", "0.05"), strict=True):
        plan = ic.compile(folder / "arm.ic", select=["tuning"], set=[f"shoulder.servo.kt={kt} N*m/A"])
        batch.run(plan, output=name)
    return report(names[1], folder / "a.html", against=names[0])


@pytest.fixture(scope="module")
def dense(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A report of a logarithmic sweep of 60 x 30 cases: one strays, one is infinite, one fails."""
    folder = tmp_path_factory.mktemp("dense")
    real = plans.answer

    def answer(*args: Any, **options: Any) -> Any:
        found = real(*args, fails=frozenset({400}), **options)
        stray = np.where(found.case == 300, 1e12, found.metrics["volts"] + 0.001 * (found.case % 30))
        return replace(found, metrics={**found.metrics, "volts": np.where(found.case == 200, np.inf, stray)})

    with pytest.MonkeyPatch.context() as patch:
        plans.answering(patch)
        patch.setattr(engine, "run", answer)
        sweep = archives.grid(np.geomspace(0.001, 0.1, 60).tolist(), np.linspace(1.0, 9.0, 30).tolist())
        archives.made(folder / "a.h5", sweep, histories="none")
    yield report(folder / "a.h5")


def choose(page: Page, selector: str, value: str) -> None:
    page.run(
        f"(() => {{ const s = document.querySelector({selector!r}); s.value = {value!r};"
        "s.dispatchEvent(new Event('change')); })()"
    )
    page.settle()


def opened(chromium: Chromium, path: Path, **options: Any) -> Page:
    page = chromium.open(path, **options)
    page.settle()
    return page


@pytest.mark.release
@pytest.mark.parametrize("width", [1280, 390, 320])
@pytest.mark.parametrize("dark", [False, True])
def test_nothing_is_clipped(chromium: Chromium, compared: Path, width: int, dark: bool) -> None:
    page = opened(chromium, compared, width=width, dark=dark)
    page.run("document.querySelectorAll('details:not(.file)').forEach((each) => { each.open = true; })")
    page.settle()
    assert page.run(CLIPPED) == []
    quiet(page)
    page.close()


def test_no_backtick_is_seen_but_in_the_deck(chromium: Chromium, compared: Path) -> None:
    page = opened(chromium, compared)
    page.run("document.querySelectorAll('.source').forEach((each) => each.remove())")
    page.run("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    seen = page.run("Array.from(document.querySelectorAll('header, main, footer'), (e) => e.innerText).join()")
    assert "the program of tuning is another" in seen and "`" not in seen
    page.close()


def test_a_unit_is_told_once(chromium: Chromium, compared: Path) -> None:
    page = opened(chromium, compared)
    rows = page.run(
        "Array.from(document.querySelectorAll('.compared .cases tbody tr'), (row) => "
        "Array.from(row.children, (cell) => cell.textContent))"
    )
    assert rows and {row[5] for row in rows} <= {"%", "s", "deg", "V", "rad", "rad/s", "N·m"}
    for text in (text for row in rows for text in row[3:5]):
        float(text.replace("∞", "inf"))  # a number alone
    page.close()


def test_lines_of_a_panel_are_equally_thick(chromium: Chromium, compared: Path) -> None:
    page = opened(chromium, compared)
    choose(page, ".how", "now")
    widths = page.run("MET.models[0].signalPlots().map((u) => u.series.slice(1).map((s) => s.width))")
    assert len(widths) == 4 and {len(set(each)) for each in widths} == {1}
    page.close()


@pytest.mark.parametrize("width", [1280, 390])
def test_a_dense_map_is_drawn_without_gaps_and_says_what_strays(chromium: Chromium, dense: Path, width: int) -> None:
    page = opened(chromium, dense, width=width)
    choose(page, ".map select", "metric:volts")
    bare = page.run(
        "(() => { const c = document.querySelector('.map canvas'), w = c.width, h = Math.round(c.height * 0.5);"
        "const { data } = c.getContext('2d').getImageData(Math.round(w * 0.32), 4, Math.round(w * 0.66), h);"
        "let bare = 0; for (let i = 3; i < data.length; i += 4) bare += data[i] < 255; return bare; })()"
    )
    assert bare == 0
    said = page.run("document.querySelector('.map .scale').textContent")
    assert "1 cell above, up to 1e12" in said and "infinite (1 cell)" in said and "failed (1 cell)" in said
    counted = re.search(r"([\d,]+) of 1,800 cases miss, in ([\d,]+) of 1,440 cells", said)
    assert counted is not None
    missed, cells = (int(each.replace(",", "")) for each in counted.groups())
    assert 0 < cells < missed < 1800
    assert "no case" not in said
    page.run("document.querySelector('.map canvas').focus()")
    for key in ("ArrowRight", "ArrowRight", "ArrowUp", "Enter"):
        page.key(key)
    assert page.run("MET.models[0].chosen") == 61  # the worse of two in the cell
    quiet(page)
    page.close()


def test_points_of_a_logarithmic_sweep_lie_on_a_logarithmic_axis(chromium: Chromium, dense: Path) -> None:
    page = opened(chromium, dense)
    assert page.run("MET.models[0].plot.u.scales.x.distr") == 3
    page.close()


@pytest.fixture(scope="module")
def sparse(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of a logarithmic sweep of four values."""
    folder = tmp_path_factory.mktemp("sparse")
    (folder / "arm.ic").write_text(
        "#include <two_link.ic>\nsweep few of nominal { vary gearbox.kp = logspace(0.004, 0.04, 4) V*s/rad; }\n"
    )
    batch.run(ic.compile(folder / "arm.ic", select=["few"]), output=folder / "few.h5")
    return report(folder / "few.h5", folder / "few.html")


@pytest.mark.release
def test_a_short_logarithmic_axis_has_several_numbers(chromium: Chromium, sparse: Path) -> None:
    page = opened(chromium, sparse)
    said = page.run("MET.models[0].plot.u.axes[0]._values.filter((text) => text)")
    assert said == ["0.005", "0.01", "0.02"]
    page.close()
