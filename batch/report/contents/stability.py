"""Stability of the motors on beds in the plan that was run: r of the cases, and its limits."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from batch.queries.pool import CaseColumn, Pool, ranges
from batch.queries.stability_words import stable_at, verdict
from batch.report.contents.parts import BedStability, Stability
from met.analysis.margin import Margin, margins
from met.distinct import distinct
from met.plan import Experiment

MOST_CASES = 60
"""Largest number of cases whose margin is computed, spread over all, including the worst."""

MOST_LOOPS = 6
"""Largest number of different combinations of servo, bed and law: each takes seconds."""


def stability(
    pool: Pool, experiments: Mapping[str, Experiment], progress: Callable[[int], None] | None = None
) -> Stability | None:
    """The stability of the motor beds in a sweep, over all structures that have one; None where none has."""
    margins_of: dict[int, tuple[Margin, ...]] = {}
    left = 0
    for number, group in enumerate(pool.groups):
        experiment = experiments.get(group.name)
        if experiment is None or not experiment.structure.substitutions:
            continue
        places = np.flatnonzero(pool.group_of == number)
        chosen = _chosen(pool, experiment, places)
        left += len(places) - len(chosen)
        rows = np.searchsorted(experiment.cases.table, pool.cases[chosen]).tolist()
        margins_of |= dict(zip(chosen.tolist(), margins(experiment, rows, progress), strict=True))
    if not margins_of:
        return None
    places = np.array(sorted(margins_of))
    joints = list(dict.fromkeys(margin.joint for place in places.tolist() for margin in margins_of[place]))
    columns = [replace(c, values=c.values[places]) for c in pool.varied()]
    columns.append(CaseColumn("case", "case", "", "case", pool.cases[places].astype(float)))
    spans = any(margin.lower > 0.0 for case in margins_of.values() for margin in case)
    beds = tuple(
        _bed(joint, [_joint_margin(margins_of[place], joint) for place in places.tolist()], spans) for joint in joints
    )
    note = f"Computed for {len(places):,} of {len(places) + left:,} cases, spread over all." if left else ""
    return Stability(
        pool.cases[places], tuple(columns), beds, tuple(_unstable(pool, places, margins_of, joints)), spans, note
    )


def _chosen(pool: Pool, experiment: Experiment, places: np.ndarray) -> np.ndarray:
    """Places of the cases to examine: of few different loops, spread over all, including the worst."""
    own = tuple(
        f"{use.joint}.{part}." for use in experiment.structure.substitutions for part in ("servo", "bed", "law")
    )
    deciding = [c for c in experiment.cases.coordinates if any(path.startswith(own) for path in c.sets)]
    if deciding:
        rows = np.searchsorted(experiment.cases.table, pool.cases[places])
        loops = np.unique(np.stack([c.values[rows] for c in deciding], axis=1), axis=0, return_inverse=True)[1].ravel()
        count = int(loops.max(initial=0)) + 1
        examined = distinct(np.linspace(0, count - 1, min(count, MOST_LOOPS)).astype(int))
        places = places[np.isin(loops, examined)]
    if len(places) <= MOST_CASES:
        return places
    spread = places[np.linspace(0, len(places) - 1, MOST_CASES - 1).astype(int)]
    worst = pool.worst_first[np.isin(pool.worst_first, places)][:1]
    return distinct(np.concatenate([spread, worst]))


def _joint_margin(case: Sequence[Margin], joint: str) -> Margin | None:
    return next((margin for margin in case if margin.joint == joint), None)


def _bed(joint: str, margins_of_cases: Sequence[Margin | None], spans: bool) -> BedStability:
    """The stability of a joint's motor bed over the examined cases; None among these where the joint has no bed."""
    with_bed = [margin for margin in margins_of_cases if margin is not None]
    tightest = min(with_bed, key=lambda margin: margin.room)
    r = np.array([np.nan if margin is None else margin.together for margin in margins_of_cases])
    limit = np.array(
        [np.nan if margin is None or margin.limit is None else margin.limit for margin in margins_of_cases]
    )
    lower = np.array([np.nan if margin is None or margin.lower == 0.0 else margin.lower for margin in margins_of_cases])
    unstable = np.array([margin is not None and not margin.stable for margin in margins_of_cases])
    known = r[np.isfinite(r)]
    spread = "-" if not len(known) else f"{known.min():.3g}"
    if len(known) and f"{known.max():.3g}" != spread:
        spread += f" to {known.max():.3g}"
    return BedStability(
        joint,
        _words(margin.law for margin in with_bed),
        _words(f"{margin.rate_hz:g} Hz" for margin in with_bed),
        _words(f"{margin.delay:g}" for margin in with_bed),
        r,
        lower,
        limit,
        unstable,
        spread,
        stable_at(tightest, spans),
        verdict(tightest, "none"),
        not unstable.any(),
    )


def _words(texts: Iterable[str]) -> str:
    return ", ".join(dict.fromkeys(texts))


def _unstable(
    pool: Pool, places: np.ndarray, margins_of: Mapping[int, Sequence[Margin]], joints: Sequence[str]
) -> Iterator[str]:
    """The cases in which each joint is not stable, in words."""
    for joint in joints:
        margin_of_case = [(place, _joint_margin(margins_of[place], joint)) for place in places.tolist()]
        bad = [int(pool.cases[place]) for place, margin in margin_of_case if margin is not None and not margin.stable]
        if bad:
            yield f"{joint}: not stable in {len(bad):,} of {len(margin_of_case):,} cases: {ranges(bad)}"
