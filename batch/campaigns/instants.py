"""Warnings about the step of the dynamics at instants that a campaign's cases pass; the choice of cases depends on
counts alone.

Of a small campaign the memory of cases is kept while they run; of a large one some cases are run again. Both give the
same bits, so it does not matter who ran them, nor how often they were interrupted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from batch.campaigns.outcomes import CaseOutcomes
from batch.campaigns.tasks import GRANULE, CampaignSection
from batch.queries.signals import number_text
from ic.meaning.checks.programs import bed_warning
from ic.meaning.checks.step_words import fault_warning, from_instants, loop_warning
from met import models
from met import run as engine
from met.analysis import passed
from met.analysis.following import Unfollowed, unfollowed
from met.analysis.step_size import StepFault, chosen_cases, step_size
from met.diagnostic import Diagnostic, Label, Place, Problem
from met.passing import Memories, even_ticks
from met.plan import Experiment
from met.plan.columns import are_among

CODES = ("D317", "D318", "D319", "D320", "D321", "D322", "D348")

SHARE = 0.03
"""Largest share of a campaign's steps that is spent on running some of its cases again. One block is run in any
case."""

MOST_CASES = 8
"""Largest number of cases that are examined."""

STANDS_OUT, LEAST_CASES, MOST_OUT, ROUNDING = 20.0, 16, 2, 1e-6
"""A metric of a case stands out where its distance from the median exceeds this many widths of the middle half of all
cases, and rounding; for at least so many cases, and at most so many outliers."""

MOST_EXPERIMENTS = 8
"""Largest number of experiments of a campaign that are examined: a sweep of structures may have hundreds."""


def with_memories(sections: Sequence[CampaignSection]) -> list[CampaignSection]:
    """The sections of a campaign; small ones that are examined keep the memory of their cases."""
    wanted = set(np.linspace(0, len(sections) - 1, MOST_EXPERIMENTS).astype(int).tolist())
    return [
        replace(section, memories=_memories(section)) if number in wanted else section
        for number, section in enumerate(sections)
    ]


def _memories(section: CampaignSection) -> Memories | None:
    """The storage for memories; None for an experiment without such warnings."""
    experiment, rows = section.prepared.experiment, section.rows
    structure = experiment.structure
    known = structure.integrator in models.find_own("integrator")  # another package's is only recorded
    if section.prepared.wire or not known or not structure.moving or all(map(experiment.allows, CODES)):
        return None
    if len(rows) > GRANULE:
        some = np.array(chosen_cases(experiment))
        cases = [int(rows[0]), int(rows[-1]), *some[are_among(rows, some)].tolist()]
        cases = cases[: MOST_CASES if _is_small(section) else 0]
    else:
        cases = rows.tolist()
    return Memories(even_ticks(structure.schedule, passed.MOST_INSTANTS // 2), frozenset(cases))


def _is_small(section: CampaignSection) -> bool:
    """True where another block of cases would be a large share of the campaign's."""
    return SHARE * len(section.rows) < GRANULE


def step_warnings(section: CampaignSection, outcomes: CaseOutcomes, threads: int | None = None) -> list[Diagnostic]:
    """Warnings of modes that the steps of a campaign's cases do not follow at instants that they pass, except those
    that the run allows, and those that the check reports for the initial poses."""
    experiment, memories = section.prepared.experiment, section.memories
    if memories is None:
        return []
    cases = _cases(section, outcomes, memories)
    missing = np.array([case for case in cases if case not in memories.by_case], np.int64)
    if len(missing):
        again = replace(memories, cases=frozenset(missing.tolist()))
        engine.compute(section.prepared, missing, record=False, threads=threads, memories=again)
    try:
        instants = _passed(section, memories, cases)
        if not len(instants.case):
            return []
        diagnostics = [_warning(experiment, lasting) for lasting in passed.lasting(experiment, instants)]
        diagnostics += [
            bed_warning(
                experiment,
                reading,
                f"reckoned with the arm as it stands {from_instants(experiment, reading.case, since)}",
            )
            for reading, since in passed.lasting_beds(experiment, instants)
        ]
        diagnostics += not_followed(experiment, memories, section.prepared.recording.cells, diagnostics)
        return [diagnostic for diagnostic in diagnostics if not experiment.allows(diagnostic.code)]
    except Problem:  # a program that needs a kernel
        return []


def _cases(section: CampaignSection, outcomes: CaseOutcomes, memories: Memories) -> list[int]:
    """The cases to examine: those whose memory was kept, and any that stand out; where memory was kept of all cases or
    of none, the first, the last and the worst of each metric."""
    out = [int(section.rows[place]) for place in standing_out(outcomes)]
    if memories.cases and len(section.rows) > GRANULE:
        return sorted({*memories.cases, *out})
    places = [*(outcomes.ends() or (0, len(section.rows) - 1)), *outcomes.worst_finite()]
    most = min(MOST_CASES, passed.instants(section.prepared.experiment) // passed.LEAST_INSTANTS)
    return sorted({*(int(section.rows[place]) for place in list(dict.fromkeys(places))[:most]), *out})


def standing_out(outcomes: CaseOutcomes) -> list[int]:
    """Places of the cases with a metric far from all others', the furthest first: single rows that went another way.
    None for few cases or very many, nor where metrics are spread evenly."""
    ratios: dict[int, float] = {}
    for values in outcomes.few_values():
        fine = np.flatnonzero(np.isfinite(values))
        if len(fine) < LEAST_CASES:
            continue
        quarter, middle, three_quarters = np.percentile(values[fine], (25.0, 50.0, 75.0))
        away = np.abs(values[fine] - middle)
        furthest, spread = int(away.argmax()), STANDS_OUT * (three_quarters - quarter)
        if away[furthest] > max(spread, ROUNDING * abs(middle)):
            ratio = float(away[furthest] / spread) if spread > 0.0 else np.inf
            ratios[int(fine[furthest])] = max(ratio, ratios.get(int(fine[furthest]), 0.0))
    return sorted(ratios, key=lambda place: (-ratios[place], place))[:MOST_OUT]


def _passed(section: CampaignSection, memories: Memories, cases: Sequence[int]) -> passed.Passed:
    """The memory of these cases at the instants that say most about their steps, of all cases in one table."""
    experiment, cells = section.prepared.experiment, section.prepared.recording.cells
    count = max(passed.LEAST_INSTANTS, passed.instants(experiment) // len(cases))
    places = [passed.telling(experiment, memories.by_case[case], cells, count) for case in cases]
    every = np.concatenate([memories.by_case[case][ticks] for case, ticks in zip(cases, places, strict=True)])
    return passed.Passed(
        np.repeat(cases, [len(ticks) for ticks in places]),
        np.array(memories.ticks)[np.concatenate(places)],
        {name: every[:, slot] for slot, name in enumerate(cells)},
    )


def _warning(experiment: Experiment, lasting: passed.Lasting) -> Diagnostic:
    """A warning about a lasting finding, in words."""
    hz = experiment.structure.schedule.base_hz
    where = from_instants(experiment, lasting.case, float(lasting.passed.tick[0]) / hz, lasting.until)
    if not isinstance(lasting.fault, StepFault):
        return loop_warning(experiment, lasting.fault, experiment.place, f"as it stands {where}")
    better = passed.remedy_of(experiment, lasting)
    return fault_warning(experiment, lasting.fault, better, experiment.place, f"reckoned {where}")


LOOPS = frozenset({"D317", "D320", "D321", "D322"})
"""Warnings of a loop or a step because of which nothing follows: with one of these, at the check too, D348 is left
out."""


def not_followed(
    experiment: Experiment, memories: Memories, cells: Sequence[str], others_warnings: Sequence[Diagnostic]
) -> list[Diagnostic]:
    """The warning about joints and points that do not follow their commands, if there are any: the worst, with the
    others by name.

    others_warnings  what else is told of the same instants
    """
    if experiment.allows("D348") or any(diagnostic.code in LOOPS for diagnostic in others_warnings):
        return []
    unfollowed_commands = unfollowed(experiment, memories.ticks, memories.by_case, cells)
    if not unfollowed_commands:
        return []
    begun = step_size(experiment, chosen_cases(experiment))
    if begun.loops or any(fault.kind == "grows" for fault in begun.faults):
        return []
    worst, *others = unfollowed_commands
    place, what = _place(experiment, worst), "path of guide" if worst.kind == "path" else "joint"
    does = "is not followed" if worst.kind == "path" else "does not follow its command"
    at_limit = f", and `{worst.limit}` was reached for most of that time" if worst.limit else ""
    case = f" in case #{int(experiment.cases.table[worst.case])}" if experiment.cases.count > 1 else ""
    message = f"{what} `{worst.subject}` {does}{case}: it is {_off(experiment, worst)}{at_limit}"
    helps = [_remedy(experiment, worst)]
    if others:
        helps.append(f"the same of {', '.join(f'`{other.subject}`' for other in others)}")
    helps.append(f"root mean square from {worst.since:.4g} s to {worst.until:.4g} s, and it does not fall")
    return [Diagnostic("D348", message, None if place is None else Label(place), (), tuple(helps), "warning")]


def _off(experiment: Experiment, follower: Unfollowed) -> str:
    """The error in words: `1.047 rad off, of 1.047 rad that it is told to move`."""
    straight = follower.kind == "path" or any(
        joint.name == follower.subject and joint.kind == "prismatic" for joint in experiment.structure.joints
    )
    unit = ("m" if straight else "rad") + ("/s" if follower.kind == "rate" else "")
    off = f"{number_text(follower.off)} {unit} off"
    if not follower.commanded:
        return f"{off}, and is told to stay"
    does = {"position": "it is told to move", "rate": "it is told", "path": "it leads"}[follower.kind]
    return f"{off}, of {number_text(follower.commanded)} {unit} that {does}"


def _remedy(experiment: Experiment, follower: Unfollowed) -> str:
    """The remedies, in words, with which it may follow."""
    if follower.kind == "path":
        return "let the path stay where the arm reaches, and within what rates and damping leave"
    structure, beside = experiment.structure, []
    for use in structure.environment:
        about = experiment.parameters.get(f"environment.{use.name}.joint")
        if about is not None and about.value == follower.subject:
            beside.append(f"`{use.name}`")
    other = f", or take away what holds it: {', '.join(beside)}" if beside else ""
    if follower.limit:
        return f"raise `{follower.limit}`, give it less to move{other}"
    return f"look at its servo's gains, ratio and friction, and at what it has to move{other}"


def _place(experiment: Experiment, follower: Unfollowed) -> Place | None:
    """The place where the command, or the guide, is written."""
    if follower.kind == "path":
        return next(use.place for use in experiment.structure.guides if use.name == follower.subject)
    places = [
        parameter.origin.place
        for path, parameter in experiment.parameters.items()
        if path.startswith(f"{follower.subject}.servo.command.") and parameter.origin.place is not None
    ]
    servos = [use.place for use in experiment.structure.servos if use.joint == follower.subject]
    return (places or servos)[0]
