"""Random edits of shipped decks in the real server, `python -m tests.ic.editor.fuzz`, for 20 s."""

from __future__ import annotations

import pytest

from tests.ic.editor.fuzz import fuzz


@pytest.mark.release
def test_after_any_edits_the_editor_shows_what_a_fresh_start_finds() -> None:
    edits, compared = fuzz(20, seed=3)
    assert edits > compared > 0
