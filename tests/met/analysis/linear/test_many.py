"""Jacobians of many cases at once, in machine code, are those of each case by itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.analysis.linear.jacobian import at_instant, period_map
from met.analysis.linear.many import PeriodJacobians
from met.analysis.linear.period import PeriodProgram
from met.diagnostic import Problem
from met.plan import Experiment
from tests.ic.small_decks import experiment
from tests.met.analysis.linear.oracles import shipped_experiment
from tests.met.analysis.linear.test_jacobian import swing
from tests.met.small_models import smallest


def agree(made: Experiment, rows: list[int], periods: list[int]) -> None:
    """The Jacobians of these cases and periods, and that the run itself has its bits."""
    program = PeriodProgram(made)
    many, compared = PeriodJacobians(program), 0
    for period in periods:
        found = many.at(rows, period)
        for row, A in zip(rows, found, strict=True):
            try:
                by_itself = period_map(program, at_instant(program, row, period * program.ticks))
            except Problem:  # an event on the way
                continue
            places = [program.states.index(name) for name in by_itself.states]
            size = np.abs(by_itself.A).max(axis=1, keepdims=True)
            assert np.all(np.abs(A[np.ix_(places, places)] - by_itself.A) <= 1e-12 * size)
            compared += 1
    assert compared > 0
    inputs, ticks = engine.inputs(made, np.array(rows)), (periods[-1] + 1) * program.ticks
    plain = program.prepared.kernel.run(inputs, ticks, record=False)[1]
    carried = many.kernel.run(inputs, ticks, record=False)[1]
    np.testing.assert_array_equal(carried[:, : plain.shape[1]], plain)


def test_of_a_law_that_ticks_every_fourth_step(tmp_path: Path) -> None:
    agree(swing(tmp_path), [0], [0, 1, 7])


@pytest.mark.parametrize("name", ["rigid_gearbox", pytest.param("compliant_gearbox", marks=pytest.mark.slow)])
def test_of_two_joints_whose_servos_tick_twice_a_step(name: str, tmp_path: Path) -> None:
    agree(experiment(tmp_path, smallest("servo", name).put(tmp_path).deck(), select=["cases"]), [0, 3], [1, 30])


def test_a_body_that_moves_freely_has_none() -> None:
    many = PeriodJacobians(PeriodProgram(shipped_experiment("free_flyer.ic", "flyer_drifting")))
    with pytest.raises(ValueError, match="moves freely"):
        many.at([0], 1)


@pytest.mark.slow
def test_of_seven_joints_with_their_servos() -> None:
    agree(shipped_experiment("panda.ic", "reach"), [0], [500, 1000])
