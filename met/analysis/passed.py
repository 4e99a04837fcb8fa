"""Checks of the step at instants that cases have passed: modes that grow there, and modes that the step misses.

At an instant the arm moves, and its modes are those of A as it is then. They count over the time between neighbouring
instants that both show them; modes that come and go in between are missed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from met import models
from met.analysis.blame import Opened, Unstable, needs
from met.analysis.loops import fastest, growing, growths, least, ticking
from met.analysis.margin import Margin, ends_of_motion, margins, rotor_inertias
from met.analysis.modes import FAST, TELLING, Mode, modes
from met.analysis.step_map import Linearizer, StepMap
from met.analysis.step_size import Remedy, StepFault, chosen_cases, owner_of, remedy, step_size
from met.frozen import frozen
from met.integrators.integrator import Integrator
from met.passing import BESIDE
from met.plan import Experiment

GROWS = 1.0
"""ln of the growth from one instant to others above which it is reported: the earlier state is lost in it."""

NAMES = 2000
"""Largest number of names times instants that is analysed: it bounds the time, to some 20 ms."""

LEAST_INSTANTS, MOST_INSTANTS = 8, 64
"""Smallest and largest number of instants, of all cases together."""

Found = TypeVar("Found")

Owner = tuple[str, str]
"""The part that has the largest share in a mode, as from `met.analysis.step_size.owner_of`."""


@frozen
class Passed:
    """Instants that cases have passed: the lanes of a case are neighbours, and rise.

    case    rows of the case table: [lane]
    tick    of the base rate: [lane]
    memory  cells of the program by name: [lane]
    """

    case: np.ndarray
    tick: np.ndarray
    memory: Mapping[str, np.ndarray]

    def only(self, lanes: np.ndarray) -> Passed:
        """The instants of some lanes only."""
        return Passed(self.case[lanes], self.tick[lanes], {name: values[lanes] for name, values in self.memory.items()})


@frozen
class Lasting:
    """A finding that neighbouring instants of a case all show.

    fault   the worst of it: of the step, or of a servo's loop
    case    row of the case table;  since, until: s from the start of the run
    passed  the worst one's instant, alone
    """

    fault: StepFault | Unstable
    case: int
    since: float
    until: float
    passed: Passed


def instants(experiment: Experiment) -> int:
    """The number of instants that are analysed, of all cases together."""
    names = 2 * len(experiment.structure.moving) + 6 * len(experiment.structure.servos) + 12
    return min(MOST_INSTANTS, max(LEAST_INSTANTS, NAMES // names))


def telling(experiment: Experiment, memory: np.ndarray, cells: Sequence[str], count: int) -> np.ndarray:
    """Places of those `count` instants of a case that say most about its steps: where a joint is at its ends, or
    fastest, and others evenly; each with the instant after it.

    memory  [instant, cell]
    """
    places = {name: slot for slot, name in enumerate(cells)}
    fine = np.flatnonzero(np.isfinite(memory).all(1))
    if len(fine) <= count:
        return fine
    wanted = []
    for joint in experiment.structure.moving:
        q, qd = (memory[fine, places[f"{joint.name}.{part}"]] for part in ("q", "qd"))
        wanted += [int(np.argmax(np.abs(qd))), int(np.argmin(q)), int(np.argmax(q))]
    last = len(fine) // 2 - 1
    pairs = list(dict.fromkeys(min(place // 2, last) for place in wanted))[: count // 4]
    even = np.linspace(0, last, max(1, count // 2 - len(pairs))).astype(int).tolist()
    return fine[sorted({place for pair in {*pairs, *even} for place in (2 * pair, 2 * pair + 1)})]


def lasting(experiment: Experiment, passed: Passed) -> tuple[Lasting, ...]:
    """The findings that last, one of each kind: the worst that is unstable, that is damped, that is fast, and of loops;
    kinds that the starting poses show are left out, since the check has reported them. Raises Problem where the program
    cannot be built."""
    integrator, schedule = models.find("integrator", experiment.structure.integrator), experiment.structure.schedule
    linearizer = Linearizer(experiment, passed.case.tolist(), passed.memory)
    sampled, as_it_is, times = linearizer.sampled(), linearizer.sampled(loose=False), passed.tick / schedule.base_hz
    quiet = np.zeros(len(times), bool)
    if as_it_is is not None and ticking(as_it_is):
        quiet = fastest(as_it_is) <= least(as_it_is, schedule.duration)
    seen = _Seen(_by_owner(as_run(linearizer.map()), integrator, len(times)), times, _stretches(passed), schedule.step)
    held = ticking(sampled) if sampled is not None else frozenset()
    every = [list(seen.growing(quiet)), list(seen.missed(held))]
    if not any(every):
        every.append(list(seen.fast()))
    in_truth = [
        isinstance(candidate.fault, StepFault) and candidate.fault.mode.grows_in_truth(schedule.step)
        for candidate in every[0]
    ]
    if sampled is not None and all(in_truth):
        every.append(_loops(Opened(linearizer, sampled), times, seen.stretches, schedule.duration))
        every[0] = [] if every[-1] else every[0]
    findings = []
    for several in every:
        if several:
            worst = max(several, key=lambda candidate: candidate.weight)
            instant = passed.only(np.array([worst.lane]))
            since, until = float(times[worst.first]), float(times[worst.last])
            findings.append(Lasting(worst.fault, int(passed.case[worst.lane]), since, until, instant))
    return _news(experiment, findings)


@frozen
class _Candidate:
    """A finding that the lanes `first` to `last` show, most clearly at `lane`, and its weight among those of its
    kind."""

    weight: float
    fault: StepFault | Unstable
    lane: int
    first: int
    last: int


@frozen
class _Seen:
    """The modes of each lane by their owners, with the instants of the lanes, s, and the lanes of each case."""

    modes: Sequence[Mapping[Owner, Sequence[Mode]]]
    times: np.ndarray
    stretches: Sequence[tuple[int, int]]
    h: float

    def growing(self, quiet: np.ndarray) -> Iterator[_Candidate]:
        """Modes that the step makes grow by e and more, where no law holds them."""
        by_lane = self._passing(lambda mode, lane: mode.grown(self.h, 1) > 0.0 and not quiet[lane])
        for owner, first, last in _lasting_ones(by_lane, self.stretches):
            of_each = [max(by_lane[lane][owner], key=lambda mode: mode.growth) for lane in range(first, last + 1)]
            grown = _over([mode.grown(self.h, 1) for mode in of_each], self.times[first : last + 1], self.h)
            if grown > GROWS:
                worst = max(of_each, key=lambda mode: mode.growth)
                fault = StepFault("grows", worst, *owner, worst.growth, 0.0, 0.0)
                yield _Candidate(grown, fault, worst.lane, first, last)

    def missed(self, held: frozenset[str]) -> Iterator[_Candidate]:
        """The mode that swings and is damped, or not, unlike in truth over the whole time, judged at its best
        instant."""
        by_lane = self._passing(lambda mode, _: abs(mode.root.imag) > abs(mode.root.real))
        for owner, first, last in _lasting_ones(by_lane, self.stretches):
            steps = round((self.times[last] - self.times[first]) / self.h)

            def lost(mode: Mode, steps: int = steps) -> float:
                run, truth, _ = mode.missed(self.h, steps)
                return abs(run - truth)

            best = min((max(by_lane[lane][owner], key=lost) for lane in range(first, last + 1)), key=lost)
            if lost(best) > TELLING and owner[1] not in held and steps > BESIDE:
                run, truth, k = best.missed(self.h, steps)
                fault = StepFault("misses", best, *owner, run, truth, k * self.h)
                yield _Candidate(lost(best), fault, best.lane, first, last)

    def fast(self) -> Iterator[_Candidate]:
        """Modes whose rate is too fast for the step, |root| h above `FAST`, for longer than some steps: at their worst
        instants."""
        by_lane = self._passing(lambda mode, _: abs(mode.root) * self.h > FAST * (1.0 + 1e-6))
        for owner, first, last in _lasting_ones(by_lane, self.stretches):
            every = [mode for lane in range(first, last + 1) for mode in by_lane[lane][owner]]
            worst = max(every, key=lambda mode: round(abs(mode.root) * self.h, 6))
            figure = abs(worst.root) * self.h
            fault = StepFault("fast", worst, *owner, figure, 0.0, 0.0)
            if round((self.times[last] - self.times[first]) / self.h) > BESIDE:
                yield _Candidate(figure, fault, worst.lane, first, last)

    def _passing(self, telling: Callable[[Mode, int], bool]) -> list[dict[Owner, list[Mode]]]:
        """The modes of each lane and owner that pass a test."""
        return [
            {owner: those for owner, owned in of_lane.items() if (those := [m for m in owned if telling(m, lane)])}
            for lane, of_lane in enumerate(self.modes)
        ]


def _by_owner(step_map: StepMap, integrator: Integrator, lanes: int) -> list[dict[Owner, list[Mode]]]:
    """The modes of each lane by owner, without those that the arm turns away from before they have swung."""
    out: list[dict[Owner, list[Mode]]] = [{} for _ in range(lanes)]
    for mode in modes(step_map, integrator):
        if not mode.turns:
            out[mode.lane].setdefault(owner_of(mode), []).append(mode)
    return out


def _over(growths: Sequence[float], times: np.ndarray, length: float) -> float:
    """ln of the growth over these instants, from growths over a length of time: of two neighbours, the smaller
    counts."""
    return float(np.sum(np.minimum(growths[1:], growths[:-1]) * np.diff(times)) / length)


def lasting_beds(experiment: Experiment, passed: Passed) -> list[tuple[Margin, float]]:
    """The joints whose motor on a bed is unstable with the heaviest or the lightest arm that neighbouring instants of a
    case both show, and the first of these instants, s. Joints that are unstable in the starting pose are left out."""
    if not experiment.structure.substitutions:
        return []
    Lambda = Linearizer(experiment, passed.case.tolist(), passed.memory).loads()
    unstable: dict[str, tuple[Margin, float]] = {}
    for first, last in _stretches(passed):
        case = int(passed.case[first])
        rotors = rotor_inertias(experiment, case)
        motions = np.array([ends_of_motion(matrix, rotors) for matrix in Lambda[first : last + 1]])
        if last == first or not np.isfinite(motions).all():
            continue
        least, most = np.maximum(*_pairs(motions[:, 0])), np.minimum(*_pairs(motions[:, 1]))
        (begun,) = margins(experiment, [case])
        for margin in begun:
            for place in (int(np.argmax(most)), int(np.argmin(least))):
                then = replace(margin, least=float(least[place]), together=float(most[place]))
                if margin.stable and not then.stable and margin.joint not in unstable:
                    time = float(passed.tick[first + place]) / experiment.structure.schedule.base_hz
                    unstable[margin.joint] = then, time
    return list(unstable.values())


def _pairs(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return values[1:], values[:-1]


def remedy_of(experiment: Experiment, finding: Lasting) -> Remedy:
    """The remedy for a mode that lasts, as it is at its worst instant."""
    assert isinstance(finding.fault, StepFault)
    step_map = as_run(Linearizer(experiment, finding.passed.case.tolist(), finding.passed.memory).map())
    fault = replace(finding.fault, mode=replace(finding.fault.mode, lane=0))
    return remedy(experiment, step_map, fault, finding.passed.memory)


def as_run(step_map: StepMap) -> StepMap:
    """The lanes with the run's own state, numbered by instant."""
    own = ~step_map.loose
    return replace(
        step_map, case=step_map.case[own], loose=step_map.loose[own], slope=step_map.slope[own], rate=step_map.rate[own]
    )


def _stretches(passed: Passed) -> list[tuple[int, int]]:
    """First and last lane of each case."""
    ends = np.flatnonzero(np.diff(passed.case)).tolist()
    return list(zip([0, *(end + 1 for end in ends)], [*ends, len(passed.case) - 1], strict=True))


def _lasting_ones(
    by_lane: Sequence[Mapping[Found, object]], stretches: Sequence[tuple[int, int]]
) -> Iterator[tuple[Found, int, int]]:
    """Each owner with the first and last of two or more neighbouring lanes of a case that all have it."""
    for first, last in stretches:
        for owner in dict.fromkeys(lane_owner for lane in range(first, last + 1) for lane_owner in by_lane[lane]):
            since = None
            for lane in range(first, last + 2):
                if lane <= last and owner in by_lane[lane]:
                    since = lane if since is None else since
                elif since is not None:
                    if lane - 1 > since:
                        yield owner, since, lane - 1
                    since = None


def _loops(
    opened: Opened, times: np.ndarray, stretches: Sequence[tuple[int, int]], duration: float
) -> list[_Candidate]:
    """The loops that are unstable for longest, with laws that have no stored integrals, as in all loose lanes."""
    loops = opened.loops
    rates, ticks = np.full(len(times), -math.inf), np.zeros(len(times), bool)
    for lane, limit, by_ticks in growing(loops, fastest(loops), duration):
        if opened.lane(lane, limit, by_ticks).concerned():
            ticks[lane], rates[lane] = by_ticks, growths(loops, np.array([lane]), ticks=by_ticks).max()
    by_lane = [{"": None} if rate > 0.0 else {} for rate in rates.tolist()]
    several = [
        (_over(rates[first : last + 1].tolist(), times[first : last + 1], 1.0), first, last)
        for _, first, last in _lasting_ones(by_lane, stretches)
    ]
    for grown, first, last in sorted(several, reverse=True):
        lane = first + int(np.argmax(np.round(rates[first : last + 1] / rates[first : last + 1].max(), 4)))
        limit = GROWS / (times[last] - times[first])
        blame = opened.blamed(opened.lane(lane, limit, bool(ticks[lane]))) if grown > GROWS else []
        if blame:
            return [_Candidate(grown, min(blame, key=needs), lane, first, last)]
    return []


def _news(experiment: Experiment, findings: Sequence[Lasting]) -> tuple[Lasting, ...]:
    """The findings of those kinds that the starting poses do not show; the check has reported the others."""
    if not findings:
        return ()
    begun = step_size(experiment, chosen_cases(experiment))
    kinds = {fault.kind for fault in begun.faults}
    if "grows" in kinds or "misses" in kinds:
        kinds.add("fast")
    loops = bool(begun.loops) or "grows" in kinds
    return tuple(
        finding
        for finding in findings
        if (not loops if isinstance(finding.fault, Unstable) else finding.fault.kind not in kinds)
    )
