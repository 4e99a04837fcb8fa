"""The difference of two archives, in bounded memory: what made them, status, metrics, signals, and the worst cases."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from batch.archive.read import ArchiveFile, Group, Stored
from batch.differences import matching
from batch.differences.changed import changed
from batch.differences.compare import Difference, compare
from batch.differences.found import Diff, Ended, Experiment, Place, Ranked, Signal
from batch.differences.matching import Cases
from batch.differences.samples import samples
from batch.differences.tolerance import Tolerance, Tolerances, check

WORST = 20
"""Cases that are ranked."""


def diff(a: str | Path, b: str | Path, given: Tolerances | None = None, *, distributions: bool = False) -> Diff:
    """Compare two archives. given: tolerances; None: nothing may differ. distributions: compare metrics as samples even
    where the seeds are the same. Raises Problem."""
    with ArchiveFile(a) as file_a, ArchiveFile(b) as file_b:
        pairs, only_a, only_b = matching.experiments(file_a, file_b)
        allowed = given or Tolerances()
        _check(allowed, [*file_a.groups, *file_b.groups])
        found = tuple(_experiment(group_a, group_b, allowed, distributions) for group_a, group_b in pairs)
        return Diff(
            Path(a), Path(b), allowed, changed(file_a, file_b, pairs), found,
            tuple(group.name for group in only_a), tuple(group.name for group in only_b),
        )  # fmt: skip


def _check(allowed: Tolerances, groups: Sequence[Group]) -> None:
    units, shown = {}, []
    for group in groups:
        for variable in (*group.role("signal"), *group.role("metric")):
            units[variable.name] = variable.unit or (variable.units_by_joint or ("1",))[0]
            shown.append(variable.name)
            if variable.role == "signal":
                for joint, unit in zip(group.joints(variable), _units(group, variable), strict=True):
                    units[f"{joint}.{variable.name}"] = unit
    check(allowed, units, list(dict.fromkeys(shown)))


def _units(group: Group, variable: Stored) -> Sequence[str]:
    return variable.units_by_joint or [variable.unit] * len(group.joints(variable))


def _experiment(a: Group, b: Group, allowed: Tolerances, distributions: bool) -> Experiment:
    matched = matching.cases(a, b)
    out = Experiment(a.name, b.name, matched)
    out.only_a = a.values("case")[matched.only_a].tolist()
    out.only_b = b.values("case")[matched.only_b].tolist()
    scores = _Scores(matched.count)
    _ended(a, b, matched, out)
    for name in matching.names([v.name for v in a.role("metric")], [v.name for v in b.role("metric")]):
        out.signals.append(_metric(a, b, matched, name, allowed, scores))
    out.signals += _signals(a, b, matched, allowed, scores, out.notes)
    _requirements(a, b, matched, out)
    out.worst = scores.ranked(a, b, matched)
    out.cases_different = int(scores.beyond.sum())
    if distributions or _other_noise(a, b):
        out.samples = samples(a, b)
    return out


def _other_noise(a: Group, b: Group) -> bool:
    """Whether the two have other seeds, so that single cases differ by chance."""
    return not np.array_equal(np.unique(a.values("seed")), np.unique(b.values("seed")))


def _ended(a: Group, b: Group, matched: Cases, out: Experiment) -> None:
    """Cases that ended otherwise, or earlier, or for another cause."""
    status, rows = ([group.values(name) for group in (a, b)] for name in ("status", "n_valid"))
    here, there = status[0][matched.a], status[1][matched.b]
    unlike = (here != there) | ((here != 0) & (rows[0][matched.a] != rows[1][matched.b]))
    places = np.flatnonzero(unlike)
    if not len(places):
        return
    names = ("case", "case_id", "cause")
    told = {name: (a.at(name, matched.a[places]), b.at(name, matched.b[places])) for name in names}
    for i, place in enumerate(places.tolist()):
        out.ended.append(Ended(
            int(told["case"][1][i]), str(told["case_id"][1][i]), int(here[place]), int(there[place]),
            str(told["cause"][0][i]), str(told["cause"][1][i]), int(rows[0][matched.a[place]]),
            int(rows[1][matched.b[place]]),
        ))  # fmt: skip


def _requirements(a: Group, b: Group, matched: Cases, out: Experiment) -> None:
    """By requirement of both: how many matched cases meet it in a, and in b."""
    if "met" not in a.variables or "met" not in b.variables:
        return
    texts_a, texts_b = ([str(text) for text in group.values("requirement")] for group in (a, b))
    met_a, met_b = a.values("met"), b.values("met")
    for text in texts_a:
        if text in texts_b:
            here, there = met_a[matched.a, texts_a.index(text)] == 1, met_b[matched.b, texts_b.index(text)] == 1
            out.requirements.append((text, int(here.sum()), int(there.sum())))


class _Scores:
    """How badly each matched case differs, and where most."""

    def __init__(self, count: int) -> None:
        self.score = np.zeros(count)
        self.beyond = np.zeros(count, bool)
        self.where: dict[int, tuple[str, Place, float]] = {}

    def take(self, place: int, score: float, signal: str, where: Place, difference: float) -> None:
        """Of one case; of the many only those that may be among the worst keep where."""
        self.beyond[place] = True
        if score > self.score[place] or place not in self.where:
            self.score[place] = max(score, self.score[place])
            self.where[place] = (signal, where, difference)
            if len(self.where) > 50 * WORST:
                kept = sorted(self.where, key=lambda each: -self.score[each])[:WORST]
                self.where = {each: self.where[each] for each in kept}

    def ranked(self, a: Group, b: Group, matched: Cases) -> list[Ranked]:
        places = sorted(self.where, key=lambda each: (-self.score[each], each))[:WORST]
        if not places:
            return []
        case_a, case_b = a.at("case", matched.a[places]), b.at("case", matched.b[places])
        ids = b.at("case_id", matched.b[places])
        return [
            Ranked(int(case_a[i]), int(case_b[i]), str(ids[i]), self.where[place][0], float(self.score[place]),
                   self.where[place][1], self.where[place][2])
            for i, place in enumerate(places)
        ]  # fmt: skip


# Metrics


def _metric(a: Group, b: Group, matched: Cases, name: str, allowed: Tolerances, scores: _Scores) -> Signal:
    unit = (a if name in a.variables else b).variables[name].unit
    out = Signal(name, unit, True, allowed.of(name))
    out.why = _incomparable(a, b, name, "metric")
    if out.why:
        return out
    values_a, values_b = a.values(name)[matched.a], b.values(name)[matched.b]
    finite = values_a[np.isfinite(values_a)]
    if len(finite):
        out.low, out.high = float(finite.min()), float(finite.max())
    out.compared = matched.count
    tolerance = Tolerance(out.tolerance.absolute, out.tolerance.relative)
    found = compare(values_a[:, None], values_b[:, None], tolerance)
    if found is None:
        out.identical = out.compared
        return out
    _add(out, found)
    case = int(b.at("case", [matched.b[found.row]])[0])
    out.place = Place(case, "", float("nan"), found.before, found.after)
    unlike = np.flatnonzero((values_a.view(np.int64) != values_b.view(np.int64))
                            & ~(np.isnan(values_a) & np.isnan(values_b)))  # fmt: skip
    out.identical = out.compared - len(unlike)
    out.different = found.beyond
    out.equivalent = len(unlike) - found.beyond
    if found.beyond:
        _rank_metric(out, values_a, values_b, tolerance, unlike, scores, b, matched)
    return out


def _rank_metric(
    out: Signal, a: np.ndarray, b: np.ndarray, allowed: Tolerance, unlike: np.ndarray, scores: _Scores, group: Group,
    matched: Cases,
) -> None:  # fmt: skip
    with np.errstate(invalid="ignore"):
        apart = np.abs(b[unlike] - a[unlike])
    limit = allowed.absolute + allowed.relative * np.maximum(np.abs(a[unlike]), np.abs(b[unlike]))
    nan = np.isnan(apart)
    over = nan | (apart > limit)
    unit = _unit_of(out)
    score = np.where(nan, np.inf, apart / unit)
    scores.beyond[unlike[over]] = True
    worst = np.flatnonzero(over)[np.argsort(-score[over], kind="stable")[:WORST]]
    cases = group.at("case", matched.b[unlike[worst]])
    for i, place in enumerate(worst.tolist()):
        at = int(unlike[place])
        where = Place(int(cases[i]), "", float("nan"), float(a[at]), float(b[at]))
        scores.take(at, float(score[place]), out.name, where, float(apart[place]))


def _unit_of(signal: Signal) -> float:
    """What a difference is measured by to rank cases: the tolerance, else what the values of a span."""
    span = signal.high - signal.low
    return signal.tolerance.absolute or (span if span > 0.0 else 0.0) or max(abs(signal.high), 1e-300)


def _add(out: Signal, found: Difference) -> None:
    out.largest = max(out.largest, found.largest)
    out.squares += found.squares
    out.values += found.values
    out.used = max(out.used, found.used)
    out.nan += found.nan


# Signals


def _signals(
    a: Group, b: Group, matched: Cases, allowed: Tolerances, scores: _Scores, notes: list[str]
) -> Iterator[Signal]:
    names = matching.names([v.name for v in a.role("signal")], [v.name for v in b.role("signal")])
    if not names:
        return
    places, ia, ib = _recorded(a, b, matched, notes)
    time_a, time_b = (group.values("time") if "time" in group.variables else np.empty(0) for group in (a, b))
    rows_a, rows_b = matching.instants(time_a, time_b, allowed.time)
    if len(rows_a) < max(len(time_a), len(time_b)) and len(time_a) and len(time_b):
        of = f"of {len(time_a):,} and {len(time_b):,}"
        notes.append(f"signals are compared at the {len(rows_a):,} instants that both have, {of}")
    aligned = len(rows_a) == len(time_a) == len(time_b)
    for name in names:
        unit = (a if name in a.variables else b).variables[name].unit
        out = Signal(name, unit, False, allowed.of(name))
        out.why = _incomparable(a, b, name, "signal") or ("" if len(rows_a) else "the two have no instant in common")
        if not out.why:
            labels = _labels(a, a.variables[name])
            limits = [allowed.of(f"{label.partition('.')[0]}.{name}").absolute for label in labels]
            for place, at_a, at_b in zip(places.tolist(), ia.tolist(), ib.tolist(), strict=True):
                out.compared += 1
                if aligned and (raw := a.raw(name, at_a)) is not None and raw == b.raw(name, at_b):
                    out.identical += 1
                    continue
                values_a, values_b = a.recorded_signal(name, at_a), b.recorded_signal(name, at_b)
                values_a = values_a.reshape(len(values_a), -1)[rows_a].astype(np.float64)
                values_b = values_b.reshape(len(values_b), -1)[rows_b].astype(np.float64)
                _case(out, values_a, values_b, time_a[rows_a], labels, limits, scores, place, b, matched)
        yield out


def _case(
    out: Signal, a: np.ndarray, b: np.ndarray, time: np.ndarray, labels: Sequence[str], limits: Sequence[float],
    scores: _Scores, place: int, group: Group, matched: Cases,
) -> None:  # fmt: skip
    """One case of a signal whose bits are not all the same, or may not be."""
    finite = a[np.isfinite(a)]
    if len(finite):
        out.low, out.high = min(out.low, float(finite.min())), max(out.high, float(finite.max()))
    tolerance = out.tolerance
    if any(limits):  # of single joints: what such a limit allows counts as what the signal's would
        tolerance = Tolerance(1.0, 0.0, tolerance.time)
        scale = np.array([limit or out.tolerance.absolute or 1e-300 for limit in limits])
        found = compare(a / scale, b / scale, tolerance, time)
        plain = compare(a, b, Tolerance(np.inf), time)
        if found is not None and plain is not None:
            found = replace(plain, beyond=found.beyond, first_beyond=found.first_beyond, used=found.used)
    else:
        found = compare(a, b, tolerance, time)
    if found is None:
        out.identical += 1
        return
    case = int(group.at("case", [matched.b[place]])[0])
    where = Place(case, labels[found.column], float(time[found.row]), found.before, found.after)
    if found.largest > out.largest or out.place is None:
        out.place = where
    _add(out, found)
    out.first = min(out.first, float(time[found.first]))
    if found.beyond:
        out.different += 1
        out.first_beyond = min(out.first_beyond, float(time[found.first_beyond]))
        score = float("inf") if found.nan else found.largest / _unit_of(out)
        scores.take(place, score, out.name, where, found.largest)
    else:
        out.equivalent += 1


def _recorded(
    a: Group, b: Group, matched: Cases, notes: list[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Matched cases whose histories both have: their places in `matched`, and along recorded_case of a and b."""
    has_a, has_b = np.isin(matched.a, a.recorded_positions), np.isin(matched.b, b.recorded_positions)
    for mine, theirs, path in ((has_a, has_b, a.path), (has_b, has_a, b.path)):
        alone = int((mine & ~theirs).sum())
        if alone:
            notes.append(f"histories of {alone:,} cases are in {path} alone, and are not compared")
    both = np.flatnonzero(has_a & has_b)
    along_a = np.searchsorted(a.recorded_positions, matched.a[both])
    return both, along_a, np.searchsorted(b.recorded_positions, matched.b[both])


def _labels(group: Group, variable: Stored) -> list[str]:
    """What each column of a signal is called: joint, component, or both."""
    joints, components = group.joints(variable), group.components(variable)
    if joints and components:
        return [f"{joint}.{component}" for joint in joints for component in components]
    return list(joints or components or ("",))


def _incomparable(a: Group, b: Group, name: str, role: str) -> str:
    """Why a signal or metric cannot be compared; empty where it can."""
    for mine, other in ((a, b), (b, a)):
        if name not in other.variables or other.variables[name].role != role:
            return f"only in {mine.path}"
    one, two = a.variables[name], b.variables[name]
    if (one.unit, one.units_by_joint) != (two.unit, two.units_by_joint):
        return f"in {one.unit or 'units by joint'} and in {two.unit or 'units by joint'}"
    if role == "signal" and (a.joints(one), a.components(one)) != (b.joints(two), b.components(two)):
        return "of other joints or components"
    return ""


