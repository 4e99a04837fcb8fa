"""Requirements with a confidence: checks that a sweep's cases are drawn suitably, and the number of cases needed."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ic.sweeps.axes import Sweep, SweepAxis
from ic.sweeps.reach import has_noise
from ic.text.complaints import Complaints
from met.diagnostic import Label
from met.plan import Experiment
from met.plan.columns import AxisColumn, blocks
from met.plan.judged import Requirement
from met.statistics import confidence, sequential
from met.statistics.design_points import design_points

OF_CASES = "cases for a confidence: "
"""The beginning of the notes on the number of cases."""


def check_confidences(complaints: Complaints, sweep: Sweep, experiment: Experiment) -> tuple[str, ...]:
    """Notes on how many cases each requirement with a confidence needs; reports those that no case could show.

    A confidence needs cases of which each is drawn at random, without regard to the others. A sweep that draws nothing
    has no share of cases: there each case is judged by itself.
    """
    wanted = [requirement for requirement in experiment.requirements if requirement.confidence is not None]
    drawn = [axis for axis in sweep.axes if axis.design]
    if sweep.early_axis is not None and not wanted:
        complaints.error(
            "D357",
            f"no requirement of `{experiment.name}` has a confidence, so nothing is to be shown",
            sweep.early_axis.until_shown,
            help=[
                "write one in the run: `require METRIC < LIMIT in 99 % of cases with 90 % confidence;`",
                "or draw a number of cases: `sample random(200) { ... }`",
            ],
        )
    if not wanted or (not drawn and sweep.repeated is None):
        return ()
    before = complaints.error_count
    for requirement in wanted:
        with complaints.gather():
            _check_draws(complaints, sweep, experiment, requirement, drawn)
    if complaints.error_count > before:
        return ()
    fewest = _fewest_of_a_point(experiment)
    if sweep.early_axis is not None:
        return _early_notes(complaints, wanted, fewest)
    return tuple(_note(complaints, requirement, fewest) for requirement in wanted)


def _check_draws(
    complaints: Complaints, sweep: Sweep, experiment: Experiment, requirement: Requirement, drawn: Sequence[SweepAxis]
) -> None:
    """Report samples whose cases are not drawn independently, as a confidence needs."""
    for axis in drawn:
        if axis.design != "random":
            complaints.error(
                "D351",
                f"`{axis.design}` does not draw cases each without regard to the others, which a confidence needs",
                requirement.place,
                also=[Label(axis.columns[0].place, f"drawn by `{axis.design}`")],
                help=[f"write `sample random({axis.size}) {{ ... }}`", "or leave `with ... confidence` out"],
            )
            return
    if len(drawn) > 1:
        complaints.error(
            "D351",
            "the cases of two samples share their draws with one another, and a confidence needs draws of their own",
            requirement.place,
            also=[Label(axis.columns[0].place, "a sample") for axis in drawn],
            help="draw all of it in one `sample random(N) { ... }`",
        )
    elif drawn and sweep.repeated is not None:
        complaints.error(
            "D351",
            "the repeats of a case share its draws, and a confidence needs draws of their own",
            requirement.place,
            also=[Label(sweep.repeated, "repeated")],
            help="leave `repeat` out and draw more cases: `seeds = independent;` gives each noise of its own",
        )
    elif sweep.independent is None and sweep.repeated is None and has_noise(experiment):
        complaints.error(
            "D351",
            "all cases feel the same noise, and a confidence needs draws of their own",
            requirement.place,
            help=f"write `seeds = independent;` in the sweep `{sweep.name}`",
        )


def _fewest_of_a_point(experiment: Experiment) -> int:
    """The number of cases of the smallest design point."""
    cases = experiment.cases
    chosen = [coordinate.values for coordinate in cases.coordinates if not coordinate.design]
    if not chosen:
        return cases.count
    if all(isinstance(values, AxisColumn) for values in chosen):
        return _fewest_of_a_choice([values for values in chosen if isinstance(values, AxisColumn)])
    return int(np.bincount(design_points([np.asarray(values) for values in chosen], cases.count)).min())


def _fewest_of_a_choice(chosen: Sequence[AxisColumn]) -> int:
    """The size of the smallest design point of a long table, whose values are compared by their axes: equal ones are
    one value of an axis."""
    rows, axes = chosen[0].rows, sorted({values.axis for values in chosen})
    counts = np.zeros(math.prod(rows.sizes[axis] for axis in axes), np.int64)
    for piece in blocks(rows.count):
        numbers, point = np.arange(piece.start, piece.stop), np.zeros(piece.stop - piece.start, np.int64)
        for axis in axes:
            point = point * rows.sizes[axis] + rows.index(axis, numbers)
        counts += np.bincount(point, minlength=len(counts))
    return int(counts[counts > 0].min())


def _note(complaints: Complaints, requirement: Requirement, fewest: int) -> str:
    """A line on the number of cases that a requirement with a confidence needs; warns where there are too few to show
    it (D352). fewest: cases of a design point."""
    assert requirement.share is not None and requirement.confidence is not None
    needed, more = (confidence.cases_needed(requirement.share, requirement.confidence, missed) for missed in (0, 1))
    if fewest < needed:
        complaints.remark(
            "D352",
            f"{fewest:,} cases cannot show this, were it met by all of them",
            requirement.place,
            help=f"draw {needed:,} cases or more for each design point; {more:,} show it where one misses it",
        )
    return (
        f"{OF_CASES}`{requirement.text}` needs {needed:,} if none misses it, {more:,} if one does; there are {fewest:,}"
    )


def _early_notes(complaints: Complaints, wanted: Sequence[Requirement], most: int) -> tuple[str, ...]:
    """The note of a sample that is run until all of these requirements are decided, of up to `most` cases for each
    design point."""
    fewest = 0
    for requirement in wanted:
        assert requirement.share is not None and requirement.confidence is not None
        needed, more = (sequential.cases_needed(requirement.share, requirement.confidence, missed) for missed in (0, 1))
        if most < needed:
            complaints.remark(
                "D352",
                f"{most:,} cases at most cannot show this, were it met by all of them",
                requirement.place,
                help=f"write `at_most = {needed}` or more; {more:,} show it where one misses it",
            )
        fewest = max(fewest, needed)
    stops = "stops at" if fewest <= most else "would stop at"
    return (f"{OF_CASES}{stops} {fewest:,} cases for each design point if none misses; at most {most:,}",)
