"""Joints and guided points that do not follow what they are commanded: found at instants that cases have passed.

A command is judged where it stays the same for a last part of the run, long enough for the joint to reach it. A joint
is reported where its mean error over that part is a large share of the commanded motion and does not shrink. The
setpoints are those of the program's own functions, and positions and rates those of the run.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from met import models
from met.analysis.lanes import LaneTape
from met.frozen import frozen
from met.plan import Experiment
from met.plan.limits import limits
from met.program.cells import AT_LIMIT
from met.program.control import guiding
from met.program.system import PARAMETER, System

SHARE = 0.2
"""Share of the commanded motion up to which an error counts as followed, if not well."""

STAYS, STRAYS = 1e-3, 0.2
"""A command that changes by less than the first is to stay in place, and a joint strays if off by the second; rad, m,
rad/s, m/s."""

SETTLED = 0.01
"""Share of the commanded motion within which a command still changes once it has settled."""

FIRST, LEAST = 0.75, 0.1
"""Shares of the run: the judged part begins after the first of it, and is at least as long as the second."""

FALLS = 0.25
"""Share of its error that a joint which is still on its way loses in a time as long as the run."""


@frozen
class Unfollowed:
    """A joint or guided point that is not where it is commanded to be, or not as fast, as a case ends.

    subject  name of the joint, or of the guide;  kind: `position` or `rate` of a joint, `path` of a guide
    off    root of the mean square of the distance from the setpoint, from `since` to `until`, s
    commanded  what was commanded over the run, 0: to stay: rad, m, rad/s or m/s, as `off`
    weight of the distance, by what is told at all;  case: row of the case table
    limit  path of the limit of its servo that it was at for most of that time; "": none
    """

    subject: str
    kind: str
    off: float
    commanded: float
    weight: float
    since: float
    until: float
    case: int
    limit: str = ""


def unfollowed(
    experiment: Experiment, ticks: Sequence[int], memories: Mapping[int, np.ndarray], cells: Sequence[str]
) -> list[Unfollowed]:
    """The joints with a command of position or rate, and the guides, that are not followed: each in its worst case,
    worst first. Joints whose servo fails, as the deck asks, are left out, and so are those of which a requirement asks
    more than a limit. Raises Problem where a model's function does.

    ticks     of the base rate, rising;  memories: row of the case table -> [tick, cell], as `cells` names these
    """
    system, whole = System(experiment), [case for case, memory in memories.items() if np.isfinite(memory).all()]
    judged = [actuator for actuator in system.working if actuator.command_kind in ("position", "rate")]
    judged = [
        actuator
        for actuator in judged
        if actuator.use.joint not in system.failing and _is_own(experiment, actuator.use.command)
    ]
    judged = [
        actuator for actuator in judged if not _is_required(experiment, actuator.use.joint, actuator.command_kind)
    ]
    guides = [use for use in guiding.ticking(system) if models.find("guide", use.model, use.place).error]
    if not whole or not (judged or guides):
        return []
    tape = _lanes(system, ticks, memories, whole, cells)
    times = np.asarray(ticks) / tape.base_hz
    findings: list[Unfollowed] = []

    def by_case(value: object) -> np.ndarray:
        return np.broadcast_to(np.asarray(value, dtype=float), (tape.lanes,)).reshape(len(whole), len(ticks))

    with np.errstate(all="ignore"):
        for actuator in judged:
            joint, kind = actuator.use.joint, actuator.command_kind
            setpoint = by_case(guiding.setpoint(system, actuator, tape.read, tape.time).value)
            begun = by_case(tape.lane(f"{joint}.q"))[:, :1] if kind == "position" else 0.0
            is_at = by_case(tape.lane(f"{joint}.{'q' if kind == 'position' else 'qd'}"))
            for finding in _not_followed(joint, kind, whole, times, setpoint - begun, np.abs(setpoint - is_at)):
                first = int(np.searchsorted(times, finding.since))
                steps = (ticks[-1] - ticks[first]) // experiment.structure.schedule.dynamics
                counted = dict(zip(cells, memories[finding.case][-1] - memories[finding.case][first], strict=True))
                findings.append(replace(finding, limit=_limit(experiment, joint, counted, steps)))
        for use in guides:
            guiding.tick(system, tape, use)
            way = by_case(guiding.way_along(system, tape, use))
            off = by_case(tape.lane(f"guides.{use.name}.{models.find('guide', use.model, use.place).error}"))
            findings += _not_followed(use.name, "path", whole, times, way, off)
    worst: dict[tuple[str, bool], Unfollowed] = {}
    for finding in sorted(findings, key=lambda finding: (-finding.weight, finding.case)):
        worst.setdefault((finding.subject, finding.kind == "path"), finding)
    return list(worst.values())


def _is_own(experiment: Experiment, command: object) -> bool:
    """True for a command that is a function of time. A setpoint that a guide computes as it runs is judged by the
    guide's own error."""
    guide = getattr(command, "guide", "")
    use = next((use for use in experiment.structure.guides if use.name == guide), None)
    return use is None or models.find("guide", use.model, use.place).course is not None


def _is_required(experiment: Experiment, joint: str, kind: str) -> bool:
    """True where a requirement judges the joint's position or rate by more than a limit: it says how close is close
    enough."""
    most = {requirement.metric for requirement in experiment.requirements if requirement.comparison.startswith(">")}
    channel = f"{joint}.{'q' if kind == 'position' else 'qd'}"
    return any(use.name in most and use.of == channel for use in experiment.structure.metrics)


def _lanes(
    system: System,
    ticks: Sequence[int],
    memories: Mapping[int, np.ndarray],
    cases: Sequence[int],
    cells: Sequence[str],
) -> LaneTape:
    """A lane for each instant of each case, with the case's memory and its own parameters."""
    experiment = system.experiment
    rows = np.repeat(cases, len(ticks))
    swept = {coordinate.path: coordinate.values[rows] for coordinate in experiment.cases.coordinates}
    tape = LaneTape(experiment.structure.schedule.base_hz, swept, len(rows))
    tape.k = np.tile(np.asarray(ticks), len(cases))
    values = experiment.formulas.replay(swept)
    for path in system.varying:
        tape.write(PARAMETER + path, values[experiment.parameters[path].value.output])  # type: ignore[union-attr]
    system.keep_tree(tape.read, tape.write)
    every = np.concatenate([memories[case] for case in cases])
    tape.cells.update({name: every[:, slot] for slot, name in enumerate(cells)})
    return tape


def _not_followed(
    subject: str, kind: str, cases: Sequence[int], times: np.ndarray, way: np.ndarray, off: np.ndarray
) -> Iterator[Unfollowed]:
    """The cases in which a setpoint is not followed.

    way  what is commanded, from where it begins;  off: distance from the setpoint: [case, instant]
    """
    end = float(times[-1])
    for case, setpoint, away in zip(cases, way, off, strict=True):
        most = float(np.max(np.abs(setpoint)))
        commanded = most if most > STAYS else 0.0
        unsettled = np.flatnonzero(np.abs(setpoint - setpoint[-1]) > SETTLED * max(most, 0.1))
        first = max(int(unsettled[-1]) + 1 if len(unsettled) else 0, int(np.searchsorted(times, FIRST * end)))
        if first >= len(times) or end - times[first] < LEAST * end:
            continue
        late, half = away[first:], (first + len(times)) // 2
        mean = float(np.sqrt(np.mean(late * late)))
        bound = SHARE * commanded if commanded else STRAYS
        worst, other = first + int(np.argmax(away[first:half])), half + int(np.argmax(away[half:]))
        falls = (away[worst] - away[other]) * end > FALLS * away[other] * (times[other] - times[worst])
        if mean > bound and not falls:
            yield Unfollowed(subject, kind, mean, commanded, mean / bound, float(times[first]), end, case)


def _limit(experiment: Experiment, joint: str, counted: Mapping[str, float], steps: int) -> str:
    """The limit of a joint's servo at which more than half of these steps began; among several, the one nearest to the
    joint.

    counted  change of the memory over these steps, by cell
    """
    servo = [
        limit.path
        for limit in limits(experiment.structure, experiment.parameters)
        if limit.joint == joint and limit.machine and limit.channels
    ]
    half = 0.5 * steps
    return next((path for path in reversed(servo) if counted.get(AT_LIMIT(path), 0.0) > half), "")
