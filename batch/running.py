"""`met run` from end to end: read, say what will run, run it, say what came of it and where it is."""

from __future__ import annotations

import json as json_module
import sys
from pathlib import Path
from typing import Any

from batch.archive.read import ArchiveFile
from batch.campaign import Campaign, Part, perform, prepare, quoted, size_text
from batch.progress import Bar, duration
from batch.show import verdict
from batch.structures import structures
from batch.summary import Summary, as_json, summarise
from met.diagnostic import Problem
from met.frozen import frozen
from met.plan import Plan

WORST = 3
"""Cases of a sweep that the verdict names."""

MOST_GROUPS = 4
"""Structures of a sweep that are told of in full; of more, the table alone, and what failed."""


def run_and_tell(
    source: str,
    names: tuple[str, ...] = (),
    *,
    everything: bool = False,
    output: str | None = None,
    cases: tuple[str, ...] = (),
    histories: Any = "default",
    threads: int | None = None,
    no_picture: bool = False,
    defines: tuple[str, ...] = (),
    include_dirs: tuple[str, ...] = (),
    quiet: bool = False,
    verbose: bool = False,
    json: bool = False,
) -> bool:
    """Run a deck or a plan; True where every case reached its end and met its requirements."""
    say = (lambda *_: None) if quiet or json else print
    plan = read_plan(
        source, names, everything=everything, defines=defines, include_dirs=include_dirs, quiet=quiet or json
    )
    campaign = prepare(plan, output=output, experiments=names or None, cases=cases or None, histories=histories)
    say("\n".join(announcement(campaign, verbose, notes=verbose or is_plan(source))))
    timings = perform(
        campaign, threads=threads, progress=None if quiet or json else Bar(), ready=lambda: say(writing(campaign))
    )
    with ArchiveFile(campaign.output) as file:
        summaries = summarise(file)
        worst = worst_cases(file)
        tables = list(structures(file))
        picture, excuse = (None, "") if no_picture else first_picture(file)
    ok = all(summary.ok for summary in summaries)
    if json:
        print(verdict_json(campaign, summaries, worst, picture, timings, ok))
    else:
        say("\n".join(told(source, campaign, summaries, worst, picture, excuse, timings, ok, tables)))
    return ok


def read_plan(
    source: str,
    names: tuple[str, ...] = (),
    *,
    everything: bool = False,
    defines: tuple[str, ...] = (),
    include_dirs: tuple[str, ...] = (),
    quiet: bool = False,
) -> Plan:
    """The plan of a deck, or in a plan file. Warnings go to stderr; errors are a Problem."""
    if is_plan(source):
        from met import plan_file

        return plan_file.read(source)
    import ic
    from ic.find import find

    select: Any = "all" if everything else names or None
    find(source, include_dirs)  # a misspelt name is told with the one that was probably meant
    compiled = ic.check(source, include_dirs=include_dirs, defines=defines, select=select)
    if compiled.plan is None:
        raise Problem(compiled.diagnostics, compiled.sources)
    if compiled.diagnostics and not quiet:
        from met import render

        colour = render.wants_colour(sys.stderr)
        print(render.render(compiled.diagnostics, compiled.sources, colour=colour), file=sys.stderr)
    return compiled.plan


def is_plan(source: str) -> bool:
    """Whether a name is that of a plan file rather than a deck's."""
    return Path(source).suffix == ".json"


def first_picture(archive: ArchiveFile) -> tuple[Path | None, str]:
    """The picture beside an archive; where there can be none, why not, in words."""
    from batch.plot import plot

    try:
        return plot(archive, archive.path.with_suffix(".png")), ""
    except Problem as problem:
        return None, problem.diagnostics[0].message


# What is said before


def announcement(campaign: Campaign, verbose: bool = False, *, notes: bool = False) -> list[str]:
    """What will run, and what will be kept. notes: those of the plan as well, which `met plan` prints."""
    out = []
    for part in campaign.parts:
        out += _part_lines(part, verbose)
        out += [f"  note: {note}" for note in part.experiment.notes] if notes else []
    out += [f"note: {note}" for note in campaign.notes]
    return out


def writing(campaign: Campaign) -> str:
    """Where the archive will be, and how large: said once there is a kernel to fill it."""
    return f"writing {campaign.output}, about {size_text(campaign.bytes)}"


def _part_lines(part: Part, verbose: bool) -> list[str]:
    experiment = part.experiment
    schedule = experiment.structure.schedule
    count, whole = len(part.rows), experiment.cases.count
    cases = f"{count:,} case{'s' if count != 1 else ''}" + (f" of {whole:,}" if count < whole else "")
    if count == 1 and whole > 1:
        of = f"`{experiment.sweep}`" if experiment.sweep else f"{whole:,}"
        cases = f"case #{experiment.cases.table[part.rows[0]]} of {of}"
    steps = schedule.ticks // schedule.dynamics
    out = [
        f"{experiment.name}: {cases}, {schedule.duration:g} s in {steps:,} steps of {1e3 * schedule.step:g} ms, "
        f"{experiment.structure.integrator}"
    ]
    recorded = ", ".join(recorded.name for recorded in experiment.structure.record)
    if part.recorded:
        each = size_text(experiment.structure.history_bytes)
        out.append(f"  histories: {recorded}; {schedule.rows:,} rows, {each} a case")
    else:
        out.append("  histories: none" + (f" (would be {recorded})" if recorded else ""))
    for coordinate in experiment.cases.coordinates if verbose else ():
        out.append(f"  varied: {coordinate.path} ({', '.join(coordinate.sets)})")
    return out


# What is said after


@frozen
class Worst:
    """The worst cases of a sweep: as lines, for programs, and the row of the first."""

    lines: tuple[str, ...] = ()
    rows: tuple[dict[str, Any], ...] = ()

    @property
    def first(self) -> str:
        return f"#{self.rows[0]['row']}"


def worst_cases(archive: ArchiveFile) -> tuple[Worst, ...]:
    """Of every experiment; none where there is one case, or nothing by which one would be worse than another."""
    from batch import cases

    out = []
    for group in archive.groups:
        rows = tuple(cases.rows_json(group, WORST))
        judged = any(row["met"] or row["status"] == "failed" for row in rows)
        lines = (cases.title(group, WORST), *cases.table(group, WORST, hint=False)) if judged else ()
        out.append(Worst(lines, rows if judged else ()) if group.count > 1 else Worst())
    return tuple(out)


def told(
    source: str, campaign: Campaign, summaries: tuple[Summary, ...], worst: tuple[Worst, ...], picture: Path | None,
    excuse: str, timings: list[dict[str, Any]], ok: bool, tables: list[list[str]],
) -> list[str]:  # fmt: skip
    """The verdict, and where everything is. tables: of sweeps of several structures."""
    out: list[str] = []
    many = {s.sweep for s in summaries if sum(s.sweep == other.sweep for other in summaries) > MOST_GROUPS} - {""}
    for summary, cases, timing in zip(summaries, worst, timings, strict=True):
        lines = verdict(summary, 100)
        if summary.sweep in many:
            if summary.failed:
                out += ["", f"{summary.name}: {lines[0]}", *lines[1 : 1 + len(summary.failures)]]
            continue
        name = f"{summary.name}: " if len(summaries) > 1 else ""
        out += ["", f"{name}{lines[0]}, in {duration(timing['seconds'])}", *lines[1:]]
        out += ["", *cases.lines] if cases.lines else []
    out += [line for table in tables for line in ("", *table)]
    path = campaign.output
    out += ["", f"archive  {path}  ({size_text(path.stat().st_size)})"]
    if picture is not None:
        out.append(f"picture  {picture}")
    elif excuse:
        out.append(f"picture  none: {excuse}")
    out.append(f"next     met show {quoted(path)}")
    for summary, cases in zip(summaries, worst, strict=True):
        if cases.rows and summary.sweep not in many:
            only = f" --run {quoted(summary.name)}" if len(summaries) > 1 else ""
            out.append(f"         met show {quoted(path)}{only} --case '{cases.first}'")
    if not any(summary.recorded for summary in summaries) and campaign.parts[0].experiment.structure.record:
        out.append(f"         met run {quoted(source)} {summaries[0].name} --case '#0'")
    if not ok:
        out.append(f"exit 1: {_why_not(summaries)}")
    return out


def _why_not(summaries: tuple[Summary, ...]) -> str:
    failed = sum(summary.failed for summary in summaries)
    missed = [r for summary in summaries for r in summary.requirements if r.met < summary.cases]
    parts = [f"{failed:,} case{'s' if failed != 1 else ''} failed"] if failed else []
    if missed:
        parts.append("not met everywhere: " + ", ".join(dict.fromkeys(r.text for r in missed)))
    return "; ".join(parts)


def verdict_json(
    campaign: Campaign, summaries: tuple[Summary, ...], worst: tuple[Worst, ...], picture: Path | None,
    timings: list[dict[str, Any]], ok: bool,
) -> str:  # fmt: skip
    """The verdict for programs."""
    data = {
        "ok": ok,
        "archive": str(campaign.output),
        "picture": None if picture is None else str(picture),
        "notes": list(campaign.notes),
        "experiments": [
            {**as_json(summary), "worst": list(cases.rows), "seconds": timing["seconds"]}
            for summary, cases, timing in zip(summaries, worst, timings, strict=True)
        ],
    }
    return json_module.dumps(data, indent=1)
