"""The page of a deck that is watched, in a browser: the new run takes the old one's place, and is seen from there."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import pytest

from tests.batch.report.browser import Chromium, Page, browser_or_skip
from tests.batch.watching.watched import DECK, View, replace, viewing, write_deck

pytestmark = pytest.mark.browser


chromium = pytest.fixture(scope="module")(browser_or_skip)


RUN = "document.querySelector('iframe:not(.coming)').contentWindow"


def until(page: Page, condition: str) -> None:
    """Wait for what a page comes to."""
    page.run(f"new Promise(done => {{ const look = () => ({condition}) ? done() : setTimeout(look, 20); look(); }})")


def shown(page: Page, number: int, *, whole: bool = True) -> None:
    """Wait until the run of this number is shown; whole: with what came of its cases."""
    page.ask("Page.bringToFront")  # behind another one a page draws nothing
    until(page, f"document.documentElement.dataset.shown == {number}")
    if whole:
        until(page, f"{RUN}.document.querySelector('.came').textContent.includes(\"'s bits in\")")
    page.settle()


def opened(chromium: Chromium, view: View, **words: Any) -> Page:
    page = chromium.open(view.address, **words)
    shown(page, 1)
    return page


def at(page: Page) -> dict[str, Any]:
    """Where the run that is shown stands."""
    found: dict[str, Any] = json.loads(page.run(f"JSON.stringify({RUN}.metKept.take())"))
    return found


def silent(page: Page, view: View) -> None:
    """Nothing went wrong in the page, and it asked for nothing but its own address."""
    assert page.said == []
    assert all(address.startswith((view.address, "data:")) for address in page.requests)


def test_a_save_changes_the_run_and_leaves_the_view_where_it_was(chromium: Chromium, tmp_path: Path) -> None:
    deck = write_deck(tmp_path)
    with viewing(deck, "-q") as view:
        page = opened(chromium, view)
        until(page, f"{RUN}.document.documentElement.dataset.haunted === 'yes'")
        left, top, wide, _ = page.box("iframe")
        middle = (left + wide / 2, top + 420)
        page.drag([middle, (middle[0] + 60, middle[1] + 25)])  # the view is turned
        page.run(f"{RUN}.document.querySelector('.knob input[type=range]').value = 0.4")
        page.run(f"{RUN}.document.querySelector('.knob input[type=range]').dispatchEvent(new Event('input'))")
        chips = f"[...{RUN}.document.querySelectorAll('.stage .chip')]"
        page.run(f"{chips}.find((each) => each.textContent === 'frames').click()")
        page.run(f"{RUN}.scrollTo(0, 700)")
        page.settle()
        zoomed = page.run(f"(() => {{ const b = {RUN}.document.querySelector('.panel .u-over').getBoundingClientRect();"
                          "return [b.left, b.top, b.width, b.height]; })()")  # fmt: skip
        y = top + zoomed[1] + zoomed[3] / 2
        page.drag([(left + zoomed[0] + share * zoomed[2], y) for share in (0.25, 0.5, 0.75)])
        page.mouse("mouseMoved", 5, 5)  # where it points at no plot, which would move the clock
        page.settle()
        page.run(f"{RUN}.document.querySelector('.transport input').value = 0.375")
        page.run(f"{RUN}.document.querySelector('.transport input').dispatchEvent(new Event('input'))")
        before = at(page)
        assert before["case"] is None and before["values"]["gearbox.kp"] == pytest.approx(0.011, rel=1e-9)
        assert before["stage"]["time"] == pytest.approx(0.75) and before["stage"]["frames"]
        assert before["zoom"] == pytest.approx([0.5, 1.5], abs=0.02) and before["scroll"] == [0, 700]
        replace(deck, "[45000, 90000]", "[45000, 60000, 90000]")
        replace(tmp_path / "length.ic", "2 s", "3 s")
        until(page, f"{RUN}.document.querySelectorAll('.knob option').length === 10")  # 9 cases
        until(page, f"Number({RUN}.document.querySelector('.transport input').value) === 0.25")  # 0.75 s of 3 s
        page.settle()
        assert at(page) == before
        assert page.run(f"{RUN}.document.querySelector('.came').textContent").startswith("Not in the sweep: ")
        silent(page, view)
        page.close()


def still(page: Page) -> bytes:
    """A picture of the arm when it stands, with all its ghosts, on plain paper: a gradient is never twice the same."""
    until(page, f"{RUN}.document.documentElement.dataset.haunted && {RUN}.metKept.MET.shown.isStill()")
    page.run(f"void ({RUN}.document.querySelector('.view').style.background = 'white')")
    page.settle()
    clip = page.run(
        f"(() => {{ const [a, b] = [document.querySelector('iframe'), {RUN}.document.querySelector('.view')]"
        ".map(each => each.getBoundingClientRect());"
        "return { x: a.left + b.left, y: a.top + b.top, width: b.width, height: b.height, scale: 1 }; })()"
    )
    return base64.b64decode(page.ask("Page.captureScreenshot", format="png", clip=clip)["data"])


def test_a_save_keeps_the_page_and_draws_on_what_was_drawn_on(chromium: Chromium, tmp_path: Path) -> None:
    deck = write_deck(tmp_path, DECK.replace("3.55 V", "31 V"))
    with viewing(deck, "-q") as view:
        page = opened(chromium, view)
        canvas = f"{RUN}.document.querySelector('.stage canvas')"
        count = f"[{RUN}.metKept.MET.drawn.length, {RUN}.document.querySelectorAll('.stage, .panel').length]"
        page.run(f"{RUN}.document.querySelector('.view').focus()")
        before = still(page)
        page.run(f"void ({RUN}.stays = {canvas}.stays = 'yes')")
        had = page.run(count)
        for number in (2, 3, 4):
            replace(deck, f"3{number - 1} V", f"3{number} V")  # a limit that no case is near
            shown(page, number)
            assert still(page) == before
        assert page.run(f"[{RUN}.stays, {canvas}.stays, {RUN}.metKept.MET.shown.drawsBy()]") == ["yes", "yes", "webgl"]
        assert page.run(count) == had  # nothing of the runs before is left
        assert page.run(f"{RUN}.document.activeElement === {RUN}.document.querySelector('.view')")
        assert [each for each in page.requests if each.endswith("/run")] == [f"{view.address}run"]
        page.run(f"{canvas}.getContext('webgl2').getExtension('WEBGL_lose_context').loseContext()")
        until(page, f"{RUN}.metKept.MET.shown.drawsBy() === 'svg'")
        replace(deck, "34 V", "35 V")
        shown(page, 5)
        assert page.run(f"{RUN}.metKept.MET.shown.drawsBy()") == "webgl"  # on another
        assert still(page) == before
        silent(page, view)
        page.close()


def test_the_chosen_case_stays_chosen_and_comes_with_the_bits_of_met_run(chromium: Chromium, tmp_path: Path) -> None:
    deck = write_deck(tmp_path)
    with viewing(deck, "-q") as view:
        page = opened(chromium, view)
        said = f"{RUN}.document.querySelector('.came').textContent"
        page.run(f"{RUN}.document.querySelector('.knob select').value = 4")
        page.run(f"{RUN}.document.querySelector('.knob select').dispatchEvent(new Event('change'))")
        assert page.run(said).startswith("Case #4, with the sweep's bits in its metric: ")
        before = page.run(f"{RUN}.document.querySelector('.answers').innerText")
        replace(deck, "0.02] V", "0.03] V")
        shown(page, 2)
        assert page.run(said).startswith("Case #4, with the sweep's bits in its metric: ")
        assert page.run(f"{RUN}.document.querySelector('.knob .typed input').value") == "0.03"
        assert page.run(f"{RUN}.document.querySelector('.answers').innerText") != before
        silent(page, view)
        page.close()


def test_points_and_a_map_show_all_cases_and_choose_one(chromium: Chromium, tmp_path: Path) -> None:
    deck = write_deck(tmp_path)
    with viewing(deck, "-q") as view:
        page = opened(chromium, view)
        cells = f"Array.from({RUN}.document.querySelectorAll('.of-cases td[data-case]'), e => e.textContent)"
        first = page.run(cells)
        assert len(first) == 6 and sum(each.endswith("✗") for each in first) == 4
        assert page.run(f"{RUN}.document.querySelector('.came-of').innerText").split("\n")[-1] == (
            "volts < 3.55 V: 2 met, 4 missed"
        )
        page.run(f"{RUN}.document.querySelector('.of-cases td[data-case=\"5\"]').click()")
        assert page.run(f"{RUN}.document.querySelector('.knob select').value") == "5"
        replace(tmp_path / "length.ic", "2 s", "4 s")
        shown(page, 2)
        until(page, f"{RUN}.document.querySelectorAll('.of-cases td[data-case]').length === 6")
        assert page.run(cells) != first
        silent(page, view)
        page.close()


def test_a_mistake_stands_beside_the_run_with_its_line_until_it_is_mended(chromium: Chromium, tmp_path: Path) -> None:
    deck = write_deck(tmp_path)
    with viewing(deck, "-q") as view:
        page = opened(chromium, view)
        assert page.run("document.querySelector('aside').hidden")
        replace(deck, "gearbox.kp = [", "gearbox.kq = [")
        until(page, "!document.querySelector('aside').hidden")
        page.settle()
        words = page.run("document.querySelector('aside').innerText")
        assert words.startswith("A mistake: shown is the run as saved at ") and "9 |     vary gearbox.kq = [" in words
        assert "no parameter `gearbox.kq` in this run" in words
        aside, run = page.run(
            "['aside', 'iframe'].map(s => { const b = document.querySelector(s).getBoundingClientRect();"
            "return [b.left, b.right, b.top, b.bottom]; })"
        )
        assert aside[1] <= run[0] + 1 and run[1] == 1280 and run[2] < 60 and run[3] == 900
        assert page.run("document.querySelector('.doing').className") == "doing bad"
        page.run(f"{RUN}.document.querySelectorAll('.knob input[type=range]')[0].value = 1")
        page.run(f"{RUN}.document.querySelectorAll('.knob input[type=range]')[0].dispatchEvent(new Event('input'))")
        assert page.run(f"{RUN}.document.querySelector('.came').textContent").startswith("Case #4, ")  # it goes on
        replace(deck, "gearbox.kq = [", "gearbox.kp = [")
        until(page, "document.querySelector('aside').hidden")
        assert page.run("document.documentElement.dataset.shown") == "1"  # it is the deck that it was
        silent(page, view)
        page.close()


def test_on_a_narrow_screen_nothing_is_cut_off(chromium: Chromium, tmp_path: Path) -> None:
    deck = write_deck(tmp_path)
    with viewing(deck, "-q") as view:
        page = opened(chromium, view, width=400, height=860, dark=True)
        replace(deck, "gearbox.kp = [", "gearbox.kq = [")
        until(page, "!document.querySelector('aside').hidden")
        page.settle()
        assert page.run("document.documentElement.scrollWidth") <= 400
        assert page.run(f"{RUN}.document.documentElement.scrollWidth") <= 400
        assert page.run("document.querySelector('iframe').getBoundingClientRect().height") > 300
        silent(page, view)
        page.close()


@pytest.mark.parametrize("width", [400, 1280])
def test_the_mark_under_a_long_line_is_in_sight_and_the_line_scrolls_where_it_stands(
    chromium: Chromium, tmp_path: Path, width: int
) -> None:
    deck = write_deck(tmp_path)
    with viewing(deck, "-q") as view:
        page = opened(chromium, view, width=width)
        replace(deck, "    vary gearbox.kp = [", " " * 200 + "vary gearbox.kq = [")
        until(page, "!document.querySelector('aside').hidden")
        page.settle()
        found = page.run("""[...document.querySelectorAll('.of-deck')].map(part => {
            const range = document.createRange(), text = part.firstChild, at = text.data.indexOf('^');
            range.setStart(text, at); range.setEnd(text, at + 1);
            const [mark, box] = [range.getBoundingClientRect(), part.getBoundingClientRect()];
            return [at, mark.left - box.left, box.right - mark.right, box.left, box.right]; })""")
        assert len(found) == 1
        at, left, right, *sides = found[0]
        assert at > 0 and left >= 0 and right >= 0 and 0 <= sides[0] < sides[1] <= width
        silent(page, view)
        page.close()


def test_another_run_is_chosen_on_the_page(chromium: Chromium, tmp_path: Path) -> None:
    deck = write_deck(tmp_path)
    with viewing(deck, "-q") as view:
        page = opened(chromium, view)
        fitted = at(page)["stage"]["camera"]
        page.run(f"{RUN}.document.querySelector('.transport input').value = 0.5")
        page.run(f"{RUN}.document.querySelector('.transport input').dispatchEvent(new Event('input'))")
        choose = "(() => { const e = document.querySelector('.deck-bar select'); e.value = 'brief';"
        page.run(choose + " e.dispatchEvent(new Event('change')); })()")
        shown(page, 2)
        assert page.run(f"{RUN}.document.querySelector('h1').textContent") == "brief"
        assert page.run(f"{RUN}.document.querySelector('.knob')") is None
        stage = at(page)["stage"]
        assert stage["time"] == 0 and stage["camera"] != fitted  # it is another run: seen from where it is seen best
        silent(page, view)
        page.close()


def test_two_pages_of_one_deck_stand_each_where_it_is(chromium: Chromium, tmp_path: Path) -> None:
    deck = write_deck(tmp_path)
    with viewing(deck, "-q") as view:
        one, other = opened(chromium, view), opened(chromium, view)
        one.run(f"{RUN}.document.querySelector('.knob select').value = 3")
        one.run(f"{RUN}.document.querySelector('.knob select').dispatchEvent(new Event('change'))")
        replace(deck, "3.55", "3.5")
        for page, case in ((one, "3"), (other, "0")):
            shown(page, 2)
            assert page.run(f"{RUN}.document.querySelector('.knob select').value") == case
            silent(page, view)
        one.close()
        other.close()


def test_texts_of_a_deck_are_texts_whatever_they_hold(chromium: Chromium, tmp_path: Path) -> None:
    hurt = '</script><img src=x onerror="top.hurt = 1">'  # in a comment, and in a name that is not known
    deck = write_deck(tmp_path, f"// {hurt}\n{DECK}")
    with viewing(deck, "-q") as view:
        page = opened(chromium, view)
        replace(deck, "duration = length;", f'duration = length; record += ["{hurt.replace(chr(34), chr(39))}"];')
        until(page, "!document.querySelector('aside').hidden")
        page.settle()
        assert "onerror" in page.run("document.querySelector('aside').innerText")
        assert page.run("top.hurt") is None
        assert page.run("document.querySelectorAll('img').length") == 0
        silent(page, view)
        page.close()


def test_the_page_says_when_nothing_is_watched_any_more(chromium: Chromium, tmp_path: Path) -> None:
    deck = write_deck(tmp_path)
    with viewing(deck, "-q") as view:
        page = opened(chromium, view)
        view.process.kill()
        until(page, "document.querySelector('.doing').textContent.startsWith('met view has ended')")
        page.run(f"{RUN}.document.querySelectorAll('.knob input[type=range]')[0].value = 1")
        page.run(f"{RUN}.document.querySelectorAll('.knob input[type=range]')[0].dispatchEvent(new Event('input'))")
        assert page.run(f"{RUN}.document.querySelector('.came').textContent").startswith("Case #4, ")
        page.close()


MARGINS = """\
#include <two_link.ic>
run held like nominal {
    duration = 0.4 s;  remove settle;
    linear loop { at = 360 ms;  open = shoulder.servo.voltage; }
    require gain_margin(loop) > 20;
}
default sweep tuned of held { vary gearbox.kp = [0.005, 0.02] V*s/rad; }
"""


def test_a_margin_comes_with_the_cases_and_is_not_known_between_them(chromium: Chromium, tmp_path: Path) -> None:
    deck = write_deck(tmp_path, MARGINS)
    with viewing(deck, "-q") as view:
        page = opened(chromium, view)
        row = f"{RUN}.document.querySelector('.answers tr:last-child').innerText"
        for case, verdict in enumerate(("met", "missed")):
            page.run(f"{RUN}.document.querySelector('.knob select').value = {case}")
            page.run(f"{RUN}.document.querySelector('.knob select').dispatchEvent(new Event('change'))")
            name, value, about, said = (cell.strip() for cell in page.run(row).split("\t"))
            assert name == "loop_gain_margin" and value.endswith(", from the sweep")
            assert about == "gain_margin of loop" and said.startswith(f"gain_margin(loop) > 20: {verdict}")
        page.run(f"{RUN}.document.querySelector('.knob input[type=range]').value = 0.5")
        page.run(f"{RUN}.document.querySelector('.knob input[type=range]').dispatchEvent(new Event('input'))")
        assert page.run(row).split("\t")[1].strip() == "not computed here"
        assert page.run(f"{RUN}.document.querySelector('.came-of li').textContent") == (
            "gain_margin(loop) > 20: 1 met, 1 missed"
        )
        silent(page, view)
        page.close()


@pytest.mark.release
@pytest.mark.browser
def test_of_eight_tabs_each_is_new_and_the_next_hears_when_the_first_is_closed(
    chromium: Chromium, tmp_path: Path
) -> None:
    deck = write_deck(tmp_path)
    with viewing(deck, "brief", "-q") as view:
        tabs = [opened(chromium, view) for _ in range(8)]  # a browser opens six connections to one server
        replace(deck, "3.55", "3.5")
        for tab in tabs:
            shown(tab, 2)
        tabs.pop(0).close()  # it was the one that heard
        replace(deck, "3.5 V", "3.45 V")
        for tab in tabs:
            shown(tab, 3)
        view.process.kill()
        for tab in tabs:
            until(tab, "document.querySelector('.doing').textContent.startsWith('met view has ended')")
            assert [said for said in tab.said if "ERR_" not in said] == []
            tab.close()
