"""What changed against another archive, as parts of a page: what made the two, then cases, signals, the worst."""

from __future__ import annotations

from collections.abc import Sequence

from batch.differences.compare import IDENTICAL
from batch.differences.words import SAME, WORST
from batch.report.blocks import case_link, likeness, scrolling
from batch.report.changes import ChangedCase, Compared, Comparison, EndedAlike, Made, SignalRow
from batch.report.markup import Child, Html, breaking, el, join, lines
from batch.report.tabular import command, table

SHOWN_LINES, SHOWN_WORST = 12, 5
"""Of one kind of change, and of the cases that changed most; the others are folded away."""


def made(found: Comparison) -> Html:
    """What made the two and differs, and what one of them has alone."""
    rows = [el("div", el("dt", each.about), el("dd", _lines(each))) for each in found.made]
    same = el("p", SAME[0].upper() + SAME[1:], ".", cls="said") if not rows else None
    return join([el("dl", rows, cls="facts made") if rows else None, same, _noted(found.alone)])


def _noted(said: Sequence[str]) -> Html | None:
    return el("div", [el("p", line) for line in said], cls="note") if said else None


def _lines(found: Made) -> list[Html]:
    shown = [_line(line) for line in found.lines[:SHOWN_LINES]]
    folded = found.lines[SHOWN_LINES:]
    if folded:
        more = [_line(line) for line in folded]
        more += [el("p", f"and {found.left:,} more", cls="under")] if found.left else []
        summary = el("summary", f"and {len(folded) + found.left:,} more")
        shown.append(el("details", summary, more))
    return shown


def _line(said: str) -> Html:
    """What is indented is a line of a deck."""
    return el("p", said[2:], cls="text") if said.startswith("  ") else el("p", said)


def compared(found: Compared) -> Html:
    """A run or a structure: its cases, then signals and metrics, distributions, and the cases that changed most."""
    head = el("h3", el("span", likeness(found.word), cls="likeness"), found.heading)
    signals = _signals(found.signals)
    if found.word == IDENTICAL:
        signals = el("details", el("summary", f"{len(found.signals)} signals and metrics, all identical"), signals)
    return join([
        head,
        _noted(found.alone),
        [_ended(each) for each in found.ended],
        [el("p", f"Note: {note}", cls="said") for note in found.notes],
        [el("p", line, ".", cls="said") for line in found.allowed],
        signals,
        table(found.samples, "Metrics as distributions") if found.samples is not None else None,
        el("p", found.starred, cls="said") if found.starred else None,
        _worst(found),
    ])  # fmt: skip


def _ended(found: EndedAlike) -> Html:
    """Cases that end otherwise, and why."""
    rows = [
        el("li", case_link(each.case), " ", el("code", each.id), "  ", el("span", each.cause)) for each in found.each
    ]
    left = el("li", f"and {found.left:,} more") if found.left else None
    head = el("p", el("strong", found.text, ":"), " ", el("span", found.cases, cls="cases"), cls="ends")
    return el("div", head, el("ul", rows, left), cls="failing ended")


def _signals(found: Sequence[SignalRow]) -> Html | None:
    if not found:
        return None
    texts = [("largest difference", "largest", "right"), ("of range", "share", "right"), ("where", "where", "words"),
             ("first", "first", None), ("tolerance", "tolerance", "words")]  # fmt: skip
    used = [(head, name, cls) for head, name, cls in texts if any(getattr(each, name) for each in found)]
    heads = [el("th", head, scope="col") for head in ("signal or metric", "verdict", "cases")]
    heads += [el("th", head, scope="col", cls=cls if cls == "right" else None) for head, _, cls in used]
    rows = [
        el("tr", el("th", el("code", breaking(each.name)), scope="row"),
           el("td", likeness(each.word), each.word, cls=f"is {'same' if each.word == IDENTICAL else 'other'}"),
           el("td", each.cases),
           [el("td", _where(each) if name == "where" else getattr(each, name), cls=cls) for _, name, cls in used])
        for each in found
    ]  # fmt: skip
    made = el("table", el("thead", el("tr", heads)), el("tbody", lines(rows)))
    return scrolling(made, "Signals and metrics, before and now")


def _where(each: SignalRow) -> Child:
    """Its case to be chosen."""
    number = f"#{each.case}"
    before, found, after = each.where.rpartition(number) if each.case is not None else ("", "", each.where)
    return [before, case_link(each.case), after] if found and each.case is not None else each.where


def _worst(found: Compared) -> Html | None:
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


def _cases(found: Sequence[ChangedCase]) -> Html:
    heads = ("case", "id", "what changed most", "before", "now", "unit", "run it again, before and now")
    right = {0, 3, 4}
    head = el("tr", [el("th", name, scope="col", cls="right" if n in right else "command" if n == 6 else None)
                     for n, name in enumerate(heads)])  # fmt: skip
    rows = [
        el("tr", el("th", case_link(each.case), scope="row", cls="right"), el("td", el("code", each.id), cls="id"),
           el("td", each.what), el("td", each.before, cls="right"), el("td", each.now, cls="right"),
           el("td", each.unit), el("td", [el("p", command(words)) for words in each.commands], cls="command"),
           data_case=each.case)
        for each in found
    ]  # fmt: skip
    return scrolling(el("table", el("thead", head), el("tbody", lines(rows)), cls="cases"), "Cases that changed most")
