"""Warnings about an archive's finished cases: errors due to the step, limits of machines and joints, grapples,
times beyond the run's end, and axes of sweeps without an effect."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from batch.queries import at_limits, grapples, no_effect, undecided
from batch.queries.step_errors import warning as step_errors
from batch.queries.streamed import summed_up
from ic.printing.columns import count as counted
from met.diagnostic import Diagnostic

if TYPE_CHECKING:
    from batch.archive.read import ArchiveGroup
    from met.plan import Experiment


def campaign_warnings(groups: Iterable[ArchiveGroup], experiments: Mapping[str, Experiment]) -> list[Diagnostic]:
    """The warnings about all experiments of an archive, with the places in the deck; equal ones of several structures
    once."""
    first: dict[object, Diagnostic] = {}
    more: dict[object, int] = {}
    for group in groups:
        for warning in warnings(group, experiments.get(group.name)):
            key = (warning.code, warning.at if warning.at is not None else warning.message)
            more[key] = more.get(key, -1) + 1
            first.setdefault(key, warning)
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
    about = (step_errors,) if summed_up(group) is not None else (step_errors, at_limits, grapples, undecided, no_effect)
    return [warning for module in about for warning in module.warnings(group, experiment)]
