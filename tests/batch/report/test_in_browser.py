"""The page in a browser: it opens in silence, its plots are drawn, answer to mouse and keys, and it prints.

Pictures of it are left in a folder, whose name the last test says: look at them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import batch
from batch.report import report
from tests.batch import plans
from tests.batch.report import archives
from tests.batch.report.browser import INK, Chromium, Page, quiet

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def sent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of a sweep with a motor on a bed, away from its archive."""
    folder = tmp_path_factory.mktemp("sent")
    batch.run(archives.compiled(folder, "loads"), output=folder / "a.h5")
    page = report(folder / "a.h5")
    (folder / "a.h5").unlink()
    return page


@pytest.fixture
def page(chromium: Chromium, sent: Path) -> Iterator[Page]:
    opened = chromium.open(sent)
    opened.settle()
    yield opened
    opened.close()


def test_the_browser_of_these_tests_hears_what_goes_wrong(chromium: Chromium, tmp_path: Path) -> None:
    rules = "default-src 'none'; script-src 'unsafe-inline'"
    (tmp_path / "bad.html").write_text(
        f'<meta http-equiv="Content-Security-Policy" content="{rules}"><p style="color: red">x</p>'
        '<img src="file:///nothing.png">'
        '<script>console.error("said"); fetch("https://example.invalid/"); oops()</script>'
    )
    page = chromium.open(tmp_path / "bad.html")
    page.settle()
    said = "\n".join(page.said)
    assert "said" in said and "oops is not defined" in said
    assert all(f"{rule}" in said for rule in ("style", "img-src", "connect-src"))
    page.close()
    (tmp_path / "asks.html").write_text('<img src="nothing.png">')
    page = chromium.open(tmp_path / "asks.html")
    assert [address.rpartition("/")[2] for address in page.requests] == ["asks.html", "nothing.png"]
    page.close()


def test_it_opens_in_silence_and_its_plots_are_drawn(page: Page) -> None:
    assert page.run("document.documentElement.dataset.ready") == "yes"
    inked = page.run(f"{INK}('.plot canvas')")
    assert len(inked) == 1 + 4 + 1  # points, signals, stability
    assert all(share > 0.01 for share in inked)
    assert page.run("document.querySelectorAll('.grid tbody td').length") == 6
    quiet(page)


@pytest.mark.parametrize(("width", "dark"), [(1280, False), (1280, True), (390, False), (390, True), (320, False)])
def test_nothing_is_wider_than_the_window(chromium: Chromium, sent: Path, width: int, dark: bool) -> None:
    page = chromium.open(sent, width=width, dark=dark)
    page.settle()
    assert page.run("document.documentElement.scrollWidth") <= width
    paper = page.run("getComputedStyle(document.body).backgroundColor")
    assert (paper == "rgb(255, 255, 255)") != dark
    quiet(page)
    page.close()


def test_a_drag_zooms_all_signals_and_a_double_click_shows_all(page: Page) -> None:
    spans = "MET.models[0].signalPlots().map(u => [u.scales.x.min, u.scales.x.max])"
    left, top, width, _ = page.box(".signals .u-over", 1)
    assert page.run(spans) == [[0, 2]] * 4
    page.drag([(left + 0.25 * width, top + 40), (left + 0.4 * width, top + 44), (left + 0.5 * width, top + 50)])
    page.settle()
    for low, high in page.run(spans):
        assert (low, high) == pytest.approx((0.5, 1.0), abs=0.01)
    page.click(left + 0.5 * width, top + 50, clicks=2)
    page.settle()
    assert page.run(spans) == [[0, 2]] * 4
    quiet(page)


def test_the_pointer_reads_all_signals_at_one_time(page: Page) -> None:
    left, top, width, height = page.box(".signals .u-over", 0)
    page.mouse("mouseMoved", left + 0.5 * width, top + 0.5 * height)
    page.settle()
    read = page.run("Array.from(document.querySelectorAll('.reading'), e => e.textContent)")
    assert len(read) == 4 and all(text.startswith("t 1 s") for text in read)
    assert page.box(".signals .u-over", 0)[1] == top  # and no plot moves under it


def test_a_case_is_chosen_by_a_click_and_its_signals_are_shown(page: Page) -> None:
    left, top, _, _ = page.box(".points .u-over")
    x, y = page.run("MET.models[0].plot.where(4)")
    page.mouse("mouseMoved", left + x, top + y)
    page.settle()
    tip = page.run("document.getElementById('tip').textContent")
    assert tip.startswith("#4 ") and "links.lower.mass100 kg" in tip
    page.click(left + x, top + y)
    page.settle()
    assert "Case #4" in page.run("document.querySelector('.card').textContent")
    assert "met run a.h5 --case '#4'" in page.run("document.querySelector('.card').textContent")
    assert page.run("document.querySelector('.signals.plot .chip').textContent").startswith("#4")
    assert page.run("document.querySelector('tr.chosen').dataset.case") == "4"
    quiet(page)


def test_a_case_of_the_verdict_leads_to_where_it_is_shown_and_is_marked(page: Page) -> None:
    buttons = "[...document.querySelectorAll('#verdict button[data-case]')]"
    case = page.run(f"{buttons}[0].dataset.case")
    page.run(f"scrollTo(0, 0); {buttons}[0].click()")
    page.run("new Promise(done => setTimeout(done, 1500))")  # it scrolls smoothly
    assert page.run("MET.models[0].chosen") == int(case) and page.run("scrollY") > 0
    place = (
        "[...document.querySelectorAll('[data-plot]')].map(e => e.getBoundingClientRect()).find(b => b.top >= -2).top"
    )
    assert page.run(place) < 450  # of a window of 900
    pressed = page.run(f"{buttons}.map(e => [e.dataset.case, e.getAttribute('aria-pressed')])")
    assert pressed and all((each == case) == (mark == "true") for each, mark in pressed)
    quiet(page)


def test_a_drag_over_points_zooms_and_chooses_none(page: Page) -> None:
    left, top, width, height = page.box(".points .u-over")
    page.drag([(left + 100, top + 40), (left + 300, top + 100), (left + 0.7 * width, top + height - 30)])
    page.settle()
    low, high = page.run("[MET.models[0].plot.u.scales.x.min, MET.models[0].plot.u.scales.x.max]")
    assert low > 10 and high < 100 and page.run("MET.models[0].chosen") is None
    page.click(left + 0.5 * width, top + 60, clicks=2)
    page.settle()
    assert page.run("MET.models[0].plot.u.scales.x.max") > 100


def test_other_parameters_and_metrics_are_drawn(page: Page) -> None:
    for number, value in ((0, "metric:volts"), (1, "parameter:shoulder.bed.delay"), (2, "")):
        page.run(
            f"(() => {{ const s = document.querySelectorAll('.points select')[{number}]; s.value = '{value}';"
            "s.dispatchEvent(new Event('change')); })()"
        )
        page.settle()
    assert page.run("document.querySelectorAll('.points canvas').length") == 1
    assert page.run("MET.models[0].plot.u.axes[1].label") == "volts (V)"
    quiet(page)


def test_keys_do_what_the_mouse_does(page: Page) -> None:
    page.run("document.querySelector('.points .frame').focus()")
    page.key("ArrowRight")
    page.key("ArrowRight")
    page.key("Enter", "\r")
    page.settle()
    assert page.run("MET.models[0].chosen") == 1
    page.run("document.querySelectorAll('.signals.plot .frame')[1].focus()")
    page.key("+", "+")
    page.settle()
    assert page.run("MET.models[0].signalPlots().map(u => u.scales.x.max - u.scales.x.min)") == [1] * 4
    page.key("Escape")
    page.settle()
    assert page.run("MET.models[0].signalPlots().map(u => u.scales.x.max - u.scales.x.min)") == [2] * 4
    quiet(page)


def test_a_joint_can_be_hidden(page: Page) -> None:
    lines = "MET.models[0].signalPlots()[1].series.length - 1"
    before = page.run(lines)
    page.run("Array.from(document.querySelectorAll('.chip')).find(e => e.textContent === 'elbow').click()")
    page.settle()
    assert page.run(lines) == before / 2
    quiet(page)


def test_parameters_are_searched_and_lead_to_their_line(page: Page) -> None:
    page.run(
        "(() => { const i = document.querySelector('input.search'); i.value = 'SHOULDER kp';"
        "i.dispatchEvent(new Event('input')); })()"
    )
    rows = "Array.from(document.querySelectorAll('.parameters tbody tr:not([hidden]) th'), e => e.textContent)"
    assert page.run(rows) == ["shoulder.servo.kp"]
    page.run("document.querySelector('.parameters tbody tr:not([hidden]) a').click()")
    page.settle()
    text = page.run("document.querySelector('.source li:target').textContent")
    assert "kp" in text and page.run("document.querySelector('.source li:target').closest('details').open")


def test_it_prints_open_light_and_without_controls(chromium: Chromium, sent: Path, tmp_path: Path) -> None:
    page = chromium.open(sent, dark=True)
    page.settle()
    page.run(
        "addEventListener('beforeprint', () => { window.printed = {"
        "closed: document.querySelectorAll('details:not([open])').length, dark: MET.dark() }; })"
    )
    data = page.pdf(tmp_path / "a.pdf").read_bytes()
    assert len(re.findall(rb"/Type\s*/Page\b", data)) >= 4
    assert page.run("window.printed") == {"closed": 0, "dark": False}
    assert page.run("document.querySelectorAll('details[open]').length") == 0 and page.run("MET.dark()")
    page.ask("Emulation.setEmulatedMedia", media="print", features=[])
    assert page.run("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert page.run("Array.from(document.querySelectorAll('select, .copy, nav, .hint')).every(e => !e.offsetParent)")
    quiet(page)
    page.close()


def test_without_scripts_its_tables_are_there(chromium: Chromium, sent: Path) -> None:
    page = chromium.open(sent, scripts=False)
    shown = page.ask("Page.captureScreenshot", format="png")["data"]
    assert len(shown) > 10_000
    assert [line for line in page.said if "script" not in line.lower()] == []
    page.close()


def test_a_hostile_archive_is_shown_and_not_run(
    chromium: Chromium, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dataclasses import replace

    plans.answering(monkeypatch)
    hostile = archives.HOSTILE.replace("\x00", "")
    archives.failing(monkeypatch, 2, cause=hostile)
    one = plans.gains(5)
    first, second = one.requirements
    one = replace(one, requirements=(replace(first, text=f"settle < 10 s {hostile}"), second), notes=(hostile,))
    plan = plans.plan(one)
    source = replace(plan.sources[0], text=f"// {hostile}\n", name=f"{hostile}.ic")
    batch.run(replace(plan, sources=(source,), deck=f"{hostile}.ic"), output=tmp_path / "a.h5")
    page = chromium.open(report(tmp_path / "a.h5", title=hostile))
    page.settle()
    page.run("MET.models[0].choose(2)")
    left, top, _, _ = page.box(".points .u-over")
    x, y = page.run("MET.models[0].plot.where(2)")
    page.mouse("mouseMoved", left + x, top + y)
    page.settle()
    assert page.run("window.hostile") is None
    assert "</script><script>window.hostile=1</script>" in page.run("document.querySelector('.card').textContent")
    assert "</script>" in page.run("document.title")
    assert "</script>" in page.run("document.querySelector('h1').textContent")
    assert page.run("document.querySelectorAll('img').length") == 0
    quiet(page)
    page.close()


def test_cases_without_a_number_are_in_strips_and_can_be_chosen(
    chromium: Chromium, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plans.answering(monkeypatch)
    archives.failing(monkeypatch, 7)
    page = chromium.open(report(archives.made(tmp_path / "a.h5", plans.gains(20))))
    page.settle()
    page.run(
        "(() => { const s = document.querySelectorAll('.points select')[0]; s.value = 'metric:settle';"
        "s.dispatchEvent(new Event('change')); })()"
    )
    page.settle()
    left, top, _, _ = page.box(".points .u-over")
    for place, outcome in ((0, "missed"), (7, "failed")):
        x, y = page.run(f"MET.models[0].plot.where({place})")
        assert y < 0
        page.click(left + x, top + y)
        page.settle()
        card = page.run("document.querySelector('.card').textContent")
        assert f"Case #{place}" in card and outcome in card
    assert "D is not above 0 kg m^2" in card
    quiet(page)
    page.close()


@pytest.mark.release
def test_pictures_of_it_for_people(chromium: Chromium, sent: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("pictures")
    for name, width, dark in (("desktop", 1280, False), ("dark", 1280, True), ("narrow", 390, False)):
        page = chromium.open(sent, width=width, dark=dark)
        page.settle()
        assert page.picture(folder / f"{name}.png").stat().st_size > 50_000
        page.close()
    print(f"pictures of a report: {folder}")
