"""What the command line of a run gave its deck: `--set`, `--vary` and `-D`."""

from __future__ import annotations

from batch.archive.read import ArchiveFile
from ic.text.lexer import COMMAND_LINE
from met.outputs import setting_path, varies


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
