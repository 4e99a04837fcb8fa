"""Signals on a page that simulates: read at the cursor, zoomed, hidden; limits, and why a requirement is missed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray

from met import cli
from tests.batch.report.browser import Chromium, Page, browser_or_skip, quiet

DECK = """\
#include <servos/rigid_gearbox.ic>
arm three {
    link turret { mass = 8 kg;  shape = cylinder(radius = 80 mm, length = 300 mm, along = z); }
    link upper { mass = 6 kg;  shape = rod(length = 0.6 m, along = x); }
    link fore  { mass = 3 kg;  shape = rod(length = 0.5 m, along = x); }
    joint yaw   revolute { parent = base; child = turret; axis = z; }
    joint lift  revolute { parent = turret; child = upper; axis = y; at = [0 m, 0 m, 0.3 m]; }
    joint bend  revolute { parent = upper; child = fore; axis = y; at = [0.6 m, 0 m, 0 m]; }
}
servo drive like rigid_gearbox {
    k_position = 5 1/s;  command = position(ramp(start = 0 deg, to = 40 deg, begin = 0.2 s, over = 1.5 s));
}
run raised {
    arm = three;
    servos { yaw = drive; lift = drive; bend = drive; }
    environment { gravity = [0, 0, -9.81] m/s^2; }
    rates { dynamics = 1 kHz; servos = 1 kHz; record = 1 kHz; }
    duration = 1 s;
    record = [q, tau, reaction.force];
    metric hold = peak { of = lift.tau; }
    metric late = final { of = lift.q; }
    require hold < 80 N*m;
    require late < 300 deg;
}
sweep loads of raised { vary links.fore.mass = [2, 3, 5] kg; }
"""


chromium = pytest.fixture(scope="module")(browser_or_skip)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an archive of three cases and its page."""
    folder = tmp_path_factory.mktemp("traces")
    (folder / "deck.ic").write_text(DECK, encoding="utf-8")
    words = ["run", str(folder / "deck.ic"), "loads", "-q", "--no-picture", "-o", str(folder / "a.h5")]
    assert cli.main(words) == cli.NO
    assert cli.main(["view", str(folder / "a.h5"), "-q"]) == 0
    return folder


ROWS = "[...document.querySelectorAll('.answers tr')].map(row => [...row.cells].map(cell => cell.innerText.trim()))"
CHIPS = "[...document.querySelectorAll('.panel')[{0}].querySelectorAll('.chip')]"
READ = f"{CHIPS}.map(chip => chip.querySelector('b').textContent)"
PLOT = "document.querySelectorAll('.panel .u-over')[{0}]"


def stretch(page: Page) -> list[list[float]]:
    """The times that each plot shows, from and to."""
    found: list[list[float]] = page.run("MET.page.plots().map(({ scales }) => [scales.x.min, scales.x.max])")
    return found


@pytest.mark.browser
def test_a_metric_says_what_it_is_of_and_a_missed_requirement_by_how_much_when_and_at_which_limit(
    chromium: Chromium, folder: Path
) -> None:
    page = chromium.open(folder / "a.view.html")
    page.settle()
    with xarray.open_dataset(folder / "a.h5") as data:
        for case in range(3):
            page.run(f"MET.page.put(MET_PAGE.description.cases.inputs[{case}].slice())")
            tau = np.abs(data["tau"].sel(joint="lift").values[case])
            hold, number = float(data["hold"][case]), int(data["extreme_at.hold"][case])
            path = str(data["extreme_at.hold"].attrs["flag_meanings"]).split()[number]
            name, value, about, verdict = page.run(ROWS)[0]
            assert (name, about) == ("hold", data["hold"].attrs["long_name"])
            assert float(value.split()[0]) == pytest.approx(hold, rel=1e-3)
            words = verdict.replace(",", "").split()
            assert words[:6] == ["hold", "<", "80", "N*m:", "missed", "by"]
            assert float(words[6]) == pytest.approx(hold - 80.0, rel=1e-3) and number > 0
            assert float(words[words.index("at") + 1]) == pytest.approx(data["time"].values[tau.argmax()], abs=1e-3)
            assert verdict.endswith(f", while {path} was reached")
    assert page.run(ROWS)[1][-1] == "late < 300 deg: met"
    corner = page.run(
        "[...document.querySelectorAll('.triad span')].map(e => [e.textContent, parseFloat(e.style.top)])"
    )
    (*axes, (gravity, below)) = corner
    assert [name for name, _ in axes] == ["x", "y", "z"] and gravity == "g" and below > 38 > axes[2][1]
    assert "9.81 m/s²" in page.run("document.querySelector('.triad').title")
    quiet(page)
    page.close()


@pytest.mark.browser
def test_a_limit_comes_into_view_where_it_is_near_and_is_drawn(chromium: Chromium, folder: Path) -> None:
    page = chromium.open(folder / "a.view.html")
    page.settle()
    found = page.run("""(() => { const said = [], own = CanvasRenderingContext2D.prototype.fillText;
        CanvasRenderingContext2D.prototype.fillText = text => said.push(text);
        MET.page.plots().forEach(plot => plot.batch(() => plot.redraw()));
        CanvasRenderingContext2D.prototype.fillText = own;  return said; })()""")
    assert "hold < 80 N*m" in found
    scale = page.run("(({ min, max }) => [min, max])(MET.page.plots()[0].scales.y)")
    assert scale[1] < 300.0  # far from it
    low, high = page.run("(({ min, max }) => [min, max])(MET.page.plots()[1].scales.y)")
    assert low < -80.0 and high > 80.0  # of a peak both
    quiet(page)
    page.close()


@pytest.mark.browser
def test_lines_are_read_at_the_cursor_hidden_by_their_chips_and_told_apart(chromium: Chromium, folder: Path) -> None:
    page = chromium.open(folder / "a.view.html")
    page.settle()
    names = page.run(f"{CHIPS.format(2)}.map(chip => chip.childNodes[1].textContent)")
    assert names == [f"{joint}.{axis}" for joint in ("yaw", "lift", "bend") for axis in "xyz"]
    strokes = page.run(f"{CHIPS.format(2)}.map(chip => chip.querySelector('line').outerHTML)")
    assert len(set(strokes)) == 9
    left, top, width, height = page.box(".panel .u-over", 1)
    page.mouse("mouseMoved", left + 0.5 * width, top + 0.5 * height)
    page.settle()
    row = page.run("MET.page.plots()[1].cursor.idx")
    with xarray.open_dataset(folder / "a.h5") as data:
        expected = data["tau"].values[0, row]
    assert [float(each) for each in page.run(READ.format(1))] == pytest.approx(expected.tolist(), rel=1e-3)
    assert page.run(READ.format(0)) != ["0", "0", "0"]  # the others go with it
    assert page.run("MET.shown.time()") == 0.0
    page.click(left + 0.5 * width, top + 0.5 * height)
    page.settle()
    assert page.run("MET.shown.time()") == pytest.approx(row / 1000.0)
    page.run(f"{CHIPS.format(1)}[1].click()")
    assert page.run("MET.page.plots()[1].series.map(({ show }) => show)") == [True, True, False, True]
    page.run("dispatchEvent(new Event('resize'))")  # it is made again
    assert page.run("MET.page.plots()[1].series.map(({ show }) => show)") == [True, True, False, True]
    quiet(page)
    page.close()


@pytest.mark.browser
def test_a_stretch_of_time_that_is_dragged_stays_while_a_slider_moves(chromium: Chromium, folder: Path) -> None:
    page = chromium.open(folder / "a.view.html")
    page.settle()
    left, top, width, height = page.box(".panel .u-over", 0)
    page.drag([(left + share * width, top + height / 2) for share in (0.25, 0.4, 0.5)])
    page.settle()
    zoomed = stretch(page)
    assert zoomed == [pytest.approx([0.25, 0.5], abs=0.01)] * 3 and page.run("MET.shown.time()") == 0.0
    before = page.run("MET.page.plots()[1].scales.y.max")
    page.run("MET.page.put(MET_PAGE.description.cases.inputs[2].slice())")
    page.settle()
    assert stretch(page) == zoomed and page.run("MET.page.plots()[1].scales.y.max") != before
    page.run("dispatchEvent(new Event('resize'))")
    page.settle()
    assert stretch(page) == zoomed
    page.click(left + 0.5 * width, top + 0.5 * height, clicks=2)
    page.settle()
    assert stretch(page) == [[0.0, 1.0]] * 3
    quiet(page)
    page.close()


@pytest.mark.browser
def test_arrows_of_recorded_forces_are_in_view_below_the_switches(chromium: Chromium, folder: Path) -> None:
    page = chromium.open(folder / "a.view.html")
    page.settle()
    seen = """(() => { const { camera } = MET.shown, high = document.querySelector('.stage .view').clientHeight;
        const ends = MET.shown.around().filter(each => each.role === 'force').flatMap(each => MET.arm.ends(each).ends);
        return ends.map(p => camera.see(p)).map(([x, y]) => [Math.abs(x / camera.aspect), y + 88 / high]); })()"""
    fit = "[...document.querySelectorAll('.stage .chip')].find(e => e.textContent === 'fit').click()"
    for without, inside in ((False, True), (True, False)):
        if without:
            page.run("MET.shown.legend.forces = () => []; 0")  # the arm alone decides
        page.run(fit)
        page.settle()
        assert all(x < 1 and y < 1 for x, y in page.run(seen)) == inside
    page.close()
