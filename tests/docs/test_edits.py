"""Edits beside helps do what the helps say: on every deck of docs/diagnostics.md.

`python -m tests.docs.test_edits` prints each help of the page that is shown for a deck: `+` where an edit is with it.
"""

from __future__ import annotations

import contextlib
import functools
import io
import json
import shlex
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest

from met import cli
from met.messages.edits import Edit, apply
from tests.docs.test_diagnostics_page import ALL, GIVEN, Shown, in_a_folder, offer

CHECKED = [one for one in ALL if one.commands[-1].startswith("check ")]

WITH_EDITS = 79
"""Helps of the page that an edit is with: fewer would say that one was lost."""


def checked(one: Shown) -> dict[str, Any]:
    """What `met check` says of a deck of the page, for programs, in the folder that holds it."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(io.StringIO()):
        cli.main([*shlex.split(one.commands[-1]), "--format", "json"])
    found: dict[str, Any] = json.loads(said.getvalue())
    return found


@contextlib.contextmanager
def beside(one: Shown) -> Iterator[Any]:
    """A folder with all that stands beside a deck of the page."""
    with in_a_folder() as folder, pytest.MonkeyPatch.context() as patch:
        patch.delenv("MET_DECK_PATH", raising=False)
        for name, text in one.files.items():
            (folder / name).write_text(text, encoding="utf-8")
        for name in one.given:
            GIVEN[name](folder)
        if "model.py" in one.files:
            offer(patch, folder / "model.py")
        for command in one.commands[:-1]:
            with contextlib.redirect_stdout(io.StringIO()):
                cli.main(shlex.split(command))
        yield folder


def counted(found: dict[str, Any], *severities: str) -> Counter[tuple[str, str]]:
    return Counter((each["code"], each["message"]) for each in found["diagnostics"] if each["severity"] in severities)


@functools.cache
def before_edits(number: int) -> dict[str, Any]:
    """What `met check` says of a deck of the page as it stands there, which is the deck of this number in `CHECKED`."""
    with beside(CHECKED[number]):
        return checked(CHECKED[number])


def broken(number: int) -> Iterator[str]:
    """What is wrong after each edit of a deck's messages alone, in words; nothing where all is well."""
    one, before = CHECKED[number], before_edits(number)
    if not any(each["edits"] for each in before["diagnostics"]):
        return
    with beside(one) as folder:
        for each in before["diagnostics"]:
            for edit in each["edits"]:
                file = folder / edit["file"]
                text = file.read_bytes().decode("utf-8")
                made = Edit(**{key: value for key, value in edit.items() if key != "help"})
                file.write_bytes(apply(made, text).encode("utf-8"))
                after = checked(one)
                file.write_bytes(text.encode("utf-8"))
                told = (each["code"], each["message"])
                if counted(after, "error", "warning")[told] >= counted(before, "error", "warning")[told]:
                    yield f"{each['help'][edit['help']]}: {told} is still there after {made}"
                arisen = counted(after, "error") - counted(before, "error")
                if arisen:
                    yield f"{each['help'][edit['help']]}: {list(arisen)} arose after {made}"


@pytest.mark.slow
@pytest.mark.parametrize("number", range(len(CHECKED)), ids=[one.code for one in CHECKED])
def test_an_edit_mends_what_its_message_says_and_makes_no_other_error(number: int) -> None:
    assert list(broken(number)) == []


def helps() -> Iterator[tuple[str, str, bool]]:
    """Each help of the page's decks, with its code, and True where an edit is with it."""
    told: dict[tuple[str, str], bool] = {}
    for number in range(len(CHECKED)):
        for each in before_edits(number)["diagnostics"]:
            with_edit = {edit["help"] for edit in each["edits"]}
            for n, text in enumerate(each["help"]):
                told[each["code"], text] = told.get((each["code"], text), False) or n in with_edit
    yield from ((code, text, there) for (code, text), there in told.items())


@pytest.mark.release
def test_as_many_helps_have_edits_as_are_known_to() -> None:
    assert sum(there for _, _, there in helps()) >= WITH_EDITS


def main() -> None:
    found = list(helps())
    for code, text, there in found:
        print("+" if there else " ", code, text)
    print(f"{sum(there for _, _, there in found)} of {len(found)} helps have an edit")
    for number, one in enumerate(CHECKED):
        for wrong in broken(number):
            print("WRONG", one.code, wrong)


if __name__ == "__main__":
    main()
