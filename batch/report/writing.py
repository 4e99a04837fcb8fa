"""Where a report goes: what is refused as a place for it, and that it is there whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from batch.campaigns.output import quoted
from batch.report.page import GENERATOR
from met.diagnostic import Problem, error
from met.host.files import open_regular, whole_file

ENDINGS = (".html", ".htm")
HEAD_BYTES = 400
"""A page says within these who made it."""


def default(archive: Path) -> Path:
    """Beside the archive: `two_link.gains.html`."""
    return archive.with_suffix(".html")


def check(output: Path) -> None:
    """Refuse a place before anything is computed. Raises Problem E380, or E381 where the name is not that of a page."""
    try:
        _check(output)
    except OSError as reason:
        raise cannot_write(output, reason) from reason


def _check(output: Path) -> None:
    if output.is_dir():
        inside = quoted(output / "report.html")
        raise Problem(error("E380", f"cannot write {output}: it is a folder", help=f"name a file in it: `-o {inside}`"))
    if output.suffix.lower() not in ENDINGS:
        helps = [f"`-o {quoted(output.with_suffix('.html'))}`"] if output.name else []
        if output.suffix.lower() == ".pdf":
            helps.append("a browser prints the page to PDF: everything is open then, and light")
        raise Problem(error("E381", f"cannot write {output}: reports are HTML files", help=helps))
    if not output.parent.is_dir():
        what = "is a file, not a folder" if output.parent.exists() else "does not exist"
        helps = [] if output.parent.exists() else [f"make it first: `mkdir -p {quoted(output.parent)}`"]
        raise Problem(error("E380", f"cannot write {output}: {output.parent} {what}", help=helps))
    if output.exists() and not output.is_file():
        raise Problem(error("E380", f"cannot write {output}: it is not a regular file"))
    if output.exists() and output.stat().st_size > 0 and not is_report(output):
        message = f"{output} exists and is no report of MET: it is not written over"
        raise Problem(error("E380", message, help="give another name with `-o`, or remove the file"))


def is_report(path: Path) -> bool:
    """Whether a file says that it is a page of ours."""
    with open_regular(path) as file:
        return f'<meta name="generator" content="{GENERATOR}">'.encode() in file.read(HEAD_BYTES)


def write(output: Path, text: str) -> None:
    """The page under its name when it is whole. Raises Problem E380 where the system refuses."""
    try:
        with whole_file(output) as file:
            file.write(text.encode("utf-8"))
    except OSError as reason:
        raise cannot_write(output, reason) from reason


def cannot_write(output: Path, reason: OSError) -> Problem:
    why = (os.strerror(reason.errno) if reason.errno else str(reason)).lower()
    return Problem(error("E380", f"cannot write {output}: {why}", help="`-o FILE` names another place"))
