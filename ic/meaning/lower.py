"""From a deck to a plan: the runs and sweeps that were asked for, each as an experiment."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np

from ic.grammar.syntax import Deck, Word
from ic.meaning.arm import resolve_arm
from ic.meaning.complaints import Complaints, known_words
from ic.meaning.resolve import Definition, Definitions
from ic.meaning.run import Resolved, resolve_run
from ic.meaning.scope import Scope
from ic.meaning.servos import check_servo_definition
from ic.meaning.sweep import Sweep, check_coordinates, coordinates, kept, read_sweep, table
from ic.meaning.values import Value
from ic.read import in_order, read
from met.diagnostic import Diagnostic, Label, Problem, did_you_mean, error
from met.frozen import frozen
from met.plan import Cases, Experiment, Formula, Plan, Source
from met.trace import Formulas, Graph, Scalar

Select = Sequence[str] | Literal["all"] | None


@frozen
class Compiled:
    """A plan, None where an error stands in its way; all diagnostics, warnings too; every file's text by name."""

    plan: Plan | None
    diagnostics: tuple[Diagnostic, ...]
    sources: Mapping[str, str] = field(default_factory=dict)
    scopes: tuple[Scope, ...] = field(default=(), repr=False)  # one for each experiment: what `explain` looks into


def check(path: str | PathLike[str], *, include_dirs: Sequence[str | PathLike[str]], defines: Sequence[str],
          select: Select) -> Compiled:
    """The deck at `path`, compiled."""
    try:
        deck = read(Path(path), [Path(each) for each in include_dirs], defines)
    except Problem as problem:
        return Compiled(None, problem.diagnostics, problem.sources)
    return compile_deck(deck, select=select, defines=defines)


def compile_deck(deck: Deck, *, select: Select = None, defines: Iterable[str] = (),
                 complaints: Complaints | None = None) -> Compiled:
    """The plan of the deck's runs and sweeps that `select` names, with everything that is wrong on the way."""
    complaints = complaints if complaints is not None else Complaints(deck.warnings)
    definitions = Definitions(deck, complaints)
    experiments: list[Experiment] = []
    scopes: list[Scope] = []
    try:
        complaints.add(
            *(d for problem in Scope(definitions, complaints).names.check_lets() for d in problem.diagnostics)
        )
        for kind in ("arm", "servo", "run"):
            for definition in definitions.of_kind(kind).values():
                definitions.block(definition)
        for definition in chosen(definitions, complaints, select):
            with complaints.gather():
                lowered = lower(definitions, complaints, definition)
                if lowered is not None:
                    experiments.append(lowered[0])
                    scopes.append(lowered[1])
        for arm in definitions.of_kind("arm").values():
            resolve_arm(Scope(definitions, complaints), arm)
        for name in definitions.of_kind("servo"):
            with complaints.gather():
                check_servo_definition(Scope(definitions, complaints), name)
    except RecursionError:
        complaints.error("D078", "this deck's values are nested too deeply",
                         help="build them up in steps, with `let`")
    except Problem as problem:
        complaints.add(*problem.diagnostics)
    sources = (*deck.sources, *definitions.csv_files.sources)
    texts = {source.name: source.text for source in sources}
    if not complaints.errors:
        complaints.admit_remarks()
    else:
        return Compiled(None, in_order(complaints.all, sources), texts)
    files = tuple(Source(source.name, source.text, source.sha256) for source in sources)
    selected = (select,) if isinstance(select, str) else tuple(dict.fromkeys(select or ()))
    return Compiled(Plan(deck.file, tuple(experiments), files, tuple(defines), selected),
                    in_order(complaints.all, sources), texts, tuple(scopes))


def chosen(definitions: Definitions, complaints: Complaints, select: Select) -> list[Definition]:
    """The runs and sweeps that are asked for: by name, all, or the only one, or the one marked `default`."""
    known = {d.name: d for kind in ("run", "sweep") for d in definitions.of_kind(kind).values()}
    if select == "all":
        return list(known.values())
    if select is not None:
        names = [select] if isinstance(select, str) else list(dict.fromkeys(select))
        for name in names:
            if name not in known:
                complaints.error("D164", f"no run or sweep `{name}` in this deck",
                                 help=[*did_you_mean(name, known), known_words("it has", known)])
        return [known[name] for name in names if name in known]
    default = definitions.default()
    if len(known) == 1 or default is not None:
        return [default] if default is not None else list(known.values())
    if complaints.errors and not known:
        return []
    if not known:
        raise Problem(error("D161", "this deck has no run", help="write `run NAME { ... }`"))
    none = "several included files mark a `default`" if any(d.default for d in known.values()) else \
        "none is marked `default`"
    raise Problem(error("D162", f"this deck has {len(known)} runs and sweeps, and {none}",
                        also=[Label(d.place, d.name) for d in known.values()],
                        help=[known_words("name one", known), "or write `default run ...` for one of them"]))


Lowered = tuple[Experiment, Scope] | None


def lower(definitions: Definitions, complaints: Complaints, definition: Definition) -> Lowered:
    """One run or sweep as an experiment, with its scope; None where something of it is wrong, which was told."""
    if definition.kind == "run":
        scope = Scope(definitions, complaints)
        resolved = resolve_run(scope, definition)
        return None if resolved is None else _experiment(scope, definition, resolved, None)
    of = definition.group.of
    assert of is not None  # a sweep without one is no definition
    if len(of.path) > 1:
        raise Problem(error("D059", f"`{of.text}` is a path; the name of a run is needed", of.place,
                            help=f"write `{of.path[0].text}`"))
    base = definitions.find("run", Word(of.text, of.place))
    graph = Graph()
    before = len(complaints.errors)
    sweep = read_sweep(definitions, complaints, definition, graph)
    if len(complaints.errors) > before:
        resolve_run(Scope(definitions, complaints), base)
        return None
    scope = Scope(definitions, complaints, {varied.path: varied for varied in sweep.varied}, graph)
    resolved = resolve_run(scope, base)
    check_coordinates(scope, complete=resolved is not None)
    return None if resolved is None else _experiment(scope, definition, resolved, sweep)


def _experiment(scope: Scope, definition: Definition, resolved: Resolved, sweep: Sweep | None) -> Lowered:
    parameters, outputs = scope.quantities()
    formulas = Formulas.of(scope.graph, outputs) if outputs else Formulas()
    cases = Cases(1, (), resolved.seed)
    if sweep is not None:
        cases = _cases(scope, resolved, sweep, outputs, formulas)
    notes = (*scope.notes, *_stability(scope, resolved, cases))
    return Experiment(definition.name, resolved.structure, parameters, formulas, cases, resolved.requirements,
                      definition.place, notes), scope


def _cases(scope: Scope, resolved: Resolved, sweep: Sweep, outputs: list[Scalar], formulas: Formulas) -> Cases:
    for varied in sweep.varied:
        taken = scope.sets.get(varied.path) or varied.path in scope.names.followed
        if taken and varied.path not in formulas.inputs:
            scope.complaints.error("D137", f"`{varied.path}` changes nothing in this run", varied.place,
                                   help="no parameter's value depends on it: leave it out")
    columns = table(sweep)
    keep = kept(scope, sweep, columns)
    columns = {path: values[keep] for path, values in columns.items()}
    count = int(np.count_nonzero(keep))
    scope.checks.run(columns, count)
    seed = resolved.seed
    if sweep.seed is not None:
        seed = _seed(scope, sweep) or 0
    paths = [path for path, settled in scope.parameters.items() if isinstance(settled.value, Scalar)]
    dependents: dict[str, list[str]] = {varied.path: [] for varied in sweep.varied}
    for path, output in zip(paths, outputs, strict=True):
        for name in Formulas.of(scope.graph, [output]).inputs:
            dependents[name].append(path)
    return Cases(count, coordinates(scope, sweep, columns, dependents), seed)


def _seed(scope: Scope, sweep: Sweep) -> int | None:
    assert sweep.seed is not None
    with scope.complaints.gather():
        found = scope.names.evaluate(sweep.seed.value)
        if not isinstance(found, Value) or isinstance(found.number, Scalar) or not found.bare \
                or not float(found.number).is_integer() or not 0 <= found.number <= 2**53:
            raise Problem(error("D113", "a seed is a whole number from 0 to 2^53", found.place))
        return int(found.number)
    return None


def _stability(scope: Scope, resolved: Resolved, cases: Cases) -> list[str]:
    """`h * lambda` of each joint, as a note: its value, or least and largest over the cases."""
    notes = []
    inputs = {coordinate.path: coordinate.values for coordinate in cases.coordinates}
    for joint, x in resolved.stability:
        if isinstance(x, Scalar):
            values = np.asarray(Formulas.of(scope.graph, [x]).replay(inputs)[0])
            shown = f"{float(values.min()):.3g} to {float(values.max()):.3g}" if values.size else "?"
        else:
            shown = f"{float(x):.3g}"
        notes.append(f"stability of joint {joint}: h * lambda = {shown}")
    return notes


__all__ = ["Compiled", "Formula", "Select", "chosen", "compile_deck", "lower"]
