"""Errors of runs that should begin balanced with servos that cannot hold their joints."""

from __future__ import annotations

from ic.text.complaints import Complaints
from met.diagnostic import Label
from met.plan import Experiment, Formula


def check_balance(complaints: Complaints, experiment: Experiment) -> None:
    """Report servos that are too weak to hold their joints at a balanced start.

    Where a sweep varies numbers, each case is judged when it is run, and fails.
    """
    if not experiment.structure.balanced or any(isinstance(q.value, Formula) for q in experiment.parameters.values()):
        return
    from met.analysis.balance import unheld_at_start

    with complaints.gather():
        for each in unheld_at_start(experiment):
            help = [each.reason, "or let the servos begin unloaded: without `servos = balanced` the arm sinks in"]
            limits = [experiment.parameters[f"{each.joint.name}.servo.{name}"] for name, _ in each.limits]
            places = [quantity.origin.place for quantity in limits if quantity.origin.place is not None]
            use = each.servo.place
            complaints.error(
                "D343",
                f"joint `{each.joint.name}` cannot begin balanced: it takes {each.wanted:.3g} {each.unit}, and its "
                f"servo can hold {each.there:.3g} {each.unit}",
                places[0] if places else use,
                also=[Label(use, f"drives joint `{each.joint.name}`")] if places and use is not None else [],
                help=help,
            )
