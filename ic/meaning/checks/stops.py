"""Warnings about steps that are too long for stops that joints may run into, and for contacts of bodies."""

from __future__ import annotations

import math

from ic.meaning.control.schedule import slowest_that_fits
from ic.text.complaints import Complaints
from met import models
from met.diagnostic import Label
from met.plan import Experiment, Formula, Quantity
from met.plan.columns import ends

ENOUGH = {1: 10.0, 2: 10.0}
"""Number of steps in a contact, by the integrator's order, with which it gains or loses at most 3 % of the energy."""

FEW = 4.0
"""The number of steps for higher orders, with at most 2 %."""


def check_stops(complaints: Complaints, experiment: Experiment) -> None:
    """Warn about stops so stiff that a contact takes few steps, and creates energy."""
    structure = experiment.structure
    uses = {use.name: use for use in structure.environment if models.find("environment", use.model).springs}
    if not uses or not experiment.cases.count:
        return
    from met.analysis.contact import contacts

    integrator = models.find("integrator", structure.integrator)
    enough = ENOUGH.get(integrator.order, FEW)
    with complaints.gather():
        paths = [
            (name, f"environment.{name}.{part}")
            for name, use in uses.items()
            for part in models.find("environment", use.model).springs[1:]
        ]
        stiffness = {name: experiment.parameters[path] for name, path in paths if path in experiment.parameters}
        stiffest = {name: _stiffest(experiment, quantity) for name, quantity in stiffness.items()}
        by_case = {case: contacts(experiment, case) for case in set(stiffest.values())}
        for contact in (
            contact for name, case in stiffest.items() for contact in by_case[case] if contact.stop == name
        ):
            if not contact.steps < enough:
                continue
            place = stiffness[contact.stop].origin.place or uses[contact.stop].place
            times = enough / contact.steps if contact.steps > 0.0 else math.inf
            rate = times * structure.schedule.base_hz / structure.schedule.dynamics
            fits = "no rate is so high: make it softer"
            if math.isfinite(rate):
                least = slowest_that_fits(structure.schedule, _AT_MOST)(rate)
                fits = f"quicken the dynamics to {least}, or make it softer"
            complaints.remark(
                "D295",
                f"`{contact.stop}` is stiff for the dynamics' step: "
                f"{contact.body} touches it for {contact.steps:.2g} steps",
                Label(place, f"h = {structure.schedule.step:g} s") if place else place,
                help=[
                    f"with {integrator.name} a contact of fewer than {enough:g} steps gives energy that nobody put in",
                    f"{fits}: it feels {contact.inertia:.3g} {contact.unit} at the start",
                ],
            )


_AT_MOST = math.nextafter(1.0, 2.0)
"""The bound of a step times the required rate, exclusive, so that 1 itself is enough."""


def _stiffest(experiment: Experiment, stiffness: Quantity) -> int:
    """The first case in which the stiffness is largest."""
    if not isinstance(stiffness.value, Formula):
        return 0
    return ends(experiment.column(stiffness.value))[1]
