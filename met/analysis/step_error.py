"""The error of a number due to the length of the step, from runs with the step, half and a quarter of it.

Richardson's extrapolation: where x(h) = x + c h^p, the differences d1 = x(h) - x(h/2) and d2 = x(h/2) - x(h/4) give p =
log2(d1/d2) and the error c h^p = d1 2^p/(2^p - 1). Where the observed p is not that of the integrator, nor that of a
number sampled once a step (1), the estimate is not valid; then three times the larger difference is a cautious bound,
as the grid convergence index has it for two grids (P. J. Roache, Journal of Fluids Engineering 116, 1994, 405-413).

Only the dynamics are refined. Servos, guides, sensors, beds, recorded rows and noise keep their instants in time, so
that an experiment and its refinement differ only in the error of integration, and in how often quantities that are
observed at each step are sampled.
"""

from __future__ import annotations

import math
from dataclasses import replace
from math import gcd

from met import models
from met.frozen import frozen
from met.plan import Experiment, GuideUse, ServoUse, Structure

NEAR = 0.3
"""Largest difference of an observed order from the expected one."""

ROUNDING = 1e-10
"""Differences below this share of the number are rounding, from which no order follows."""


@frozen
class StepError:
    """The error of one number due to the step.

    error  estimate of |x(h) - x(0)|, or a bound of it where the order is unclear, with what samples may miss; in the
           number's unit
    order  the observed power of the step; not a number where differences are of rounding, or not finite
    clear  True where the order is the expected one, or all differences are of rounding
    """

    error: float
    order: float
    clear: bool

    def step_for(self, h: float, tolerance: float) -> float:
        """The step (s) at which the error would be this tolerance, where it is estimated at the step h (s)."""
        if self.error <= tolerance:
            return h
        order = self.order if self.clear and not math.isnan(self.order) else 1.0
        return h * (tolerance / self.error) ** (1.0 / order)


def step_error(first: float, second: float, scale: float, expected: int, missed: float = 0.0) -> StepError:
    """The error of a number at the step h.

    first     |x(h) - x(h/2)|, of numbers in time its largest over time
    second    |x(h/2) - x(h/4)|
    scale     size of the number, |x|
    expected  order of the integrator
    missed    how far x(h/4) may be off by what lies between samples (met/metrics/metric.py). Where an extreme is the
              same sample with all three steps, their differences show nothing of it
    """
    if not (math.isfinite(first) and math.isfinite(second)):
        return StepError(math.inf, math.nan, False)
    if max(first, second) <= ROUNDING * scale:
        return StepError(max(first, second) + missed, math.nan, True)
    if first <= 0.0 or second <= 0.0:
        return StepError(3.0 * max(first, second) + missed, math.nan, False)
    order = math.log2(first / second)
    if any(abs(order - p) <= NEAR for p in {1, expected}):
        return StepError(first * 2.0**order / (2.0**order - 1.0) + missed, order, True)
    return StepError(3.0 * max(first, second) + missed, order, False)


def instant_error(first: float, second: float, both: float, instant: float) -> StepError:
    """The error at the step h of an instant that is seen at whole steps alone, such as a settling time: a bound.

    With a quarter of the step it is known to `instant`, a quarter of h, and to the error of that run's integration,
    which is below its difference from the run with half the step where the error falls at all. Such differences are
    whole steps, so no order follows from them; they are clear where they do not grow by more than their resolution.

    first    |x(h) - x(h/2)|, s
    second   |x(h/2) - x(h/4)|, s
    both     |x(h) - x(h/4)|, s
    instant  h/4, s
    """
    if not all(map(math.isfinite, (first, second, both))):
        return StepError(math.inf, math.nan, False)
    return StepError(both + second + instant, math.nan, second <= first + 2.0 * instant * (1.0 + ROUNDING))


def refine(experiment: Experiment, factor: int) -> Experiment:
    """The same experiment with `factor` steps of the dynamics in the place of each one.

    Where a step has too few base ticks to be parted, the base rate becomes a multiple of it. Raises ValueError where
    factor is below 1.
    """
    if factor < 1:
        raise ValueError(f"a step cannot be parted in {factor}")
    return replace(experiment, structure=_refine(experiment.structure, factor))


def _refine(structure: Structure, factor: int) -> Structure:
    """The structure with steps of the dynamics that are `factor` times shorter. All else keeps its instants in time."""
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
