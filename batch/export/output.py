"""Output files: they get their names only when whole, and existing files are protected."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path

from batch.archive.sink import FileBusy, Sink, temporary_of
from met.diagnostic import Problem, error
from met.outputs import ELSEWHERE, check_overwrite, check_place, settle_named, writing


def check(output: Path, archive: Path, own: Callable[[Path], bool], *, force: bool | None) -> None:
    """Refuse a place before anything is written. Raises Problem E305 where nothing can be written, E374 where a file
    exists.

    own    whether a file that is there is an export of MET's, and may go
    force  whether any other may; None where the user has no way to say so
    """
    with writing(output, code="E305", help=ELSEWHERE):
        check_place(output, code="E305", inside=output / archive.with_suffix(".mcap").name)
        if output.exists() and archive.exists() and output.samefile(archive):
            message = f"{output} is the archive itself: it is not written over"
            raise Problem(error("E374", message, help="give another name with `-o`"))
        if not force:
            because = ", and may hold work that is not in the archive"
            remedy = "remove the file" if force is None else "say `--force`"
            check_overwrite(output, own, code="E374", because=because, remedy=remedy)


@contextlib.contextmanager
def whole(output: Path) -> Iterator[Sink]:
    """A new file, which replaces the file of its name when the block has ended and all is on the disk. If the block
    raises, nothing is left; a killed process leaves a file under a temporary name, which the next one takes over.
    Raises Problem E305, E307."""
    temporary = temporary_of(output)
    with writing(output, code="E305", help=ELSEWHERE):
        try:
            sink = Sink(temporary)
        except FileBusy:
            helps = "wait until it is done, or give another name with `-o`"
            message = f"cannot write {output}: another export is writing it now"
            raise Problem(error("E307", message, help=helps)) from None
        try:
            yield sink
            sink.settle()
            temporary.replace(output)
        except BaseException:
            sink.remove()
            raise
        finally:
            sink.close()
        settle_named(output)
