"""Output of a report: checks of its place, and writing whole or not at all."""

from __future__ import annotations

from pathlib import Path

from batch.report.html.page import GENERATOR
from met.host.files import open_regular, whole_file
from met.outputs import ELSEWHERE, check_ending, check_overwrite, check_place, writing

HEAD_BYTES = 400
"""Number of bytes at the beginning of a page that name its program."""


def check(output: Path) -> None:
    """Refuse a place before anything is computed. Raises Problem E380, or E381 where the name is not that of a page."""
    with writing(output, code="E380", help=ELSEWHERE):
        printed = ["a browser prints the page to PDF: everything is open then, and light"]
        more = printed if output.suffix.lower() == ".pdf" else []
        check_ending(output, (".html", ".htm"), code="E381", kinds="reports are HTML files", more=more)
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
