"""The shown state of a watched deck: written by the compiling thread, read by the serving ones."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any

KEPT = 4
"""Number of pages, each as the data of its run, and of numbers, that can still be fetched: the last ones."""


class Board:
    """The state as JSON has it, with a number that rises; pages and numbers of cases by their own numbers; and what was
    chosen on the page. For several threads.

    name      the deck;  names, groups: what can be chosen;  run, group: what is shown of these
    messages  of `met check`;  broken: whether an error is among them, so that the page is that of an earlier deck
    fault     whether what is broken is MET, so that the messages are no mistakes of the deck
    page      number of the page that is shown, 0 of none;  numbers: of its cases' numbers, 0 of none
    doing     what is being done, in words; "" where all is done
    saved     when the deck was saved that is shown, and broken: when the one was that is not; s since 1970

    `ended`, which is no part of the state: whether nobody is to wait for it any more.
    """

    def __init__(self, name: str) -> None:
        self._changed = threading.Condition(threading.RLock())
        self._state: dict[str, Any] = {
            "name": name, "names": [], "groups": [], "run": "", "group": "", "messages": "", "broken": False,
            "fault": False,
            "page": 0, "numbers": 0, "doing": "compiling", "saved": 0.0, "tried": 0.0,
        }  # fmt: skip
        self._number = 1
        self._texts: dict[str, dict[int, bytes]] = {"page": {}, "numbers": {}}
        self._chosen: tuple[str, str | None] | None = None
        self.ended = False

    def tell(self, shown_page: int | None = None, **changes: Any) -> None:
        """Change entries of the state. shown_page: that which they concern, where they count only while it is shown"""
        with self._changed:
            if shown_page in (None, self._state["page"]) and any(
                self._state[name] != value for name, value in changes.items()
            ):
                self._state.update(changes)
                self._number += 1
                self._changed.notify_all()

    def show(self, kind: str, text: str, shown_page: int | None = None, **changes: Any) -> int:
        """Store a text, a `page` or `numbers`, and change other entries of the state with it; returns its number.
        shown_page: as for `tell`"""
        with self._changed:
            texts = self._texts[kind]
            number = max(texts, default=0) + 1
            texts[number] = text.encode()
            for old in [text_number for text_number in texts if text_number <= number - KEPT]:
                del texts[old]
            self.tell(shown_page, **{kind: number}, **changes)
            return number

    def text(self, kind: str, number: int) -> bytes | None:
        """A stored text; None where it has been dropped."""
        with self._changed:
            return self._texts[kind].get(number)

    def after(self, number: int, seconds: float) -> tuple[int, Mapping[str, Any] | None]:
        """The first state after that of this number, waiting at most this long; None where there is none yet."""
        with self._changed:
            self._changed.wait_for(lambda: self._number > number or self.ended, seconds)
            return self._number, dict(self._state) if self._number > number else None

    def choose(self, run: str, group: str | None) -> bool:
        """Choose the shown run, for the compiling thread. False where there is no such run or group."""
        with self._changed:
            if run not in self._state["names"] or (group is not None and group not in self._state["groups"]):
                return False
            self._chosen = (run, group)
            return True

    def is_chosen(self) -> bool:
        """True where a choice has not been taken yet."""
        return self._chosen is not None

    def take_chosen(self) -> tuple[str, str | None] | None:
        """The choice that was made on the page since the last call."""
        with self._changed:
            chosen, self._chosen = self._chosen, None
            return chosen

    def end(self) -> None:
        """Release everybody who waits."""
        with self._changed:
            self.ended = True
            self._changed.notify_all()
