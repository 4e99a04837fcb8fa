"""Arms of 2 to 30 joints in Chromium, bit for bit: friction, noise, beds, payloads, tables, plumes, a free base."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from benchmarks.arms import Arm

from tests.batch.portable.bits_in_chromium import counted, kernel_page
from tests.batch.report.browser import PACKAGE, Page, browser, program, quiet
from tests.met.backends import whole_runs

MACHINE = pytest.mark.parametrize("machine", [pytest.param(False, id="own fma"), pytest.param(None, id="found out")])


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    if program() is None:
        pytest.skip(f"no chromium; on Debian or Ubuntu: apt-get install {PACKAGE}")
    with browser() as chromium:
        opened = chromium.open(kernel_page(tmp_path_factory.mktemp("kernel")))
        yield opened
        quiet(opened)


@pytest.mark.browser
@pytest.mark.slow
@MACHINE
@pytest.mark.parametrize(("deck", "run"), whole_runs.PUBLISHED)
def test_whole_runs_of_published_arms_have_the_native_bits(
    page: Page, deck: str, run: str, machine: bool | None
) -> None:
    count, wrong, fused = counted(page, whole_runs.published(deck, run), machine)
    assert wrong == 0 and count > 4_000 and not (fused and machine is False)


@pytest.mark.browser
@pytest.mark.release
@MACHINE
@pytest.mark.parametrize(("arm", "model"), whole_runs.REVERSING, ids=lambda of: of.name if isinstance(of, Arm) else of)
def test_arms_that_reverse_have_the_native_bits(page: Page, arm: Arm, model: str, machine: bool | None) -> None:
    count, wrong, fused = counted(page, whole_runs.reversing(arm, model), machine)
    assert wrong == 0 and count > 1_000 and not (fused and machine is False)


@pytest.mark.browser
@pytest.mark.slow
def test_a_number_that_is_a_bit_off_is_counted(page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    run = whole_runs.reversing(*whole_runs.REVERSING[0])
    rows, outputs = run.native()
    rows.view("int64").reshape(-1)[7] ^= 1
    monkeypatch.setattr(whole_runs.WholeRun, "native", lambda _: (rows, outputs))
    assert counted(page, run, None)[1] == 1
