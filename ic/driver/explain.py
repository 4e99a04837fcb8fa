"""The origin of a value: who wrote it, what it overrode, and the macros and names that it came through."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from os import PathLike

from ic.driver.compile import Compiled, Select, check
from ic.grammar.syntax import Expression, Name, names_in, place_of, spell
from ic.meaning.expressions.names import written_origin
from ic.meaning.expressions.quantity import Value
from ic.meaning.parameters.owner import Settled
from ic.meaning.parameters.scope import Scope
from met import units
from met.diagnostic import Label, Place, Problem, did_you_mean, error
from met.frozen import frozen
from met.plan import Experiment, Formula, Origin, Quantity
from met.plan.columns import FormulaColumn, span
from met.trace import Formulas, Scalar

DEEPEST = 16  # depth to which names in names are followed


@frozen
class Explanation:
    """One parameter of one run or sweep.

    path      the parameter's own path (`elbow.servo.kt`), of run or sweep `run`
    value     in SI: a number, a list, a word; (least, greatest) over the cases where `varies`
    written   the expression as the deck has it; "" for a default or a derived value
    origin    "deck", "default", "case" or "derived", and `note` in words
    place     where it was written, with the macros that it came through; None for a default
    overrode  places of what that overrode, latest first
    names     the names that the expression uses, each with its own expression and where it is defined
    doc       what the parameter means
    """

    run: str
    path: str
    value: float | tuple[float, ...] | str
    unit: str
    varies: bool
    written: str
    origin: str
    note: str
    place: Place | None
    overrode: tuple[Place, ...]
    names: tuple[Label, ...]
    doc: str


def explain(
    path: str | PathLike[str],
    target: str,
    *,
    include_dirs: Sequence[str | PathLike[str]] = (),
    defines: Sequence[str] = (),
    select: Select = None,
) -> tuple[Explanation, ...]:
    """Every parameter that `target` names: by its own path, or by a definition's (`gearbox.kp`: all that follow it).

    Raises Problem with the deck's errors, or D163 where the path names nothing.
    """
    compiled = check(path, include_dirs=tuple(include_dirs), defines=tuple(defines), select=select)
    if compiled.plan is None:
        raise Problem(compiled.diagnostics, compiled.sources)
    explanations = tuple(explanations_of(compiled, target))
    if not explanations:
        known = list(
            dict.fromkeys(
                path for scope in compiled.scopes for path in (*scope.parameters, *scope.auxiliary, *scope.known)
            )
        )
        inside = [path for path in known if path.startswith(target + ".")]
        runs = ", ".join(f"`{experiment.name}`" for experiment in compiled.plan.experiments)
        helps = [f"there are: {', '.join(inside[:24])}"] if inside else list(did_you_mean(target, known))
        raise Problem(error("D163", f"nothing is called `{target}` in {runs}", help=helps), compiled.sources)
    return explanations


def with_all_settings(compiled: Compiled, number: int = 0) -> Experiment:
    """An experiment of a deck, with its settings and the names in its values as if these were parameters."""
    assert compiled.plan is not None
    experiment, scope = compiled.plan.experiments[number], compiled.scopes[number]
    parameters, outputs = scope.quantities(auxiliary=True)
    for name in (*scope.definitions.lets, *scope.names.cells):
        let = _let(scope, name)
        if let is None or name in parameters or any(path.startswith(f"{name}.") for path in parameters):
            continue
        value = let.value
        if isinstance(value, Scalar):
            outputs.append(value)
        parameters[name] = Quantity(
            Formula(len(outputs) - 1) if isinstance(value, Scalar) else value, let.unit, let.origin
        )
    return replace(experiment, parameters=parameters, formulas=Formulas.of(scope.graph, outputs))


def explanations_of(compiled: Compiled, target: str) -> Iterator[Explanation]:
    """The origin of each value of the path `target`, in every experiment of a compiled deck; of a vector, of each
    component."""
    assert compiled.plan is not None
    for experiment, scope in zip(compiled.plan.experiments, compiled.scopes, strict=True):
        paths = dict.fromkeys((target, *scope.known.get(target, ())))
        vector = [
            path
            for path in (*scope.parameters, *scope.auxiliary)
            if path.startswith(target + ".")
            and path.count(".") == target.count(".") + 1
            and path.rpartition(".")[2] in ("x", "y", "z", "xx", "yy", "zz", "xy", "xz", "yz")
        ]
        for path in (*paths, *vector):
            settled = scope.settled(path) or _let(scope, path)
            if settled is not None:
                yield _explanation(experiment, scope, path, settled)


def _let(scope: Scope, name: str) -> Settled | None:
    """A `let` as if it were a parameter; None where it is not one, or is neither a number nor a list of numbers."""
    let = scope.definitions.lets.get(name)
    if let is None:
        return _cells(scope, name)
    if scope.names.row_table(name) is not None:
        return None
    varied = scope.varied.get(name)
    origin = written_origin(place_of(let.value), let.overrides)
    if varied is not None:
        origin = Origin("case", varied.place, (let.given_at, *let.overrides), origin.note)
    let_value = scope.names.find(Name((let.name,), let.name.place))
    if isinstance(let_value, Value):
        return Settled(let_value.number, units.text(let_value.dimension), origin, "", let.value)
    numbers = [value for value in let_value.items if isinstance(value, Value) and not isinstance(value.number, Scalar)]
    if not numbers or len(numbers) < len(let_value.items):
        return None
    unit = units.text(numbers[0].dimension)
    return Settled(tuple(float(value.number) for value in numbers), unit, origin, "", let.value)


def _cells(scope: Scope, path: str) -> Settled | None:
    """The value of a table by row name that the run requested, `bodies.boom.mass`; None where it requested none."""
    cells, table = scope.names.cells.get(path), scope.names.row_table(scope.definitions.split(path)[0])
    if cells is None or table is None:
        return None
    quantities = [table.csv.quantity(cell) for cell in cells]
    origin = Origin("deck", cells[0].place, (), f"row and column of {table.csv.file}")
    unit = units.text(quantities[0][1].dimension)
    return Settled(
        quantities[0][0] if len(quantities) == 1 else tuple(number for number, _ in quantities), unit, origin
    )


def _explanation(experiment: Experiment, scope: Scope, path: str, settled: Settled) -> Explanation:
    """A settled parameter with its origin; of one that varies, the values of its cases in short."""
    value = settled.value
    varies = isinstance(value, Scalar)
    if isinstance(value, Scalar):
        inputs = {coordinate.path: coordinate.values for coordinate in experiment.cases.coordinates}
        value = span(FormulaColumn(Formulas.of(scope.graph, [value]), inputs, experiment.cases.count))
    origin = settled.origin
    written = spell(settled.expression) if settled.expression is not None else ""
    names = tuple(_names(scope, settled.expression)) if settled.expression is not None else ()
    return Explanation(
        experiment.name,
        path,
        value,
        settled.unit,
        varies,
        written,
        origin.kind,
        origin.note,
        origin.place,
        origin.overrides,
        names,
        settled.doc,
    )


def _names(scope: Scope, expression: Expression) -> Iterator[Label]:
    """Every let that the expression uses, and those that these use, with their expressions."""
    seen: set[str] = set()
    level = [expression]
    for _ in range(DEEPEST):
        below = []
        for part in level:
            for name in map(scope.definitions.in_full, names_in(part)):
                cells = scope.names.cells.get(name.text)
                if cells is not None and name.text not in seen:
                    seen.add(name.text)
                    written = ", ".join(f"{cell.text} {cell.column.unit or ''}".rstrip() for cell in cells)
                    yield Label(cells[0].place, f"{name.text} = {written}")
                let = scope.definitions.lets.get(name.text)
                if let is not None and name.text not in seen:
                    seen.add(name.text)
                    below.append(let.value)
                    place = place_of(let.value)
                    yield Label(let.name.place if let.set_at is None else place, f"{name.text} = {spell(let.value)}")
        level = below
