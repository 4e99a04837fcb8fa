"""Reading of the block of a search or a tuning: its chosen parameters with bounds, its goal, and its number of cases.

It becomes a sweep of one axis, of which the values are those of its first generation (met/searches); what comes after
follows from what that gives.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from ic.grammar.settings import path_of
from ic.grammar.syntax import Call, List, Name, Setting, Statement, WithUnit, place_of, spell
from ic.language import BLOCKS
from ic.language.runs import MARGIN, RUN
from ic.meaning.definitions.resolve import Definition, Definitions
from ic.meaning.expressions.conditions import VariedPath
from ic.meaning.expressions.evaluate import PURE, evaluate_number
from ic.meaning.expressions.names import Names
from ic.meaning.expressions.quantity import Value, unit_of_plan
from ic.meaning.parameters.models import word_of
from ic.meaning.runs.allowances import ALLOW
from ic.sweeps.axes import Sweep, SweepAxis, read_sweep, varied_path, whole_number
from ic.sweeps.choices import check_constant, decides_structure, path_place
from ic.sweeps.designs import in_unit
from ic.text.complaints import Complaints, known_words
from met import units
from met.diagnostic import Label, Place, Problem, did_you_mean, error
from met.frozen import frozen
from met.plan.columns import AxisColumn, CaseValues, SweptRows
from met.plan.judged import MetricUse, Requirement
from met.plan.searches import LEAST_MARGIN, MOST_PLANTS, MOST_SEARCHED, SHORTEST, Search, SearchedParameter
from met.trace import Graph, Scalar

RANGES = {"between": False, "logbetween": True}
"""Words for bounds; True where equal ratios between them are equal steps."""

CHOOSE, AGAINST, CONFIRM, GRADIENTS = "choose", "against", "confirm", "gradients"
SWITCHED = {"on": True, "off": False}
GOALS = {"maximise": True, "minimise": False}
MOST_CORNERS = 8
"""Largest number of parameters whose bounds are combined with each other; with more, they are examined one after the
other."""


@frozen
class _Chosen:
    """A parameter that the search chooses. low: its lower bound as written"""

    parameter: SearchedParameter
    place: Place
    low: Value
    with_unit: WithUnit | None


def read_search(
    definitions: Definitions,
    complaints: Complaints,
    definition: Definition,
    graph: Graph,
    *,
    noise_seed: int = 0,
    fixed: Collection[str] = (),
) -> Sweep:
    """The search as a sweep over its first generation; reports mistakes in it.

    noise_seed  the run's, for what the sweep draws that a tuning is held against
    fixed       paths that are set outside of the deck, and so not chosen
    """
    reader = _SearchReader(definitions, complaints, definition)
    before = complaints.error_count
    for entry in definition.group.body:
        with complaints.gather():
            reader.enter(entry)
    with complaints.gather():
        reader.check(complaints.error_count > before)
    empty = Sweep(definition.name, (), (), None, None, 1, None, definition.place)
    against: Sweep | None = None
    fresh: tuple[tuple[float, ...], ...] = ()
    name = reader.sweeps.get(AGAINST)
    if name is not None:
        with complaints.gather():
            against = _against(definitions, complaints, reader, name, graph, noise_seed, fixed)
    if (confirm := reader.sweeps.get(CONFIRM)) is not None and complaints.error_count == before:
        with complaints.gather():
            # its draws are others than those of the sweep that it may share with `against`
            others = _against(definitions, complaints, reader, confirm, graph, noise_seed + 1, fixed)
            fresh = _confirming_cases(against, others, confirm)
    if complaints.error_count > before or (name is not None and against is None):
        return empty
    chosen = [choice for choice in reader.chosen if choice.parameter.path not in fixed]
    if not chosen:
        message = f"all that `{definition.name}` chooses is set, so nothing is left to choose"
        complaints.error("D361", message, definition.place, help="leave one of them out of `--set`")
        return empty
    plants = _plants(against)
    search = Search(
        kind="tune" if definition.kind == "tune" else "search",
        metric=reader.metric,
        largest=reader.largest,
        parameters=tuple(choice.parameter for choice in chosen),
        at_most=reader.at_most,
        of=definition.run_name,
        seed=reader.seed,
        against=against.name if against is not None else "",
        plants=plants,
        drawn_with=0 if against is None else noise_seed if against.seed is None else against.seed,
        confirms=confirm.text if confirm is not None else "",
        fresh=fresh,
        margin=reader.margin,
        least_margin=reader.least_margin,
        steers="least_margin" in reader.written and reader.least_margin > 0.0,
        gradients=reader.gradients,
        place=reader.goal_place,
    )
    least = len(plants) + len(fresh) + SHORTEST
    if search.kind == "tune" and search.at_most < least:
        uses = f"{len(plants)} to try the best with each case of `{search.against}`, and " if plants else ""
        uses = f"{len(fresh)} to confirm it, {uses}" if fresh else uses
        complaints.error(
            "D363",
            f"{search.at_most} cases are too few to tune anything",
            reader.at_most_place,
            help=f"{least} at least: {uses}{SHORTEST} to choose among; a thousand are no luxury",
        )
        return empty
    from met.searches import search_method

    rows = search_method(search).ask()
    columns = []
    for number, choice in enumerate(chosen):
        written = choice.with_unit.unit if choice.with_unit is not None else choice.low.unit
        unit = unit_of_plan(written, choice.low.dimension)
        columns.append(varied_path(graph, choice.parameter.path, choice.place, rows[:, number], choice.low, unit))
    for number, column in enumerate(against.varied if against is not None else (), start=len(chosen)):
        columns.append(VariedPath(column.path, column.place, rows[:, number], column.value, column.unit, column.scale))
    axis = SweepAxis(tuple(columns))
    drawn = tuple(against.designs.items()) if against is not None else ()
    return Sweep(definition.name, (axis,), (), None, None, 1, None, definition.place, search, drawn)


MARGINS = ("margin", "least_margin")
"""Keys of a tuning's numbers."""


class _SearchReader:
    """Reader of the block of a search or a tuning, entry after entry."""

    def __init__(self, definitions: Definitions, complaints: Complaints, definition: Definition) -> None:
        self.definitions, self.complaints, self.definition = definitions, complaints, definition
        self.tunes = definition.kind == "tune"
        self.chosen: list[_Chosen] = []
        self.metric, self.largest = "", False
        self.at_most = self.seed = 0
        self.margin = float(MARGIN.default) if self.tunes and isinstance(MARGIN.default, float) else 0.0
        self.least_margin = LEAST_MARGIN
        self.sweeps: dict[str, Name] = {}
        self.gradients = self.tunes
        self.goal_place = self.at_most_place = definition.place
        self.written: dict[str, Place] = {}
        entries = [entry for entry in definition.group.body if isinstance(entry, Setting)]
        self._paths = {path_of(entry): path_place(entry) for entry in entries}

    @property
    def usage(self) -> str:
        """An example of a chosen parameter in a deck's syntax."""
        return f"{f'{CHOOSE} ' * self.tunes}PATH = between(LOW, HIGH) UNIT;"

    def enter(self, entry: object) -> None:
        """Read one entry of the block of a search or tuning. Raises Problem for one that it does not have, or a wrong
        value."""
        words = [word.text for word in getattr(entry, "words", ())]
        match entry:
            case Setting() if not words and path_of(entry) in ("at_most", "seed", *(MARGINS * self.tunes)):
                self._number(entry, path_of(entry))
            case Setting() if not words and path_of(entry) == GRADIENTS and self.tunes:
                self._once(GRADIENTS, path_place(entry))
                word = word_of(entry.value)
                if word not in SWITCHED:
                    message = "a tuning's `gradients` are `on` or `off`"
                    raise Problem(error("D363", message, place_of(entry.value), help=f"write `{GRADIENTS} = off;`"))
                self.gradients = SWITCHED[word]
            case Setting() if words == [CHOOSE] * self.tunes:
                self._choose(entry)
            case Statement() if words in ([goal] for goal in GOALS):
                self._goal(entry, words[0])
            case Statement() if words in ([AGAINST], [CONFIRM]) and self.tunes:
                [word] = words
                self._once(word, entry.place)
                if not isinstance(entry.value, Name) or len(entry.value.path) > 1:
                    message = f"`{word}` takes the name of a sweep"
                    raise Problem(error("D364", message, place_of(entry.value), help=f"write `{word} SWEEP;`"))
                self.sweeps[word] = entry.value
            case Statement() if words[:1] == [ALLOW]:
                pass  # read with those of the run
            case _:
                self._refuse(entry, words)

    def check(self, failed: bool) -> None:
        """Report missing entries. failed: True where the block had a mistake, which may be the cause"""
        name = self.definition.name
        if not any(goal in self.written for goal in GOALS) and not failed:
            usage = "minimise METRIC;" if self.tunes else "maximise METRIC;"
            self.complaints.error(
                "D362", f"{self.definition.kind} `{name}` has no goal", self.definition.place, help=f"write `{usage}`"
            )
        if "at_most" not in self.written and not failed:
            self.complaints.error(
                "D363",
                f"{self.definition.kind} `{name}` does not say how many cases it may run",
                self.definition.place,
                help="write `at_most = 2000;`: it never runs more",
            )
        if not self.chosen and not failed:
            self.complaints.error(
                "D361", f"{self.definition.kind} `{name}` chooses nothing", self.definition.place,
                help=f"write `{self.usage}`",
            )  # fmt: skip

    def _once(self, key: str, place: Place, done: str = "written") -> None:
        """Note a key, or a path that is chosen, as there. Raises Problem D040 where it is there twice. done: how a
        message says that it is there"""
        if key in self.written:
            raise Problem(
                error("D040", f"`{key}` is {done} twice", place, also=[Label(self.written[key], "first")],
                      help="leave one out")
            )  # fmt: skip
        self.written[key] = place

    def _number(self, entry: Setting, key: str) -> None:
        """Read an entry of one number: `seed`, `margin`, `least_margin` or `at_most`. Raises Problem D363 for a number
        out of its range."""
        self._once(key, path_place(entry))
        if key == "seed":
            self.seed = whole_number(self.definitions, entry.value, "a seed", least=0)
            return
        value = evaluate_number(entry.value, Names(self.definitions, {}).find)
        number = value.number
        plain = not isinstance(number, Scalar) and value.dimension == PURE
        if key == "margin":
            if not plain or not 0.0 <= float(number) < 1.0:
                message = "a margin is a share of a limit, from 0 % to less than 100 %"
                raise Problem(error("D363", message, value.place, help="write `margin = 5 %;`"))
            self.margin = float(number)
            return
        if key == "least_margin":
            if not plain or not 0.0 <= float(number) < 2.0:
                message = "a least margin is a disk margin, from 0 to less than 2"
                helps = ["write `least_margin = 0.5;`: 0.3 is a gain of 1.35 times, 0.67 of 2 times", "0 asks for none"]
                raise Problem(error("D363", message, value.place, help=helps))
            self.least_margin = float(number)
            return
        if not plain or not float(number).is_integer() or not 1 <= float(number) <= MOST_SEARCHED:
            message = f"`at_most` is a whole number of cases from 1 to {MOST_SEARCHED:,}"
            raise Problem(error("D363", message, value.place, help="write `at_most = 2000;`"))
        self.at_most, self.at_most_place = int(number), value.place

    def _goal(self, entry: Statement, word: str) -> None:
        """Read the goal of a search or tuning, the metric that is to be smallest or largest. Raises Problem D362."""
        other = next((goal for goal in GOALS if goal in self.written), None)
        if other is not None:
            helps = ["leave one out", "what else matters is required in the run: `require METRIC < LIMIT;`"]
            raise Problem(
                error("D362", f"`{self.definition.name}` has two goals", entry.place,
                      also=[Label(self.written[other], "first")], help=helps)
            )  # fmt: skip
        if not isinstance(entry.value, Name) or len(entry.value.path) > 1:
            helps = [f"write `{word} METRIC;`", "what is computed of several signals is a metric of an expression"]
            raise Problem(error("D362", f"`{word}` takes the name of a metric", place_of(entry.value), help=helps))
        self.written[word] = entry.place
        self.metric, self.largest, self.goal_place = entry.value.text, GOALS[word], place_of(entry.value)

    def _choose(self, entry: Setting) -> None:
        """Add a parameter that the search may choose, with its ends. Raises Problem where it is added twice."""
        path = path_of(entry)
        self._once(path, path_place(entry), "chosen")
        if entry.operator == "+=":
            raise Problem(error("D056", f"nothing to append to in a {self.definition.kind}", path_place(entry),
                                help="write `=`"))  # fmt: skip
        self.chosen.append(self._ends(path, entry))

    def _ends(self, path: str, entry: Setting) -> _Chosen:
        """The chosen parameter of an entry `PATH = between(LOW, HIGH) UNIT;`, its ends in SI. Raises Problem D361 for
        what is no such range, D063 for ends of two dimensions."""
        names = Names(self.definitions, {}, watched=set(self._paths))
        unit, call = (entry.value.unit, entry.value.inner) if isinstance(entry.value, WithUnit) else (None, entry.value)
        ranges = known_words("ranges", RANGES)
        if not isinstance(call, Call) or call.name.text not in RANGES:
            near = did_you_mean(call.name.text, RANGES) if isinstance(call, Call) else ()
            helps = [*near, f"write `{CHOOSE * self.tunes}{' ' * self.tunes}{path} = between(LOW, HIGH) UNIT;`", ranges]
            raise Problem(error("D361", f"`{path}` is chosen between two ends", place_of(entry.value), help=helps))
        name = call.name.text
        if len(call.positional) != 2 or call.named or call.body is not None:
            message = f"`{name}` takes two numbers, the lower end and the higher"
            raise Problem(error("D361", message, call.name.place, help=f"write `{name}(LOW, HIGH) UNIT`"))
        if decides_structure(self.definitions, path, List(call.positional, place_of(call)), names):
            message = f"`{path}` decides the program, so that nothing chooses it between two ends"
            remedy = f"write a {self.definition.kind} for each, of runs that differ in it"
            raise Problem(error("D361", message, path_place(entry), help=remedy))
        low, high = (evaluate_number(in_unit(argument, unit), names.find) for argument in call.positional)
        check_constant(path, entry, names, self._paths)
        if not units.same(high.dimension, low.dimension):
            message = f"`{name}` of {units.text(low.dimension)} and {units.text(high.dimension)}"
            raise Problem(error("D063", message, high.place, help="both must be of one dimension"))
        ends = float(low.number), float(high.number)
        if not (np.isfinite(ends).all() and ends[0] < ends[1]):
            message = f"`{name}` goes from a lower to a higher value"
            remedy = "change the two about, or leave the parameter out where they are equal"
            raise Problem(error("D361", message, high.place, help=remedy))
        if RANGES[name] and not (ends[0] > 0.0 or ends[1] < 0.0):
            message = "the ends of a `logbetween` are both above or both below zero"
            raise Problem(error("D361", message, low.place, help="`between` has no such limit"))
        if not np.isfinite(ends[1] - ends[0]):
            message = f"the ends of this `{name}` are too far apart: their difference is no number"
            raise Problem(error("D361", message, high.place, help="take ends that a machine could have"))
        shown = unit_of_plan(unit or low.unit or high.unit, low.dimension)
        parameter = SearchedParameter(path, *ends, RANGES[name], shown.text if shown is not None else "")
        return _Chosen(parameter, path_place(entry), low, entry.value if isinstance(entry.value, WithUnit) else None)

    def _refuse(self, entry: object, words: list[str]) -> None:
        """Raise Problem D360 for an entry that a search or tuning does not have, with what may have been meant. words:
        before its path."""
        place: Place = entry.place  # type: ignore[attr-defined]  # every entry has one
        kind, run = self.definition.kind, self.definition.run_name or "RUN"
        known = [
            *(declared.name for declared in BLOCKS[kind].entries),
            *([] if self.tunes else ["PATH = between(LOW, HIGH)"]),
        ]
        if isinstance(entry, Setting):
            path, value = path_of(entry), entry.value
            call = value.inner if isinstance(value, WithUnit) else value
            if isinstance(call, Call) and call.name.text in RANGES:
                usage = f"{f'{CHOOSE} ' * self.tunes}{path} = {spell(value)};"
                raise Problem(error("D360", f"in a {kind} this is written otherwise", place, help=f"write `{usage}`"))
            if "." not in path and path not in self.definitions.lets and path not in RUN.keys:
                helps = [*did_you_mean(path, known), known_words(f"a {kind} has", known)]
                raise Problem(error("D360", f"no `{' '.join([*words, path])}` in a {kind}", place, help=helps))
            raise Problem(
                error("D360", f"`{' '.join([*words, path])} = ...` in a {kind}", place,
                      help=[f"to choose it write `{f'{CHOOSE} ' * self.tunes}{path} = between(LOW, HIGH) UNIT;`",
                            f"or set it in a run `like {run}`"])
            )  # fmt: skip
        text = " ".join(words)
        helps = [*did_you_mean(text, known), known_words(f"a {kind} has", known)]
        if words[:1] == [AGAINST]:
            helps = ["a tuning is held against a sweep: `tune NAME of RUN { ... }`",
                     "a search chooses what is drawn, too: `PATH = between(LOW, HIGH) UNIT;`"]  # fmt: skip
        if words[:1] == ["require"]:
            helps = ["it belongs to the run"]
        raise Problem(error("D360", f"no `{text}` in a {kind}", place, help=helps))


# Against a sweep


def _against(
    definitions: Definitions,
    complaints: Complaints,
    reader: _SearchReader,
    name: Name,
    graph: Graph,
    seed: int,
    fixed: Collection[str],
) -> Sweep | None:
    """The sweep whose cases a tuning is judged on, or by which it is confirmed; None where it has mistakes, which are
    reported. Raises Problem D364 where it is unsuitable."""
    known, place = definitions.of_kind("sweep"), name.place
    if name.text not in known:
        helps = [*did_you_mean(name.text, known), known_words("sweeps of this deck", known)]
        raise Problem(error("D041", f"no sweep `{name.text}`", place, help=helps))
    definition = known[name.text]
    run, own = definition.run_name, reader.definition.run_name
    also = [Label(definition.place, "written here")]
    if definition.parts or not own or run != own:
        origin = "is made of others" if definition.parts or not run else f"is of `{run}`"
        remedy = f"write a sweep of `{own or 'RUN'}` with the cases that it must bear"
        raise Problem(error("D364", f"sweep `{name.text}` {origin}, and not of the run that is tuned", place, also=also,
                            help=remedy))  # fmt: skip
    before = complaints.error_count
    sweep = read_sweep(definitions, complaints, definition, graph, seed=seed)
    if complaints.error_count > before or not (sweep.axes or sweep.repeated):  # that it varies nothing is reported
        return None
    cannot = [
        *((column.place, "it chooses what decides the program") for column in sweep.chosen),
        *((exclude.place, "it leaves cases out") for exclude in sweep.excludes),
        *([(sweep.repeated, "it repeats cases")] if sweep.repeated is not None else []),
        *([(sweep.independent, "each of its cases has noise of its own")] if sweep.independent is not None else []),
        *([(axis.until_shown, "it runs cases until something is shown") for axis in sweep.axes if axis.until_shown]),
        *([(definition.place, "it has a seed of its own")] if sweep.seed is not None and not _draws(sweep) else []),
    ]
    for where, why in cannot[:1]:
        remedy = "a tuning is held against a list, a product or a sample of numbers: write such a sweep for it"
        raise Problem(error("D364", f"nothing is tuned against sweep `{name.text}`: {why}", place,
                            also=[Label(where, "here")], help=remedy))  # fmt: skip
    places = {choice.parameter.path: choice.place for choice in reader.chosen}
    for column in sweep.varied:
        if column.path in places:
            message = f"`{column.path}` is chosen, and varies in `{name.text}`"
            remedy = "one parameter cannot be both: leave it out of one of the two"
            raise Problem(error("D364", message, places[column.path], also=[Label(column.place, "varies here")],
                                help=remedy))  # fmt: skip
        if column.path in fixed:
            message = (
                f"`{column.path}` is set, and varies in `{name.text}`, which `{reader.definition.name}` is against"
            )
            raise Problem(error("D364", message, place, also=[Label(column.place, "varies here")],
                                help="leave it out of `--set`"))  # fmt: skip
    count = int(np.prod([axis.size for axis in sweep.axes]))
    if count > MOST_PLANTS:
        message = f"sweep `{name.text}` has {count:,} cases, and a tuning is held against {MOST_PLANTS:,} at most"
        raise Problem(error("D364", message, place, also=also, help="a hundred drawn at random tell most: draw fewer"))
    return sweep


def _confirming_cases(against: Sweep | None, drawn: Sweep | None, name: Name) -> tuple[tuple[float, ...], ...]:
    """The cases of the sweep by which a tuning is confirmed, coordinates as `_plants` has them of the sweep that it is
    judged on. Raises Problem D364 where they are the same cases."""
    if drawn is None:
        return ()
    first, paths = _plants(against), [column.path for column in drawn.varied]
    wanted = [column.path for column in against.varied] if against is not None else []
    own = "a sweep that writes no `seed` is drawn anew for `confirm`, even the one that the tuning is against"
    if sorted(paths) != sorted(wanted):
        message = f"`{name.text}` does not vary what the tuning is against"
        held = f"write a sample of {', '.join(f'`{path}`' for path in wanted)}" if wanted else "write `against SWEEP;`"
        raise Problem(error("D364", message, name.place, help=held))
    order = [paths.index(path) for path in wanted]
    rows = tuple(tuple(row[column] for column in order) for row in _plants(drawn))
    if not _draws(drawn):
        message = f"nothing is drawn in `{name.text}`, so that it confirms nothing"
        raise Problem(error("D364", message, name.place, help=["write a sample in it", own]))
    if not set(rows).isdisjoint(first):
        message = f"cases of `{name.text}` are among those that choose the design"
        raise Problem(error("D364", message, name.place, help=own))
    return rows


def _draws(sweep: Sweep) -> bool:
    return any(axis.design for axis in sweep.axes)


def _plants(sweep: Sweep | None) -> tuple[tuple[float, ...], ...]:
    """The values of a sweep's coordinates in each of its cases (the plants of a tuning, on which it judges its
    candidates)."""
    if sweep is None:
        return ()
    rows = SweptRows(sweep.sizes, (None,) * len(sweep.sizes))
    table = [
        np.asarray(AxisColumn(rows, number, column.values))
        for number, axis in enumerate(sweep.axes)
        for column in axis.columns
        if isinstance(column, VariedPath)
    ]
    return tuple(tuple(row) for row in np.stack(table, axis=1).tolist())


# Checked with the run


def with_corners(search: Search, columns: Mapping[str, CaseValues]) -> tuple[dict[str, np.ndarray], int]:
    """The cases of a search's first generation, then others that may occur: at the bounds of the chosen parameters, and
    with each plant (a case of the sweep that a tuning judges candidates on); and their total number. The results of
    checks for these are assumed to hold in between."""
    ends = [(parameter.low, parameter.high) for parameter in search.parameters]
    if len(ends) <= MOST_CORNERS:
        corners = list(itertools.product(*ends))
    else:
        low = tuple(end[0] for end in ends)
        corners = [low, tuple(end[1] for end in ends)]
        corners += [(*low[:n], end[1], *low[n + 1 :]) for n, end in enumerate(ends)]
    plants = search.plants or ((),)
    rows = [(*corner, *plants[number % len(plants)]) for number, corner in enumerate(corners)]
    rows += [(*corners[0], *plant) for plant in (*plants[1:], *search.fresh)]
    more = np.array(rows)
    table = {path: np.concatenate([np.asarray(own), more[:, n]]) for n, (path, own) in enumerate(columns.items())}
    return table, len(next(iter(table.values())))


def check_goal(complaints: Complaints, name: str, search: Search, metrics: Sequence[MetricUse]) -> None:
    """Report a goal that is not a metric of the run."""
    known = [use.name for use in metrics]
    if search.metric not in known and not complaints.is_lost(search.metric):
        missing = ["a run has one by `metric NAME = MODEL { of = ...; }`"] if not known else []
        helps = [
            *did_you_mean(search.metric, known),
            *missing,
            *([known_words("metrics of the run", known)] * bool(known)),
        ]
        complaints.error("D362", f"`{name}` goes by `{search.metric}`, which is no metric of its run", search.place,
                         help=helps)  # fmt: skip


def each_case(requirements: tuple[Requirement, ...]) -> tuple[tuple[Requirement, ...], list[str]]:
    """The requirements for a search, each applied to every case, with notes on those over shares of cases: chosen cases
    show nothing about a share."""
    from dataclasses import replace

    notes = [
        f"`{requirement.text}` is of a share of cases, of which chosen cases show nothing: "
        "each is held against its limit"
        for requirement in requirements
        if requirement.share is not None
    ]
    return tuple(replace(requirement, share=None, confidence=None) for requirement in requirements), notes
