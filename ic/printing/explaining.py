"""The origin of a value in each structure of a run or sweep, or in other runs where these do not have the path."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ic.driver.compile import Compiled
from ic.driver.explain import explanations_of, with_all_settings
from ic.printing.explain import NO_MORE, explain_json, find_paths, print_explain, with_settings
from met import units
from met.diagnostic import Label, Problem, error
from met.frozen import frozen
from met.plan import Experiment, Plan

Source = tuple[Plan, Compiled | None]
"""A plan, and the deck from which it was compiled; None for a plan file."""

Sources = Sequence[Callable[[], Source]]
"""Plans in which to look for a path, in order; each is made only where those before lack the path."""


@frozen
class ExplainedExperiment:
    """An experiment that has the path, with its settings. alone: True if all of the first source's experiments have
    it."""

    experiment: Experiment
    plan: Plan
    compiled: Compiled | None
    number: int
    alone: bool

    @property
    def known(self) -> Mapping[str, Sequence[str]]:
        return NO_MORE if self.compiled is None else self.compiled.scopes[self.number].known

    def names_of(self, path: str) -> tuple[Label, ...]:
        if self.compiled is None:
            return ()
        return next((explained.names for explained in explanations_of(self.compiled, path)), ())


def print_explained(sources: Sources, path: str) -> Iterator[str]:
    """The explanation line by line; once where all experiments agree. Raises Problem where none has the path."""
    by_lines: dict[tuple[str, ...], list[ExplainedExperiment]] = {}
    for explained in _explained(sources, path):
        texts = {source.name: source.text for source in explained.plan.sources}
        lines = tuple(print_explain(explained.experiment, path, texts, explained.names_of, explained.known))
        by_lines.setdefault(lines, []).append(explained)
    for position, (lines, where) in enumerate(by_lines.items()):
        if position:
            yield ""
        if len(by_lines) > 1 or not where[0].alone:
            yield f"in {', '.join(explained.experiment.name for explained in where)}:"
        yield from lines


def explained_json(sources: Sources, path: str) -> list[dict[str, Any]]:
    """The explanations for programs; with several experiments each names its own."""
    all_explained = _explained(sources, path)
    several = len(all_explained) > 1 or not all_explained[0].alone
    return [
        {"experiment": explained.experiment.name, **record} if several else record
        for explained in all_explained
        for record in explain_json(explained.experiment, path, explained.known)
    ]


def _explained(sources: Sources, path: str) -> list[ExplainedExperiment]:
    """The experiments that have the path, of the first source that has it at all. sources: the run or sweep that is
    asked for first, then others of the deck. Raises the Problem of the first where none has it."""
    problem: Problem | None = None
    for n, source in enumerate(sources):
        try:
            plan, compiled = source()
        except Problem:
            if problem is not None:  # another run has other mistakes
                raise problem from None
            raise
        all_explained = []
        for number, experiment in enumerate(plan.experiments):
            whole = with_settings(experiment if compiled is None else with_all_settings(compiled, number))
            explained = ExplainedExperiment(whole, plan, compiled, number, True)
            try:
                find_paths(whole, path, explained.known)
            except Problem as unknown:
                problem = problem or _of_unit(path, compiled) or unknown
            else:
                all_explained.append(explained)
        if all_explained:
            alone = n == 0 and len(all_explained) == len(plan.experiments)
            return [replace(explained, alone=alone) for explained in all_explained]
    assert problem is not None  # each source has an experiment, and none had the path
    raise problem


def _of_unit(path: str, compiled: Compiled | None) -> Problem | None:
    """The error that a path is a unit, the deck's or the language's; None where it is not."""
    declared = compiled.units.get(path) if compiled is not None else None
    known = units.ALL_UNITS.get(path)
    if declared is not None:
        what, help = "a unit that the deck declares", f"1 {path} is {units.size_in_si(declared)}"
    elif known is not None:
        what, help = "a unit", f"{known.word}, {units.size_in_si(known.measure)}: `met doc units`"
    else:
        return None
    return Problem(error("D170", f"`{path}` is {what}, and no parameter", help=help))
