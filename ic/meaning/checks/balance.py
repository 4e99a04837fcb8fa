"""Errors of runs that should begin balanced with servos that cannot hold their joints."""

from __future__ import annotations

from ic.meaning.checks.usual import usual_number
from ic.meaning.parameters.scope import Scope
from met.diagnostic import Label
from met.plan import Experiment, Formula


def check_balance(scope: Scope, experiment: Experiment) -> None:
    """Report servos that are too weak to hold their joints at a balanced start.

    Where a sweep varies numbers, each case is judged when it is run, and fails.
    """
    if not experiment.structure.balanced or any(isinstance(q.value, Formula) for q in experiment.parameters.values()):
        return
    from met.analysis.balance import unheld_at_start

    weak = unheld_at_start(experiment)
    blamed = usual_number(scope, experiment, lambda changed: not unheld_at_start(changed)) if weak else []
    with scope.complaints.gather():
        for unheld_joint in weak:
            unloaded = "or let the servos begin unloaded: without `servos = balanced` the arm sinks in"
            limits = [
                experiment.parameters[f"{unheld_joint.joint.name}.servo.{name}"] for name, _ in unheld_joint.limits
            ]
            places = [quantity.origin.place for quantity in limits if quantity.origin.place is not None]
            use = unheld_joint.servo.place
            scope.complaints.error(
                "D343",
                f"joint `{unheld_joint.joint.name}` cannot begin balanced: "
                f"it takes {unheld_joint.wanted:.3g} {unheld_joint.unit}, and its servo can hold "
                f"{unheld_joint.holdable:.3g} {unheld_joint.unit}",
                places[0] if places else use,
                also=[Label(use, f"drives joint `{unheld_joint.joint.name}`")] if places and use is not None else [],
                help=[*blamed, unheld_joint.reason, unloaded],
            )
