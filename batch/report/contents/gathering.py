"""Gathering of a report's contents from an archive, as plain data."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path, PurePath
from typing import Any

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.queries.pool import Pool, by_run, groups_named, pools
from batch.queries.signals import DeckUnits, written_plan
from batch.queries.step_errors.figures import about as about_errors
from batch.queries.step_errors.figures import figures, together
from batch.report.contents import comparison
from batch.report.contents.against import ComparedArchive, EarlierCases, of_groups
from batch.report.contents.designs import design_answer
from batch.report.contents.histories import MOST_VALUES, WHERE_RUN_AGAIN, no_signals, signals
from batch.report.contents.overview import overview
from batch.report.contents.parameters import parameters, varied
from batch.report.contents.parts import Fact, Report, ReportSection, Signals, SourceListing, Stability
from batch.report.contents.simulation import MOST_STRUCTURES, ComputedGroup, simulation
from batch.report.contents.stability import stability
from batch.report.contents.tables import best, evidence_part, influences, replay, structures, worst
from batch.report.contents.verdicts import metric_rows, verdict
from ic.printing.columns import size as size_text
from met.diagnostic import Problem
from met.host.files import open_regular
from met.outputs import quoted
from met.plan import Experiment

MOST_LINES, MOST_LETTERS = 2000, 200_000
"""Largest number of lines, and of letters, of a deck file in a page."""

MOST_HASHED = 4 << 30
"""Largest size of an archive whose digest is computed."""

BEGINS = 200
"""Largest length of a title in letters; longer ones are cut."""


def gather(
    archive: ArchiveFile,
    names: Sequence[str] = (),
    title: str = "",
    progress: Callable[[int], None] | None = None,
    against: ComparedArchive | None = None,
    *,
    simulate: bool = False,
    meshes: bool = True,
) -> Report:
    """Gather all that a page says of an archive, or of these runs and sweeps of it. Raises Problem E325 for another
    name.

    progress  called with the number of cases whose margin is known, where motors are on beds
    against   another archive to compare with
    simulate  whether the page is to run cases again
    meshes    whether it draws links by their meshes
    """
    groups = groups_named(archive, names)
    pools_ = pools(groups)
    several = len(by_run(archive.groups)) > 1
    experiments, trouble = _experiments(archive)
    if against is not None and names:
        against = replace(against, differences=of_groups(against.differences, groups))
    name = archive.path.name if against is None else str(against.differences.b)
    share = MOST_VALUES // max(1, len(pools_))
    befores = [None if against is None else against.of(pool) for pool in pools_]
    sections = tuple(
        replace(
            _section(
                name,
                pool,
                pool.name if several else "",
                experiments,
                trouble,
                share,
                progress,
                before,
                archive,
                simulate,
                meshes,
            ),
            changes=() if against is None else comparison.run_changes(against.differences, before),
        )
        for pool, before in zip(pools_, befores, strict=True)
    )
    verdicts = [verdict(pool, experiments, named=len(pools_) > 1) for pool in pools_]
    if against is not None:
        verdicts.append(comparison.verdict(against, list(zip(pools_, befores, strict=True))))
    return Report(
        title=title[:BEGINS] or f"{_stem(archive.deck)} · {', '.join(pool.name for pool in pools_)}",
        archive=name,
        deck=archive.deck,
        replay=replay(name, pools_[0].name if several else "", int(pools_[0].cases[0]) if pools_[0].count else 0),
        verdicts=tuple(verdicts),
        sections=sections,
        sources=tuple(_sources(archive)),
        provenance=(*_provenance(archive, groups), *(() if against is None else _compared_with(against))),
        changes=None if against is None else comparison.archive_changes(against.differences),
        again=tuple(
            f"met run {quoted(path)} --all"
            for path in (name, *(() if against is None else [str(against.differences.a)]))
        ),
    )


def _stem(deck: str) -> str:
    """The name of a deck's file without its ending, `two_link`, for the title of a page."""
    return PurePath(deck.strip("<>")).stem or deck


def _experiments(archive: ArchiveFile) -> tuple[dict[str, Experiment], str]:
    """The plan's experiments by name; or none, and the reason."""
    try:
        return {experiment.name: experiment for experiment in archive.plan().experiments}, ""
    except Problem as problem:  # for instance, a model of the plan is not installed here
        return {}, "; ".join(diagnostic.message for diagnostic in problem.diagnostics)


def _section(
    archive: str,
    pool: Pool,
    only: str,
    experiments: Mapping[str, Experiment],
    trouble: str,
    values: int,
    progress: Callable[[int], None] | None,
    before: EarlierCases | None,
    file: ArchiveFile,
    simulate: bool,
    meshes: bool,
) -> ReportSection:
    """All that the page says of a run or sweep. only: its name in commands; values: the most numbers of histories"""
    own = {group.name: experiments[group.name] for group in pool.groups if group.name in experiments}
    beds: Stability | None = None
    rows: tuple[Any, ...] = ()
    try:
        rows = parameters(pool, own)
        beds = stability(pool, own, progress)
    except Problem as problem:
        trouble = trouble or "; ".join(diagnostic.message for diagnostic in problem.diagnostics)
    points = overview(pool, before)
    best_cases, worst_cases = best(pool, archive, only, before), worst(pool, archive, only, before)
    computed = {
        n: ComputedGroup(group, own[group.name])
        for n, group in enumerate(pool.groups[:MOST_STRUCTURES])
        if simulate and group.name in own
    }
    drawn, chosen = _signals(pool, file, before, values, computed), design_answer(file, pool)
    if drawn is not None and before is None and chosen is not None and chosen.case is not None:
        drawn = replace(drawn, opens=chosen.case)
    played = None
    if drawn is not None and computed:
        first = [
            *drawn.first_cases,
            *([] if drawn.opens is None else [drawn.opens]),
            *(case for notable in (best_cases, worst_cases) if notable is not None for case in notable.cases),
            *([] if before is None else before.most),
        ]
        played = simulation(pool, own, drawn, first, points, before, meshes=meshes)
    errors = together(map(figures, pool.groups))
    return ReportSection(
        name=pool.name,
        lede=_lede(pool),
        facts=tuple(_facts(pool, own)),
        varied=varied(pool, own),
        metrics=metric_rows(pool, before, errors),
        structures=structures(pool, before),
        evidence=evidence_part(pool, archive, several=bool(only)),
        designs=chosen,
        best=best_cases,
        worst=worst_cases,
        overview=points,
        signals=drawn,
        no_signals="" if drawn else no_signals(pool),
        simulation=played,
        stability=beds,
        parameters=rows,
        trouble=trouble,
        notes=tuple(dict.fromkeys(note for experiment in own.values() for note in experiment.notes)),
        single=pool.count == 1,
        by_step="" if errors is None else about_errors(errors),
        influences=influences(pool),
    )


def _signals(
    pool: Pool, file: ArchiveFile, before: EarlierCases | None, values: int, computed: Mapping[int, ComputedGroup]
) -> Signals | None:
    """The signals of a section, in the deck's units; fewer histories where all its cases can be run again."""
    recorded = any(group.recorded for group in pool.groups)
    plan = written_plan(file) if recorded or computed else None
    units = [DeckUnits(plan, group) for group in pool.groups] if plan is not None else []
    if before is None and len(computed) == len(pool.groups):
        values = min(values, WHERE_RUN_AGAIN)
    return signals(pool, values, before, units, computed)


# The run


def _all(pool: Pool, attribute: str, form: str = "{}") -> str:
    """An attribute of all groups, each value once."""
    return ", ".join(dict.fromkeys(form.format(group.attributes[attribute]) for group in pool.groups))


def _lede(pool: Pool) -> str:
    """A line on what was run: `37 cases of 20 s each: arm two_link, modified_euler at 25 Hz`."""
    table = sum(group.attributes["cases_in_table"] for group in pool.groups)
    cases = f"{pool.count:,} case{'s' if pool.count != 1 else ''}"
    if pool.count < table:
        most = "at most " * any("until_shown" in group.attributes for group in pool.groups)
        cases += f" of {most}{table:,}"
    length = f"{_all(pool, 'duration_s', '{:g} s')}{' each' if pool.count > 1 else ''}"
    kinds = f" in {len(pool.groups)} structures" if len(pool.groups) > 1 else ""
    how = f"{_all(pool, 'integrator')} at {_all(pool, 'dynamics_hz', '{:g} Hz')}"
    return (
        f"{cases}{kinds}, {length}. Arm {_all(pool, 'arm')}, {how}, recorded at {_all(pool, 'record_hz', '{:g} Hz')}."
    )


def _facts(pool: Pool, experiments: Mapping[str, Experiment]) -> Iterator[Fact]:
    """The facts of a run: duration, integrator, rates, servos, beds, guides, sensors and environment, a fact each."""
    recorded = sum(group.recorded for group in pool.groups)
    yield from [
        Fact("arm", _all(pool, "arm")),
        Fact("duration", _all(pool, "duration_s", "{:g} s")),
        Fact("integrator", _all(pool, "integrator")),
        Fact("rate of the dynamics", _all(pool, "dynamics_hz", "{:g} Hz")),
        Fact("rate of the record", _all(pool, "record_hz", "{:g} Hz")),
        Fact("velocity products", _all(pool, "velocity_products")),
    ]
    yield from [
        Fact("allowed", line) for line in dict.fromkeys(line for group in pool.groups for line in group.allowed)
    ]
    servos: dict[str, dict[str, None]] = {}  # joints by their servo
    others: dict[str, dict[str, None]] = {}
    for experiment in experiments.values():
        structure, base = experiment.structure, experiment.structure.schedule.base_hz
        for use in structure.servos:
            command_use = use.command
            command = (
                f", told a {command_use.kind} ({command_use.model or command_use.guide})"
                if command_use is not None
                else ""
            )
            rate = "continuous" if use.continuous else f"at {base / use.divisor:g} Hz"
            servos.setdefault(f"{use.model} {rate}{command}", {})[use.joint] = None
        for on_bed in structure.substitutions:
            others.setdefault(f"bed of {on_bed.joint}", {})[f"{on_bed.bed}, law {on_bed.law}"] = None
        for guide in structure.guides:
            others.setdefault(f"guide {guide.name}", {})[f"{guide.model}, of {', '.join(guide.joints)}"] = None
        for sensor in structure.sensors:
            others.setdefault(f"sensor {sensor.name}", {})[f"{sensor.model} at {base / sensor.divisor:g} Hz"] = None
        for environment in structure.environment:
            others.setdefault(f"environment {environment.name}", {})[environment.model] = None
    for text, joints in servos.items():
        names = list(joints)
        few = ", ".join(names) if len(names) <= 3 else f"{names[0]}, {names[1]} … {names[-1]}"
        yield Fact(f"servo of {few}", text)
    yield from [Fact(name, "; ".join(texts)) for name, texts in others.items()]
    yield Fact("histories kept", f"{recorded:,} of {pool.count:,} cases")


# Where it comes from


def _sources(archive: ArchiveFile) -> Iterator[SourceListing]:
    """The archive's deck files, each cut to what a page can hold, with its SHA-256."""
    for name, text in archive.sources().items():
        lines = text.split("\n")
        if lines and not lines[-1]:
            lines.pop()
        shown_lines = lines[:MOST_LINES]
        while sum(map(len, shown_lines)) > MOST_LETTERS and shown_lines:
            shown_lines = shown_lines[: len(shown_lines) // 2]
        digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
        yield SourceListing(name, "\n".join(shown_lines), digest, len(lines) - len(shown_lines))


def _provenance(archive: ArchiveFile, groups: Sequence[ArchiveGroup]) -> Iterator[Fact]:
    """The provenance of an archive, a fact each: its file, deck, MET's commit, versions of packages, and keys."""
    provenance = archive.provenance
    changed = {"yes": ", with changes that were not committed", "unknown": ""}.get(str(provenance.get("git_dirty")), "")
    yield from [
        Fact("archive", f"{archive.path.name} ({size_text(archive.path.stat().st_size)})"),
        Fact("SHA-256 of it", _digest(archive.path), True),
        Fact("deck", archive.deck),
        Fact("commit of MET", f"{provenance.get('git_commit', 'unknown')}{changed}", True),
    ]
    versions = {name[8:]: str(value) for name, value in provenance.items() if name.startswith("version_")}
    yield from [Fact(f"version of {'MET' if name == 'met' else name}", versions[name]) for name in sorted(versions)]
    yield Fact("defines", str(provenance.get("defines") or "none"), True)
    for group in groups:
        of_group = f" of {group.name}" if len(groups) > 1 else ""
        for name, about in (("structure_key", "key of the structure"), ("code_key", "key of the program")):
            if name in group.attributes:
                yield Fact(f"{about}{of_group}", str(group.attributes[name]), True)


def _compared_with(against: ComparedArchive) -> tuple[Fact, ...]:
    """Facts about the file that an archive is compared with: its name, size and SHA-256."""
    path, name = against.file.path, str(against.differences.a)
    size = size_text(path.stat().st_size)
    return Fact("compared with", f"{name} ({size})"), Fact(f"SHA-256 of {name}", _digest(path), True)


def _digest(path: Path) -> str:
    """The SHA-256 of an archive's file; words where it is too large for that."""
    if path.stat().st_size > MOST_HASHED:
        return "not computed: it is large"
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
