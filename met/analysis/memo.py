"""Answers of the analysis, each kept under a digest of all that it follows from, so that each is found once.

The digest goes by structure, parameters and cases (`met.plan.keys.content_digest`), never by where a deck writes them:
a deck whose lines have moved asks the same, and so do two runs that are equal. Nothing says when an answer is out of
date, since another experiment has another digest.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from met.frozen import frozen
from met.plan import Experiment, keys

T = TypeVar("T")

MOST = 500
"""Answers that are kept where it is not known yet which are asked for; each is some kilobytes."""


@frozen
class KeptAnswer:
    """An answer, and the digests of the questions that were asked to find it: while it is known they are not asked, and
    yet their answers are good for another experiment that has an equal part."""

    answer: Any
    within: tuple[bytes, ...]


class AnalysisMemo:
    """The answers that were asked for, and those that were brought along from another time.

    asked  by their digests: what is to be brought along next time
    """

    def __init__(
        self, known: Mapping[bytes, KeptAnswer] | None = None, found: Callable[[], object] | None = None
    ) -> None:
        """found: called when an answer was found that was not brought along."""
        self._known: Mapping[bytes, KeptAnswer] = known or {}
        self._found = found
        self.asked: dict[bytes, KeptAnswer] = {}
        self._of_now: dict[bytes, Any] = {}
        self._open: list[list[bytes]] = []  # digests of what was asked within each question that is being answered

    def answer(self, question: str, experiment: Experiment, find: Callable[[], T], rows: Sequence[int] = ()) -> T:
        """The answer to a question about an experiment and these rows of its case table; what `find` raises is no
        answer, and is raised again next time."""
        key = keys.content_digest(question, experiment, rows)
        if self._open:
            self._open[-1].append(key)
        self._bring(key)
        if key not in self.asked:
            within = list[bytes]()
            self._open.append(within)
            try:
                found = find()
            finally:
                self._open.pop()
            self.asked[key] = KeptAnswer(found, tuple(within))
            if self._found is not None:
                self._found()
        answer: T = self.asked[key].answer
        return answer

    def _bring(self, key: bytes) -> None:
        """Take an answer that was brought along among those that are asked for, with all that are within it."""
        if key in self._known and key not in self.asked:
            self.asked[key] = self._known[key]
            for each in self._known[key].within:
                self._bring(each)

    def answer_of_now(
        self, question: str, experiment: Experiment, find: Callable[[], T], rows: Sequence[int] = ()
    ) -> T:
        """The same of an answer that is large: it is not brought along."""
        key = keys.content_digest(question, experiment, rows)
        if key not in self._of_now:
            self._of_now[key] = find()
        answer: T = self._of_now[key]
        return answer

    @property
    def so_far(self) -> dict[bytes, KeptAnswer]:
        """The answers that were asked for, and before them those that were brought along and may be asked for yet: no
        more than `MOST`, of which the first leave."""
        found = {**{key: each for key, each in self._known.items() if key not in self.asked}, **self.asked}
        return dict(list(found.items())[-MOST:])
