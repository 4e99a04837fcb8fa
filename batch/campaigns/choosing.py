"""The plan that a command is given, and the user's choice among its runs and sweeps, and among their cases."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from batch.archive.rows import row_of
from met.diagnostic import Problem, error
from met.host.sources import names_plan
from met.outputs import quoted, settings_of, varied_run, varies
from met.plan import Experiment, Plan, keys
from met.plan.columns import CaseValues, all_rows, blocks, row_at


def read_plan(
    source: str,
    names: tuple[str, ...] = (),
    *,
    everything: bool = False,
    defines: tuple[str, ...] = (),
    include_dirs: tuple[str, ...] = (),
    settings: tuple[str, ...] = (),
    quiet: bool = False,
) -> Plan:
    """The plan of a deck, or in a plan file. Warnings go to stderr; errors are a Problem."""
    if names_plan(source):
        from met.plan import file as plan_file

        return plan_file.read(source)
    import ic
    from ic.find import find

    select: Any = "all" if everything else names or None
    find(source, include_dirs)  # a misspelt name is reported with the one that was probably meant
    compiled = ic.check(source, include_dirs=include_dirs, defines=defines, **settings_of(settings), select=select)
    if compiled.plan is None:
        raise Problem(compiled.diagnostics, compiled.sources)
    if compiled.diagnostics and not quiet:
        from met.messages import render

        colour = render.wants_colour(sys.stderr)
        print(render.render(compiled.diagnostics, compiled.sources, colour=colour), file=sys.stderr)
    return compiled.plan


def experiments_named(plan: Plan, names: Sequence[str] | None) -> tuple[Experiment, ...]:
    """The plan's experiments of these names; all of them for None. Raises Problem E310.

    For a run that the command line varied, these are the experiments of its sweep.
    """
    if names is None:
        return plan.experiments
    by_name: dict[str, list[Experiment]] = {}
    for experiment in plan.experiments:
        of_run = {varied_run(experiment.name_in_deck)} if any(map(varies, plan.settings)) else set()
        for name in {experiment.name, experiment.name_in_deck} | of_run:
            by_name.setdefault(name, []).append(experiment)
    problems = []
    for name in names:
        if name not in by_name:
            near = difflib.get_close_matches(name, by_name, n=1)
            helps = [f"did you mean `{near[0]}`?"] if near else []
            helps.append(f"runs and sweeps of {plan.deck}: {', '.join(by_name)}")
            problems.append(error("E310", f"no run or sweep `{name}` in {plan.deck}", help=helps))
    if problems:
        raise Problem(problems)
    by_experiment = {experiment.name: experiment for name in names for experiment in by_name[name]}
    return tuple(by_experiment.values())


def select_rows(
    experiments: Sequence[Experiment], cases: Sequence[int | str] | None
) -> list[tuple[Experiment, CaseValues]]:
    """The rows of each experiment that contain the given cases, by position (`7`, `"#7"`) or the beginning of a
    case_id; all for None. An experiment without any of them is left out. Raises Problem E311, E312."""
    if cases is None:
        return [(experiment, all_rows(experiment.cases.count)) for experiment in experiments]
    rows_of: dict[str, set[int]] = {experiment.name: set() for experiment in experiments}
    for case in cases:
        matches = [(e, row) for e in experiments for row in _rows(e, case)]
        if not matches:
            last: dict[str, int] = {}
            for e in experiments:
                last[e.name_in_deck] = max(last.get(e.name_in_deck, 0), int(e.cases.table[-1]))
            begun = [e.name_in_deck for e in experiments if e.search is not None and not e.search.complete]
            listed = {name: row for name, row in last.items() if name not in begun}
            counts = ", ".join(f"`{name}` has #0 {f'to #{row}' if row else 'alone'}" for name, row in listed.items())
            meant = [f"a position is written `'#{case}'`"] if isinstance(case, str) and case.isdecimal() else []
            of_decks = [counts, "`met cases DECK` lists them"] if listed else []
            helps = [*meant, *(_of_search(name, case) for name in begun), *of_decks]
            raise Problem(error("E311", f"no case `{_case_text(case)}`", help=helps))
        if len(matches) > 1 and not _is_row(case):
            some = ", ".join(f"#{e.cases.table[row]} of `{e.name_in_deck}`" for e, row in matches[:4])
            message = f"case `{case}` may be any of {len(matches)}: {some}"
            position = matches[0][0].cases.table[matches[0][1]]
            ids = {keys.case_ids(e, [row])[0] for e, row in matches}  # cases that differ only in structure share theirs
            remedy = "" if len(ids) == 1 else "give more of its id, or "
            raise Problem(error("E312", message, help=f"{remedy or 'give '}its position: `--case '#{position}'`"))
        for experiment, row in matches:
            rows_of[experiment.name].add(row)
    return [(e, np.array(sorted(rows_of[e.name]), dtype=np.int64)) for e in experiments if rows_of[e.name]]


def _of_search(name: str, case: int | str) -> str:
    """Remedies where a case may belong to a search that has not run yet."""
    again = f"`met run ARCHIVE.h5 --case {quoted(_case_text(case))}`"
    return f"each case of the search `{name}` follows from those before: run one again from its archive: {again}"


def _is_row(case: int | str) -> bool:
    return not isinstance(case, str) or row_of(case) is not None


def _case_text(case: int | str) -> str:
    return case if isinstance(case, str) else f"#{case}"


def _rows(experiment: Experiment, case: int | str) -> list[int]:
    """The rows of the case table that a user's word means: a row's number, `#7`, or the beginning of case_ids."""
    if _is_row(case):
        position = row_of(case) if isinstance(case, str) else int(case)
        row = None if position is None else row_at(experiment.cases.table, position)
        return [] if row is None else [row]
    if not case:
        return []
    pieces = (np.arange(piece.start, piece.stop) for piece in blocks(experiment.cases.count))
    ids = (case_id for rows in pieces for case_id in keys.case_ids(experiment, rows))
    return [row for row, case_id in enumerate(ids) if case_id.startswith(str(case))]
