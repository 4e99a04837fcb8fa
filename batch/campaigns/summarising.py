"""The summary of very many cases in place of a row for each (`met run --rows`), and the choice of the few rows to
keep."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from batch.archive import layout as archive_layout
from batch.archive.summarised import CaseSummary
from batch.campaigns.keep import KeptRows
from batch.campaigns.outcomes import CaseOutcomes
from batch.campaigns.tasks import CampaignSection
from batch.campaigns.verification import choosing
from batch.queries.tallies import MOST_POINTS, CaseBlock, CaseTallies, PointNumbers, TooManyPoints
from met.diagnostic import Problem, error
from met.distinct import distinct
from met.frozen import frozen
from met.plan import Coordinate, Experiment
from met.plan.columns import CaseValues, blocks, span
from met.run import DONE, Run


@frozen
class Summarised:
    """The summary of an experiment's cases. places: of those whose rows are kept, rising; outcomes: of all cases."""

    summary: CaseSummary
    places: np.ndarray
    outcomes: CaseOutcomes


def point_sizes(experiment: Experiment, rows: CaseValues) -> list[int]:
    """The number of cases of each design point among some rows, in the order in which these first appear. Raises
    Problem E351 where there are too many."""
    chosen = _chosen(experiment)
    if not chosen:
        return [len(rows)]
    points, sizes = PointNumbers(), np.zeros(MOST_POINTS, np.int64)
    try:
        for piece in blocks(len(rows)):
            positions = np.asarray(rows[piece])
            numbers = points.of([np.asarray(coordinate.values[positions]) for coordinate in chosen], len(positions))
            sizes += np.bincount(numbers, minlength=len(sizes))
    except TooManyPoints:
        message = f"a summary has {MOST_POINTS:,} design points at most, and this sweep has more"
        raise Problem(error("E351", message, help="`--rows all` keeps a row a case; or choose fewer values")) from None
    return sizes[: len(points.values)].tolist()


def _chosen(experiment: Experiment) -> tuple[Coordinate, ...]:
    """The coordinates that distinguish design points: none where nothing is drawn, or nothing is chosen."""
    return (
        tuple(coordinate for coordinate in experiment.cases.coordinates if not coordinate.design)
        if _drawn(experiment)
        else ()
    )


def _drawn(experiment: Experiment) -> bool:
    """True where values are drawn at random: parameters of a sample, or noise of repeats."""
    repeats = experiment.cases.repeats
    return any(coordinate.design for coordinate in experiment.cases.coordinates) or (
        repeats is not None and span(repeats)[1] > 0
    )


def summarise(
    section: CampaignSection,
    runs: Iterator[tuple[int, Run]],
    wanted: KeptRows,
    *,
    verified: bool,
    progress: Callable[[int], None] = lambda _: None,
) -> Summarised:
    """The summary of all cases of a section. runs: their results in order, in blocks of one size, each with the place
    of its first case; verified: whether some are run with shorter steps, and need their rows. Raises Problem E351."""
    experiment = section.prepared.experiment
    layout = archive_layout.layout(experiment, 1, 0)
    named = {variable.key: variable.name for role in ("coordinate", "metric") for variable in layout.role(role)}
    chosen, points = _chosen(experiment), PointNumbers()
    tallies = CaseTallies(
        [use.name for use in experiment.metrics],
        experiment.requirements,
        point_sizes(experiment, section.rows),
    )
    outcomes = CaseOutcomes(experiment, {wanted.metric: wanted.worst} if wanted.worst else None)
    for first, run in runs:
        outcomes.add_run(run)
        rows = np.asarray(run.case)
        met = np.empty((len(rows), len(experiment.requirements)), np.int8)
        for number, requirement in enumerate(experiment.requirements):
            unknown = (run.status != DONE) | np.isnan(run.metrics[requirement.metric])
            met[:, number] = np.where(unknown, -1, run.met[requirement.text])
        tallies.add(
            CaseBlock(
                first + np.arange(len(rows)),
                run.status,
                run.cause,
                run.warning,
                run.metrics,
                met,
                points.of([np.asarray(coordinate.values[rows]) for coordinate in chosen], len(rows)),
                int(np.count_nonzero(run.limited)),
            )
        )
        progress(first + len(rows))
    kept_places = tallies.named()
    kept_places += outcomes.worst(wanted.metric).tolist() if wanted.worst else []
    kept_places += choosing.chosen(experiment, outcomes).tolist() if verified else []
    places = distinct(np.array(kept_places or [0], np.int64))  # an archive has a case
    values = tallies.values(
        lambda place: int(experiment.cases.table[section.rows[place]]),
        named,
        [named[coordinate.path] for coordinate in chosen],
        points,
    )
    summary = CaseSummary(len(section.rows), tallies.limited, wanted.word, _drawn(experiment), values)
    return Summarised(summary, places, outcomes)
