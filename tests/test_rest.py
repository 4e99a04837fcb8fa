"""`scripts/test --ci --rest` leaves out what has just passed on the same files, and nothing else."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TESTS = """\
import pytest


def test_right() -> None:
    pass


def test_wrong() -> None:
    assert not "wrong"


@pytest.mark.skip(reason="no such tool")
def test_skipped() -> None:
    pass


@pytest.fixture
def leaves_a_mess() -> object:
    yield
    raise OSError


def test_right_with_a_mess_behind_it(leaves_a_mess: object) -> None:
    pass


@pytest.mark.slow
def test_slow() -> None:
    pass
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout whose default run has one test that passes and three that do not."""
    (tmp_path / "tests").mkdir()
    for name in ("conftest.py", "costs.py", "costs.toml"):
        shutil.copy(ROOT / "tests" / name, tmp_path / "tests")
    shutil.copy(ROOT / "setup.cfg", tmp_path)
    (tmp_path / "tests" / "instruction_sets.py").write_text('def header() -> str:\n    return ""\n')
    (tmp_path / "tests" / "test_it.py").write_text(TESTS)
    return tmp_path


def names(checkout: Path, surroundings: Mapping[str, str], *words: str) -> list[str]:
    """The tests that ran, as pytest told of them."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST_", "MET_TEST"))}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-v", *words],
        cwd=checkout,
        capture_output=True,
        text=True,
        env={**environment, **surroundings},
    )
    assert done.returncode == 1, done.stdout + done.stderr
    started = (
        line.partition("::")[2].split() for line in done.stdout.splitlines() if line.startswith("tests/test_it.py::")
    )
    return list(dict.fromkeys(words[0] for words in started))


ALL = {"MET_TEST_ALL": "1"}
REST = {**ALL, "MET_TEST_REST": "1"}
EVERY_TEST = ["test_right", "test_wrong", "test_skipped", "test_right_with_a_mess_behind_it", "test_slow"]


@pytest.mark.release
def test_what_passed_wholly_is_left_out_until_a_file_changes(checkout: Path) -> None:
    assert names(checkout, {}, "-m", "not slow") == EVERY_TEST[:-1]
    assert names(checkout, REST) == EVERY_TEST[1:]
    assert names(checkout, ALL) == EVERY_TEST
    assert names(checkout, REST) == EVERY_TEST[1:], "and a run of everything changes nothing about that"
    (checkout / "data.txt").write_text("what a test may read")
    assert names(checkout, REST) == EVERY_TEST


def test_it_goes_with_ci_and_all_only() -> None:
    done = subprocess.run([ROOT / "scripts" / "test", "--rest"], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (
        2,
        "",
        "scripts/test: error: `--rest` is what is left of `--ci` or `--all`; write `scripts/test --ci --rest`\n",
    )
