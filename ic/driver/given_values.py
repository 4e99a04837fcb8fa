"""A run whose parameters get values from outside, for many cases at once, as if a sweep of the deck varied them.

`GivenRun` is of one run; `vary` compiles it as a sweep over some paths. The resulting experiment has one case; the same
program runs any others, whose values are checked by `VariedRun.errors` like those of a sweep.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path

import numpy as np

from ic.driver.compile import Compiled, compile_deck
from ic.driver.explain import explanations_of
from ic.grammar.parse import parse
from ic.grammar.syntax import Deck, Entry, Name, Number, WithUnit, children
from ic.grammar.uses import with_full_names
from ic.meaning.definitions.resolve import Definitions
from ic.meaning.expressions.conditions import Checks
from ic.meaning.expressions.quantity import measure_of
from ic.read import read
from ic.text.complaints import Complaints, known_words
from ic.text.lexer import END, Text, Token, solid_tokens
from ic.text.source import SourceFile
from met.diagnostic import Diagnostic, Problem, did_you_mean, error
from met.frozen import frozen
from met.plan import Experiment
from met.plan.columns import CaseValues
from met.unit_parser import parse_unit
from met.units import Measure, same

GIVEN = "(given)"
"""The name, in messages, of the text that varies the given values."""

VARY = "vary "
"""Prefix of a path in that text."""


@frozen
class VariedRun:
    """A run as a sweep of one case.

    checks   those of values, for cases of any others; None where no path is given
    sources  texts that messages show
    """

    experiment: Experiment
    checks: Checks | None
    sources: Mapping[str, str]

    def check(self, columns: Mapping[str, CaseValues], count: int) -> None:
        """Raise Problem where one of `count` cases has a value that its parameter cannot have. columns: SI, by path"""
        errors = () if self.checks is None else self.checks.errors(columns, count)
        if errors:
            raise Problem(errors, self.sources)

    def broken(self, columns: Mapping[str, np.ndarray], count: int) -> np.ndarray:
        """A truth for each of `count` cases: whether `check` refuses it, [n]."""
        return np.zeros(count, bool) if self.checks is None else self.checks.broken(columns, count)


@frozen
class GivenRun:
    """A run of a deck, compiled once unchanged, and again for each set of given paths.

    settings  `PATH=VALUE`, as of `--set`
    """

    deck: Deck
    name: str
    defines: tuple[str, ...]
    settings: tuple[str, ...]
    compiled: Compiled

    @property
    def experiment(self) -> Experiment:
        """The run as in the deck."""
        assert self.compiled.plan is not None
        return self.compiled.plan.experiments[0]

    def unit(self, path: str) -> str | None:
        """The SI unit of a path's value, `gearbox.kp` or a `let`; None for an unknown path, "" for a word."""
        explanation = next(explanations_of(self.compiled, path), None)
        return None if explanation is None else explanation.unit if not isinstance(explanation.value, str) else ""

    def written_in(self, path: str) -> tuple[str, Measure]:
        """The unit in which the deck writes a parameter or a `let`: the first of its dimension in its value or in the
        `let`s that occur there; its SI unit where there is none."""
        (scope,) = self.compiled.scopes
        settled, let = scope.settled(path), scope.definitions.lets.get(path)
        si = settled.unit if settled is not None else self.unit(path) or "1"
        wanted = parse_unit(si)
        expression = settled.expression if settled is not None else None if let is None else let.value
        waiting = [] if expression is None else [expression]
        seen: set[str] = set()
        while waiting:
            part = waiting.pop()
            unit = part.unit if isinstance(part, Number | WithUnit) else None
            if unit is not None and same(measure_of(unit).dimension, wanted.dimension):
                return unit.text, measure_of(unit)
            if isinstance(part, Name) and part.text in scope.definitions.lets and part.text not in seen:
                seen.add(part.text)
                waiting.append(scope.definitions.lets[part.text].value)
            waiting.extend(reversed(children(part)))
        return si, wanted

    def vary_most(self, values: Mapping[str, tuple[float | str, str]]) -> tuple[VariedRun, tuple[str, ...]]:
        """The run over as many of these paths as can vary together, and those left out, since they have no effect, or
        decide the program. Raises Problem where the deck has a mistake."""
        together: dict[str, tuple[float | str, str]] = {}
        run = VariedRun(self.experiment, None, self.compiled.sources)
        waiting = [dict(values)]
        while waiting:
            more = waiting.pop()
            if not more:
                continue
            try:
                run = self.vary({**together, **more})
            except Problem as problem:
                blamed = _given_paths(problem.diagnostics, {**together, **more}) & more.keys()
                if blamed:
                    waiting.append({path: value for path, value in more.items() if path not in blamed})
                elif len(more) > 1:
                    paths = list(more)
                    halves = paths[: len(paths) // 2], paths[len(paths) // 2 :]
                    waiting += [{path: more[path] for path in half} for half in reversed(halves)]
                continue
            together.update(more)
        return run, tuple(path for path in values if path not in together)

    def sets(self, path: str) -> bool:
        """True where the settings contain exactly this path."""
        return any(_path(setting) == path for setting in self.settings)

    def vary(
        self, values: Mapping[str, tuple[float | str, str]], *, repeat: int = 1, words: Mapping[str, str] | None = None
    ) -> VariedRun:
        """The run as a sweep over these paths, of which the one case has these values in these units.

        values  numbers, or words as a deck has them
        repeat  1: nothing is repeated
        words   what decides the program, by path, in place of what the deck writes

        What is set of the same paths counts for nothing then.
        Raises Problem with what is wrong, as of the entry of a sweep; E434 where a path decides the program.
        """
        if not values and repeat == 1:
            return VariedRun(self.experiment, None, self.compiled.sources)
        words = {**self._set_around(values), **(words or {})}  # a `--set` around a varied path is refused
        settings = [setting for setting in self.settings if _path(setting) not in (*words, *values)]
        name = f"{self.name}_given"
        while name in _names(self.deck):
            name += "_"
        varied = [
            *((path, word, "1") for path, word in words.items()),
            *((path, *value) for path, value in values.items()),
        ]
        text = _sweep(f"{name} of {self.name}", varied, repeat)
        deck = replace(
            self.deck,
            entries=(*self.deck.entries, *with_full_names(_entries(text), self.deck.roofs)),
            sources=(*self.deck.sources, SourceFile(GIVEN, _without_vary(text), "")),
        )
        compiled = compile_deck(deck, select=name, defines=self.defines, settings=settings)
        if compiled.plan is None:
            raise Problem(_without_parts(_errors(compiled), words, text), compiled.sources)
        (experiment,) = compiled.plan.experiments
        chosen = [choice.path for choice in experiment.cases.choices if choice.path not in words]
        if chosen:
            path = chosen[0]
            message = f"`{path}` decides the program, and is no number that a case brings"
            raise Problem(error("E434", message, help=f'`batch.Simulation(..., set={{"{path}": "..."}})` sets it'))
        assert [coordinate.path for coordinate in experiment.cases.coordinates] == list(values)
        (scope,) = compiled.scopes
        experiment = replace(experiment, name=self.name, sweep="", cases=replace(experiment.cases, choices=()))
        return VariedRun(experiment, scope.checks.of_other_cases(), compiled.sources)

    def _set_around(self, values: Iterable[str]) -> dict[str, str]:
        """The settings of things of which these paths are parts, by path: a command with one of its values given."""
        return {
            _path(setting): setting.partition("=")[2]
            for setting in self.settings
            if any(path.startswith(f"{_path(setting)}.") for path in values)
        }


def given_run(
    path: str | PathLike[str],
    run: str | None = None,
    *,
    text: str | None = None,
    include_dirs: Sequence[str | PathLike[str]] = (),
    defines: Sequence[str] = (),
    settings: Sequence[str] = (),
) -> GivenRun:
    """A run of a deck. run: None for the deck's only one, else the one that it marks `default`. Raises Problem."""
    deck = read(Path(path), [Path(include_dir) for include_dir in include_dirs], tuple(defines), text=text)
    definitions = Definitions(deck, Complaints(deck.warnings))
    return _run_of_deck(deck, _name_of(definitions, run, deck), tuple(defines), tuple(settings))


def swept_run(
    path: str | PathLike[str],
    name: str,
    *,
    include_dirs: Sequence[str | PathLike[str]] = (),
    defines: Sequence[str] = (),
    settings: Sequence[str] = (),
) -> tuple[GivenRun, tuple[Experiment, ...]]:
    """A run of a deck and the run itself, or the run of a sweep and the experiments of the sweep. Raises Problem."""
    deck = read(Path(path), [Path(include_dir) for include_dir in include_dirs], tuple(defines))
    sweep = Definitions(deck, Complaints(deck.warnings)).of_kind("sweep").get(name)
    run = name if sweep is None else sweep.run_name or name
    base_run = given_run(path, run, include_dirs=include_dirs, defines=defines, settings=settings)
    if sweep is None:
        return base_run, (base_run.experiment,)
    compiled = compile_deck(base_run.deck, select=name, defines=defines, settings=settings)
    if compiled.plan is None:
        raise Problem(_errors(compiled), compiled.sources)
    return base_run, compiled.plan.experiments


def _run_of_deck(deck: Deck, name: str, defines: tuple[str, ...], settings: tuple[str, ...]) -> GivenRun:
    """The run of this name, compiled. Raises Problem where the deck has a mistake."""
    compiled = compile_deck(deck, select=name, defines=defines, settings=settings)
    if compiled.plan is None:
        raise Problem(_errors(compiled), compiled.sources)
    return GivenRun(deck, name, defines, settings, compiled)


def _name_of(definitions: Definitions, run: str | None, deck: Deck) -> str:
    """The name of the requested run. Raises Problem E433 where it is a sweep, or there is no unique one."""
    runs, sweeps = definitions.of_kind("run"), definitions.of_kind("sweep")
    sources = {source.name: source.text for source in deck.sources}
    if run is None:
        own = {name: definition for name, definition in runs.items() if definitions.writes(definition)} or dict(runs)
        if len(own) == 1:
            return next(iter(own))
        ours = [
            definition
            for definition in (*runs.values(), *sweeps.values())
            if definition.name in own or definitions.writes(definition)
        ]
        default = next((run_or_sweep for run_or_sweep in ours if run_or_sweep.default), None)
        if default is None or default.name not in own:
            why = f"it marks a sweep, `{default.name}`, `default`" if default else "none is marked `default`"
            message = f"this deck has {len(own)} runs, and {why}" if own else "this deck has no run"
            helps = [f'name one: `run="{next(iter(own))}"`', known_words("there are", own)] if own else "write one"
            raise Problem(error("E433", message, help=helps), sources)
        return default.name
    if run in sweeps:
        base = sweeps[run].run_name
        message = f"`{run}` is a sweep, and a simulation is of one run, whose values are given"
        raise Problem(
            error("E433", message, sweeps[run].place, help=f'`run="{base}"` is the run that it varies' if base else ()),
            sources,
        )
    if run not in runs:
        raise Problem(
            error(
                "E433", f"no run `{run}` in this deck", help=[*did_you_mean(run, runs), known_words("there are", runs)]
            ),
            sources,
        )
    return run


def _path(setting: str) -> str:
    return setting.partition("=")[0].strip()


def _errors(compiled: Compiled) -> list[Diagnostic]:
    return [diagnostic for diagnostic in compiled.diagnostics if diagnostic.severity == "error"]


def _names(deck: Deck) -> set[str]:
    """All names of the deck's definitions."""
    return {word.text for entry in deck.entries for word in (*getattr(entry, "words", ()), *getattr(entry, "path", ()))}


def _sweep(head: str, varied: Iterable[tuple[str, float | str, str]], repeat: int) -> str:
    """The text of a sweep over paths with these values and units. A caller's texts are on lines of their own, since
    messages show lines; `_without_vary` removes `VARY`, which is not the caller's."""
    lines = [f"sweep {head} {{"]
    for path, value, unit in varied:
        text = value if isinstance(value, str) else repr(value)
        lines += [f"{VARY}{path}", "= [", text, f"]{f' {unit}' if unit != '1' else ''};"]
    lines += ["repeat", str(repeat), ";"] if repeat > 1 else []
    return "\n".join([*lines, "}", ""])


def _without_vary(text: str) -> str:
    """The text of such a sweep for messages, each word at its place."""
    return re.sub(f"^{VARY}", " " * len(VARY), text, flags=re.MULTILINE)


def _without_parts(errors: Sequence[Diagnostic], words: Mapping[str, str], text: str) -> list[Diagnostic]:
    """The errors without those of values that are parts of a word with an error of its own, from which they follow."""
    lines = _without_vary(text).split("\n")

    def line(diagnostic: Diagnostic) -> str:
        label = diagnostic.at
        return lines[label.place.line - 1].strip() if label is not None and label.place.file == GIVEN else ""

    wrong = tuple(f"{path}." for path, word in words.items() if any(line(diagnostic) == word for diagnostic in errors))
    return [diagnostic for diagnostic in errors if not line(diagnostic).startswith(wrong)]


def _given_paths(errors: Iterable[Diagnostic], values: Mapping[str, tuple[float | str, str]]) -> set[str]:
    """The paths in whose lines of `_sweep` these errors stand."""
    lines = _without_vary(_sweep("", ((path, *value) for path, value in values.items()), 1)).split("\n")
    places = [
        diagnostic.at.place for diagnostic in errors if diagnostic.at is not None and diagnostic.at.place.file == GIVEN
    ]
    return {lines[place.line - 1].strip() for place in places if place.line <= len(lines)} & values.keys()


def _entries(text: str) -> tuple[Entry, ...]:
    """The entries of a text without preprocessor lines. Raises Problem."""
    source = Text(GIVEN, text)
    entries, diagnostics = parse([*solid_tokens(source), Token(END, "", source, len(text.rstrip()), 1)])
    if diagnostics:
        raise Problem(diagnostics, {GIVEN: _without_vary(text)})
    return entries
