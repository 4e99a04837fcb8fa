"""The case table: rows of the product of a sweep's axes, grouped by structure, without excluded ones."""

from __future__ import annotations

import itertools
import math
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ic.grammar.syntax import Name
from ic.meaning.expressions.conditions import VariedPath
from ic.meaning.expressions.quantity import Value, ValueList
from ic.meaning.expressions.truths import NumberComparison, Truths
from ic.meaning.parameters.scope import Scope
from ic.sweeps.axes import Sweep, SweepAxis
from ic.sweeps.choices import OF_JOINT, OF_RUN, ChoiceColumn, Choices
from met.diagnostic import Diagnostic, Label, Problem, did_you_mean, error, write_either
from met.plan import Structure
from met.plan.channel import channels
from met.plan.columns import AxisColumn, CaseValues, CountedRows, RowBits, SweptRows, blocks, listed
from met.trace import Scalar
from met.unit_parser import parse_unit

MOST_NAMED = 4
MOST_STRUCTURES = 256
ROUNDING = 1e-12  # relative: some thousand roundings, and far below intended differences


def columns(sweep: Sweep, rows: SweptRows) -> dict[str, CaseValues]:
    """Values of the varied numbers, by path, in these rows of the product."""
    return {
        column.path: listed(AxisColumn(rows, number, column.values))
        for number, axis in enumerate(sweep.axes)
        for column in axis.columns
        if isinstance(column, VariedPath)
    }


def repeats(sweep: Sweep, rows: SweptRows) -> CaseValues | None:
    """Number of the repeat of each of these rows; None where nothing is repeated."""
    return None if sweep.repeated is None else listed(AxisColumn(rows, len(sweep.axes), CountedRows(sweep.repeat)))


def structures(sweep: Sweep) -> list[tuple[Choices, SweptRows]]:
    """The structures of a sweep: the choices, and the rows of the product; in order of first appearance.

    What is chosen on an axis goes with some of its values, whatever the others are. Raises Problem D229 where there are
    too many structures.
    """
    by_axis = [_by_choice(axis) for axis in sweep.axes]
    count = math.prod(len(parts) for parts in by_axis)
    if count > MOST_STRUCTURES:
        raise Problem(
            error(
                "D229",
                f"sweep `{sweep.name}` is of {count} structures",
                sweep.place,
                help=[
                    f"{MOST_STRUCTURES} are possible, each with a program of its own",
                    "what is a number of a model, varied as such, needs no other structure",
                ],
            )
        )
    by_choice = []
    for parts in itertools.product(*by_axis):
        chosen = tuple(
            (column, column.options[0 if places is None else int(places[0])])
            for axis, places in zip(sweep.axes, parts, strict=True)
            for column in axis.columns
            if isinstance(column, ChoiceColumn)
        )
        by_choice.append((chosen, SweptRows(sweep.sizes, (*parts, None))))
    return sorted(by_choice, key=lambda entry: int(entry[1].number(np.zeros(1, np.int64))[0]))


def _by_choice(axis: SweepAxis) -> list[np.ndarray | None]:
    """The places of an axis' values with the same choices; None: all of them."""
    chosen = [column for column in axis.columns if isinstance(column, ChoiceColumn)]
    if not chosen:
        return [None]
    alike: dict[tuple[str, ...], list[int]] = {}
    for place, options in enumerate(zip(*(column.options for column in chosen), strict=True)):
        alike.setdefault(tuple(option.text for option in options), []).append(place)
    return [None] if len(alike) == 1 else [np.array(places) for places in alike.values()]


# Exclusion


PIECE = 1 << 18
"""Number of rows for which conditions are evaluated together."""


def kept_rows(
    scope: Scope, sweep: Sweep, rows: SweptRows, choices: Choices, structure: Structure
) -> tuple[SweptRows, list[int]]:
    """The rows that no `exclude when` drops, and the number that each drops; warns where rounding decides.

    choices those that the rows share; structure: theirs
    """
    if not sweep.excludes:
        return rows, []
    values = columns(sweep, rows)
    truths = _Truths(scope, choices, rows.count, structure)
    packed, dropped, wrong = [], [0] * len(sweep.excludes), set[int]()  # statements that are reported as wrong
    for piece in blocks(rows.count, PIECE):
        truths.take({path: column[piece] for path, column in values.items()}, piece.stop - piece.start)
        keep = np.ones(truths.length, dtype=bool)
        for number, statement in enumerate(sweep.excludes):
            drops = np.zeros(truths.length, dtype=bool)
            if number in wrong:
                continue
            wrong.add(number)
            truths.statement = number
            with scope.complaints.gather():
                drops = np.broadcast_to(truths.of(statement.value, keep), truths.length)
                wrong.remove(number)
            dropped[number] += int(drops.sum())
            keep &= ~drops
        packed.append(np.packbits(keep))
    for number in range(len(sweep.excludes)):
        with scope.complaints.gather():
            truths.report(number)
    return rows.only(RowBits(np.concatenate(packed), rows.count)), dropped


@dataclass
class _SeenComparison:
    """The findings on a comparison of numbers, over all pieces.

    lost  rows in which a side has no value;  close: rows in which rounding decides;  edge: the sides in the first
    """

    compared: NumberComparison
    lost: int = 0
    close: int = 0
    edge: tuple[float, float] = (0.0, 0.0)


class _Truths(Truths):
    """Conditions over rows of the table of a sweep, piece by piece, and what is to be said of them in the end.

    statement  the number of the `exclude when` that is asked
    """

    def __init__(self, scope: Scope, choices: Choices, count: int, structure: Structure) -> None:
        words = {column.path: option.text for column, option in choices}
        options = {column.path: [option.text for option in column.options] for column, _ in choices}
        super().__init__(self._find, scope.graph, words, options)
        self.scope, self.count, self.structure = scope, count, structure
        self.statement = 0
        self._seen: dict[tuple[int, int], _SeenComparison] = {}  # by statement, and by the expression

    def warn(self, diagnostic: Diagnostic) -> None:
        self.scope.complaints.add(replace(diagnostic, severity="warning"))

    def look_at(self, compared: NumberComparison, left: np.ndarray, right: np.ndarray, mask: np.ndarray) -> None:
        """Count, for a warning, the rows of an exclusion's comparison that are not-a-number, or equal but for
        rounding."""
        key = self.statement, id(compared.expression)
        seen = self._seen.setdefault(key, _SeenComparison(compared))
        seen.lost += int(np.count_nonzero(mask & (np.isnan(left) | np.isnan(right))))
        finite = np.isfinite(left) & np.isfinite(right) & (left != right) & mask
        edge = finite.copy()
        edge[finite] = np.abs(left - right)[finite] <= ROUNDING * np.maximum(np.abs(left), np.abs(right))[finite]
        if edge.any():
            if not seen.close:
                row = int(np.flatnonzero(edge)[0])
                seen.edge = float(left[row]), float(right[row])
            seen.close += int(edge.sum())

    def report(self, number: int) -> None:
        """Report what was found of the comparisons of a statement, in their order. Raises Problem D066 where one has no
        value, and then nothing of those behind it."""
        cases = f"of {self.count} {'case' if self.count == 1 else 'cases'}"
        for seen in (seen for (statement, _), seen in self._seen.items() if statement == number):
            place = seen.compared.expression.place
            if seen.lost:
                raise Problem(
                    error(
                        "D066",
                        f"a side of this comparison has no value in {seen.lost} {cases}",
                        place,
                        help=[
                            "it is the root of a negative number, or zero divided by zero",
                            "ask before whether there is one: `exclude when x >= 0 m^2 and sqrt(x) > 1 m;`",
                        ],
                    )
                )
            if seen.close:
                sides = zip(seen.compared.sides, seen.edge, strict=True)
                self.scope.complaints.remark(
                    "D127",
                    f"rounding decides this comparison in {seen.close} {cases}",
                    place,
                    also=[Label(side.place, f"{value!r}") for side, value in sides],
                    help="compare with a limit between two values, not with one of them",
                )

    def _find(self, name: Name) -> Value | ValueList:
        """The value of a name in `exclude when`: coordinates, parameters of the run, then names that any expression may
        use."""
        scope = self.scope
        if scope.checks.failed(name.text):
            raise Problem(())  # already reported
        if name.text in scope.varied:
            return scope.varied[name.text].value
        paths = scope.known.get(name.text) or [name.text]
        by_path = {path: settled for path in paths if (settled := scope.settled(path)) is not None}
        numbers = {x.ref if isinstance(x := settled.value, Scalar) else x for settled in by_path.values()}
        if name.path[0].text in scope.definitions.of_kind("servo"):
            with suppress(Problem):  # a default, which the definition does not write
                own = scope.names.find(name)
                if isinstance(own, Value):
                    numbers.add(own.number.ref if isinstance(own.number, Scalar) else own.number)
        if len(numbers) > 1:
            raise Problem(
                error(
                    "D165",
                    f"`{name.text}` is not the same wherever it is used in this sweep",
                    name.place,
                    help=write_either(list(by_path)[:MOST_NAMED], "say which is meant: ", old=name.text),
                )
            )
        for settled in by_path.values():
            if isinstance(settled.value, (float, int, Scalar)):
                measure = parse_unit(settled.unit)
                return Value(settled.value, measure.dimension, name.place, hertz=measure.hertz)
        try:
            return scope.names.find(name)
        except Problem as problem:
            if not any(
                diagnostic.at is not None and diagnostic.at.place == name.place for diagnostic in problem.diagnostics
            ):
                raise  # it has one, which is wrong
            later = "a metric" if name.text in {use.name for use in self.structure.metrics} else ""
            later = later or ("a channel" if name.text in channels(self.structure, [name.text]) else "")
            if later:
                raise Problem(
                    error(
                        "D065",
                        f"`{name.text}` is {later}, which has no value before a case has run",
                        name.place,
                        help="exclude by what varies, or by parameters of the run",
                    )
                ) from None
            known = [*scope.varied, *self.words, *scope.known]
            if name.text in OF_RUN or (len(name.path) > 1 and name.path[-1].text in (*OF_JOINT, "command", "model")):
                raise Problem(
                    error(
                        "D065",
                        f"`{name.text}` is no number, and does not vary in this sweep",
                        name.place,
                        help=f"leave the comparison out, or `vary {name.text} = [...];`",
                    )
                ) from None
            raise Problem(
                error(
                    "D065",
                    f"no value `{name.text}`",
                    name.place,
                    help=did_you_mean(name.text, known) or problem.diagnostics[0].help,
                )
            ) from None
