"""A search asks for each case once, within its number of cases, whatever the optimiser asks for."""

from __future__ import annotations

import numpy as np
import pytest

from met import optimisers
from met.plan.searches import Search, SearchedParameter
from met.searches import search_method
from met.searches.robust import HardestCase


def search(at_most: int = 300, **ends: float) -> Search:
    parameters = (
        SearchedParameter("links.bar.mass", 2.0, 4.0, unit="kg"),
        SearchedParameter("gearbox.kp", 1e-3, 10.0, logarithmic=True, unit="V*s/rad"),
    )
    return Search("search", "effort", True, parameters, at_most, seed=2)


def test_the_least_value_of_a_smooth_hollow_is_found() -> None:
    of, cases, values = HardestCase(search()), [], []
    while len(asked := of.ask()):
        worth = (asked[:, 0] - 2.7) ** 2 + np.log10(asked[:, 1] / 0.05) ** 2
        cases.append(asked)
        values.append(worth)
        of.tell(worth)
    table = np.concatenate(cases)
    assert table[np.argmin(np.concatenate(values))] == pytest.approx([2.7, 0.05], rel=0.02)
    assert len(table) <= 300 and len(np.unique(table, axis=0)) == len(table)
    assert (table.min(axis=0) >= [2.0, 1e-3]).all() and (table.max(axis=0) <= [4.0, 10.0]).all()


def test_values_are_rounded_to_what_a_deck_can_say() -> None:
    for kg, kp in HardestCase(search()).ask().tolist():
        assert float(f"{kg:.12g}") == kg and float(f"{kp:.12g}") == kp


class Repeats:
    """An optimiser that asks for the same points again and again, then for one more."""

    def __init__(self) -> None:
        self.told: list[list[float]] = []

    def ask(self) -> np.ndarray:
        middle, end = [[0.5, 0.5], [0.5, 0.5], [0.0, 1.0]], [[0.25, 0.25]]
        return np.array([middle, middle, middle, [*middle, *end], np.empty((0, 2))][len(self.told)])

    def tell(self, values: np.ndarray) -> None:
        self.told.append(values.tolist())


def test_a_point_that_was_tried_is_worth_what_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    optimiser = Repeats()
    monkeypatch.setattr(optimisers, "hardest", lambda *_: optimiser)
    of = search_method(search())
    first = of.ask()
    assert len(first) == 2 and not (first[0] == first[1]).all()
    of.tell(np.array([3.0, -1.0]))
    second = of.ask()
    assert second.tolist() == [[2.5, pytest.approx(1e-2)]]
    of.tell(np.array([7.0]))
    assert not len(of.ask())
    assert optimiser.told == [[3.0, 3.0, -1.0]] * 3 + [[3.0, 3.0, -1.0, 7.0]]


@pytest.mark.parametrize("at_most", [1, 3, 40])
def test_it_never_asks_for_more_than_it_may(at_most: int) -> None:
    of, count = HardestCase(search(at_most)), 0
    while len(asked := of.ask()):
        count += len(asked)
        of.tell(asked.sum(axis=1))
    assert 0 < count <= at_most
