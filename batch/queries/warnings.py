"""Warnings about an archive's finished cases: errors due to the step, limits of machines and joints, grapples,
times beyond the run's end, and axes of sweeps without an effect.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from batch.queries import at_limits
from batch.queries.requirements import GroupRequirement, group_requirements
from batch.queries.signals import number_text
from batch.queries.step_errors import warning as step_errors
from batch.queries.tallies import summed_up
from ic.meaning.checks.reach import flies_from_afar
from ic.printing.columns import count as counted
from met import models
from met.diagnostic import Diagnostic, Problem, warning
from met.plan.outputs import GRAPPLE_FIGURES
from met.run import DONE

if TYPE_CHECKING:
    from batch.archive.read import ArchiveGroup
    from met.plan import Experiment


FAST, TURNING = 1.0, 10.0
"""m/s and rad/s: at these rates a payload moves 0.1 m, or turns by a radian, in the tenth of a second that a gripper
needs to close."""


def grapple_warnings(group: ArchiveGroup, experiment: Experiment | None = None) -> list[Diagnostic]:
    """The warning about grapples of an experiment, if there is one: about the worst, with the other payloads by name.

    experiment  of the plan, for places; what the check tells of it is not told again
    """
    figures: dict[str, dict[str, np.ndarray]] = {}
    for variable in group.role("grapple"):
        grappled, name = (str(variable.attributes.get(attribute)) for attribute in ("of", "figure"))
        figures.setdefault(grappled, {})[name] = group.values(variable.name)
    bad = {}
    for payload, payload_figures in figures.items():
        if set(payload_figures) != set(GRAPPLE_FIGURES) or (
            experiment is not None and flies_from_afar(experiment, payload)
        ):
            continue
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = [
                payload_figures["distance"] / payload_figures["near"],
                payload_figures["speed"] / FAST,
                payload_figures["rate"] / TURNING,
            ]
        worst = np.nan_to_num(np.max(ratios, axis=0), posinf=np.finfo(float).max)
        if (worst > 1.0).any():
            bad[payload] = worst
    if not bad or group.allows("D347"):
        return []
    payload = max(bad, key=lambda candidate: float(bad[candidate].max()))
    row, cases = int(bad[payload].argmax()), int((bad[payload] > 1.0).sum())
    distance, near, speed, rate, energy = (float(figures[payload][name][row]) for name in GRAPPLE_FIGURES)
    how, helps = [], []
    if distance > near:
        how.append(f"{number_text(distance)} m from its place")
        helps.append(
            "let it be there by then: change its `position`, `velocity` or `grapple`, or the arm's motion; "
            f"`payloads.{payload}.distance` is how far it is"
        )
    motion = [(speed, FAST, "m/s"), (rate, TURNING, "rad/s")]
    against = [f"{number_text(value)} {unit}" for value, most, unit in motion if value > most]
    if against:
        how.append(f"at {' and '.join(against)} against its link")
        helps.append("let the link go along with it by then: no gripper closes on what moves so fast")
    many = f", in {cases:,} of {group.count:,} cases, worst in #{group.values('case')[row]}"
    if len(bad) > 1:
        helps.append(f"also grappled so: {', '.join(f'`{other}`' for other in bad if other != payload)}")
    message = (
        f"payload `{payload}` is grappled {', '.join(how)}{many if group.count > 1 else ''}: momentum is kept, and "
        f"{number_text(energy)} J are lost at once"
    )
    place = at_limits.place_of_parameter(experiment, f"payloads.{payload}.grapple")
    return [warning("D347", message, place, help=helps)]


def undecided_warnings(group: ArchiveGroup, experiment: Experiment | None = None) -> list[Diagnostic]:
    """The warnings about times that a run is too short to show, and about times that are 0 in all cases: of each kind
    about the first requirement, with the others by name.

    experiment  of the plan, for places
    """
    duration, undecided, none = float(group.attributes["duration_s"]), [], []
    for requirement in () if group.allows("D341") else group_requirements(group):
        times = group.values(requirement.metric)
        if not _is_time(str(group.variables[requirement.metric].attributes.get("model"))):
            continue
        unseen = int(np.isposinf(times).sum())
        if duration < requirement.limit < math.inf and unseen:
            undecided.append((requirement, unseen))
        elif len(times) and not times.any() and requirement.comparison.startswith("<"):
            none.append(requirement)
    return [*_unseen(group, experiment, duration, undecided), *_nothing(experiment, none)]


def _nothing(experiment: Experiment | None, requirements: list[GroupRequirement]) -> list[Diagnostic]:
    """A warning about requirements on a settling time that are met because the signal never left its band (D341)."""
    if not requirements:
        return []
    first, *others = requirements
    name = first.metric.rpartition(".")[2]
    message = (
        f"`require {first.text}` is met from the start: `{name}` is 0 s, since its signal left the band at no time"
    )
    helps = [
        "is it the signal that the command moves, and the band less than the motion? where it is to stay there, "
        "`peak` or `always(...)` says so"
    ]
    return _diagnostics(experiment, first, others, message, helps)


def _unseen(
    group: ArchiveGroup, experiment: Experiment | None, duration: float, undecided: list[tuple[GroupRequirement, int]]
) -> list[Diagnostic]:
    """A warning about requirements whose limit lies beyond the run's end (D341). undecided: each with the number of its
    cases"""
    if not undecided:
        return []
    (first, unseen), *others = undecided
    many = f" in {unseen:,} of {group.count:,} cases" if group.count > 1 else ""
    name = first.metric.rpartition(".")[2]
    message = (
        f"`require {first.text}` looks beyond this run, which ends at {duration:.9g} s: `{name}` is not seen by "
        f"then{many}, and it may yet come"
    )
    helps = ["let the run last longer, or write an earlier limit"]
    return _diagnostics(experiment, first, [requirement for requirement, _ in others], message, helps)


def _diagnostics(
    experiment: Experiment | None,
    first: GroupRequirement,
    others: list[GroupRequirement],
    message: str,
    helps: list[str],
) -> list[Diagnostic]:
    """One warning (D341) about a requirement, with the others that it is true of."""
    if others:
        helps.append(f"the same of {', '.join(f'`require {other.text}`' for other in others)}")
    return [warning("D341", message, first.written_at(experiment), help=helps)]


def _is_time(model: str) -> bool:
    """True for a metric that is a time of its run; False where its package is missing."""
    try:
        return models.find("metric", model).times
    except Problem:
        return False


ROUNDING = 1e-9
"""Largest change of a metric that counts as none, as a share of the metric."""


def idle_warnings(group: ArchiveGroup, experiment: Experiment | None = None) -> list[Diagnostic]:
    """The warning about axes that change no metric, if there are any: about the first, with the others by name.

    experiment  of the plan, for places
    """
    done = group.values("status") == DONE
    metrics = [group.values(variable.name)[done] for variable in group.role("metric")]
    axes = {variable.path: group.values(variable.name)[done] for variable in group.role("coordinate")}
    if group.allows("D329") or not all(np.isfinite(metric).all() for metric in metrics):
        return []  # of a metric that is not finite nobody knows what changes it
    idle = _idle(axes, metrics)
    if not idle:
        return []
    first, *others = idle
    values = counted(len(np.unique(axes[first])), "value")
    same = (
        f"the {len(metrics)} metrics are the same to 9 digits"
        if len(metrics) > 1
        else "its metric is the same to 9 digits"
    )
    message = f"`{first}` changes no metric of any case: at its {values}, all else the same, {same}"
    helps = ["is it what was meant to vary? a metric of what it changes would show it"]
    if others:
        helps.append(f"the same of {', '.join(f'`{path}`' for path in others)}")
    places = (
        {} if experiment is None else {coordinate.path: coordinate.place for coordinate in experiment.cases.coordinates}
    )
    return [warning("D329", message, places.get(first), help=helps)]


def _idle(axes: dict[str, np.ndarray], metrics: list[np.ndarray]) -> list[str]:
    """The axes of a sweep that change no metric between cases that differ in them alone. Parameters that vary together
    are one axis. Where no cases differ in one axis alone, as in a sample, all axes if no metric changes at all."""
    codes = {path: np.unique(values, return_inverse=True)[1] for path, values in axes.items()}
    together: dict[bytes, list[str]] = {}
    for path, code in codes.items():
        if code.any():
            together.setdefault(code.tobytes(), []).append(path)
    if not metrics or not together:
        return []
    idle, compared = list[str](), False
    for paths in together.values():
        others = [codes[names[0]] for names in together.values() if names is not paths]
        rest = _numbered(others, len(codes[paths[0]]))
        alone = not _same(rest, [codes[paths[0]]])
        compared |= alone
        if alone and _same(rest, metrics):
            idle += paths
    if not compared and _same(_numbered([], len(metrics[0])), metrics):
        return [path for paths in together.values() for path in paths]
    return idle


def _numbered(codes: Iterable[np.ndarray], count: int) -> np.ndarray:
    """A number for each case, equal for cases that have all these codes equal."""
    numbers = np.zeros(count, np.int64)
    for code in codes:
        numbers = np.unique(numbers * (code.max() + 1) + code, return_inverse=True)[1]
    return numbers


def _same(plants: np.ndarray, values: Iterable[np.ndarray]) -> bool:
    """True where all cases with the same number in `plants`, [case], have the same values, but for rounding: what
    numbers the cases apart has no effect."""
    _, first, number = np.unique(plants, return_index=True, return_inverse=True)
    return all(np.isclose(value[first[number]], value, rtol=ROUNDING, atol=0.0).all() for value in values)


def campaign_warnings(groups: Iterable[ArchiveGroup], experiments: Mapping[str, Experiment]) -> list[Diagnostic]:
    """The warnings about all experiments of an archive, with the places in the deck; equal ones of several structures
    once."""
    first: dict[object, Diagnostic] = {}
    more: dict[object, int] = {}
    for group in groups:
        for diagnostic in warnings(group, experiments.get(group.name)):
            key = (diagnostic.code, diagnostic.at if diagnostic.at is not None else diagnostic.message)
            more[key] = more.get(key, -1) + 1
            first.setdefault(key, diagnostic)
    with_notes = (
        (
            diagnostic,
            f"the same of {counted(more[key], 'other structure')}, which `met show` lists" if more[key] else "",
        )
        for key, diagnostic in first.items()
    )
    return [
        replace(diagnostic, help=(*diagnostic.help, note)) if note else diagnostic for diagnostic, note in with_notes
    ]


def warnings(group: ArchiveGroup, experiment: Experiment | None = None) -> list[Diagnostic]:
    """The warnings about one experiment of an archive, except those that its run allows.

    experiment  of the plan, for places
    """
    # found from counts; rows beside a summary are few, and say nothing about all cases
    warners = [step_errors.warnings]
    if summed_up(group) is None:
        warners += [at_limits.warnings, grapple_warnings, undecided_warnings, idle_warnings]
    return [diagnostic for warner in warners for diagnostic in warner(group, experiment)]
