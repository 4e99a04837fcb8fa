"""What acts on an arm, on a page that simulates: forces of joints on their links, loads, contact, gas, payloads."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import xarray

from batch.archive.read import ArchiveFile
from batch.portable import page as portable_page
from met import cli
from tests.batch.arms.decks import about
from tests.batch.portable.test_arm_on_page import becomes, changed, opened, pixels
from tests.batch.report.browser import Chromium, Page, browser_or_skip, quiet

DECK = """\
#include <two_link.ic>
run brief like nominal { duration = 0.2 s;  remove settle;  record += [reaction.force];  initial { elbow.q = 1 rad; } }
"""


LEGEND = "Array.from(document.querySelectorAll('.stage .legend .chip:not([hidden])'), e => e.textContent)"
AROUND = "MET.shown.around().filter(each => each.mesh !== 'block').map(each => each.role)"
LOOKED = "new Promise(d => { const f = () => MET.shown.legend.looked() ? d() : setTimeout(f, 20); f(); })"


chromium = pytest.fixture(scope="module")(browser_or_skip)


@pytest.mark.browser
def test_an_arrow_is_the_recorded_force_in_the_world_and_its_scale_is_told(chromium: Chromium, tmp_path: Path) -> None:
    (tmp_path / "deck.ic").write_text(DECK, encoding="utf-8")
    archive = tmp_path / "a.h5"
    assert cli.main(["run", str(tmp_path / "deck.ic"), "brief", "-q", "--no-picture", "-o", str(archive)]) == cli.YES
    assert cli.main(["view", str(archive), "-q"]) == 0
    page = opened(chromium, tmp_path / "a.view.html", width=400)
    with xarray.open_dataset(archive) as data:
        recorded = data["reaction.force"].values.reshape(-1, 2, 3)
        time = data["time"].values
    for row in (1, len(time) // 2, len(time) - 1):
        found = page.run(f"MET.shown.legend.reactions({time[row]})")
        assert [each[1:] for each in found] == recorded[row].tolist()
    most = float(np.linalg.norm(recorded, axis=-1).max())
    assert most > 0.0 and page.run("MET.shown.legend.most('force', 'N')") == pytest.approx(most, rel=1e-15)
    told = page.run(LEGEND)
    assert len(told) == 1 and told[0].startswith("joint forceslongest ")
    assert float(told[0].partition("longest ")[2].removesuffix(" N")) == pytest.approx(most, rel=1e-3)

    rng = np.random.default_rng(20261126)
    turn, origin, force = about([0.6, 0.0, 0.8], 1.1), rng.normal(size=3), rng.normal(size=3)
    numbers = json.dumps([0.0] * 12 + [*turn.reshape(-1).tolist(), *origin.tolist()])
    drawn = page.run(f"MET.arm.make(MET_PAGE.arm.scene).arrows({numbers}, {json.dumps([[1, *force.tolist()]])}, 2)")
    shaft, head = drawn
    assert [shaft["mesh"], head["mesh"]] == ["can", "cone"]
    begin, end = (
        np.array(each["at"]) + sign * np.array(each["axes"][2]) * each["size"][3] / 2
        for each, sign in ((shaft, -1), (head, 1))
    )
    assert begin == pytest.approx(origin, abs=1e-12)
    assert end == pytest.approx(origin + 2.0 * (turn @ force), abs=1e-12)  # the page's up is z for this deck

    page.run("MET.shown.seek(0.1)")
    before = pixels(page, tmp_path)
    page.run("document.querySelector('.stage .view').focus()")
    page.key("a")
    assert changed(before, becomes(page, tmp_path, lambda shown: changed(before, shown) > 0.001)) > 0.001
    quiet(page)
    page.close()


ACTING = """\
arm boom {
    link upper { mass = 8 kg; shape = rod(length = 2 m, along = x); }
    link lower { mass = 4 kg; shape = rod(length = 1.6 m, along = x); }
    joint shoulder revolute { parent = base;  child = upper; axis = z; }
    joint elbow    revolute { parent = upper; child = lower; axis = z; at = [2, 0, 0] m; }
}
run pushed {
    arm = boom;
    rates { dynamics = 500 Hz; record = 50 Hz; }
    duration = 2 s;
    initial { elbow.q = 0.6 rad; shoulder.qd = 0.3 rad/s; }
    environment {
        shove = wrench { link = upper; force = [0, 3, 1] N; point = [1, 0, 0] m; from = 0.4 s; axes = link; }
        twist = wrench { link = lower; moment = [0, 0, 1] N*m; from = 1 s; }
        stop  = joint_stop { joint = elbow; lower = -10 deg; upper = 30 deg; stiffness = 400 N*m/rad; dissipation = 0.2 s/rad; }
        jet   = plume { link = lower; at = [1.2, 0, 0] m; rpy = [-90, 0, 0] deg; width = 0.8 m; height = 0.5 m; cells = 1; sides = both;
                        nozzle = [3, -1.2, 0] m; axis = [-0.3, 1, 0]; thrust = 20 N; exponent = 8; from = 0.5 s; until = 1.5 s; }
    }
    payload parcel { mass = 2 kg; shape = box(size = [0.3, 0.3, 0.3] m); on = lower; grapple = 1.2 s; position = [1.7, 2.5, 0.1] m; at = [1.6, 0, 0] m; }
    payload tool   { mass = 1 kg; inertia = [1, 1, 1] kg*m^2; on = upper; release = 1.6 s; }
    record = [q, qd, payloads.parcel.position, payloads.parcel.orientation];
}
"""  # noqa: E501

HOSTILE = "</script><img src=x onerror=\"document.title='hurt'\">"


@pytest.fixture(scope="module")
def acting(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page of an arm that is pushed, stopped, blown at and handed a payload."""
    folder = tmp_path_factory.mktemp("acting")
    (folder / "deck.ic").write_text(ACTING, encoding="utf-8")
    words = ["run", folder / "deck.ic", "-q", "--no-picture", "-o", folder / "a.h5"]
    assert cli.main([str(word) for word in words]) == cli.YES
    assert cli.main(["view", str(folder / "a.h5"), "-q"]) == 0
    return folder


def shown_at(page: Page, time: float) -> list[str]:
    """The roles of what is drawn around the arm at a time."""
    page.run(f"MET.shown.seek({time})")
    page.run("new Promise(d => { const f = () => MET.shown.isStill() ? d() : setTimeout(f, 20); f(); })")
    return page.run(AROUND)  # type: ignore[no-any-return]


@pytest.mark.release
@pytest.mark.browser
@pytest.mark.parametrize(("width", "dark"), [(1280, True), (400, False)])
def test_each_kind_is_drawn_while_it_acts_and_its_switch_takes_it_away(
    chromium: Chromium, acting: Path, tmp_path: Path, width: int, dark: bool
) -> None:
    page = opened(chromium, acting / "a.view.html", width=width, dark=dark)
    page.run(LOOKED)
    loads, contact, plumes, payloads = page.run(LEGEND)
    assert loads == "loadslongest 3.162 N, 1 N\u00b7m"  # of (0, 3, 1) and of 1
    assert contact.startswith("contactlongest ") and contact.endswith(" N\u00b7m")
    assert plumes.startswith("plumeslongest ") and payloads == "payloadsparcel free, tool on upper"
    assert "contact" not in shown_at(page, 1.0) and "contact" not in page.run(LEGEND)
    touching = page.run("MET.shown.legend.now(0).find(each => each.kind === 'contact')")
    assert touching["at"] == pytest.approx([2.0, 0.0, 0.0]) and touching["vector"][2] == pytest.approx(
        -400.0 * (0.6 - np.radians(30.0))
    )
    assert shown_at(page, 0.0).count("contact") == 4  # shaft, two heads, and a collar of the joint
    for time, plume in ((0.3, False), (0.6, True), (1.4, True), (1.52, False)):
        assert ("plume" in shown_at(page, time)) == plume
        assert page.run(LEGEND)[-1] == f"payloadsparcel {'free' if time < 1.2 else 'on lower'}, tool on upper"
    assert "grip" in shown_at(page, 1.4) and "grip" not in shown_at(page, 1.1)
    shown_at(page, 1.8)
    assert page.run(LEGEND)[-1] == "payloadsparcel on lower, tool released"
    note = page.run("document.querySelector('.stage .note').textContent")
    assert note == (
        "Not drawn: payload tool. For all that, the run must record "
        "record += [payloads.tool.position, payloads.tool.orientation];"
    )
    assert page.run("document.documentElement.scrollWidth") <= width

    shown_at(page, 1.4)
    for n, key in enumerate("lpo"):
        before = pixels(page, tmp_path)
        page.run("document.querySelector('.stage .view').focus()")
        page.key(key)
        new = becomes(page, tmp_path, lambda shown, old=before: changed(old, shown) > 0.0005)  # type: ignore[misc]
        assert changed(before, new) > 0.0005, key
        kinds = {"l": "load", "p": "plume", "o": "grip"}
        assert kinds[key] not in page.run(AROUND)
        pressed = page.run(
            "Array.from(document.querySelectorAll('.stage .legend .chip:not([hidden])'), e => e.ariaPressed)"
        )
        assert pressed.count("false") == n + 1
    kept = page.run("MET.shown.kept().legend")
    assert kept == {"force": True, "load": False, "contact": True, "plume": False, "payload": False}
    page.run("MET.shown.resume({ ...MET.shown.kept(), legend: { load: true } })")
    assert "load" in page.run(AROUND)
    words = page.run(LEGEND)
    page.run(
        "MET.shown.resume({ ...MET.shown.kept(), legend: { plume: true } }); dispatchEvent(new Event('beforeprint'))"
    )
    assert page.run("document.querySelectorAll('.stage .film svg').length") >= 6
    inks = page.run(
        "Array.from(document.querySelectorAll('.stage .film path'), e => Number(e.getAttribute('opacity')))"
    )
    assert inks.count(0.3) >= 6  # plates, and cones of gas
    assert page.run(LEGEND) == words  # of the instant that is shown, not of the last picture on paper
    quiet(page)
    page.close()


@pytest.mark.browser
def test_kinds_differ_in_colour_from_each_other_and_from_paper(chromium: Chromium, acting: Path) -> None:
    for dark in (False, True):
        page = opened(chromium, acting / "a.view.html", dark=dark)
        colours = page.run("Object.values(MET.acting.inks())")
        rgb = np.array([[int(each[at : at + 2], 16) for at in (1, 3, 5)] for each in colours], float)
        apart = np.linalg.norm(rgb[:, None] - rgb[None], axis=-1)[~np.eye(len(rgb), dtype=bool)]
        assert apart.min() > 90.0
        light = [0.2126, 0.7152, 0.0722] @ np.where(
            rgb.T / 255 <= 0.04045, rgb.T / 3294.6, ((rgb.T / 255 + 0.055) / 1.055) ** 2.4
        )
        paper = 0.008 if dark else 1.0
        contrast = (np.maximum(light, paper) + 0.05) / (np.minimum(light, paper) + 0.05)
        assert contrast.min() > (3.0 if dark else 2.0)
        page.close()


@pytest.mark.release
@pytest.mark.browser
def test_names_of_loads_and_payloads_are_texts_whatever_they_hold(
    chromium: Chromium, acting: Path, tmp_path: Path
) -> None:
    with ArchiveFile(acting / "a.h5") as file:
        experiment = file.plan().experiments[0]
        data = portable_page.data_of(experiment, file, file.groups[0])
    found = data["arm"]["acting"]
    found["arrows"] = [[kind, HOSTILE, unit] for kind, _, unit in found["arrows"]]
    found["jets"] = [HOSTILE]
    found["payloads"] = [[HOSTILE, HOSTILE, body] for *_, body in found["payloads"]]
    found["notDrawn"] = [["load", HOSTILE, []], ["payload", HOSTILE, [HOSTILE]]]
    (tmp_path / "hostile.html").write_text(portable_page.page_of(experiment, data), encoding="utf-8")
    page = opened(chromium, tmp_path / "hostile.html")
    for words in (page.run(LEGEND)[-1], page.run("document.querySelector('.stage .note').textContent")):
        assert HOSTILE in words
    assert page.run("document.querySelectorAll('img').length") == 0 and "hurt" not in page.run("document.title")
    quiet(page)
    page.close()
