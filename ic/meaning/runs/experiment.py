"""A resolved run and its cases as an experiment of a plan."""

from __future__ import annotations

from ic.meaning.parameters.scope import Scope
from ic.meaning.runs.run import Resolved
from met.diagnostic import Place
from met.plan import Allowance, Cases, Experiment
from met.trace import Formulas


def experiment(
    scope: Scope, name: str, place: Place, resolved: Resolved, cases: Cases, allowances: tuple[Allowance, ...] = ()
) -> Experiment:
    """The experiment of this name; `scope` holds the parameters of the run that was resolved."""
    parameters, outputs = scope.quantities()
    formulas = Formulas.of(scope.graph, outputs) if outputs else Formulas()
    return Experiment(
        name,
        resolved.structure,
        parameters,
        formulas,
        cases,
        resolved.requirements,
        place,
        tuple(scope.notes),
        tolerances=resolved.tolerances,
        allowances=allowances,
        step_errors=resolved.step_errors,
        linear=resolved.linear,
        linear_metrics=resolved.linear_metrics,
        **resolved.settings,
    )
