"""Diagnostics as text for people in a terminal; `met.messages.programs` writes them for programs.

    error[D031]: servo `shoulder` at 300 Hz does not divide the base rate, 1000 Hz
      --> arm.ic:42:12
       |
    42 |     rate = 300 Hz;
       |            ^^^^^^ 1000/300 = 3.33
      ::: rates.ic:3:5  base rate set here
       = help: nearest that fit: 333.333 Hz (1000/3), 250 Hz (1000/4)

For a token that a macro made, the place shown is where the deck used the macro; the place in the macro's body follows.
For one in a loop, the loop and the value of its index follow.
A token from an argument is shown where the argument was written.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import TextIO

from met.messages.message import Diagnostic, Place, shown_place

TAB = 4
WIDEST = 120  # columns of a source line; a longer one is shown in part
MOST_STEPS = 8  # of macro expansion, or of includes
ELLIPSIS = "..."

_COLOURS: Mapping[str, str] = MappingProxyType(
    {"error": "\x1b[1;31m", "warning": "\x1b[1;33m", "note": "\x1b[1;36m", "frame": "\x1b[1;34m", "bold": "\x1b[1m"}
)
_RESET = "\x1b[0m"


def render(
    diagnostics: Iterable[Diagnostic], sources: Mapping[str, str] = MappingProxyType({}), *, colour: bool = False
) -> str:
    """The diagnostics as text, with the deck's lines and a count at the end; "" for none.

    sources: the text of each file by the name that places give it; a file that is not there is named, not shown.
    """
    listed = tuple(diagnostics)
    lines = {name: text.split("\n") for name, text in sources.items()}
    paint = _Paint(colour)
    blocks = [_block(diagnostic, lines, paint) for diagnostic in listed]
    if listed:
        blocks.append(count_line(listed) + "\n")
    return "\n".join(blocks)


def count_line(diagnostics: Iterable[Diagnostic]) -> str:
    """`2 errors, 1 warning`."""
    listed = tuple(diagnostics)
    counts = ((sum(d.severity == kind for d in listed), kind) for kind in ("error", "warning", "note"))
    return ", ".join(f"{n} {kind}{'s' * (n != 1)}" for n, kind in counts if n)


def wants_colour(stream: TextIO, environ: Mapping[str, str] = os.environ) -> bool:
    """True where output to this stream should be coloured: a terminal, and NO_COLOR is not set."""
    return stream.isatty() and not environ.get("NO_COLOR") and environ.get("TERM") != "dumb"


class _Paint:
    def __init__(self, colour: bool) -> None:
        self.colour = colour

    def __call__(self, style: str, text: str) -> str:
        return f"{_COLOURS[style]}{text}{_RESET}" if self.colour and text else text


def _block(diagnostic: Diagnostic, lines: Mapping[str, list[str]], paint: _Paint) -> str:
    """A diagnostic as text for a terminal, with the line of its place and a mark below. lines: of the files, by
    name."""
    head = paint(diagnostic.severity, f"{diagnostic.severity}[{diagnostic.code}]")
    out = [head + paint("bold", f": {_safe(diagnostic.message)}")]
    own_label = diagnostic.at
    shown_at = shown_place(own_label.place) if own_label else None
    number = str(shown_at.line) if shown_at else ""
    gutter = " " * len(number)
    if own_label and shown_at:
        out.append(f"{gutter}{paint('frame', '-->')} {_safe(str(shown_at))}")
        source = lines.get(shown_at.file, [])
        if 0 < shown_at.line <= len(source):
            out.append(f"{gutter} {paint('frame', '|')}")
            text, caret = _excerpt(source[shown_at.line - 1], shown_at)
            out.append(f"{paint('frame', number)} {paint('frame', '|')} {text}".rstrip())
            note = f" {_safe(own_label.text)}" if own_label.text else ""
            out.append(f"{gutter} {paint('frame', '|')} {caret[0]}{paint(diagnostic.severity, caret[1] + note)}")
        elif own_label.text:
            out.append(f"{gutter} {paint('frame', '=')} {_safe(own_label.text)}")
        if shown_at is not own_label.place:
            macro = own_label.place.expansions[0].macro
            out.append(
                f"{gutter}{paint('frame', ':::')} {_safe(str(own_label.place))}  written here, in macro {_safe(macro)}"
            )
    for label in diagnostic.also:
        place = shown_place(label.place)
        out.append(f"{gutter}{paint('frame', ':::')} {_safe(str(place))}  {_safe(label.text)}".rstrip())
    notes = [f"help: {text}" for text in diagnostic.help]
    if own_label and shown_at:
        notes += _came_through(own_label.place) + _came_in(shown_at)
    for note in notes:
        kind, _, text = note.partition(": ")
        body = f"\n{gutter}   {' ' * len(kind)}  ".join(_safe(line) for line in text.split("\n"))
        out.append(f"{gutter} {paint('frame', '=')} {paint('bold', kind)}: {body}")
    return "\n".join(out) + "\n"


def _came_through(place: Place) -> list[str]:
    """The macros that made a token, and the iterations of loops in which it stands, innermost first."""
    steps = [f"note: in expansion of macro {step.macro}, used at {step.use}" for step in place.macros]
    iterations = [f"note: in `for {step.macro}` at {shown_place(step.use)}, {step}" for step in place.iterations]
    return _cut(steps, "macros") + _cut(iterations, "loops")


def _came_in(place: Place) -> list[str]:
    """The lines that led to a file, innermost first."""
    return _cut([f"note: {word} {file}:{line}" for file, line, word in place.came_by], "files")


def _cut(steps: list[str], what: str) -> list[str]:
    """The first and last of many lines, with a count of those between."""
    if len(steps) <= MOST_STEPS:
        return steps
    half = MOST_STEPS // 2
    return [*steps[:half], f"note: ... {len(steps) - 2 * half} {what} more ...", *steps[-half:]]


def _excerpt(line: str, place: Place) -> tuple[str, tuple[str, str]]:
    """The line as shown, and its caret line in two parts: the space before, and the carets.

    Tabs become spaces, characters take the columns that a terminal gives them, and of a long line the part around the
    place is shown.
    """
    start = min(max(place.column - 1, 0), len(line))
    stop = min(max(start + place.length, start + 1), max(len(line), start + 1))
    first, last = 0, len(line)
    if sum(_width(c) for c in line[: 4 * WIDEST]) > WIDEST:
        first, last = _window(line, start)
    before, under, after = line[first:start], line[start : min(stop, last)], line[min(stop, last) : last]
    lead = ELLIPSIS if first > 0 else ""
    column = len(lead)
    text, column = _spread(before, column)
    marked, end = _spread(under, column)
    rest, _ = _spread(after, end)
    tail = ELLIPSIS if last < len(line) else ""
    return lead + text + marked + rest + tail, (" " * column, "^" * max(1, end - column))


def _window(line: str, start: int) -> tuple[int, int]:
    """A stretch of at most WIDEST columns with the place in its first two thirds."""
    first = start
    room = WIDEST // 3
    while first > 0 and room > 0:
        first -= 1
        room -= max(1, _width(line[first]))
    last = first
    room = WIDEST - 2 * len(ELLIPSIS)
    while last < len(line) and room > 0:
        room -= max(1, _width(line[last]))
        last += 1
    return first, last


def _spread(text: str, column: int) -> tuple[str, int]:
    """The text as it is printed from a column on, and the column after it."""
    out = []
    for character in text:
        if character == "\t":
            width = TAB - column % TAB
            out.append(" " * width)
        else:
            width = _width(character)
            out.append(_safe(character))
        column += width
    return "".join(out), column


def _width(character: str) -> int:
    """Columns that a terminal gives a character."""
    if character < "\x7f":
        return TAB if character == "\t" else 1
    import unicodedata

    if unicodedata.combining(character):
        return 0
    return 2 if unicodedata.east_asian_width(character) in ("W", "F") else 1


def _safe(text: str) -> str:
    """Text without control sequences that could steer a terminal."""
    if text.isprintable():
        return text
    import unicodedata

    return "".join(c if c.isprintable() or unicodedata.combining(c) else "\ufffd" for c in text)
