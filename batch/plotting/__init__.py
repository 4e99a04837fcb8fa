"""`met plot`: an archive as a picture, for a screen or for a paper.

    batch.plotting.plot("two_link.h5")                                       # -> two_link.png
    batch.plotting.plot("a.h5", "fig3.svg", ["settle"], over=["gearbox.kp", "gearbox.ki"], size="8.5cm")

`plot_request` says whether signals or metrics are meant; `histories`, `points` and `maps` draw them, over `layout`.
"""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from met.outputs import path_of

if TYPE_CHECKING:
    from batch.archive.read import ArchiveFile, ArchiveGroup
    from batch.plotting.layout import PictureSheet


def plot(
    path: str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    names: Sequence[str] = (),
    *,
    run: str | None = None,
    cases: Sequence[str] = (),
    over: Sequence[str] = (),
    against: str | os.PathLike[str] | None = None,
    size: str = "",
    dpi: int | None = None,
    arm: bool = False,
    at: Sequence[float] = (),
) -> Path:
    """Draw one run or sweep of an archive; the picture. The same archive gives the same bytes.

    output   PNG, SVG or PDF by its ending; None: beside the archive, `ARCHIVE.png`
    names    signals (`qd`, `elbow.q`), which are drawn over time, or metrics; none: histories where they were kept,
             else metrics
    run      its name; None: the first
    cases    only these, by `#7` or the beginning of an id: of signals
    over     what is varied, by its path: metrics as points over one parameter, as maps over two, beside one another for
             each value of a third
    against  another archive: its cases of the same values under the own ones; in maps the difference, own less theirs
    size     for a paper: `8.5cm` wide, or `8.5x6cm`; letters are then of 8 pt, and a caption says what is drawn
    dpi      dots of a PNG; None: 144, on paper 300
    arm      draws the arm of the first of `cases`, or of the first that has a history
    at       instants of which it is drawn, s; none: some over all of the run

    Raises met.diagnostic.Problem for mistakes that a user can correct.
    """
    from batch.archive.read import ArchiveFile
    from batch.plotting.layout import sheet

    names, cases, over = ([words] if isinstance(words, str) else words for words in (names, cases, over))
    on = sheet(size, dpi)
    with contextlib.ExitStack() as files:
        archive = files.enter_context(ArchiveFile(Path(path)))
        other = None if against is None else files.enter_context(ArchiveFile(Path(against)))
        target = path_of(output) if output is not None else archive.path.with_suffix(".png")
        if arm:
            return draw_arm(archive, target, run=run, case=cases[0] if cases else "", at=at, sheet=on)
        return draw(archive, target, names, run=run, cases=cases, over=over, against=other, sheet=on)


def draw(
    archive: ArchiveFile,
    output: str | os.PathLike[str],
    names: Sequence[str] = (),
    *,
    run: str | None = None,
    cases: Sequence[str] = (),
    over: Sequence[str] = (),
    against: ArchiveFile | None = None,
    sheet: PictureSheet | None = None,
) -> Path:
    """Draw a picture of open archives, as `plot` does."""
    from batch.plotting import histories, requests
    from batch.plotting import output as place

    for open_archive in (archive, *([against] if against is not None else [])):
        open_archive.need_every_row("a picture of all cases")
    from batch.plotting.against import beside
    from batch.plotting.layout import PictureSheet
    from batch.plotting.requests import plot_request
    from batch.queries.pool import groups_named, pools

    target, sheet = path_of(output), sheet or PictureSheet()
    groups = groups_named(archive, (run,) if run else ())
    group = _with_case(groups, cases[0] if cases else "")
    place.check(target)
    [pool] = [pool for pool in pools(groups) if group in pool.groups]
    wanted = plot_request(group, pool, names, cases, over)
    with _styled(sheet):
        if wanted.histories:
            other_group = None if against is None else beside(archive, [group], against)[0]
            figure = histories.Histories(archive, group, wanted.signals, cases, sheet, other_group).draw()
        else:
            theirs = [None] * len(pool.groups) if against is None else beside(archive, pool.groups, against)
            others = {number: group for number, group in enumerate(theirs) if group is not None}
            figure = requests.draw(archive, pool, wanted.metrics, over, sheet, others, against)
        place.save(figure, target)
    return target


def draw_arm(
    archive: ArchiveFile,
    output: str | os.PathLike[str],
    *,
    run: str | None = None,
    case: str = "",
    at: Sequence[float] = (),
    sheet: PictureSheet | None = None,
) -> Path:
    """Draw the arm of a case of an open archive, as `plot` does."""
    from batch.plotting import output as place
    from batch.plotting.arm import arm_picture
    from batch.plotting.layout import PictureSheet
    from batch.queries.pool import groups_named

    target, sheet = path_of(output), sheet or PictureSheet()
    archive.need_every_row("a picture of an arm")
    group = _with_case(groups_named(archive, (run,) if run else ()), case)
    place.check(target)
    with _styled(sheet):
        place.save(arm_picture(archive, group, case, at, sheet), target)
    return target


def _with_case(groups: Sequence[ArchiveGroup], case: str) -> ArchiveGroup:
    """The first experiment that has a case; where none has it, the first of all, which then reports it. case: "" for
    any"""
    from met.diagnostic import Problem

    for group in groups if case else ():
        with contextlib.suppress(Problem):
            group.find_case(case)
            return group
    return groups[0]


@contextlib.contextmanager
def _styled(sheet: PictureSheet) -> Iterator[None]:
    """A block in which matplotlib has the settings of a sheet. A matplotlibrc in the working folder, which might start
    TeX, is ignored, and messages about font caches are not said."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(sheet.style)
        yield
