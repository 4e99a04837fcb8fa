"""The cases of an archive that did not reach their end, grouped by cause."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Sequence

import numpy as np

from met.frozen import frozen
from met.run import DONE, FAILED, LOST, TIMED_OUT

STATUS = {DONE: "done", FAILED: "failed", TIMED_OUT: "timed out", LOST: "lost"}
"""Words for how a case ended."""

MOST_RANGES, FEW = 120, 20
"""Largest number of stretches of cases that are listed for one cause, and the number listed if there are more."""

NUMBER = re.compile(r"(?<![\w.])[-+]?\d[\d.]*(e[-+]?\d+)?")


@frozen
class FailureGroup:
    """Cases that failed alike: their status, the cause and id of the first, and all their positions; where an archive
    keeps a summary, only the position of the first, and their number, `of`."""

    status: str
    cause: str
    case_id: str
    cases: tuple[int, ...]
    of: int = 0

    @property
    def count(self) -> int:
        """The number of the cases."""
        return self.of or len(self.cases)

    @property
    def row(self) -> int:
        """The position of the first case."""
        return self.cases[0]


def failures(status: np.ndarray, cause: np.ndarray, case: np.ndarray, case_id: np.ndarray) -> tuple[FailureGroup, ...]:
    """Group failed cases by cause, in the order of their first cases. Causes that differ only in numbers are grouped.

    status, cause, case, case_id   of failed cases, in order
    """
    places_of: dict[tuple[int, str], list[int]] = {}
    for place in range(len(status)):
        places_of.setdefault((int(status[place]), NUMBER.sub("#", str(cause[place]))), []).append(place)
    return tuple(
        FailureGroup(
            STATUS.get(ended, str(ended)),
            str(cause[places[0]]),
            str(case_id[places[0]]),
            tuple(int(case[place]) for place in places),
        )
        for (ended, _), places in places_of.items()
    )


def failure_lines(failure_groups: Sequence[FailureGroup], width: int) -> Iterator[str]:
    """Lines with each cause and its cases, wrapped."""
    width = max(width, 40)
    for failure in failure_groups:
        word = "" if failure.status == "failed" else f"{failure.status}: "
        cause = failure.cause.removeprefix(word)
        if failure.count == 1:
            head = f"  #{failure.row} {failure.case_id[:8]}  {word}"
            yield from textwrap.wrap(cause, width, initial_indent=head, subsequent_indent=" " * len(head))
            continue
        head = f"  {failure.count:,} cases  {word}"
        yield from textwrap.wrap(
            f"{cause} (#{failure.row})", width, initial_indent=head, subsequent_indent=" " * len(head)
        )
        if failure.of:
            continue
        yield from textwrap.wrap(ranges(failure.cases), width, initial_indent="    ", subsequent_indent="    ")


def ranges(cases: Sequence[int]) -> str:
    """Ascending positions in words: `#3, #7-#12`."""
    stretches: list[list[int]] = []
    for case in cases:
        if stretches and case == stretches[-1][1] + 1:
            stretches[-1][1] = case
        else:
            stretches.append([case, case])
    most = MOST_RANGES if len(stretches) <= MOST_RANGES else FEW
    texts = [f"#{first}" if first == last else f"#{first}-#{last}" for first, last in stretches[:most]]
    left = sum(last - first + 1 for first, last in stretches[most:])
    return ", ".join(texts) + (f" and {left:,} more; `cause` in the archive has them all" if left else "")
