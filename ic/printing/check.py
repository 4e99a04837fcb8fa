"""The verdict of `met check`, in one line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ic.printing.columns import count
from ic.printing.plan import NOT_LOOKED_AT, STEP_SIZE, passive
from met.diagnostic import Diagnostic
from met.plan import Experiment, Plan


def notes(plan: Plan) -> Iterator[str]:
    """Remarks on a plan, run by run: `free: no servo on rail, which moves freely`."""
    for experiment in plan.experiments:
        free = passive(experiment.structure)
        if free:
            freely = "which moves freely" if len(free) == 1 else "which move freely"
            yield f"{experiment.name}: no servo on {', '.join(free)}, {freely}"
        yield from (f"{experiment.name}: {note}" for note in experiment.notes if not note.startswith(STEP_SIZE))


def left_out(plan: Plan) -> Iterator[str]:
    """Yield a line for each reason why a run's step was not checked, with the runs that it holds for."""
    runs: dict[str, list[str]] = {}
    for experiment in plan.experiments:
        for note in experiment.notes:
            if note.startswith(NOT_LOOKED_AT):
                runs.setdefault(note, []).append(experiment.name)
    yield from (f"{', '.join(names)}: {note}" for note, names in runs.items())


def verdict(plan: Plan, diagnostics: Sequence[Diagnostic], allowed: int = 0) -> str:
    """The verdict, `two_link.ic: 1 run, 1 sweep, 37 cases: no errors, 1 warning allowed`; the cases are those of all
    experiments, for a search the most that it may run. allowed: number of suppressed warnings"""
    varying = [experiment for experiment in plan.experiments if experiment.varies]
    sweeps = len({experiment.name_in_deck for experiment in varying if experiment.search is None})
    kinds = [experiment.search.kind for experiment in varying if experiment.search is not None]
    runs = sum(1 for experiment in plan.experiments if not experiment.varies)
    parts = [count(runs, "run")] if runs else []
    parts += [count(sweeps, "sweep")] if sweeps else []
    parts += [count(kinds.count("search"), "search", "searches")] if "search" in kinds else []
    parts += [count(kinds.count("tune"), "tuning")] if "tune" in kinds else []
    parts.append(count(sum(_cases(experiment) for experiment in plan.experiments), "case"))
    warnings = sum(1 for diagnostic in diagnostics if diagnostic.severity == "warning")
    counted = f", {count(warnings, 'warning')}" if warnings else ""
    counted += f", {count(allowed, 'warning')} allowed" if allowed else ""
    return f"{plan.deck.strip('<>')}: {', '.join(parts)}: no errors{counted}"


def _cases(experiment: Experiment) -> int:
    """The number of an experiment's cases, or for a search the largest."""
    return experiment.cases.count if experiment.search is None else experiment.search.at_most
