"""Numbers, sizes, columns and prefixes, as commands print them."""

from __future__ import annotations

import pytest

from ic.printing.cases import prefixes
from ic.printing.columns import columns, number, size


@pytest.mark.parametrize(
    ("value", "text"), [(0.1 + 0.2, "0.3"), (-0.0, "0"), (1e-5, "1e-05"), (1570.0, "1570"), (1 / 3, "0.333333")]
)
def test_a_number_is_shown_without_its_last_binary_digits(value: float, text: str) -> None:
    assert number(value) == text


@pytest.mark.parametrize(
    ("count", "text"),
    [(0, "0 B"), (999, "999 B"), (11_256, "11.0 KiB"), (999_600, "976 KiB"), (1_234_567_890, "1.1 GiB")],
)
def test_a_size_is_in_the_units_that_a_run_counts_in(count: int, text: str) -> None:
    assert size(count) == text


def test_columns_are_as_wide_as_what_a_terminal_shows() -> None:
    assert columns([("a", "1"), ("重い", "22")], right=(1,)) == ["  a      1", "  重い  22"]


def test_prefixes_are_the_shortest_of_one_length_that_tell_names_apart() -> None:
    assert prefixes(["8f3a11", "8f3a22", "1c8100"]) == ["8f3a1", "8f3a2", "1c810"]
    assert prefixes(["8f3a11", "1c8100"]) == ["8f3a", "1c81"]
    assert prefixes(["8f3a11"]) == ["8f3a"]
