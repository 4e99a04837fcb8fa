"""What a run was given: the settings of its command line, `--set`, `--vary` and `-D`, with its deck, name and seed."""

from __future__ import annotations

from typing import Any

from batch.archive.read import ArchiveFile
from batch.queries.pool import Pool
from ic.text.lexer import COMMAND_LINE
from met.diagnostic import Problem
from met.outputs import setting_path, varied_run, varies


def settings_lines(archive: ArchiveFile) -> list[str]:
    """The settings in a line of each kind: `set: drive.kp = 2 V/rad`, `varied: ...`, `-D: N=2`."""
    defines = str(archive.provenance.get("defines") or "")
    settings = _settings(archive.sources().get(COMMAND_LINE, "").splitlines(), defines)
    kinds = (("set", False), ("varied", True))
    settings_of_kind = [
        (kind, [_spaced(setting) for setting in settings if varies(setting) == wanted]) for kind, wanted in kinds
    ]
    return [f"{kind}: {'; '.join(lines)}" for kind, lines in (*settings_of_kind, ("-D", [defines])) if any(lines)]


def _settings(lines: list[str], defines: str) -> list[str]:
    """The lines behind those of the macros of -D, `NAME text`, which `defines` has as `NAME=text` or `NAME`."""
    left = f"{defines} "
    for number, line in enumerate(lines):
        name, _, text = line.partition(" ")
        forms = [form for form in (f"{name}={text} ", f"{name} ") if left.startswith(form)]
        if not forms:
            return lines[number:]
        left = left.removeprefix(forms[0])
    return []


def _spaced(setting: str) -> str:
    return f"{setting_path(setting)} = {setting.partition('=')[2].strip()}"


def context(archive: ArchiveFile, pool: Pool) -> dict[str, Any]:
    """The deck, name, seed, options and remarks of a campaign, by those arguments of `BestAnswer` in best_answer.py."""
    defines = str(archive.provenance.get("defines") or "").split()
    remarks = []
    if any(group.attributes.get("step_errors") for group in pool.groups):
        remarks.append("requirements on errors by the step are not looked at here: `met show --evidence`")
    settings: tuple[str, ...] = ()
    try:
        settings = archive.plan(as_written=True).settings
    except Problem:  # for instance, a model of the plan is not installed here
        remarks.append("the plan in this archive cannot be read: what `--set` set, if it did, is not in the command")
    seed = int(pool.groups[0].at("seed", [0])[0])
    name = varied_run(pool.name) if any(map(varies, settings)) else pool.name
    return {
        "deck": archive.deck.strip("<>"), "name": name, "seed": seed, "defines": defines, "overrides": settings,
        "remarks": remarks,
    }  # fmt: skip
