"""A page against another archive in a browser: what was before is under what is now, or the difference is drawn.

It is the story of docs/diff.md: a servo whose second version stops at once.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from batch.report import report
from met.run import Run
from tests.batch import plans
from tests.batch.report import archives
from tests.batch.report.browser import INK, Chromium, Page, quiet
from tests.docs import mended_servo

pytestmark = pytest.mark.browser

LINES = "MET.models[0].signalPlots().map(u => u.series.length - 1)"


@pytest.fixture(scope="module")
def sent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of after.h5 against before.h5, away from both."""
    folder = mended_servo.told(tmp_path_factory.mktemp("sent"))
    made = report(folder / "after.h5", against=folder / "before.h5")
    for name in ("before.h5", "after.h5"):
        (folder / name).unlink()
    return made


@pytest.fixture
def page(chromium: Chromium, sent: Path) -> Iterator[Page]:
    opened = chromium.open(sent)
    opened.settle()
    yield opened
    opened.close()


def choose(page: Page, selector: str, value: str) -> None:
    page.run(
        f"(() => {{ const s = document.querySelector({selector!r}); s.value = {value!r};"
        "s.dispatchEvent(new Event('change')); })()"
    )
    page.settle()


@pytest.mark.release
def test_it_opens_in_silence_and_its_plots_are_drawn(page: Page) -> None:
    inked = page.run(f"{INK}('.plot canvas')")
    assert len(inked) == 1 + 4 and all(share > 0.01 for share in inked)
    assert page.run("document.querySelector('.verdict.against .share').textContent") == "71.4 % → 82.1 %"
    quiet(page)


def test_a_case_of_the_comparison_leads_to_where_it_is_shown(page: Page) -> None:
    first = "document.querySelector('.verdict.against button[data-case]')"
    page.run(f"{first}.click()")
    page.settle()
    assert str(page.run("MET.models[0].chosen")) == page.run(f"{first}.dataset.case")
    assert page.run(f"{first}.getAttribute('aria-pressed')") == "true"


def test_it_is_as_small_as_its_data(sent: Path) -> None:
    source = sent.read_text(encoding="utf-8")
    data = sum(map(len, re.findall(r'<script type="application/json" id="d\d+">(.*?)</script>', source, re.DOTALL)))
    assert len(source) - data < 300_000 and data < 2_000_000


@pytest.mark.parametrize(("width", "dark"), [(1200, False), (1200, True), (400, False), (320, True)])
def test_nothing_is_wider_than_the_window(chromium: Chromium, sent: Path, width: int, dark: bool) -> None:
    page = chromium.open(sent, width=width, dark=dark)
    page.settle()
    assert page.run("document.documentElement.scrollWidth") <= width
    quiet(page)
    page.close()


def test_before_is_under_now_and_the_legend_says_which(page: Page) -> None:
    assert page.run(LINES) == [4, 4, 2, 2]
    widths = page.run("MET.models[0].signalPlots()[1].series.slice(1).map(s => s.width)")
    assert widths[:2] == [5, 5] and max(widths[2:]) < 3  # the wide ones are drawn first, so they lie below
    assert page.run("document.querySelector('.versions').textContent") == "before.h5after.h5"
    strokes = page.run("MET.models[0].signalPlots()[1].series.slice(1).map(s => s.stroke())")
    assert [stroke[:7] for stroke in strokes[:2]] == strokes[2:] and all(len(stroke) == 9 for stroke in strokes[:2])
    quiet(page)


def test_the_difference_is_drawn_in_their_stead(page: Page) -> None:
    choose(page, "select.how", "change")
    assert page.run(LINES) == [2, 2, 1, 1]
    values = page.run("MET.models[0].signalPlots()[1].data.slice(1).map(line => Math.min(...line))")
    assert min(values) == pytest.approx(-0.2493, abs=1e-4)
    assert page.run("document.querySelector('.versions').textContent") == "after.h5 − before.h5"
    assert page.run("document.querySelectorAll('.panel .head b')[1].textContent") == "change of qd (rad/s)"
    choose(page, "select.how", "now")
    assert page.run(LINES) == [2, 2, 1, 1]
    quiet(page)


def test_both_are_read_at_one_time(page: Page) -> None:
    page.run("document.querySelectorAll('.signals.plot .frame')[1].focus()")
    page.key("ArrowRight")
    page.settle()
    said = page.run("document.querySelectorAll('.reading')[1].textContent")
    assert re.match(r"t [\d.]+ sshoulder[-\d.e]+before [-\d.e]+elbow", said), said


def test_a_case_that_changed_is_chosen_from_its_table(page: Page) -> None:
    page.run("document.querySelectorAll('.compared .cases button.case')[1].click()")
    page.settle()
    card = page.run("document.querySelector('.card').textContent")
    assert "Case #23" in card and "0.9621 rad, before 1.499" in card
    assert page.run("document.querySelector('.signals.plot .chip').textContent").startswith("#23")
    assert set(page.run("Array.from(document.querySelectorAll('tr.chosen'), e => e.dataset.case)")) == {"23"}
    quiet(page)


def test_the_points_have_where_they_were_or_not(page: Page) -> None:
    highest = "MET.models[0].plot.u.scales.y.max"
    assert page.run(highest) > 0.0103  # rad/s, of #24 before
    page.run("document.querySelector('.stems').click()")
    page.settle()
    assert page.run(highest) < 0.0025
    choose(page, ".points select", "change:metric:stop")
    assert page.run("MET.models[0].plot.u.axes[1].label") == "change of stop (rad)"
    assert page.run("document.querySelector('.stems').disabled")
    low, high = page.run("[MET.models[0].plot.u.scales.y.min, MET.models[0].plot.u.scales.y.max]")
    assert low < -0.538 and high > 0.0
    quiet(page)


def test_a_value_before_that_a_logarithmic_axis_cannot_show_leaves_the_others(
    chromium: Chromium, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plans.answering(monkeypatch)

    def answer(volts: Callable[[np.ndarray], np.ndarray]) -> Callable[..., Run]:
        def answered(*args: object, **options: object) -> Run:
            found: Run = plans.answer(*args, **options)  # type: ignore[arg-type]
            found.metrics["volts"] = volts(np.arange(len(found.case)))
            return found

        return answered

    for name, volts in (("a.h5", lambda n: n / 10.0), ("b.h5", lambda n: 10.0 ** (n - 5.0))):
        monkeypatch.setattr("met.run.run", answer(volts))
        archives.made(tmp_path / name, plans.gains(9))
    page = chromium.open(report(tmp_path / "b.h5", against=tmp_path / "a.h5"))
    page.settle()
    assert page.run("MET.models[0].plot.u.scales.y.distr") == 3  # logarithmic
    low, high = page.run("[MET.models[0].plot.u.scales.y.min, MET.models[0].plot.u.scales.y.max]")
    assert 1e-6 < low < 1e-5 and 1e3 < high < 1e4
    choose(page, ".points select", "change:metric:volts")
    assert page.run("MET.models[0].plot.u.scales.y.distr") == 1
    quiet(page)
    page.close()


def test_the_map_of_the_change_says_its_sign_and_what_is_asked_for(page: Page) -> None:
    cells = "Array.from(document.querySelectorAll('.grid tbody td'), e => e.textContent)"
    assert page.run(cells)[-1] == "−0.008415"
    said = page.run("document.querySelector('.map .scale').textContent")
    assert "creep < 0.001 rad/s asks for less" in said and "+0.008415" in said
    choose(page, ".map select", "change:metric:stop")
    assert all(text.startswith("−0.") for text in page.run(cells))
    colours = page.run("Array.from(document.querySelectorAll('.grid tbody td'), e => e.style.background)")
    assert len(set(colours)) > 10
    quiet(page)


def test_it_prints_with_what_was_before(chromium: Chromium, sent: Path, tmp_path: Path) -> None:
    page = chromium.open(sent, dark=True)
    page.settle()
    data = page.pdf(tmp_path / "a.pdf").read_bytes()
    assert len(re.findall(rb"/Type\s*/Page\b", data)) >= 6
    page.ask("Emulation.setEmulatedMedia", media="print", features=[])
    assert page.run("getComputedStyle(document.querySelector('.versions')).display") != "none"
    assert page.run("getComputedStyle(document.querySelector('select.how')).display") == "none"
    quiet(page)
    page.close()


@pytest.mark.release
def test_pictures_of_it_for_people(chromium: Chromium, sent: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("pictures")
    for name, width, dark in (("desktop", 1200, False), ("dark", 1200, True), ("narrow", 400, False)):
        page = chromium.open(sent, width=width, dark=dark)
        page.settle()
        assert page.picture(folder / f"{name}.png").stat().st_size > 50_000
        page.close()
    print(f"pictures of a report against another: {folder}")
