"""The group `summary-of-cases` of an experiment of whose cases the archive has few rows: the results of all of them.

    cause               why cases failed, or are doubtful, numbers aside; a dimension. cause_status: how they ended, -1
                        doubtful; cause_cases: how many; cause_first: the first, by position in the case table
    summed_metric       names of the metrics' variables; a dimension. finite, infinite, unknown: cases with such a
                        value; mean, variance of the finite ones, SI; least, most: of these, in the cases least_case and
                        most_case
    point               design points, in the order in which they first appear; a dimension
    chosen              coordinates that are chosen and not drawn; a dimension. chosen_value (point, chosen), SI
    judged              rows, one for each requirement of all cases, and of one over a share of cases one more for each
                        design point; a dimension. judged_requirement, judged_point (-1: all cases), judged_cases; of
                        these judged_missed, and judged_unknown with judged_no_value among those that reached their end;
                        judged_worst_case, its value judged_worst; mean and deviation of the metric; judged_bound, the
                        order statistic that bounds the percentile, not-a-number where there is none
    attributes          `cases`, all of them; `limited`, those with a bed's motor at its limit; `rows`, as asked for;
                        `drawn`, whether something was drawn at random

A name with `-` is none that a deck can give. Every case that is named here has its row in the archive.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from batch.archive import stored
from batch.archive.hdf5 import h5py
from batch.archive.sound import MOST, are_cases
from batch.archive.stored import COUNT, NUMBER, WORDS, StoredGroup, Unlike
from met.frozen import frozen
from met.run import LOST

NAME = "summary-of-cases"

DOUBTFUL = -1
"""The status of a cause that makes finished cases doubtful."""

VARIABLES: stored.Declared = {
    "cause": (("cause",), WORDS, "why cases failed or are doubtful"),
    "cause_status": (("cause",), COUNT, "how they ended; -1: doubtful"),
    "cause_cases": (("cause",), COUNT, "cases of this cause"),
    "cause_first": (("cause",), COUNT, "the first of them, by position in the case table"),
    "summed_metric": (("summed_metric",), WORDS, "metrics"),
    "finite": (("summed_metric",), COUNT, "cases with a finite value"),
    "infinite": (("summed_metric",), COUNT, "cases with an infinite one"),
    "unknown": (("summed_metric",), COUNT, "cases without a value"),
    "mean": (("summed_metric",), NUMBER, "mean of the finite values, SI"),
    "variance": (("summed_metric",), NUMBER, "their variance, SI squared"),
    "least": (("summed_metric",), NUMBER, "the least of them, SI"),
    "most": (("summed_metric",), NUMBER, "the largest of them, SI"),
    "least_case": (("summed_metric",), COUNT, "the case of the least, by position in the case table; -1: none"),
    "most_case": (("summed_metric",), COUNT, "the case of the largest"),
    "point": (("point",), COUNT, "design points"),
    "chosen": (("chosen",), WORDS, "coordinates that are chosen"),
    "chosen_value": (("point", "chosen"), NUMBER, "their values at the design points, SI"),
    "judged": (("judged",), COUNT, "requirements at design points"),
    "judged_requirement": (("judged",), COUNT, "place of the requirement"),
    "judged_point": (("judged",), COUNT, "the design point; -1: all cases"),
    "judged_cases": (("judged",), COUNT, "cases there"),
    "judged_missed": (("judged",), COUNT, "cases that miss it"),
    "judged_unknown": (("judged",), COUNT, "cases that failed or have no value"),
    "judged_no_value": (("judged",), COUNT, "of these, those that reached their end"),
    "judged_worst_case": (("judged",), COUNT, "the case nearest to the limit or furthest beyond it"),
    "judged_worst": (("judged",), NUMBER, "its value, SI"),
    "judged_mean": (("judged",), NUMBER, "mean of the finite values, SI"),
    "judged_deviation": (("judged",), NUMBER, "their standard deviation, SI"),
    "judged_bound": (("judged",), NUMBER, "bound of the percentile, an order statistic, SI"),
}
"""Dimensions, type and meaning of each variable."""

COUNTS = ("finite", "infinite", "unknown", "cause_cases", "judged_cases", "judged_missed", "judged_unknown",
          "judged_no_value")  # fmt: skip
"""Variables that are numbers of cases."""

ROUNDING = 1e-9
"""A mean may lie outside the extremes by this share of the larger one."""


@frozen
class CaseSummary:
    """Counts, moments and extremes of all cases of an experiment. values: arrays by `VARIABLES`; other fields:
    attributes"""

    cases: int
    limited: int
    rows: str
    drawn: bool
    values: dict[str, np.ndarray]

    def judged(self, requirement: int, *, whole: bool) -> list[dict[str, Any]]:
        """The rows of a requirement, for all cases or for its design points, as plain numbers by names without
        `judged_`."""
        values = self.values
        rows_wanted = (values["judged_requirement"] == requirement) & ((values["judged_point"] < 0) == whole)
        return [
            {name.removeprefix("judged_"): values[name][row].item() for name in VARIABLES if name.startswith("judged_")}
            for row in np.flatnonzero(rows_wanted)
        ]


def write(parent: Any, summary: CaseSummary) -> None:
    """Write the group into an experiment's group of an open file."""
    node = parent.create_group(NAME, track_order=True)
    node.attrs["cases"], node.attrs["limited"] = summary.cases, summary.limited
    node.attrs["rows"], node.attrs["drawn"] = summary.rows, summary.drawn
    stored.write(node, VARIABLES, summary.values)


def read(node: Any, group: StoredGroup) -> CaseSummary | None:
    """The summary of an experiment's group, checked; None where the archive has a row for each case. Raises Unlike."""
    inside = node.get(NAME)
    if inside is None:
        return None
    if not isinstance(inside, h5py().Group):
        raise Unlike(f"`{NAME}` is no group")
    values = stored.read(inside, VARIABLES, NAME)
    cases, limited, rows, drawn = (inside.attrs.get(name) for name in ("cases", "limited", "rows", "drawn"))
    if not isinstance(cases, np.integer) or not 0 < cases < MOST:
        raise Unlike(f"attribute `cases` of `{NAME}` is missing or of another type")
    if not isinstance(limited, np.integer) or not 0 <= limited <= cases or not isinstance(rows, str):
        raise Unlike(f"attribute `limited` or `rows` of `{NAME}` is missing or of another type")
    if not isinstance(drawn, np.bool_):
        raise Unlike(f"attribute `drawn` of `{NAME}` is missing or of another type")
    summary = CaseSummary(int(cases), int(limited), rows, bool(drawn), values)
    _check(summary, group)
    return summary


def _check(summary: CaseSummary, group: StoredGroup) -> None:
    """Check that counts are those of its cases, and that names and places exist in the group. Raises Unlike."""
    values = summary.values
    for name in COUNTS:
        _within(name, values[name], 0, summary.cases)
    none = values["finite"] == 0
    for name in ("cause_first", "judged_worst_case", "least_case", "most_case"):
        some = values[name][~none] if name in ("least_case", "most_case") else values[name]
        if not are_cases(group, some).all():
            raise Unlike(f"variable `{NAME}/{name}` names a case that it does not have")
    _within("cause_status", values["cause_status"], DOUBTFUL, LOST)
    for name in ("point", "judged"):
        _need(name, values[name] == np.arange(len(values[name])))
    for name, role in (("summed_metric", "metric"), ("chosen", "coordinate")):
        if not {variable.name for variable in group.role(role)}.issuperset(values[name].tolist()):
            raise Unlike(f"variable `{NAME}/{name}` names what it does not have")
    doubtful = values["cause_status"] == DOUBTFUL
    for some in (doubtful, ~doubtful):
        _need("cause_cases", values["cause_cases"][some].sum() <= summary.cases)
    overflows = _check_metrics(summary)
    _check_judged(summary, group, overflows=overflows)


def _check_metrics(summary: CaseSummary) -> bool:
    """Check that the counts of each metric include every case, and that its moments match its extremes; True where
    values are so far apart that their moments overflow. Raises Unlike."""
    values = summary.values
    finite, least, most = values["finite"], values["least"], values["most"]
    _need("finite", finite + values["infinite"] + values["unknown"] == summary.cases)
    some = finite > 0
    for name in ("least", "most", "mean", "variance"):
        _need(name, np.isnan(values[name][finite < (2 if name == "variance" else 1)]))
    for name in ("least", "most"):
        _need(name, np.isfinite(values[name][some]))
    _need("least", least[some] <= most[some])
    with np.errstate(over="ignore"):
        span, near = most - least, ROUNDING * np.maximum(np.abs(least), np.abs(most))
        sums, squares = (np.isfinite(power * summary.cases) for power in (span, span * (span * summary.cases)))
        _need("mean", ((least - near <= values["mean"]) & (values["mean"] <= most + near))[some & sums])
        _need("variance", ((values["variance"] >= 0.0) & (values["variance"] <= span * span))[(finite > 1) & squares])
    _need("variance", ~(values["variance"] < 0.0))
    return not squares[some].all()


def _check_judged(summary: CaseSummary, group: StoredGroup, *, overflows: bool) -> None:
    """Check that each requirement has a row for all cases, and one over a share of cases also for each design point.
    Raises Unlike."""
    values = summary.values
    required = group.shape("requirement")[0] if "requirement" in group.variables else 0
    requirement_numbers, point_numbers, cases = (values[f"judged_{name}"] for name in ("requirement", "point", "cases"))
    _within("judged_requirement", requirement_numbers, 0, required - 1)
    _within("judged_point", point_numbers, -1, len(values["point"]) - 1)
    _within("judged_cases", cases, 1, summary.cases)
    _need("judged_missed", values["judged_missed"] + values["judged_unknown"] <= cases)
    _need("judged_no_value", values["judged_no_value"] <= values["judged_unknown"])
    _need("judged_deviation", ~(values["judged_deviation"] < 0.0))
    if not overflows:
        for name in ("judged_mean", "judged_deviation"):
            _need(name, ~np.isinf(values[name]))
    _need(
        "judged_point",
        len(set(zip(requirement_numbers.tolist(), point_numbers.tolist(), strict=True))) == len(requirement_numbers),
    )
    _need("judged_requirement", np.bincount(requirement_numbers[point_numbers < 0], minlength=required) == 1)
    _need("judged_cases", cases[point_numbers < 0] == summary.cases)
    if required:
        shares = np.atleast_1d(group.variables["requirement"].attributes.get("share", np.full(required, np.nan)))
        parts = [int(cases[(requirement_numbers == number) & (point_numbers >= 0)].sum()) for number in range(required)]
        _need("judged_cases", np.array(parts) == np.where(np.isnan(shares), 0, summary.cases))


def _need(name: str, sound: np.ndarray | bool) -> None:
    if not np.all(sound):
        raise Unlike(f"variable `{NAME}/{name}` has a value that it cannot have")


def _within(name: str, values: np.ndarray, low: int, high: int) -> None:
    _need(name, (values >= low) & (values <= high))
