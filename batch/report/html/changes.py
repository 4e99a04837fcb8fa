"""Changes against another archive, as parts of a page: provenance, then cases, signals, and the worst."""

from __future__ import annotations

import math
from collections.abc import Sequence

from batch.differences.compare import IDENTICAL
from batch.differences.words import (
    DISTRIBUTION_HEADS,
    SAME,
    WORST,
    DiffColumn,
    Ending,
    SignalRow,
    WorstCase,
    cause,
    signal_columns,
)
from batch.queries.pool import page_number
from batch.report.contents.changes import PARAMETERS, ArchiveChanges, DeckTextChange, OtherOrigin, RunChanges
from batch.report.contents.parts import TextTable
from batch.report.html.blocks import case_link, command, headings, likeness, rows_under
from batch.report.html.markup import Child, Html, breaking, el, join, lines
from batch.report.html.tables import table

SHOWN_LINES, SHOWN_WORST, SHOWN_DIFF = 12, 5, 60
"""Numbers of visible lines of one kind of change, of cases that changed most, and of lines of a deck's file; the others
are folded away."""

MOST_ENDED = 20
"""Largest number of listed cases with the same change of ending."""


def origins(found: ArchiveChanges) -> Html:
    """The section on the provenance of the two archives, without their parameters, and on runs that only one of them
    has."""
    rows = [
        el("div", el("dt", origin.about), el("dd", _lines(origin)))
        for origin in found.origins
        if origin.about != PARAMETERS
    ]
    same = el("p", SAME[0].upper() + SAME[1:], ".", cls="said") if not found.origins and not found.decks else None
    decks = [el("h3", "The decks' text"), [_deck(deck) for deck in found.decks]] if found.decks else None
    return join([el("dl", rows, cls="facts made") if rows else None, same, _noted(found.alone), decks])


def parameters(found: ArchiveChanges) -> list[Child]:
    """The parameters and models that differ, to stand beside the verdict of the comparison."""
    return [
        el("div", el("p", f"{origin.about}:", cls="said"), _lines(origin), cls="changed")
        for origin in found.origins
        if origin.about == PARAMETERS
    ]


MARKS = {"+": "new", "-": "gone", "@": "at"}


def _deck(found: DeckTextChange) -> Html:
    """The differences of a file's text: each differing line with its mark, its context, and the line numbers."""
    if not found.lines:
        return el("p", found.said)
    rows = [el("li", el("code", line), cls=MARKS.get(line[:1])) for line in found.lines]
    left = el("p", f"and {found.left:,} more lines", cls="under") if found.left else None
    text = [el("ol", lines(rows), cls="textdiff"), left]
    return el("details", el("summary", found.said), text, open=len(rows) <= SHOWN_DIFF, cls="deck")


def _noted(said: Sequence[str]) -> Html | None:
    return el("div", [el("p", line) for line in said], cls="note") if said else None


def _lines(found: OtherOrigin) -> list[Html]:
    shown = [_line(line) for line in found.lines[:SHOWN_LINES]]
    folded = found.lines[SHOWN_LINES:]
    if folded:
        more = [_line(line) for line in folded]
        more += [el("p", f"and {found.left:,} more", cls="under")] if found.left else []
        summary = el("summary", f"and {len(folded) + found.left:,} more")
        shown.append(el("details", summary, more))
    return shown


def _line(said: str) -> Html:
    """A line about a change; an indented one is a line of a deck."""
    return el("p", said[2:], cls="text") if said.startswith("  ") else el("p", said)


def run_changes(found: RunChanges) -> Html:
    """A run or a structure: its cases, then signals and metrics, distributions, and the cases that changed most."""
    head = el("h3", el("span", likeness(found.word), cls="likeness"), found.heading)
    signals = _signals(found.signals)
    if found.word == IDENTICAL:
        signals = el("details", el("summary", f"{len(found.signals)} signals and metrics, all identical"), signals)
    return join(
        [
            head,
            _noted(found.alone),
            [_ended(ending) for ending in found.endings],
            [el("p", f"Note: {note}", cls="said") for note in found.notes],
            [el("p", line, ".", cls="said") for line in found.allowed],
            signals,
            _samples(found),
            el("p", found.starred, cls="said") if found.starred else None,
            _worst(found),
        ]
    )


def _ended(found: Ending) -> Html:
    """Cases with another ending, and the causes."""
    rows = [
        el("li", case_link(each.case), " ", el("code", each.case_id[:8]), "  ", el("span", cause(each)))
        for each in found.each[:MOST_ENDED]
    ]
    more = len(found.each) - MOST_ENDED
    left = el("li", f"and {more:,} more") if more > 0 else None
    head = el("p", el("strong", found.text, ":"), " ", el("span", found.cases, cls="cases"), cls="ends")
    return el("div", head, el("ul", rows, left), cls="failing ended")


def _signals(found: Sequence[SignalRow]) -> Html | None:
    if not found:
        return None
    used = signal_columns(found)
    numbers = {n for n, each in enumerate(used) if each.kind == "number"}
    rows = [el("tr", [_cell(row, column) for column in used]) for row in found]
    return rows_under(headings((each.page_head for each in used), numbers), rows, "Signals and metrics, before and now")


def _cell(row: SignalRow, column: DiffColumn) -> Html:
    """A cell of the table of signals; a case in it can be chosen."""
    text = getattr(row, column.field)
    if column.field == "name":
        return el("th", el("code", breaking(text)), scope="row")
    if column.field == "verdict":
        return el("td", likeness(text), text, cls=f"is {'same' if text == IDENTICAL else 'other'}")
    if column.field == "where":
        return el("td", _where(row), cls="words")
    if column.unit:
        text = f"{text} {getattr(row, column.unit)}".rstrip()
    return el("td", text, cls={"number": "right", "words": "words"}.get(column.kind))


def _samples(found: RunChanges) -> Html | None:
    """The table of metrics as distributions."""
    if not found.samples:
        return None
    heads = tuple(head for _, head in DISTRIBUTION_HEADS)
    rows = tuple(sample.cells for sample in found.samples)
    return table(
        TextTable(heads, ("",) * len(heads), rows, frozenset(range(1, len(heads)))), "Metrics as distributions"
    )


def _number(text: str) -> str:
    """A number, or the dash of other tables of the page."""
    return page_number(math.nan) if text == "nan" else text


def _where(each: SignalRow) -> Child:
    """The text about the place, with its case as a button that chooses it."""
    number = f"#{each.case}"
    before, found, after = each.where.rpartition(number) if each.case is not None else ("", "", each.where)
    return [before, case_link(each.case), after] if found and each.case is not None else each.where


def _worst(found: RunChanges) -> Html | None:
    """The cases that changed most, with the commands that run them again."""
    if not found.worst:
        return None
    first, others = found.worst[:SHOWN_WORST], found.worst[SHOWN_WORST:]
    more = [el("details", el("summary", f"{len(others)} more of them"), _cases(others))] if others else []
    left = el("p", f"{found.left:,} more cases differ.", cls="said") if found.left else None
    head = el("h4", WORST[0].upper() + WORST[1:])
    commands = [el("code", words) for words in found.worst[0].commands]
    again = el("p", commands[0], " and ", commands[1], " run the first again.", cls="said printed")
    return join([head, _cases(first), more, left, again])


def _cases(found: Sequence[WorstCase]) -> Html:
    heads = headings(("case", "id", "what changed most", "before", "now", "unit"), right={0, 3, 4})
    heads.append(el("th", "run it again, before and now", scope="col", cls="command"))
    rows = [
        el(
            "tr",
            el("th", case_link(each.case), scope="row", cls="right"),
            el("td", el("code", each.id), cls="id"),
            el("td", each.what),
            el("td", _number(each.before), cls="right"),
            el("td", _number(each.now), cls="right"),
            el("td", each.unit),
            el("td", [el("p", command(words)) for words in each.commands], cls="command"),
            data_case=each.case,
        )
        for each in found
    ]
    return rows_under(heads, rows, "Cases that changed most", cls="cases")
