"""Sweeps: what varies, in which order the cases stand, and which are left out.

Every `vary` and every `zip` is an axis. The cases are the product of the axes, in the order written: the first is the
outermost and the last varies fastest, as digits of a number do. `exclude when` then drops rows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from ic.grammar.syntax import Binary, Expression, Group, List, Name, Setting, Statement, String, Unary
from ic.meaning.checks import Varied
from ic.meaning.complaints import Complaints, belongs, known_words
from ic.meaning.names import Names
from ic.meaning.resolve import Definition, Definitions
from ic.meaning.scope import Scope
from ic.meaning.values import COMPARISONS, PURE, Value, Values, evaluate_number, measure_of, place_of
from met import units
from met.diagnostic import Label, Place, Problem, did_you_mean, error
from met.frozen import frozen
from met.plan import Coordinate
from met.trace import Formulas, Graph, Scalar

MOST_CASES = 10_000_000
MOST_NAMED = 4
ROUNDING = 1e-12  # relative: some thousand roundings, and far below what anyone means to tell apart
LATER = ("sample", "repeat", "seeds", "design")


@frozen
class Sweep:
    """What a sweep's block says. Each axis is one varied parameter, or several that go together."""

    axes: tuple[tuple[Varied, ...], ...]
    excludes: tuple[Statement, ...]
    seed: Setting | None
    place: Place

    @property
    def varied(self) -> tuple[Varied, ...]:
        return tuple(varied for axis in self.axes for varied in axis)

    @property
    def sizes(self) -> tuple[int, ...]:
        return tuple(len(axis[0].values) for axis in self.axes)


def read_sweep(definitions: Definitions, complaints: Complaints, definition: Definition, graph: Graph) -> Sweep:
    """The sweep's axes with their values; tells what is wrong with them."""
    axes: list[tuple[Varied, ...]] = []
    excludes: list[Statement] = []
    seed = None
    written: dict[str, Place] = {}
    paths = {path for entry in definition.group.body for path in _paths(entry)}
    for entry in definition.group.body:
        with complaints.gather():
            words = [word.text for word in getattr(entry, "words", ())]
            if isinstance(entry, Setting) and words == ["vary"]:
                axes.append((_varied(definitions, entry, written, paths, graph),))
            elif isinstance(entry, Group) and words == ["zip"]:
                axis = _zip(definitions, complaints, entry, written, paths, graph)
                if axis:
                    axes.append(axis)
            elif isinstance(entry, Statement) and words == ["exclude", "when"]:
                excludes.append(entry)
            elif isinstance(entry, Setting) and not words and entry.path[0].text == "seed" and len(entry.path) == 1:
                seed = entry
            else:
                _refuse(entry, words)
        if math.prod(len(axis[0].values) for axis in axes) > MOST_CASES:
            break
    sweep = Sweep(tuple(axes), tuple(excludes), seed, definition.place)
    if not axes and not complaints.errors:
        complaints.error("D126", f"sweep `{definition.name}` varies nothing", definition.place,
                         help="write `vary PATH = [...] UNIT;`")
    if math.prod(sweep.sizes) > MOST_CASES:
        complaints.error(
            "D134",
            f"sweep `{definition.name}` has {math.prod(sweep.sizes):.3g} cases",
            definition.place,
            help=f"{MOST_CASES} are possible: " + " x ".join(str(size) for size in sweep.sizes) + " is more",
        )
    return sweep


def _paths(entry: object) -> list[str]:
    if isinstance(entry, Setting):
        return [".".join(word.text for word in entry.path)]
    if isinstance(entry, Group):
        return [path for inner in entry.body for path in _paths(inner)]
    return []


def _refuse(entry: object, words: list[str]) -> None:
    place = entry.place  # type: ignore[attr-defined]  # every entry has one
    if isinstance(entry, Setting) and not words:
        words = [entry.path[0].text]
    if words and words[0] in LATER:
        raise Problem(error("D120", f"`{words[0]}` in a sweep is not in this version", place,
                            help="vary the parameter over a list, linspace(...) or logspace(...)"))
    if isinstance(entry, Setting):
        path = ".".join(word.text for word in entry.path)
        raise Problem(error("D136", f"`{path} = ...` in a sweep", place,
                            help=[f"`vary {path} = [...];` to vary it",
                                  "or set it in a run `like` this one, and sweep that"]))
    known = ("vary", "zip", "exclude when")
    raise Problem(error("D136", f"no `{' '.join(words)}` in a sweep", place,
                        help=[*did_you_mean(" ".join(words), known), *belongs(words[0] if words else ""),
                              known_words("a sweep has", known)]))


def _zip(definitions: Definitions, complaints: Complaints, group: Group, written: dict[str, Place], paths: set[str],
         graph: Graph) -> tuple[Varied, ...]:
    axis: list[Varied] = []
    for entry in group.body:
        with complaints.gather():
            if not isinstance(entry, Setting) or [word.text for word in entry.words] not in ([], ["vary"]):
                raise Problem(error("D136", "a zip holds `PATH = [...];` and nothing else", entry.place))
            axis.append(_varied(definitions, entry, written, paths, graph))
    if not group.body:
        raise Problem(error("D126", "this zip is empty", group.place, help="write `PATH = [...];` in it"))
    for other in axis[1:]:
        if len(other.values) != len(axis[0].values):
            raise Problem(error(
                "D135", f"`{axis[0].path}` has {len(axis[0].values)} values and `{other.path}` has {len(other.values)}",
                other.place, also=[Label(axis[0].place, f"{len(axis[0].values)} values")],
                help="what is zipped goes in step: as many values each"))
    _check_repeats(axis)
    return tuple(axis)


def _varied(definitions: Definitions, entry: Setting, written: dict[str, Place], paths: set[str],
            graph: Graph) -> Varied:
    path = ".".join(word.text for word in entry.path)
    if path in written:
        raise Problem(error("D040", f"`{path}` is varied twice", entry.place, also=[Label(written[path], "first")],
                            help="leave one out"))
    written[path] = entry.place
    if entry.operator == "+=":
        raise Problem(error("D056", "nothing to append to in a sweep", entry.place, help="write `=`"))
    names = Names(definitions, {}, watched=paths)
    word = _word_in(entry.value, names)
    if word is not None:
        raise Problem(error("D122", f"`{path}` cannot vary over words", place_of(word),
                            help=["a word, a model and a file are one for the whole sweep in this version: write a run "
                                  "for each, `like` the first",
                                  *([f"where a number is meant, define it: `let {word.text} = ...;`"]
                                    if isinstance(word, Name) else [])]))
    found = names.evaluate(entry.value)
    if names.followed:
        raise Problem(
            error(
                "D121",
                f"the values of `{path}` depend on `{next(iter(names.followed))}`, which varies too",
                place_of(entry.value),
                help="write numbers that stand still",
            )
        )
    if isinstance(found, Value):
        raise Problem(error("D126", f"`{path}` varies over a list of values, and this is one", found.place,
                            help=["write `[a, b, c] UNIT`, `linspace(from, to, count) UNIT` or `logspace(...)`",
                                  "one value that stands still belongs into the run"]))
    numbers = [value for value in found.items if isinstance(value, Value)]
    if len(numbers) != len(found.items):
        raise Problem(error("D126", "a list inside a list", found.place, help="a vector varies by its parts: `PATH.x`"))
    if not numbers:
        raise Problem(error("D126", f"`{path}` has no values", found.place, help="one at least"))
    first = numbers[0]
    for value in numbers[1:]:
        if not units.same(value.dimension, first.dimension):
            raise Problem(error("D063", f"{_unit(value)} in a list that begins with {_unit(first)}", value.place,
                                also=[Label(first.place, _unit(first))], help="all must be of one dimension"))
    unit = found.unit or first.unit
    value = Value(graph.input(path), first.dimension, first.place, all(value.bare for value in numbers), unit)
    scale = measure_of(unit).scale if unit is not None and measure_of(unit).dimension == first.dimension else 1.0
    varied = Varied(path, entry.place, np.array([value.number for value in numbers], dtype=float), value, unit, scale)
    if not [word for word in entry.words if word.text != "vary"] and entry.words:
        _check_repeats([varied])
    return varied


def _word_in(listed: Expression, names: Names) -> Name | String | None:
    """The first item of a list of texts, or of names that have no value and are like none that has."""

    def is_word(item: Expression) -> bool:
        if not isinstance(item, Name):
            return isinstance(item, String)
        known = names.knows(item.text) or units.is_unit(item.text) or did_you_mean(item.text, names.definitions.lets)
        return len(item.path) == 1 and not known

    items = listed.items if isinstance(listed, List) else ()
    return next((item for item in items if all(is_word(each) for each in items)), None)  # type: ignore[return-value]


def _unit(value: Value) -> str:
    return "a pure number" if value.dimension == PURE else units.text(value.dimension)


def _check_repeats(axis: Sequence[Varied]) -> None:
    """The same values twice are the same case twice."""
    seen: dict[tuple[float, ...], int] = {}
    for n, row in enumerate(zip(*(varied.values.tolist() for varied in axis), strict=True)):
        if row in seen:
            raise Problem(error("D133", f"values number {seen[row] + 1} and {n + 1} are the same", axis[0].place,
                                help="leave one out: each case stands in the table once"))
        seen[row] = n


# The case table


def table(sweep: Sweep) -> dict[str, np.ndarray]:
    """Values by path, one a case, before anything is excluded."""
    count = math.prod(sweep.sizes)
    columns = {}
    after = count
    for axis, size in zip(sweep.axes, sweep.sizes, strict=True):
        after //= size
        index = (np.arange(count) // after) % size
        for varied in axis:
            columns[varied.path] = varied.values[index]
    return columns


def kept(scope: Scope, sweep: Sweep, columns: dict[str, np.ndarray]) -> np.ndarray:
    """Which rows no `exclude when` drops; warns where rounding decides, and where one drops nothing."""
    count = math.prod(sweep.sizes)
    keep = np.ones(count, dtype=bool)
    for statement in sweep.excludes:
        with scope.complaints.gather():
            drops = np.broadcast_to(_truth(scope, statement.value, columns, count), count)
            if not drops.any():
                scope.complaints.remark("D138", "this excludes no case", statement.place,
                                      help="the sweep is the same without it")
            keep &= ~drops
    if not keep.any():
        scope.complaints.error("D139", "every case is excluded", sweep.excludes[-1].place,
                               also=[Label(statement.place, "") for statement in sweep.excludes[:-1]],
                               help="`exclude when` says which cases are left out, not which are kept")
    return keep


def _truth(scope: Scope, expression: Expression, columns: dict[str, np.ndarray], count: int) -> np.ndarray:
    if isinstance(expression, Unary) and expression.operator == "not":
        return ~_truth(scope, expression.operand, columns, count)
    if isinstance(expression, Binary) and expression.operator in ("and", "or"):
        left = _truth(scope, expression.left, columns, count)
        right = _truth(scope, expression.right, columns, count)
        return left & right if expression.operator == "and" else left | right
    if not isinstance(expression, Binary) or expression.operator not in COMPARISONS:
        raise Problem(error("D130", "a comparison is needed here", place_of(expression),
                            help="such as `gearbox.kp > 0.03 V*s/rad`, joined by `and`, `or`, `not`"))
    sides = [evaluate_number(side, scope_lookup(scope)) for side in (expression.left, expression.right)]
    if not units.same(sides[0].dimension, sides[1].dimension):
        helps = "both must be of one dimension"
        for one, other in (sides, sides[::-1]):
            if one.bare and one.dimension == PURE and not isinstance(one.number, Scalar):
                helps = f"write `{one.number:g} {units.text(other.dimension)}`"
        raise Problem(error("D063", f"`{expression.operator}` of {_unit(sides[0])} and {_unit(sides[1])}",
                            expression.place, also=[Label(side.place, _unit(side)) for side in sides], help=helps))
    formulas = Formulas.of(scope.graph, [side.number for side in sides])
    left, right = (np.broadcast_to(np.asarray(x, dtype=float), count) for x in formulas.replay(columns))
    edge = (left != right) & (np.abs(left - right) <= ROUNDING * np.maximum(np.abs(left), np.abs(right)))
    if edge.any():
        row = int(np.flatnonzero(edge)[0])
        scope.complaints.remark(
            "D127", f"rounding decides this comparison in {int(edge.sum())} of {count} cases", expression.place,
            also=[Label(sides[0].place, f"{left[row]!r}"), Label(sides[1].place, f"{right[row]!r}")],
            help="compare with a limit between two values, not with one of them")
    holds = {"<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal, "==": np.equal,
             "!=": np.not_equal}[expression.operator]
    return np.asarray(holds(left, right))


def scope_lookup(scope: Scope):  # type: ignore[no-untyped-def]  # a Lookup
    """Names in `exclude when`: coordinates, parameters of the run, then what any expression may name."""

    def find(name: Name) -> Value | Values:
        if scope.checks.failed(name.text):
            raise Problem(())  # which was told
        if name.text in scope.varied:
            return scope.varied[name.text].value
        paths = scope.known.get(name.text, ())
        found = {path: settled for path in paths if (settled := scope.settled(path)) is not None}
        numbers = {x.ref if isinstance(x := each.value, Scalar) else x for each in found.values()}
        if name.path[0].text in scope.definitions.of_kind("servo"):
            with suppress(Problem):  # a default, which the definition does not write
                own = scope.names.find(name)
                if isinstance(own, Value):
                    numbers.add(own.number.ref if isinstance(own.number, Scalar) else own.number)
        if len(numbers) > 1:
            choice = " or ".join(f"`{path}`" for path in list(found)[:MOST_NAMED])
            raise Problem(error("D165", f"`{name.text}` is not the same wherever it is used in this sweep", name.place,
                                help=f"say which is meant: write {choice}"))
        for settled in found.values():
            if isinstance(settled.value, (float, int, Scalar)):
                return Value(settled.value, units.parse_unit(settled.unit).dimension, name.place)
        try:
            return scope.names.find(name)
        except Problem as problem:
            known = [*scope.varied, *scope.known]
            raise Problem(error("D065", f"no value `{name.text}`", name.place,
                                help=did_you_mean(name.text, known) or problem.diagnostics[0].help)) from None

    return find


# What a coordinate sets


def check_coordinates(scope: Scope, *, complete: bool) -> None:
    """Every coordinate sets something.

    complete  all of the run was resolved; else nothing is said of what hangs on the rest, since that was told
    """
    for path, varied in scope.varied.items():
        if path in scope.sets or path in scope.names.followed or scope.hangs(path):
            continue
        unknown = path in scope.definitions.lets or path.startswith("metrics.") or not scope.known
        if unknown and (not complete or scope.gone or scope.lost):
            continue
        place = varied.place
        if path in scope.whole:
            scope.complaints.error("D122", f"`{path}` cannot vary", place, help=f"it {scope.whole[path]}")
            continue
        first, _, rest = path.partition(".")
        overridden = _overridden(scope, first, rest)
        if (
            first in ("rates", "arm", "integrator", "duration", "record", "servos")
            or path == "environment.velocity_products"
        ):
            scope.complaints.error("D122", f"`{path}` cannot vary", place,
                                   help="it decides the program, which is one for the whole sweep in this version")
        elif overridden is not None:
            scope.complaints.error(
                "D137",
                f"`{path}` changes nothing in this run",
                place,
                also=overridden,
                help="every use overrides it, or the run does not use it; vary it where it is overridden",
            )
        else:
            scope.complaints.error("D128", f"no parameter `{path}` in this run", place,
                                   help=did_you_mean(path, (*scope.known, *scope.whole, *scope.definitions.lets))
                                   or _continued(scope, path) or _beginnings(scope))


def _overridden(scope: Scope, first: str, rest: str) -> list[Label] | None:
    """Places of a definition's or a let's value that exists but that no parameter of the run takes."""
    let = scope.definitions.lets.get(first)
    if let is not None and not rest:
        return [Label(let.name.place, "defined here")]
    definition = scope.definitions.of_kind("servo").get(first)
    block = scope.definitions.block(definition) if definition is not None else None
    item = block.get(rest) if block is not None else None
    return [Label(item.place, "written here")] if item is not None else None


def _beginnings(scope: Scope) -> list[str]:
    """What the paths of this run begin with."""
    return [known_words("paths begin with", dict.fromkeys(known.partition(".")[0] for known in scope.known))]


def _continued(scope: Scope, path: str) -> list[str]:
    """Parameters of the thing that the path's first words name, where they name one."""
    parts = path.split(".")
    for length in range(len(parts) - 1, 0, -1):
        head = ".".join(parts[:length]) + "."
        inside = sorted(known for known in scope.known if known.startswith(head))
        if inside:
            return [known_words(f"parameters of `{head[:-1]}`", inside)]
    return []


def coordinates(scope: Scope, sweep: Sweep, columns: dict[str, np.ndarray], dependents: dict[str, list[str]],
                ) -> tuple[Coordinate, ...]:
    """The coordinates as a plan holds them. dependents: parameters whose formulas need each coordinate."""
    made = []
    for varied in sweep.varied:
        direct = [path for path in scope.sets.get(varied.path, ()) if path in scope.parameters]
        unit = varied.unit.text if varied.unit is not None else units.text(varied.value.dimension)
        made.append(Coordinate(varied.path, unit, varied.scale, columns[varied.path],
                               tuple(direct or dependents.get(varied.path, ())), varied.place))
    return tuple(made)
