"""Warnings about steps that are too long for bodies that spin from the start: a free base, payloads."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ic.meaning.control.schedule import slowest_that_fits
from ic.meaning.definitions.merge import MergedBlock
from ic.meaning.parameters.models import value_place
from ic.meaning.parameters.owner import XYZ
from ic.meaning.parameters.scope import Scope
from met import models
from met.diagnostic import Label, Place
from met.plan import BASE, Structure

LOST_A_TURN = 0.01
"""Share of the energy of a tumbling body that a turn may lose or gain without a warning."""

FIRST, HIGHER = 1.6, 5.0
"""Error coefficients: an integrator of order p has an error of up to (h rate/HIGHER)^p of the energy of a body that
tumbles for each radian, and h rate/FIRST where p is 1: measured, of bodies whose centre of mass is as far from their
frame as they are large (docs/physics.md, section 3)."""


def check_spins(scope: Scope, block: MergedBlock, structure: Structure) -> None:
    """Warn about bodies that fly from the start, and turn too far in a step for the integrator."""
    integrator, schedule = models.find("integrator", structure.integrator), structure.schedule
    limit = (FIRST if integrator.order == 1 else HIGHER) * (LOST_A_TURN / (2.0 * math.pi)) ** (1.0 / integrator.order)
    for label, path, place in _spinning(block, structure):
        paths = tuple(f"{path}.{axis}" for axis in XYZ)
        settled = [setting.value for name in paths if (setting := scope.parameters.get(name)) is not None]

        def warn(rows: np.ndarray, label: str = label, place: Place = place) -> None:
            fastest = float(np.max(np.sqrt((rows * rows).sum(axis=1))))
            if schedule.step * fastest > limit:
                fits = slowest_that_fits(schedule, limit)(fastest)
                scope.complaints.remark(
                    "D300",
                    f"{label} turns by {schedule.step * fastest:.3g} rad in a step of the dynamics",
                    Label(place, f"h = {schedule.step:g} s"),
                    help=[
                        f"below {limit:.2g} rad a step a body that tumbles keeps its energy to {LOST_A_TURN:.0%} a "
                        f"turn with {integrator.name}: the slowest rate that fits is {fits}",
                        "a steady spin about a principal axis through the frame's origin needs less",
                    ],
                )

        if len(settled) == len(paths):
            scope.checks.observe(tuple(settled), warn, place, needs=paths)  # type: ignore[arg-type]


def _spinning(block: MergedBlock, structure: Structure) -> Iterator[tuple[str, str, Place]]:
    """Free bodies that spin from the start: in words, with the path and the place of their angular velocity."""
    if structure.base is not None and structure.free:
        initial = block.get("initial")
        written = initial.body.get(f"{BASE}.rate") if initial is not None and initial.body is not None else None
        place = value_place(written) if written is not None else structure.base.place
        assert place is not None  # a moving base comes from a deck
        yield "the base", f"initial.{BASE}.rate", place
    items = {item.name: item for item in block.of_kind("payload")}
    for payload in structure.payloads:
        if payload.grappled:
            item = items[payload.name]
            written = item.body.get("rate") if item.body is not None else None
            yield f"payload `{payload.name}`", f"payloads.{payload.name}.rate", value_place(written or item)
