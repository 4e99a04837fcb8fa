"""The answer of a search in the output of `met run` and `met show`: the best, binding requirements, and next
commands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.queries.best_answer import context
from batch.queries.pool import Pool
from batch.queries.search_answers import SearchAnswer
from ic.driver.write_values import WrittenValue
from met.frozen import frozen
from met.outputs import quoted, setting_option, setting_path


@frozen
class SearchResult:
    """The answer of a search: as lines, for programs, and whether it is what was asked for.

    commands  that follow from it, each with what it is for
    tunes     whether it is a tuning: then the requirements count in its answer alone;  name: of the search
    values    what it chose;  among: among what, in words
    """

    name: str
    lines: tuple[str, ...]
    commands: tuple[tuple[str, str], ...]
    data: dict[str, Any]
    ok: bool
    tunes: bool
    values: tuple[WrittenValue, ...]
    among: str


def search_result(archive: ArchiveFile, group: ArchiveGroup) -> SearchResult | None:
    """The answer of a group of an archive; None where it is not a search, or has only some of its cases."""
    answer = SearchAnswer.of(group)
    if answer is None:
        return None
    commands = _commands(archive, group, answer)
    tunes = answer.search.kind == "tune"
    lines = (
        *answer.lines(),
        *(line for purpose, command in commands for line in _purpose_and_command(purpose, command)),
    )
    data = {**answer.as_data(), "commands": [command for _, command in commands]}
    cases_text = f"{len(group.values('case')):,} cases"
    return SearchResult(group.name, lines, tuple(commands), data, answer.ok, tunes, tuple(answer.values()), cases_text)


def _purpose_and_command(purpose: str, command: str) -> Sequence[str]:
    return [f"{purpose} {command}"] if len(purpose) + len(command) < 100 else [purpose, f"  {command}"]


def _commands(archive: ArchiveFile, group: ArchiveGroup, answer: SearchAnswer) -> list[tuple[str, str]]:
    """Commands for the next steps after an answer, each with its purpose."""
    again = f"met run {quoted(archive.path)} --case '#{answer.position}'"
    if answer.search.kind == "search":
        return [("run it again:", again)]
    how = context(archive, Pool(group.name, [group]))
    name = answer.search.against or answer.search.of
    words = [f"-D {quoted(macro)}" for macro in how["defines"]]
    chosen = [value.setting for value in answer.values()]
    replaced = {*map(setting_path, chosen), *(["seed"] if answer.draws else [])}
    words += [setting_option(setting) for setting in how["overrides"] if setting_path(setting) not in replaced]
    words += [setting_option(setting) for setting in chosen]
    command = f"met run {quoted(how['deck'])} {quoted(name)} {' '.join(words)}"
    steps = [("its worst case again:", again), ("run it:", f"{command} -o chosen.h5")]
    if answer.draws:
        confirmed = len(answer.search.confirmation)
        seed = f"--set seed={answer.search.drawn_with + 1 + confirmed}"
        purpose = "these cases chose it, so they flatter it: other draws confirm it or not:"
        steps[1] = ("with yet other draws:" if confirmed else purpose, f"{command} {seed} -o confirmed.h5")
    elif answer.search.against:
        steps[1] = (f"nothing was drawn in {name}, so that no other draws confirm it; run it:", steps[1][1])
    return steps
