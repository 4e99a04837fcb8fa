"""Runs with numbers other than an archive's: a second module of its run, whose inputs are the deck's numbers.

It computes what `met run --vary` of these numbers computes, and is another structure than the archive's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile
from ic.driver.given_values import GivenRun, VariedRun, given_run
from ic.meaning.definitions.resolve import Definitions
from ic.read import read
from ic.text.complaints import Complaints
from ic.text.lexer import COMMAND_LINE
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.messages.visible import visible
from met.outputs import varied_run, varies
from met.plan import Experiment, Plan
from met.units import Measure

MOST = 200
"""Largest number of inputs; further numbers are left out."""

FAR = 1e3
"""Range of an input, relative to the deck's number, or to 1 in SI where that is 0."""

HALVINGS = 60
"""Number of halvings by which the last number is found that the deck's checks allow."""

MACRO = "macro "
"""Prefix of a macro's name where a sweep chooses its text."""


@frozen
class OtherNumbers:
    """A run with the deck's numbers as inputs.

    run_name  the run's name in the deck
    plan      of the run as the deck has it, by which one sees in which units its signals are thought of
    fixed     what decides the program and is as the archive's group has it, as `integrator = rk4`
    measures  of each input the unit in which the deck writes it
    left_out  numbers of the deck that are no inputs: they have no effect, decide the program, or are too many
    """

    run_name: str
    plan: Plan
    fixed: tuple[str, ...]
    run: VariedRun
    measures: tuple[Measure, ...]
    left_out: tuple[str, ...]


def deck_of(
    archive: ArchiveFile, experiment: Experiment, deck: str | Path, include_dirs: Sequence[str | Path] = ()
) -> OtherNumbers:
    """The archive's run with the deck's numbers as inputs; for a sweep, the run that it varies, with the structure that
    the group has chosen. Raises Problem E479 where the deck is not the archive's, or nothing can vary."""
    plan = archive.plan(as_written=True)
    choices = experiment.cases.choices
    macros = [
        f"{choice.path.removeprefix(MACRO)}={choice.value}" for choice in choices if choice.path.startswith(MACRO)
    ]
    words = [f"{choice.path}={choice.value}" for choice in choices if not choice.path.startswith(MACRO)]
    defines = (*plan.defines, *macros)
    settings = (*(setting for setting in plan.settings if not varies(setting)), *words)
    name = experiment.name_in_deck
    if experiment.varies:
        name = (
            varied_run(name)
            if len(settings) - len(words) < len(plan.settings)
            else _run_of(deck, name, defines, include_dirs)
        )
    run = given_run(deck, name, include_dirs=include_dirs, defines=defines, settings=settings)
    texts = set(archive.sources().values())
    if any(text not in texts for source, text in run.compiled.sources.items() if source != COMMAND_LINE):
        message = f"{deck} is not the deck that the archive was made with, or includes other files"
        raise Problem(error("E479", message, help="run it again, and view the new archive"))
    return varied(run, tuple(f"{choice.path} = {choice.value}" for choice in choices))


def _run_of(deck: str | Path, sweep: str, defines: Sequence[str], include_dirs: Sequence[str | Path]) -> str:
    """The run that a sweep of a deck is of. Raises Problem E479."""
    tree = read(Path(deck), tuple(map(Path, include_dirs)), tuple(defines))
    sweep_definition = Definitions(tree, Complaints()).of_kind("sweep").get(sweep)
    run_word = sweep_definition.group.of if sweep_definition is not None else None
    if run_word is None:
        message = f"{deck} has no sweep `{sweep}` of one run"
        raise Problem(error("E479", message, help="name the deck that the archive was made with"))
    return run_word.text


def varied(run: GivenRun, fixed: tuple[str, ...] = ()) -> OtherNumbers:
    """The run with the numbers in its deck as inputs, in the deck's units, without those that cannot vary. Raises
    Problem E479 where there is none."""
    parameters = run.experiment.parameters
    numbers = {
        path: (parameter.value, parameter.unit)
        for path, parameter in parameters.items()
        if isinstance(parameter.value, float) and parameter.origin.kind == "deck"
    }
    with_inputs, left_out = run.vary_most(numbers)
    paths = [coordinate.path for coordinate in with_inputs.experiment.cases.coordinates]
    if len(paths) > MOST:
        left_out = tuple(path for path in numbers if path not in paths[:MOST])
        with_inputs = run.vary({path: numbers[path] for path in paths[:MOST]})
    coordinates = with_inputs.experiment.cases.coordinates
    if not coordinates:
        raise Problem(error("E479", f"no number of `{run.name}` can vary", help="leave `--numbers` out"))
    units = [run.written_in(coordinate.path) for coordinate in coordinates]
    with_units = tuple(
        replace(coordinate, unit=unit, scale=measure.scale)
        for coordinate, (unit, measure) in zip(coordinates, units, strict=True)
    )  # fmt: skip
    cases = replace(with_inputs.experiment.cases, coordinates=with_units)
    with_inputs = replace(with_inputs, experiment=replace(with_inputs.experiment, cases=cases))
    assert run.compiled.plan is not None
    return OtherNumbers(
        run.name, run.compiled.plan, fixed, with_inputs, tuple(measure for _, measure in units), left_out
    )


def limits(run: VariedRun) -> list[dict[str, Any]]:
    """The least and largest number of each input that the deck's checks allow while the others keep the deck's values,
    and the checks' messages beyond: SI."""
    paths = [coordinate.path for coordinate in run.experiment.cases.coordinates]
    own = np.array([float(coordinate.values[0]) for coordinate in run.experiment.cases.coordinates])
    count = len(paths)

    def broken(ends: np.ndarray) -> np.ndarray:
        """The failing checks for cases in each of which one number is at an end, first all least and then all largest
        ones."""
        cases = np.repeat(own[:, None], 2 * count, axis=1)
        for n in range(count):
            cases[n, [n, count + n]] = ends[[n, count + n]]
        return run.broken(dict(zip(paths, cases, strict=True)), 2 * count)

    twice = np.concatenate([own, own])
    way = np.repeat([-1.0, 1.0], count)
    far = twice + way * FAR * np.where(twice == 0.0, 1.0, np.abs(twice))
    refused = broken(far)
    through_zero = ~broken(np.zeros(2 * count)) & (way * twice < 0.0)
    good, bad = np.where(through_zero, 0.0, twice), far.copy()
    for _ in range(HALVINGS):
        middle = 0.5 * (good + bad)
        wrong = broken(middle)
        good, bad = np.where(wrong, good, middle), np.where(wrong, middle, bad)
    ends = np.where(refused, good, far)

    def refusal(n: int) -> str:
        """The reason why a value beyond the limit number `n` is refused, in words; empty where it is not."""
        if not refused[n]:
            return f"it is more than {FAR:g} times as far as the deck's"
        path = paths[n % count]
        columns = {
            other_path: np.array([bad[n] if other_path == path else value])
            for other_path, value in zip(paths, own, strict=True)
        }
        try:
            run.check(columns, 1)
        except Problem as problem:
            return visible(problem.diagnostics[0].message.removesuffix("; case #0 breaks it"))
        return ""

    return [
        {"low": float(ends[n]), "high": float(ends[count + n]), "below": refusal(n), "above": refusal(count + n)}
        for n in range(count)
    ]
