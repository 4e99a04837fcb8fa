"""`met report`: an archive as one HTML page, which opens anywhere without a network.

    batch.report.report("two_link.gains.h5")                    # -> two_link.gains.html
    batch.report.report("after.h5", against="before.h5")        # and what changed

`contents` makes plain data of an archive (`contents.parts.Report`), `html` makes a page of that; here it is written.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from met.outputs import path_of


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
    from batch.report.writing import check, write

    if tolerances and against is None:
        raise ValueError("tolerances are for a comparison: against which archive?")
    archive = Path(path)
    target = archive.with_suffix(".html") if output is None else path_of(output)
    with ExitStack() as stack:
        file = stack.enter_context(ArchiveFile(archive))
        file.need_every_row("a report")
        check(target)
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
    write(target, text)
    played = [section.simulation.structures for section in contents.sections if section.simulation is not None]
    for words in dict.fromkeys(structure.arm.meshes.words for structures in played for structure in structures):
        if words:
            tell(words)
    return target
