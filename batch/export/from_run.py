"""An export directly from a run, `met run DECK -o FILE.mcap`: it is made from an archive FILE.h5, which stays."""

from __future__ import annotations

import os
from pathlib import Path

from batch.campaigns.campaign import Campaign
from batch.export import Exported, export
from batch.export.formats import ExportRequest, find
from batch.export.output import check as check_place
from batch.formats import format_of
from met.diagnostic import Problem, error
from met.outputs import path_of, quoted


def archive_and_export(output: str | os.PathLike[str] | None) -> tuple[Path | None, Path | None]:
    """The archive and the export that an output names; None for the one that it does not name."""
    target = None if output is None else path_of(output)
    if target is None or format_of(target) is None:
        return target, None
    return target.with_suffix(".h5"), target


def check(campaign: Campaign, target: Path, *, histories: bool) -> None:
    """Refuse, before anything runs, a campaign that could not be exported. histories: True where they were asked for.
    Raises Problem E305, E323, E370-E376."""
    writer = find(str(format_of(target)))
    recorded = sum(len(part.history_places) for part in campaign.parts)
    writer.check_request(ExportRequest("histories" if histories else None), target)
    takes_histories = "metrics" not in writer.tables or ("histories" in writer.tables and campaign.cases == 1)
    if not recorded and not campaign.keep.later and (takes_histories or histories):
        message = f"{target} would be empty: no histories are kept"
        helps = ["`--histories all` keeps them, and `--histories '#0'` those of a case"]
        if not any(part.experiment.structure.record for part in campaign.parts):
            helps = ["`record = [q, qd, tau];` in the run records signals"]
        raise Problem(error("E323", message, help=[*helps, *campaign.notes]))
    writer.check_campaign(campaign, target)
    check_place(target, campaign.output, writer.is_own, force=None)


def export_command(campaign: Campaign, target: Path, *, histories: bool) -> str:
    """The command that makes the export of an archive that is whole."""
    runs = campaign.run_names
    named = "".join(f" --run {quoted(name)}" for name in runs) if len(runs) > 1 else ""
    return f"met export {quoted(campaign.output)}{named}{' --histories' * histories} -o {quoted(target)}"


def export_run(campaign: Campaign, target: Path, *, histories: bool) -> Exported:
    """Export everything that was run. Raises Problem."""
    return export(campaign.output, target, runs=campaign.run_names, table="histories" if histories else None)
