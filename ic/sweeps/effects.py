"""Checks that each setting of `--set`, or of a run itself, has an effect in one of the requested runs and sweeps.

Each run is resolved once more with what was set in question. A number becomes an input of the program, and
`met.analysis.audit` says whether anything is computed from it. Anything else becomes a name that nothing has: reading
it is an error. This is done for one structure after the other, until all is found to do something.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ic.grammar.settings import path_of
from ic.grammar.syntax import Call, Entry, Expression, Group, Name, Setting, Statement, Word, children
from ic.meaning.definitions.resolve import Definition, Definitions
from ic.meaning.definitions.row_tables import is_row_table
from ic.meaning.expressions.conditions import VariedPath
from ic.meaning.expressions.quantity import Value
from ic.meaning.parameters.scope import Scope
from ic.meaning.runs.run import BLOCKS, Resolved, experiment, resolve_run
from ic.sweeps.choices import OF_RUN, OF_SERVO
from ic.sweeps.reach import first_words, has_noise, no_scale, parameters_nearby, paths_ending_in, without_effect
from ic.sweeps.settings import SEED as SEED_PATH
from ic.sweeps.settings import Destination, Settings, applies_to, destination
from ic.text.complaints import Complaints, known_words
from met.analysis.memo import AnalysisMemo
from met.diagnostic import Label, Problem, did_you_mean
from met.plan import Cases, Coordinate, Experiment
from met.trace import Graph, Scalar

NONSENSE = "?"  # a name that nothing in a deck can have
MOST_NAMED = 4


class Effects:
    """The effects of settings: whether each had one, and the runs in which that was checked."""

    def __init__(self, settings: Settings) -> None:
        self.waiting = {path_of(entry): entry for entry in settings.entries}
        self.met: set[str] = set()  # paths of a run's structure that some run has
        self.scopes: list[Scope] = []  # of the runs that were resolved, as far as they could be
        self.complete = True  # all of them could

    def note_run(self, scope: Scope, run: Definition) -> None:
        """Note the paths of a run."""
        self.scopes.append(scope)
        for path, entry in self.waiting.items():
            if destination(scope.definitions, entry) == "run" and applies_to(scope.definitions, run, entry):
                self.met.add(path)

    def examine(
        self, scope: Scope, run: Definition, built: Experiment, memo: AnalysisMemo, sweep: Sequence[Entry] = ()
    ) -> None:
        """Look for effects in a run that was resolved without a mistake. sweep: the block of its sweep"""
        if not self.waiting or scope.complaints.errors:
            return
        named = _named(scope.definitions, sweep)
        numbers: dict[str, Setting] = {}
        for path, entry in tuple(self.waiting.items()):
            kind = destination(scope.definitions, entry)
            if path == SEED_PATH:
                used = any(varied.drawn for varied in scope.varied.values()) or has_noise(built)
            elif kind == "number" and path not in scope.targets:
                used = False
            elif kind != "run" and not _decides(kind, entry) and _is_number(scope, entry):
                numbers[path], used = entry, False
            else:
                used = kind == "number" or _is_looked_at(scope, run, entry)
            if used or path in named:
                del self.waiting[path]
                numbers.pop(path, None)
        for path in _used(scope, run, numbers, memo):
            del self.waiting[path]

    def report(self, complaints: Complaints, names: Sequence[str], *, idle: bool = True) -> None:
        """Report all settings without an effect. names: names of runs and sweeps; idle: also known paths without an
        effect"""
        quoted = [f"`{name}`" for name in names]
        where = ", ".join(quoted[:MOST_NAMED]) + (f" and {len(quoted) - MOST_NAMED} more" * (len(quoted) > MOST_NAMED))
        for path, entry in self.waiting.items():
            if self.scopes:
                self._report_one(complaints, path, entry, where, idle)

    def _report_one(self, complaints: Complaints, path: str, entry: Setting, where: str, idle: bool) -> None:
        """Report a setting of this path where it has no effect, or cannot be set."""
        scope = next(
            (candidate for candidate in self.scopes if path in candidate.known or path in candidate.not_sweepable),
            self.scopes[0],
        )
        kind = destination(scope.definitions, entry)
        inside = sorted(known for known in scope.known if known.startswith(f"{path}."))
        if any(
            (path in other.evaluated_settings and other.evaluated_settings[path] is None)
            or other.depends_on_failed(path)
            for other in self.scopes
        ):
            return  # already reported
        if kind in ("let", "servo") or path in self.met or any(path in other.targets for other in self.scopes):
            if idle:
                self._report_idle(complaints, scope, path, entry, where)
        elif path in (*BLOCKS, "record"):
            complaints.error(
                "D235",
                f"`{path}` cannot be set",
                entry.place,
                help="one value is set, not a block or a list: such as `rates.dynamics=1 kHz`",
            )
        elif path in scope.not_sweepable:
            complaints.error("D235", f"`{path}` cannot be set", entry.place, help=scope.not_sweepable[path].to_set())
        elif inside:
            complaints.error("D235", f"`{path}` cannot be set", entry.place, help=known_words("set one of", inside))
        elif self.complete:
            self._report_unknown(complaints, scope, path, entry, where)

    def _report_idle(self, complaints: Complaints, scope: Scope, path: str, entry: Setting, where: str) -> None:
        """Report a setting that changes nothing in a run or sweep (D236). where: in words."""
        if complaints.errors:  # any of which may be the cause
            return
        first = entry.path[0].text
        lets, servos = scope.definitions.lets, scope.definitions.of_kind("servo")
        place = lets[first].name.place if path in lets else servos[first].place if first in servos else None
        message = "no noise is in it" if path == SEED_PATH else "nothing that is computed depends on it"
        complaints.error(
            "D236",
            f"`{path}` changes nothing in {where}",
            entry.place,
            also=[Label(place, "defined here")] if place is not None else [],
            help=f"{message}: leave it out, or name a run that uses it",
        )

    def _report_unknown(self, complaints: Complaints, scope: Scope, path: str, entry: Setting, where: str) -> None:
        """Report a setting of a path that no run has, with what may have been meant."""
        first, *words = scope.definitions.split(path)
        rest = ".".join(words)
        joints = list(
            dict.fromkeys(
                known.split(".")[1] for other in self.scopes for known in other.known if known.startswith("initial.")
            )
        )
        servo = scope.definitions.of_kind("servo").get(first)
        also: list[Label] = []
        if rest in ("bed", "law") and first in joints:
            helps: Sequence[str] = (f"its motor is on no bed there: `substitute {first} {{ }}` puts it on one",)
        elif servo is not None and not any(
            path.startswith(f"{first}.") for other in self.scopes for path in other.known
        ):
            helps, also = ("no joint has this servo there",), [Label(servo.place, "defined here")]
        else:
            known = [known_path for other in self.scopes for known_path in (*other.known, *other.not_sweepable)]
            known += [*scope.definitions.lets, *OF_RUN, *(f"{joint}.servo" for joint in joints)]
            helps = (
                scope.definitions.stays_away(path)
                or no_scale(path)
                or did_you_mean(path, known)
                or parameters_nearby(scope, path)
                or paths_ending_in(scope, path)
            )
            macro = [] if rest else [f"a macro is defined by `-D {path}=VALUE`"]
            helps = helps or [*macro, *first_words(scope)]
        complaints.error("D234", f"nothing in {where} is called `{path}`", entry.place, also=also, help=helps)


# Numbers


def _decides(kind: Destination, entry: Setting) -> bool:
    """Return True if this setting is a compile-time number: the rate of a servo's definition."""
    return kind == "servo" and entry.path[-1].text in OF_SERVO


def _is_number(scope: Scope, entry: Setting) -> bool:
    """Return True if this setting is a number, the same in all cases."""
    try:
        value = scope.names.evaluate(entry.value)
    except Problem:
        return False
    return isinstance(value, Value) and not isinstance(value.number, Scalar)


def _used(scope: Scope, run: Definition, settings: Mapping[str, Setting], memo: AnalysisMemo) -> list[str]:
    """The paths of these settings from which this run computes something."""
    present = {
        path: entry
        for path, entry in settings.items()
        if path in scope.targets or destination(scope.definitions, entry) != "number"
    }
    if not present:
        return []
    idle = _idle(scope, run, present, memo)
    if idle is not None:
        return [path for path in present if path not in idle]
    used = []
    for path, entry in present.items():  # one that cannot be an input decides the program; the others need not
        alone = _idle(scope, run, {path: entry}, memo)
        if alone is None or path not in alone:
            used.append(path)
    return used


def _idle(scope: Scope, run: Definition, settings: Mapping[str, Setting], memo: AnalysisMemo) -> tuple[str, ...] | None:
    """The paths of these settings on which no result depends, as inputs; None if one of them cannot be an input."""
    graph = Graph()
    varied = {
        path: replace(varied_path, value=replace(varied_path.value, number=graph.input(path)))
        for path, varied_path in scope.varied.items()
    }
    for path, entry in settings.items():
        value = scope.names.evaluate(entry.value)
        assert isinstance(value, Value)
        number = np.array([float(value.number)])
        varied[path] = VariedPath(path, entry.place, number, replace(value, number=graph.input(path)), None, 1.0)
    others = {path: entry for path, entry in scope.settings.items() if path not in settings}
    trial = Scope(scope.definitions, Complaints(), varied, graph, settings=others)
    resolved = _resolved(trial, run)
    if resolved is None:
        return None
    cases = Cases(
        1, tuple(Coordinate(path, "1", 1.0, varied_path.values[:1], ()) for path, varied_path in varied.items())
    )
    built = experiment(trial, run.name, run.place, resolved, cases)
    zero = tuple(replace(coordinate, values=np.zeros(1)) for coordinate in cases.coordinates)
    zeroed = replace(built, cases=replace(cases, coordinates=zero))  # the program's answer, independent of the values
    return memo.answer("idle settings", zeroed, lambda: without_effect(built))


def _resolved(trial: Scope, run: Definition) -> Resolved | None:
    """The run resolved, without any report."""
    with trial.complaints.gather():
        resolved = resolve_run(trial, run)
        return resolved if not trial.complaints.errors else None
    return None


# Settings other than numbers


def _is_looked_at(scope: Scope, run: Definition, entry: Setting) -> bool:
    """Return True if this entry is read: an undefined name in its place raises a diagnostic."""
    place = entry.place
    nonsense = Settings((replace(entry, value=Name((Word(NONSENSE, place),), place)),))
    definitions, changed = nonsense.in_run(nonsense.in_definitions(scope.definitions), run)
    trial = Scope(definitions, Complaints(), dict(scope.varied), scope.graph, settings=scope.settings)
    return _resolved(trial, changed) is None


# What a sweep's block names


def _named(definitions: Definitions, entries: Sequence[Entry]) -> set[str]:
    """Paths that a sweep's block names in its lists and conditions, including those in the values of names."""
    waiting = list(_expressions(entries))
    paths: set[str] = set()
    while waiting:
        expression = waiting.pop()
        waiting += children(expression)
        if isinstance(expression, Call) and expression.body is not None:
            waiting += _expressions(expression.body)
        if isinstance(expression, Name) and definitions.in_full(expression).text not in paths:
            name = definitions.in_full(expression)
            paths.add(name.text)
            let = None if name.roof else definitions.lets.get(name.path[0].text)
            if let is not None and (len(name.path) == 1 or is_row_table(let.value)):
                paths.add(let.name.text)
                waiting.append(let.value)
    return paths


def _expressions(entries: Sequence[Entry]) -> Iterable[Expression]:
    """The values of these entries, and of those in their blocks."""
    for entry in entries:
        if isinstance(entry, Group):
            yield from _expressions(entry.body)
        elif isinstance(entry, Setting | Statement):
            yield entry.value
