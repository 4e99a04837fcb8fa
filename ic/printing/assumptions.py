"""The assumptions of a deck's runs (`met.analysis.assumed`): a table for a reviewer, and the same as data."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from ic.driver.compile import Compiled
from ic.printing.columns import columns, quantity
from met.analysis.assumed import Assumption, assumptions


def print_assumptions(compiled: Compiled) -> list[str]:
    """A table for each experiment, in its first case."""
    assert compiled.plan is not None
    lines: list[str] = []
    for experiment in compiled.plan.experiments:
        lines += [
            *([""] if lines else []),
            experiment.name,
            *columns([_row(assumption) for assumption in assumptions(experiment)]),
        ]
    return lines


def _row(assumption: Assumption) -> tuple[str, ...]:
    size = ""
    if assumption.size is not None:
        where = f" at `{assumption.at}`" if assumption.at not in assumption.subject else ""
        size = f"{quantity(float(f'{assumption.size:.3g}'), assumption.unit)}{where}"
    return assumption.subject, assumption.assumed, size, assumption.meaning


def assumptions_json(compiled: Compiled) -> list[dict[str, Any]]:
    """The same for programs, a list a run."""
    assert compiled.plan is not None
    return [
        {"run": experiment.name, "assumptions": [asdict(assumption) for assumption in assumptions(experiment)]}
        for experiment in compiled.plan.experiments
    ]
