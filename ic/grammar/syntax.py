"""The syntax tree of a deck: what was written, in the order written, each node with its place.

The tree knows the language's shape and none of its words: a `link` or a `vary` is an entry like any other, and
what may stand where is decided when the tree is resolved. So a joint may be called `at` or `sample`.

    let reach = 2.0 m;                                      Let
    servo gearbox like rigid_gearbox { ... }                Group, words ("servo", "gearbox"), like ("rigid_gearbox",)
    default run nominal { ... }                             Group, words ("default", "run", "nominal")
    sweep gains of nominal { ... }                          Group, words ("sweep", "gains"), of ("nominal",)
    arm panda from urdf("panda.urdf") { ... }               Group, words ("arm", "panda"), made_from a Call
    joint elbow revolute { ... }                            Group, words ("joint", "elbow", "revolute")
    shoulder = gearbox;      record += [q];                 Setting, words (), path, operator, value
    metric settle = settling_time { ... };                  Setting, words ("metric",), path ("settle",)
    vary gearbox.kp = linspace(0.01, 0.04, 7) V*s/rad;      Setting, words ("vary",), path ("gearbox", "kp")
    vary macro PAYLOAD = [0, 5];                            Setting, words ("vary", "macro"), path ("PAYLOAD",)
    sweep both = gains + spread;                            Setting, words ("sweep",), path ("both",)
    sample lhs(200) { ... }                                 Statement, words ("sample",), value a Call with a body
    require settle < 10 s;                                  Statement, words ("require",), value
    require settle < 10 s in 99 % of cases;                 Statement, words ("require",), value an OverCases
    require quick: settle < 10 s;                           Statement, words ("require",), name "quick", value
    exclude when kp > 3 V*s/rad and m > 5 kg;               Statement, words ("exclude", "when"), value
    remove settle;                                          Statement, words ("remove",), value a Name
    use <panda.ic> as panda;                                UseEntry, which no tree of a whole deck has
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import field, replace
from types import MappingProxyType

from ic.text.edition import FIRST
from ic.text.files import Unsaved
from ic.text.source import SourceFile, UnreadableStretch
from met.diagnostic import Diagnostic, Place
from met.frozen import frozen
from met.units import Measure


@frozen
class Word:
    """An identifier and its place."""

    text: str
    place: Place


@frozen
class Unit:
    """A unit as written: factors (name, exponent) in order. `%` is a unit of 0.01.

    declared  those of its names that the deck declares, each with its measure
    """

    factors: tuple[tuple[Word, int], ...]
    place: Place
    text: str
    declared: tuple[tuple[str, Measure], ...] = ()


@frozen
class Number:
    """A number with the unit that follows it, None where it is bare."""

    value: float
    unit: Unit | None
    place: Place
    text: str


@frozen
class String:
    """A text in quotes: its characters, without the quotes and with escapes replaced."""

    value: str
    place: Place


@frozen
class Name:
    """A reference: `slow`, `gearbox.kp`, `shoulder.servo.voltage`, `on`; `*.servo.voltage`, of every joint.

    roof  of a name that a used deck writes, the roof under which its own names are (`ic.grammar.uses`)
    """

    path: tuple[Word, ...]
    place: Place
    roof: str = ""

    @property
    def text(self) -> str:
        return ".".join(word.text for word in self.path)


@frozen
class Indexed:
    """The element `lengths[i]` of a list, the first of which is `lengths[0]`."""

    name: Name
    index: Expression
    place: Place


@frozen
class List:
    """Values in square brackets, `[1, 2 m]`."""

    items: tuple[Expression, ...]
    place: Place


@frozen
class Call:
    """`rod(length = reach, along = x)`, `linspace(0, 1, 5)`, `settling_time { of = q; }` (then `body` is not None)."""

    name: Name
    positional: tuple[Expression, ...]
    named: tuple[tuple[Word, Expression], ...]
    body: tuple[Entry, ...] | None
    place: Place


@frozen
class WithUnit:
    """`[...] unit` or `(...) unit` or `linspace(...) unit`: the unit applies to all bare numbers inside."""

    inner: Expression
    unit: Unit
    place: Place


@frozen
class Range:
    """`first .. last by step`: both ends included where the steps meet the last."""

    first: Expression
    last: Expression
    step: Expression
    place: Place  # of the `..`


@frozen
class Unary:
    """An operator before its one operand: `-x`, `not c`."""

    operator: str  # "-" "+" "not"
    operand: Expression
    place: Place


@frozen
class Binary:
    """operator: + - * / ^ < <= > >= == != and or"""

    operator: str
    left: Expression
    right: Expression
    place: Place  # of the operator


@frozen
class OverCases:
    """`COMPARISON in 99 % of cases with 90 % confidence`; share and confidence are None where they are not written."""

    comparison: Expression
    share: Expression | None
    confidence: Expression | None
    place: Place  # of the words after the comparison


@frozen
class Broken:
    """An expression that could not be read (already reported)."""

    place: Place


Expression = Number | String | Name | Indexed | List | Call | WithUnit | Range | Unary | Binary | OverCases | Broken


def children(expression: Expression) -> tuple[Expression, ...]:
    """The direct subexpressions, as written; a call's body is left out."""
    match expression:
        case List(items=items):
            return items
        case Indexed(name=name, index=index):
            return (name, index)
        case WithUnit(inner=inner):
            return (inner,)
        case Range(first=first, last=last, step=step):
            return (first, last, step)
        case Unary(operand=operand):
            return (operand,)
        case Binary(left=left, right=right):
            return (left, right)
        case OverCases(comparison=comparison, share=share, confidence=confidence):
            return (comparison, *(part for part in (share, confidence) if part is not None))
        case Call(positional=positional, named=named):
            return (*positional, *(value for _, value in named))
    return ()


def parts_of(expression: Expression) -> Iterator[Expression]:
    """The expression and its subexpressions (`children`) of every depth, in the order in which they are written."""
    waiting = [expression]
    while waiting:
        part = waiting.pop()
        yield part
        waiting.extend(reversed(children(part)))


def names_in(expression: Expression) -> list[Name]:
    """The names that an expression uses, in the order in which they are written."""
    return [part for part in parts_of(expression) if isinstance(part, Name)]


def mapped(expression: Expression, change: Callable[[Expression], Expression]) -> Expression:
    """The expression with its direct subexpressions (`children`) changed."""
    match expression:
        case List(items=items):
            return replace(expression, items=tuple(map(change, items)))
        case Indexed(index=index):
            return replace(expression, index=change(index))
        case WithUnit(inner=inner):
            return replace(expression, inner=change(inner))
        case Range(first=first, last=last, step=step):
            return replace(expression, first=change(first), last=change(last), step=change(step))
        case Unary(operand=operand):
            return replace(expression, operand=change(operand))
        case Binary(left=left, right=right):
            return replace(expression, left=change(left), right=change(right))
        case OverCases(comparison=comparison, share=share, confidence=confidence):
            share, confidence = (change(part) if part is not None else None for part in (share, confidence))
            return replace(expression, comparison=change(comparison), share=share, confidence=confidence)
        case Call(positional=positional, named=named):
            arguments = tuple((word, change(value)) for word, value in named)
            return replace(expression, positional=tuple(map(change, positional)), named=arguments)
    return expression


@frozen
class Let:
    """`let NAME = VALUE;`, or `param NAME = VALUE;`.

    is_param   whether it is a `param`, which an including deck and a run may set
    overrides  where the values are given that its value replaced, latest first;  set_at: where its own is, if not here
    default    of a `param` that an including deck has set: the value that its own file writes
    """

    name: Word
    value: Expression
    place: Place
    is_param: bool = False
    overrides: tuple[Place, ...] = ()
    default: Expression | None = None
    set_at: Place | None = None

    @property
    def given_at(self) -> Place:
        """The place that gives its value."""
        return self.name.place if self.set_at is None else self.set_at


@frozen
class Setting:
    """`words path = value;`.

    overrides  places of what it replaced of its kind, latest first: of `with`, in a run that is like another
    """

    words: tuple[Word, ...]
    path: tuple[Word, ...]
    operator: str  # "=" or "+="
    value: Expression
    place: Place  # of the words and the path
    overrides: tuple[Place, ...] = ()


@frozen
class Statement:
    """`words value;`, or of a requirement with a name `words name: value;`."""

    words: tuple[Word, ...]
    value: Expression
    place: Place
    name: Word | None = None


@frozen
class Group:
    """`words { body }`, or with `like`/`of`/`from` a base. At the top level a definition, inside one a block."""

    words: tuple[Word, ...]
    like: Name | None
    of: Name | None
    body: tuple[Entry, ...]
    place: Place  # of the words
    made_from: Call | None = None


Entry = Let | Setting | Statement | Group


@frozen
class UseEntry:
    """`use <panda.ic> as panda;`: the file as it is asked for, whether in < >, and the name of the roof.

    file_place  the place of the file's name
    source  the file that the entry stands in, by the name that messages print
    """

    file: str
    angled: bool
    roof: Word
    file_place: Place
    source: str


@frozen
class Roof:
    """A roof of a deck: the entry that made it, and the kinds of the used deck's runs and sweeps, which are left
    out."""

    use: UseEntry
    left: Mapping[str, str] = field(default_factory=dict)


Roofs = Mapping[str, Roof]
"""Roofs by their full names: `panda`, or `cell.panda` for a deck that a used one uses."""


NO_ROOFS: Roofs = MappingProxyType({})


@frozen
class Deck:
    """A whole deck after the preprocessor: its entries in order, the files they came from, and warnings so far.

    include_dirs: further directories in which files that the deck names are searched. path, text, defines: its source,
    to read it again; text: None where it was in a file. unsaved: texts that count in place of files. unreadable:
    stretches that could not be read; if there are some, `warnings` holds errors too. units: those that the deck
    declares, which files of its editions may use. roofs: those under which definitions of decks that it uses are among
    the entries, with full names.
    """

    file: str
    entries: tuple[Entry, ...]
    sources: tuple[SourceFile, ...]
    warnings: tuple[Diagnostic, ...] = ()
    include_dirs: tuple[str, ...] = ()
    path: str = ""
    defines: tuple[str, ...] = ()
    unreadable: tuple[UnreadableStretch, ...] = ()
    text: str | None = None
    unsaved: Unsaved = field(default_factory=dict, compare=False, repr=False)
    units: Mapping[str, Measure] = field(default_factory=dict)
    roofs: Roofs = field(default_factory=dict)

    @property
    def edition(self) -> int:
        """The edition of the deck's own file."""
        return self.sources[0].edition if self.sources else FIRST


def place_of(expression: Expression) -> Place:
    """The stretch of an expression, as far as it is on one line."""
    match expression:
        case Number(unit=unit) if unit is not None:
            return spanned(expression.place, unit.place)
        case Unary():
            return spanned(expression.place, place_of(expression.operand))
        case Binary():
            left = expression.left
            while isinstance(left, Binary):
                left = left.left
            return spanned(place_of(left), place_of(expression.right))
        case WithUnit():
            return spanned(place_of(expression.inner), expression.unit.place)
        case OverCases():
            return spanned(place_of(expression.comparison), expression.place)
        case Range():
            return spanned(place_of(expression.first), place_of(expression.step))
    return expression.place


def spanned(first: Place, last: Place) -> Place:
    """The place from the first to the end of the last if both are on one line and came there by one way."""
    if (first.file, first.line, first.expansions) != (last.file, last.line, last.expansions):
        return first
    end = last.column + last.length
    return replace(first, length=end - first.column) if end > first.column else first


# As text again, for messages and for a plan's quotes of its deck

_BINDING = {
    "or": 1, "and": 2, "<": 3, "<=": 3, ">": 3, ">=": 3, "==": 3, "!=": 3, "+": 4, "-": 4, "*": 5, "/": 5, "^": 7,
}  # fmt: skip
"""The strength with which operators bind in a deck's text: those of a larger number bind first."""


def spell(expression: Expression, within: int = 0) -> str:
    """The expression in a deck's syntax. within: the binding strength of the surrounding operator"""
    match expression:
        case Number():
            if expression.unit is None:
                return expression.text
            gap = "" if expression.text.endswith(expression.unit.text) else f" {expression.unit.text}"
            return expression.text + gap
        case String():
            return f'"{expression.value}"'
        case Name():
            return expression.text
        case Indexed():
            return f"{expression.name.text}[{spell(expression.index)}]"
        case List():
            return "[" + ", ".join(spell(item) for item in expression.items) + "]"
        case WithUnit():
            inner = spell(expression.inner)
            closed = isinstance(expression.inner, (List, Call))
            return f"{inner if closed else f'({inner})'} {expression.unit.text}"
        case Call():
            named = (f"{word.text} = {spell(value)}" for word, value in expression.named)
            inside = ", ".join([*(spell(value) for value in expression.positional), *named])
            head = expression.name.text + (f"({inside})" if inside or expression.body is None else "")
            return head if expression.body is None else f"{head} {_spelled_body(expression.body)}"
        case OverCases():
            share = f" in {spell(expression.share)} of cases" if expression.share is not None else ""
            confidence = f" with {spell(expression.confidence)} confidence" if expression.confidence is not None else ""
            return f"{spell(expression.comparison)}{share}{confidence}"
        case Broken():
            return "..."
        case Range():
            return f"{spell(expression.first)} .. {spell(expression.last)} by {spell(expression.step)}"
        case Unary():
            gap = " " if expression.operator == "not" else ""
            return f"{expression.operator}{gap}{spell(expression.operand, 6)}"
        case Binary():
            binds = _BINDING[expression.operator]
            text = f"{spell(expression.left, binds)} {expression.operator} {spell(expression.right, binds + 1)}"
            return f"({text})" if binds < within else text
    raise AssertionError(expression)


def _spelled_body(entries: tuple[Entry, ...]) -> str:
    """A block's entries with its braces, in one line."""
    return " ".join(["{", *map(_spelled_entry, entries), "}"])


def _spelled_entry(entry: Entry) -> str:
    """An entry as the text of a deck."""
    if isinstance(entry, Setting):
        name = ".".join(word.text for word in entry.path)
        return " ".join([*(word.text for word in entry.words), name, entry.operator, f"{spell(entry.value)};"])
    if isinstance(entry, Group):
        return " ".join([*(word.text for word in entry.words), _spelled_body(entry.body)])
    if isinstance(entry, Let):
        return f"{'param' if entry.is_param else 'let'} {entry.name.text} = {spell(entry.value)};"
    named = [f"{entry.name.text}:"] if entry.name is not None else []
    return " ".join([*(word.text for word in entry.words), *named, f"{spell(entry.value)};"])
