"""A campaign: the cases of a plan to run, and the results to keep.

`prepare` settles everything that can be refused (names, cases, room on the disk, the output) and writes nothing;
batch/campaigns/performing.py runs the missing cases, and merges them.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from batch.archive import layout as archive_layout
from batch.campaigns import choosing
from batch.campaigns.folder import Folder, beside
from batch.campaigns.keep import Keep, KeptRows, as_list, keep, kept_before, kept_by_outcome, kept_rows, point_sizes
from batch.campaigns.outcomes import CaseOutcomes
from batch.campaigns.output import check_output, check_room, default_output
from batch.campaigns.searching import check_first_generation
from batch.campaigns.tasks import CampaignSection
from batch.campaigns.verification.verifying import WORDS as VERIFY_WORDS
from batch.campaigns.verification.verifying import Verify
from ic.printing.columns import size as size_text
from met import run as engine
from met.diagnostic import Problem, error
from met.distinct import distinct
from met.frozen import frozen
from met.outputs import path_of
from met.plan import Experiment, Plan
from met.plan.columns import CaseValues, are_among, places_among

KEPT_BYTES = 1 << 30
"""Histories are kept by default while the archive stays below this size."""

OUTPUTS = 8
"""Number of values of a case in a shard besides its coordinates and metrics."""


@frozen
class Wires:
    """Real beds at the wires. late: ticks of their delay that pass on the wires"""

    late: int


@frozen
class CampaignPart:
    """The cases of one experiment that are run.

    rows            of its case table, rising
    history_places  places in `rows` of the cases whose histories are kept whatever comes of them
    later           how many more may be chosen when all are done, at most
    single          whether histories are kept as numbers of four bytes
    wires           whether its beds are real ones, and how late these are (met.program.build.build); None: they are
                    emulated
    stops_early     whether its cases are run only until what is required of them is decided; then `rows` are the most
    written         the number of cases that have a row in the archive, about; None: all
    searches        whether what its cases give decides which ones are run next; then `rows` are the first generation
    keeps_best      whether of a search the history of its answer is kept
    """

    experiment: Experiment
    rows: CaseValues
    history_places: np.ndarray
    later: int = 0
    single: bool = False
    wires: Wires | None = None
    stops_early: bool = False
    written: int | None = None
    searches: bool = False
    keeps_best: bool = False

    @property
    def most(self) -> int:
        """The number of cases that are run, at most."""
        search = self.experiment.search
        return search.at_most if self.searches and search is not None else len(self.rows)

    @property
    def open_ended(self) -> bool:
        """True if it is not known beforehand how many cases are run."""
        return self.stops_early or self.searches

    def prepared(self) -> engine.Prepared:
        """The program that runs these cases."""
        if self.wires is None:
            return engine.prepare(self.experiment)
        return engine.prepare(self.experiment, wire=True, late=self.wires.late)

    @property
    def recorded(self) -> int:
        """The number of cases whose histories are kept, at most."""
        return (
            self.most if self.all_recorded else min(self.most, len(self.history_places) + self.later + self.keeps_best)
        )

    @property
    def all_recorded(self) -> bool:
        return 0 < len(self.rows) == len(self.history_places)

    @property
    def bytes(self) -> int:
        """Approximate size of this part in the archive."""
        described = archive_layout.PARAMETER_TEXT * len(self.experiment.parameters)
        rows = self.most if self.written is None else min(self.written, len(self.rows))
        return archive_layout.layout(self.experiment, rows, self.recorded, self.single).bytes + described

    @property
    def shard_bytes(self) -> int:
        """Approximate size of this part's shards."""
        numbers = OUTPUTS + len(self.experiment.cases.coordinates) + len(self.experiment.metrics)
        histories = self.recorded * self.experiment.structure.history_bytes // (2 if self.single else 1)
        return 8 * numbers * self.most + histories


@frozen
class Campaign:
    """A campaign that is ready to run and fully checked. words: the choice of histories, as `prepare` takes it; verify:
    the cases that are run with shorter steps too (batch/campaigns/verification); kept_rows: the choice of cases
    with rows in the archive."""

    plan: Plan
    parts: tuple[CampaignPart, ...]
    keep: Keep
    words: tuple[str | int, ...]
    output: Path
    notes: tuple[str, ...] = ()
    verify: Verify = "auto"
    kept_rows: KeptRows = KeptRows()

    @property
    def cases(self) -> int:
        return sum(part.most for part in self.parts)

    @property
    def run_names(self) -> list[str]:
        """The runs and sweeps, by the names by which they were asked for, each once."""
        return list(dict.fromkeys(part.experiment.name_in_deck for part in self.parts))

    @property
    def open_ended(self) -> bool:
        """True if the number of cases is not known beforehand: then `cases` and `bytes` are upper bounds."""
        return any(part.open_ended for part in self.parts)

    @property
    def bytes(self) -> int:
        """Approximate size of the archive."""
        return sum(part.bytes for part in self.parts)

    def bytes_of(self, histories: Sequence[tuple[CampaignPart, int]]) -> int:
        """Approximate size of the histories of these numbers of cases of each part, in shards and in the archive,
        bytes."""
        whole = sum(part.experiment.structure.history_bytes // (2 if part.single else 1) * n for part, n in histories)
        return self.bytes + 2 * whole

    @property
    def bytes_missing(self) -> int:
        """Approximate number of bytes that the disk must still take until the archive is whole."""
        shards = sum(part.shard_bytes for part in self.parts)
        return self.bytes + shards - min(shards, Folder(beside(self.output)).bytes())


def prepare(
    plan: Plan,
    *,
    output: str | os.PathLike[str] | None = None,
    experiments: Sequence[str] | None = None,
    cases: Sequence[int | str] | None = None,
    histories: str | int | Sequence[str | int] = "default",
    float32: bool = False,
    selected: Sequence[tuple[Experiment, CaseValues]] | None = None,
    history_rows: Mapping[str, np.ndarray] | None = None,
    wires: Wires | None = None,
    verify: Verify = "auto",
    decided: Collection[str] = (),
    rows: str = "all",
) -> Campaign:
    """Determine the cases to run, without writing anything; raises Problem for anything that would stop the run later.

    output        None: `default_output`, in the current folder
    experiments   names; None: all of the plan's
    cases         positions in the case table, `7` or `"#7"`, or the beginning of a case_id; None: all
    histories     what to keep (batch/campaigns/keep.py), one word or several
    float32       keep histories as numbers of four bytes
    selected      experiments with rows of their case tables, in place of `experiments` and `cases`
    history_rows  rows whose histories are kept, by the experiment's name, in place of `histories`
    wires         where it is run on real beds: then nothing is verified
    verify        which cases are run again with shorter steps: "none", "some", "all", or "auto": some where it is cheap
    decided       experiments, by name, whose rows in `selected` are those after which it was decided what is required
    rows          of which cases the archive has rows: "all", or a "summary" and the rows that it names,
                  "worst:N:METRIC" and the worst besides (batch/campaigns/keep.py)
    """
    if verify not in VERIFY_WORDS:
        raise ValueError(f"verify is one of {', '.join(VERIFY_WORDS)}, and not {verify!r}")
    all_of = None
    if selected is None:
        chosen = choosing.experiments_named(plan, experiments)
        all_of = sum(experiment.cases.count for experiment in chosen)
        selected = choosing.select_rows(chosen, cases)
    selected = [(experiment, rows) for experiment, rows in selected if len(rows)]
    if not selected:
        raise Problem(error("E311", "there is no case to run", help="`met cases DECK` lists them"))
    named = [experiment for experiment, _ in selected]
    target = path_of(output) if output is not None else default_output(plan, experiments, selected, all_of)
    chosen_rows = kept_rows(rows, named)
    if not chosen_rows.all:
        histories = _histories_of_a_summary(rows, histories, verify)
    wanted = keep(histories, named)
    words = tuple(as_list(histories))
    parts = tuple(_parts(selected, wanted, float32, decided))
    if not chosen_rows.all:
        parts = tuple(_summarised(part, chosen_rows) for part in parts)
    if history_rows is not None:
        parts = tuple(
            replace(part, history_places=places_among(part.rows, history_rows[part.experiment.name])) for part in parts
        )
    notes: list[str] = []
    whole = sum(part.bytes for part in parts)
    if wanted.default and whole > KEPT_BYTES:
        wanted, words = Keep(), ("none",)
        take = "may take" if any(part.open_ended for part in parts) else "would take"
        parts = tuple(_parts(selected, wanted, float32, decided))
        notes.append(
            f"histories {take} {size_text(whole)}, over {size_text(KEPT_BYTES)}: metrics only are kept "
            f"(`--histories all` keeps them; any case can be run again alone: `--case '#0'`)"
        )
    parts = tuple(replace(part, wires=wires) for part in parts)
    for part in parts:
        if part.searches:
            check_first_generation(part.experiment)
            if wires is not None:
                message = f"`{part.experiment.name}` chooses its cases as it goes, which is not done on motor beds"
                helps = "`met run` searches with beds that are emulated; a run with what it finds is driven on them"
                raise Problem(error("E313", message, help=helps))
    kept_plan = replace(plan, experiments=tuple(part.experiment for part in parts), selected=())
    words = tuple("all" if word == "default" else word for word in words)
    checked: Verify = "none" if wires else verify
    campaign = Campaign(kept_plan, parts, wanted, words, target, tuple(notes), checked, chosen_rows)
    check_output(target, kept_plan)
    if not target.exists():  # an existing one may be whole, and need nothing: then `perform` decides
        check_room(target, campaign.bytes_missing)
    return campaign


def _histories_of_a_summary(rows: str, histories: str | int | Sequence[str | int], verify: Verify) -> Literal["none"]:
    """The choice of histories beside `--rows` other than `all`: none. Raises Problem E351 for any other, and where all
    cases should be verified, which needs their rows."""
    if as_list(histories) not in (["default"], ["none"]):
        message = f"rows `{rows}` keep no histories"
        remedy = "`met run ARCHIVE.h5 --case '#7'` computes a case again, with its history; `--rows all` keeps any"
        raise Problem(error("E351", message, help=remedy))
    if verify == "all":
        message = f"rows `{rows}` do not go with all cases verified, of which each would need its row"
        raise Problem(error("E351", message, help="`--verify some` verifies those that it chooses; `--rows all`"))
    return "none"


def _summarised(part: CampaignPart, rows: KeptRows) -> CampaignPart:
    """A part that the archive summarises. Raises Problem E351 where it has too many design points, or stops by its
    results."""
    experiment = part.experiment
    if part.open_ended:
        does = "chooses its cases by what others gave" if part.searches else "stops when its requirements are decided"
        message = f"`{experiment.name_in_deck}` {does}, which takes a row a case"
        raise Problem(error("E351", message, help="leave `--rows` away: its cases are few"))
    points = len(point_sizes(experiment, part.rows))
    named = 2 * len(experiment.metrics) + (points + 1) * len(experiment.requirements)
    return replace(part, written=rows.worst + named)


def _parts(
    selected: Sequence[tuple[Experiment, CaseValues]], wanted: Keep, single: bool, decided: Collection[str]
) -> Iterator[CampaignPart]:
    """The experiments with their histories to keep. Raises Problem E311, E312 for unknown cases."""
    chosen = choosing.select_rows([experiment for experiment, _ in selected], wanted.cases) if wanted.cases else []
    named = {experiment.name: rows for experiment, rows in chosen}
    strays, run = set[int](), set[int]()
    for experiment, rows in selected:
        own = np.asarray(named.get(experiment.name, rows[:0]))
        among = are_among(rows, own)
        strays.update(experiment.cases.table[row] for row in own[~among])
        run.update(experiment.cases.table[row] for row in own[among])
    if strays - run:
        case = min(strays - run)
        raise Problem(error("E351", f"the history of case #{case} cannot be kept: it is not among those to run"))
    for experiment, rows in selected:
        own = np.asarray(named.get(experiment.name, np.empty(0, np.int64)))
        has_history = experiment.structure.history_bytes > 0
        # cases that a user chooses are all run, whatever they show
        whole = len(rows) == experiment.cases.count or experiment.name in decided
        searches = experiment.search is not None and not experiment.search.complete and whole
        before = has_history and not (searches and wanted.default)
        yield CampaignPart(
            experiment,
            rows,
            history_places=kept_before(wanted, experiment, rows, own) if before else np.empty(0, np.int64),
            later=wanted.at_most(len(rows)) if has_history else 0,
            single=single and has_history,
            stops_early=experiment.cases.until_shown > 0 and whole,
            searches=searches,
            keeps_best=searches and wanted.default and has_history,
        )


def values_sections(campaign: Campaign) -> list[CampaignSection]:
    """The first pass: all cases, with their histories where those of all cases are kept."""
    return [
        CampaignSection(number, number, part.prepared(), part.rows, part.all_recorded, part.single)
        for number, part in enumerate(campaign.parts)
    ]


def histories_section(
    campaign: Campaign, values: CampaignSection, results: Callable[[], CaseOutcomes]
) -> CampaignSection | None:
    """The second pass over an experiment: the cases whose histories are kept, where that is not all of them.

    results  what became of its cases
    """
    part = campaign.parts[values.experiment]
    if values.recorded or not part.experiment.structure.history_bytes:
        return None
    history_places = part.history_places
    if campaign.keep.later:
        history_places = distinct(
            np.concatenate([history_places, kept_by_outcome(campaign.keep, part.experiment, results())])
        )
    if not len(history_places):
        return None
    number = len(campaign.parts) + values.experiment
    return CampaignSection(
        number, values.experiment, values.prepared, part.rows[history_places], True, part.single, values.begun
    )


def with_known_rows(
    campaign: Campaign, sections: Sequence[CampaignSection], best: Mapping[int, Sequence[int]]
) -> tuple[Campaign, list[str]]:
    """The campaign of the cases that these sections have, one for each part; and a note on each case that is none of
    them, and whose history was asked for by name.

    best  rows that answer a search, by the number of its section
    """
    parts, notes = [], []
    for part, section in zip(campaign.parts, sections, strict=True):
        experiment = section.prepared.experiment
        wanted = section.rows if part.searches and part.all_recorded else part.rows[part.history_places]
        if part.keeps_best:
            wanted = np.concatenate([wanted, best[section.number]])
        known_places = np.flatnonzero(np.isin(section.rows, wanted))
        parts.append(replace(part, experiment=experiment, rows=section.rows, history_places=known_places))
        for _, named in choosing.select_rows([experiment], campaign.keep.cases) if part.stops_early else ():
            for case in experiment.cases.table[named[~np.isin(named, section.rows)]].tolist():
                notes.append(f"no history of case #{case} is kept: what is required was decided without it")
    plan = replace(campaign.plan, experiments=tuple(part.experiment for part in parts))
    return replace(campaign, plan=plan, parts=tuple(parts)), notes
