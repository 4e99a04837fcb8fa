"""What holds for all tests."""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import os
import random
import re
import signal
import sys
from collections.abc import Generator
from pathlib import Path

import pytest

from tests import costs

ROOT = Path(__file__).parents[1]
PASSED = "met/passed"
"""Where pytest's cache keeps which of the default tests passed last, and the digest of the files that they tested."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--order", type=int, metavar="SEED", help="shuffle the files of tests, and the tests of each file")


def pytest_configure(config: pytest.Config) -> None:
    """Signals as a terminal's: who starts the tests in the background, or by nohup, has some ignored."""
    if "MET_TEST_ALL" not in os.environ and not hasattr(config, "workerinput"):
        config.pluginmanager.register(_Passed(config))
    ledger = costs.read_ledger()
    config.pluginmanager.register(costs.Measured(ledger))
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(costs.Counted(ledger))
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    os.environ["MET_CHECK_RECORDINGS"] = "1"  # also of the processes that tests start
    os.environ.pop("COLUMNS", None)  # what is printed is not as wide as the window in which tests run


def pytest_report_header(config: pytest.Config) -> list[str]:
    """What machine code is made for, which instruction sets this processor lacks and what is left out: a log tells."""
    from tests import instruction_sets  # not before what it imports may be

    lines = [instruction_sets.header()]
    if "MET_TEST_REST" in os.environ:
        count = len(passed_on_these_files(config))
        lines.append(f"left out: {count} tests that have passed on these files" if count else "nothing is left out")
    return lines


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """With `scripts/test --ci` and `--all` nothing is skipped in silence: what a test misses there is a failure."""
    report = yield
    if report.skipped and "MET_TEST_ALL" in os.environ and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"skipped, which is a failure with --ci and --all: {report.longrepr}"
    return report


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """No file is imported without a test of those asked for, as far as its first lines tell.

    With `-m alone...` these are the files that name this mark, and with `-m "not (slow or ...)"` those which are not
    marked so as a whole.
    """
    if collection_path.suffix != ".py":
        return None
    if config.option.markexpr.startswith("alone"):
        return b"mark.alone" not in collection_path.read_bytes() or None
    if not (unwanted := _unwanted_marks(config)):
        return None
    of_the_file = re.search(r"^pytestmark = (.*?)\n(?![ \])])", collection_path.read_text("utf-8"), re.M | re.S)
    return bool(of_the_file and unwanted & set(re.findall(r"mark\.(\w+)", of_the_file[1]))) or None


@pytest.hookimpl(tryfirst=True)
def pytest_pycollect_makeitem(collector: pytest.Collector, obj: object) -> list[pytest.Item] | None:
    """Nothing is made of functions and classes that are marked as what was not asked for: half of all tests."""
    unwanted = _unwanted_marks(collector.config)
    marks = getattr(obj, "pytestmark", []) if unwanted and (isinstance(obj, type) or callable(obj)) else []
    return [] if isinstance(marks, list) and any(mark.name in unwanted for mark in marks) else None


def _unwanted_marks(config: pytest.Config) -> frozenset[str]:
    """The marks of `-m "not (MARK or MARK ...)"`; none where it is another expression."""
    alternatives = re.fullmatch(r"not \((\w+(?: or \w+)*)\)", config.option.markexpr)
    return frozenset(alternatives[1].split(" or ")) if alternatives else frozenset()


@pytest.hookimpl(tryfirst=True)
def pytest_collection(session: pytest.Session) -> None:
    """In a fresh clone, each process that runs tests compiles all of them, with what shows how an assert failed.

    What one has compiled is on the disk for the others. So every other one begins with the last file.
    """
    worker = os.environ.get("PYTEST_XDIST_WORKER", "gw0")
    if int(worker.removeprefix("gw")) % 2 == 0 or [Path(arg).name for arg in session.config.args] != ["tests"]:
        return
    for path in sorted(ROOT.glob("tests/**/test_*.py"), reverse=True):
        if not pytest_ignore_collect(path, session.config):
            with contextlib.suppress(Exception, pytest.skip.Exception):  # the collection tells
                importlib.import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))


class _Passed:
    """Keeps which tests passed, for `--rest` of `scripts/test`."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._files = files_digest()
        self._passed: set[str] = set()
        self._not_wholly: set[str] = set()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if not report.passed:
            self._not_wholly.add(report.nodeid)
        elif report.when == "call":
            self._passed.add(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        if hasattr(self._config, "cache") and self._files == files_digest():  # else: of which files did they pass?
            tests = sorted(self._passed - self._not_wholly)
            self._config.cache.set(PASSED, {"files": self._files, "tests": tests})


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """With `--rest` of `scripts/test`, leave out what passed when the same files were tested by `scripts/test`.

    With `--order`, shuffle. Tests that make environments come first: at the end they would keep one core waiting for
    minutes.
    """
    _draw_the_same_whatever_the_sources_say()
    if (seed := config.getoption("order")) is not None:
        drawing = random.Random(seed)
        files = sorted({item.path for item in items})
        place = dict(zip(drawing.sample(files, len(files)), range(len(files)), strict=True))
        drawing.shuffle(items)
        items.sort(key=lambda item: place[item.path])
    items.sort(key=lambda item: item.path.name != "test_scripts.py")
    passed = passed_on_these_files(config) if "MET_TEST_REST" in os.environ else set()
    left_out = [item for item in items if item.nodeid in passed]
    items[:] = [item for item in items if item.nodeid not in passed]
    config.hook.pytest_deselected(items=left_out)


def _draw_the_same_whatever_the_sources_say() -> None:
    """Keep hypothesis from mixing numbers and words of our source files into what it draws.

    Any change would give other examples, and a search of all files for them costs each process seconds.
    """
    if "hypothesis" in sys.modules:
        from hypothesis.internal.conjecture import providers

        providers._get_local_constants = lambda: providers._local_constants


def passed_on_these_files(config: pytest.Config) -> set[str]:
    """The names of the tests that passed when `scripts/test` last ran; none where a file has changed since."""
    kept = config.cache.get(PASSED, None) if hasattr(config, "cache") else None
    return set(kept["tests"]) if kept is not None and kept["files"] == files_digest() else set()


def files_digest() -> str:
    """SHA-256, in hex, of Python's version and of the names and bytes of the checkout's files, as far as git has them.

    Left out is what an environment, Python and the tools of the tests leave behind.
    """
    digest = hashlib.sha256(sys.version.encode())
    for folder, folders, names in os.walk(ROOT):
        folders[:] = sorted(
            name
            for name in folders
            if not (name.startswith(".") and name not in (".ci", ".github"))
            and name not in ("__pycache__", "build", "dist")
            and not name.endswith(".egg-info")
        )
        for name in sorted(names):
            path = Path(folder, name)
            digest.update(f"\0{path.relative_to(ROOT)}\0".encode(errors="surrogateescape"))
            digest.update(hashlib.sha256(path.read_bytes()).digest() if path.is_file() else b"")
    return digest.hexdigest()
