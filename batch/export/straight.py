"""An export straight from a run, `met run DECK -o FILE.mcap`: of an archive FILE.h5 that is run, and stays."""

from __future__ import annotations

import os
from pathlib import Path

from batch.campaigns.campaign import Campaign
from batch.campaigns.output import quoted
from batch.export import FORMATS, Exported, export, owner
from batch.export.output import check as check_place
from met.diagnostic import Problem, error


def parted(output: str | os.PathLike[str] | None) -> tuple[Path | None, Path | None]:
    """The archive and the export that an output names; None for what it does not."""
    target = None if output is None else Path(output)
    if target is None or target.suffix.lower().removeprefix(".") not in FORMATS:
        return target, None
    return target.with_suffix(".h5"), target


def check(campaign: Campaign, target: Path, *, histories: bool) -> None:
    """Refuse what could not be exported in the end, before anything runs. histories: whether they were asked for.
    Raises Problem E305, E323, E370-E374."""
    form = target.suffix.lower().removeprefix(".")
    kept = sum(len(part.kept) for part in campaign.parts)
    if not kept and not campaign.keep.later and (form == "mcap" or histories or campaign.cases == 1):
        message = f"{target} would be empty: no histories are kept"
        helps = ["`--histories all` keeps them, and `--histories '#0'` those of a case"]
        if not any(part.experiment.structure.record for part in campaign.parts):
            helps = ["`record = [q, qd, tau];` in the run records signals"]
        raise Problem(error("E323", message, help=[*helps, *campaign.notes]))
    if form == "parquet":
        from batch.export.parquet import pyarrow_here

        pyarrow_here()
    if form == "mcap":
        from batch.export.mcap import OVERLAID, too_many

        _placed(campaign, target)
        if kept > OVERLAID:
            archive = quoted(target.with_suffix(".h5"))
            helps = ["`--case '#0'` runs one alone, and `--histories '#0'` keeps the signals of one",
                     f"or run all, and choose then: `-o {archive}`, `met export {archive} --case '#0'`"]  # fmt: skip
            raise Problem(too_many(kept, ", ".join(_asked(campaign)), helps))
    check_place(target, campaign.output, owner(form), force=None)


def _placed(campaign: Campaign, target: Path) -> None:
    """Raises Problem E370 where q of a joint is not recorded, without which no arm can be shown."""
    for part in campaign.parts:
        structure = part.experiment.structure
        recorded = {channel for each in structure.record for channel in each.channels}
        lacking = [f"{joint.name}.q" for joint in structure.moving if f"{joint.name}.q" not in recorded]
        if part.recorded and lacking:
            which = "q" if len(lacking) == len(structure.moving) else ", ".join(lacking)
            message = (
                f"the arm of `{part.experiment.name_in_deck}` could not be shown in {target}: {which} is not recorded"
            )
            helps = ("`record = [q, ...]` in the run keeps where its joints are",
                     f"`-o {quoted(target.with_suffix('.csv'))}` needs no positions")  # fmt: skip
            raise Problem(error("E370", message, help=helps))


def later(campaign: Campaign, target: Path, *, histories: bool) -> str:
    """The command that makes the export of an archive that is whole."""
    runs = _asked(campaign)
    named = "".join(f" --run {quoted(name)}" for name in runs) if len(runs) > 1 else ""
    return f"met export {quoted(campaign.output)}{named}{' --histories' * histories} -o {quoted(target)}"


def written(campaign: Campaign, target: Path, *, histories: bool) -> Exported:
    """Export all that was run. Raises Problem."""
    return export(campaign.output, target, runs=_asked(campaign), table="histories" if histories else None)


def _asked(campaign: Campaign) -> list[str]:
    """The runs and sweeps, by the names by which they are asked for."""
    return list(dict.fromkeys(part.experiment.name_in_deck for part in campaign.parts))
