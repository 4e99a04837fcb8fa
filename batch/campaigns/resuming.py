"""The existing parts of a campaign: its whole archive, or shards in its folder; or those of another campaign."""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile
from batch.campaigns.campaign import Campaign, prepare
from batch.campaigns.changes import changes
from batch.campaigns.folder import Folder, FolderBusy, beside
from batch.campaigns.output import sidecar_path
from batch.campaigns.status import duration
from batch.campaigns.tasks import CampaignSection
from batch.campaigns.verification import verifying
from met.diagnostic import Problem, error
from met.host.files import open_regular, read_json
from met.plan import file as plan_file
from met.plan.codec import encode
from met.plan.columns import blocks
from met.plan.searches import Search

WHOLE, DAMAGED = "whole", "damaged"

GUARDED_SECONDS = 60.0
"""Computing time, s, from which a finished archive is replaced by another campaign's only on request."""

MOST_SECONDS = 1e12
"""Upper bound of a campaign's computing time, s: a sidecar that claims more is not believed."""

MOST_CHANGES = 8
"""Largest number of changes that a refusal names."""


def campaign_key(values: Sequence[CampaignSection]) -> str:
    """A digest of everything that decides the numbers of a campaign: code and inputs. The choice of cases that are run
    again for their histories may change meanwhile."""
    keys = [[section.name, section.key(), *_search_of(section)] for section in values]
    return hashlib.sha256(json.dumps(keys).encode()).hexdigest()


def _search_of(section: CampaignSection) -> list[Any]:
    """Everything that decides which cases a search asks for after its first ones; for a tuning also the limits that
    affect worths; nothing for a section without a search."""
    experiment = section.prepared.experiment
    search = experiment.search
    if search is None:
        return []
    limits = [
        [requirement.metric, requirement.comparison, requirement.limit] for requirement in experiment.requirements
    ]
    return [encode(Search, replace(search, place=None)), *([limits] if search.kind == "tune" else [])]


def as_begun(folder: Folder, campaign: Campaign, values: list[CampaignSection]) -> tuple[list[CampaignSection], str]:
    """The sections, with the keys of an older MET's programs where the folder or the archive is this campaign under
    those keys; and the campaign's key."""
    key = campaign_key(values)
    begun = _begun_key(folder, campaign)
    if begun in ("", key):
        return values, key
    older = [replace(section, begun=section.prepared.old_code_key) for section in values]
    return (older, begun) if campaign_key(older) == begun else (values, key)


def settled(campaign: Campaign, values: Sequence[CampaignSection]) -> Campaign:
    """The campaign, with `verify` as "auto" where that has the same effect in each experiment: so equal campaigns are
    equal however the choice was written."""
    if campaign.verify == "auto" or campaign.open_ended:  # the number of cases is not known yet
        return campaign
    sections = [(value.prepared, len(value.rows)) for value in values]
    same = all(verifying.resolve(campaign.verify, *each) == verifying.resolve("auto", *each) for each in sections)
    return replace(campaign, verify="auto") if same else campaign


def _begun_key(folder: Folder, campaign: Campaign) -> str:
    """The key of the campaign in the folder, else of the one that made the archive; "" where neither can be read."""
    try:
        if folder.exists():
            return str(folder.described()["key"])
        return str(read_json(sidecar_path(campaign.output))["campaign"])
    except (Problem, OSError, ValueError, LookupError, TypeError):
        return ""


def proof(campaign: Campaign, key: str, archive: Path) -> dict[str, str]:
    """Entries of a finished archive's sidecar by which `finished_state` recognises it."""
    return {"campaign": key, "asked_sha256": _asked_sum(campaign), "archive_sha256": _file_sum(archive)}


def finished_state(campaign: Campaign, key: str) -> str:
    """WHOLE where the archive exists, belongs to this very campaign and plan, and is unchanged since it was written;
    DAMAGED where it has changed; else ""."""
    output = campaign.output
    try:
        sidecar = read_json(sidecar_path(output))
        wanted = {"campaign": key, "asked_sha256": _asked_sum(campaign)}
        if not isinstance(sidecar, dict) or any(sidecar.get(name) != value for name, value in wanted.items()):
            return ""
        return WHOLE if sidecar.get("archive_sha256") == _file_sum(output) else DAMAGED
    except (OSError, ValueError):
        return ""


def guard(campaign: Campaign) -> None:
    """Refuse to replace a finished archive of another campaign that took long, or was measured on motor beds. Raises
    Problem E353."""
    try:
        sidecar = read_json(sidecar_path(campaign.output))
        seconds = min(MOST_SECONDS, sum(float(record["seconds"]) for record in sidecar["experiments"]))
        measured = bool(sidecar.get("beds"))
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return
    if (seconds < GUARDED_SECONDS and not measured) or not campaign.output.exists():
        return
    try:
        with ArchiveFile(campaign.output) as file:
            differences = changes(file.plan(as_written=True), campaign.plan)
    except Problem:
        differences = ["it cannot be read any more"]
    what = "driven on motor beds" if measured else f"{duration(seconds)} of computing"
    message = f"{campaign.output} holds another campaign, {what}, and is left as it is"
    raise Problem(
        error("E353", message, help=changed_since(differences or ["what is asked for (`--case`, `--histories`)"]))
    )


def changed_since(differences: Sequence[str]) -> list[str]:
    """Help for an error: the changes, and the remedies."""
    most = [
        *differences[:MOST_CHANGES],
        *([f"and {len(differences) - MOST_CHANGES} more"] if len(differences) > MOST_CHANGES else []),
    ]
    return [
        "changed since: " + most[0],
        *(f"               {text}" for text in most[1:]),
        "`--fresh` starts over, and removes what is done; `-o OTHER.h5` leaves it, and runs beside it",
    ]


def is_begun(folder: Folder, key: str) -> bool:
    """True if the folder holds this very campaign, begun."""
    try:
        return folder.exists() and folder.described()["key"] == key
    except Problem:
        return False


def remove_leftovers(folder: Folder, key: str) -> None:
    """Remove the files of a run that was killed after its archive had got its name, but not those of another
    campaign."""
    folder.finish_removal()
    if not folder.exists():
        return
    with contextlib.suppress(FolderBusy, Problem):
        folder.lock()
        try:
            if folder.described()["key"] == key:
                folder.remove()
        finally:
            folder.close()


def take_up(
    folder: Folder, campaign: Campaign, values: Sequence[CampaignSection], key: str, fresh: bool
) -> Iterator[str]:
    """Take up the contents of the folder, which is locked; returns messages. Raises Problem E350, E353."""
    if not folder.exists():
        return
    held = sum(task.cases for number in range(len(values)) for task in folder.named_tasks(number))
    if fresh:
        folder.empty()
        yield f"starts over: {held:,} cases that were done before are removed"
        return
    if not held and not folder.submitted and not folder.recorded:  # the earlier run had done nothing
        folder.empty()
        return
    description = folder.described()
    if description["key"] != key:
        raise Problem(_of_another(folder, campaign, values, description))


def describe(folder: Folder, campaign: Campaign, sections: Iterable[CampaignSection], key: str) -> None:
    """Write the description of the computations into the folder."""
    folder.describe(
        campaign.plan,
        sections,
        stops_early=[number for number, part in enumerate(campaign.parts) if part.open_ended],
        searches={number: part.most for number, part in enumerate(campaign.parts) if part.searches},
        key=key,
        archive=campaign.output.name,
        histories=campaign.words,
        float32=any(part.single for part in campaign.parts),
        verify=campaign.verify,
        **({} if campaign.kept_rows.all else {"rows": campaign.kept_rows.word}),
    )


def described(folder: Folder) -> Campaign:
    """The campaign of a folder, as it was written down. Raises Problem."""
    description = folder.described()
    if beside(folder.path.with_name(description["archive"])).name != folder.path.name:
        message = f"{folder.path} says that it fills {description['archive']}, which has another folder"
        raise Problem(error("E350", message, help="give the folder the name back that it had"))
    plan = folder.plan()
    first = sorted(folder.sections().values(), key=lambda section: section.number)
    selected = [(section.prepared.experiment, section.rows) for section in first[: len(plan.experiments)]]
    return prepare(
        plan,
        output=folder.path.with_name(description["archive"]),
        selected=selected,
        histories=description["histories"],
        float32=description["float32"],
        verify=description.get("verify", "auto"),
        rows=description.get("rows", "all"),
    )


def _of_another(
    folder: Folder, campaign: Campaign, values: Sequence[CampaignSection], description: dict[str, Any]
) -> Any:
    """The error for a folder that holds cases of another campaign, with what differs (E353)."""
    done = sum(task.cases for number in range(len(description["sections"])) for task in folder.named_tasks(number))
    try:
        differences = changes(folder.plan(), campaign.plan)
    except Problem:
        differences = ["its plan cannot be read any more"]
    if not differences:
        differences = _other_work(campaign, values, description)
    message = f"{folder.path} holds {done:,} cases of another campaign, and is left as it is"
    return error("E353", message, help=changed_since(differences))


def _other_work(campaign: Campaign, values: Sequence[CampaignSection], description: dict[str, Any]) -> list[str]:
    """Differences besides the plan between a campaign and the one in its folder."""
    before = description["sections"][: len(values)]
    if [len(section.rows) for section in values] != [section.get("cases") for section in before]:
        return ["other cases were asked for"]
    if [section.code for section in values] != [section.get("code") for section in before]:
        return [f"MET's own models or code (it was begun by version {description.get('met')})"]
    if [(section.recorded, section.single) for section in values] != [
        (section.get("recorded"), section.get("single")) for section in before
    ]:
        return ["what is kept of histories (`--histories`, `--float32`)"]
    return ["which cases were asked for, or whose histories are kept (`--case`, `--histories`)"]


def _asked_sum(campaign: Campaign) -> str:
    """A digest of the plan, the cases, and the choice of histories."""
    summed = hashlib.sha256(json.dumps([campaign.keep.failed, campaign.keep.worst]).encode())
    if campaign.verify != "auto":
        summed.update(f"verify {campaign.verify}".encode())
    if not campaign.kept_rows.all:
        summed.update(f"rows {campaign.kept_rows.word}".encode())

    def refer(experiment: Any, index: int) -> dict[str, Any]:
        if not index and campaign.kept_rows.all:  # else the campaign's key covers it, which depends on all inputs
            for _, _, values in plan_file.table_pieces(experiment):
                summed.update(values.tobytes())
        return {"index": index}

    summed.update(plan_file.dumps(campaign.plan, refer).encode())
    for part in campaign.parts:
        for piece in blocks(len(part.rows)):
            summed.update(np.asarray(part.rows[piece]).tobytes())
        summed.update(b"kept" + part.history_places.tobytes())
    return summed.hexdigest()


def _file_sum(path: Path) -> str:
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
