"""An experiment with a shorter step of the dynamics, for solution verification (NASA-STD-7009).

Only the dynamics are refined. Servos, guides, sensors, beds, recorded rows and noise keep their instants in time, so
that an experiment and its refinement differ only in the error of integration, and in how often quantities that are
observed at each step are sampled.
"""

from __future__ import annotations

from dataclasses import replace
from math import gcd

from met import models
from met.plan import Experiment, GuideUse, ServoUse, Structure


def refine(experiment: Experiment, factor: int) -> Experiment:
    """The same experiment with `factor` steps of the dynamics in the place of each one.

    Where a step has too few base ticks to be parted, the base rate becomes a multiple of it. Raises ValueError where
    factor is below 1.
    """
    if factor < 1:
        raise ValueError(f"a step cannot be parted in {factor}")
    return replace(experiment, structure=_refine(experiment.structure, factor))


def _refine(structure: Structure, factor: int) -> Structure:
    schedule = structure.schedule
    faster = factor // gcd(schedule.dynamics, factor)  # new base ticks in an old one
    step = schedule.dynamics * faster // factor

    def servo(use: ServoUse) -> ServoUse:
        ticks = not use.continuous and models.find("servo", use.model).control is not None
        return replace(use, divisor=use.divisor * faster if ticks else step)

    def guide(use: GuideUse) -> GuideUse:
        ticks = models.find("guide", use.model).steer is not None
        return replace(use, divisor=use.divisor * faster if ticks else step)

    return replace(
        structure,
        schedule=replace(
            schedule,
            base_hz=schedule.base_hz * faster,
            dynamics=step,
            record=schedule.record * faster,
            ticks=schedule.ticks * faster,
        ),
        servos=tuple(map(servo, structure.servos)),
        guides=tuple(map(guide, structure.guides)),
        sensors=tuple(replace(use, divisor=use.divisor * faster) for use in structure.sensors),
    )
