"""`met report`: an archive as one HTML page, which opens anywhere without a network.

    batch.report.report("two_link.gains.h5")                    # -> two_link.gains.html
    batch.report.report("after.h5", against="before.h5")        # and what changed

`contents` makes plain data of an archive (`contents.parts.Report`), `html` makes a page of that; here it is written.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from met.host.files import open_regular, whole_file
from met.outputs import ELSEWHERE, check_ending, check_overwrite, check_place, path_of, writing

HEAD_BYTES = 400
"""Number of bytes at the beginning of a page that name its program."""


def report(
    path: str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    *,
    experiments: Sequence[str] = (),
    title: str = "",
    against: str | os.PathLike[str] | None = None,
    tolerances: str | Sequence[str] = (),
    simulate: bool = True,
    meshes: bool = True,
    tell: Callable[[str], object] = lambda line: None,
    progress: Callable[[int], None] | None = None,
) -> Path:
    """Write a report of an archive; its place. The same archives give the same bytes.

    output       the page; None: beside the archive, `ARCHIVE.html`
    experiments  names of runs and sweeps; none: all
    title        what stands above it; "": the names of deck, runs and sweeps
    against      an earlier archive: what changed is in the page too
    tolerances   how much may differ from it, as `batch.diff` has them
    simulate     whether the page can run the cases again, and draws the arm
    meshes       whether links are drawn by their meshes, from files that are there
    tell         called with lines on these
    progress     called with the number of cases whose stability is known, where motors are on beds

    Raises met.diagnostic.Problem for mistakes that a user can correct.
    """
    from contextlib import ExitStack

    from batch.archive.read import ArchiveFile
    from batch.queries.pool import groups_named
    from batch.report.contents.against import ComparedArchive, display_names, rename_archives
    from batch.report.contents.gathering import gather
    from batch.report.html.page import page

    if tolerances and against is None:
        raise ValueError("tolerances are for a comparison: against which archive?")
    archive = Path(path)
    target = archive.with_suffix(".html") if output is None else path_of(output)
    with ExitStack() as stack:
        file = stack.enter_context(ArchiveFile(archive))
        file.need_every_row("a report")
        _check(target)
        other = None
        if against is not None:
            from batch.differences.campaigns import diff
            from batch.differences.tolerance import tolerances as read

            groups_named(file, experiments)
            texts = [tolerances] if isinstance(tolerances, str) else tolerances
            diff_ = rename_archives(diff(Path(against), archive, read(texts)), *display_names(Path(against), archive))
            other = ComparedArchive(stack.enter_context(ArchiveFile(Path(against))), diff_)
        contents = gather(file, experiments, title, progress, other, simulate=simulate, meshes=meshes)
        text = page(contents)
    with writing(target, code="E380", help=ELSEWHERE), whole_file(target) as page_file:
        page_file.write(text.encode("utf-8"))
    played = [section.simulation.structures for section in contents.sections if section.simulation is not None]
    for words in dict.fromkeys(structure.arm.meshes.words for structures in played for structure in structures):
        if words:
            tell(words)
    return target


def _check(output: Path) -> None:
    """Refuse a place before anything is computed. Raises Problem E380, or E381 where the name is not that of a page."""
    with writing(output, code="E380", help=ELSEWHERE):
        printed = ["a browser prints the page to PDF: everything is open then, and light"]
        more = printed if output.suffix.lower() == ".pdf" else []
        check_ending(output, (".html", ".htm"), code="E381", kinds="reports are HTML files", more=more)
        check_place(output, code="E380", inside=output / "report.html")
        check_overwrite(output, _is_report, code="E380", because=" and is no report of MET")


def _is_report(path: Path) -> bool:
    """True if a file is marked as a page of MET's."""
    from batch.report.html.page import GENERATOR

    with open_regular(path) as file:
        return f'<meta name="generator" content="{GENERATOR}">'.encode() in file.read(HEAD_BYTES)
