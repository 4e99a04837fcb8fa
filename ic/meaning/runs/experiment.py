"""A resolved run and its cases as an experiment of a plan."""

from __future__ import annotations

import numpy as np

from ic.meaning.parameters.scope import Scope
from ic.meaning.runs.run import Resolved
from met.diagnostic import Place
from met.plan import Allowance, Cases, Experiment
from met.trace import Formulas, Scalar


def experiment(
    scope: Scope, name: str, place: Place, resolved: Resolved, cases: Cases, allowances: tuple[Allowance, ...] = ()
) -> Experiment:
    """The experiment of this name; `scope` holds the parameters of the run that was resolved."""
    parameters, outputs = scope.quantities()
    formulas = Formulas.of(scope.graph, outputs) if outputs else Formulas()
    notes = (*scope.notes, *_stability(scope, resolved, cases))
    return Experiment(
        name,
        resolved.structure,
        parameters,
        formulas,
        cases,
        resolved.requirements,
        place,
        notes,
        tolerances=resolved.tolerances,
        allowances=allowances,
        step_errors=resolved.step_errors,
        **resolved.settings,
    )


def _stability(scope: Scope, resolved: Resolved, cases: Cases) -> list[str]:
    """`h * lambda` of each joint, as a note: its value, or least and largest over the cases."""
    notes = []
    inputs = {coordinate.path: coordinate.values for coordinate in cases.coordinates}
    for joint, x in resolved.stability:
        if isinstance(x, Scalar):
            values = np.asarray(Formulas.of(scope.graph, [x]).replay(inputs)[0])
            ends = dict.fromkeys(f"{float(x):.3g}" for x in (values.min(), values.max())) if values.size else ["?"]
            shown = " to ".join(ends)
        else:
            shown = f"{float(x):.3g}"
        notes.append(f"stability of joint {joint}: h * lambda = {shown}")
    return notes
