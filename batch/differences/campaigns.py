"""The difference of two archives, in bounded memory: provenance, status, metrics, signals, and the worst cases."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.archive.stored import Stored
from batch.differences import matching
from batch.differences.compare import (
    DIFFERENT,
    EQUIVALENT,
    IDENTICAL,
    VERDICTS,
    Difference,
    SampledCourse,
    compare,
    compare_cases,
    magnitude,
    spans,
    unlike_bits,
)
from batch.differences.demands import compare_requirements
from batch.differences.matching import MatchedCases
from batch.differences.paired import judge_pairs
from batch.differences.provenance import provenance_changes
from batch.differences.result import Diff, DiffPlace, EndingDiff, ExperimentDiff, RankedCase, SignalDiff
from batch.differences.samples import samples
from batch.differences.tolerance import SignalTolerance, Tolerances, check, fits, of_deck
from batch.differences.words import step_error_note
from batch.queries.signals import deck_unit
from batch.queries.step_errors.figures import figures, of_difference
from met.diagnostic import Problem
from met.distinct import distinct
from met.plan import Plan
from met.plan.outputs import joint_parts
from met.unit_parser import decimals, written

WORST = 20
"""Number of cases that are ranked."""

NO_CASE = "no case is in both"

ROUNDING = 1e-9
"""Largest relative difference of varied values that is taken for rounding."""

LARGEST = float(np.finfo(float).max)
"""Upper bound of a span, so that a share of it is a number."""

BLOCK = 1 << 16
"""Number of values of a signal that are compared at a time: 512 KiB."""


def diff(a: str | Path, b: str | Path, overrides: Tolerances | None = None, *, distributions: bool = False) -> Diff:
    """Compare two archives. overrides: tolerances that take precedence over those of b's deck. distributions: compare
    metrics as samples even where the seeds are the same. Raises Problem."""
    with ArchiveFile(a) as file_a, ArchiveFile(b) as file_b:
        for file in (file_a, file_b):
            file.need_every_row("a comparison of cases")
        pairs, only_a, only_b = matching.match_experiments(file_a, file_b)
        allowed = overrides or Tolerances()
        _check(allowed, [*file_a.groups, *file_b.groups])
        plans = [_plan(file) for file in (file_a, file_b)]
        experiments = tuple(_experiment(group, two, allowed, plans[1], distributions) for group, two in pairs)
        return Diff(
            Path(a),
            Path(b),
            allowed,
            provenance_changes(file_a, file_b, pairs, plans),
            experiments,
            tuple(group.name for group in only_a),
            tuple(group.name for group in only_b),
        )


def _check(allowed: Tolerances, groups: Sequence[ArchiveGroup]) -> None:
    """Check that each tolerance of the command line names a quantity of one of the archives."""
    known: dict[str, Sequence[str]] = {}
    known_names: dict[str, None] = {}
    for group in groups:
        known_names |= {variable.name: None for variable in (*group.role("signal"), *group.role("metric"))}
        for name, units in _known(group).items():
            if name not in allowed.absolute or name not in known or not fits(allowed.absolute[name][1], known[name]):
                known[name] = units
    check(allowed, known, list(known_names))


def _known(group: ArchiveGroup) -> dict[str, Sequence[str]]:
    """Units of signals, joints' parts of them and metrics, by name."""
    known: dict[str, Sequence[str]] = {}
    for variable in (*group.role("signal"), *group.role("metric")):
        units = variable.units_by_joint or [variable.unit]
        known[variable.name] = list(dict.fromkeys(units))
        if variable.role == "signal":
            parts = joint_parts(variable.name, tuple(group.joints(variable)))
            known.update(zip(parts, ([unit] for unit in units * (len(parts) // len(units))), strict=True))
    return known


def _plan(file: ArchiveFile) -> Plan | str:
    """The plan of an archive, or the reason why it cannot be read here."""
    try:
        return file.plan(as_written=True)
    except Problem as problem:
        return problem.diagnostics[0].message


def _experiment(
    a: ArchiveGroup, b: ArchiveGroup, overrides: Tolerances, plan: Plan | str, distributions: bool
) -> ExperimentDiff:
    """Compare two groups. plan: that of b, or the reason why it cannot be read"""
    known = {} if isinstance(plan, str) else {experiment.name: experiment for experiment in plan.experiments}
    overrides = overrides.within(_known(a)).within(_known(b))
    allowed = overrides.over(of_deck(known[b.name], b) if b.name in known else Tolerances())
    matched = matching.match_cases(a, b)
    out = ExperimentDiff(a.name, b.name, matched, allowed)
    if isinstance(plan, str) and not overrides.alone:
        out.notes.append("what its deck allows is not known, for the plan cannot be read")
    out.only_a = a.values("case")[matched.only_a].tolist()
    out.only_b = b.values("case")[matched.only_b].tolist()
    out.last_digits = _last_digits(a, b, matched)
    if any(group.attributes.get("until_shown") for group in (a, b)):
        out.notes.append("cases were run until it was shown what is required: chances are those of a fixed number")
    scores = _Scores(matched.count)
    _ended(a, b, matched, out)
    by_step = of_difference(figures(a), figures(b))
    for name in matching.names(a, b, "metric"):
        out.signals.append(_metric(a, b, matched, name, allowed, scores))
        out.signals[-1].by_step = by_step.get(name, float("nan"))
    if note := step_error_note(out):
        out.notes.append(note)
    out.signals += _signals(a, b, matched, allowed, scores, out)
    if not out.signals:
        out.notes.append("neither has a metric or a history: nothing is compared but how cases end")
    compare_requirements(a, b, matched, out)
    if _is_sample(b, matched.b) or _other_noise(a, b):
        judge_pairs(out)
    _counts(a, b, matched, out)
    out.worst = scores.ranked(a, b, matched, out.signals)
    out.cases_different = int(scores.beyond.sum())
    out.how = _how(scores, matched, b, out)
    if distributions or _other_noise(a, b):
        out.samples = samples(a, b)
    return out


def _last_digits(a: ArchiveGroup, b: ArchiveGroup, matched: MatchedCases) -> str:
    """Words for cases at the same place in both tables that are unmatched because of rounding in what is varied; empty
    where there are none."""
    rows_a, rows_b = a.values("case")[matched.only_a], b.values("case")[matched.only_b]
    rows, in_a, in_b = np.intersect1d(rows_a, rows_b, return_indices=True)
    coordinates = {variable.path: variable for variable in b.role("coordinate")}
    both = [(variable, coordinates[variable.path]) for variable in a.role("coordinate") if variable.path in coordinates]
    if not len(rows) or not both or len(both) < max(len(a.role("coordinate")), len(coordinates)):
        return ""
    columns = [
        (variable, a.values(variable.name)[matched.only_a[in_a]], b.values(two.name)[matched.only_b[in_b]])
        for variable, two in both
    ]
    near = np.all([np.abs(x - y) <= ROUNDING * np.maximum(np.abs(x), np.abs(y)) for _, x, y in columns], axis=0)
    near &= np.any([x != y for _, x, y in columns], axis=0)
    if not near.any():
        return ""
    first = int(np.argmax(near))
    variable, before, now = next((v, x[first], y[first]) for v, x, y in columns if x[first] != y[first])
    unit = str(variable.attributes.get("deck_unit", variable.unit))
    [text] = decimals([before], unit)
    some = f"{near.sum():,} cases have" if near.sum() > 1 else f"case #{rows[first]} has"
    return f"{some} other last digits in what is varied, {variable.path} = {text}, now {written(now, unit)}"


def _how(scores: _Scores, matched: MatchedCases, b: ArchiveGroup, experiment: ExperimentDiff) -> np.ndarray:
    """The verdict on each matched case, as its place in VERDICTS, [case]; a case that ended otherwise is different."""
    out = np.where(scores.unlike, VERDICTS.index(EQUIVALENT), VERDICTS.index(IDENTICAL)).astype(np.int8)
    out[scores.beyond] = VERDICTS.index(DIFFERENT)
    if experiment.ended:
        ended = [ending.case for ending in experiment.ended]
        out[np.isin(b.values("case")[matched.b], ended)] = VERDICTS.index(DIFFERENT)
    return out


def _is_sample(group: ArchiveGroup, cases: np.ndarray) -> bool:
    """True if cases were drawn at random, or repeated with other noise, so that a difference may be due to chance."""
    repeated = "repeat" in group.variables and bool(group.values("repeat")[cases].any())
    return repeated or any(variable.attributes.get("design") for variable in group.role("coordinate"))


def _other_noise(a: ArchiveGroup, b: ArchiveGroup) -> bool:
    """True if the two have different seeds, so that single cases differ by chance."""
    mine, theirs = a.values("seed"), b.values("seed")
    return not np.array_equal(mine, theirs) and not np.array_equal(distinct(mine), distinct(theirs))


def _ended(a: ArchiveGroup, b: ArchiveGroup, matched: MatchedCases, out: ExperimentDiff) -> None:
    """Cases with another ending, or an earlier one."""
    status, rows = ([group.values(name) for group in (a, b)] for name in ("status", "n_valid"))
    status_a, status_b = status[0][matched.a], status[1][matched.b]
    unlike = (status_a != status_b) | ((status_a != 0) & (rows[0][matched.a] != rows[1][matched.b]))
    places = np.flatnonzero(unlike)
    if not len(places):
        return
    names = ("case", "case_id", "cause")
    values_of = {name: (a.at(name, matched.a[places]), b.at(name, matched.b[places])) for name in names}
    for i, place in enumerate(places.tolist()):
        out.ended.append(
            EndingDiff(
                int(values_of["case"][1][i]),
                str(values_of["case_id"][1][i]),
                int(status_a[place]),
                int(status_b[place]),
                str(values_of["cause"][0][i]),
                str(values_of["cause"][1][i]),
                int(rows[0][matched.a[place]]),
                int(rows[1][matched.b[place]]),
            )
        )


COUNTS = {
    "friction_splits": "steps that friction split",
    "friction_clamped": "rates that friction clamped",
    "friction_undecided": "modes of friction that were left open",
    "bed_limited": "ticks at a bed's limit",
}
"""Counters of each case besides its records, with their meanings."""

FIGURES = ("limit", "excess", "extreme", "grapple")
"""Roles of the figures that each case has besides its metrics: of its limits and its grapples."""


def _counts(a: ArchiveGroup, b: ArchiveGroup, matched: MatchedCases, out: ExperimentDiff) -> None:
    """Note counts and figures that differ where nothing else does: then something unrecorded differs."""
    if any(signal.equivalent or signal.different for signal in out.signals):
        return
    figures = {v.name: v.long_name for role in FIGURES for v in a.role(role)}
    named = {name: f"number of {words}" for name, words in COUNTS.items() if name in a.variables} | figures
    for name, words in named.items():
        if name in b.variables:
            figures_a, figures_b = a.values(name)[matched.a], b.values(name)[matched.b]
            unlike = int(((figures_a != figures_b) & ((figures_a == figures_a) | (figures_b == figures_b))).sum())
            if unlike:
                out.notes.append(f"the {words} is another in {unlike:,} of {matched.count:,} cases")
                out.partial = True


class _Scores:
    """For each matched case, how much it differs at worst, and where."""

    def __init__(self, count: int) -> None:
        self.score = np.zeros(count)
        self.unlike = np.zeros(count, bool)
        self.beyond = np.zeros(count, bool)
        self.where: dict[int, tuple[str, DiffPlace, float]] = {}

    def take(self, place: int, score: float, signal: str, where: DiffPlace, difference: float) -> None:
        """Note a difference of a case that is among the worst of a signal."""
        if score > self.score[place] or place not in self.where:
            self.score[place] = score
            self.where[place] = (signal, where, difference)

    def ranked(
        self, a: ArchiveGroup, b: ArchiveGroup, matched: MatchedCases, signals: Sequence[SignalDiff]
    ) -> list[RankedCase]:
        """The cases that differ most, the worst first, each with the signal and the place of its largest difference."""
        by_name = {signal.name: signal for signal in signals}
        places = sorted(self.where, key=lambda place: (-self.score[place], place))[:WORST]
        if not places:
            return []
        case_a, case_b = a.at("case", matched.a[places]), b.at("case", matched.b[places])
        ids = b.at("case_id", matched.b[places])
        return [
            RankedCase(
                int(case_a[i]),
                int(case_b[i]),
                str(ids[i]),
                name,
                float(self.score[place]),
                where,
                difference,
                by_name[name].deck_unit,
                by_name[name].deck_scale,
            )
            for i, place in enumerate(places)
            for name, where, difference in [self.where[place]]
        ]


# Metrics


def _metric(
    a: ArchiveGroup, b: ArchiveGroup, matched: MatchedCases, name: str, allowed: Tolerances, scores: _Scores
) -> SignalDiff:
    """The differences of one metric over all matched cases; their scores are added to `scores`."""
    unit = (a if name in a.variables else b).variables[name].unit
    tolerance = replace(allowed.of(name), time=0.0)
    out = SignalDiff(name, unit, True, tolerance)
    out.why = _incomparable(a, b, name, "metric") or ("" if matched.count else NO_CASE)
    if out.why:
        return out
    out.deck_scale, out.deck_unit = deck_unit(b.variables[name])
    out.as_written = allowed.as_written({"": name})
    values_a, values_b = a.values(name)[matched.a], b.values(name)[matched.b]
    finite = values_a[np.isfinite(values_a)]
    if len(finite):
        out.low, out.high = float(finite.min()), float(finite.max())
    out.compared = matched.count
    difference = compare(values_a[:, None], values_b[:, None], tolerance)
    if difference is None:
        out.identical = out.compared
        return out
    case = int(b.at("case", [matched.b[difference.row]])[0])
    _add(out, difference, DiffPlace(case, "", float("nan"), difference.before, difference.after))
    unlike = np.flatnonzero(
        (values_a.view(np.int64) != values_b.view(np.int64)) & ~(np.isnan(values_a) & np.isnan(values_b))
    )
    scores.unlike[unlike] = True
    out.higher, out.lower = int((values_b > values_a).sum()), int((values_b < values_a).sum())
    out.identical = out.compared - len(unlike)
    out.different = difference.beyond
    out.equivalent = len(unlike) - difference.beyond
    if difference.beyond:
        _rank_metric(out, values_a, values_b, tolerance, unlike, scores, b, matched)
    return out


def _rank_metric(
    out: SignalDiff,
    a: np.ndarray,
    b: np.ndarray,
    allowed: SignalTolerance,
    unlike: np.ndarray,
    scores: _Scores,
    group: ArchiveGroup,
    matched: MatchedCases,
) -> None:
    """Score the cases whose metric differs by more than its tolerance, and rank the worst of them."""
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.abs(b[unlike] - a[unlike])
        limit = allowed.absolute + allowed.relative * magnitude(a[unlike], b[unlike])
    nan = np.isnan(apart)
    over = nan | (apart > limit)
    with np.errstate(over="ignore"):
        score = np.where(nan, np.inf, apart / _unit_of(out))
    scores.beyond[unlike[over]] = True
    worst = np.flatnonzero(over)[np.argsort(-score[over], kind="stable")[:WORST]]
    cases = group.at("case", matched.b[unlike[worst]])
    for i, place in enumerate(worst.tolist()):
        position = int(unlike[place])
        where = DiffPlace(int(cases[i]), "", float("nan"), float(a[position]), float(b[position]))
        scores.take(position, float(score[place]), out.name, where, float(apart[place]))


def _unit_of(signal: SignalDiff) -> float:
    """The scale by which a signal's differences are ranked: the span of its values; finite."""
    if signal.low > signal.high:
        return 1.0
    return min(signal.high - signal.low, LARGEST) or max(abs(signal.high), 1e-300)


def _add(out: SignalDiff, difference: Difference, where: DiffPlace) -> None:
    """Add a difference. Those beyond a tolerance replace those within, which are then not reported."""
    beyond = bool(difference.beyond)
    if out.place is None or (beyond and not out.beyond):
        out.largest, out.most, out.place, out.beyond = difference.largest, difference.most, where, beyond
    elif beyond == out.beyond:
        out.largest = max(out.largest, difference.largest)
        if difference.most > out.most:
            out.most, out.place = difference.most, where
    out.squares += difference.squares
    out.values += difference.values
    out.used = max(out.used, difference.used)
    out.nan += difference.nan


# Signals


def _signals(
    a: ArchiveGroup, b: ArchiveGroup, matched: MatchedCases, allowed: Tolerances, scores: _Scores, about: ExperimentDiff
) -> Iterator[SignalDiff]:
    """The differences of each signal of both, at common instants; notes on these go to `about`."""
    names = matching.names(a, b, "signal")
    if not names:
        return
    places, ia, ib = _recorded(a, b, matched, about)
    time_a, time_b = (group.values("time") if "time" in group.variables else np.empty(0) for group in (a, b))
    rows_a, rows_b = matching.match_instants(time_a, time_b, allowed.time or 0.0)
    if len(rows_a) < max(len(time_a), len(time_b)) and len(time_a) and len(time_b):
        of_instants = f"of {len(time_a):,} and {len(time_b):,}"
        about.notes.append(f"signals are compared at the {len(rows_a):,} instants that both have, {of_instants}")
        about.partial = True
    aligned = len(rows_a) == len(time_a) == len(time_b)
    if a.attributes.get("record_hz") == b.attributes.get("record_hz"):
        rows = min(len(time_a), len(time_b))  # at one rate, the n-th rows of both are of one instant
        planned_a, planned_b = time_a[:rows], time_b[:rows]
    else:
        planned_a, planned_b = time_a[rows_a], time_b[rows_b]
    if len(planned_a) and (other := _instants(planned_a, planned_b, allowed, len(places))) is not None:
        yield other
    whole = slice(None)
    at_a, at_b = (
        whole if np.array_equal(rows, np.arange(len(time))) else rows
        for rows, time in ((rows_a, time_a), (rows_b, time_b))
    )
    numbers = b.values("recorded_case")[ib] if len(ib) else ib
    for name in names:
        unit = (a if name in a.variables else b).variables[name].unit
        out = SignalDiff(name, unit, False, allowed.of(name))
        out.why = _incomparable(a, b, name, "signal") or ("" if matched.count else NO_CASE)
        if not out.why and not len(places):
            out.why = "no case has its history in both"
        if not out.why and not len(rows_a):
            out.why = "the two have no instant in common"
        worst: list[tuple[float, int, DiffPlace, float]] = []
        if not out.why:
            labels = _labels(a, a.variables[name])
            out.deck_scale, out.deck_unit = deck_unit(b.variables[name])
            joints = tuple(a.joints(a.variables[name]))
            out.by_joint = _by_joint(a, a.variables[name], allowed)
            out.as_written = allowed.as_written({"": name, **dict(zip(joints, joint_parts(name, joints), strict=True))})
            absolute = _absolute(a, a.variables[name], out)
            together = max(1, BLOCK // (len(labels) * max(len(time_a), len(time_b))))
            for first in range(0, len(places), together):
                some = slice(first, first + together)
                values_a, values_b = _histories(a, name, ia[some]), _histories(b, name, ib[some])
                which = unlike_bits(values_a, values_b) if aligned else np.ones(len(values_a), bool)
                out.compared += len(which)
                out.identical += int((~which).sum())
                low, high = spans(values_a[:, at_a])
                out.low, out.high = min(out.low, float(low.min())), max(out.high, float(high.max()))
                if which.any():
                    passed = SampledCourse(time_b[rows_b], time_a, values_a[which])
                    values_b = values_b[which][:, at_b]
                    worst += _cases(
                        out,
                        passed,
                        values_b,
                        rows_a,
                        labels,
                        absolute,
                        scores,
                        places[some][which],
                        numbers[some][which],
                    )
                    worst = sorted(worst, key=lambda entry: -entry[0])[:WORST]
            unit_of = _unit_of(out)
            for most, place, where, largest in worst:
                scores.take(place, most / unit_of, name, where, largest)
        yield out


def _instants(a: np.ndarray, b: np.ndarray, allowed: Tolerances, cases: int) -> SignalDiff | None:
    """The recorded instants as a signal, where a bit of them differs."""
    difference = compare(a[:, None], b[:, None], SignalTolerance(absolute=allowed.time or 0.0))
    if difference is None:
        return None
    out = SignalDiff("time", "s", False, SignalTolerance(time=allowed.time or 0.0), compared=cases)
    out.deck_unit, out.low, out.high = "s", float(a.min()), float(a.max())
    _add(out, difference, DiffPlace(0, "", float(difference.before), difference.before, difference.after))
    out.equivalent, out.different = (0, cases) if difference.beyond else (cases, 0)
    return out


def _histories(group: ArchiveGroup, name: str, places: np.ndarray) -> np.ndarray:
    """A signal's numbers in the recorded cases at these places, [case, row, column]."""
    values = group.histories(name, places)
    return values.reshape(*values.shape[:2], -1).astype(np.float64, copy=False)


def _by_joint(group: ArchiveGroup, signal: Stored, allowed: Tolerances) -> dict[str, float]:
    """The joints of a signal with an allowed difference of their own, even if that is 0."""
    joints = tuple(group.joints(signal))
    parts = zip(joints, joint_parts(signal.name, joints), strict=True)
    return {joint: allowed.of(part).absolute for joint, part in parts if part in allowed.absolute}


def _absolute(group: ArchiveGroup, signal: Stored, signal_diff: SignalDiff) -> np.ndarray | None:
    """The allowed difference of each column, SI; None where it is the same for all."""
    if not signal_diff.by_joint:
        return None
    limits = [signal_diff.by_joint.get(joint, signal_diff.tolerance.absolute) for joint in group.joints(signal)]
    return np.repeat(limits, len(group.components(signal)) or 1)


def _cases(
    out: SignalDiff,
    passed: SampledCourse,
    b: np.ndarray,
    rows: np.ndarray,
    labels: Sequence[str],
    absolute: np.ndarray | None,
    scores: _Scores,
    places: np.ndarray,
    numbers: np.ndarray,
) -> Iterator[tuple[float, int, DiffPlace, float]]:
    """The cases of a signal whose bits are not known to be the same. rows: of a, to which those of b belong; places: of
    the cases among the matched ones; numbers: in the case table of b. Returns, for those beyond a tolerance, how far
    and where."""
    time = passed.times[rows]
    a = passed.values if len(rows) == len(passed.times) else passed.values[:, rows]
    differences = compare_cases(a, b, out.tolerance, passed, absolute)
    for difference, place, number in zip(differences, places.tolist(), numbers.tolist(), strict=True):
        if difference is None:
            out.identical += 1
            continue
        scores.unlike[place] = True
        where = DiffPlace(
            number, labels[difference.column], float(time[difference.row]), difference.before, difference.after
        )
        _add(out, difference, where)
        out.first = min(out.first, float(time[difference.first]))
        if difference.beyond:
            out.different += 1
            out.first_beyond = min(out.first_beyond, float(time[difference.first_beyond]))
            scores.beyond[place] = True
            yield difference.most, place, where, difference.largest
        else:
            out.equivalent += 1


def _recorded(
    a: ArchiveGroup, b: ArchiveGroup, matched: MatchedCases, about: ExperimentDiff
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Matched cases whose histories both have: their places in `matched`, and along recorded_case in a and b."""
    has_a, has_b = np.isin(matched.a, a.recorded_positions), np.isin(matched.b, b.recorded_positions)
    for mine, theirs, path in ((has_a, has_b, a.path), (has_b, has_a, b.path)):
        alone = int((mine & ~theirs).sum())
        if alone:
            some = "the history of 1 case is" if alone == 1 else f"histories of {alone:,} cases are"
            about.notes.append(f"{some} in {path} alone, and {some.split()[-1]} not compared")
            about.partial = True
    both = np.flatnonzero(has_a & has_b)
    along_a = np.searchsorted(a.recorded_positions, matched.a[both])
    return both, along_a, np.searchsorted(b.recorded_positions, matched.b[both])


def _labels(group: ArchiveGroup, variable: Stored) -> list[str]:
    """The label of each column of a signal: joint, component, or both."""
    joints, components = group.joints(variable), group.components(variable)
    if joints and components:
        return [f"{joint}.{component}" for joint in joints for component in components]
    return list(joints or components or ("",))


def _incomparable(a: ArchiveGroup, b: ArchiveGroup, name: str, role: str) -> str:
    """The reason why a signal or metric cannot be compared; empty where it can."""
    for mine, other in ((a, b), (b, a)):
        if name not in other.variables or other.variables[name].role != role:
            return f"only in {mine.path}"
    stored, two = a.variables[name], b.variables[name]
    if role == "signal" and a.joints(stored) != b.joints(two):
        return f"of {', '.join(a.joints(stored)) or 'no joint'}, now of {', '.join(b.joints(two)) or 'no joint'}"
    if (stored.unit, stored.units_by_joint) != (two.unit, two.units_by_joint):
        return f"in {stored.unit or 'units by joint'} and in {two.unit or 'units by joint'}"
    if role == "signal" and a.components(stored) != b.components(two):
        return "of other components"
    return ""
