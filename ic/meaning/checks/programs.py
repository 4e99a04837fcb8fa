"""The checks of an experiment for which the engine's program is built and looked into."""

from __future__ import annotations

from ic.meaning.checks.balance import check_balance
from ic.meaning.checks.beds import check_beds
from ic.meaning.checks.lumped import check_lumped
from ic.meaning.checks.steps import check_steps
from ic.meaning.checks.stops import check_stops
from ic.meaning.parameters.scope import Scope
from met.analysis.memo import AnalysisMemo
from met.plan import Experiment


def check_program(scope: Scope, experiment: Experiment, memo: AnalysisMemo) -> Experiment:
    """Check lumped links, stops, a balanced start, the integrator's steps and beds; the experiment with notes on its
    mass matrix and its steps."""
    experiment = check_lumped(scope.complaints, experiment, memo)
    check_stops(scope.complaints, experiment)
    check_balance(scope, experiment)
    experiment = check_steps(scope, experiment, memo)
    check_beds(scope.complaints, experiment, memo)
    return experiment
