"""A browser, for tests of what a page does in one."""

import pytest

from tests.batch.report.browser import browser_or_skip

chromium = pytest.fixture(scope="module")(browser_or_skip)
