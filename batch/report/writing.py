"""Output of a report: checks of its place, and writing whole or not at all."""

from __future__ import annotations

from pathlib import Path

from batch.report.html.page import GENERATOR
from met.diagnostic import Problem, error
from met.host.files import open_regular, whole_file
from met.outputs import ELSEWHERE, check_overwrite, check_place, quoted, writing

ENDINGS = (".html", ".htm")
HEAD_BYTES = 400
"""Number of bytes at the beginning of a page that name its program."""


def default(archive: Path) -> Path:
    """The default path of a report, beside the archive: `two_link.gains.html`."""
    return archive.with_suffix(".html")


def check(output: Path) -> None:
    """Refuse a place before anything is computed. Raises Problem E380, or E381 where the name is not that of a page."""
    with writing(output, code="E380", help=ELSEWHERE):
        if output.suffix.lower() not in ENDINGS and not output.is_dir():
            helps = [f"`-o {quoted(output.with_suffix('.html'))}`"] if output.name else []
            if output.suffix.lower() == ".pdf":
                helps.append("a browser prints the page to PDF: everything is open then, and light")
            raise Problem(error("E381", f"cannot write {output}: reports are HTML files", help=helps))
        check_place(output, code="E380", inside=output / "report.html")
        check_overwrite(output, is_report, code="E380", because=" and is no report of MET")


def is_report(path: Path) -> bool:
    """True if a file is marked as a page of MET's."""
    with open_regular(path) as file:
        return f'<meta name="generator" content="{GENERATOR}">'.encode() in file.read(HEAD_BYTES)


def write(output: Path, text: str) -> None:
    """Write the page under its name, whole or not at all. Raises Problem E380 where the system refuses."""
    with writing(output, code="E380", help=ELSEWHERE), whole_file(output) as file:
        file.write(text.encode("utf-8"))
