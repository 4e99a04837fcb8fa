"""One archive for all tests here; none of them changes it."""

from pathlib import Path

import pytest

from tests.batch.foreign import archives


@pytest.fixture(scope="session")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run and a sweep, each in groups of their own."""
    return archives.made(tmp_path_factory.mktemp("foreign"))


@pytest.fixture(scope="session")
def single(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One run, in the root of its archive."""
    return archives.made(tmp_path_factory.mktemp("foreign"), "open")
