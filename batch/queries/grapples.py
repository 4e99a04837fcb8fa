"""Grapples in an archive that a gripper could not make: the payload is not at its place, or moves or turns too fast."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from batch.queries.signals import number_text
from ic.meaning.checks.reach import flies_from_afar
from met.diagnostic import Diagnostic, Label
from met.plan.outputs import GRAPPLE_FIGURES

if TYPE_CHECKING:
    from batch.archive.read import ArchiveGroup
    from met.plan import Experiment

FAST, TURNING = 1.0, 10.0
"""m/s and rad/s: at these rates a payload moves 0.1 m, or turns by a radian, in the tenth of a second that a gripper
needs to close."""


def warnings(group: ArchiveGroup, experiment: Experiment | None = None) -> list[Diagnostic]:
    """The warning about grapples of an experiment, if there is one: about the worst, with the other payloads by name.

    experiment  of the plan, for places; what the check tells of it is not told again
    """
    figures: dict[str, dict[str, np.ndarray]] = {}
    for variable in group.role("grapple"):
        grappled, name = (str(variable.attributes.get(attribute)) for attribute in ("of", "figure"))
        figures.setdefault(grappled, {})[name] = group.values(variable.name)
    bad = {}
    for payload, payload_figures in figures.items():
        if set(payload_figures) != set(GRAPPLE_FIGURES) or (
            experiment is not None and flies_from_afar(experiment, payload)
        ):
            continue
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = [
                payload_figures["distance"] / payload_figures["near"],
                payload_figures["speed"] / FAST,
                payload_figures["rate"] / TURNING,
            ]
        worst = np.nan_to_num(np.max(ratios, axis=0), posinf=np.finfo(float).max)
        if (worst > 1.0).any():
            bad[payload] = worst
    if not bad or group.allows("D347"):
        return []
    payload = max(bad, key=lambda candidate: float(bad[candidate].max()))
    row, cases = int(bad[payload].argmax()), int((bad[payload] > 1.0).sum())
    distance, near, speed, rate, energy = (float(figures[payload][name][row]) for name in GRAPPLE_FIGURES)
    how, helps = [], []
    if distance > near:
        how.append(f"{number_text(distance)} m from its place")
        helps.append(
            "let it be there by then: change its `position`, `velocity` or `grapple`, or the arm's motion; "
            f"`payloads.{payload}.distance` is how far it is"
        )
    motion = [(speed, FAST, "m/s"), (rate, TURNING, "rad/s")]
    against = [f"{number_text(value)} {unit}" for value, most, unit in motion if value > most]
    if against:
        how.append(f"at {' and '.join(against)} against its link")
        helps.append("let the link go along with it by then: no gripper closes on what moves so fast")
    many = f", in {cases:,} of {group.count:,} cases, worst in #{group.values('case')[row]}"
    if len(bad) > 1:
        helps.append(f"also grappled so: {', '.join(f'`{other}`' for other in bad if other != payload)}")
    grapple = None if experiment is None else experiment.parameters.get(f"payloads.{payload}.grapple")
    place = None if grapple is None else grapple.origin.place
    message = (
        f"payload `{payload}` is grappled {', '.join(how)}{many if group.count > 1 else ''}: momentum is kept, and "
        f"{number_text(energy)} J are lost at once"
    )
    return [Diagnostic("D347", message, None if place is None else Label(place), (), tuple(helps), "warning")]
