"""The arm in 3D on a page that simulates: by WebGL in software, and as SVG where there is none."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from matplotlib import image

from met import cli
from tests.batch.report.browser import (
    PACKAGE,
    PATIENCE_SECONDS,
    Chromium,
    Page,
    browser,
    browser_or_skip,
    program,
    quiet,
)

PICTURES = 12
"""Pictures that are taken at most until two in a row are alike."""

DECK = """\
#include <two_link.ic>
run brief like nominal {
    duration = 2 s;  remove settle;  initial { elbow.q = 1 rad; }
    require volts < 3.55 V;
}
sweep tuned of brief { vary gearbox.kp = [0.005, 0.02] V*s/rad; vary reach = [1.5, 2] m; }
run blind of brief { record = [qd]; }
"""

GATHERED = (
    "new Promise(d => { const f = () => document.documentElement.dataset.haunted ? d() : setTimeout(f, 20); f(); })"
)


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("arms")
    (folder / "deck.ic").write_text(DECK.replace("run blind of", "run blind like"), encoding="utf-8")
    for name in ("tuned", "blind"):
        words = ["run", folder / "deck.ic", name, "-q", "--no-picture", "-o", folder / f"{name}.h5"]
        assert cli.main([str(word) for word in words]) in (cli.YES, cli.NO)
        assert cli.main(["view", str(folder / f"{name}.h5"), "-q"]) == 0
    return folder


webgl = pytest.fixture(scope="module")(browser_or_skip)


@pytest.fixture(scope="module")
def flat() -> Iterator[Chromium]:
    if program() is None:
        pytest.skip(f"no chromium; on Debian or Ubuntu: apt-get install {PACKAGE}")
    with browser(webgl=False) as started:
        yield started


def opened(chromium: Chromium, path: Path, **words: object) -> Page:
    page = chromium.open(path, **words)  # type: ignore[arg-type]
    page.run(GATHERED)
    page.run("document.querySelectorAll('.triad').forEach(e => { e.style.visibility = 'hidden'; })")  # it has colours
    page.settle()
    return page


def pixels(page: Page, folder: Path) -> np.ndarray:
    """The view as the browser shows it, without its edge, (row, column, rgb) from 0 to 1, once its fine picture is
    drawn: by the process that draws, too, and shown, which a busy machine does later: three pictures in a row are
    alike then, for two may both be of before."""
    page.run("new Promise(d => { const f = () => MET.shown.isStill() ? d() : setTimeout(f, 20); f(); })")
    page.run("MET.shown.finish()")
    alike: list[np.ndarray] = []
    for _ in range(PICTURES):
        page.settle()
        found = image.imread(page.picture(folder / "view.png", ".stage .view", margin=0))[4:-4, 4:-4, :3]
        alike = [*alike, found] if alike and np.array_equal(alike[-1], found) else [found]
        if len(alike) == 3:
            break
    return found


def coloured(shown: np.ndarray) -> float:
    """The share of pixels that have a colour, as joints do; floor, links and letters are grey."""
    return float(np.mean(shown.max(axis=-1) - shown.min(axis=-1) > 0.25))


def becomes(page: Page, folder: Path, seen: Callable[[np.ndarray], bool]) -> np.ndarray:
    """The view once it is as it should be. A browser may show a picture some time after its page has drawn it: how long
    is the machine's affair, so only patience ends this, with the view as it is then."""
    end = time.monotonic() + PATIENCE_SECONDS
    shown = pixels(page, folder)
    while not seen(shown) and time.monotonic() < end:
        shown = pixels(page, folder)
    return shown


def changed(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.mean(np.abs(one - other).max(axis=-1) > 0.02))


@pytest.mark.release
@pytest.mark.browser
@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [1280, 400])
def test_the_arm_is_drawn_on_screens_wide_and_narrow_light_and_dark(
    webgl: Chromium, pages: Path, tmp_path: Path, width: int, dark: bool
) -> None:
    page = opened(webgl, pages / "tuned.view.html", width=width, dark=dark)
    assert page.run("[MET.shown.drawsBy(), MET.shown.ghosts()]") == ["webgl", 3]
    shown = pixels(page, tmp_path)
    assert 0.002 < coloured(shown) < 0.2
    corner = shown[-2, shown.shape[1] // 2]
    assert (corner.mean() < 0.3) == dark
    for edge in (shown[4:12], shown[-12:-4], shown[:, 4:12], shown[:, -12:-4]):
        assert coloured(edge) == 0.0  # all of it is in view
    assert page.run("document.documentElement.scrollWidth") <= width
    quiet(page)
    page.close()


@pytest.mark.browser
def test_keys_and_mouse_turn_the_view_and_ghosts_and_frames_come_and_go(
    webgl: Chromium, pages: Path, tmp_path: Path
) -> None:
    page = opened(webgl, pages / "tuned.view.html")
    page.run("document.querySelector('.stage .view').focus()")
    page.key("0")  # on a busy machine the page may have been laid out after the arm was fitted into it
    page.settle()
    before = pixels(page, tmp_path)
    left, top, width, height = page.box(".stage .view")
    page.drag([(left + 0.5 * width, top + 0.6 * height), (left + 0.6 * width, top + 0.6 * height)])
    turned = becomes(page, tmp_path, lambda shown: changed(before, shown) > 0.02)
    assert changed(before, turned) > 0.02
    page.run("document.querySelector('.stage .view').focus()")
    page.key("0")
    assert changed(becomes(page, tmp_path, lambda shown: changed(shown, before) < 0.002), before) < 0.002
    for key in ("g", "f", "+", "ArrowLeft"):
        old = pixels(page, tmp_path)
        page.key(key)
        new = becomes(page, tmp_path, lambda shown, old=old: changed(old, shown) > 0.0005)  # type: ignore[misc]
        assert changed(old, new) > 0.0005, key
    page.run("MET.shown.haunt([])")  # nobody is told of no other cases
    assert page.run("document.querySelector('.stage .tools').innerText.split(/\\s+/)") == ["frames", "fit", "?"]
    page.close()


@pytest.mark.browser
def test_arm_and_signals_have_one_clock(webgl: Chromium, pages: Path, tmp_path: Path) -> None:
    page = opened(webgl, pages / "tuned.view.html")
    start = pixels(page, tmp_path)
    left, top, width, height = page.box(".panel .u-over")
    page.mouse("mouseMoved", left + 0.75 * width, top + 0.5 * height)
    page.settle()
    read = "document.querySelector('.panel .instant').textContent"
    assert page.run("MET.shown.time()") == 0.0 and page.run(read).startswith("t = 1.")  # it is read there alone
    page.click(left + 0.75 * width, top + 0.5 * height)
    page.settle()
    assert page.run("MET.shown.time()") == pytest.approx(1.5, abs=0.05)
    assert changed(start, pixels(page, tmp_path)) > 0.001
    page.mouse("mouseMoved", left + 0.75 * width, top - 400)
    page.run("MET.shown.seek(0.5)")
    page.settle()
    places = "Array.from(document.querySelectorAll('.panel .u-cursor-x'), e => e.getBoundingClientRect().left)"
    assert page.run(places) == pytest.approx([left + 0.25 * width] * 4, abs=3)
    page.run("document.querySelector('.stage .play').click()")
    page.run("new Promise(d => { const f = () => MET.shown.time() > 0.55 ? d() : setTimeout(f, 20); f(); })")
    assert page.run("MET.shown.isPlaying()") == (page.run("MET.shown.time()") < 2.0)
    quiet(page)
    page.close()


@pytest.mark.browser
def test_the_worlds_axes_stand_in_the_corner_and_turn_with_the_view(webgl: Chromium, pages: Path) -> None:
    page = opened(webgl, pages / "tuned.view.html")
    letters = """[...document.querySelectorAll('.triad span')].map(e =>
        [e.textContent, parseFloat(e.style.left), parseFloat(e.style.top)])"""
    before = {name: (x, y) for name, x, y in page.run(letters)}
    assert list(before) == ["x", "y", "z"]  # this deck has no gravity
    assert before["z"][1] < 38 and before["z"][0] == pytest.approx(38, abs=0.1)  # up
    right = page.run("MET.shown.camera.axes().right")
    assert before["x"][0] == pytest.approx(38 + 32 * right[0], abs=0.1)
    page.run("MET.shown.camera.orbit(0.8, 0); MET.shown.redraw()")
    page.settle()
    after = {name: (x, y) for name, x, y in page.run(letters)}
    assert after["x"] != before["x"] and after["z"] == before["z"]
    quiet(page)
    page.close()


@pytest.mark.browser
def test_keys_are_listed_behind_a_question_mark_and_no_switch_is_cut_off(webgl: Chromium, pages: Path) -> None:
    page = opened(webgl, pages / "tuned.view.html", width=400)
    page.run("MET.shown.accompany(() => [], 'an_archive_of_a_rather_long_name.h5')")
    page.settle()
    boxes = page.run("""[...document.querySelectorAll('.stage .tools .chip:not([hidden])')].map(e => {
        const b = e.getBoundingClientRect();
        return [b.left, b.top, b.right, b.bottom, e.scrollWidth - e.clientWidth]; })""")
    assert len(boxes) == 5 and all(left >= 0 and right <= 400 and not cut for left, _, right, _, cut in boxes)
    for n, (left, top, right, bottom, _) in enumerate(boxes):
        for other in boxes[n + 1 :]:
            assert other[0] >= right or other[2] <= left or other[1] >= bottom or other[3] <= top
    shown = "getComputedStyle(document.querySelector('.stage .keys')).display"
    assert page.run(shown) == "none"
    page.run("document.querySelector('.stage .view').focus()")
    page.key("?")
    assert page.run(shown) == "grid" and "joint forces" in page.run("document.querySelector('.stage .keys').innerText")
    page.key("?")
    assert page.run(shown) == "none"
    quiet(page)
    page.close()


@pytest.mark.browser
def test_the_floor_stays_while_pictures_follow_one_another(webgl: Chromium, pages: Path, tmp_path: Path) -> None:
    page = opened(webgl, pages / "tuned.view.html", width=400, scale=2)
    start = pixels(page, tmp_path)
    page.run("MET.shown.seek(1)")
    for shown in (start, pixels(page, tmp_path)):
        lines = np.abs(np.diff(shown[-60:-10, 400:-20].mean(axis=-1), axis=1)).max(axis=1)
        assert np.all(lines > 0.02)
    page.close()


@pytest.mark.browser
def test_a_slider_moves_the_solid_arm_and_leaves_the_view_where_it_was(
    webgl: Chromium, pages: Path, tmp_path: Path
) -> None:
    page = opened(webgl, pages / "tuned.view.html")
    before, camera = pixels(page, tmp_path), "JSON.stringify(MET.shown.camera)"
    where = page.run(camera)
    page.run("""(() => { const e = document.querySelectorAll('.knob input[type=range]')[1]; e.value = 0.6;
        e.dispatchEvent(new Event('input')); })()""")
    assert page.run("document.querySelector('.stage .told').textContent") == "not in the archive"
    assert page.run("MET.shown.ghosts()") == 4
    assert changed(before, pixels(page, tmp_path)) > 0.002 and page.run(camera) == where
    page.close()


@pytest.mark.browser
def test_without_webgl_and_on_paper_it_is_svg(flat: Chromium, pages: Path, tmp_path: Path) -> None:
    page = opened(flat, pages / "tuned.view.html")
    assert page.run("MET.shown.drawsBy()") == "svg"
    assert page.run("document.querySelectorAll('.stage .paper path').length") > 20
    assert 0.002 < coloured(pixels(page, tmp_path)) < 0.2
    page.run("dispatchEvent(new Event('beforeprint'))")
    assert page.run("document.querySelectorAll('.stage .film svg').length") > 6
    times = page.run("Array.from(document.querySelectorAll('.stage figcaption'), e => e.textContent)")
    assert times == ["0 s", "0.4 s", "0.8 s", "1.2 s", "1.6 s", "2 s"]
    page.pdf(tmp_path / "page.pdf")
    quiet(page)
    page.close()


@pytest.mark.release
@pytest.mark.browser
def test_a_run_that_does_not_record_q_says_what_to_record(webgl: Chromium, pages: Path) -> None:
    page = opened(webgl, pages / "blind.view.html")
    assert page.run("document.querySelector('.view')") is None
    said = page.run("document.querySelector('main').innerText")
    assert "The arm is not shown, for the run does not record q: record += [q];" in said
    page.close()
