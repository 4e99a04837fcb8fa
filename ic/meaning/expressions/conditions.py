"""Conditions on values, tested at once, or over all cases of a sweep once they are known; and the failed ones."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import numpy as np

from ic.grammar.syntax import Unit
from ic.meaning.expressions.quantity import Value, measure_of
from ic.text.complaints import PROVISIONAL, Complaints, and_more
from met.diagnostic import Diagnostic, Label, Place
from met.frozen import frozen
from met.plan.columns import AxisColumn, CaseValues, blocks, ends
from met.trace import Formulas, Graph, Real, Scalar
from met.units import ONE

Test = Callable[[np.ndarray], tuple[np.ndarray, list[str]]]
"""A test: values [n, k] -> a truth for each bad row [n], and the reason of the first in words."""

PIECE = 1 << 16
"""Number of cases that `in_pieces` tests at a time."""


WHOLE = 1 << 20
"""Largest number of cases that a test gets at once; more are tested piece by piece."""

SHOWN = 1 << 16
"""Number of cases, evenly spread, that are examined for warnings if there are more, besides those at the ends of varied
values."""

MOST_BAD = 1000
"""Largest number of failing cases of a check in pieces for which the reason is determined."""


def in_pieces(test: Test, values: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Apply a test that treats each row separately piece by piece, in little memory: a million cases would take 300 MB
    where a test needs matrices."""
    if len(values) <= PIECE:
        return test(values)
    bad, causes = np.zeros(len(values), bool), list[str]()
    for first in range(0, len(values), PIECE):
        bad[first : first + PIECE], why = test(values[first : first + PIECE])
        causes = causes or why
    return bad, causes


@frozen
class VariedPath:
    """A coordinate of a sweep while the run is resolved: its values in SI, and the scalar that stands for them.

    drawn  the distribution that they are drawn from; "" where the deck lists them
    """

    path: str
    place: Place
    values: CaseValues
    value: Value
    unit: Unit | None
    scale: float
    drawn: str = ""

    def __len__(self) -> int:
        return len(self.values)


@frozen
class Check:
    """A condition on values that are only known with the cases."""

    values: tuple[Real, ...]
    test: Test
    code: str
    message: str
    place: Place
    help: tuple[str, ...] = ()
    path: str = ""
    needs: tuple[str, ...] = ()
    warns: bool = False


class Checks:
    """The checks of one run, and the paths of failed ones, so that one mistake is reported once."""

    def __init__(self, complaints: Complaints, graph: Graph, varied: Mapping[str, VariedPath]) -> None:
        self.complaints, self.graph, self.varied = complaints, graph, varied
        self._waiting: list[Check] = []
        self._failed: set[str] = set()
        self._listed = 0  # cases that have a number
        self._rows: np.ndarray | None = None  # the cases that a test is looking at, where that is not all of them
        self._tested: Formulas | None = None  # of the values of all checks that wait, once no more come

    def of_other_cases(self) -> Checks:
        """The same checks for cases of another table, without failures yet, except those that warn or concern the whole
        arm."""
        checks = Checks(Complaints(), self.graph, self.varied)
        checks._waiting = [check for check in self._waiting if not check.warns and check.code not in PROVISIONAL]
        checks._tested = checks._formulas()
        return checks

    def errors(self, cases: Mapping[str, CaseValues], count: int) -> tuple[Diagnostic, ...]:
        """The errors of `count` cases with these values, independent of former calls."""
        if count <= WHOLE:
            columns = {path: np.asarray(values) for path, values in cases.items()}
            if not any(check.test(table)[0].any() for check, table in self._tables(columns, count)):
                return ()
        checks = copy.copy(self)
        checks.complaints, checks._failed = Complaints(), set()
        checks.run(cases, count)
        return checks.complaints.errors

    def broken(self, cases: Mapping[str, np.ndarray], count: int) -> np.ndarray:
        """A truth for each of `count` cases with these values: whether `errors` would report it, [n]."""
        bad = np.zeros(count, bool)
        for check, table in self._tables(cases, count):
            bad |= check.test(table)[0]
        return bad

    def _formulas(self) -> Formulas:
        """The values of all waiting checks, one after the other."""
        return self._tested or Formulas.of(self.graph, [x for check in self._waiting for x in check.values])

    @property
    def is_clear(self) -> bool:
        """True where nothing has failed, and no check waits for cases."""
        return not (self._failed or self._waiting)

    def fail(self, path: str) -> None:
        self._failed.add(path)

    def failed(self, path: str) -> bool:
        return bool(path) and any(
            failed_path == path or failed_path.startswith(path + ".") for failed_path in self._failed
        )

    def touches_failed(self, path: str) -> bool:
        """Return True if a failed path is this one, inside it, or around it."""
        return self.failed(path) or any(
            path.startswith(failed_path + ".") for failed_path in self._failed if failed_path
        )

    def require(
        self,
        values: tuple[Real, ...],
        test: Test,
        *,
        code: str,
        message: str,
        place: Place,
        help: str | tuple[str, ...] = (),
        path: str = "",
        needs: tuple[str, ...] = (),
        warns: bool = False,
        also: Sequence[Label] = (),
    ) -> None:
        """Tests [n, k] values now, or once the cases are known where one of them varies.

        path   what the check is about; needs: paths whose own checks must hold for this one to say anything
        warns  whether some of very many cases are enough for it
        """
        if any(self.failed(need) for need in needs):
            return
        check = Check(
            values, test, code, message, place, (help,) if isinstance(help, str) else help, path, needs, warns
        )
        if any(isinstance(value, Scalar) for value in values):
            self._waiting.append(check)
            return
        bad, causes = test(np.array([values], dtype=float))
        if bad[0]:
            self.fail(path)
            label = Label(place, causes[0] if causes else "")
            self.complaints.error(code, message, label, also=also, help=check.help)

    def observe(
        self, values: tuple[Real, ...], act: Callable[[np.ndarray], None], place: Place, needs: tuple[str, ...] = ()
    ) -> None:
        """Call `act` with [n, k] values now, or once the cases are known where one of them varies: for warnings. If
        there are very many cases it gets some, with all ends of varied values."""

        def test(table: np.ndarray) -> tuple[np.ndarray, list[str]]:
            act(table)
            return np.zeros(len(table), bool), []

        self.require(values, test, code="", message="", place=place, needs=needs, warns=True)

    def case_of(self, row: int) -> int | None:
        """The case in this row of a test's values; None while these are a piece of a long table, of which only the
        outcome counts."""
        if self._rows is None:
            return row
        return int(self._rows[row]) if len(self._rows) else None

    def where(self, row: int, values: Iterable[object]) -> str:
        """Words for the case in this row of a warning, ` in case #7`, where one of these values varies; else none."""
        case = self.case_of(row) if any(isinstance(value, Scalar) for value in values) else None
        return "" if case is None else f" in {self._case(case)}"

    def _case(self, row: int) -> str:
        return f"case #{row}" if row < self._listed else "a case that may be chosen"

    def run(self, cases: Mapping[str, CaseValues], count: int, listed: int | None = None) -> None:
        """Run every check that waited for the cases, over all of them; messages name the first failing case.

        listed  how many of them have numbers; those behind may come, and have none yet. None: all
        """
        self._listed = count if listed is None else listed
        if not self._waiting or count == 0:
            return
        if count > WHOLE:
            self._run_in_pieces(cases, count)
            return
        for check, table in self._tables({path: np.asarray(values) for path, values in cases.items()}, count):
            bad, causes = check.test(table)
            if bad.any():
                self._refuse(check, cases, int(np.flatnonzero(bad)[0]), int(bad.sum()), causes)

    def _tables(self, values: Mapping[str, np.ndarray], count: int) -> Iterator[tuple[Check, np.ndarray]]:
        """Each check that waits until the numbers of the cases are known, with its values, [case, number of the value].

        values  the inputs of the checks' formulas by name, a number for each case;  count: of cases
        """
        columns = iter(self._formulas().replay(values))
        for check in self._waiting:
            table = np.empty((count, len(check.values)))
            for number in range(len(check.values)):
                table[:, number] = next(columns)
            yield check, table

    def _run_in_pieces(self, cases: Mapping[str, CaseValues], count: int) -> None:
        """Run the waiting checks on a long table: each is tested on all of it, and gives its reason, or warnings, for
        some rows."""
        shown_rows = _shown_rows(cases, count)
        some: list[list[np.ndarray]] = [[] for _ in self._waiting]
        rows: list[list[np.ndarray]] = [[] for _ in self._waiting]
        failing = [0] * len(self._waiting)
        for piece in blocks(count):
            piece_rows = shown_rows[np.searchsorted(shown_rows, piece.start) : np.searchsorted(shown_rows, piece.stop)]
            values, length = {path: column[piece] for path, column in cases.items()}, piece.stop - piece.start
            for number, (check, table) in enumerate(self._tables(values, length)):
                taken = piece_rows - piece.start
                if not check.warns:
                    self._rows = np.empty(0)
                    bad = np.flatnonzero(check.test(table)[0])
                    taken = bad[: max(0, MOST_BAD - failing[number])]
                    failing[number] += len(bad)
                some[number].append(table[taken])
                rows[number].append(piece.start + taken)
        for number, check in enumerate(self._waiting):
            self._rows = np.concatenate(rows[number])
            if check.warns or failing[number]:
                causes = check.test(np.concatenate(some[number]))[1]
            if failing[number]:
                self._refuse(check, cases, int(self._rows[0]), failing[number], causes)
        self._rows = None

    def _refuse(
        self, check: Check, cases: Mapping[str, CaseValues], row: int, count: int, causes: Sequence[str]
    ) -> None:
        """Report a check that fails in some cases, of which this is the first."""
        if any(self.failed(need) for need in check.needs):
            return
        self.fail(check.path)
        where = ", ".join(f"{path} = {self.value_words(path, cases[path][row])}" for path in cases)
        case = self._case(row)
        self.complaints.error(
            check.code,
            f"{check.message}; {case} breaks it{and_more(count - 1)}",
            Label(check.place, causes[0] if causes else ""),
            help=(f"{case}: {where}", *(self._narrower(check) or check.help)),
        )

    def _narrower(self, check: Check) -> tuple[str, ...]:
        """The remedy where the checked value was drawn from a normal distribution, which has no bounds."""
        checked = {value.ref for value in check.values if isinstance(value, Scalar)} if check.code == "D077" else set()
        for varied in self.varied.values():
            drawn = varied.value.number
            if varied.drawn == "normal" and isinstance(drawn, Scalar) and drawn.ref in checked:
                unit = f" {varied.unit.text}" if varied.unit else ""
                return (f"a normal distribution has no bounds: `truncated(mean, deviation, from, to){unit}` has two",)
        return ()

    def value_words(self, path: str, value: float) -> str:
        """A coordinate's value in the unit of the deck."""
        varied = self.varied[path]
        return f"{measure_of(varied.unit).decimal(value)} {varied.unit.text}" if varied.unit else ONE.decimal(value)

    def first(self, value: Real) -> float:
        """A number's value in the first case."""
        if not isinstance(value, Scalar):
            return value
        formulas = Formulas.of(self.graph, [value])
        return float(formulas.replay({path: float(varied.values[0]) for path, varied in self.varied.items()})[0])


MOST_ENDS = 10
"""Largest number of axes whose ends are combined with each other."""


def _shown_rows(cases: Mapping[str, CaseValues], count: int) -> np.ndarray:
    """Rows of a long table that represent all of it, ascending: some in even steps, and those with extreme coordinates,
    in a product also several at once."""
    corners: list[int] = [row for column in cases.values() for row in ends(column)]
    axes = {column.axis: column for column in cases.values() if isinstance(column, AxisColumn)}
    if axes and all(column.rows.kept is None for column in axes.values()) and len(axes) <= MOST_ENDS:
        corners += [sum(rows) for rows in itertools.product(*(ends(column) for column in axes.values()))]
    return np.unique(np.concatenate([np.linspace(0, count - 1, SHOWN).astype(np.int64), corners]).astype(np.int64))
