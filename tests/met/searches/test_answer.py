"""The answer of a search says which of its parameters stand at an end of their range."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from met.plan.searches import Search, SearchedParameter
from met.searches.answer import answer


@pytest.mark.parametrize(
    ("low", "high", "inside"),
    [(0.01, 1.0, 0.1), (1e-300, 1e300, 1.0), (-1e300, -1e-300, -1.0), (1e-300, 1e-290, 1e-295)],
)
def test_ends_of_equal_ratios_are_told_however_far_apart(low: float, high: float, inside: float) -> None:
    search = Search("search", "effort", True, (SearchedParameter("kp", low, high, logarithmic=True),), 1)
    for value, ends in ((low, (("kp", "lower"),)), (inside, ()), (high, (("kp", "upper"),))):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = answer(search, np.array([[value]]), np.array([True]), {"effort": np.array([2.0])}, [])
        assert found.ends == ends
