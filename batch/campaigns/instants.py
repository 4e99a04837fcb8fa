"""The step of the dynamics against the arm at instants that a campaign's cases pass: warnings, decided by counts alone.

Of a small campaign the memory of cases is kept while they run; of a large one some cases are run again. Both give the
same bits, so it does not matter who ran them, nor how often they were interrupted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from batch.campaigns.follow_words import not_followed
from batch.campaigns.outcomes import CaseOutcomes
from batch.campaigns.tasks import GRANULE, CampaignSection
from ic.meaning.checks.beds import bed_warning
from ic.meaning.checks.step_words import fault_warning, from_instants, loop_warning
from met import models
from met import run as engine
from met.analysis import passed
from met.analysis.step_size import StepFault, chosen_cases
from met.diagnostic import Diagnostic, Problem
from met.passing import Memories, even_ticks
from met.plan import Experiment
from met.plan.columns import are_among

CODES = ("D317", "D318", "D319", "D320", "D321", "D322", "D348")

SHARE = 0.03
"""Of a campaign's steps: so much more is done to look at some of its cases again. A block is run, whatever is in it."""

MOST_CASES = 8
"""Cases that are looked at."""

STANDS_OUT, LEAST_CASES, MOST_OUT, ROUNDING = 20.0, 16, 2, 1e-6
"""A metric of a case stands out where it is so many times the width of the middle half of all cases away from their
median, and more than a rounding: of so many cases at least, and so many of them at most."""

MOST_EXPERIMENTS = 8
"""Experiments of a campaign that are looked at: a sweep of structures may have hundreds."""


def with_memories(sections: Sequence[CampaignSection]) -> list[CampaignSection]:
    """The sections of a campaign; those that are looked at, and are small, keep the memory of the cases for that."""
    wanted = set(np.linspace(0, len(sections) - 1, MOST_EXPERIMENTS).astype(int).tolist())
    return [replace(each, memories=_memories(each)) if at in wanted else each for at, each in enumerate(sections)]


def _memories(section: CampaignSection) -> Memories | None:
    """None where nothing is to be said of this experiment."""
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
    """True where another block of cases is no small share of the campaign's."""
    return SHARE * len(section.rows) < GRANULE


def step_warnings(section: CampaignSection, outcomes: CaseOutcomes, threads: int | None = None) -> list[Diagnostic]:
    """Warnings of modes that the steps of a campaign's cases do not follow at instants that they pass, but for what
    its run allows, and what the check tells of the poses in which they begin."""
    experiment, memories = section.prepared.experiment, section.memories
    if memories is None:
        return []
    cases = _cases(section, outcomes, memories)
    missing = np.array([case for case in cases if case not in memories.by_case], np.int64)
    if len(missing):
        again = replace(memories, cases=frozenset(missing.tolist()))
        engine.compute(section.prepared, missing, record=False, threads=threads, memories=again)
    try:
        at = _passed(section, memories, cases)
        if not len(at.case):
            return []
        said = [_warning(experiment, one) for one in passed.lasting(experiment, at)]
        said += [
            bed_warning(
                experiment, each, f"reckoned with the arm as it stands {from_instants(experiment, each.case, since)}"
            )
            for each, since in passed.lasting_beds(experiment, at)
        ]
        said += not_followed(experiment, memories, section.prepared.recording.cells, said)
        return [each for each in said if not experiment.allows(each.code)]
    except Problem:  # a program that cannot be put together but for a kernel
        return []


def _cases(section: CampaignSection, outcomes: CaseOutcomes, memories: Memories) -> list[int]:
    """The cases that are looked at: those whose memory was asked for, and any that stand out; the first, the last and
    the worst of each metric where memory was asked for of all, or of none."""
    out = [int(section.rows[place]) for place in standing_out(outcomes)]
    if memories.cases and len(section.rows) > GRANULE:
        return sorted({*memories.cases, *out})
    places = [*(outcomes.ends() or (0, len(section.rows) - 1)), *outcomes.worst_finite()]
    most = min(MOST_CASES, passed.instants(section.prepared.experiment) // passed.LEAST_INSTANTS)
    return sorted({*(int(section.rows[place]) for place in list(dict.fromkeys(places))[:most]), *out})


def standing_out(outcomes: CaseOutcomes) -> list[int]:
    """Places of the cases of which a metric is far from all others', the furthest first: one row of many that went
    another way. None of a few cases or of very many, nor where metrics are spread evenly."""
    found: dict[int, float] = {}
    for values in outcomes.few_values():
        fine = np.flatnonzero(np.isfinite(values))
        if len(fine) < LEAST_CASES:
            continue
        quarter, middle, three_quarters = np.percentile(values[fine], (25.0, 50.0, 75.0))
        away = np.abs(values[fine] - middle)
        at, spread = int(away.argmax()), STANDS_OUT * (three_quarters - quarter)
        if away[at] > max(spread, ROUNDING * abs(middle)):
            ratio = float(away[at] / spread) if spread > 0.0 else np.inf
            found[int(fine[at])] = max(ratio, found.get(int(fine[at]), 0.0))
    return sorted(found, key=lambda place: (-found[place], place))[:MOST_OUT]


def _passed(section: CampaignSection, memories: Memories, cases: Sequence[int]) -> passed.Passed:
    """The telling instants of these cases."""
    experiment, cells = section.prepared.experiment, section.prepared.recording.cells
    count = max(passed.LEAST_INSTANTS, passed.instants(experiment) // len(cases))
    places = [passed.telling(experiment, memories.by_case[case], cells, count) for case in cases]
    every = np.concatenate([memories.by_case[case][at] for case, at in zip(cases, places, strict=True)])
    return passed.Passed(
        np.repeat(cases, [len(at) for at in places]),
        np.array(memories.ticks)[np.concatenate(places)],
        {name: every[:, slot] for slot, name in enumerate(cells)},
    )


def _warning(experiment: Experiment, found: passed.Lasting) -> Diagnostic:
    """A warning of what lasts, in words."""
    hz = experiment.structure.schedule.base_hz
    where = from_instants(experiment, found.case, float(found.at.tick[0]) / hz, found.until)
    if not isinstance(found.fault, StepFault):
        return loop_warning(experiment, found.fault, experiment.place, f"as it stands {where}")
    better = passed.remedy_of(experiment, found)
    return fault_warning(experiment, found.fault, better, experiment.place, f"reckoned {where}")
