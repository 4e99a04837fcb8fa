"""The part of a report on a search that says its answer, and how it came."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.report import report
from batch.report.contents.designs import search_answer
from batch.report.contents.parts import DesignAnswer, TextTable
from batch.report.html.designs import HIGH, WIDE, designs
from tests.batch.slider import swing

RUN = swing("metric far = final { of = slide.q; }", "require far > -0.05 m;")
DECK = (
    RUN
    + """\
search slowest of swing { minimise far;  environment.held.stiffness = between(5, 79) N/m;  at_most = 60; }
search wild of swing { minimise far;  environment.held.stiffness = logbetween(1, 1e9) N/m;  at_most = 64; }
tune still of swing { choose environment.held.stiffness = between(2, 9) N/m;  maximise far;  at_most = 60; }
"""
)


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("searches")
    return batch.run(ic.compile(text=DECK, select=["slowest", "wild", "still"]), output=folder / "a.h5", threads=1).path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "heading", "link"),
    [("slowest", "The worst case found", "The worst case"), ("still", "Which design to use", "Which design")],
)
def test_its_heading_says_what_was_asked(archive: Path, tmp_path: Path, name: str, heading: str, link: str) -> None:
    page = report(archive, tmp_path / "r.html", experiments=[name]).read_text(encoding="utf-8")
    assert re.search(rf'<section id="s0-designs" class="designs"><h[23]>{heading}</h[23]>', page)
    assert f'<a href="#s0-designs">{link}</a>' in page or f">{link}</a>" in page
    assert ("The worst of search <code>slowest</code>: far = " in page) == (name == "slowest")


@pytest.mark.slow
def test_a_search_that_found_a_case_that_fails_opens_with_it(archive: Path, tmp_path: Path) -> None:
    page = report(archive, tmp_path / "r.html", experiments=["wild"]).read_text(encoding="utf-8")
    opens = page[page.index("<main") :].partition("</section>")[0]
    assert re.search(r"A miss was found</p><p class=\"headline\">The worst case found, #\d+, fails\.</p>", opens)
    assert "<h4>Did not reach their end</h4>" in opens and "not known in the worst case found" in opens


@pytest.mark.slow
@pytest.mark.parametrize("name", ["slowest", "still"])
def test_every_row_is_a_change_and_the_curve_has_the_best_by_then(archive: Path, name: str) -> None:
    with ArchiveFile(archive) as file:
        group = next(each for each in file.groups if each.name == name)
        found = search_answer(file, group)
        far = group.values("far")
    assert found is not None and 2 <= len(found.table.rows) <= 24
    assert all(one[2:] != other[2:] for one, other in zip(found.table.rows, found.table.rows[1:], strict=False))
    best = np.minimum.accumulate(far) if name == "slowest" else np.maximum.accumulate(far)
    assert [value for _, value, _ in found.progress] == [best[cases - 1] for cases, _, _ in found.progress]
    assert found.progress[-1][0] == len(far)


def drawn(*progress: tuple[int, float, int]) -> str:
    table = TextTable(("generation", "cases", "far", ""), ("",) * 4, ())
    page = designs(DesignAnswer("", "", table, None, "", "", (), None, progress=progress))
    return "".join(re.findall(r'<path d="([^"]*)"', page))


def test_the_curve_goes_in_steps_with_gaps_where_nothing_compares() -> None:
    assert drawn((10, 1.0, 1), (20, 3.0, 1)) == f"M{WIDE / 2:.1f} {HIGH:.1f}H{WIDE:.1f}V0.0"
    assert drawn((1, 1.0, 1), (2, math.nan, 1), (4, 2.0, 1)) == f"M{WIDE / 4:.1f} {HIGH:.1f}M{WIDE:.1f} 0.0"
    assert drawn((2, 1.0, 1), (4, 2.0, 32)) == f"M{WIDE / 2:.1f} {HIGH:.1f}M{WIDE:.1f} 0.0"
    assert drawn((1, 2.0, 1), (2, 2.0, 1)) == drawn((1, math.nan, 1)) == ""
