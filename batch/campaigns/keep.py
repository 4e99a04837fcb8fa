"""The choice of histories to keep, and the summary of very many cases in place of a row for each (`--rows`).

Cases that are chosen by place or name are recorded when they are run. Cases that failed, and the worst by a metric, are
known when all are done, and are run again for their histories, with the same bits.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from batch.archive import layout as archive_layout
from batch.archive.summarised import CaseSummary
from batch.archive.values import verdicts_of_cases
from batch.campaigns.outcomes import CaseOutcomes
from batch.campaigns.tasks import CampaignSection
from batch.campaigns.verification import verifying
from batch.queries.tallies import MOST_POINTS, CaseBlock, CaseTallies, PointNumbers, TooManyPoints
from met.diagnostic import Problem, error
from met.distinct import distinct
from met.frozen import frozen
from met.plan import Coordinate, Experiment
from met.plan.columns import CaseValues, are_among, blocks, places_among, span
from met.run import Run

SINGLE = ("default", "all", "none", "every", "failed", "worst")
WORDS = "default, all, none, every:N, failed, worst:N, worst:N:METRIC, or cases by '#7' or id"


ROW_WORDS = ("all", "summary", "worst")
ROWS_HELP = "rows are kept of: all, summary, worst:N, or worst:N:METRIC, N up to 100,000"

MOST_WORST = 100_000
"""Largest number of rows of the worst cases beside a summary."""


@frozen
class Keep:
    """The choice of cases whose histories are kept.

    default, everything   all while there is room, or whatever it takes;  every: of how many one
    cases    as users name them;  failed: those that failed;  worst: (how many, by which metric, "" for the first)
    """

    default: bool = False
    everything: bool = False
    every: tuple[int, ...] = ()
    cases: tuple[int | str, ...] = ()
    failed: bool = False
    worst: tuple[tuple[int, str], ...] = ()

    @property
    def later(self) -> bool:
        """True if a part of the choice depends on results."""
        return self.failed or bool(self.worst)

    def at_most(self, cases: int) -> int:
        """The most cases that may be chosen by results; no failures are expected."""
        return min(cases, sum(count for count, _ in self.worst))


@frozen
class KeptRows:
    """The cases of which an archive has rows: all, or those that its summary names and the `worst` by a `metric`.

    word  as it was asked for, `all`, `summary` or `worst:N:METRIC`
    """

    word: str = "all"
    worst: int = 0
    metric: str = ""

    @property
    def all(self) -> bool:
        return self.word == "all"


def kept_rows(word: str, experiments: Sequence[Experiment]) -> KeptRows:
    """Read the word of `--rows`. Raises Problem E351."""
    name, *rest = word.split(":")
    if word in ("all", "summary"):
        return KeptRows(word)
    if name == "worst" and 1 <= len(rest) <= 2 and rest[0].isdecimal() and 0 < int(rest[0]) <= MOST_WORST:
        metric = rest[1] if len(rest) == 2 else ""
        _check_metric(metric, experiments)
        first = experiments[0].metrics
        return KeptRows(word, int(rest[0]), metric or (first[0].name if first else ""))
    near = difflib.get_close_matches(name, ROW_WORDS, n=1)
    helps = [*(f"did you mean `{text}`?" for text in near if text != name), ROWS_HELP]
    raise Problem(error("E351", f"rows `{word}` is none of the words that say whose rows are kept", help=helps))


def as_list(words: str | int | Sequence[str | int]) -> list[str | int]:
    """One word or several as a list, with numpy's numbers as Python's."""
    several: Sequence[Any] = [words] if isinstance(words, str) or not hasattr(words, "__iter__") else list(words)
    return [word if isinstance(word, str) else int(word) for word in several]


def keep(words: str | int | Sequence[str | int], experiments: Sequence[Experiment]) -> Keep:
    """Read one or several words of `--histories` (`WORDS`). Raises Problem E351."""
    word_list = as_list(words)
    keep_rules = Keep()
    for word in word_list:
        keep_rules = _with(keep_rules, word, experiments)
    alone = [word for word in word_list if word in ("default", "all", "none")]
    if alone and len(word_list) > 1:
        raise Problem(error("E351", f"histories `{alone[0]}` stands alone, and not with {len(word_list) - 1} more"))
    return keep_rules


def _with(rules: Keep, word: str | int, experiments: Sequence[Experiment]) -> Keep:
    """The rules with those of one more word. Raises Problem E351 where it is none."""
    from dataclasses import replace

    if not isinstance(word, str):
        return replace(rules, cases=(*rules.cases, word))
    name, *rest = word.split(":")
    if word in ("default", "all", "none"):
        return replace(rules, default=word == "default", everything=word != "none")
    if word == "failed":
        return replace(rules, failed=True)
    if name == "every" and len(rest) == 1 and rest[0].isdecimal() and int(rest[0]) > 0:
        return replace(rules, every=(*rules.every, min(int(rest[0]), 2**62)))
    if name == "worst" and 1 <= len(rest) <= 2 and rest[0].isdecimal() and int(rest[0]) > 0:
        metric = rest[1] if len(rest) == 2 else ""
        _check_metric(metric, experiments)
        return replace(rules, worst=(*rules.worst, (int(rest[0]), metric)))
    if word.startswith("#") or (word and all(c in "0123456789abcdef" for c in word)):
        return replace(rules, cases=(*rules.cases, word))
    near = [match for match in difflib.get_close_matches(name, SINGLE, n=1) if match != name]
    helps = [*(f"did you mean `{text}`?" for text in near), f"what may be kept: {WORDS}"]
    if "," in word:
        helps.insert(
            0,
            "several words are given one by one: `"
            + " ".join(f"--histories {part.strip()}" for part in word.split(","))
            + "`",
        )
    raise Problem(error("E351", f"histories `{word}` is none of the words that say what to keep", help=helps))


def _check_metric(metric: str, experiments: Sequence[Experiment]) -> None:
    """Check that there is a metric by which cases can be the worst. Raises Problem E351."""
    known = list(dict.fromkeys(use.name for experiment in experiments for use in experiment.metrics))
    if not known:
        remedy = "a run has them by `metric NAME = MODEL { of = ...; }`"
        raise Problem(error("E351", "there is no metric by which cases could be the worst", help=remedy))
    if metric and metric not in known:
        near = difflib.get_close_matches(metric, known, n=1)
        helps = [*(f"did you mean `{text}`?" for text in near), f"metrics here: {', '.join(known)}"]
        raise Problem(error("E351", f"no metric `{metric}` by which cases could be the worst", help=helps))


def kept_before(rules: Keep, experiment: Experiment, rows: CaseValues, named: np.ndarray) -> np.ndarray:
    """Places in `rows` of the cases whose histories are kept whatever their results. named: rows of `found.cases`"""
    if rules.everything:
        return np.arange(len(rows))
    places = [places_among(rows, named[are_among(rows, named)])]
    for piece in blocks(len(rows)) if rules.every else ():
        positions = np.asarray(experiment.cases.table[rows[piece]])
        places += [piece.start + np.flatnonzero(positions % every == 0) for every in rules.every]
    return distinct(np.concatenate(places).astype(np.int64))


def worst_wanted(rules: Keep, experiment: Experiment) -> dict[str, int]:
    """The number of worst cases by each metric whose histories are kept; the largest where several are asked for."""
    wanted: dict[str, int] = {}
    for count, by in rules.worst:
        metric = by or (experiment.metrics[0].name if experiment.metrics else "")
        wanted[metric] = max(count, wanted.get(metric, 0))
    return {use.name: wanted[use.name] for use in experiment.metrics if use.name in wanted}


def kept_by_outcome(rules: Keep, experiment: Experiment, results: CaseOutcomes) -> np.ndarray:
    """Places of the cases whose histories are kept because of their results. results: of all cases"""
    places = [results.worst(metric) for metric in worst_wanted(rules, experiment)]
    if rules.failed:
        places.append(results.failed.select(np.arange(results.failed.set)))
    return distinct(np.concatenate([np.zeros(0, np.int64), *places]))


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
    progress: Callable[[int], None],
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
        tallies.add(
            CaseBlock(
                first + np.arange(len(rows)),
                run.status,
                run.cause,
                run.warning,
                run.metrics,
                verdicts_of_cases(experiment, run),
                points.of([np.asarray(coordinate.values[rows]) for coordinate in chosen], len(rows)),
                int(np.count_nonzero(run.limited)),
            )
        )
        progress(first + len(rows))
    kept_places = tallies.named()
    kept_places += outcomes.worst(wanted.metric).tolist() if wanted.worst else []
    kept_places += verifying.chosen(experiment, outcomes).tolist() if verified else []
    places = distinct(np.array(kept_places or [0], np.int64))  # an archive has a case
    values = tallies.values(
        lambda place: int(experiment.cases.table[section.rows[place]]),
        named,
        [named[coordinate.path] for coordinate in chosen],
        points,
    )
    summary = CaseSummary(len(section.rows), tallies.limited, wanted.word, _drawn(experiment), values)
    return Summarised(summary, places, outcomes)
