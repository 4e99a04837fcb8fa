"""The case table: rows of the product of a sweep's axes, parted by structure, less those that are excluded."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from ic.grammar.syntax import Binary, Name
from ic.meaning.expressions.quantity import Value, ValueList
from ic.meaning.expressions.truths import Truths
from ic.meaning.parameters.scope import Scope
from ic.sweeps.axes import Sweep
from ic.sweeps.choices import OF_JOINT, OF_RUN, Choices
from met.diagnostic import Diagnostic, Label, Problem, did_you_mean, error
from met.plan import Structure
from met.plan.channel import channels
from met.trace import Scalar
from met.unit_parser import parse_unit

MOST_NAMED = 4
ROUNDING = 1e-12  # relative: some thousand roundings, and far below what anyone means to tell apart


def _index(sweep: Sweep, rows: np.ndarray) -> dict[str, np.ndarray]:
    """By path, which value of its column each of these rows of the product has."""
    found: dict[str, np.ndarray] = {}
    after = math.prod(sweep.sizes)
    for axis, size in zip(sweep.axes, sweep.sizes, strict=False):
        after //= size
        index = (rows // after) % size
        found |= {column.path: index for column in axis.columns}
    return found


def columns(sweep: Sweep, rows: np.ndarray) -> dict[str, np.ndarray]:
    """Values of the numbers that vary, by path, in these rows of the product."""
    index = _index(sweep, rows)
    return {column.path: column.values[index[column.path]] for column in sweep.varied}


def repeats(sweep: Sweep, rows: np.ndarray) -> np.ndarray | None:
    """Number of the repeat of each of these rows; None where nothing is repeated."""
    return None if sweep.repeated is None else (rows % sweep.repeat).astype(float)


def structures(sweep: Sweep) -> list[tuple[Choices, np.ndarray]]:
    """The structures that a sweep is of: what is chosen, and the rows of the product; in order of first appearance."""
    rows = np.arange(math.prod(sweep.sizes))
    if not sweep.chosen:
        return [((), rows)]
    index = _index(sweep, rows)
    code = np.zeros(len(rows), dtype=np.int64)
    for column in sweep.chosen:
        known: dict[str, int] = {}
        numbers = np.array([known.setdefault(option.text, len(known)) for option in column.options])
        code = code * len(known) + numbers[index[column.path]]
    order = np.argsort(code, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(code[order])) + 1)
    made = []
    for there in sorted(parts, key=lambda part: int(part[0])):
        chosen = tuple((column, column.options[int(index[column.path][there[0]])]) for column in sweep.chosen)
        made.append((chosen, there))
    return made


# Exclusion


def kept(
    scope: Scope, sweep: Sweep, values: Mapping[str, np.ndarray], choices: Choices, count: int, structure: Structure
) -> tuple[np.ndarray, list[int]]:
    """The rows that no `exclude when` drops, as a mask, and how many each drops; warns where rounding decides.

    values, choices  what varies in the `count` rows, and what they have in common
    structure        theirs
    """
    keep = np.ones(count, dtype=bool)
    dropped = []
    truths = _Truths(scope, values, choices, count, structure)
    for statement in sweep.excludes:
        drops = np.zeros(count, dtype=bool)
        with scope.complaints.gather():
            drops = np.broadcast_to(truths.of(statement.value, keep), count)
        dropped.append(int(drops.sum()))
        keep &= ~drops
    return keep, dropped


class _Truths(Truths):
    """Conditions over rows of the table of a sweep."""

    def __init__(
        self, scope: Scope, values: Mapping[str, np.ndarray], choices: Choices, count: int, structure: Structure
    ) -> None:
        words = {column.path: option.text for column, option in choices}
        options = {column.path: [option.text for option in column.options] for column, _ in choices}
        super().__init__(self._find, scope.graph, values, count, words, options)
        self.scope, self.structure = scope, structure

    def warn(self, found: Diagnostic) -> None:
        self.scope.complaints.add(replace(found, severity="warning"))

    def look_at(
        self, expression: Binary, sides: Sequence[Value], left: np.ndarray, right: np.ndarray, asked: np.ndarray
    ) -> None:
        """Refuse a side that has no value, and warn where rounding decides."""
        lost = asked & (np.isnan(left) | np.isnan(right))
        cases = f"of {self.count} {'case' if self.count == 1 else 'cases'}"
        if lost.any():
            raise Problem(
                error(
                    "D066",
                    f"a side of this comparison has no value in {int(lost.sum())} {cases}",
                    expression.place,
                    help=[
                        "it is the root of a negative number, or zero divided by zero",
                        "ask before whether there is one: `exclude when x >= 0 m^2 and sqrt(x) > 1 m;`",
                    ],
                )
            )
        finite = np.isfinite(left) & np.isfinite(right) & (left != right) & asked
        edge = finite.copy()
        edge[finite] = np.abs(left - right)[finite] <= ROUNDING * np.maximum(np.abs(left), np.abs(right))[finite]
        if edge.any():
            row = int(np.flatnonzero(edge)[0])
            self.scope.complaints.remark(
                "D127",
                f"rounding decides this comparison in {int(edge.sum())} {cases}",
                expression.place,
                also=[Label(sides[0].place, f"{float(left[row])!r}"), Label(sides[1].place, f"{float(right[row])!r}")],
                help="compare with a limit between two values, not with one of them",
            )

    def _find(self, name: Name) -> Value | ValueList:
        """Names in `exclude when`: coordinates, parameters of the run, then what any expression may name."""
        scope = self.scope
        if scope.checks.failed(name.text):
            raise Problem(())  # already reported
        if name.text in scope.varied:
            return scope.varied[name.text].value
        paths = scope.known.get(name.text) or [name.text]
        found = {path: settled for path in paths if (settled := scope.settled(path)) is not None}
        numbers = {x.ref if isinstance(x := each.value, Scalar) else x for each in found.values()}
        if name.path[0].text in scope.definitions.of_kind("servo"):
            with suppress(Problem):  # a default, which the definition does not write
                own = scope.names.find(name)
                if isinstance(own, Value):
                    numbers.add(own.number.ref if isinstance(own.number, Scalar) else own.number)
        if len(numbers) > 1:
            choice = " or ".join(f"`{path}`" for path in list(found)[:MOST_NAMED])
            raise Problem(
                error(
                    "D165",
                    f"`{name.text}` is not the same wherever it is used in this sweep",
                    name.place,
                    help=f"say which is meant: write {choice}",
                )
            )
        for settled in found.values():
            if isinstance(settled.value, (float, int, Scalar)):
                measure = parse_unit(settled.unit)
                return Value(settled.value, measure.dimension, name.place, hertz=measure.hertz)
        try:
            return scope.names.find(name)
        except Problem as problem:
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
