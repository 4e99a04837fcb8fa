"""Text blocks of a page: the verdict, the run, metrics, and provenance."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence

from batch.queries.pool import page_number
from batch.queries.summary import SPREAD_COLUMNS
from batch.report.contents.parts import (
    Fact,
    FailureRow,
    MetricRow,
    ReportSection,
    ReportWarning,
    RequirementCounts,
    RequirementFlow,
    Spot,
    VariedParameter,
    Verdict,
)
from batch.report.html.markup import Child, Html, breaking, el, join, lines

Anchors = Mapping[str, tuple[int, int]]
"""For each file whose text is in the page: its number, and the number of its lines there."""

WORDS = {"met": "meet all", "missed": "miss a requirement", "unknown": "not known", "done": "reached their end"}

ALL_MET = ("Requirements met", "Requirements not met")
ALL_SHOWN = ("Requirements demonstrated", "Requirements not demonstrated")
NOTHING_ASKED = ("All ran to the end", "Not all ran to the end")


def share(part: int, whole: int) -> str:
    """The share in per cent; 100 and 0 are shown only for all and none."""
    if part in (0, whole) or whole == 0:
        return "100 %" if part and part == whole else "0 %"
    text = f"{100 * part / whole:.3g}"
    return "> 99.9 %" if text == "100" else f"{text} %" if 100 * part / whole >= 0.1 else "< 0.1 %"


def bar(parts: Sequence[tuple[str, int]], label: str) -> Html:
    """Shares as a bar: class and count of each part, from left to right."""
    total = sum(count for _, count in parts) or 1
    rects, left = [], 0.0
    for cls, count in parts:
        width = 100.0 * count / total
        if count:
            rects.append(el("rect", x=f"{left:.3f}", y=0, width=f"{width:.3f}", height=8, cls=cls))
        left += width
    return el("svg", rects, cls="bar", viewBox="0 0 100 8", preserveAspectRatio="none", role="img", aria_label=label)


def spot_link(spot: Spot | None, anchors: Anchors) -> Html | None:
    """A line of the deck, as a link where its text is in the page."""
    if spot is None:
        return None
    words = f"{spot.file}:{spot.line}"
    known = anchors.get(spot.file)
    if known is None or not 1 <= spot.line <= known[1]:
        return el("code", words)
    return el("a", el("code", words), href=f"#f{known[0]}-{spot.line}")


# The verdict


def verdict(verdict_part: Verdict, anchors: Anchors, *, tried: bool = False, again: str = "") -> Html:
    """The answer, large, beside its grounds and doubts. tried: it is of all candidates, and neither yes nor no; again:
    the command that runs all again, if it is to be here"""
    yes, no = (verdict_part.word, verdict_part.word) if verdict_part.kind == "answer" else _words(verdict_part)
    answer = el(
        "div",
        el("p", verdict_part.about, cls="about") if verdict_part.about else None,
        None if tried else el("p", mark(verdict_part.ok), yes if verdict_part.ok else no, cls="word"),
        el("p", share(verdict_part.good, verdict_part.cases), cls="share") if verdict_part.cases > 1 else None,
        el("p", verdict_part.headline, ".", cls="headline"),
        _again("Run it again:", [again]) if again else None,
        cls="answer",
    )
    evidence = [
        _parts(verdict_part) if verdict_part.cases > 1 else None,
        _demands(verdict_part),
        _failing(verdict_part.failing, single=verdict_part.cases == 1) if verdict_part.failing else None,
        [_warning(warning, anchors) for warning in verdict_part.warnings],
        [el("p", note, cls="note") for note in verdict_part.notes],
    ]
    kind = "" if tried else " yes" if verdict_part.ok else " no"
    return el("div", answer, el("div", evidence, cls="evidence"), cls=f"verdict{kind}")


def command(words: str) -> Html:
    """A command line, and a button that copies it."""
    button = el("button", "copy", type="button", cls="copy", data_copy=words, aria_label=f"Copy {words}")
    return join([button, " ", el("code", words)])


def _again(words: str, commands: Sequence[str]) -> Html:
    """Commands that run something again, under these words."""
    return join(
        [el("p", words, cls="said"), *(el("p", command(command_text), cls="command") for command_text in commands)]
    )


def _words(verdict_part: Verdict) -> tuple[str, str]:
    """The answer in two words, for yes and for no."""
    if not verdict_part.demands:
        return NOTHING_ASKED
    of_all = {"demonstrated", "not shown", "refuted"}  # cases that may be drawn
    return ALL_SHOWN if any(demand.verdict in of_all for demand in verdict_part.demands) else ALL_MET


def _warning(warning: ReportWarning, anchors: Anchors) -> Html:
    """A warning beside the verdict: the finding, the line of the deck, and the remedies."""
    place = spot_link(warning.spot, anchors)
    return el(
        "div",
        el(
            "p",
            el("strong", f"Warning {warning.code}"),
            [", ", place] if place is not None else None,
            ": ",
            warning.message,
            ".",
        ),
        [el("p", help, cls="under") for help in warning.help],
        cls="note warning",
    )


def mark(ok: bool) -> Html:
    """A tick or a cross, before the word of the same meaning."""
    return _drawn("M3 8.5l3.2 3.2L13 4.6" if ok else "M4 4l8 8M12 4l-8 8")


def _drawn(path: str) -> Html:
    """A sign of 16 by 16, drawn as an SVG path."""
    return el("svg", el("path", d=path), cls="mark", viewBox="0 0 16 16", aria_hidden="true")


ALIKE = {
    "identical": "M3 5.7h10M3 10.3h10",
    "equivalent": "M3 6.2q2.5-2.4 5 0t5 0M3 10.8q2.5-2.4 5 0t5 0",
    "different": "M3 5.7h10M3 10.3h10M10.7 2.6L5.3 13.4",
}
UNCLEAR = "M5.2 6q0-3 2.8-3t2.8 2.6q0 1.6-1.6 2.4T7.9 10.4M7.9 13v.3"


def likeness(word: str) -> Html:
    """A sign before the word of a comparison: two lines, two waves, two lines crossed out, a question mark."""
    return _drawn(ALIKE.get(word, UNCLEAR))


SHARES = {
    "identical": ("same", "identical"),
    "equivalent": ("near", "equivalent"),
    "different": ("other", "different"),
    "only before": ("gone", "only before"),
    "only now": ("new", "only now"),
}


def comparison(comparison_part: Verdict, changed: Sequence[Child], again: Sequence[str]) -> Html:
    """The share of cases that meet all requirements, before and now, with what changed; the number of differing cases;
    gains and losses of each requirement.

    changed  the lines about the parameters that differ;  again: the commands that run both archives again
    """
    figure: list[Child] = []
    if comparison_part.figure is not None:
        was, now, total = comparison_part.figure
        text = share(now, total) if was == now else [share(was, total), el("span", " → ", cls="to"), share(now, total)]
        caption = f"of the {total:,} cases in both meet all{', as before' if was == now else ''}"
        figure = [el("p", text, cls="share two"), el("p", caption, cls="under")]
    answer = el(
        "div",
        el("p", comparison_part.about, cls="about"),
        el("p", likeness(comparison_part.word), comparison_part.word.capitalize(), cls="word"),
        figure,
        el("p", comparison_part.headline, ".", cls="headline") if comparison_part.headline else None,
        _again("Run both again:", again),
        changed,
        cls="answer",
    )
    parts = [(*SHARES.get(part.word, ("other", part.word)), part.count) for part in comparison_part.parts]
    moves = [*comparison_part.flows, *([comparison_part.ends] if comparison_part.ends is not None else [])]
    apart = [_moves(moves, better=better) for better in (True, False)] if moves else []
    evidence = [_bar_of(parts) if comparison_part.cases > 1 else None, apart, _flows(comparison_part.flows)]
    return el("div", answer, el("div", evidence, cls="evidence"), cls="verdict against")


def _flows(flows: Sequence[RequirementFlow]) -> Html | None:
    """The table of requirements whose outcome changed in cases of both archives; None where none has."""
    if not flows:
        return None
    rows = [
        el("tr", el("th", el("code", breaking(flow.text)), scope="row"), el("td", flow.met, cls="words"))
        for flow in flows
    ]
    return rows_under(headings(("requirement", "cases in both")), rows, "Requirements, before and now")


def _moves(flows: Sequence[RequirementFlow], *, better: bool) -> Html:
    """The requirements with better, or worse, values in some case: a row for each."""
    rows = []
    for flow in flows:
        crossed, moved = (flow.gained, flow.better) if better else (flow.lost, flow.worse)
        if not crossed and moved is None:
            continue
        furthest: Child = "–"
        if moved is not None:
            values = f" {moved.before} → {moved.now} {moved.unit}".rstrip()
            furthest = [case_link(moved.case), values]
        rows.append(
            el(
                "tr",
                el("th", el("code", breaking(flow.text)), scope="row"),
                el("td", crossed or "–", cls=f"{'good' if better else 'bad'} words" if crossed else None),
                el("td", f"{moved.cases:,}" if moved is not None else "–", cls="right"),
                el("td", furthest, cls="words"),
            )
        )
    name = "Improvements" if better else "Regressions"
    if not rows:
        return join([el("h4", name), el("p", "None of what is required.", cls="said")])
    crossed, moved_head = ("met now, and not before", "better in") if better else ("no longer met", "worse in")
    heads = headings(("requirement", crossed, moved_head, "furthest"), right={2})
    return join([el("h4", name), rows_under(heads, rows, name)])


def _parts(verdict_part: Verdict) -> Html:
    """The outcomes of a verdict's cases as a bar over its legend."""
    order = {"met": "good", "done": "good", "missed": "bad", "unknown": "open"}
    return _bar_of(
        [(order.get(part.word, "lost"), WORDS.get(part.word, part.word), part.count) for part in verdict_part.parts]
    )


def _bar_of(parts: Sequence[tuple[str, str, int]]) -> Html:
    """Numbers of cases as a bar over its legend: class, word and count of each part."""
    words = [(cls, f"{count:,} {word}") for cls, word, count in parts]
    legend = el("ul", [el("li", el("span", cls=f"key {cls}"), text) for cls, text in words], cls="legend")
    return join([bar([(cls, count) for cls, _, count in parts], "; ".join(text for _, text in words)), legend])


def _demands(verdict_part: Verdict) -> Html | None:
    """The table of requirements beside a verdict; None where there are none."""
    if not verdict_part.demands:
        return None
    if verdict_part.kind == "answer":
        return _answered(verdict_part.demands)
    single = verdict_part.cases == 1
    missed = not single and any(demand.missed for demand in verdict_part.demands)
    unknown = not single and any(demand.unknown for demand in verdict_part.demands)
    shares = not single and any(demand.verdict for demand in verdict_part.demands)
    heads = [
        "requirement",
        *(["outcome"] if single else ["met by", "yield"]),
        *(["verdict"] if shares else []),
        *(["missed"] if missed else []),
        *(["not known"] if unknown else []),
        "value" if single else "worst value",
    ]
    rows = [el("tr", _demand(demand, single, shares, missed, unknown)) for demand in verdict_part.demands]
    right = {n for n, head in enumerate(heads) if head not in ("requirement", "outcome", "verdict")}
    return rows_under(headings(heads, right), rows, "Requirements")


def _answered(requirements: Sequence[RequirementCounts]) -> Html:
    """The requirements in the cases of a search's answer."""
    rows = [
        el(
            "tr",
            el("th", el("code", breaking(requirement.text)), scope="row"),
            el("td", mark(requirement.ok), requirement.verdict, cls="good words" if requirement.ok else "bad words"),
            el(
                "td",
                requirement.furthest,
                [" ", case_link(requirement.case)] if requirement.case is not None else None,
                cls="right",
            ),
        )
        for requirement in requirements
    ]
    heads = headings(("requirement", "outcome", "worst value of the answer"), right={2})
    return rows_under(heads, rows, "Requirements")


def _demand(
    requirement: RequirementCounts, single: bool, shares: bool, missed: bool, unknown: bool
) -> list[Html | None]:
    """The cells of a requirement's row. single: the run has one case; shares, missed, unknown: columns of the table"""
    name = el("th", el("code", breaking(requirement.text)), scope="row")
    if single:
        word = "met" if requirement.met else "missed" if requirement.missed else "not known"
        return [
            name,
            el(
                "td",
                mark(word == "met") if word != "not known" else None,
                word,
                cls="good" if requirement.met else "bad",
            ),
            el("td", requirement.furthest, cls="right"),
        ]
    far: Child = requirement.furthest
    if requirement.case is not None:
        far = [requirement.furthest, " ", case_link(requirement.case)]
    return [
        name,
        el("td", f"{requirement.met:,} of {requirement.cases:,}", cls="right"),
        el("td", share(requirement.met, requirement.cases), cls="right strong"),
        _share_verdict(requirement) if shares else None,
        el(
            "td",
            f"{requirement.missed:,}" if requirement.missed else "–",
            cls="right bad" if requirement.missed else "right",
        )
        if missed
        else None,
        el("td", f"{requirement.unknown:,}" if requirement.unknown else "–", cls="right") if unknown else None,
        el("td", far, cls="right"),
    ]


def _share_verdict(requirement: RequirementCounts) -> Html:
    """The verdict on a requirement over a share of cases, with its bound; empty for one on every case."""
    if not requirement.verdict:
        return el("td", "–")
    ok = requirement.verdict in ("met", "demonstrated")
    bound = el("span", requirement.bound, cls="under") if requirement.bound else None
    return el("td", mark(ok), requirement.verdict, bound, cls="good" if ok else "bad")


def case_link(case: int) -> Html:
    """A case by its number, as a button that chooses it where there are scripts."""
    return el("button", f"#{case}", type="button", cls="case", data_case=case, title=f"Choose case #{case}")


def _failing(failures: Sequence[FailureRow], *, single: bool) -> Html:
    """The causes of failures, with the cases of each, and their common properties once."""
    rows = []
    for failure in failures:
        who: Child = f"case #{failure.first}" if failure.count == 1 else f"{failure.count:,} cases"
        rows.append(
            el(
                "li",
                el(
                    "p",
                    el("strong", "The case" if single else who, " ", failure.status),
                    " ",
                    el("span", failure.cause),
                ),
                el("p", failure.cases, cls="cases") if failure.count > 1 else None,
            )
        )
    return join([el("h4", "Why" if single else "Did not reach their end"), el("ul", rows, cls="failing")])


# What was run


def facts(fact_list: Sequence[Fact]) -> Html:
    """Facts as a list of names and texts."""
    return el(
        "dl",
        [
            el("div", el("dt", fact.name), el("dd", el("code", fact.text) if fact.code else fact.text))
            for fact in fact_list
        ],
        cls="facts",
    )


def varied(parameters: Sequence[VariedParameter], anchors: Anchors) -> Html | None:
    """The table of what is varied, each with the line of the deck; None where nothing is."""
    if not parameters:
        return None
    decides = any(parameter.sets for parameter in parameters)
    rows = [
        el(
            "tr",
            el("th", el("code", breaking(parameter.path)), scope="row"),
            el("td", parameter.text, cls="words"),
            el("td", parameter.unit),
            el("td", _sets(parameter.sets)) if decides else None,
            el("td", spot_link(parameter.spot, anchors)),
        )
        for parameter in parameters
    ]
    heads = ("varied", "values", "unit", *(["decides"] if decides else []), "written in")
    return rows_under(headings(heads), rows, "What was varied")


def _sets(paths: Sequence[str]) -> list[Child]:
    """The first of the paths that a varied parameter sets, and the number of the others."""
    shown_paths = [part for path in paths[:3] for part in (", ", el("code", path))][1:]
    return [*shown_paths, f" and {len(paths) - 3} more" if len(paths) > 3 else None]


def metrics(section: ReportSection) -> Html | None:
    """The table of metrics, each with its spread, and the shape of it."""
    if not section.metrics:
        return None
    compared = any(metric.before for metric in section.metrics)
    values = [*(column.page_head for column in SPREAD_COLUMNS), *(["median before"] if compared else [])]
    if section.single:
        values = ["before", "now"] if compared else ["value"]
    verified = any(metric.by_step for metric in section.metrics)
    values += ["± by the step"] if verified else []
    remarks = any(metric.remark for metric in section.metrics)
    heads = ["metric", *values, "unit", *(["how often"] if not section.single else []), *([""] if remarks else [])]
    rows = [el("tr", _metric(metric, section.single, remarks, compared, verified)) for metric in section.metrics]
    table = rows_under(
        headings(heads, range(1, len(values) + 1)), rows, "Metrics", cls="few" if section.single else None
    )
    outline = any(metric.bars_before for metric in section.metrics)
    legend = el("p", "Bars: how often now. Outline: before.", cls="said") if outline else None
    by_step = el("p", f"{section.by_step}.", cls="said") if section.by_step else None
    return join([table, legend, by_step])


def _metric(row: MetricRow, single: bool, remarks: bool, compared: bool, verified: bool) -> list[Child]:
    """The cells of a metric's row. single: there is one case; compared: with earlier values; verified: with errors by
    the step"""
    before = [row.before] if compared else []
    spread = [page_number(getattr(row.spread, column.field)) for column in SPREAD_COLUMNS]
    values = [*before, page_number(row.spread.median)] if single else [*spread, *before]
    values += [row.by_step] if verified else []
    return [
        el("th", el("code", breaking(row.name)), el("span", row.about, cls="under"), scope="row"),
        [el("td", value, cls="right") for value in values],
        el("td", row.unit),
        None if single else el("td", histogram(row)),
        el("td", row.remark) if remarks else None,
    ]


def histogram(row: MetricRow) -> Html | None:
    """Counts as bars, limits as lines; those of the earlier archive as an outline."""
    if not row.bars:
        return None
    top, wide = max(row.bars + row.bars_before), 160 / len(row.bars)
    bars = [
        el(
            "rect",
            x=f"{n * wide:.2f}",
            y=f"{26 - 24 * count / top:.2f}",
            width=f"{wide - 0.6:.2f}",
            height=f"{24 * count / top:.2f}",
            cls="count",
        )
        for n, count in enumerate(row.bars)
        if count
    ]
    limits = []
    for limit in row.limits:
        x = f"{160 * (limit - row.low) / (row.high - row.low):.2f}"
        limits.append(el("line", x1=x, x2=x, y1=0, y2=28, cls="limit"))
    before = ""
    for n, count in enumerate(row.bars_before):
        y = f"{26 - 24 * count / top:.2f}"
        before += f"{'L' if n else 'M'}{n * wide:.2f} {y}H{(n + 1) * wide - 0.6 * (n + 1 == len(row.bars)):.2f}"
    outline = el("path", d=before, cls="before") if before else None
    low, high, middle = (page_number(value) for value in (row.spread.minimum, row.spread.maximum, row.spread.median))
    words = f"{row.name} from {low} to {high} {row.unit}, median {middle}"
    floor = el("line", x1=0, x2=160, y1=26.5, y2=26.5, cls="floor")
    return el("svg", bars, floor, outline, limits, cls="histogram", viewBox="-1 0 162 28", role="img", aria_label=words)


def headings(names: Iterable[Child], right: Container[int] = ()) -> list[Html]:
    """The headings of a table's columns. right: the columns of numbers, which are flush right"""
    return [el("th", name, scope="col", cls="right" if n in right else None) for n, name in enumerate(names)]


def rows_under(heads: Sequence[Html], rows: Sequence[Html], label: str, cls: str | None = None) -> Html:
    """A table of rows under its headings. label: of the table, for those who do not see it"""
    return scrolling(el("table", el("thead", el("tr", heads)), el("tbody", lines(rows)), cls=cls), label)


def scrolling(table: Html, label: str) -> Html:
    """A table that scrolls within a narrower page, also by the keyboard."""
    return el("div", table, cls="wide", tabindex=0, role="region", aria_label=label)
