"""A server for all tests, since each start takes a second; each test finds nothing open."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.ic.editor.client import Editor


@pytest.fixture(scope="session")
def started(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Editor]:
    """An editor with its server, which must end well."""
    with Editor(tmp_path_factory.mktemp("editor")) as made:
        yield made
        assert made.end() == 0


@pytest.fixture
def editor(started: Editor) -> Iterator[Editor]:
    """The editor with nothing open, before and after."""
    started.forget()
    yield started
    started.close_all()
    assert not any(started.diagnostics.values()), "closed files show nothing"
