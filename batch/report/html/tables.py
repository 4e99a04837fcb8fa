"""Tables of a page: worst cases, structures, beds, parameters; and the deck's text with its lines numbered."""

from __future__ import annotations

from collections.abc import Sequence

from batch.queries.stability_words import stable_head
from batch.report.contents.parts import (
    EvidencePart,
    InfluencePart,
    InfluenceRow,
    NotableCases,
    ParameterRow,
    SourceListing,
    Stability,
    TextTable,
)
from batch.report.html.blocks import Anchors, case_link, command, headings, mark, rows_under, scrolling, spot_link
from batch.report.html.markup import Child, Html, breaking, el, join, lines

SHOWN_CASES = 8
"""Number of visible rows of the best and of the worst cases; the others are folded away."""


def table(text_table: TextTable, label: str) -> Html:
    """A table of texts."""
    rows = [
        el("tr", [el("td", text, cls=" ".join(_classes(text_table, number, n)) or None) for n, text in enumerate(row)])
        for number, row in enumerate(text_table.rows)
    ]
    return rows_under(_headings(text_table), rows, label)


def _classes(text_table: TextTable, row: int, column: int) -> list[str]:
    """The classes of a cell of a table: flush right, and marked as bad."""
    return ["right"] * (column in text_table.right) + ["bad"] * ((row, column) in text_table.marked)


def _headings(text_table: TextTable) -> list[Html]:
    """The headings of the columns, each with its unit where one has one."""
    units = [el("span", unit, cls="unit") if any(text_table.units) else None for unit in text_table.units]
    names = [el("span", breaking(head)) for head in text_table.heads]
    return headings(zip(names, units, strict=True), text_table.right)


def cases(notable: NotableCases) -> Html:
    """The best or the worst cases with the command that runs each again."""
    rows = []
    columns = notable.table
    for number, row in enumerate(columns.rows):
        own: list[Html] = [el("th", case_link(notable.cases[number]), scope="row", cls="right")]
        for n, text in list(enumerate(row))[1:]:
            classes = _classes(columns, number, n)
            classes += ["bad"] * (n == len(row) - 1 and text not in ("met", "done")) + ["id"] * (n == 1)
            own.append(el("td", el("code", text) if n == 1 else text, cls=" ".join(classes) or None))
        own.append(el("td", command(notable.commands[number]), cls="command"))
        rows.append(el("tr", own, data_case=notable.cases[number]))
    heads = [*_headings(columns), el("th", "run it again, to the same bits", scope="col", cls="command")]
    first, folded = (
        rows_under(heads, part, notable.title, "cases") for part in (rows[:SHOWN_CASES], rows[SHOWN_CASES:])
    )
    left = len(rows) - SHOWN_CASES
    more = el("details", el("summary", f"{left} more of them"), folded) if left > 0 else None
    again = el("p", el("code", notable.commands[0]), " runs the first again, to the same bits.", cls="said printed")
    return join([first, more, el("p", notable.more, cls="said") if notable.more else None, again])


EVIDENCE_HEADS = ("verdict", "missed", "of all cases", "percentile", "worst", "margin", "± step")


def evidence(part: EvidencePart) -> Html:
    """The table of evidence, what the cases show of each requirement: over each row the requirement and the command
    that runs its worst case again, beneath each number its limit; notes."""

    def cell(text: Child, under: str = "", cls: str | None = "right") -> Html:
        return el("td", el("span", text), el("span", under, cls="under") if under else None, cls=cls)

    rows = []
    for row in part.rows:
        texts = row.texts
        name = [
            el("code", breaking(row.requirement)),
            el("span", row.condition, cls="under") if row.condition else None,
        ]
        again = el("span", command(row.command), cls="under command") if row.command else None
        worst = texts.worst if row.case is None else [texts.worst, " ", case_link(row.case)]
        numbers = [
            cell(
                [mark(row.ok), texts.verdict],
                f"{texts.needed} more cases" if texts.needed[:1].isdigit() else "",
                cls="good" if row.ok else "bad",
            ),
            cell(texts.missed, f"{texts.share_met} met"),
            cell(texts.of_all, f"asked: {texts.demand}"),
            cell(texts.bound),
            cell(worst, f"limit {texts.limit}"),
            cell(texts.margin, f"{texts.sigmas} sigmas" if texts.sigmas[-1:].isdigit() else ""),
            cell(texts.step_error),
        ]
        head = el("tr", el("th", name, again, scope="rowgroup", colspan=len(EVIDENCE_HEADS)), cls="head")
        rows.append(el("tbody", head, el("tr", numbers)))
    heads = headings(EVIDENCE_HEADS, range(1, len(EVIDENCE_HEADS)))
    table_element = scrolling(el("table", el("thead", el("tr", heads)), lines(rows), cls="judged"), "Evidence")
    about = "Each command runs the worst case of its row again, to the same bits."
    return join([table_element, [el("p", note, cls="said") for note in (about, *part.notes)]])


def influence(part: InfluencePart) -> Html:
    """The parameters that explain a metric, with a tornado; notes."""
    head = [el("code", part.metric), ": ", part.summary] if part.metric else part.summary
    if not part.rows:
        return el("p", head, cls="said")
    together = any(row.together for row in part.rows)
    ends = [value for row in part.rows for value in (row.low, row.high)]
    low, high = min(part.mean, *ends), max(part.mean, *ends)
    rows = [
        el(
            "tr",
            el("th", el("code", breaking(row.path)), scope="row"),
            el("td", _tornado(row, part.mean, low, high)),
            el("td", row.alone, cls="right"),
            el("td", row.together, cls="right") if together else None,
            el("td", row.ends, cls="right"),
            el("td", row.rank, cls="right"),
        )
        for row in part.rows
    ]
    heads = ["parameter", "", "alone", *(["with others"] if together else []), "mean, from low to high", "rank"]
    table_element = rows_under(headings(heads, range(2, len(heads))), rows, f"What explains {part.metric}")
    return join([el("h4", head), table_element, [el("p", note, cls="said") for note in part.notes]])


def _tornado(row: InfluenceRow, mean: float, low: float, high: float) -> Html:
    """Two bars from the metric's mean to its values at both ends of a parameter. low, high: ends of the axis"""

    def x_of(value: float) -> float:
        return 160.0 * (value - low) / (high - low) if high > low else 80.0

    bars = [
        el(
            "rect",
            x=f"{min(x_of(end), x_of(mean)):.2f}",
            y=3,
            width=f"{abs(x_of(end) - x_of(mean)):.2f}",
            height=12,
            cls=cls,
        )
        for end, cls in ((row.low, "lowest"), (row.high, "highest"))
    ]
    middle = el("line", x1=f"{x_of(mean):.2f}", x2=f"{x_of(mean):.2f}", y1=0, y2=18, cls="floor")
    words = f"{row.path}: from {row.ends}"
    return el("svg", bars, middle, cls="tornado", viewBox="-1 0 162 18", role="img", aria_label=words)


def beds(bed_stability: Stability) -> Html:
    """The table of the motor beds' stability, a row for each joint."""
    several = len(bed_stability.beds) > 1
    stable = stable_head(bed_stability.spans)
    heads = ("joint", "law", "servo", "delay", "r, together" if several else "r", stable, "margin")
    rows = tuple(
        (bed.joint, bed.law, bed.servo, bed.delay, bed.spread, bed.stable_at, bed.margin) for bed in bed_stability.beds
    )
    marked = frozenset((n, 6) for n, bed in enumerate(bed_stability.beds) if not bed.ok)
    return table(TextTable(heads, ("",) * len(heads), rows, frozenset({3, 4, 5}), marked), "Beds")


# Parameters


def parameters(rows_of_parameters: Sequence[ParameterRow], anchors: Anchors) -> Html:
    """The table of parameters, each with its origin and the line of the deck."""
    among = any(row.among for row in rows_of_parameters)
    heads = ["parameter", "value", "unit", "from", "written in", *(["structures"] if among else [])]
    rows = [
        el(
            "tr",
            el("th", el("code", breaking(row.path)), scope="row"),
            el("td", row.value, cls="right"),
            el("td", row.unit),
            el("td", row.origin),
            el("td", spot_link(row.spot, anchors), _overrides(row, anchors)),
            el("td", ", ".join(row.among)) if among else None,
        )
        for row in rows_of_parameters
    ]
    return rows_under(headings(heads, right={1}), rows, "Parameters", cls="parameters")


def _overrides(row: ParameterRow, anchors: Anchors) -> Html | None:
    if not row.overrides:
        return None
    links = [part for override in row.overrides for part in (spot_link(override, anchors), " ")]
    return el("span", "overrides ", links, cls="under")


# The deck


def source(number: int, file: SourceListing) -> Html:
    """A deck file with line numbers, as targets of links."""
    texts = file.text.split("\n")
    rows = [el("li", el("code", line), id=f"f{number}-{n}") for n, line in enumerate(texts, start=1)]
    left = el("p", f"{file.left:,} more lines are in the archive.", cls="said") if file.left else None
    count = f"{len(texts) + file.left:,} lines"
    head = el("summary", el("code", file.name), el("span", f" {count} · SHA-256 {file.sha256}", cls="under"))
    return el("details", head, el("ol", lines(rows), cls="source"), left, cls="file")
