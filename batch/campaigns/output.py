"""The place of an archive: its default name, checks of the path, and the final renaming."""

from __future__ import annotations

import errno
import json
import os
import resource
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from batch.archive.sink import FileBusy, Sink, temporary_of
from batch.campaigns.choosing import experiments_named
from batch.campaigns.folder import Folder, beside
from batch.formats import format_of
from ic.printing.columns import size as size_text
from met import outputs
from met.diagnostic import Problem, error
from met.host.files import new_file
from met.outputs import check_overwrite, check_place, quoted, varies
from met.plan import Experiment, Plan
from met.plan.columns import CaseValues


def default_output(
    plan: Plan,
    experiments: Sequence[str] | None = None,
    selected: Sequence[tuple[Experiment, CaseValues]] = (),
    whole: int | None = None,
) -> Path:
    """The default name: `two_link.h5` for the run that the deck itself chooses, whether it is named or not;
    `two_link.gains.h5` for other runs and sweeps; `two_link.gains.case7.h5` for some of the cases.

    They are named here, or were when the plan was made (`two_link.all.h5` where all were asked for).
    So a case that is run again does not take its sweep's place. A deck of the standard library is called `<name>`.
    whole: how many cases there are of all that was asked for; None: of what is selected.
    """
    names_asked = plan.selected
    if experiments and not any(map(varies, plan.settings)):
        chosen = experiments_named(plan, experiments)
        names_asked = tuple(experiments) if len(chosen) < len(plan.experiments) else plan.selected
    names = [Path(plan.deck.strip("<>")).stem, *names_asked]
    count = sum(len(rows) for _, rows in selected)
    if count < (sum(experiment.cases.count for experiment, _ in selected) if whole is None else whole):
        few = (
            [int(position) for experiment, rows in selected for position in experiment.cases.table[rows]]
            if count <= 4
            else []
        )
        names.append("case" + "-".join(map(str, few)) if few else "cases")
    return Path(".".join([*names, "h5"]))


def publish(output: Path, temporary: Path, sidecar: dict[str, Any]) -> None:
    """Give a finished archive its name, and its sidecar."""
    beside = sidecar_path(output)
    beside_temporary = temporary_of(beside)
    try:
        with new_file(beside_temporary) as file:
            file.write(f"{json.dumps(sidecar, indent=1)}\n".encode())
        temporary.replace(output)
        try:
            beside_temporary.replace(beside)
        except OSError as reason:
            message = f"{output} is whole, but {beside} cannot be written: {outputs.refusal_text(reason)}"
            raise Problem(error("E305", message, help="without it the same command runs all cases again")) from reason
    finally:
        beside_temporary.unlink(missing_ok=True)
    outputs.settle_named(output)


OF_OTHER_FILES = frozenset(
    {".ic", ".json", ".toml", ".urdf", ".xacro", ".txt", ".md", ".py", ".html", ".png", ".svg", ".pdf"}
)
"""Endings of what is read or written otherwise: an archive of such a name would be taken for that."""


def sidecar_path(output: Path) -> Path:
    """The file beside an archive with what is no part of its bytes: machine, dates and durations."""
    return output.with_name(output.name + ".run.json")


def check_output(output: Path, plan: Plan) -> None:
    """Refuse an output that could not be written in the end, before anything runs. Raises Problem E305, E307."""
    try:
        _check_output(output, plan)
    except FileBusy:
        raise Problem(busy(output)) from None
    except OSError as reason:
        raise Problem(cannot_write(output, reason)) from reason


def _check_output(output: Path, plan: Plan) -> None:
    """Raise Problem E305 where an archive, its sidecar and its campaign's folder cannot be written to these places."""
    from batch.archive.read import is_archive

    for folder in (output, *output.parents):
        if (folder / "campaign.json").exists() and folder.name.endswith(".campaign"):
            archive = quoted(folder.with_name(folder.name.removesuffix(".campaign")))
            remedy = f"what it fills is called {archive}: `-o {archive}`"
            raise Problem(error("E305", f"cannot write {output}: {folder} is a campaign's folder", help=remedy))
    if format_of(output):
        remedy = f"`-o {quoted(output.with_suffix('.h5'))}`; `met run DECK -o {quoted(output)}` writes both"
        raise Problem(error("E305", f"cannot write {output}: it is to be an archive, which ends in .h5", help=remedy))
    if output.suffix.lower() in OF_OTHER_FILES or output.name == "-":
        other = output.with_suffix(".h5") if output.suffix else default_output(plan)
        message = f"cannot write {output}: it is to be an archive, which ends in .h5"
        raise Problem(error("E305", message, help=f"`-o {quoted(other)}`"))
    check_place(output, code="E305", inside=output / default_output(plan))
    if beside(output).exists() and not beside(output).is_dir():
        message = f"cannot write {output}: {beside(output)} is no folder, and a campaign's has to be there"
        raise Problem(error("E305", message, help="give another name with `-o`, or move the file"))
    if foreign := Folder(beside(output)).foreign():
        message = f"cannot write {output}: {beside(output)} is no campaign's folder, and holds {', '.join(foreign[:3])}"
        raise Problem(error("E305", message, help="give another name with `-o`, or move the folder"))
    check_place(sidecar_path(output), code="E305")
    check_overwrite(output, is_archive, code="E305", because=" and is no archive of MET")
    temporary_of(sidecar_path(output)).exists()  # the longest of the names that there will be beside it
    probe = Sink(temporary_of(output))
    probe.remove()
    probe.close()


def check_room(output: Path, needed: int) -> None:
    """Refuse an output that does not fit on the disk. needed: bytes, approximately, until it is whole. Raises Problem
    E306."""
    try:
        total, _, free = shutil.disk_usage(output.parent)
    except OSError:  # a file system that does not tell
        return
    known = total > 0 and free >= 0  # others answer 0 of 0 blocks, or all ones, which is -1
    if known and needed > free:
        needs, has = size_text(needed), size_text(free)
        message = f"cannot write {output}: it needs about {needs} until it is whole, and the disk has {has} left"
        helps = (
            "`--histories none` keeps metrics only; `--float32`, fewer signals in `record`, or a slower "
            "`rates.record`, take less"
        )
        raise Problem(error("E306", message, help=helps))


def cannot_write(output: Path, reason: OSError, kept_work: str = "") -> Any:
    """The error that a file cannot be written. kept_work: the part of the work that is kept, and its place; "" where
    none is"""
    why = outputs.refusal_text(reason)
    if reason.errno in (errno.EMFILE, errno.ENFILE):  # the name of the unopened file does not matter
        return error("E305", f"cannot write {output}: {why}", help=f"{kept_work or 'nothing was kept'}; {more_files()}")
    where = str(reason.filename) if isinstance(reason.filename, str | os.PathLike) else ""
    if where and Path(where).is_relative_to(beside(output)):  # the archive itself is not the obstacle
        why = f"{where}: {why}"
    helps = kept_work or "nothing was kept; `-o FILE` names another place"
    if reason.errno in (errno.EEXIST, errno.EISDIR, errno.ENOTDIR):
        helps = f"{kept_work or 'nothing was kept'}; move away what is in the way, or give another name with `-o`"
    return error("E305", f"cannot write {output}: {why}", help=helps)


def more_files() -> str:
    """The remedy where no more files can be opened."""
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return f"`ulimit -n` allows {most:,} open files: allow more in the shell that runs it, or use fewer processes"


def busy(output: Path) -> Any:
    """The error that another run is writing this archive now."""
    helps = [
        f"`met status {quoted(output)}` says how far it is",
        "wait until it is done, or give another name with `-o`",
    ]
    return error("E307", f"cannot write {output}: another run is writing it now", help=helps)
