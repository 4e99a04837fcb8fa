"""The choice of histories to keep: of all cases, of none, of every n-th, of named ones, of those that failed, of the
worst.

Cases that are chosen by place or name are recorded when they are run. Cases that failed, and the worst by a metric, are
known when all are done, and are run again for their histories, with the same bits.
"""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from typing import Any

import numpy as np

from batch.campaigns.outcomes import CaseOutcomes
from met.diagnostic import Problem, error
from met.distinct import distinct
from met.frozen import frozen
from met.plan import Experiment
from met.plan.columns import CaseValues, are_among, blocks, places_among

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
