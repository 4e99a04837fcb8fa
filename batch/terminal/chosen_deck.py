"""`met best --write`: the chosen values, written into the text of the deck that was swept or tuned."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Sequence
from pathlib import Path

from batch.archive.read import ArchiveFile
from ic.driver.write_values import DeckWithValues, with_values
from ic.driver.written_value import WrittenValue
from ic.formatting.files import write
from ic.text.files import Files, decode, file_at
from ic.text.limits import MOST_BYTES
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.host.files import read_regular, whole_file
from met.outputs import quoted, refusal_text, setting_option


@frozen
class ChosenDeck:
    """A deck with the chosen values in it, not yet written.

    target   the file it is for;  replaces_deck: whether that is the deck itself, which is replaced
    before, after  its text without them, and with them
    run      that has them;  others: runs that change with it
    newline  the ends of its lines
    """

    target: Path
    replaces_deck: bool
    before: str
    after: str
    run: str
    others: tuple[str, ...]
    newline: str = "\n"

    def diff(self) -> Iterator[str]:
        """The lines that change, as `diff -u` prints them."""
        old, new = self.before.splitlines(), self.after.splitlines()
        return difflib.unified_diff(old, new, str(self.target), f"{self.target} (chosen)", lineterm="")

    def changes(self) -> str:
        """The runs that change, in words."""
        others = f", and {', '.join(self.others)} with it" if self.others else ""
        return f"changes {self.run}{others}"

    def write(self) -> None:
        """Write the file. Raises Problem E338 where the system refuses; the file is then unchanged."""
        text = self.after.replace("\n", self.newline)
        if self.replaces_deck:
            write(str(self.target), text)
            return
        try:
            with whole_file(self.target) as file:
                file.write(text.encode())
        except OSError as reason:
            raise Problem(error("E338", f"cannot write `{self.target}`: {refusal_text(reason)}")) from None


@frozen
class FittedValue:
    """A value to be written into a deck, with the two parts of its comment. Values on one line share `origin`."""

    value: WrittenValue
    origin: str
    interval: str = ""

    @property
    def remark(self) -> str:
        """The comment of a value that has a line of its own."""
        return f"{self.origin}, {self.interval}" if self.interval else self.origin


def chosen_deck(
    file: ArchiveFile, values: Sequence[WrittenValue], output: str | None, *, experiment: str, among: str
) -> ChosenDeck:
    """The deck of an archive with these values in it.

    output      a file for a copy; None: the deck itself
    experiment  the sweep or tuning that chose them;  among: among what, in words, `400 designs`

    Raises Problem E397 where a value cannot be written, E398 where the deck is not the archive's, or is not to be
    written to.
    """
    sources = file.sources()
    if file.deck not in sources:
        raise _other("the archive does not hold the text of its deck", "run the sweep again")
    before = sources[file.deck]
    plan = file.plan(as_written=True)
    if plan.settings:
        message = f"the archive was made with `{setting_option(plan.settings[0])}`, which is not in its deck"
        raise _other(message, "write that into the deck, and run the sweep again")
    target, newline = Path(output) if output is not None else Path(file.deck), "\n"
    if output is None:
        newline = _newline_as_archived(file.deck, before)
    elif target.exists():
        raise _other(f"`{target}` is there already", "name a file that is not: it would be lost")
    name = "".join(letter if letter.isprintable() and letter != "\\" else "?" for letter in file.path.name)
    with_chosen = with_values(
        before,
        values,
        name=file.deck.strip("<>"),
        folder=target.parent,
        experiment=experiment,
        defines=plan.defines,
        remark=f"of {among}: {experiment}, {name}",
    )
    known = set(with_chosen.sources.values())
    changed = [name for name, text in sources.items() if text not in known and not _is_there(name, text)]
    if changed:
        raise _other(f"{changed[0]} is not what it was when the archive was made", "run the sweep again")
    return ChosenDeck(target, output is None, before, with_chosen.text, with_chosen.run, with_chosen.others, newline)


def fitted_deck(
    deck: str,
    values: Sequence[FittedValue],
    output: str | None,
    *,
    experiment: str,
    defines: Sequence[str] = (),
    settings: Sequence[str] = (),
) -> ChosenDeck:
    """A deck with fitted values in it, each with its interval in a comment.

    output  a file for a copy; None: the deck itself;  experiment: the run that was fitted

    Raises Problem E397 where a value cannot be written, E398 where the deck is not to be written to.
    """
    if settings:
        raise _other(f"`{setting_option(settings[0])}` is not in the deck", "write that into the deck, and fit again")
    target = Path(output) if output is not None else Path(deck)
    if output is not None and target.exists():
        raise _other(f"`{target}` is there already", "name a file that is not: it would be lost")
    before = Files().text(file_at(deck))
    newline = "\n" if output is not None else _newline_as_archived(deck, before)
    after, others, remarks = before, dict[str, None](), list[str]()

    def written(value: WrittenValue, remark: str) -> DeckWithValues:
        """The deck with one fitted value written into its text. Raises Problem where the text has no place for it."""
        return with_values(
            after,
            [value],
            name=Path(deck).name,
            folder=Path(deck).parent,
            experiment=experiment,
            defines=defines,
            remark=remark,
        )

    for fitted in values:
        remark = fitted.remark
        changed = written(fitted.value, remark)
        for lost in [remark for remark in remarks if remark not in changed.text]:  # that of a value on the same line
            remark = f"{lost}, {fitted.interval}"
            changed = written(fitted.value, remark)
        after = changed.text
        remarks = [remark for remark in (*remarks, remark) if remark in after]
        others |= dict.fromkeys(changed.others)
    return ChosenDeck(target, output is None, before, after, experiment, tuple(others), newline)


def _is_there(name: str, text: str) -> bool:
    """True if an additional file of the sweep, such as a table, is unchanged."""
    try:
        return decode(read_regular(name, len(text.encode()) * 2), name, "file")[0] == text
    except OSError:
        return False


def _newline_as_archived(deck: str, archived: str) -> str:
    """The line ends of a deck's file, whose text must be that of the archive; else Problem E398."""
    copy = "`-o FILE` writes a copy, of the text that the archive holds"
    if deck.startswith("<"):
        raise _other(f"{deck} comes with MET, and is not written to", copy)
    if not Path(deck).is_file():
        raise _other(f"there is no `{deck}` here, of which the archive is", f"go to its folder; or {copy}")
    deck_file = file_at(deck)
    text = Files().text(deck_file)
    if text != archived:
        raise _other(f"`{deck}` is not what it was when the archive was made", f"run the sweep again; or {copy}")
    data = read_regular(deck_file.path, MOST_BYTES)
    for newline in ("\n", "\r\n"):
        if archived.replace("\n", newline).encode() == data:
            return newline
    raise _other(f"the lines of `{deck}` do not end alike", f"`met fmt {quoted(deck)}` mends that; then run it again")


def _other(message: str, help: str) -> Problem:
    """The problem that a deck is not the one that was run, or is not to be written to."""
    return Problem(error("E398", message, help=help))
