"""Runs, sweeps and cases of an archive by the names that a command gives them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from batch.archive.read import ArchiveFile, ArchiveGroup
from met.diagnostic import Problem, error


def by_run(groups: Iterable[ArchiveGroup]) -> dict[str, list[ArchiveGroup]]:
    """The groups of each run or sweep, under its name."""
    groups_of_run: dict[str, list[ArchiveGroup]] = {}
    for group in groups:
        groups_of_run.setdefault(group.sweep or group.name, []).append(group)
    return groups_of_run


def groups_named(archive: ArchiveFile, names: Sequence[str]) -> tuple[ArchiveGroup, ...]:
    """The experiments of these names, or all where none is given."""
    for name in names:
        if all(name not in (group.name, group.sweep) for group in archive.groups):
            helps = f"in it: {', '.join(by_run(archive.groups))}"
            raise Problem(error("E325", f"no run or sweep `{name}` in {archive.path}", help=helps))
    named = [group for name in names for group in archive.groups if name in (group.name, group.sweep)]
    return tuple(dict.fromkeys(named)) if names else archive.groups


def cases_named(archive: ArchiveFile, names: Sequence[str], case: str | None) -> list[tuple[ArchiveGroup, int | None]]:
    """The experiments of these names; where a case is given, those that have it, with its position in each."""
    groups = groups_named(archive, names)
    if case is None:
        return [(group, None) for group in groups]
    cases: list[tuple[ArchiveGroup, int | None]] = []
    problems = []
    for group in groups:
        try:
            cases.append((group, group.find_case(case)))
        except Problem as problem:
            problems.append(problem)
    if not cases:
        raise Problem([d for problem in problems for d in problem.diagnostics])
    return cases
