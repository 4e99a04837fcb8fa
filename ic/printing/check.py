"""The verdict of `met check`, in one line."""

from __future__ import annotations

from collections.abc import Sequence

from ic.printing.columns import count
from met.diagnostic import Diagnostic
from met.plan import Plan


def verdict(plan: Plan, diagnostics: Sequence[Diagnostic]) -> str:
    """`two_link.ic: 1 run, 1 sweep, 37 cases: no errors`; the cases are those of all runs and sweeps."""
    sweeps = sum(1 for experiment in plan.experiments if experiment.cases.coordinates)
    runs = len(plan.experiments) - sweeps
    parts = [count(runs, "run")] if runs else []
    parts += [count(sweeps, "sweep")] if sweeps else []
    parts.append(count(sum(experiment.cases.count for experiment in plan.experiments), "case"))
    warnings = sum(1 for diagnostic in diagnostics if diagnostic.severity == "warning")
    told = f", {count(warnings, 'warning')}" if warnings else ""
    return f"{plan.deck.strip('<>')}: {', '.join(parts)}: no errors{told}"
