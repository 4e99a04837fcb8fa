"""Campaigns: many cases, run into archives that xarray opens as they are.

import ic, batch
archive = batch.run(ic.compile("two_link.ic"))          # -> two_link.h5
data = archive.open()                                   # an xarray.Dataset, or a DataTree of several
data = batch.open("two_link.h5")                        # the same, later
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from met.frozen import frozen

if TYPE_CHECKING:
    from batch.campaign import Histories, Progress
    from batch.summary import Summary
    from met.plan import Plan


@frozen
class Archive:
    """An archive on the disk, and what came of its cases, one summary an experiment."""

    path: Path
    summaries: tuple[Summary, ...]
    notes: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether every case reached its end and met every requirement."""
        return all(summary.ok for summary in self.summaries)

    def open(self) -> Any:
        """Its contents as xarray has them (`batch.open`)."""
        return open(self.path)


def run(
    plan: Plan,
    *,
    output: str | os.PathLike[str] | None = None,
    experiments: Sequence[str] | None = None,
    cases: Sequence[int | str] | None = None,
    histories: Histories = "default",
    threads: int | None = None,
    progress: Progress | None = None,
) -> Archive:
    """Run a plan's cases into an archive.

    output       the archive; None: the deck's name with `.h5`, in the current folder
    experiments  names of runs and sweeps; None: all of the plan's
    cases        rows of the case table, `"#7"`, or the beginnings of case_ids; None: all
    histories    "default": all while the archive stays below 1 GiB, else metrics only; "all"; "none"
    threads      None: as many as there are cores
    """
    from batch.campaign import perform, prepare

    campaign = prepare(plan, output=output, experiments=experiments, cases=cases, histories=histories)
    perform(campaign, threads=threads, progress=progress)
    return look(campaign.output, campaign.notes)


def look(path: str | os.PathLike[str], notes: Sequence[str] = ()) -> Archive:
    """An archive that exists, with its summaries."""
    from batch.archive.read import ArchiveFile
    from batch.summary import summarise

    with ArchiveFile(Path(path)) as file:
        return Archive(Path(path), summarise(file), tuple(notes))


def open(path: str | os.PathLike[str]) -> Any:
    """An archive as an xarray.Dataset, or an xarray.DataTree where it holds several experiments; read lazily."""
    from batch.archive.read import ArchiveFile

    with ArchiveFile(Path(path)) as file:
        several = len(file.groups) > 1
    import xarray

    return xarray.open_datatree(path, engine="h5netcdf") if several else xarray.open_dataset(path, engine="h5netcdf")
