"""Output of `met fit`: the fitted numbers, what is known of them, and what is left of the logs."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from batch.fitting.known import Known, correlated
from batch.fitting.logged import DELAY, LoggedRun
from batch.fitting.question import FitAnswer, FitQuestion, Promise
from batch.measured.residuals import Comparison
from batch.queries.summary import finite
from batch.terminal.chosen_deck import FittedValue
from batch.terminal.residuals import doubt_lines, note_lines
from ic.driver.written_value import WrittenValue
from ic.printing.columns import columns
from met.outputs import quoted, setting_option
from met.unit_parser import decimals

WORDS: Mapping[str, str] = MappingProxyType({
    "known": "known",
    "tied": "tied to others",
    "unseen": "unseen",
    "held": "not free: the deck allows no value beside it",
})  # fmt: skip
"""Words for whether logs tell a parameter."""

SHOWN, MOST_PARTS = 3, 6
"""Largest number of changes without a mark, and of correlated pairs, that are printed; and of parts of a change."""

REMOVED = 0.5
"""Share of a channel's residual below which a fit has removed what made it doubtful."""

MOST_LEFT = 0.3
"""Largest median of what a fit leaves of signals that is no noise, in their spreads, without a doubt."""

MOST_UNLIKE = 2.0
"""Largest ratio of the delays of channels that are those of one log."""

DRAWN_APART = 0.7
"""Correlation of errors from which on independent draws are too wide, by 1.4 times."""

DIGITS = 2
"""Digits of half an interval, to which a value is rounded."""


def rounded(si: float, half: float, unit: str) -> WrittenValue:
    """A value rounded to the second digit of half its interval. half: SI"""
    if not (math.isfinite(half) and half > 0.0):
        return WrittenValue("", float(f"{si:.3g}"), unit)
    in_unit, half_in_unit = (float(text) for text in decimals([si, half], unit))
    digits = DIGITS - 1 - math.floor(math.log10(half_in_unit))
    scale = si / in_unit if in_unit else half / half_in_unit
    return WrittenValue("", round(in_unit, digits) * scale, unit)


def written_values(question: FitQuestion, answer: FitAnswer) -> list[FittedValue]:
    """The fitted values, rounded to a hundredth of their intervals, to be written into the deck."""
    logs = ", ".join(Path(run.file).name for run in question.runs)
    values = []
    for place, path in enumerate(question.paths):
        if path.startswith(DELAY):
            continue
        unit, half = question.units[place], float(answer.fit.factor * answer.fit.deviation[place])
        value = dataclasses.replace(rounded(float(answer.fit.values[place]), half / 10.0, unit), path=path)
        interval = f"{path} +- {_short(half, unit)}" if math.isfinite(half) else ""
        values.append(FittedValue(value, f"by a fit to {logs}", interval))
    return values


def written_motion(promise: Promise) -> list[FittedValue]:
    """The values that make the best case of a sweep, to be written into the deck."""
    return [FittedValue(value, f"of {promise.sweep.cases.count:,}: {promise.motion.file}") for value in promise.values]


def identifiable_lines(question: FitQuestion, known: Known, promised: Sequence[Promise]) -> Iterator[str]:
    """Lines about the numbers that the logs can tell before anything is fitted, and with a log of other motions."""
    rows = [["", "deck", "standard error", "by itself", ""]]
    for place, path in enumerate(question.paths):
        unit = question.units[place]
        errors = [_short(deviation, unit) for deviation in (known.deviation[place], known.alone[place])]
        rows.append([f"  {path}", _deck_value(question, place), *errors, WORDS[known.verdict[place]]])
    yield from columns(rows, right=(1, 2, 3))
    yield ""
    condition = "infinite" if math.isinf(known.condition) else f"{known.condition:.3g}"
    many = len(question.paths)
    yield f"{known.rank} of {many} combinations of these can be known from the logs; condition {condition}"
    yield from _together(question, known)
    if promised:
        yield ""
        rows = [["standard errors with a log of", *(promise.motion.file for promise in promised)]]
        for place, path in enumerate(question.paths):
            errors = [_short(promise.known.deviation[place], question.units[place]) for promise in promised]
            rows.append([f"  {path}", *errors])
        yield from columns(rows, right=tuple(range(1, len(promised) + 1)))
        yield ""
        for promise in promised:
            yield from _choice_lines(promise)
    yield "The errors are those of the logs' noise alone: what the model lacks adds to them."


def _choice_lines(promise: Promise) -> Iterator[str]:
    """Lines that name the best case of a sweep, and the command that runs it; none for a run."""
    cases, settings = promise.sweep.cases.count, [value.setting for value in promise.values]
    if not settings:
        return
    judged, others = f"{cases:,} cases", ""
    if promise.judged < cases:
        judged, others = f"{promise.judged:,} of {judged}", ": the others fail, leave limits or miss requirements"
    yield f"{promise.motion.file} is the best of {judged}{others}"
    run = promise.motion.deck_run
    words = [f"-D {quoted(define)}" for define in run.defines]
    words += [setting_option(setting) for setting in (*run.settings, *settings)]
    yield f"its motion: {' '.join(['met run', quoted(run.deck.file), run.name, *words])}"
    yield ""


def fit_lines(question: FitQuestion, answer: FitAnswer) -> Iterator[str]:
    """The fitted numbers, what they are worth, and what is left of the logs, in lines."""
    fit = answer.fit
    logs, numbers = ", ".join(run.file for run in question.runs), f"{len(fit.residuals):,} numbers"
    yield f"{question.runs[0].deck_run.name}, fitted to {numbers} of {logs}"
    yield ""
    rows = [["", "deck", "fitted", "95 %", ""]]
    for place, path in enumerate(question.paths):
        half, unit = float(fit.factor * fit.deviation[place]), question.units[place]
        known = answer.known.verdict[place] == "known" and not fit.at_limit[place]
        value = rounded(float(fit.values[place]), half if known else math.nan, unit)
        interval = f"+- {_short(half, unit)}" if known else ""
        verdict = answer.known.verdict[place]
        words = "" if known else "at its limit" if fit.at_limit[place] and verdict != "held" else WORDS[verdict]
        text = "" if verdict == "held" else value.text
        prior = question.priors.get(path)
        if prior is not None and known and fit.deviation[place] > 0.9 * prior.deviation:
            words = "as it was known: the logs say little of it"
        rows.append([f"  {path}", _deck_value(question, place), text, interval, words])
    yield from columns(rows, right=(1, 2))
    yield from _together(question, answer.known)
    pairs = sorted(correlated(fit.covariance, question.paths, answer.known), key=lambda pair: -abs(pair[2]))
    for path_a, other, share in pairs[:SHOWN]:
        yield f"  note: the errors of {path_a} and {other} are correlated by {share:.2f}"
    if len(pairs) > SHOWN:
        yield f"  note: so are those of {len(pairs) - SHOWN} more pairs, by 0.9 at least"
    if fit.outliers:
        yield f"  note: {fit.outliers:,} numbers are far from all others, and left out"
    if any(run.thinned for run in question.runs):
        yield "  note: the logs are longer than what is fitted: instants are left out at even distances"
    if not fit.converged:
        yield f"  doubt: after {fit.steps} steps, the fit was still moving: these are not yet its numbers"
    if fit.rival is not None:
        texts = [
            f"{path} = {rounded(value, 0.0, unit).text}"
            for path, value, unit in zip(question.paths, fit.rival.tolist(), question.units, strict=True)
        ]
        yield f"  doubt: other values explain the logs as well: {', '.join(texts)}"
    doubts = _all_doubts(question, answer)
    for run, before, after, own in zip(question.runs, answer.before, answer.after, doubts, strict=True):
        yield ""
        yield from _residual_lines(f"Residuals of {run.file}", before, after, own)
    for run, (before, after) in zip(question.predicted, answer.predicted, strict=True):
        yield ""
        yield from _residual_lines(f"Predicted, and not fitted: {run.file}", before, after, _doubts(before, after))


def sweep_lines(question: FitQuestion, answer: FitAnswer, count: int = 200) -> Iterator[str]:
    """A sweep over what is known of the fitted parameters, for the deck, in lines; none where all are at their limits,
    or errors go together so much that independent draws would be of arms that the logs exclude."""
    limited = answer.fit.at_limit
    free = [place for place, path in enumerate(question.paths) if not (limited[place] or path.startswith(DELAY))]
    if not free:
        return
    if pairs := list(correlated(answer.fit.covariance, question.paths, answer.known, DRAWN_APART)):
        path_a, other, share = pairs[0]
        yield (
            f"no sweep: the errors of {path_a} and {other} are correlated by {share:.2f}, and a sweep draws them apart"
        )
        return
    yield "What is known of the arm, as a sweep of the deck:"
    yield ""
    run = question.runs[0].deck_run.name
    yield f"sweep fitted of {run} {{"
    yield f"    sample lhs({count}) {{"
    for place in free:
        path = question.paths[place]
        unit, value, deviation = question.units[place], answer.fit.values[place], answer.fit.deviation[place]
        mean, spread = decimals([rounded(value, 0.2 * deviation, unit).si, float(f"{deviation:.2g}")], unit)
        distribution = f"normal({mean}, {float(spread):.2g})"
        ladder = np.tile(answer.fit.values, (121, 1))
        ladder[:, place] += deviation * np.linspace(-6.0, 6.0, 121)
        allowed = ladder[~question.logs.refused(ladder), place]
        if len(allowed) < len(ladder):
            low, high = (f"{float(text):.4g}" for text in decimals([allowed.min(), allowed.max()], unit))
            distribution = f"truncated({mean}, {float(spread):.2g}, {low}, {high})"
        yield f"        {path} = {distribution}{'' if unit == '1' else f' {unit}'};"
    yield "    }"
    yield "}"


def as_data(question: FitQuestion, answer: FitAnswer) -> dict[str, Any]:
    """The answer of a fit for JSON, in SI: its numbers, doubts and residuals; a number that is not finite is null."""
    fit = answer.fit
    parameters = [
        {
            "path": path,
            "unit": question.si_units[place],
            "deck": float(question.start[place]),
            "fitted": float(fit.values[place]),
            "half_interval": float(fit.factor * fit.deviation[place]),
            "known": answer.known.verdict[place],
            "at_limit": bool(fit.at_limit[place]),
        }
        for place, path in enumerate(question.paths)
    ]
    data = {
        "certain": is_certain(question, answer),
        "doubts": [line.strip() for all_doubt in _all_doubts(question, answer) for line in all_doubt],
        "parameters": parameters,
        "covariance": fit.covariance.tolist(),
        "converged": fit.converged,
        "rival": None if fit.rival is None else fit.rival.tolist(),
        "together": _as_paths(question, answer.known),
        "logs": _comparisons(question.runs, zip(answer.before, answer.after, strict=True)),
        "predicted": _comparisons(question.predicted, answer.predicted),
    }
    return finite(data)


def identifiable_data(question: FitQuestion, known: Known, promised: Sequence[Promise]) -> dict[str, Any]:
    """Known and unknown numbers of a fit for JSON, in SI, before anything is fitted; a number that is not finite is
    null."""
    parameters = [
        {"path": path, "deck": float(start), "deviation": float(whole), "alone": float(alone), "known": verdict}
        for path, start, whole, alone, verdict in zip(
            question.paths, question.start, known.deviation, known.alone, known.verdict, strict=True
        )
    ]
    data = {
        "parameters": parameters,
        "rank": known.rank,
        "condition": known.condition,
        "motions": {promise.motion.file: promise.known.deviation.tolist() for promise in promised},
        "chosen": [
            {
                "motion": promise.motion.file,
                "cases": promise.sweep.cases.count,
                "judged": promise.judged,
                "set": [value.setting for value in promise.values],
            }
            for promise in promised
            if promise.values
        ],
        "together": _as_paths(question, known),
    }
    return finite(data)


def _comparisons(runs: Sequence[Any], pairs: Any) -> list[dict[str, Any]]:
    """The residuals of each log before and after the fit, for JSON."""
    return [
        {
            "run": run.deck_run.name,
            "log": run.file,
            "before": dataclasses.asdict(before),
            "after": dataclasses.asdict(after),
        }
        for run, (before, after) in zip(runs, pairs, strict=True)
    ]


def _as_paths(question: FitQuestion, known: Known) -> list[dict[str, float]]:
    """The changes of several numbers that leave no mark in the logs, for JSON: how far each goes, SI, by its path."""
    return [{question.paths[place]: part for place, part in change.items()} for change in known.together]


def _together(question: FitQuestion, known: Known) -> Iterator[str]:
    """Lines about changes of several parameters that leave no mark in the logs, the first few of them."""
    for change in known.together[:SHOWN]:
        largest = sorted(change, key=lambda place: -abs(change[place] / known.size[place]))[:MOST_PARTS]
        parts = [
            f"{question.paths[place]} by {WrittenValue('', float(f'{change[place]:.3g}'), question.units[place]).text}"
            for place in sorted(largest)
        ]
        more = f" and {len(change) - MOST_PARTS} more" if len(change) > MOST_PARTS else ""
        yield f"  doubt: a change of all of these leaves no mark in the logs: {', '.join(parts)}{more}"
        if len(change) == 2:
            (own_place, part), (other, by) = change.items()
            factor = f"{'+' if part * by < 0.0 else '-'} {abs(part / by):.3g}"
            own, its = question.si_units[own_place], question.si_units[other]
            unit = "" if own == its else f" {own} per {its}"
            yield f"         only {question.paths[own_place]} {factor}{unit} * {question.paths[other]} is known"
    if len(known.together) > SHOWN:
        yield f"  doubt: {len(known.together) - SHOWN} more such changes leave no mark: estimate fewer numbers"


def _residual_lines(title: str, before: Comparison, after: Comparison, doubts: Sequence[str]) -> Iterator[str]:
    """The table of a log's residuals before and after the fit, a row for each channel."""
    earlier = {residual.channel: residual for residual in before.residuals}
    rows = [[title, "before", "after", "", "of spread", "", "what is left follows"]]
    for residual in after.residuals:
        was = earlier.get(residual.channel)
        share = f"{residual.rms / residual.spread:.3g}" if residual.spread else "-"
        white = (
            "white" if residual.white else "" if residual.white is None else f"not white ({residual.correlation:.2g})"
        )
        follows = f"{residual.explained[0].what}: {residual.explained[0].means}" if residual.explained else ""
        unit = "" if residual.unit == "1" else residual.unit
        first = "" if was is None else f"{was.rms:.3g}"
        rows.append([f"  {residual.channel}", first, f"{residual.rms:.3g}", unit, share, white, follows])
    yield from columns(rows, right=(1, 2, 4))
    yield from dict.fromkeys([*doubts, *note_lines(after)])


def _deck_value(question: FitQuestion, place: int) -> str:
    """The deck's value of the estimated number at this place, with its unit."""
    return WrittenValue("", float(f"{question.start[place]:.6g}"), question.units[place]).text


def _doubts(before: Comparison, after: Comparison) -> list[str]:
    """The reasons to doubt a log: those after the fit, and those before it unless the fit removed most of what was left
    of the channels that a doubt names, or of all."""
    sizes = {residual.channel: residual.rms for residual in before.residuals}
    left = {
        residual.channel for residual in after.residuals if residual.rms > REMOVED * sizes.get(residual.channel, 0.0)
    }
    left -= {residual.channel for residual in after.residuals if residual.white}
    doubts = {doubt.rpartition(": ")[0]: doubt for doubt in doubt_lines(after)}
    for doubt in doubt_lines(before):
        named = set(re.findall("`([^`]+)`", doubt)) & sizes.keys() or set(sizes)
        if named & left:
            doubts.setdefault(doubt.rpartition(": ")[0], doubt)
    return list(doubts.values())


def _late_doubt(run: LoggedRun, path: str, delay: float, after: Comparison) -> list[str]:
    """A doubt about a log that is late by as much in most channels after a fit. path, delay: of its delay, and the
    fitted one, s"""
    first = [residual.explained[0] for residual in after.residuals if residual.explained]
    sizes = [
        first_residual.size
        for first_residual in first
        if first_residual.means == "a delay" and first_residual.size is not None
    ]
    if 2 * len(sizes) <= len(after.residuals) or min(sizes) * max(sizes) <= 0.0:
        return []
    if max(map(abs, sizes)) > MOST_UNLIKE * min(map(abs, sizes)):
        return []
    late = float(np.median(sizes))
    zero = quoted(f"{run.file}={run.zero + delay + late:.4g} s")
    words = f"{abs(late):.3g} s {'late' if late > 0.0 else 'early'}"
    return [f"  doubt: the log seems {words}: `--zero {zero}` begins so, and `--estimate {quoted(path)}` fits it"]


def _all_doubts(question: FitQuestion, answer: FitAnswer) -> list[list[str]]:
    """The reasons to doubt each log that is fitted, as lines."""
    delays, doubts_of_logs = dict(zip(question.paths, answer.fit.values.tolist(), strict=True)), []
    for run, before, after in zip(question.runs, answer.before, answer.after, strict=True):
        path, doubts = DELAY + run.file, _doubts(before, after)
        left = [
            residual.rms / residual.spread
            for residual in after.residuals
            if residual.white is False and residual.spread
        ]
        if 2 * len(left) > len(after.residuals) and not doubts and np.median(left) > MOST_LEFT:
            words = f"the fit leaves {np.median(left):.2g} of what was measured in most channels"
            doubts.append(f"  doubt: {words}: is the log of this run, and of an arm like this?")
        doubts_of_logs.append([*doubts, *_late_doubt(run, path, delays.get(path, 0.0), after)])
    return doubts_of_logs


def is_certain(question: FitQuestion, answer: FitAnswer) -> bool:
    """True if a fit found all its numbers, no others explain the logs as well, and no log is doubtful."""
    known = set(answer.known.verdict) == {"known"} and answer.fit.converged and answer.fit.rival is None
    return known and not any(_all_doubts(question, answer))


def _short(si: float, unit: str) -> str:
    """A number in SI as a text of two digits in this unit: `0.0012 N*m`; "unknown" if it is not finite."""
    if not math.isfinite(si):
        return "unknown"
    (text,) = decimals([float(f"{si:.2g}")], unit)
    return f"{float(text):.2g}{'' if unit == '1' else f' {unit}'}"
