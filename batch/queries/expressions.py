"""Expressions and conditions over the cases of a run or sweep, in the deck's language: `settle < 4 s and load > 5 kg`.

A name is a metric's, or the path of what varies; numbers have their units.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property

import numpy as np

from batch.archive.stored import Stored
from batch.queries.pool import Pool
from ic.grammar.settings import read_expression
from ic.grammar.syntax import Name
from ic.meaning.expressions.evaluate import evaluate_number
from ic.meaning.expressions.quantity import Value
from ic.meaning.expressions.truths import Truths
from ic.text.complaints import known_words
from ic.text.lexer import COMMAND_LINE
from met import models
from met.diagnostic import Problem, did_you_mean, error
from met.plan.judged import FIGURES
from met.trace import Formulas, Graph
from met.unit_parser import parse_unit
from met.units import Dimension


class CaseExpressions:
    """The cases of a pool as a table whose columns expressions may name."""

    def __init__(self, pool: Pool) -> None:
        self.pool = pool
        self._graph = Graph()
        self._columns: dict[str, np.ndarray] = {}

    @cached_property
    def _variables(self) -> Mapping[str, Stored]:
        """Numbers of the cases by the names that a deck gives them."""
        roles = ("metric", "coordinate")
        return {variable.path: variable for role in roles for variable in self.pool.variables(role)}

    def holds(self, condition: str) -> np.ndarray:
        """The cases in which a condition holds, [case]: not those in which it compares a missing value. Raises
        Problem."""
        choices = {column.label: column for column in self.pool.columns if column.role == "choice"}
        words = {
            name: np.array([*column.words, ""])[np.nan_to_num(column.values, nan=len(column.words)).astype(int)]
            for name, column in choices.items()
        }
        options = {name: column.words for name, column in choices.items()}
        truths = Truths(self._find, self._graph, words, options)
        truths.numeric = False  # an archive has only the words of a choice
        truths.take(self._columns, self.pool.count)
        with _about_expression(condition):
            return truths.of(read_expression(condition), np.ones(self.pool.count, bool))

    def values(self, expression: str) -> tuple[np.ndarray, Dimension]:
        """The value of an expression in each case, [case] in SI, and its dimension. Raises Problem."""
        with _about_expression(expression):
            number = evaluate_number(read_expression(expression), self._find)
        [numbers] = Formulas.of(self._graph, [number.number]).replay(self._columns)
        return np.array(np.broadcast_to(np.asarray(numbers, float), self.pool.count)), number.dimension

    def is_margin(self, expression: str) -> bool:
        """True for the name of a metric that is a margin, which should be large, by its model's declaration."""
        named = [variable for variable in self.pool.variables("metric") if variable.path == expression.strip()]
        model = str(named[0].attributes.get("model", "")) if named else ""
        figure, metric = FIGURES.get(model), models.available("metric").get(model)
        return figure.margin if figure is not None else metric is not None and metric.margin

    def _find(self, name: Name) -> Value:
        """The values of a metric or varied parameter over all cases. Raises Problem D065 for an unknown name."""
        variable = self._variables.get(name.text)
        if variable is None:
            known = [*self._variables, *(column.label for column in self.pool.columns if column.role == "choice")]
            helps = [*did_you_mean(name.text, known), known_words("here", known)]
            raise Problem(error("D065", f"no metric or varied parameter `{name.text}`", name.place, help=helps))
        if name.text not in self._columns:
            self._columns[name.text] = self.pool.gathered(variable.name)
        try:
            measure = parse_unit(variable.unit)
        except ValueError:
            message = f"`{name.text}` has no unit that can be read: `{variable.unit}`"
            raise Problem(error("E302", message, name.place, help="was the archive changed?")) from None
        return Value(self._graph.input(name.text), measure.dimension, name.place, hertz=measure.hertz)


@contextmanager
def _about_expression(expression: str) -> Iterator[None]:
    """Add the expression to a Problem about it."""
    try:
        yield
    except Problem as problem:
        raise problem if problem.sources else Problem(problem.diagnostics, {COMMAND_LINE: f"{expression}\n"}) from None
