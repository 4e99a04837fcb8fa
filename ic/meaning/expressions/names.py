"""The values of names in expressions: `let`s in any order, parameters of servo definitions, a sweep's coordinates."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from ic.grammar.syntax import Expression, Name, Setting
from ic.meaning.definitions.csv_files import CsvCell
from ic.meaning.definitions.resolve import Definitions
from ic.meaning.definitions.row_tables import RowTable, is_row_table
from ic.meaning.expressions.evaluate import CONSTANTS, FUNCTIONS, RESERVED, evaluate
from ic.meaning.expressions.quantity import COMPONENTS, Value, ValueList, component, no_single_number
from ic.text.complaints import MOST_DIAGNOSTICS, known_words
from ic.text.lexer import COMMAND_LINE
from met import units
from met.diagnostic import Help, Label, Place, Problem, did_you_mean, error, write
from met.frozen import frozen
from met.messages import other_units
from met.plan import Origin
from met.trace import Real

AXES = {"x": "[1, 0, 0]", "y": "[0, 1, 0]", "z": "[0, 0, 1]"}

DEEPEST = 64  # depth of lets that need lets: far more than in decks, far less than Python's recursion limit


def _if_a_unit(help: str) -> Help:
    return Help(f"if a unit is meant: {help}", *(help.changes if isinstance(help, Help) else ()))


@frozen
class FoundNames:
    """The values found for names: `let`s, cells of tables by the requested paths, and the numbers of such cells by
    identity."""

    worth: Mapping[str, Value | ValueList | Problem]
    cells: Mapping[str, tuple[CsvCell, ...]]
    read: Mapping[int, tuple[float, Label]]

    @property
    def named(self) -> Collection[str]:
        """Names whose values were requested and found, including those in their expressions, and tables of requested
        cells."""
        return self.worth.keys() | {path.partition(".")[0] for path in self.cells}

    @property
    def is_plain(self) -> bool:
        """True where it contains no mistake, and nothing by identity."""
        return not self.cells and not self.read and not any(isinstance(worth, Problem) for worth in self.worth.values())


class Names:
    """Evaluator of expressions in a deck, which finds each name's value once.

    varied paths that a sweep varies, with the value that stands for them watched paths whose use is recorded in
    `followed`, like that of the varied
    """

    def __init__(self, definitions: Definitions, varied: Mapping[str, Value], watched: Collection[str] = ()) -> None:
        self.definitions = definitions
        self.varied = varied
        self.watched = watched
        self.followed: dict[str, None] = {}  # coordinates that an expression named
        self._worth: dict[str, Value | ValueList | Problem] = {}
        self._open: dict[str, Place] = {}
        self.cells: dict[str, tuple[CsvCell, ...]] = {}  # of tables by row name, by the path that asked for them
        self._read: dict[int, tuple[float, Label]] = {}  # the numbers of such cells, by identity

    @property
    def found_names(self) -> FoundNames:
        """The values that were found so far."""
        return FoundNames(self._worth, self.cells, self._read)

    def take_over(self, others: FoundNames) -> None:
        """Take over values that were found elsewhere, and are the same here."""
        for name, worth in others.worth.items():
            self._worth.setdefault(name, worth)
        if others.cells or others.read:
            self.cells = {**others.cells, **self.cells}
            self._read = {**others.read, **self._read}

    def evaluate(self, expression: Expression) -> Value | ValueList:
        return evaluate(expression, self.find)

    def knows(self, text: str) -> bool:
        """Return True if a single word of the deck itself has a value."""
        return text in self.varied or text in self.definitions.lets or text in CONSTANTS

    def is_value(self, name: Name) -> bool:
        """Return True if a name is a single word with a value at its place."""
        name_in_full = self.definitions.in_full(name)
        return self.knows(name_in_full.text) if not name_in_full.roof else name_in_full.text in CONSTANTS

    def find(self, name: Name) -> Value | ValueList:
        """The value of a name. Raises Problem D065 where there is none, D073 where it depends on itself."""
        name = self.definitions.in_full(name)
        if name.roof:
            raise self._unknown_in_used(name)
        table = self.row_table(name.path[0].text, len(name.path))
        if table is not None:
            return self._cells(table, name)
        text = self._reached(name)
        if self.names_a_component(name):
            let = name.path[0]
            return component(name, self.find(Name((let,), let.place)))
        if text in self.varied:
            self.followed[text] = None
            return self.varied[text]
        if text in self.watched:
            self.followed[text] = None
        worth = self._worth.get(text)
        if isinstance(worth, Problem):
            raise worth  # reported once, however often the name is used
        if worth is not None:
            return worth
        if text in self._open:
            loop = [*list(self._open)[list(self._open).index(text) :], text]
            raise Problem(
                error(
                    "D073",
                    f"`{text}` needs itself: " + " needs ".join(f"`{needed}`" for needed in loop),
                    name.place,
                    also=[Label(self._open[needed], f"`{needed}`") for needed in loop[1:-1]],
                    help="write one of them as a number",
                )
            )
        if len(self._open) >= DEEPEST:
            raise Problem(
                error(
                    "D073",
                    f"`{text}` is at the end of a chain of {DEEPEST} names",
                    name.place,
                    help="define values before their uses",
                )
            )
        self._open[text] = name.place
        try:
            value = self.evaluate(self._expression(name))
        except Problem as problem:
            if text in self.definitions.lets:
                self._worth[text] = problem
            raise
        finally:
            self._open.pop(text, None)
        self._worth[text] = value
        return value

    def row_table(self, let: str, words: int = 1) -> RowTable | None:
        """The table of a `let`; None where it is not one, or a servo of its name is meant. words: of the path that
        begins with it. Raises Problem with the errors of its file."""
        written = self.definitions.lets.get(let)
        if written is None or not is_row_table(written.value):
            return None
        if words > 1 and let in self.definitions.of_kind("servo"):
            return None
        return self.definitions.row_table(written.value)

    def _cells(self, table: RowTable, name: Name) -> Value | ValueList:
        """The value of a cell, or the vector of several."""
        cells = table.cells(name)
        self.cells[name.text] = cells
        values = []
        for cell in cells:
            number, measure = table.csv.quantity(cell)
            bare, place = cell.column.unit is None, name.place if len(cells) == 1 else cell.place
            value = Value(number, measure.dimension, place, bare, hertz=measure.hertz)
            self._read[id(number)] = number, Label(cell.place, f"`{name.text}` is read here")
            values.append(value)
        return values[0] if len(values) == 1 else ValueList(tuple(values), name.place)

    def names_a_component(self, name: Name) -> bool:
        """Return True for `v.x` of a `let`: a servo of that name, or a path that a sweep varies, takes precedence."""
        return (
            len(name.path) == 2
            and name.path[1].text in COMPONENTS
            and name.path[0].text in self.definitions.lets
            and name.path[0].text not in self.definitions.of_kind("servo")
            and name.text not in self.varied
        )

    def _reached(self, name: Name) -> str:
        """The path to look up: that of the base that a sweep varies, where a servo definition inherits the value."""
        first, *rest = (word.text for word in name.path)
        servo = self.definitions.of_kind("servo").get(first) if rest else None
        block = self.definitions.block(servo) if servo is not None and name.text not in self.varied else None
        item = block.items.get(".".join(rest)) if block is not None else None
        homes = item.homes if item is not None else ()
        paths = [".".join((home, *rest)) for home in homes]
        return next((path for path in paths if path in self.varied or path in self.watched), name.text)

    def label_of_cell(self, number: Real, place: Place) -> list[Label]:
        """The cell of a table with this number, as a label for messages about it at another place."""
        read = self._read.get(id(number))
        return [read[1]] if read is not None and read[1].place != place else []

    def label(self, value: Value) -> list[Label]:
        """The place that defines the name in this value, as a label for messages about it."""
        cell = self.label_of_cell(value.number, value.place)
        if cell:
            return cell
        for text, let in self.definitions.lets.items():
            worth = self._worth.get(text)
            if (
                isinstance(worth, Value)
                and worth.number is value.number
                and worth.dimension == value.dimension
                and worth.place != value.place
                and value.place.length in (len(text), len(text.rpartition(".")[2]))
            ):
                return [Label(let.given_at, f"`{text}` is {'defined' if let.set_at is None else 'set'} here")]
        return []

    def _expression(self, name: Name) -> Expression:
        """The expression that a name stands for: of a `let`, or of a servo's entry. Raises Problem D065."""
        first, *rest = (word.text for word in name.path)
        if not rest and first in self.definitions.lets:
            return self.definitions.lets[first].value
        servo = self.definitions.of_kind("servo").get(first)
        if servo is not None and rest:
            block = self.definitions.block(servo)
            items = block.items if block is not None else {}
            item = items.get(".".join(rest))
            if item is not None and item.value is not None:
                return item.value
            let = self.definitions.lets.get(first)
            hidden = [f"it hides the components of `let {first}`: give one of the two another name"] if let else []
            raise Problem(
                error(
                    "D065",
                    f"servo `{first}` writes no `{'.'.join(rest)}`",
                    name.place,
                    also=[Label(let.name.place, f"`let {first}`")] if let else [],
                    help=[*hidden, *did_you_mean(".".join(rest), items), known_words("it writes", items)],
                )
            )
        helps = list(did_you_mean(name.text, (*self.definitions.lets, *CONSTANTS)))
        if name.text in FUNCTIONS:
            helps = [f"`{name.text}` is a function: write `{name.text}(...)`"]
        elif not rest and first in units.ALL_UNITS:
            helps = [f"`{first}` is a unit: it follows a number, or closing brackets"]
        elif not helps and rest:
            helps = ["a value names a `let`, or what a servo's definition writes, such as `SERVO.kp`"]
        elif not helps and first in AXES:
            helps = [write(AXES[first], f"where the axis is meant, write `{AXES[first]}`", where="value"),
                     f"else define it: `let {first} = ...;`"]  # fmt: skip
        elif first.lower() in ("nan", "inf", "infinity"):
            helps = ["every number of a deck is finite: leave the entry out where its default is endless, or write one"]
        elif not helps and name.place.file == COMMAND_LINE and not name.place.expansions:
            helps = ["`--set` takes a value as the deck would write it: a number with its unit, or a name of the deck"]
        elif not helps and COMMAND_LINE in (name.place.file, *(macro.use.file for macro in name.place.macros)):
            helps = [
                f"it comes from `-D`: write a number there, as in `-D {name.place.macros[0].macro}=2`, or define "
                f"`let {first} = ...;` in the deck"
            ]
        elif not helps:
            unit = other_units.remedy(first) if len(first) > 1 else ()
            helps = [f"define it: `let {first} = ...;`", *(_if_a_unit(word) for word in unit)]
        raise Problem(error("D065", f"no value `{name.text}`", name.place, help=helps))

    def _unknown_in_used(self, name: Name) -> Problem:
        """The error that a used deck names a value that it does not define."""
        first, *rest = (word.text for word in name.path)
        definitions = self.definitions
        known = definitions.under(name.roof, definitions.lets)
        known += [*CONSTANTS, *(f"{servo}." for servo in definitions.under(name.roof, definitions.of_kind("servo")))]
        helps: list[str] = list(did_you_mean(name.text if rest else first, known))
        if not helps and not rest:
            helps = [f"define it there: `let {first} = ...;`"]
        if first in definitions.lets:
            helps.append(
                f"`{first}` of the deck that uses this one is not known here: `with {name.roof}.NAME = ...;` sets a "
                "value"
            )
        return Problem(error("D065", f"no value `{name.text}`", name.place, help=helps))

    def check_lets(self) -> list[Problem]:
        """Report every mistake in the deck's lets, used or not."""
        problems: list[Problem] = []
        for text, let in self.definitions.lets.items():
            if len(problems) >= MOST_DIAGNOSTICS:  # no more would be reported, and each searches all names
                break
            try:
                own = text.rpartition(".")[2]
                if own in CONSTANTS or own in RESERVED:
                    raise Problem(
                        error(
                            "D079",
                            f"`{own}` has a meaning already",
                            let.name.place,
                            help="give the value another name",
                        )
                    )
                if self.row_table(text) is None:
                    self.find(Name((let.name,), let.name.place))
            except Problem as problem:
                problems.append(problem)
        return problems


ON_COMMAND_LINE = "set on the command line"
"""The note of such an origin."""


@frozen
class CommandLineValue:
    """A number that `--set`, or a run, puts in place of a deck's: its value, and the expression as written.

    overrides  places of what it replaced of its kind, latest first
    """

    path: str
    value: Value
    expression: Expression
    overrides: tuple[Place, ...] = ()

    def overriding(self, origin: Origin) -> Origin:
        """The origin of a value that this one overrides, made its own."""
        places = (origin.place,) if origin.place is not None else ()
        return written_origin(self.value.place, (*self.overrides, *places, *origin.overrides))


def is_on_command_line(place: Place | None) -> bool:
    """Return True if a place is on the command line, but not in the body of a macro of -D."""
    return place is not None and place.file == COMMAND_LINE and not place.expansions


def written_origin(place: Place, overrides: tuple[Place, ...], note: str = "") -> Origin:
    """The origin of a value that is written at a place, in the deck or outside of it."""
    return Origin("deck", place, overrides, ON_COMMAND_LINE if is_on_command_line(place) else note)


def evaluate_setting(entry: Setting, path: str, names: Names) -> CommandLineValue:
    """The number that an entry sets. Raises Problem where it is not a number."""
    value = names.evaluate(entry.value)
    if not isinstance(value, Value):
        raise no_single_number(f"`{path}`", value)
    return CommandLineValue(path, value, entry.value, entry.overrides)
