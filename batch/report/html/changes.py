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


def origins(archive_changes: ArchiveChanges) -> Html:
    """The section on the provenance of the two archives, without their parameters, and on runs that only one of them
    has."""
    rows = [
        el("div", el("dt", origin.about), el("dd", _lines(origin)))
        for origin in archive_changes.origins
        if origin.about != PARAMETERS
    ]
    same = (
        el("p", SAME[0].upper() + SAME[1:], ".", cls="said")
        if not archive_changes.origins and not archive_changes.decks
        else None
    )
    decks = (
        [el("h3", "The decks' text"), [_deck(deck) for deck in archive_changes.decks]]
        if archive_changes.decks
        else None
    )
    return join([el("dl", rows, cls="facts made") if rows else None, same, _noted(archive_changes.alone), decks])


def parameters(archive_changes: ArchiveChanges) -> list[Child]:
    """The parameters and models that differ, to stand beside the verdict of the comparison."""
    return [
        el("div", el("p", f"{origin.about}:", cls="said"), _lines(origin), cls="changed")
        for origin in archive_changes.origins
        if origin.about == PARAMETERS
    ]


MARKS = {"+": "new", "-": "gone", "@": "at"}


def _deck(deck_change: DeckTextChange) -> Html:
    """The differences of a file's text: each differing line with its mark, its context, and the line numbers."""
    if not deck_change.lines:
        return el("p", deck_change.summary)
    rows = [el("li", el("code", line), cls=MARKS.get(line[:1])) for line in deck_change.lines]
    left = el("p", f"and {deck_change.left:,} more lines", cls="under") if deck_change.left else None
    text = [el("ol", lines(rows), cls="textdiff"), left]
    return el("details", el("summary", deck_change.summary), text, open=len(rows) <= SHOWN_DIFF, cls="deck")


def _noted(notes: Sequence[str]) -> Html | None:
    """Sentences in a box; None where there are none."""
    return el("div", [el("p", line) for line in notes], cls="note") if notes else None


def _lines(origin: OtherOrigin) -> list[Html]:
    """The changed lines of a kind, the first ones shown, others to be unfolded."""
    blocks = [_line(line) for line in origin.lines[:SHOWN_LINES]]
    folded = origin.lines[SHOWN_LINES:]
    if folded:
        more = [_line(line) for line in folded]
        more += [el("p", f"and {origin.left:,} more", cls="under")] if origin.left else []
        summary = el("summary", f"and {len(folded) + origin.left:,} more")
        blocks.append(el("details", summary, more))
    return blocks


def _line(text: str) -> Html:
    """A line about a change; an indented one is a line of a deck."""
    return el("p", text[2:], cls="text") if text.startswith("  ") else el("p", text)


def run_changes(changes: RunChanges) -> Html:
    """A run or a structure: its cases, then signals and metrics, distributions, and the cases that changed most."""
    head = el("h3", el("span", likeness(changes.word), cls="likeness"), changes.heading)
    signals = _signals(changes.signals)
    if changes.word == IDENTICAL:
        signals = el("details", el("summary", f"{len(changes.signals)} signals and metrics, all identical"), signals)
    return join(
        [
            head,
            _noted(changes.alone),
            [_ended(ending) for ending in changes.endings],
            [el("p", f"Note: {note}", cls="said") for note in changes.notes],
            [el("p", line, ".", cls="said") for line in changes.allowed],
            signals,
            _samples(changes),
            el("p", changes.starred, cls="said") if changes.starred else None,
            _worst(changes),
        ]
    )


def _ended(ending: Ending) -> Html:
    """Cases with another ending, and the causes."""
    rows = [
        el("li", case_link(case.case), " ", el("code", case.case_id[:8]), "  ", el("span", cause(case)))
        for case in ending.case_endings[:MOST_ENDED]
    ]
    more = len(ending.case_endings) - MOST_ENDED
    left = el("li", f"and {more:,} more") if more > 0 else None
    head = el("p", el("strong", ending.text, ":"), " ", el("span", ending.cases, cls="cases"), cls="ends")
    return el("div", head, el("ul", rows, left), cls="failing ended")


def _signals(signals: Sequence[SignalRow]) -> Html | None:
    """The table of signals and metrics before and now; None where there are none."""
    if not signals:
        return None
    used = signal_columns(signals)
    numbers = {n for n, column in enumerate(used) if column.kind == "number"}
    rows = [el("tr", [_cell(row, column) for column in used]) for row in signals]
    return rows_under(
        headings((column.page_head for column in used), numbers), rows, "Signals and metrics, before and now"
    )


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


def _samples(changes: RunChanges) -> Html | None:
    """The table of metrics as distributions."""
    if not changes.samples:
        return None
    heads = tuple(head for _, head in DISTRIBUTION_HEADS)
    rows = tuple(sample.cells for sample in changes.samples)
    return table(
        TextTable(heads, ("",) * len(heads), rows, frozenset(range(1, len(heads)))), "Metrics as distributions"
    )


def _number(text: str) -> str:
    """A number, or the dash of other tables of the page."""
    return page_number(math.nan) if text == "nan" else text


def _where(row: SignalRow) -> Child:
    """The text about the place, with its case as a button that chooses it."""
    number = f"#{row.case}"
    before, middle, after = row.where.rpartition(number) if row.case is not None else ("", "", row.where)
    return [before, case_link(row.case), after] if middle and row.case is not None else row.where


def _worst(changes: RunChanges) -> Html | None:
    """The cases that changed most, with the commands that run them again."""
    if not changes.worst:
        return None
    first, others = changes.worst[:SHOWN_WORST], changes.worst[SHOWN_WORST:]
    more = [el("details", el("summary", f"{len(others)} more of them"), _cases(others))] if others else []
    left = el("p", f"{changes.left:,} more cases differ.", cls="said") if changes.left else None
    head = el("h4", WORST[0].upper() + WORST[1:])
    commands = [el("code", words) for words in changes.worst[0].commands]
    again = el("p", commands[0], " and ", commands[1], " run the first again.", cls="said printed")
    return join([head, _cases(first), more, left, again])


def _cases(worst: Sequence[WorstCase]) -> Html:
    """The table of the cases that changed most, with the commands that run each again."""
    heads = [
        *headings(("case", "id", "what changed most", "before", "now", "unit"), right={0, 3, 4}),
        el("th", "run it again, before and now", scope="col", cls="command"),
    ]
    rows = [
        el(
            "tr",
            el("th", case_link(case.case), scope="row", cls="right"),
            el("td", el("code", case.id), cls="id"),
            el("td", case.what),
            el("td", _number(case.before), cls="right"),
            el("td", _number(case.now), cls="right"),
            el("td", case.unit),
            el("td", [el("p", command(words)) for words in case.commands], cls="command"),
            data_case=case.case,
        )
        for case in worst
    ]
    return rows_under(heads, rows, "Cases that changed most", cls="cases")
