"""Forces of joints on their links, as arrows on a page that simulates."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import xarray

from met import cli
from tests.batch.arms.decks import about
from tests.batch.portable.test_arm_on_page import changed, opened, pixels
from tests.batch.report.browser import PACKAGE, Chromium, browser, program, quiet

DECK = """\
#include <two_link.ic>
run brief like nominal { duration = 0.2 s;  remove settle;  record += [reaction.force];  initial { elbow.q = 1 rad; } }
"""


@pytest.fixture(scope="module")
def chromium() -> Iterator[Chromium]:
    if program() is None:
        pytest.skip(f"no chromium; on Debian or Ubuntu: apt-get install {PACKAGE}")
    with browser() as started:
        yield started


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
        found = page.run(f"MET.shown.forces().at({time[row]})")
        assert [each[1:] for each in found] == recorded[row].tolist()
    most = float(np.linalg.norm(recorded, axis=-1).max())
    assert most > 0.0 and page.run("MET.shown.forces().most") == pytest.approx(most, rel=1e-15)
    told = page.run("document.querySelector('.stage .scaled').textContent")
    assert float(told.partition("longest arrow ")[2].removesuffix(" N")) == pytest.approx(most, rel=1e-3)

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
    assert changed(before, pixels(page, tmp_path)) > 0.001
    quiet(page)
    page.close()
