"""A report as one HTML file. It includes style, scripts and data, and its policy forbids everything else."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from batch.arms.look import arm_style
from batch.report.contents.parts import DesignAnswer, Report, ReportSection
from batch.report.html import blocks, changes, designs, inlined, tables
from batch.report.html.inlined import page_head
from batch.report.html.markup import Child, Html, el, join, lines
from batch.report.html.payload import modules_script, script_json, section_data
from ic.printing.columns import count

GENERATOR = "MET report"
"""The name in a page's `generator` that marks it as MET's, so that it may be overwritten."""


CODE = "'wasm-unsafe-eval'"
"""A further source of code for a page that runs cases again: WebAssembly modules, which are in its script."""


def page(report: Report) -> str:
    """The whole file; equal reports give equal text."""
    anchors = {file.name: (n, file.text.count("\n") + 1) for n, file in enumerate(report.sources)}
    running = any(section.simulation for section in report.sections)
    style = f"{inlined.style()}\n{arm_style()}" if running else inlined.style()
    script = inlined.script(modules_script(report.sections) if running else "")
    head = page_head(report.title, generator=GENERATOR, style=style, script=script, allowed=CODE if running else "")
    data = [
        el(
            "script",
            script_json(section_data(section, _replay(report, section), report.changes)),
            type="application/json",
            id=f"d{n}",
        )
        for n, section in enumerate(report.sections)
    ]
    body = lines(
        [
            el("a", "To the report", href="#main", cls="skip"),
            _header(report),
            el("main", lines([*_main(report, anchors)]), id="main"),
            _footer(report),
            el("div", id="tip", role="status", hidden=True),
            *data,
            Html(f"<script>{script}</script>"),
        ]
    )
    return f'<!DOCTYPE html>\n<html lang="en">\n<head>\n{head}\n</head>\n<body>\n{body}\n</body>\n</html>\n'


def _replay(report: Report, section: ReportSection) -> str:
    """The command that runs a case of a section again, with `#CASE` where its number goes."""
    if section.worst is None:
        return report.replay.rpartition("#")[0] + "#CASE'"
    return section.worst.commands[0].rpartition("#")[0] + "#CASE'"


def _header(report: Report) -> Html:
    """The head of the page: title, summary, and links to its sections."""
    lede = report.sections[0].lede if len(report.sections) == 1 else f"{len(report.sections)} runs and sweeps."
    links = [
        *([("changed", "What changed")] if report.changes is not None else []),
        ("verdict", _verdict_name(report)),
        *(link for n, section in enumerate(report.sections) for link in _links(n, section, report)),
        ("parameters", "Parameters"),
        ("provenance", "Provenance"),
    ]
    if report.chosen_design is not None:
        links.sort(key=lambda link: link[0] != "s0-designs")
    items = [el("li", el("a", name, href=f"#{where}")) for where, name in links]
    return el(
        "header",
        el("p", "Simulation report · ", el("span", _about(report)), cls="kicker"),
        el("h1", report.title),
        el("p", lede, cls="lede"),
        el("nav", el("ul", items), aria_label="Contents"),
    )


def _about(report: Report) -> str:
    if report.changes is None:
        return report.deck
    return f"{report.deck} · {report.changes.now} against {report.changes.before}"


def _links(number: int, section: ReportSection, report: Report) -> list[tuple[str, str]]:
    """The places and names of a section's parts, for the page's menu."""
    if len(report.sections) > 1:
        return [(f"s{number}", section.name)]
    links = [
        ("designs", "" if section.designs is None else section.designs.link, section.designs is not None),
        ("evidence", "Evidence", section.evidence is not None),
        ("best", "Best cases", section.best is not None),
        ("worst", "Worst cases", section.worst is not None),
        ("overview", "Cases", section.overview is not None),
        ("signals", _signals_name(section), section.signals is not None),
        ("influence", "Which parameters matter", bool(section.influences)),
        ("structures", "Structures", section.structures is not None),
        ("stability", "Stability", section.stability is not None),
        ("run", "What was run", True),
    ]
    links.sort(key=lambda link: section.single and link[0] != "signals")
    return [(f"s{number}-{key}", name) for key, name, is_present in links if is_present]


def _verdict_name(report: Report) -> str:
    """The heading of the verdict: where a sweep chose a design it is about all candidates, of which some may be bad."""
    chosen = report.chosen_design
    if chosen is None or not chosen.command or report.verdicts[0].kind != "requirements":
        return "Verdict"
    return "All that was tried" if report.verdicts[0].good < report.verdicts[0].cases else "Verdict"


def _signals_name(section: ReportSection) -> str:
    """The heading of a section's signals, which may have a drawn arm."""
    page_simulation = section.simulation
    drawn = page_simulation is not None and any(
        structure.arm.scene is not None for structure in page_simulation.structures
    )
    return "Arm and signals" if drawn else "Signals"


def _main(report: Report, anchors: blocks.Anchors) -> Sequence[Child]:
    """The page in its order: the design to use, what changed, verdicts, sections, parameters and provenance."""
    several = len(report.sections) > 1
    first, name = report.chosen_design, _verdict_name(report)
    tried = name != "Verdict"
    out: list[Child] = [] if first is None else [_designs(0, first, "h2")]
    if report.changes is not None:
        compared = [
            blocks.comparison(verdict, changes.parameters(report.changes), report.again)
            for verdict in report.verdicts
            if verdict.kind == "comparison"
        ]
        out.append(el("section", el("h2", "What changed"), compared, changes.origins(report.changes), id="changed"))
    own = [verdict for verdict in report.verdicts if verdict.kind != "comparison"]
    again = "" if report.changes is not None or (first is not None and first.command) else report.again[0]
    answers = [blocks.verdict(verdict, anchors, tried=tried, again="" if n else again) for n, verdict in enumerate(own)]
    out.append(el("section", el("h2", name, cls="" if tried else "quiet"), answers, id="verdict"))
    for number, section in enumerate(report.sections):
        shown_section = section if first is None else replace(section, designs=None)
        parts = lines(_section(number, shown_section, anchors, "h3" if several else "h2"))
        if several:
            head = [el("h2", section.name), el("p", section.lede, cls="lede")]
            out.append(el("section", head, parts, id=f"s{number}", cls="whole", data_section=number))
        else:
            out.append(el("div", parts, data_section=number))
    out.append(_parameters(report, anchors))
    out.append(
        el(
            "section",
            el("h2", "Provenance"),
            blocks.facts(report.provenance),
            [tables.source(n, file) for n, file in enumerate(report.sources)],
            id="provenance",
        )
    )
    return out


def _section(number: int, section: ReportSection, anchors: blocks.Anchors, head: str) -> Iterator[Child]:
    """The parts of a run or sweep, in the order of the page. head: the element of their headings"""

    def part(key: str, name: str, *children: Child, about: str = "") -> Html:
        paragraph = el("p", about, cls="said") if about else None
        return el("section", el(head, name), paragraph, *children, id=f"s{number}-{key}", cls=key)

    if section.changes:
        yield (
            el(
                "section",
                [changes.run_changes(change) for change in section.changes],
                id=f"s{number}-compared",
                cls="compared",
            )
        )
    if section.designs is not None:
        yield _designs(number, section.designs, head)
    if section.signals is not None:
        run_again = section.simulation.notes if section.simulation is not None else ()
        notes = [el("p", note, cls="said") for note in (*section.signals.notes, *run_again)]
        arm = el("div", cls="arm", data_plot="arm") if section.simulation is not None else None
        plots = el("div", cls="signals plot", data_plot="signals")
        drawn = [part("signals", _signals_name(section), arm, plots, notes)]
    else:
        drawn = [part("signals", "Signals", about=section.no_signals)]
    yield from drawn if section.single else []
    if section.evidence is not None:
        yield part("evidence", "Evidence", tables.evidence(section.evidence))
    if section.best is not None:
        yield part("best", section.best.title, tables.cases(section.best), about=ABOUT_BEST)
    if section.worst is not None:
        yield part("worst", section.worst.title, tables.cases(section.worst))
    table = blocks.metrics(section)
    if section.overview is not None:
        yield (
            part(
                "overview",
                "Cases at a glance",
                table,
                el("div", cls="points plot", data_plot="points"),
                el("p", section.overview.note, cls="said") if section.overview.note else None,
                el("div", cls="card", data_plot="card"),
                el("div", cls="map plot", data_plot="map") if section.overview.maps else None,
            )
        )
    elif table is not None:
        yield part("overview", "Metrics", table)
    yield from [] if section.single else drawn
    if section.influences:
        influences = [tables.influence(influence) for influence in section.influences]
        yield part("influence", "Which parameters matter", influences, about=ABOUT_INFLUENCE)
    if section.structures is not None:
        yield part("structures", "Structures side by side", tables.table(section.structures, "Structures"))
    if section.stability is not None:
        stability = section.stability
        yield (
            part(
                "stability",
                "Stability of the beds",
                el("p", ABOUT_STABILITY, cls="said"),
                tables.beds(stability),
                [el("p", note, cls="note") for note in stability.unstable],
                el("div", cls="stability plot", data_plot="stability"),
                el("p", stability.note, cls="said") if stability.note else None,
            )
        )
    yield (
        part(
            "run",
            "What was run",
            blocks.facts(section.facts),
            blocks.varied(section.varied, anchors),
            _notes(section.notes),
        )
    )
    if section.trouble:
        words = f"Parameters and stability are not shown, for the plan could not be read here: {section.trouble}."
        yield el("p", words, cls="note")


def _designs(number: int, answer: DesignAnswer, head: str) -> Html:
    return el("section", el(head, answer.heading), designs.designs(answer), id=f"s{number}-designs", cls="designs")


def _notes(notes: Sequence[str]) -> Html | None:
    if not notes:
        return None
    return el(
        "details",
        el("summary", f"{count(len(notes), 'note')} of the compiler"),
        [el("p", note) for note in notes],
        cls="notes",
    )


ABOUT_BEST = "Those that meet all that is required and stay furthest from the limit that is nearest to them."

ABOUT_INFLUENCE = (
    "The shares of each metric's variance that a varied parameter explains, alone and with others. A bar goes from the "
    "metric's mean to what it is where the parameter is lowest (dark), and where it is highest (light)."
)

ABOUT_STABILITY = (
    "r is how heavy the arm is at the joint against the rotor of its motor, J_eff/(N² J_m), at the start of the run. "
    "The loop of bed, servo and law is stable at the r of the table. Each row of it is its tightest case."
)


def _parameters(report: Report, anchors: blocks.Anchors) -> Html:
    """The parameters of all sections, folded, with a field to search them."""
    out: list[Child] = [el("h2", "Parameters")]
    for number, section in enumerate(report.sections):
        if not section.parameters:
            continue
        words = f"{len(section.parameters):,} parameters and settings"
        of_section = f" of {section.name}" if len(report.sections) > 1 else ""
        search = el(
            "label",
            "Search ",
            el(
                "input",
                type="search",
                cls="search",
                placeholder="kp, links.upper, default",
                spellcheck="false",
                autocomplete="off",
            ),
            cls="controls",
        )
        out.append(
            el(
                "details",
                el("summary", f"{words}{of_section}, each with the line of the deck that wrote it"),
                search,
                tables.parameters(section.parameters, anchors),
                el("p", role="status", cls="said found"),
                cls="all",
                id=f"p{number}",
            )
        )
    if len(out) == 1:
        out.append(el("p", "The plan could not be read here.", cls="said"))
    return el("section", out, id="parameters")


def _footer(report: Report) -> Html:
    """The foot of the page, which says what made it."""
    against = None if report.changes is None else [" against ", el("code", report.changes.before)]
    words = join(
        [
            "Made by ",
            el("code", "met report"),
            " from ",
            el("code", report.archive),
            against,
            ". The page is whole in this file and asks nothing of any network.",
        ]
    )
    scripts = el("noscript", el("p", "The plots need JavaScript; all tables are here without.", cls="note"))
    return el("footer", el("p", words), scripts)
