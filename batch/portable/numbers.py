"""Other numbers than an archive's: a second module of its run, whose inputs are the numbers that the deck writes.

It computes what `met run --vary` of these numbers computes, and is another structure than the archive's.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile
from ic.driver.given_values import GivenRun, VariedRun, given_run
from ic.meaning.definitions.resolve import Definitions
from ic.text.complaints import Complaints
from ic.text.lexer import COMMAND_LINE
from met.diagnostic import Problem, error
from met.messages.visible import visible
from met.plan import Experiment

MOST = 200
"""Numbers that are inputs; of more, the first ones are."""

FAR = 1e3
"""A number is let go so many times as far as the deck's, or as 1 in SI where that is 0."""

HALVINGS = 60
"""Halvings by which the last number is found that the deck's checks allow."""


def deck_of(archive: ArchiveFile, experiment: Experiment, deck: str | Path) -> VariedRun:
    """The archive's run with the deck's numbers as inputs. Raises Problem E479 where the deck is not the archive's, or
    nothing can vary."""
    plan = archive.plan(as_written=True)
    name = experiment.name_in_deck
    options: dict[str, Any] = {"defines": plan.defines, "settings": plan.settings}
    run = given_run(deck, _run_of(deck, name, plan.defines) if experiment.varies else name, **options)
    texts = set(archive.sources().values())
    if any(text not in texts for text in [each.text for each in run.deck.sources if each.name != COMMAND_LINE]):
        message = f"{deck} is not the deck that the archive was made with, or includes other files"
        raise Problem(error("E479", message, help="run it again, and view the new archive"))
    return varied(run)


def _run_of(deck: str | Path, sweep: str, defines: tuple[str, ...]) -> str:
    from ic.read import read

    found = Definitions(read(Path(deck), (), defines), Complaints()).of_kind("sweep").get(sweep)
    of = found.group.of if found is not None else None
    if of is None:
        message = f"{deck} has no sweep `{sweep}` of one run"
        raise Problem(error("E479", message, help="name the deck that the archive was made with"))
    return of.text


def varied(run: GivenRun) -> VariedRun:
    """The run with the numbers that its deck writes as inputs, without those that cannot vary. Raises Problem E479."""
    there = run.experiment.parameters
    paths = [
        path for path, each in there.items() if isinstance(each.value, float) and each.origin.kind == "deck"
    ][:MOST]  # fmt: skip
    numbers: dict[str, tuple[float | str, str]] = {}
    try:
        return run.vary({path: (float(there[path].value), there[path].unit) for path in paths})  # type: ignore[arg-type]
    except Problem:
        pass
    for path in paths:  # one that cannot vary is left out
        one = {path: (float(there[path].value), there[path].unit)}  # type: ignore[arg-type]
        try:
            run.vary(one)
        except Problem:
            continue
        numbers.update(one)
    if not numbers:
        raise Problem(error("E479", f"no number of `{run.name}` can vary", help="leave `--numbers` out"))
    return run.vary(numbers)


def limits(run: VariedRun) -> list[dict[str, Any]]:
    """The least and largest number of each input that the deck's checks allow while the others are the deck's, and
    what they say beyond: SI."""
    first = {each.path: np.asarray(each.values[:1], float) for each in run.experiment.cases.coordinates}

    def refused(path: str, value: float) -> str:
        try:
            run.check({**first, path: np.array([value])}, 1)
        except Problem as problem:
            return visible(problem.diagnostics[0].message.removesuffix("; case #0 breaks it"))
        return ""

    def end(path: str, way: float) -> tuple[float, str]:
        own = float(first[path][0])
        good, bad = own, own + way * FAR * (abs(own) or 1.0)
        why = refused(path, bad)
        if not why:
            return bad, f"it is more than {FAR:g} times as far as the deck's"
        if not refused(path, 0.0) and (own - bad) * np.sign(own) > 0.0 and (own > 0) == (way < 0):
            good = 0.0
        for _ in range(HALVINGS):
            middle = 0.5 * (good + bad)
            said = refused(path, middle)
            if said:
                bad, why = middle, said
            else:
                good = middle
        return good, why

    found = []
    for path in first:
        (low, below), (high, above) = end(path, -1.0), end(path, 1.0)
        found.append({"low": low, "high": high, "below": below, "above": above})
    return found
