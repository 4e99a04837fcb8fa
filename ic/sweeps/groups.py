"""A run, a sweep or a sum of them as experiments: one for each structure, with its cases and their positions."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from ic.grammar.settings import path_of
from ic.grammar.syntax import Deck, Word, names_in
from ic.meaning.checks.programs import check_program
from ic.meaning.definitions.resolve import Definition, Definitions
from ic.meaning.parameters.scope import Scope
from ic.meaning.runs.allowances import allowances_of, places_of
from ic.meaning.runs.run import experiment, resolve_run
from ic.sweeps.axes import Sweep, read_sweep, varied_paths, whole_number
from ic.sweeps.choices import Choices, with_choices
from ic.sweeps.confidences import check_confidences
from ic.sweeps.effects import Effects
from ic.sweeps.reach import check_coordinates, check_effects, plan_coordinates
from ic.sweeps.searches import check_goal, each_case, read_search, with_corners
from ic.sweeps.settings import Settings, check_overridden
from ic.sweeps.table import columns, kept_rows, repeats, structures
from ic.text.complaints import PROVISIONAL, Complaints, known_words
from met.analysis.memo import AnalysisMemo
from met.diagnostic import Help, Label, Place, Problem, did_you_mean, error, leave_out, write
from met.frozen import frozen
from met.plan import Allowance, Cases, Choice, Experiment, keys
from met.plan.columns import PositionColumn, RowBits, ShiftedColumn, SweptRows, blocks, listed
from met.trace import Formulas, Graph, Scalar

ScopedExperiment = tuple[Experiment, Scope]
Reread = Callable[[Sequence[str]], Deck]
"""A function that reads the deck again with further macros, `NAME=VALUE`. Raises Problem."""


@frozen
class DeckSource:
    """The definitions of a deck, and how to read it again with other macros.

    settings, effects  what is set from outside of the deck, and what was found to come of it
    sweep              that the command line adds to the deck's own, if it does
    audited            whether programs are built and looked into: for what has no effect, steps, contacts, beds
    memo               answers of the analysis to the deck's experiments
    """

    definitions: Definitions
    complaints: Complaints
    reread: Reread
    settings: Settings = Settings()
    effects: Effects = field(default_factory=lambda: Effects(Settings()))
    sweep: Definition | None = None
    audited: bool = True
    memo: AnalysisMemo = field(default_factory=AnalysisMemo)

    def definitions_with(self, macros: Sequence[str]) -> Definitions:
        """The definitions of the deck read again with these macros, `NAME=VALUE`. Raises Problem."""
        definitions = Definitions(self.reread(macros), self.complaints)
        if self.sweep is not None:
            definitions = definitions.replacing(self.sweep)
        return self.settings.in_definitions(definitions)


def experiments_of(source: DeckSource, definition: Definition) -> list[ScopedExperiment]:
    """The experiments of a run or sweep; none where it has a mistake (already reported)."""
    if definition.kind == "run":
        definitions, run = source.settings.in_run(source.definitions, definition)
        allowances = allowances_of(definitions, run, source.complaints)
        made_here = source.settings.of_run(definitions, run)
        before = source.complaints.error_count
        made_here.check_lets(source.definitions, source.complaints)
        if source.complaints.error_count > before:  # wherever the value stands it would be told again
            return []
        with source.complaints.allowing(places_of(allowances)):
            scope = Scope(definitions, source.complaints, settings=source.settings.numbers(definitions, run))
            resolved = resolve_run(scope, run)
            source.effects.note_run(scope, run)
            own = Effects(made_here)
            own.note_run(scope, run)
            if resolved is None:
                own.complete = False
                own.report(source.complaints, [run.name])
                return []
            built = experiment(scope, run.name, run.place, resolved, Cases(1, (), resolved.seed), allowances)
            if not source.audited:
                own.report(source.complaints, [run.name], idle=False)
                check_overridden(scope, run, made_here)
                source.complaints.settle(PROVISIONAL)
                return [(built, scope)]
            source.effects.examine(scope, run, built, source.memo)
            own.examine(scope, run, built, source.memo)
            own.report(source.complaints, [run.name])
            check_overridden(scope, run, made_here)
            if not source.complaints.errors:
                built = check_program(scope, built, source.memo)
            source.complaints.settle()
            return [(built, scope)]
    if definition.parts:
        return _sum(source, definition, ())
    base = source.definitions.of_kind("run").get(definition.run_name)
    allowances = allowances_of(source.definitions, base, source.complaints, definition) if base is not None else ()
    with source.complaints.allowing(places_of(allowances)):  # a macro that the sweep chooses may change them
        return _Sweep(source, definition).groups()


# Sweeps


@frozen
class _Read:
    """A sweep as read with some macros: the deck's definitions, its own, that of its run, axes over a graph."""

    definitions: Definitions
    definition: Definition
    base: Definition
    sweep: Sweep
    graph: Graph


class _Sweep:
    """One sweep during its conversion to experiments."""

    def __init__(self, source: DeckSource, definition: Definition) -> None:
        self.source, self.definition = source, definition
        self.definitions, self.complaints = source.definitions, source.complaints
        self.read_so_far: dict[tuple[str, ...], _Read] = {}
        self.own = Effects(Settings())  # of what its run sets itself

    def groups(self) -> list[ScopedExperiment]:
        """The experiments of the sweep, one for each structure; none where it has a mistake, which is reported."""
        before = self.complaints.error_count
        read = self._read(self.definitions, self.definition)
        sweep = read.sweep
        if self.complaints.error_count > before:
            self._report_the_rest(read)
            return []
        self.read_so_far[()] = read
        made_here = self.source.settings.of_run(read.definitions, read.base)
        made_here.check_lets(self.definitions, self.complaints)
        if self.complaints.error_count > before:
            return []
        self.own = Effects(made_here)
        by_choice = structures(sweep)
        groups: list[tuple[ScopedExperiment, SweptRows]] = []
        dropped: dict[Place, int] = {}  # by each `exclude when`, of which a macro may bring other ones
        for choices, rows in by_choice:
            faults = self.complaints.error_count
            noted = len(self.complaints.all)
            with self.complaints.gather():
                outcome = self._group(sweep, choices, rows)
                if outcome is not None:
                    for place, count in outcome[1]:
                        dropped[place] = dropped.get(place, 0) + count
                    if outcome[0] is not None:
                        groups.append(outcome[0])
            if self.complaints.error_count > faults:
                self.complaints.mark(
                    noted,
                    *(Label(option.place, f"where `{column.path}` is `{option.text}`") for column, option in choices),
                )
                return []
        self.own.report(self.complaints, [read.base.name], idle=False)
        self._report_exclusions(dropped, bool(groups))
        if not groups:
            return []
        self._report_idle_choices(sweep, [group for group, _ in groups])
        return _numbered(sweep.name, groups)

    def _report_the_rest(self, read: _Read) -> None:
        """Report mistakes in the run, and in entries of the sweep that do not depend on one that could not be read."""
        sweep = read.sweep
        if self.source.settings != Settings():  # of which one may set what varies, already reported
            resolve_run(Scope(read.definitions, self.complaints), read.base)
            return
        varied = {varied_path.path: varied_path for varied_path in sweep.varied}
        scope = Scope(read.definitions, self.complaints, varied, read.graph)
        resolved = resolve_run(scope, read.base)
        check_coordinates(scope, complete=resolved is not None)
        lost = varied_paths(read.definitions, self.definition) - set(varied)
        excludes = [
            exclude for exclude in sweep.excludes if lost.isdisjoint(name.text for name in names_in(exclude.value))
        ]
        if resolved is not None and excludes and not self.complaints.is_known_to_lack(read.base.place):
            first = SweptRows(sweep.sizes, tuple(np.zeros(1, np.int64) for _ in sweep.sizes))
            kept_rows(scope, replace(sweep, excludes=tuple(excludes)), first, (), resolved.structure)

    def _read(self, definitions: Definitions, definition: Definition) -> _Read:
        """Read the block of a sweep, search or tuning with the settings from outside, and with the run that it is
        of."""
        settings = self.source.settings
        definitions, base = settings.in_run(definitions, _base(definitions, definition, self.complaints))
        graph = Graph()
        seed, own_seed = _seed_of(definitions, base), not settings.sets_seed
        if definition.kind == "sweep":
            sweep = read_sweep(definitions, self.complaints, definition, graph, seed=seed, own_seed=own_seed)
        else:
            fixed = {path_of(entry) for entry in settings.entries}
            sweep = read_search(definitions, self.complaints, definition, graph, noise_seed=seed, fixed=fixed)
        sweep = settings.fixed_in(sweep)
        settings.check_sweep(sweep, self.complaints, definitions)
        return _Read(definitions, definition, base, sweep, graph)

    def _group(
        self, sweep: Sweep, choices: Choices, rows: SweptRows
    ) -> tuple[tuple[ScopedExperiment, SweptRows] | None, list[tuple[Place, int]]] | None:
        """The cases of one structure, with their rows of the product; and the number that each `exclude when` drops."""
        read = self._with_macros(sweep, choices)
        definitions, run = with_choices(read.definitions, read.base, choices)
        allowances = allowances_of(definitions, run, self.complaints, read.definition)
        with self.complaints.allowing(places_of(allowances)):
            return self._group_of(read, definitions, run, choices, rows, allowances)

    def _group_of(
        self,
        read: _Read,
        definitions: Definitions,
        run: Definition,
        choices: Choices,
        rows: SweptRows,
        allowances: tuple[Allowance, ...],
    ) -> tuple[tuple[ScopedExperiment, SweptRows] | None, list[tuple[Place, int]]] | None:
        """The cases of one structure, from the definitions and choices made for it."""
        swept = read.sweep
        scope = Scope(
            definitions,
            self.complaints,
            {varied.path: varied for varied in swept.varied},
            read.graph,
            settings=self.source.settings.numbers(definitions, run),
        )
        resolved = resolve_run(scope, run)
        self.source.effects.note_run(scope, run)
        self.own.note_run(scope, run)
        check_coordinates(scope, complete=resolved is not None)
        if resolved is None:
            self.complaints.settle()
            return None
        rows, counts = kept_rows(scope, swept, rows, choices, resolved.structure)
        dropped = [(statement.place, count) for statement, count in zip(swept.excludes, counts, strict=True)]
        count = rows.count
        if not count:
            return None, dropped
        values = columns(swept, rows)
        if swept.search is None:
            scope.checks.run(values, count)
        else:
            scope.checks.run(*with_corners(swept.search, values), listed=count)
            check_goal(
                self.complaints, swept.name, swept.search, (*resolved.structure.metrics, *resolved.linear_metrics)
            )
        cases = Cases(
            count,
            plan_coordinates(scope, swept, values, _dependents(scope)),
            resolved.seed if swept.seed is None else swept.seed,
            "independent" if swept.independent is not None else "common",
            tuple(Choice(column.path, option.text, option.place) for column, option in choices),
            repeats(swept, rows),
            until_shown=0 if swept.early_axis is None else swept.early_axis.size,
        )
        built = experiment(scope, swept.name, swept.place, resolved, cases, allowances)
        built = replace(built, notes=(*(axis.note for axis in swept.axes if axis.note), *built.notes))
        if swept.search is not None:
            requirements, notes = each_case(built.requirements)
            built = replace(built, search=swept.search, requirements=requirements, notes=(*built.notes, *notes))
        if not self.source.audited:
            self.complaints.settle(PROVISIONAL)
            check_overridden(scope, run, self.source.settings.of_run(read.definitions, read.base))
            return ((built, scope), rows), dropped
        if not self.complaints.errors:
            check_effects(self.complaints, swept, built, self.source.memo)
            built = replace(built, notes=(*built.notes, *check_confidences(self.complaints, swept, built)))
            built = check_program(scope, built, self.source.memo)
        self.complaints.settle()
        self.source.effects.examine(scope, run, built, self.source.memo, self.definition.group.body)
        self.own.examine(scope, run, built, self.source.memo, self.definition.group.body)
        check_overridden(scope, run, self.source.settings.of_run(read.definitions, read.base))
        return ((built, scope), rows), dropped

    def _with_macros(self, sweep: Sweep, choices: Choices) -> _Read:
        """The sweep as it reads where these choices set macros of the deck; read once for each set. Raises Problem
        D226 where it varies something else then."""
        macros = tuple(f"{column.macro}={option.text}" for column, option in choices if column.macro)
        if macros not in self.read_so_far:
            definitions = self.source.definitions_with(macros)
            definition = definitions.of_kind(self.definition.kind).get(self.definition.name)
            if definition is None or definition.parts:
                raise Problem(
                    error(
                        "D226",
                        f"with this macro the deck has no sweep `{sweep.name}`",
                        sweep.place,
                        help="let the sweep stand outside `#if`",
                    )
                )
            read = self._read(definitions, definition)
            if read.sweep.sizes != sweep.sizes or _what_varies(read.sweep) != _what_varies(sweep):
                raise Problem(
                    error(
                        "D226",
                        f"with this macro sweep `{sweep.name}` varies something else",
                        sweep.place,
                        help="what is varied, and over how many values, must not depend on a varied macro",
                    )
                )
            self.read_so_far[macros] = read
        return self.read_so_far[macros]

    def _report_exclusions(self, dropped: Mapping[Place, int], some: bool) -> None:
        """Report conditions that exclude all cases (D139), or warn of those that exclude none (D138). dropped: excluded
        cases by condition."""
        if not some and dropped:
            *others, last = dropped
            self.complaints.error(
                "D139",
                "every case is excluded",
                last,
                also=[Label(place, "together with this") for place in others],
                help="`exclude when` says which cases are left out, not which are kept",
            )
        for place, count in dropped.items():
            if some and not count:
                self.complaints.remark("D138", "this excludes no case", place, help="the sweep is the same without it")

    def _report_idle_choices(self, sweep: Sweep, groups: Sequence[ScopedExperiment]) -> None:
        """Report a choice whose options all make the same program with the same numbers."""
        for column in sweep.chosen:
            same: dict[tuple[str, ...], list[str]] = {}
            for group, _ in groups:
                others = tuple(choice.value for choice in group.cases.choices if choice.path != column.path)
                bare = replace(group.cases, choices=(), coordinates=(), repeats=None, count=1)
                same.setdefault(others, []).append(
                    keys.structure_key(group.structure, keys.inputs(group))
                    + keys.case_ids(replace(group, cases=bare))[0]
                )
            if all(len(program_keys) > 1 and len(set(program_keys)) == 1 for program_keys in same.values()):
                remedy = leave_out("with each of its values the run is the same: leave it out")
                if column.macro:
                    remedy = Help(
                        f"the run is the same with each of its values: does an `#if` ask for `{column.macro}`?"
                    )
                self.complaints.error("D137", f"`{column.path}` changes nothing in this run", column.place, help=remedy)


def _what_varies(sweep: Sweep) -> list[list[list[str]]]:
    """The paths and choices of each axis, without numbers."""
    return [
        [[column.path, *(option.text for option in getattr(column, "options", ()))] for column in axis.columns]
        for axis in sweep.axes
    ]


def _base(definitions: Definitions, definition: Definition, complaints: Complaints) -> Definition:
    """The run that a sweep is of. Raises Problem D059 for a path."""
    base = definition.group.of
    assert base is not None  # a sweep without one is not a definition
    if len(base.path) > 1:
        raise Problem(
            error(
                "D059",
                f"`{base.text}` is a path; the name of a run is needed",
                base.place,
                help=write(base.path[0].text, old=base.text),
            )
        )
    return definitions.find_or_meant("run", Word(base.text, base.place), complaints)


def _seed_of(definitions: Definitions, run: Definition) -> int:
    """The run's seed, for the sweep's draws; mistakes in it are reported with the run."""
    block = definitions.block(run)
    item = block.get("seed") if block is not None else None
    try:
        return whole_number(definitions, item.value, "a seed", least=0) if item is not None and item.value else 0
    except Problem:
        return 0


def _dependents(scope: Scope) -> dict[str, list[str]]:
    """Parameters whose formulas need each coordinate."""
    dependents: dict[str, list[str]] = {path: [] for path in scope.varied}
    for path, settled in scope.parameters.items():
        if isinstance(settled.value, Scalar):
            for name in Formulas.of(scope.graph, [settled.value]).inputs:
                dependents[name].append(path)
    return dependents


def _numbered(name: str, groups: Sequence[tuple[ScopedExperiment, SweptRows]]) -> list[ScopedExperiment]:
    """The groups with their names, and the positions of their cases in the sweep's table."""
    if len(groups) == 1:
        return [groups[0][0]]
    among = _all_of([rows for _, rows in groups])
    slugs = _slugs([group for (group, _), _ in groups])
    out = []
    for ((group, scope), rows), slug in zip(groups, slugs, strict=True):
        positions = listed(PositionColumn(rows, among))
        out.append(
            (replace(group, name=f"{name}.{slug}", sweep=name, cases=replace(group.cases, positions=positions)), scope)
        )
    return out


def _all_of(groups: Sequence[SweptRows]) -> RowBits | None:
    """The rows of a sweep's product that are cases of one of its structures; None where that is every row."""
    whole = math.prod(groups[0].sizes)
    if sum(rows.count for rows in groups) == whole:
        return None
    flags = np.zeros(whole, dtype=bool)
    for rows in groups:
        for piece in blocks(rows.count):
            flags[rows.number(np.arange(piece.start, piece.stop))] = True
    return RowBits.of(flags)


def _slugs(groups: Sequence[Experiment]) -> list[str]:
    """A short name for each group: its choices that differ from other groups', in letters that are allowed in an
    archive's group."""
    rows = [[choice.value for choice in group.cases.choices] for group in groups]
    differ = [n for n, column in enumerate(zip(*rows, strict=True)) if len(set(column)) > 1]
    heads = [[value.partition(" {")[0] for value in row] for row in rows]  # of a model, without its parameters
    slugs = ["-".join(re.sub(r"[^\w+-]+", "_", row[n]).strip("_") or "_" for n in differ) for row in heads]
    repeated = {slug for slug in slugs if slugs.count(slug) > 1}
    return [f"{slug}-{n}" if slug in repeated else slug for n, slug in enumerate(slugs, start=1)]


# Sums


def _sum(source: DeckSource, definition: Definition, within: tuple[str, ...]) -> list[ScopedExperiment]:
    """The groups of all parts, one part's cases after the other's."""
    known = {**source.definitions.of_kind("run"), **source.definitions.of_kind("sweep")}
    for named, kind in ((named, kind) for named in definition.parts for kind in ("search", "tune")):
        if named.text in source.definitions.of_kind(kind):
            message = f"`{named.text}` is a {kind}, and a sweep is made of runs and sweeps"
            raise Problem(error("D120", message, named.place, help=f"ask for both: `met run DECK NAME {named.text}`"))
    unknown = [named for named in definition.parts if named.text not in known]
    for named in unknown:  # first of all: a mistake in another part hides no name
        source.complaints.error(
            "D041",
            f"no run or sweep `{named.text}`",
            named.place,
            help=[
                *(source.definitions.stays_away(named.text) or did_you_mean(named.text, known)),
                known_words("runs and sweeps of this deck", known),
            ],
        )
    if unknown:
        return []
    parts = []
    for named in definition.parts:
        part = known[named.text]
        if named.text in (*within, definition.name):
            raise Problem(
                error("D043", f"sweep `{definition.name}` is made of itself", named.place, help="leave it out")
            )
        groups = _sum(source, part, (*within, definition.name)) if part.parts else experiments_of(source, part)
        if not groups:
            return []
        parts.append((named, groups))
    summed: list[ScopedExperiment] = []
    seen: dict[str, list[tuple[np.ndarray, str]]] = {}  # by program, the ids of groups and the parts they are of
    first = 0
    names = [name.text for name in definition.parts]
    if len(set(names)) < len(names):
        twice = next(name for n, name in enumerate(definition.parts) if name.text in names[:n])
        raise Problem(error("D040", f"`{twice.text}` is in this sweep twice", twice.place, help="leave one out"))
    for named, groups in parts:
        size = sum(group.cases.count for group, _ in groups)
        for group, scope in groups:
            program = keys.structure_key(group.structure)
            ids, before = keys.id_numbers(group), seen.setdefault(program, [])
            again = np.flatnonzero(
                np.any([np.zeros(len(ids), bool), *(np.isin(ids, earlier_ids) for earlier_ids, _ in before)], axis=0)
            )
            if len(again) and not source.complaints.errors:  # faulty parts may be equal until they are corrected
                earlier_part = next(part for earlier_ids, part in reversed(before) if ids[again[0]] in earlier_ids)
                position = int(group.cases.table[again[0]])
                message = f"case #{position} of `{named.text}` is in `{earlier_part}` too"
                if len(again) > 1:
                    message = (
                        f"{len(again)} cases of `{named.text}` are in `{earlier_part}` too, the first is #{position}"
                    )
                them = "it" if len(again) == 1 else "them"
                raise Problem(
                    error(
                        "D227",
                        message,
                        named.place,
                        also=[Label(definition.place, "in this sweep")],
                        help=[
                            f"exclude {them} in one of the two: each case stands in the table once",
                            f"`met cases DECK {named.text}` prints {them}",
                        ],
                    )
                )
            before.append((ids, named.text))
            positions = listed(ShiftedColumn(group.cases.table, first))
            summed.append(
                (
                    replace(
                        group,
                        name=f"{definition.name}.{group.name}",
                        sweep=definition.name,
                        cases=replace(group.cases, positions=positions),
                    ),
                    scope,
                )
            )
        first += size
    return summed
