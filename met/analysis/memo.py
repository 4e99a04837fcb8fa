"""Answers of analyses, each kept under a digest of everything that it depends on, so that each is computed once.

The digest goes by structure, parameters and cases (`met.plan.keys.content_digest`), never by where a deck writes them:
a deck whose lines have moved has the same digest, and so have two equal runs. An answer never expires, since another
experiment has another digest.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from met.frozen import frozen
from met.plan import Experiment, keys

T = TypeVar("T")

MOST = 500
"""Number of answers kept while it is not known which will be asked for; each takes some kilobytes."""


@frozen
class KeptAnswer:
    """An answer, and the digests of the questions that were asked to find it: these are not asked again while it is
    known, but their answers also serve an experiment that has an equal part."""

    answer: Any
    within: tuple[bytes, ...]


class AnalysisMemo:
    """The answers of this process, and those loaded from an earlier one.

    answers  by their digests: what is to be brought along next time
    """

    def __init__(
        self, known: Mapping[bytes, KeptAnswer] | None = None, on_new: Callable[[], object] | None = None
    ) -> None:
        """on_new: called when an answer was found that was not brought along."""
        self._known: Mapping[bytes, KeptAnswer] = known or {}
        self._on_new = on_new
        self.answers: dict[bytes, KeptAnswer] = {}
        self._of_now: dict[bytes, Any] = {}
        self._open: list[list[bytes]] = []  # digests of the questions asked within each one being answered

    def answer(self, question: str, experiment: Experiment, find: Callable[[], T], rows: Sequence[int] = ()) -> T:
        """The answer to a question about an experiment and these rows of its case table; what `find` raises is no
        answer, and is raised again next time."""
        key = keys.content_digest(question, experiment, rows)
        if self._open:
            self._open[-1].append(key)
        self._bring(key)
        if key not in self.answers:
            within = list[bytes]()
            self._open.append(within)
            try:
                new = find()
            finally:
                self._open.pop()
            self.answers[key] = KeptAnswer(new, tuple(within))
            if self._on_new is not None:
                self._on_new()
        answer: T = self.answers[key].answer
        return answer

    def _bring(self, key: bytes) -> None:
        """Take a loaded answer among those that were asked for, with all that it depends on."""
        if key in self._known and key not in self.answers:
            self.answers[key] = self._known[key]
            for inner_key in self._known[key].within:
                self._bring(inner_key)

    def answer_of_now(
        self, question: str, experiment: Experiment, find: Callable[[], T], rows: Sequence[int] = ()
    ) -> T:
        """The answer to a question whose answers are large: it is never loaded or saved."""
        key = keys.content_digest(question, experiment, rows)
        if key not in self._of_now:
            self._of_now[key] = find()
        answer: T = self._of_now[key]
        return answer

    @property
    def so_far(self) -> dict[bytes, KeptAnswer]:
        """The answers that were asked for, after the loaded ones that may be asked for yet: at most `MOST`, the oldest
        dropped first."""
        answers = {**{key: answer for key, answer in self._known.items() if key not in self.answers}, **self.answers}
        return dict(list(answers.items())[-MOST:])
