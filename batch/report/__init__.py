"""`met report`: an archive as one HTML page, that opens anywhere and asks for nothing.

    batch.report.report("two_link.gains.h5")          # -> two_link.gains.html

`data.gather` makes plain data of an archive (`content.Report`), `page.page` makes HTML of that; here it is written.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path


def report(
    path: str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    *,
    experiments: Sequence[str] = (),
    title: str = "",
    progress: Callable[[int], None] | None = None,
) -> Path:
    """Write a report of an archive; its place. The same archive gives the same bytes.

    output       the page; None: beside the archive, `ARCHIVE.html`
    experiments  names of runs and sweeps; none: all
    title        what stands above it; "": the names of deck, runs and sweeps
    progress     called with the number of cases whose stability is known, where motors are on beds

    Raises met.diagnostic.Problem for what a user can mend.
    """
    from batch.archive.read import ArchiveFile
    from batch.report.data import gather
    from batch.report.page import page
    from batch.report.writing import check, default, write

    archive = Path(path)
    target = default(archive) if output is None else Path(output)
    with ArchiveFile(archive) as file:
        check(target)
        text = page(gather(file, experiments, title, progress))
    write(target, text)
    return target
