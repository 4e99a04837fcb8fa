"""Errors of lumped links, whose numbers need be no body's, with which no mass matrix is positive definite."""

from __future__ import annotations

import math
from dataclasses import replace

from ic.text.complaints import Complaints
from met.analysis.memo import AnalysisMemo
from met.diagnostic import Label, Problem
from met.plan import Experiment

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
