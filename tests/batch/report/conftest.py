"""A browser, for tests of what a page does in one."""

from collections.abc import Iterator

import pytest

from tests.batch.report.browser import PACKAGE, Chromium, browser, program


@pytest.fixture(scope="module")
def chromium() -> Iterator[Chromium]:
    if program() is None:
        pytest.skip(f"no chromium; on Debian or Ubuntu: apt-get install {PACKAGE}")
    with browser() as started:
        yield started
