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


def share(part: int, of: int) -> str:
    """The share in per cent; 100 and 0 are shown only for all and none."""
    if part in (0, of) or of == 0:
        return "100 %" if part and part == of else "0 %"
    text = f"{100 * part / of:.3g}"
    return "> 99.9 %" if text == "100" else f"{text} %" if 100 * part / of >= 0.1 else "< 0.1 %"


def bar(parts: Sequence[tuple[str, int]], label: str) -> Html:
    """Shares as a bar: class and count of each part, from left to right."""
    total = sum(count for _, count in parts) or 1
    rects, at = [], 0.0
    for cls, count in parts:
        width = 100.0 * count / total
        if count:
            rects.append(el("rect", x=f"{at:.3f}", y=0, width=f"{width:.3f}", height=8, cls=cls))
        at += width
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


def verdict(found: Verdict, anchors: Anchors, *, tried: bool = False, again: str = "") -> Html:
    """The answer, large, beside its grounds and doubts. tried: it is of all candidates, and neither yes nor no; again:
    the command that runs all again, if it is to be here"""
    yes, no = (found.word, found.word) if found.kind == "answer" else _words(found)
    answer = el(
        "div",
        el("p", found.about, cls="about") if found.about else None,
        None if tried else el("p", mark(found.ok), yes if found.ok else no, cls="word"),
        el("p", share(found.good, found.cases), cls="share") if found.cases > 1 else None,
        el("p", found.headline, ".", cls="headline"),
        _again("Run it again:", [again]) if again else None,
        cls="answer",
    )
    evidence = [_parts(found) if found.cases > 1 else None, _demands(found)]
    if found.failing:
        evidence.append(_failing(found.failing, single=found.cases == 1))
    evidence += [_warning(warning, anchors) for warning in found.warnings]
    evidence += [el("p", note, cls="note") for note in found.notes]
    kind = "" if tried else " yes" if found.ok else " no"
    return el("div", answer, el("div", evidence, cls="evidence"), cls=f"verdict{kind}")


def command(words: str) -> Html:
    """A command line, and a button that copies it."""
    button = el("button", "copy", type="button", cls="copy", data_copy=words, aria_label=f"Copy {words}")
    return join([button, " ", el("code", words)])


def _again(words: str, commands: Sequence[str]) -> Html:
    return join([el("p", words, cls="said"), *(el("p", command(each), cls="command") for each in commands)])


def _words(found: Verdict) -> tuple[str, str]:
    """The answer in two words, for yes and for no."""
    if not found.demands:
        return NOTHING_ASKED
    of_all = {"demonstrated", "not shown", "refuted"}  # cases that may be drawn
    return ALL_SHOWN if any(demand.verdict in of_all for demand in found.demands) else ALL_MET


def _warning(each: ReportWarning, anchors: Anchors) -> Html:
    """A warning beside the verdict: the finding, the line of the deck, and the remedies."""
    place = spot_link(each.spot, anchors)
    return el(
        "div",
        el(
            "p",
            el("strong", f"Warning {each.code}"),
            [", ", place] if place is not None else None,
            ": ",
            each.message,
            ".",
        ),
        [el("p", help, cls="under") for help in each.help],
        cls="note warning",
    )


def mark(ok: bool) -> Html:
    """A tick or a cross, before the word of the same meaning."""
    return _drawn("M3 8.5l3.2 3.2L13 4.6" if ok else "M4 4l8 8M12 4l-8 8")


def _drawn(path: str) -> Html:
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


def comparison(found: Verdict, changed: Sequence[Child], again: Sequence[str]) -> Html:
    """The share of cases that meet all requirements, before and now, with what changed; the number of differing cases;
    gains and losses of each requirement.

    changed  the lines about the parameters that differ;  again: the commands that run both archives again
    """
    figure: list[Child] = []
    if found.figure is not None:
        was, now, of = found.figure
        text = share(now, of) if was == now else [share(was, of), el("span", " → ", cls="to"), share(now, of)]
        said = f"of the {of:,} cases in both meet all{', as before' if was == now else ''}"
        figure = [el("p", text, cls="share two"), el("p", said, cls="under")]
    answer = el(
        "div",
        el("p", found.about, cls="about"),
        el("p", likeness(found.word), found.word.capitalize(), cls="word"),
        figure,
        el("p", found.headline, ".", cls="headline") if found.headline else None,
        _again("Run both again:", again),
        changed,
        cls="answer",
    )
    parts = [(*SHARES.get(part.word, ("other", part.word)), part.count) for part in found.parts]
    moves = [*found.flows, *([found.ends] if found.ends is not None else [])]
    apart = [_moves(moves, better=better) for better in (True, False)] if moves else []
    evidence = [_bar_of(parts) if found.cases > 1 else None, apart, _flows(found.flows)]
    return el("div", answer, el("div", evidence, cls="evidence"), cls="verdict against")


def _flows(found: Sequence[RequirementFlow]) -> Html | None:
    if not found:
        return None
    rows = [
        el("tr", el("th", el("code", breaking(each.text)), scope="row"), el("td", each.met, cls="words"))
        for each in found
    ]
    return rows_under(headings(("requirement", "cases in both")), rows, "Requirements, before and now")


def _moves(found: Sequence[RequirementFlow], *, better: bool) -> Html:
    """The requirements with better, or worse, values in some case: a row for each."""
    rows = []
    for each in found:
        crossed, moved = (each.gained, each.better) if better else (each.lost, each.worse)
        if not crossed and moved is None:
            continue
        furthest: Child = "–"
        if moved is not None:
            values = f" {moved.before} → {moved.now} {moved.unit}".rstrip()
            furthest = [case_link(moved.case), values]
        rows.append(
            el(
                "tr",
                el("th", el("code", breaking(each.text)), scope="row"),
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


def _parts(found: Verdict) -> Html:
    order = {"met": "good", "done": "good", "missed": "bad", "unknown": "open"}
    return _bar_of(
        [(order.get(part.word, "lost"), WORDS.get(part.word, part.word), part.count) for part in found.parts]
    )


def _bar_of(parts: Sequence[tuple[str, str, int]]) -> Html:
    """Numbers of cases as a bar over its legend: class, word and count of each part."""
    words = [(cls, f"{count:,} {word}") for cls, word, count in parts]
    legend = el("ul", [el("li", el("span", cls=f"key {cls}"), text) for cls, text in words], cls="legend")
    return join([bar([(cls, count) for cls, _, count in parts], "; ".join(text for _, text in words)), legend])


def _demands(found: Verdict) -> Html | None:
    if not found.demands:
        return None
    if found.kind == "answer":
        return _answered(found.demands)
    single = found.cases == 1
    missed = not single and any(demand.missed for demand in found.demands)
    unknown = not single and any(demand.unknown for demand in found.demands)
    shares = not single and any(demand.verdict for demand in found.demands)
    heads = [
        "requirement",
        *(["outcome"] if single else ["met by", "yield"]),
        *(["verdict"] if shares else []),
        *(["missed"] if missed else []),
        *(["not known"] if unknown else []),
        "value" if single else "worst value",
    ]
    rows = [el("tr", _demand(demand, single, shares, missed, unknown)) for demand in found.demands]
    right = {n for n, head in enumerate(heads) if head not in ("requirement", "outcome", "verdict")}
    return rows_under(headings(heads, right), rows, "Requirements")


def _answered(found: Sequence[RequirementCounts]) -> Html:
    """The requirements in the cases of a search's answer."""
    rows = [
        el(
            "tr",
            el("th", el("code", breaking(each.text)), scope="row"),
            el("td", mark(each.ok), each.verdict, cls="good words" if each.ok else "bad words"),
            el("td", each.furthest, [" ", case_link(each.case)] if each.case is not None else None, cls="right"),
        )
        for each in found
    ]
    heads = headings(("requirement", "outcome", "worst value of the answer"), right={2})
    return rows_under(heads, rows, "Requirements")


def _demand(each: RequirementCounts, single: bool, shares: bool, missed: bool, unknown: bool) -> list[Html | None]:
    name = el("th", el("code", breaking(each.text)), scope="row")
    if single:
        word = "met" if each.met else "missed" if each.missed else "not known"
        return [
            name,
            el("td", mark(word == "met") if word != "not known" else None, word, cls="good" if each.met else "bad"),
            el("td", each.furthest, cls="right"),
        ]
    far: Child = each.furthest
    if each.case is not None:
        far = [each.furthest, " ", case_link(each.case)]
    return [
        name,
        el("td", f"{each.met:,} of {each.of:,}", cls="right"),
        el("td", share(each.met, each.of), cls="right strong"),
        _share_verdict(each) if shares else None,
        el("td", f"{each.missed:,}" if each.missed else "–", cls="right bad" if each.missed else "right")
        if missed
        else None,
        el("td", f"{each.unknown:,}" if each.unknown else "–", cls="right") if unknown else None,
        el("td", far, cls="right"),
    ]


def _share_verdict(each: RequirementCounts) -> Html:
    """The verdict on a requirement over a share of cases, with its bound; empty for one on every case."""
    if not each.verdict:
        return el("td", "–")
    ok = each.verdict in ("met", "demonstrated")
    bound = el("span", each.bound, cls="under") if each.bound else None
    return el("td", mark(ok), each.verdict, bound, cls="good" if ok else "bad")


def case_link(case: int) -> Html:
    """A case by its number, as a button that chooses it where there are scripts."""
    return el("button", f"#{case}", type="button", cls="case", data_case=case, title=f"Choose case #{case}")


def _failing(found: Sequence[FailureRow], *, single: bool) -> Html:
    """The causes of failures, with the cases of each, and their common properties once."""
    rows = []
    for each in found:
        who: Child = f"case #{each.first}" if each.count == 1 else f"{each.count:,} cases"
        rows.append(
            el(
                "li",
                el("p", el("strong", "The case" if single else who, " ", each.status), " ", el("span", each.cause)),
                el("p", each.cases, cls="cases") if each.count > 1 else None,
            )
        )
    return join([el("h4", "Why" if single else "Did not reach their end"), el("ul", rows, cls="failing")])


# What was run


def facts(found: Sequence[Fact]) -> Html:
    return el(
        "dl",
        [el("div", el("dt", fact.name), el("dd", el("code", fact.text) if fact.code else fact.text)) for fact in found],
        cls="facts",
    )


def varied(found: Sequence[VariedParameter], anchors: Anchors) -> Html | None:
    if not found:
        return None
    decides = any(each.sets for each in found)
    rows = [
        el(
            "tr",
            el("th", el("code", breaking(each.path)), scope="row"),
            el("td", each.text, cls="words"),
            el("td", each.unit),
            el("td", _sets(each.sets)) if decides else None,
            el("td", spot_link(each.spot, anchors)),
        )
        for each in found
    ]
    heads = ("varied", "values", "unit", *(["decides"] if decides else []), "written in")
    return rows_under(headings(heads), rows, "What was varied")


def _sets(paths: Sequence[str]) -> list[Child]:
    shown = [part for path in paths[:3] for part in (", ", el("code", path))][1:]
    return [*shown, f" and {len(paths) - 3} more" if len(paths) > 3 else None]


def metrics(section: ReportSection) -> Html | None:
    """The table of metrics, each with its spread, and the shape of it."""
    if not section.metrics:
        return None
    compared = any(metric.before for metric in section.metrics)
    values = [*(each.page_head for each in SPREAD_COLUMNS), *(["median before"] if compared else [])]
    if section.single:
        values = ["before", "now"] if compared else ["value"]
    verified = any(metric.by_step for metric in section.metrics)
    values += ["± by the step"] if verified else []
    heads = ["metric", *values, "unit"]
    heads += [] if section.single else ["how often"]
    remarks = any(metric.remark for metric in section.metrics)
    heads += [""] if remarks else []
    rows = [el("tr", _metric(metric, section.single, remarks, compared, verified)) for metric in section.metrics]
    made = rows_under(
        headings(heads, range(1, len(values) + 1)), rows, "Metrics", cls="few" if section.single else None
    )
    outline = any(metric.bars_before for metric in section.metrics)
    said = el("p", "Bars: how often now. Outline: before.", cls="said") if outline else None
    by_step = el("p", f"{section.by_step}.", cls="said") if section.by_step else None
    return join([made, said, by_step])


def _metric(each: MetricRow, single: bool, remarks: bool, compared: bool, verified: bool) -> list[Html]:
    before = [each.before] if compared else []
    spread = [page_number(getattr(each.spread, column.field)) for column in SPREAD_COLUMNS]
    values = [*before, page_number(each.spread.median)] if single else [*spread, *before]
    values += [each.by_step] if verified else []
    cells = [el("th", el("code", breaking(each.name)), el("span", each.about, cls="under"), scope="row")]
    cells += [el("td", value, cls="right") for value in values]
    cells.append(el("td", each.unit))
    if not single:
        cells.append(el("td", histogram(each)))
    return [*cells, el("td", each.remark)] if remarks else cells


def histogram(each: MetricRow) -> Html | None:
    """Counts as bars, limits as lines; those of the earlier archive as an outline."""
    if not each.bars:
        return None
    top, wide = max(each.bars + each.bars_before), 160 / len(each.bars)
    bars = [
        el(
            "rect",
            x=f"{n * wide:.2f}",
            y=f"{26 - 24 * count / top:.2f}",
            width=f"{wide - 0.6:.2f}",
            height=f"{24 * count / top:.2f}",
            cls="count",
        )
        for n, count in enumerate(each.bars)
        if count
    ]
    limits = []
    for limit in each.limits:
        at = f"{160 * (limit - each.low) / (each.high - each.low):.2f}"
        limits.append(el("line", x1=at, x2=at, y1=0, y2=28, cls="limit"))
    before = ""
    for n, count in enumerate(each.bars_before):
        y = f"{26 - 24 * count / top:.2f}"
        before += f"{'L' if n else 'M'}{n * wide:.2f} {y}H{(n + 1) * wide - 0.6 * (n + 1 == len(each.bars)):.2f}"
    outline = el("path", d=before, cls="before") if before else None
    low, high, middle = (page_number(value) for value in (each.spread.minimum, each.spread.maximum, each.spread.median))
    words = f"{each.name} from {low} to {high} {each.unit}, median {middle}"
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
