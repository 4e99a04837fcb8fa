"""A deck that is watched: compiled, as the page of one of its runs, and its cases run.

The page comes first, since it needs only the module, and computes its own results. The cases are then run by machine
code, as in `met run`, and the page compares its numbers with theirs, bit by bit.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from batch.archive.in_memory import GroupInMemory
from batch.modules.description import MOST_CASES
from batch.portable.page import data_of, doubles, head_of
from batch.queries.pool import ENDED, Pool
from batch.report.contents.overview import overview
from batch.report.html.payload import overview_data, script_json
from ic.driver.compile import asked_definitions, compile_deck
from ic.language import EXPERIMENTS
from ic.meaning.definitions.resolve import Definitions
from ic.read import read
from ic.text.complaints import Complaints
from met.analysis.linear import metrics as linear_metrics
from met.analysis.memo import AnalysisMemo
from met.diagnostic import Diagnostic, Problem, error
from met.frozen import frozen
from met.host.sources import ARCHIVES
from met.messages.render import render
from met.messages.visible import visible
from met.outputs import quoted
from met.plan import Experiment, Plan
from met.run import DONE, Prepared, Run, results

KICKER = "A deck that is watched"

NOT_YET = -1
"""Status of a case that has yet to be run."""

FIRST, SHARE, TELLING = 32, 0.2, 1.0
"""Number of cases that are run first; seconds that further ones take before it is checked whether they are still
wanted; and seconds after which results so far are reported."""

ENDING = ".ic"
"""The ending of a deck's name. A file of another name is watched if it is a deck."""

MOST_LETTERS = 200_000
"""Largest number of letters of messages that are shown."""


@frozen
class WatchedDeck:
    """A deck with its options on the command line: its name, its file; settings as of `--set` and `--vary`."""

    name: str
    file: Path
    include_dirs: tuple[str, ...] = ()
    defines: tuple[str, ...] = ()
    settings: tuple[str, ...] = ()


@frozen
class DeckAnswer:
    """The outcome of compiling a deck.

    messages    in the words of `met check`; "" where it has nothing to say
    experiment  the run or sweep that is shown, of the plan; None where an error stands in its way
    names       runs and sweeps that can be shown;  groups: of the one that is shown, where it has several structures
    files       the names of all files that were read
    """

    messages: str
    names: tuple[str, ...]
    files: tuple[str, ...]
    plan: Plan | None = None
    experiment: Experiment | None = None
    groups: tuple[str, ...] = ()


def check(deck: WatchedDeck, name: str | None = None) -> None:
    """Refuse a file that is not a deck, and a run or sweep that the deck does not have. A deck with other mistakes is
    watched until they are corrected. Raises Problem."""
    is_named_so = deck.file.suffix == ENDING
    try:
        tree = read(
            deck.name,
            [Path(include_dir) for include_dir in deck.include_dirs],
            deck.defines,
            despite_errors=is_named_so,
        )
    except Problem as problem:
        if is_named_so:
            return
        raise Problem(_no_deck(deck, problem.diagnostics), problem.sources) from problem
    complaints = Complaints()
    known = Definitions(tree, complaints)
    has_none = not any(known.of_kind(kind) for kind in EXPERIMENTS)
    if has_none and not is_named_so:
        try:
            asked_definitions(known, Complaints(), None)
        except Problem as problem:
            raise Problem(_no_deck(deck, problem.diagnostics)) from problem
    if name is not None and not tree.unreadable and not has_none:
        asked_definitions(known, complaints, (name,))
        if unknown := [diagnostic for diagnostic in complaints.errors if diagnostic.code == "D164"]:
            raise Problem(unknown)


def _no_deck(deck: WatchedDeck, mistakes: tuple[Diagnostic, ...]) -> tuple[Diagnostic, ...]:
    """Mistakes of a file that is not named like a deck, with a remark on why it is read as one."""
    kinds = ", ".join(ARCHIVES)
    helps = f"{deck.name} is read as a deck: its name does not end like an archive's ({kinds})"
    return (*mistakes[:-1], replace(mistakes[-1], help=(*mistakes[-1].help, helps)))


def compiled(
    deck: WatchedDeck, name: str | None = None, group: str | None = None, memo: AnalysisMemo | None = None
) -> DeckAnswer:
    """The deck's run or sweep of this name; for None the one that `met run` would take.

    group  of several structures the one that is shown; for None the first
    memo   answers of the analysis from earlier times; those that are found are added
    """
    try:
        folders = [Path(include_dir) for include_dir in deck.include_dirs]
        tree = read(deck.name, folders, deck.defines, despite_errors=True)
    except Problem as problem:
        return DeckAnswer(_words(problem.diagnostics, problem.sources), (), tuple(problem.sources))
    known = Definitions(tree, Complaints())
    definitions = [definition for kind in EXPERIMENTS for definition in known.of_kind(kind).values()]
    names = tuple(
        definition.name
        for definition in [definition for definition in definitions if known.writes(definition)] or definitions
    )
    compiled_deck = compile_deck(
        tree, select=None if name is None else (name,), defines=deck.defines, settings=deck.settings, memo=memo
    )  # fmt: skip
    words, files = _words(compiled_deck.diagnostics, compiled_deck.sources), tuple(compiled_deck.sources)
    if compiled_deck.plan is None:
        return DeckAnswer(words, names, files)
    experiments = {experiment.name: experiment for experiment in compiled_deck.plan.experiments}
    experiment = experiments.get(group or "", compiled_deck.plan.experiments[0])
    if experiment.search is not None:
        return DeckAnswer(_words([_search(deck, experiment)], {}), names, files)
    return DeckAnswer(
        words, names, files, compiled_deck.plan, experiment, tuple(experiments) if len(experiments) > 1 else ()
    )


def _search(deck: WatchedDeck, experiment: Experiment) -> Diagnostic:
    name = experiment.name_in_deck
    helps = f"`met run {quoted(deck.name)} {quoted(name)} -o a.h5`, then `met view a.h5`"
    return error("E476", f"`{name}` is a search: which cases it has is known when it has run", help=helps)


def _words(diagnostics: Any, sources: Mapping[str, str]) -> str:
    return visible(render(diagnostics, sources))[:MOST_LETTERS]


def page(answer: DeckAnswer, prepared: Prepared) -> str:
    """The data of the shown run's page, before its cases are run: JSON."""
    experiment, plan = prepared.experiment, answer.plan
    assert plan is not None
    rows = shown_rows(experiment)
    empty = {use.name: np.full(len(rows), np.nan) for use in experiment.metrics}
    group = GroupInMemory.of_metrics(experiment, rows, np.full(len(rows), NOT_YET, np.int8), empty)
    data = data_of(experiment, plan, group, source=kind_of(experiment), prepared=prepared, quick=True, folder=Path())
    by = "by the code of `met run`"
    if experiment.cases.count > len(rows):
        by += f"; of {experiment.cases.count:,} cases these are the first {len(rows):,}"
    data["head"] = head_of(experiment, data, KICKER, by)
    return script_json(data)


def kind_of(experiment: Experiment) -> str:
    """`run`, or `sweep` where it has several cases."""
    return "sweep" if experiment.cases.count > 1 else "run"


def shown_rows(experiment: Experiment) -> np.ndarray:
    """Rows of the case table that are on the page and are run."""
    return np.arange(min(experiment.cases.count, MOST_CASES))


class _GivenUp(Exception):
    """Raised where the running cases are no longer wanted."""


def run_cases(
    prepared: Prepared, stop: Callable[[], bool], progress: Callable[[int], None] = lambda _: None
) -> Iterator[Run]:
    """Run the page's cases, with intermediate results now and then and the final ones; nothing more once they are to
    stop, which ends a long case, too. Raises Problem, as `met run` does."""

    def working(_: int) -> None:
        if stop():
            raise _GivenUp

    linear_metrics.check(prepared)
    rows = shown_rows(prepared.experiment)
    prepared.kernel  # noqa: B018 - compiling is not running
    done, last_shown, count, outputs = 0, time.monotonic(), FIRST, []
    while done < len(rows) and not stop():
        began = time.monotonic()
        block = rows[done : done + count]
        try:
            outputs.append(linear_metrics.compute(prepared, block, record=False, progress=working)[1])
        except _GivenUp:
            return
        done += len(block)
        took = time.monotonic() - began
        count = max(1, min(4 * count, round(count * SHARE / max(took, 1e-6))))
        progress(done)
        if done == len(rows) or time.monotonic() - last_shown > TELLING:
            last_shown = time.monotonic()
            yield results(prepared, rows[:done], None, np.concatenate(outputs))


def numbers(experiment: Experiment, run: Run) -> str:
    """The outcome of the cases so far, for the page's script: JSON."""
    done, uses = len(run.case), (*experiment.structure.metrics, *experiment.linear_metrics)
    to_come = 0, len(shown_rows(experiment)) - done
    pool = Pool(experiment.name, [GroupInMemory.of_run(experiment, run)])
    points = overview(pool)
    data = {
        "status": np.pad(run.status, to_come, constant_values=NOT_YET).tolist(),
        "metrics": [doubles(np.pad(run.metrics[use.name], to_come, constant_values=np.nan)) for use in uses],
        "done": done,
        "failed": int((run.status != DONE).sum()),
        "failures": [[failure.count, visible(failure.cause), failure.row] for failure in pool.failures[:5]],
        "doubtful": sorted({visible(warning) for warning in run.warning if warning})[:5],
        "verdicts": [
            [visible(text), *(int((pool.outcomes[:, n] == value).sum()) for value in (1, 0, -1))]
            for n, text in enumerate(pool.requirements)
        ],
        "cases": {
            "name": visible(experiment.name),
            "against": None,
            "replay": "",
            "ended": list(ENDED),
            "overview": None if points is None else overview_data(points),
        },
    }
    return json.dumps(data, allow_nan=False)
