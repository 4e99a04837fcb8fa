"""Reports and comparisons of archives that mean ill."""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import batch
from batch.archive.read import ArchiveFile
from batch.report import report
from batch.report.contents.against import ComparedArchive
from batch.report.contents.gathering import gather
from batch.report.html.page import page as html_page
from met import run as engine
from met.diagnostic import Problem
from met.plan import Experiment
from tests.batch import plans
from tests.batch.report import archives
from tests.batch.report.browser import Chromium, quiet
from tests.batch.report.test_page import hostile

pytestmark = pytest.mark.usefixtures("engine")


def some(one: Experiment, rows: range) -> Experiment:
    coordinates = tuple(replace(each, values=each.values[list(rows)]) for each in one.cases.coordinates)
    return replace(one, cases=replace(one.cases, count=len(rows), coordinates=coordinates))


def told(patch: pytest.MonkeyPatch, *, settle: list[float] | None = None, voltage: list[float] | None = None) -> None:
    """From now on a metric over the cases, or a signal over time, has these values in turn."""

    def answer(*args: Any, **options: Any) -> Any:
        found = plans.answer(*args, **options)
        if settle is not None:
            found.metrics["settle"][:] = np.asarray(settle)[found.case % len(settle)]
        if voltage is not None and "shoulder.servo.voltage" in found.signals:
            history = found.signals["shoulder.servo.voltage"]
            history[:] = np.asarray(voltage)[np.arange(history.shape[1]) % len(voltage)]
        return found

    patch.setattr(engine, "run", partial(answer))


class TestAgainst:
    @pytest.mark.release
    @pytest.mark.parametrize("histories", ["all", "none"])
    def test_one_with_the_same_sweep_and_no_case_in_common(self, here: Path, histories: str) -> None:
        archives.made(here / "a.h5", some(plans.gains(32), range(5)), histories=histories)
        archives.made(here / "b.h5", some(plans.gains(32), range(10, 15)), histories=histories)
        found = batch.diff("a.h5", "b.h5")
        assert found.verdict == "different"
        assert (found.experiments[0].only_a, found.experiments[0].only_b) == ([0, 1, 2, 3, 4], [0, 1, 2, 3, 4])
        text = report("b.h5", against="a.h5").read_text(encoding="utf-8")
        assert "The two have no case in common" in text

    @pytest.mark.slow
    def test_of_large_values_says_nothing_of_overflow(self, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        archives.made(here / "a.h5", plans.gains(3))
        told(monkeypatch, settle=[1e200])
        archives.made(here / "b.h5", plans.gains(3))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            report("b.h5", against="a.h5")


class TestOutput:
    def test_of_too_long_a_name_is_refused(self, here: Path) -> None:
        archives.made(here / "a.h5", plans.gains(3))
        name = "y" * 300 + ".html"
        with pytest.raises(Problem) as caught:
            report("a.h5", name)
        [diagnostic] = caught.value.diagnostics
        assert (diagnostic.code, diagnostic.message) == ("E380", f"cannot write {name}: file name too long")


@pytest.mark.browser
class TestInTheBrowser:
    def test_values_that_differ_by_a_rounding_are_drawn(
        self, here: Path, chromium: Chromium, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        near = [20.0, 20.0 + float(np.spacing(20.0))]
        told(monkeypatch, settle=near, voltage=near)
        archives.made(here / "a.h5", plans.gains(6), histories="all")
        page = chromium.open(report("a.h5"))
        page.settle()
        quiet(page)
        page.close()

    def test_hostile_lines_of_decks_and_requirements_are_shown_and_not_run(
        self, here: Path, chromium: Chromium, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        archives.made(here / "a.h5", plans.gains(6))
        told(monkeypatch, settle=[1.0, 30.0])
        one = plans.plan(plans.gains(6))
        source = replace(one.sources[0], text="run nominal { }\n// another\n")
        batch.run(replace(one, sources=(source,)), output="b.h5")
        with ArchiveFile("b.h5") as file, ArchiveFile("a.h5") as other:
            found = gather(file, against=ComparedArchive(other, batch.diff("a.h5", "b.h5")))
        assert found.changes is not None and found.changes.decks[0].lines
        assert found.verdicts[-1].flows[0].worse is not None
        (here / "wild.html").write_text(html_page(hostile(found)), encoding="utf-8")
        shown = chromium.open(here / "wild.html")
        shown.settle()
        assert shown.run("window.hostile") is None and shown.run("document.querySelectorAll('img').length") == 0
        for place in (".textdiff", ".verdict.against td.words", ".verdict.against th code", "#changed summary"):
            assert "</script>" in shown.run(f"document.querySelector({place!r}).textContent"), place
        quiet(shown)
        shown.close()

    def test_plus_may_be_held_down(self, here: Path, chromium: Chromium) -> None:
        archives.made(here / "a.h5", plans.nominal(), histories="all")
        page = chromium.open(report("a.h5"))
        page.settle()
        page.run("document.querySelector('[data-plot=signals] .frame').focus()")
        for _ in range(60):
            page.key("+", "+")
        page.settle()
        quiet(page)
        page.close()
