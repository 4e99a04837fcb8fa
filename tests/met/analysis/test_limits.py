"""The step map's limit of stability is that of runs, and loops are warned of on the right side of theirs."""

from __future__ import annotations

import numpy as np
import pytest

from tests.met.analysis.limits import LOOPS, MODELS, errors, sides

WITHIN = 0.01
"""Share by which the two limits may differ: a mode that hardly grows is seen late among what else moves."""


@pytest.mark.release
@pytest.mark.parametrize("model", MODELS)
def test_the_step_maps_limit_is_that_of_runs(model: str) -> None:
    found = errors(model, 4, seed=7)
    assert np.isfinite(found).all() and np.abs(found).max() < WITHIN


@pytest.mark.release
@pytest.mark.parametrize("model", MODELS)
def test_of_a_hundred_machines_too(model: str) -> None:
    found = errors(model, 100)
    assert np.isfinite(found).all() and np.abs(found).max() < WITHIN


@pytest.mark.release
@pytest.mark.parametrize("count", [4, pytest.param(50, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", LOOPS)
def test_loops_are_warned_of_beyond_their_limit_and_not_before(name: str, count: int) -> None:
    assert sides(name, count) == (count, count, count)
