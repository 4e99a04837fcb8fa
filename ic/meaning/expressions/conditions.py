"""Conditions on values: tested at once, or over all cases of a sweep once they are known; and what has failed."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from ic.grammar.syntax import Unit
from ic.meaning.expressions.quantity import Value
from ic.text.complaints import Complaints
from met.diagnostic import Label, Place
from met.frozen import frozen
from met.trace import Formulas, Graph, Real, Scalar

Test = Callable[[np.ndarray], tuple[np.ndarray, list[str]]]
"""Values [n, k] -> which rows are bad [n], and in words why the first is."""

PIECE = 1 << 16
"""Cases that `in_pieces` tests at a time."""


def in_pieces(test: Test, values: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Apply a test that looks at each row by itself piece by piece, in little memory: a million cases would take 300 MB
    where a test needs matrices."""
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
    values: np.ndarray
    value: Value
    unit: Unit | None
    scale: float
    drawn: str = ""

    def __len__(self) -> int:
        return len(self.values)


@frozen
class Check:
    """A condition on values that hold only once the cases are known."""

    values: tuple[Real, ...]
    test: Test
    code: str
    message: str
    place: Place
    help: tuple[str, ...] = ()
    path: str = ""
    needs: tuple[str, ...] = ()


class Checks:
    """The checks of one run, and the paths of what failed, so that nothing is said twice of one mistake."""

    def __init__(self, complaints: Complaints, graph: Graph, varied: Mapping[str, VariedPath]) -> None:
        self.complaints, self.graph, self.varied = complaints, graph, varied
        self._waiting: list[Check] = []
        self._failed: set[str] = set()

    def fail(self, path: str) -> None:
        self._failed.add(path)

    def failed(self, path: str) -> bool:
        return bool(path) and any(each == path or each.startswith(path + ".") for each in self._failed)

    def touches_failed(self, path: str) -> bool:
        """Return True if a failed path is this one, inside it, or around it."""
        return self.failed(path) or any(path.startswith(each + ".") for each in self._failed if each)

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
    ) -> None:
        """Tests [n, k] values now, or once the cases are known where one of them varies.

        path   what the check is about; needs: paths whose own checks must hold for this one to say anything
        """
        if any(self.failed(each) for each in needs):
            return
        check = Check(values, test, code, message, place, (help,) if isinstance(help, str) else help, path, needs)
        if any(isinstance(value, Scalar) for value in values):
            self._waiting.append(check)
            return
        bad, causes = test(np.array([values], dtype=float))
        if bad[0]:
            self.fail(path)
            self.complaints.error(code, message, Label(place, causes[0] if causes else ""), help=check.help)

    def observe(
        self, values: tuple[Real, ...], act: Callable[[np.ndarray], None], place: Place, needs: tuple[str, ...] = ()
    ) -> None:
        """Call `act` with [n, k] values now, or once the cases are known where one of them varies: for warnings."""

        def test(table: np.ndarray) -> tuple[np.ndarray, list[str]]:
            act(table)
            return np.zeros(len(table), bool), []

        self.require(values, test, code="", message="", place=place, needs=needs)

    def run(self, cases: dict[str, np.ndarray], count: int) -> None:
        """Every check that waited for the cases, over all of them; names the first case that fails one."""
        if not self._waiting or count == 0:
            return
        formulas = Formulas.of(self.graph, [x for check in self._waiting for x in check.values])
        columns = iter(formulas.replay(cases))
        for check in self._waiting:
            table = np.stack([np.broadcast_to(np.asarray(next(columns), dtype=float), count) for _ in check.values], -1)
            bad, causes = check.test(table)
            if not bad.any() or any(self.failed(each) for each in check.needs):
                continue
            self.fail(check.path)
            row = int(np.flatnonzero(bad)[0])
            where = ", ".join(f"{path} = {self.shown(path, cases[path][row])}" for path in cases)
            more = f", and {int(bad.sum()) - 1} more" if bad.sum() > 1 else ""
            self.complaints.error(
                check.code,
                f"{check.message}; case #{row} breaks it{more}",
                Label(check.place, causes[0] if causes else ""),
                help=(f"case #{row}: {where}", *(self._narrower(check) or check.help)),
            )

    def _narrower(self, check: Check) -> tuple[str, ...]:
        """The remedy where what is checked was drawn from a normal distribution, which has no bounds."""
        checked = {value.ref for value in check.values if isinstance(value, Scalar)} if check.code == "D077" else set()
        for varied in self.varied.values():
            drawn = varied.value.number
            if varied.drawn == "normal" and isinstance(drawn, Scalar) and drawn.ref in checked:
                unit = f" {varied.unit.text}" if varied.unit else ""
                return (f"a normal distribution has no bounds: `truncated(mean, deviation, from, to){unit}` has two",)
        return ()

    def shown(self, path: str, value: float) -> str:
        """A coordinate's value in the unit of the deck."""
        varied = self.varied[path]
        return f"{value / varied.scale:g}{' ' + varied.unit.text if varied.unit else ''}"

    def first(self, value: Real) -> float:
        """A number's value in the first case."""
        if not isinstance(value, Scalar):
            return value
        formulas = Formulas.of(self.graph, [value])
        return float(formulas.replay({path: float(varied.values[0]) for path, varied in self.varied.items()})[0])
