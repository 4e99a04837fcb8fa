"""The checks of an experiment for which the engine's program is built and looked into."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from ic.meaning.checks.step_words import at_the_start
from ic.meaning.checks.steps import check_steps, usual_number
from ic.meaning.control.schedule import slowest_that_fits
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import Complaints
from met import models
from met.analysis.memo import AnalysisMemo
from met.diagnostic import Diagnostic, Label, Problem
from met.plan import Experiment, Formula, Quantity
from met.plan.columns import ends

if TYPE_CHECKING:
    from met.analysis.margin import Margin


MOST_CASES = 3
"""Largest number of cases that are examined: each takes some 25 ms."""


def check_beds(complaints: Complaints, experiment: Experiment, memo: AnalysisMemo) -> None:
    """Warn about each joint whose motor on a bed is unstable in the first case, or in one with an extreme value."""
    if not experiment.structure.substitutions or not experiment.cases.count:
        return
    from met.analysis.margin import margins
    from met.analysis.step_size import chosen_cases

    reported: set[str] = set()
    cases = chosen_cases(experiment)[:MOST_CASES]
    left = experiment.cases.count - len(cases)
    try:
        by_case = memo.answer("margins", experiment, lambda: margins(experiment, cases), cases)
    except Problem:  # reported where the program is built
        return
    for margin in (candidate for of_case in by_case for candidate in of_case):
        if not margin.stable and margin.joint not in reported:
            reported.add(margin.joint)
            where = f"reckoned with the arm as it stands {at_the_start(experiment, margin.case)}"
            where += f"; {left:,} of {experiment.cases.count:,} cases were not looked at" if left else ""
            complaints.pass_on(bed_warning(experiment, margin, where))


def bed_warning(experiment: Experiment, margin: Margin, where: str) -> Diagnostic:
    """The warning about a motor bed's loop whose motion grows. where: the pose and the case, in words"""
    from met.analysis.margin import remedy

    r = margin.least if margin.too_light else margin.together
    if margin.limit == 0.0 or r != r:
        ends = "stable with no arm" if r == r else "no number"
    else:
        ends = f"above {margin.lower:.3g}" if margin.too_light else f"up to {margin.limit:.3g}"
        ends = f"stable {ends}"
    message = (
        f"the loop of joint `{margin.joint}` on its bed is unstable with `{margin.law}` at {margin.rate_hz:.12g} Hz: "
        f"r = {r:.3g}, and it is {ends}"
    )
    place = experiment.structure.on_beds[margin.joint].place
    helps = (f"{remedy(margin)} may help", "`met margin` says it of all cases", where)
    return Diagnostic("D321", message, None if place is None else Label(place), (), helps, "warning")


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


SCALED = "scaled to ones on its diagonal"


def check_lumped(complaints: Complaints, experiment: Experiment, memo: AnalysisMemo) -> Experiment:
    """The experiment with a note on its mass matrix, where it has lumped links; reports a pose at which this is not
    positive definite.

    Of a sweep the first case is looked at, and those with extreme values.
    """
    structure, lumped = experiment.structure, [link for link in experiment.structure.links if link.lumped]
    if not lumped or not experiment.cases.count or not (structure.moving or structure.free):
        return experiment
    from met.analysis.mass_matrix import LEAST, definiteness
    from met.analysis.step_size import chosen_cases

    names, cases = ", ".join(link.name for link in lumped), chosen_cases(experiment)
    try:
        mass_matrix = memo.answer(f"mass matrix; {names}", experiment, lambda: definiteness(experiment, cases), cases)
    except Problem:  # reported where the program is built
        return experiment
    several, left = experiment.cases.count > 1, experiment.cases.count - len(cases)
    poses = f"{mass_matrix.poses:,} pose{'s' * (mass_matrix.poses > 1)}" + f" of {len(cases)} cases" * several
    if mass_matrix.least > LEAST:
        note = (
            f"lumped links: {names}; mass matrix positive definite at {poses}, "
            f"least eigenvalue {mass_matrix.least:.3g}, "
            + SCALED
            + f"; {left:,} of {experiment.cases.count:,} cases were not looked at" * (left > 0)
        )
        return replace(experiment, notes=(*experiment.notes, note))
    where = (
        "".join(
            f"{joint.name} = {q:.4g} m, "
            if joint.kind == "prismatic"
            else f"{joint.name} = {math.degrees(q):.4g} deg, "
            for joint, q in zip(structure.moving, mass_matrix.q, strict=True)
        )
        + f"case #{int(experiment.cases.table[mass_matrix.case])}, " * several
    )
    help = "no larger moment of inertia of one such link is enough: look at their masses and centres of mass too"
    if mass_matrix.remedy is not None:
        amount, link, moment = mass_matrix.remedy
        value = experiment.parameters[f"links.{link}.inertia.{moment}"].value
        help = (
            f"with {moment} of the inertia of `{link}` larger by {amount:.2g} kg*m^2"
            + (f", so {value + amount:.12g} kg*m^2," if isinstance(value, float) else "")
            + f" it is positive definite at the {poses} looked at"
        )
    first, *others = [
        Label(place, f"link `{link.name}`")
        for link in lumped
        if (place := experiment.parameters[f"links.{link.name}.inertia.xx"].origin.place or link.place)
    ]
    complaints.error(
        "D182",
        f"the mass matrix is not positive definite with the lumped link{'s' * bool(others)} "
        + " and ".join(f"`{link.name}`" for link in lumped),
        Label(first.place, f"{where}an eigenvalue is {mass_matrix.least:.3g}, {SCALED}".replace(", an", ": an")),
        also=others,
        help=[help, "is the set one that leaves the rotors to the motors? then the servos need their inertia"],
    )
    return experiment


def check_program(scope: Scope, experiment: Experiment, memo: AnalysisMemo) -> Experiment:
    """Check lumped links, stops, a balanced start, the integrator's steps and beds; the experiment with notes on its
    mass matrix and its steps."""
    experiment = check_lumped(scope.complaints, experiment, memo)
    check_stops(scope.complaints, experiment)
    check_balance(scope, experiment)
    experiment = check_steps(scope, experiment, memo)
    check_beds(scope.complaints, experiment, memo)
    return experiment
