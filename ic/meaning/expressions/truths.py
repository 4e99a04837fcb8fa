"""Conditions over the rows of a table: comparisons of expressions and of words, joined by `and`, `or`, `not`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ic.grammar.syntax import Binary, Expression, Name, Unary, place_of, spell
from ic.meaning.expressions.evaluate import COMPARISONS, Lookup, evaluate_number
from ic.meaning.expressions.quantity import Value, in_words
from ic.text.complaints import known_words
from met import units
from met.diagnostic import Diagnostic, Help, Label, Problem, did_you_mean, error, write
from met.frozen import frozen
from met.trace import Formulas, Graph, Scalar
from met.units import PURE

HOLDS = {
    "<": np.less,
    "<=": np.less_equal,
    ">": np.greater,
    ">=": np.greater_equal,
    "==": np.equal,
    "!=": np.not_equal,
}
EXAMPLE = "such as `gearbox.kp > 0.03 V*s/rad`, joined by `and`, `or`, `not`"


@frozen
class NumberComparison:
    """A parsed comparison of numbers: its expression, its sides, and these as formulas of columns."""

    expression: Binary
    sides: tuple[Value, Value]
    formulas: Formulas


def need_one_dimension(comparison: Binary, left: Value, right: Value) -> None:
    """Raise Problem D063 where the two sides of a comparison have different dimensions."""
    if units.same(left.dimension, right.dimension):
        return
    helps = Help("both must be of one dimension")
    for side, other in ((left, right), (right, left)):
        if side.bare and side.dimension == PURE and not isinstance(side.number, Scalar):
            in_unit = f"{units.ONE.decimal(side.number)} {units.text(other.dimension)}"
            helps = write(in_unit, at=side.place, where="value")
    message = f"`{comparison.operator}` of {in_words(left)} and {in_words(right)}"
    also = [Label(side.place, in_words(side)) for side in (left, right)]
    raise Problem(error("D063", message, comparison.place, also=also, help=helps))


class Truths:
    """The rows of a table in which conditions hold, piece by piece of the table.

    find     gives names their values: numbers, or inputs of `graph` that stand for a column
    words    of what is a word in each row: one for all rows, or one a row; options: all the words that there are
    numeric  whether a word that is a number may be meant as one: then it is no word
    Where a side of a comparison has no value, it does not hold.
    """

    numeric = True

    def __init__(
        self,
        find: Lookup,
        graph: Graph,
        words: Mapping[str, str | np.ndarray],
        options: Mapping[str, Sequence[str]],
    ) -> None:
        self.find, self.graph, self.words, self.options = find, graph, words, options
        self.columns: Mapping[str, np.ndarray] = {}
        self.length = 0
        self._read: dict[int, NumberComparison] = {}  # by the expression: read once, whatever the pieces

    def take(self, columns: Mapping[str, np.ndarray], length: int) -> None:
        """Take a piece of the table with `length` rows. columns: the values of the graph's inputs by name, [row]"""
        self.columns, self.length = columns, length

    def of(self, expression: Expression, mask: np.ndarray) -> np.ndarray:
        """Rows for which it holds. mask: rows for which the answer matters, as after an `and` those that may still
        hold. Raises Problem D130 where it is not a condition, D063 where the sides of a comparison have two
        dimensions."""
        if isinstance(expression, Unary) and expression.operator == "not":
            return ~self.of(expression.operand, mask)
        if isinstance(expression, Binary) and expression.operator in ("and", "or"):
            left = self.of(expression.left, mask)
            if expression.operator == "and":
                return left & self.of(expression.right, mask & left)
            return left | self.of(expression.right, mask & ~left)
        if not isinstance(expression, Binary) or expression.operator not in COMPARISONS:
            raise Problem(error("D130", "a comparison is needed here", place_of(expression), help=EXAMPLE))
        of_words = self._of_words(expression)
        return self._of_numbers(expression, mask) if of_words is None else of_words

    def _of_words(self, expression: Binary) -> np.ndarray | None:
        """The truth of a comparison of a choice with a word; None for other comparisons, and for a word that is a
        number."""
        for side, other in ((expression.left, expression.right), (expression.right, expression.left)):
            if isinstance(side, Name) and side.text in self.words:
                text = self.words[side.text]
                if self.numeric and any(
                    option[:1].isdigit() or option[:1] in "-." for option in np.unique(text).tolist()
                ):
                    return None
                if expression.operator not in ("==", "!="):
                    message = f"`{side.text}` is a word, which is not less or more than another"
                    raise Problem(error("D130", message, expression.place, help="compare with `==` or `!=`"))
                written, known = spell(other), self.options[side.text]
                if written not in known:
                    message = f"`{side.text}` is never `{written}` in this sweep"
                    helps = [*did_you_mean(written, known), known_words("it varies over", known)]
                    raise Problem(error("D130", message, place_of(other), help=helps))
                holds = (np.asarray(text) == written) == (expression.operator == "==")
                return np.array(np.broadcast_to(holds, self.length))
        return None

    def _of_numbers(self, expression: Binary, mask: np.ndarray) -> np.ndarray:
        """The rows in which a comparison of numbers holds, [row]; it holds in none where a side is not-a-number. mask:
        rows that count."""
        compared = self._read.get(id(expression))
        if compared is None:
            compared = self._read[id(expression)] = self._comparison(expression)
        left, right = (
            np.broadcast_to(np.asarray(x, float), self.length) for x in compared.formulas.replay(self.columns)
        )
        self.look_at(compared, left, right, mask)
        return np.asarray(HOLDS[expression.operator](left, right)) & ~(np.isnan(left) | np.isnan(right))

    def _comparison(self, expression: Binary) -> NumberComparison:
        """A parsed comparison of numbers. Warns (D305) where one side is in Hz and the other in 1/s.

        Raises Problem where the two have different dimensions.
        """
        left, right = (evaluate_number(side, self.find) for side in (expression.left, expression.right))
        need_one_dimension(expression, left, right)
        if left.hertz is not None and right.hertz is not None and left.hertz != right.hertz:
            message = f"`{expression.operator}` of Hz and 1/s, which are taken for one"
            helps_hertz = [
                "if that is meant, write both sides in the same of the two",
                "if cycles a second are meant, write 2 pi times the number of Hz, in `1/s`",
            ]
            self.warn(error("D305", message, expression.place, help=helps_hertz))
        return NumberComparison(expression, (left, right), Formulas.of(self.graph, [left.number, right.number]))

    def warn(self, diagnostic: Diagnostic) -> None:
        """Handle a possible misreading; ignored here."""

    def look_at(self, compared: NumberComparison, left: np.ndarray, right: np.ndarray, mask: np.ndarray) -> None:
        """Handle the numbers of each comparison of a piece before it is decided."""
