"""Answers at random places of shipped decks are what tree, plan and declaration say."""

from __future__ import annotations

import pytest

from tests.ic.editor.oracle import asked, shipped


def test_answers_at_random_places_of_two_decks_are_right() -> None:
    decks = [deck for deck in shipped() if deck.endswith(("two_link.ic", "free_flyer.ic"))]
    roles, wrong = asked(80, 24, decks)
    assert not wrong, wrong
    assert sum(roles.values()) == 80 and len(roles) > 15


@pytest.mark.slow
def test_answers_at_500_random_places_of_all_shipped_decks_are_right() -> None:
    roles, wrong = asked(500, 24, shipped())
    assert not wrong, wrong
    assert sum(roles.values()) == 500 and len(roles) > 30
