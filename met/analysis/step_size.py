"""Modes of the whole linearised arm which the step of the dynamics makes grow, damps, or is long for."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Literal

import numpy as np

from met import models
from met.analysis.chains import chains, numbered, ticks_and_steps
from met.analysis.loops import MOST_EVENTS, fastest, growing, least, ticking
from met.analysis.memo import AnalysisMemo
from met.analysis.modes import FAST, TELLING, Mode, modes, of_lane, slowest
from met.analysis.step_map import Linearizer, StepMap
from met.analysis.step_map import TooLarge as TooLarge
from met.diagnostic import Problem
from met.frozen import frozen
from met.integrators.integrator import Integrator
from met.plan import BASE, Experiment
from met.plan.columns import ends

if TYPE_CHECKING:
    from met.analysis.blame import Unstable

LANES = 300
"""Largest number of names times cases that is analysed: it bounds the time, to some 50 ms."""


MOST_STATES = 1000
"""Number of states of an arm or chain beyond which a check leaves out the analysis: the time goes with the cube of
it."""


@frozen
class StepFault:
    """A mode that the step does not follow.

    kind     "grows"; "misses": it is damped, or not damped, as in truth it is not; "fast": its h |lambda| is large
    owner    what takes part in it most: `joint \\`elbow\\``, `the base` ...; joint: its name where it is one
    figure   "grows": ln of the growth of a step; "misses": its size in the end, or where most of it is missed, as a
             share; "fast": h |lambda|
    truth    "misses": what is right
    after    "misses": s from the start
    """

    kind: Literal["grows", "misses", "fast"]
    mode: Mode
    owner: str
    joint: str
    figure: float
    truth: float
    after: float


@frozen
class Remedy:
    """The remedy for a mode that the step does not follow.

    rate     the slowest rate at which it is followed, Hz; None: none that is sensible
    others   integrators that follow it at this rate: of what is fast for its step none of order 1
    cause    the environment model without which it would not be so; "" where none is
    """

    rate: float | None
    others: tuple[str, ...]
    cause: str


@frozen
class StepSize:
    """The findings on some cases: the cases; the fastest mode of the first, its owner and joint, where there is one;
    the largest h |lambda|; ln of the largest growth over a run; the worst fault of each kind; whether all slopes are
    finite; unstable loops of sampled servos; and the map that all this comes from."""

    cases: tuple[int, ...]
    mode: Mode | None
    owner: str
    joint: str
    fastest: float
    grown: float
    faults: tuple[StepFault, ...]
    finite: bool
    loops: tuple[Unstable, ...]
    map: StepMap

    def without_matrices(self) -> StepSize:
        """The findings without matrices, to save memory: of the map, only the cases are kept."""
        nothing = np.empty(0)
        return replace(self, map=replace(self.map, names=(), slope=nothing))


def chosen_cases(experiment: Experiment, also: Iterable[int] = ()) -> tuple[int, ...]:
    """The first case, those in which each coordinate is smallest and largest, and `also`; as many as time allows."""
    wanted = [0, *also]
    for coordinate in experiment.cases.coordinates:
        wanted += ends(coordinate.values)
    joints, states = len(experiment.structure.moving), 6 * len(experiment.structure.servos)
    most = max(2, LANES // (2 * joints + states + 12))
    chosen = list(dict.fromkeys(case for case in wanted if case < experiment.cases.count))[:most]
    if len(chosen) < most:
        even = np.linspace(0, experiment.cases.count - 1, min(experiment.cases.count, most)).astype(int).tolist()
        chosen += [case for case in even if case not in chosen][: most - len(chosen)]
    return tuple(chosen)


def step_size(
    experiment: Experiment, cases: Sequence[int], memo: AnalysisMemo | None = None, *, most: float = math.inf
) -> StepSize:
    """The modes of these cases that the step should follow, and its faults. Raises Problem where the program cannot be
    built, TooLarge where what is analysed has more than `most` states.

    Chains of a large arm that do not act on each other are analysed one by one, and the whole arm only where one has a
    fault. memo: answers about other experiments, which may have equal chains
    """
    parts = chains(experiment) if ticks_and_steps(experiment.structure) <= MOST_EVENTS else ()
    memo = memo if memo is not None else AnalysisMemo()
    of_parts = list[StepSize]()
    for part, names in map(numbered, parts):
        of_part = memo.answer("steps of a chain", part, partial(_of_chain, part, cases, memo, most), cases)
        if of_part is None:
            break
        of_parts.append(_named(of_part, names))
    if parts and len(of_parts) == len(parts):
        return _together(of_parts)
    return _Look(experiment, cases, most).judged(experiment)


def _of_chain(chain: Experiment, cases: Sequence[int], memo: AnalysisMemo, most: float) -> StepSize | None:
    """The findings on a chain, without matrices; None where it has a fault, so that the whole arm is to be analysed."""
    looked = _look(chain, cases, memo, most)
    if looked.may_grow(chain):
        return None
    findings = looked.judged(chain)
    if findings.faults or not findings.finite:
        return None
    mode = findings.mode
    if mode is not None:  # of the mode's participants only the owner is needed
        owner = next(name for name in mode.names if _owner(name) == (findings.owner, findings.joint))
        mode = replace(mode, names=(owner,), weights=np.ones(1))
    return replace(findings.without_matrices(), mode=mode)


def _look(part: Experiment, cases: Sequence[int], memo: AnalysisMemo, most: float) -> _Look:
    """The modes and frames of a chain, which are the same however long it runs."""
    schedule = replace(part.structure.schedule, ticks=part.structure.schedule.dynamics)
    endless = replace(part, structure=replace(part.structure, schedule=schedule))
    return memo.answer_of_now("look", endless, lambda: _Look(endless, cases, most), cases)


def _named(findings: StepSize, names: Mapping[str, str]) -> StepSize:
    """The findings on a chain with the arm's own names for its joints. names: the arm's names by the chain's"""
    if findings.mode is None:
        return findings
    ways = (name.partition(".") for name in findings.mode.names)
    mode = replace(findings.mode, names=tuple(f"{names[head]}.{rest}" for head, _, rest in ways))
    owner, joint = owner_of(mode)
    return replace(findings, mode=mode, owner=owner, joint=joint)


def _together(parts: Sequence[StepSize]) -> StepSize:
    """The findings on an arm without faults, from those on its chains."""
    first = parts[0].without_matrices()
    quickest = max((part for part in parts if part.mode is not None), key=_speed_key, default=first)
    return replace(
        first,
        mode=quickest.mode,
        owner=quickest.owner,
        joint=quickest.joint,
        fastest=max(part.fastest for part in parts),
        grown=max(part.grown for part in parts),
    )


def _speed_key(findings: StepSize) -> tuple[float, bool]:
    """The sort key of findings by the fastest mode of the first case."""
    assert findings.mode is not None
    return _speed(findings.mode, findings.map.h)


def _speed(mode: Mode, h: float) -> tuple[float, bool]:
    return round(abs(mode.root) * h, 6), not mode.loose


class _Look:
    """An arm's modes and frames in some cases, without regard to the length of a run."""

    def __init__(self, experiment: Experiment, cases: Sequence[int], most: float) -> None:
        self.cases = cases
        self.linearizer = Linearizer(experiment, cases, most=most)
        self.map, self.sampled = self.linearizer.map(), self.linearizer.sampled()
        self.modes = list(modes(self.map, models.find("integrator", experiment.structure.integrator)))
        self.rates = fastest(self.sampled) if self.sampled is not None else np.zeros(len(cases))

    def may_grow(self, experiment: Experiment) -> bool:
        """True where a loop may be unstable, or a frame is not finite."""
        if self.sampled is None:
            return False
        duration = experiment.structure.schedule.duration
        growing_lanes = any(True for _ in growing(self.sampled, self.rates, duration))
        return growing_lanes or bool(np.any(self.rates > least(self.sampled, duration)))

    def judged(self, experiment: Experiment) -> StepSize:
        """The findings for a run of this length."""
        schedule, step_map, every, sampled = experiment.structure.schedule, self.map, self.modes, self.sampled
        steps, h = schedule.ticks // schedule.dynamics, step_map.h
        held = ticking(sampled) if sampled is not None else frozenset()
        quiet = np.zeros(len(self.cases), bool)
        loops: tuple[Unstable, ...] = ()
        if sampled is not None:
            quiet = self.rates <= least(sampled, schedule.duration) if held else quiet
            lanes = list(growing(sampled, self.rates, schedule.duration))
            if lanes:
                from met.analysis.blame import closed

                loops = closed(self.linearizer, sampled, lanes)
        faults = list(_faults(every, quiet, held, h, steps))
        fast = max(every, key=lambda mode: _speed(mode, h), default=None)
        first = [mode for mode in every if mode.case == self.cases[0]]
        quickest = max(first, key=lambda mode: _speed(mode, h), default=None)
        return StepSize(
            tuple(self.cases),
            quickest,
            *(owner_of(quickest) if quickest is not None else ("", "")),
            abs(fast.root) * h if fast is not None else 0.0,
            max((mode.grown(h, steps) for mode in every), default=0.0),
            tuple(faults),
            bool(np.isfinite(step_map.slope).all()),
            loops,
            step_map,
        )


def _faults(
    every: Sequence[Mode], quiet: np.ndarray, held: Collection[str], h: float, steps: int
) -> Iterator[StepFault]:
    """The worst fault of each kind. quiet: cases whose frames do not grow;  held: joints whose laws tick"""
    growing_modes = [
        candidate
        for candidate in every
        if candidate.grown(h, steps) > np.log1p(TELLING) and not quiet[candidate.lane // 2]
    ]
    if growing_modes:
        worst = max(growing_modes, key=lambda candidate: (candidate.growth, not candidate.loose))
        yield StepFault("grows", worst, *owner_of(worst), worst.growth, 0.0, 0.0)
    missing = [(candidate, *candidate.missed(h, steps)) for candidate in every]
    missing = [miss for miss in missing if abs(miss[1] - miss[2]) > TELLING and owner_of(miss[0])[1] not in held]
    if missing:
        mode, run, truth, k = max(missing, key=lambda miss: (abs(miss[1] - miss[2]), not miss[0].loose))
        yield StepFault("misses", mode, *owner_of(mode), run, truth, k * h)
    fast = max(every, key=lambda candidate: _speed(candidate, h), default=None)
    if fast is not None and abs(fast.root) * h > FAST * (1.0 + 1e-6):
        yield StepFault("fast", fast, *owner_of(fast), abs(fast.root) * h, 0.0, 0.0)


def remedy(
    experiment: Experiment, step_map: StepMap, fault: StepFault, memory: Mapping[str, np.ndarray] | None = None
) -> Remedy:
    """The rate and the integrators that remove a fault, and the environment model that causes it.

    step_map  has the mode;  memory: of the case at its instant, one lane, as `Linearizer` takes it
    """
    structure, mode = experiment.structure, fault.mode
    integrator = models.find("integrator", structure.integrator)
    steps = structure.schedule.ticks // structure.schedule.dynamics
    followed = abs(mode.root) * step_map.h <= FAST
    others = tuple(
        name
        for name, other in models.find_own("integrator").items()
        if name != integrator.name and fault.kind != "fast" and (followed or other.order > 1)
        if _followed(step_map, mode, other, steps)
    )
    rate = slowest(step_map, mode, integrator, structure.schedule, follows=fault.kind != "grows")
    return Remedy(rate, others, _cause(experiment, mode, fault.kind, memory))


def owner_of(mode: Mode) -> tuple[str, str]:
    """The owner of a mode, which has the largest share in it, in words; and the joint's name where it is one, or its
    servo."""
    sums: dict[tuple[str, str], float] = {}
    for name, share in mode.shares:
        owner = _owner(name)
        sums[owner] = sums.get(owner, 0.0) + share
    return max(sums, key=lambda owner: round(sums[owner], 6))


def _owner(name: str) -> tuple[str, str]:
    """The owner of a state, in words, and the joint that it is of ("": none). name: of its cell"""
    head, _, rest = name.partition(".")
    if head.startswith(f"{BASE}:"):
        return "the base", ""
    if head.startswith("payload:"):
        return f"payload `{head.split(':')[1]}`", ""
    if head == "sensors":
        return f"sensor `{rest.partition('.')[0]}`", ""
    if rest.startswith("servo.sensor."):
        return f"sensor `{rest.split('.')[2]}` of joint `{head}`", head
    return f"joint `{head}`", head


def _followed(step_map: StepMap, mode: Mode, integrator: Integrator, steps: int) -> bool:
    """True where another integrator makes no mode of the lane grow with this step, and misses none."""
    for other in modes(of_lane(step_map, mode.lane, step_map.h), integrator):
        run, truth, _ = other.missed(step_map.h, steps)
        if other.grown(step_map.h, steps) > np.log1p(TELLING) or abs(run - truth) > TELLING:
            return False
    return True


def _cause(experiment: Experiment, mode: Mode, kind: str, memory: Mapping[str, np.ndarray] | None) -> str:
    """The environment model without which the case has no mode that fast, or none that grows so."""
    structure = experiment.structure
    integrator = models.find("integrator", structure.integrator)
    for use in structure.environment:
        if models.find("environment", use.model).loads is None:
            continue
        rest = tuple(other for other in structure.environment if other is not use)
        try:
            without = replace(experiment, structure=replace(structure, environment=rest))
            step_map = Linearizer(without, [mode.case], memory).map()
        except Problem:
            continue
        lanes = [other for other in modes(step_map, integrator) if other.loose == mode.loose]
        if kind == "grows" and all(lane.growth < 0.5 * mode.growth for lane in lanes):
            return use.name
        if kind != "grows" and all(abs(lane.root) < 0.8 * abs(mode.root) for lane in lanes):
            return use.name
    return ""
