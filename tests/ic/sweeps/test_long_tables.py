"""Long tables are looked at piece by piece, and what is said of them is what is said of them as a whole."""

from __future__ import annotations

from pathlib import Path

import pytest

import ic
from ic.meaning.expressions import conditions
from ic.sweeps import table
from met.diagnostic import Problem
from met.messages.render import render
from met.plan import columns

DECK = """
#include <two_link.ic>
run short like nominal {{ duration = 1 s; }}
sweep them of short {{
    vary links.upper.mass = linspace({low}, 60, 150) kg;
    vary gearbox.ki = linspace(0.1, 0.2, 120) V/rad;
    {more}
}}
"""
CLOSE = "exclude when gearbox.ki * 2 > 0.3 V/rad and links.upper.mass <= 50 kg;"


def said(folder: Path, low: float, more: str = "") -> str:
    """What is said of the deck, and the cases that are left."""
    deck = folder / "deck.ic"
    deck.write_text(DECK.format(low=low, more=more), encoding="utf-8")
    try:
        plan = ic.compile(deck, select=["them"])
    except Problem as problem:
        return render(problem.diagnostics)
    return f"{plan.experiments[0].cases.count} cases\n" + "\n".join(plan.experiments[0].notes)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("low", "more"),
    [
        (40, ""),
        (-1, ""),
        (40, CLOSE),
        (40, "exclude when sqrt(gearbox.ki - 0.15 V/rad) > 0.1 V^0.5/rad^0.5;"),
        (40, "exclude when sqrt(links.upper.mass - 50 kg) > 1 kg^0.5;"),
        (40, "exclude when links.upper.mass > 50 kg and gearbox.ki > 1 kg;"),
        (40, "exclude when links.upper.mass > 10 kg;"),
        (40, "exclude when links.upper.mass > 100 kg;"),
    ],
)
def test_what_is_said_in_pieces_is_what_is_said_of_all(
    low: float, more: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = said(tmp_path, low, more)
    monkeypatch.setattr(conditions, "WHOLE", 1000)
    monkeypatch.setattr(table, "PIECE", 512)
    monkeypatch.setattr(columns, "BLOCK", 1024)
    assert said(tmp_path, low, more) == whole


def test_a_mistake_in_a_long_table_names_its_first_case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(conditions, "WHOLE", 1000)
    text = said(tmp_path, -1)
    assert "case #0 breaks it, and 359 more" in text
