"""Reading of a sweep's block: its varied paths and values, in the order written.

Every `vary`, `zip`, `from` and `sample` is an axis. The cases are the product of the axes, in the order written: the
first is the outermost and the last varies fastest, as digits of a number do; `repeat` is the innermost of all.
`exclude when` then drops rows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from ic.grammar.settings import path_of
from ic.grammar.syntax import Call, Expression, Group, Name, Setting, Statement, String, Unit, Word, place_of
from ic.language.runs import SWEEP
from ic.meaning.definitions.resolve import Definition, Definitions
from ic.meaning.expressions.conditions import VariedPath
from ic.meaning.expressions.evaluate import evaluate_number
from ic.meaning.expressions.names import Names
from ic.meaning.expressions.quantity import Value, as_whole, in_words, measure_of, unit_of_plan
from ic.meaning.runs.allowances import ALLOW
from ic.sweeps.choices import (
    MACRO,
    ChoiceColumn,
    check_constant,
    choice_column,
    decides_structure,
    path_place,
    refuse_words,
)
from ic.sweeps.designs import DESIGNS, UNTIL_SHOWN, read_sample
from ic.text.complaints import Complaints, known_words, where_it_belongs
from met import units
from met.diagnostic import Label, Place, Problem, did_you_mean, error, write
from met.frozen import frozen
from met.plan import Design
from met.plan.columns import MOST_SWEPT, CaseValues
from met.plan.searches import Search
from met.trace import Graph

MOST_COUNTED = 16  # axes that are read of a sweep that has too many cases
KNOWN = tuple(entry.name for entry in SWEEP.entries)

Column = VariedPath | ChoiceColumn


@frozen
class SweepAxis:
    """Columns of one length that vary together. note: how they were made, for `met cases`; design: of the sample that
    drew them, "" where they were written; until_shown: place where it is written that cases are run only until the
    requirements are decided."""

    columns: tuple[Column, ...]
    note: str = ""
    design: Design = ""
    until_shown: Place | None = None

    @property
    def size(self) -> int:
        return len(self.columns[0])


@frozen
class Sweep:
    """A sweep's block as read.

    repeat       how often each case is run; repeated: where that is written, if it is
    independent  where `seeds = independent` is written, if it is
    search       what its cases are the first generation of, where they are that;  borne: paths of a sweep that a tuning
                 is held against, each with the design of the sample that drew it
    """

    name: str
    axes: tuple[SweepAxis, ...]
    excludes: tuple[Statement, ...]
    seed: int | None
    independent: Place | None
    repeat: int
    repeated: Place | None
    place: Place
    search: Search | None = None
    borne: tuple[tuple[str, Design], ...] = ()

    @property
    def varied(self) -> tuple[VariedPath, ...]:
        return tuple(column for axis in self.axes for column in axis.columns if isinstance(column, VariedPath))

    @property
    def chosen(self) -> tuple[ChoiceColumn, ...]:
        return tuple(column for axis in self.axes for column in axis.columns if isinstance(column, ChoiceColumn))

    @property
    def designs(self) -> dict[str, Design]:
        """The design of the sample that drew each path, for drawn ones."""
        drawn = {column.path: axis.design for axis in self.axes if axis.design for column in axis.columns}
        return drawn | dict(self.borne)

    @property
    def early_axis(self) -> SweepAxis | None:
        """The axis whose cases are run only until the requirements are decided, if there is one."""
        return next((axis for axis in self.axes if axis.until_shown is not None), None)

    @property
    def sizes(self) -> tuple[int, ...]:
        """The number of values of each axis, then the number of repeats."""
        return (*(axis.size for axis in self.axes), self.repeat)


def read_sweep(
    definitions: Definitions,
    complaints: Complaints,
    definition: Definition,
    graph: Graph,
    *,
    seed: int = 0,
    own_seed: bool = True,
) -> Sweep:
    """The sweep's axes with their values; reports mistakes in them.

    seed  the run's, for what is drawn;  own_seed: False where it stands in place of one that the sweep writes
    """
    reader = _SweepReader(definitions, complaints, definition, graph, seed)
    if not own_seed:
        reader.seed = None
    for entry in definition.group.body:
        with complaints.gather():
            reader.enter(entry)
        if len(reader.axes) >= MOST_COUNTED and _product(reader) > MOST_SWEPT:
            break
    sweep = Sweep(
        definition.name,
        tuple(reader.axes),
        tuple(reader.excludes),
        reader.seed,
        reader.independent,
        reader.repeat,
        reader.repeated,
        definition.place,
    )
    early = sweep.early_axis
    if early is not None and early is not sweep.axes[-1] and sweep.axes[-1].until_shown is None:
        complaints.error(
            "D358",
            f"cases of a design point are run in order until something is shown, so `{UNTIL_SHOWN}` stands last",
            early.until_shown,
            also=[Label(sweep.axes[-1].columns[0].place, "varies faster")],
            help="write this sample behind what is varied: then the cases of a design point stand together",
        )
    if not sweep.axes and sweep.repeated is None and not complaints.errors:
        complaints.error(
            "D126",
            f"sweep `{definition.name}` varies nothing",
            definition.place,
            help="write `vary PATH = [...] UNIT;`",
        )
    if math.prod(sweep.sizes) > MOST_SWEPT:
        sizes = [str(size) for size in sweep.sizes[: None if sweep.repeated else -1]]
        more = "more than " if len(sweep.axes) >= MOST_COUNTED else ""
        complaints.error(
            "D134",
            f"sweep `{definition.name}` has {more}{math.prod(sweep.sizes):,} cases",
            definition.place,
            help=f"{MOST_SWEPT:,} are possible: {' x '.join(sizes)} is more",
        )
    return sweep


def _product(reader: _SweepReader) -> int:
    """The number of cases so far."""
    return math.prod((*(axis.size for axis in reader.axes), reader.repeat))


class _SweepReader:
    """Reader of a sweep's block, entry after entry."""

    def __init__(
        self, definitions: Definitions, complaints: Complaints, definition: Definition, graph: Graph, seed: int
    ) -> None:
        self.definitions, self.complaints, self.graph, self.drawn = definitions, complaints, graph, 0
        self.axes: list[SweepAxis] = []
        self.excludes: list[Statement] = []
        self.seed: int | None = None
        self.independent: Place | None = None
        self.repeat = 1
        self.repeated: Place | None = None
        self.written: dict[str, Place] = {}
        self.places: dict[str, list[Place]] = {}  # of the numbers of a path
        self.base = definition.run_name or "RUN"
        self.paths = {path: place for entry in definition.group.body for path, place in _paths(definitions, entry)}
        self.run_seed = seed
        for entry in definition.group.body:  # first of all: draws need it, wherever it stands
            if isinstance(entry, Setting) and _is(entry, "seed"):
                with complaints.gather():
                    self.seed = whole_number(definitions, entry.value, "a seed", least=0)

    def enter(self, entry: object) -> None:
        """Read one entry of a sweep. Raises Problem for one that a sweep does not have."""
        words = [word.text for word in getattr(entry, "words", ())]
        match entry:
            case Setting() if words in (["vary"], ["vary", "macro"]):
                column = self.column(entry, entry.words[1:])
                check_no_equal_cases([column], self.places.get(column.path, ()))
                self.axes.append(SweepAxis((column,)))
            case Group() if words == ["zip"]:
                self.zip(entry)
            case Statement() if words == ["from"]:
                self.file(entry)
            case Statement() if words == ["sample"]:
                self.sample(entry)
            case Statement() if words == ["repeat"]:
                self.repeats(entry)
            case Statement() if words == ["exclude", "when"]:
                self.excludes.append(entry)
            case Setting() if _is(entry, "seed"):
                pass
            case Statement() if words[0] == ALLOW:
                pass  # read with those of the run
            case Setting() if _is(entry, "seeds"):
                word = entry.value.text if isinstance(entry.value, Name) else ""
                if word not in ("common", "independent"):
                    raise Problem(
                        error(
                            "D221",
                            "`seeds` is `common` or `independent`",
                            place_of(entry.value),
                            help=[
                                "common: cases that differ in what is varied feel the same noise",
                                "independent: each case has noise of its own",
                            ],
                        )
                    )
                self.independent = entry.place if word == "independent" else None
            case _:
                _refuse(entry, words, self.base)

    # Axes

    def zip(self, group: Group) -> None:
        """Read a `zip`, whose columns vary together as one axis. Raises Problem D126, D136."""
        columns: list[Column] = []
        before = self.complaints.error_count
        for entry in group.body:
            with self.complaints.gather():
                words = [word.text for word in entry.words] if isinstance(entry, Setting) else None
                if words is None or words not in ([], ["vary"], ["macro"], ["vary", "macro"]):
                    raise Problem(
                        error(
                            "D136",
                            "a zip holds `PATH = [...];` and nothing else",
                            entry.place,
                            help="all else stands in the sweep, beside the zip",
                        )
                    )
                assert isinstance(entry, Setting)
                columns.append(self.column(entry, entry.words[-1:] if "macro" in words else ()))
        if not group.body:
            raise Problem(error("D126", "this zip is empty", group.place, help="write `PATH = [...];` in it"))
        for other in columns[1:]:
            if len(other) != len(columns[0]):
                raise Problem(
                    error(
                        "D135",
                        f"`{columns[0].path}` has {len(columns[0])} values and `{other.path}` has {len(other)}",
                        other.place,
                        also=[Label(columns[0].place, f"{len(columns[0])} values")],
                        help="what is zipped goes in step: as many values each",
                    )
                )
        if columns and self.complaints.error_count == before:
            check_no_equal_cases(columns, self.places.get(columns[0].path, ()))
            self.axes.append(SweepAxis(tuple(columns)))

    def file(self, statement: Statement) -> None:
        """Read `from "cases.csv";`: a row of the file is a case, or a value of the axis; its columns are paths."""
        if not isinstance(statement.value, String):
            raise Problem(
                error(
                    "D222",
                    "`from` takes the name of a CSV file",
                    place_of(statement.value),
                    help='write `from "cases.csv";`: its first line names paths, with units',
                )
            )
        from ic.sweeps.files import columns_of

        columns, rows = columns_of(self.definitions, statement.value, self.graph)
        for column in columns:
            self.note(column.path, column.place)
        check_no_equal_cases(columns, rows)
        self.axes.append(SweepAxis(tuple(columns)))

    def sample(self, statement: Statement) -> None:
        """Read a `sample`, whose drawn columns are one axis; the same seed draws the same numbers."""
        sample = read_sample(
            self.definitions, self.complaints, statement, self.paths, self.run_seed if self.seed is None else self.seed
        )
        for part in sample.parts:
            self.note(part.path, part.place)
        self.drawn += 1
        drawn = sample.draw(self.drawn)
        columns: list[Column] = []
        for part, numbers in zip(sample.parts, drawn, strict=True):
            column = varied_path(self.graph, part.path, part.place, numbers, part.low, part.unit)
            columns.append(replace(column, drawn=part.distribution))
        if sample.warning is not None:
            message, place, helps = sample.warning
            self.complaints.remark("D228", message, place, help=helps)
        self.axes.append(SweepAxis(tuple(columns), sample.note, sample.design, sample.until_shown))

    def repeats(self, statement: Statement) -> None:
        """Read the number of repeats of each case. Raises Problem D040 for a second one."""
        if self.repeated is not None:
            raise Problem(
                error(
                    "D040",
                    "`repeat` is written twice",
                    statement.place,
                    also=[Label(self.repeated, "first")],
                    help="leave one out",
                )
            )
        self.repeat = whole_number(self.definitions, statement.value, "a number of repeats", least=2)
        self.repeated = statement.place

    # One column

    def note(self, path: str, place: Place) -> None:
        """Note a path as varied by the sweep. Raises Problem D040 where it is already."""
        if path in self.written:
            raise Problem(
                error(
                    "D040",
                    f"`{path}` is varied twice",
                    place,
                    also=[Label(self.written[path], "first")],
                    help="leave one out",
                )
            )
        self.written[path] = place

    def column(self, entry: Setting, detail: Sequence[Word] = ()) -> Column:
        """The column of an entry `PATH = VALUES` of a sweep: what it varies, and the values. detail: `macro` where it
        is written. Raises Problem."""
        path, place = f"{MACRO} {path_of(entry)}" if detail else path_of(entry), path_place(entry)
        self.note(path, place)
        if entry.operator == "+=":
            raise Problem(error("D056", "nothing to append to in a sweep", place, help="write `=`"))
        names = Names(self.definitions, {}, watched=set(self.paths))
        if detail or decides_structure(self.definitions, path, entry.value, names):
            return choice_column(path, entry, names)
        refuse_words(path, place, entry.value, names)
        return self.numbers(path, entry, names)

    def numbers(self, path: str, entry: Setting, names: Names) -> VariedPath:
        """The column of a path that varies over a list of numbers. Raises Problem D126."""
        listed = names.evaluate(entry.value)
        check_constant(path, entry, names, self.paths)
        if isinstance(listed, Value):
            raise Problem(
                error(
                    "D126",
                    f"`{path}` varies over a list of values, and this is one value",
                    listed.place,
                    help=[
                        "write `[a, b, c] UNIT`, `(a .. b by c) UNIT` or `linspace(from, to, count) UNIT`",
                        "one value that stands still belongs in the run",
                    ],
                )
            )
        values = [value for value in listed.items if isinstance(value, Value)]
        if len(values) != len(listed.items):
            raise Problem(
                error(
                    "D126",
                    "a list inside a list",
                    listed.place,
                    help=f"a vector varies by its parts: `vary {path}.x = [...];`",
                )
            )
        if not values:
            raise Problem(error("D126", f"`{path}` has no values", listed.place, help="one at least"))
        first = values[0]
        for value in values[1:]:
            if not units.same(value.dimension, first.dimension):
                raise Problem(
                    error(
                        "D063",
                        f"{in_words(value)} in a list that begins with {in_words(first)}",
                        value.place,
                        also=[Label(first.place, in_words(first))],
                        help="all must be of one dimension",
                    )
                )
        unit = listed.unit or first.unit
        bare = all(value.bare for value in values)
        self.places[path] = [value.place for value in values]
        return varied_path(
            self.graph,
            path,
            path_place(entry),
            np.array([value.number for value in values], dtype=float),
            Value(0.0, first.dimension, first.place, bare, unit, hertz=first.hertz),
            unit,
        )


def varied_path(
    graph: Graph, path: str, place: Place, numbers: CaseValues, like: Value, unit: Unit | None
) -> VariedPath:
    """A column of numbers in SI. like: a value of its dimension; unit: the one that the deck wrote"""
    unit, scale = unit_of_plan(unit), 1.0
    if unit is not None and measure_of(unit).dimension == like.dimension:
        scale = measure_of(unit).scale
    value = Value(graph.input(path), like.dimension, like.place, like.bare, unit, hertz=like.hertz)
    return VariedPath(path, place, numbers, value, unit, scale)


def _is(entry: Setting, name: str) -> bool:
    return not entry.words and len(entry.path) == 1 and entry.path[0].text == name


def whole_number(definitions: Definitions, expression: Expression, what: str, *, least: int) -> int:
    """A whole number that no sweep varies. Raises Problem D113."""
    value = evaluate_number(expression, Names(definitions, {}).find)
    return as_whole(value, what, least, 2**53, "2^53" if least == 0 else f"{MOST_SWEPT}")


def _paths(definitions: Definitions, entry: object) -> list[tuple[str, Place]]:
    """Paths that an entry of the sweep varies, with their places."""
    if isinstance(entry, Setting):
        return [(path_of(entry), path_place(entry))]
    if isinstance(entry, Group):
        return [path for inner in entry.body for path in _paths(definitions, inner)]
    if isinstance(entry, Statement) and isinstance(entry.value, Call) and entry.value.body is not None:
        return [path for inner in entry.value.body for path in _paths(definitions, inner)]
    if isinstance(entry, Statement) and isinstance(entry.value, String) and entry.words[0].text == "from":
        with suppress(Problem):  # reported where the file's columns are read
            return [(column.name, column.place) for column in definitions.csv_files.get(entry.value).columns]
    return []


def varied_paths(definitions: Definitions, definition: Definition) -> set[str]:
    """Everything that a sweep's block varies."""
    return {path for entry in definition.group.body for path, _ in _paths(definitions, entry)}


def _refuse(entry: object, words: list[str], base: str) -> None:
    """Report that an entry is not allowed in a sweep."""
    place = entry.place  # type: ignore[attr-defined]  # every entry has one
    if isinstance(entry, Setting) and not words and len(entry.path) == 1 and entry.path[0].text in ("repeat", "sample"):
        usage = {"repeat": "repeat 5;", "sample": "sample lhs(200) { PATH = uniform(a, b) UNIT; }"}
        raise Problem(
            error(
                "D136", f"`{entry.path[0].text} = ...` in a sweep", place, help=f"write `{usage[entry.path[0].text]}`"
            )
        )
    if isinstance(entry, Setting) and not words:
        path = path_of(entry)
        vary = [] if entry.path[0].text == "tolerances" else [f"`vary {path} = [...];` to vary it"]
        where = f"set it in a run `like {base}`, and sweep that"
        if entry.path[0].text == "links":
            where = f"write it in an arm `like` the run's, and sweep a run `like {base}` that takes that arm"
        raise Problem(
            error("D136", f"`{path} = ...` in a sweep", place, help=[*vary, f"{'or ' if vary else ''}{where}"])
        )
    if words[:1] == ["sample"]:
        raise Problem(
            error(
                "D136",
                "a sample names its design and how many",
                place,
                help=f"write `sample lhs(200) {{ ... }}`; {known_words('designs', DESIGNS)}",
            )
        )
    if words[:3] == ["exclude", "when", "macro"]:
        raise Problem(
            error(
                "D136",
                "a condition names a macro by its name alone",
                place,
                help=write("", "leave out the word `macro`: the macro's value is put in as text", old="macro "),
            )
        )
    if words[:1] == ["require"]:
        raise Problem(
            error(
                "D136",
                "`require` in a sweep",
                place,
                help=f"it belongs to the run: write a run `like {base}` with it, and sweep that",
            )
        )
    if words[:1] == ["tolerances"]:
        raise Problem(
            error(
                "D136",
                "`tolerances` in a sweep",
                place,
                help=f"they belong to the run: write a run `like {base}` with them, and sweep that",
            )
        )
    raise Problem(
        error(
            "D136",
            f"no `{' '.join(words)}` in a sweep",
            place,
            help=[
                *did_you_mean(" ".join(words), KNOWN),
                *where_it_belongs(words[0] if words else ""),
                known_words("a sweep has", KNOWN),
            ],
        )
    )


def compared_values(column: Column) -> list[float] | list[str]:
    """The values of a column as cases are told apart by them: numbers in SI, or the texts of its options."""
    return column.values.tolist() if isinstance(column, VariedPath) else [option.text for option in column.options]


def check_no_equal_cases(columns: Sequence[Column], places: Sequence[Place]) -> None:
    """Report equal rows: equal values are equal cases. places: of the rows, or of the first column's numbers."""
    seen: dict[tuple[float | str, ...], int] = {}
    for n, row in enumerate(zip(*map(compared_values, columns), strict=True)):
        if row in seen:
            if isinstance(columns[0], ChoiceColumn) and not places:
                places = [option.place for option in columns[0].options]
            first, again = places[seen[row]], places[n]
            raise Problem(
                error(
                    "D133",
                    f"values number {seen[row] + 1} and {n + 1} are the same",
                    again,
                    also=[Label(first, "first")] if first != again else [],
                    help="leave one out: each case stands in the table once",
                )
            )
        seen[row] = n
