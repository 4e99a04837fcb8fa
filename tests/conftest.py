"""What holds for all tests."""

from __future__ import annotations

import os
import signal
from collections.abc import Generator

import pytest


def pytest_configure() -> None:
    """Signals as a terminal's: who starts the tests in the background, or by nohup, has some ignored."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    os.environ["MET_CHECK_RECORDINGS"] = "1"  # also of the processes that tests start
    os.environ.pop("COLUMNS", None)  # what is printed is not as wide as the window in which tests run


def pytest_report_header() -> str:
    """What machine code is made for, and which instruction sets this processor lacks, so that a log tells."""
    from tests import instruction_sets  # not before what it imports may be

    return instruction_sets.header()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """With `scripts/test --all` nothing is skipped in silence: what a test misses there is a failure."""
    report = yield
    if report.skipped and "MET_TEST_ALL" in os.environ and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"skipped, which is a failure with --all: {report.longrepr}"
    return report
