"""Performing a campaign: find finished cases, run missing ones, merge all into the archive, and rename it.

However it ends, nothing that took a second of work or more is lost: the shards stay in the folder beside the archive,
and the next run of the same campaign goes on from there.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from batch.archive.sink import FileBusy as ArchiveBusy
from batch.archive.sink import temporary_of
from batch.campaigns import instants, merge, resuming
from batch.campaigns.campaign import Campaign, histories_section, values_sections, with_known_rows
from batch.campaigns.drive import Count, Driver, Executor, Progress, Stopped, TooManyFailures
from batch.campaigns.folder import Folder, FolderBusy, beside, uncovered
from batch.campaigns.keep import Summarised, summarise, worst_wanted
from batch.campaigns.outcomes import CaseOutcomes, CountedCases
from batch.campaigns.output import busy, cannot_write, check_room, publish
from batch.campaigns.searching import CampaignSearch, run_search
from batch.campaigns.status import Reporter, died_lines
from batch.campaigns.tasks import CampaignSection
from batch.campaigns.until_shown import StoppingPoints, run_until_shown, without_dropped
from batch.campaigns.verification import verifying
from met.analysis.linear import metrics as linear_metrics
from met.diagnostic import Diagnostic, Problem, error
from met.frozen import frozen
from met.outputs import quoted
from met.plan.columns import places_among

if TYPE_CHECKING:
    from batch.archive.write import ArchiveWriter

WORTH_SECONDS = 1.0
"""Computing time, s, below which unfinished work is discarded where a campaign ends early: repeating it is as fast as
reading it."""

ATTEMPTS = 3
"""Number of times that shards which turn out damaged in merging are run again."""


@frozen
class Performed:
    """A campaign that has been run.

    seconds  by experiment: of computing, on all workers together
    whole    whether all was there before, so that nothing was run
    notes    what happened on the way: what was resumed, which shards did not count
    warned   what the steps do not follow at instants that cases passed
    counted  by experiment: how many cases met what is required, as they were merged; empty where nothing was run
    """

    seconds: Mapping[str, float]
    whole: bool = False
    notes: tuple[str, ...] = ()
    warned: tuple[Diagnostic, ...] = ()
    counted: Mapping[str, CountedCases] = field(default_factory=dict)


class TooMany(Problem):
    """Raised where more cases failed than were allowed: an answer, not a mistake of the user."""


def perform(
    campaign: Campaign,
    *,
    executor: Executor,
    fresh: bool = False,
    max_failures: int | None = None,
    together: bool = False,
    progress: Progress | None = None,
    ready: Callable[[], None] | None = None,
    say: Callable[[str], None] = lambda _: None,
    more: Callable[[], Mapping[str, Any]] = dict,
) -> Performed:
    """Run a campaign into its archive. Raises Problem. An interrupt passes through, with words of what is kept and how
    to go on; without any where nothing is.

    executor      who runs the tasks
    fresh         whether to start over where something is there
    max_failures  stop when more cases have failed
    together      put together what others have done; it cannot go on where cases are missing
    ready         called once the first kernel is there, so that something will be written
    say           told, as it comes, what is found of an earlier run
    more          what else stands beside the archive, asked when all cases are done
    """
    values, key = resuming.as_begun(Folder(beside(campaign.output)), campaign, values_sections(campaign))
    campaign = resuming.settled(campaign, values)
    finished = resuming.finished_state(campaign, key)
    if finished == resuming.WHOLE and not fresh:
        resuming.remove_leftovers(Folder(beside(campaign.output)), key)
        return Performed({}, whole=True)
    if not finished and not fresh and not together and not resuming.is_begun(Folder(beside(campaign.output)), key):
        resuming.guard(campaign)
    check_room(campaign.output, campaign.bytes_missing)
    values = [
        section if part.open_ended else now
        for part, section, now in zip(campaign.parts, values, instants.with_memories(values), strict=True)
    ]
    for value in values:
        linear_metrics.check(value.prepared)
    values[0].prepared.kernel  # noqa: B018 - what a model's mistake stops is stopped before anything is written
    folder = Folder(beside(campaign.output))
    try:
        folder.lock()
    except FolderBusy:
        raise Problem(busy(campaign.output)) from None
    except OSError as reason:
        raise Problem(cannot_write(campaign.output, reason)) from reason
    if not fresh and finished != resuming.WHOLE and resuming.finished_state(campaign, key) == resuming.WHOLE:
        folder.remove()  # another run has ended meanwhile
        return Performed({}, whole=True)
    if finished == resuming.DAMAGED and not fresh:
        say(f"{campaign.output} is not as it was written: it is made again")
    work = _CampaignWork(campaign, folder, values, key, max_failures, progress, say, more)
    try:
        work.begin(fresh)
        if ready is not None:
            ready()
        return work.run(executor, together)
    except KeyboardInterrupt as interrupt:
        raise type(interrupt)(work.leave("interrupted")) from None
    except TooManyFailures as reason:
        work.leave("stopped")
        raise TooMany(_stopped("E355", str(reason), work, ", with a larger `--max-failures`")) from None
    except Stopped as reason:
        work.leave("stopped")
        raise Problem(_stopped("E354", f"the campaign cannot go on: {reason}", work)) from None
    except ArchiveBusy:
        work.leave("stopped")
        raise Problem(busy(campaign.output)) from None
    except OSError as reason:
        raise Problem(cannot_write(campaign.output, reason, work.leave("stopped"))) from reason
    except BaseException:
        work.leave("stopped")
        raise
    finally:
        folder.close()


class _CampaignWork:
    """A campaign on its way, in its folder.

    whole   the campaign with the cases that it has in the end: less those that are dropped (`until_shown`), with those
            that were searched;  values, final_sections: its sections, as they were begun and with these cases
    """

    def __init__(
        self,
        campaign: Campaign,
        folder: Folder,
        values: list[CampaignSection],
        key: str,
        max_failures: int | None,
        progress: Progress | None,
        say: Callable[[str], None],
        more: Callable[[], Mapping[str, Any]],
    ) -> None:
        """Begin with all cases of the campaign; nothing is written yet. values: a section of cases for each part of the
        campaign; key: of the campaign (`resuming.campaign_key`); the rest: as for `perform`"""
        self.campaign, self.folder, self.key, self.say, self.more = campaign, folder, key, say, more
        self.sections = {section.number: section for section in values}
        self.values = self.final_sections = values
        self.whole = campaign
        self.notes: list[str] = []
        self.warned: dict[object, Diagnostic] = {}
        self.counted: dict[str, CountedCases] = {}
        self.summaries: dict[int, Summarised] = {}
        self.began = time.time()
        self.reporter = Reporter(folder, campaign.cases, progress)
        self.max_failures = max_failures
        self.driver: Driver | None = None
        self.ours = self.resumed = False

    def begin(self, fresh: bool) -> None:
        """Make the folder, or take up the existing one. Raises Problem E353 where it belongs to another campaign."""
        self.resumed = bool(self.folder.named_tasks(0)) and not fresh
        self._note(*resuming.take_up(self.folder, self.campaign, self.values, self.key, fresh))
        self._note(*(died_lines(self.folder) if self.resumed else ()))
        self.ours = True
        self.folder.finish_removal()
        resuming.describe(self.folder, self.campaign, self.values, self.key)
        self.folder.remove_partial_shards()

    def run(self, executor: Executor, together: bool) -> Performed:
        """Run all missing cases, and write the archive. Raises Stopped where cases stay missing."""
        driver = self.driver = Driver(self.folder, executor, self.reporter, self.max_failures, len(self.values))
        executor.open(self.folder, self.sections, driver.tell)
        try:
            for attempt in range(ATTEMPTS):
                searches = {value.number: CampaignSearch(value) for value in self.values if self._searches(value)}
                for number in searches:
                    driver.counts[number] = Count(self._done(self.values[number]))
                missing = [(value, driver.find(value)) for value in self.values if value.number not in searches]
                self._tell_found(first=not attempt)
                left = sum(last - first for _, stretches in missing for first, last in stretches)
                if together and left:
                    raise Stopped(f"{left:,} of {self.campaign.cases:,} cases are missing")
                early = [value for value in self.values if self.campaign.parts[value.experiment].stops_early]
                stops = {section.number: StoppingPoints(section) for section in early}
                for number, points in stops.items():
                    points.read(self.folder)
                    driver.counts[number].failed = points.failed
                for section, stretches in missing:
                    if section.number in stops:
                        run_until_shown(driver, section, stops[section.number])
                    else:
                        driver.run(section, stretches)
                for search in searches.values():
                    run_search(driver, search, self.sections)
                try:
                    self._settle(stops, searches)
                    self._summarise()
                    histories = self._histories(driver)
                    self.reporter.state("merging")
                    self._merge(histories)
                    break
                except merge.Missing as reason:
                    if attempt == ATTEMPTS - 1:
                        raise Stopped(f"{reason}, again and again") from None
        finally:
            executor.close()
        seconds = {section.name: 0.0 for section in self.values}
        for number, count in driver.counts.items():
            seconds[self.sections[number].name] += count.seconds
        self.folder.remove()
        notes, warned = tuple(self.notes), tuple(self.warned.values())
        return Performed(seconds, notes=notes, warned=warned, counted=self.counted)

    def leave(self, state: str) -> str:
        """Stop for now. Work worth keeping stays; returns its amount and place in words, or "" where nothing stays."""
        if not self.ours:
            return ""
        self.folder.remove_partial_shards()
        worth = self.resumed or self.folder.submitted or self.folder.recorded
        worth = worth or self.folder.seconds(WORTH_SECONDS) >= WORTH_SECONDS
        if not worth:
            self.folder.remove()
            return ""
        self.reporter.state(state)
        done = self._of_all(sum(map(self._done, self.values)))
        return f"{done} are kept in {self.folder.path}; the same command goes on"

    def _searches(self, section: CampaignSection) -> bool:
        return self.campaign.parts[section.experiment].searches

    def _done(self, section: CampaignSection) -> int:
        """The number of a section's cases that have a shard, sound or not."""
        tasks = self.folder.named_tasks(section.number)
        cases = max((task.last for task in tasks), default=0) if self._searches(section) else len(section.rows)
        return cases - sum(last - first for first, last in uncovered(tasks, cases))

    def _of_all(self, done: int) -> str:
        """The progress in words: so many cases of the total, where that is known."""
        return f"{done:,} cases" if self.campaign.open_ended else f"{done:,} of {self.campaign.cases:,} cases"

    def _settle(self, stops: Mapping[int, StoppingPoints], searches: Mapping[int, CampaignSearch]) -> None:
        """Go on with the final cases: those up to these stops, and those of these searches, by section."""
        if not stops and not searches:
            return
        self.final_sections = [
            without_dropped(self.folder, value, stops[value.number], 2 * len(self.values) + value.number)
            if value.number in stops
            else searches[value.number].section
            if value.number in searches
            else value
            for value in self.values
        ]
        self.final_sections = [
            now if section.number in stops or section.number in searches else section
            for section, now in zip(self.final_sections, instants.with_memories(self.final_sections), strict=True)
        ]
        best = {number: [search.answer.case] for number, search in searches.items()}
        self.whole, notes = with_known_rows(self.campaign, self.final_sections, best)
        self._note(*notes)

    def _summarise(self) -> None:
        """Go on with the few cases whose rows are kept, and a summary of all, if a summary is asked for."""
        if self.campaign.kept_rows.all:
            return
        sections, parts = [], []
        for part, section in zip(self.whole.parts, self.values, strict=True):
            self.reporter.begin(f"{section.name}, summing up", len(section.rows), 0, 0, "")
            summarised = summarise(
                section,
                merge.runs_in_blocks(self.folder, section, self._threads),
                self.campaign.kept_rows,
                verified=verifying.resolve(self.campaign.verify, section.prepared, len(section.rows)) == "some",
                progress=lambda cases: self.reporter.advance(cases, 0),
            )
            self.reporter.end()
            self.summaries[section.experiment] = summarised
            number = 2 * len(self.values) + section.number
            sections.append(merge.with_rows(self.folder, section, summarised.places, number))
            parts.append(replace(part, rows=sections[-1].rows))
        self.final_sections, self.whole = sections, replace(self.campaign, parts=tuple(parts))

    def _histories(self, driver: Driver) -> dict[int, CampaignSection]:
        """Run the second pass; its sections by experiment."""
        sections_again = {}
        for section in self.final_sections:
            histories = histories_section(self.whole, section, partial(self._results, section))
            if histories is not None:
                self.sections[histories.number] = sections_again[section.experiment] = histories
        if sections_again:
            parts = [
                (self.campaign.parts[section.experiment], len(section.rows)) for section in sections_again.values()
            ]
            check_room(self.campaign.output, self.campaign.bytes_of(parts))
            resuming.describe(self.folder, self.campaign, self.sections.values(), self.key)
            missing = [(section, driver.find(section)) for section in sections_again.values()]
            self._tell_found(first=False)
            for section, stretches in missing:
                driver.run(section, stretches)
        return sections_again

    def _results(self, section: CampaignSection) -> CaseOutcomes:
        return merge.results(self.folder, section, worst_wanted(self.campaign.keep, section.prepared.experiment))

    def _merge(self, histories: Mapping[int, CampaignSection]) -> None:
        """Write the archive from all shards, under a temporary name that becomes its own when it is whole."""
        from batch.archive.write import ArchivePart, ArchiveWriter
        from met.host.provenance import machine

        parts = []
        for part, values in zip(self.whole.parts, self.final_sections, strict=True):
            history_places = part.history_places
            if values.experiment in histories:
                rows = np.asarray(histories[values.experiment].rows)
                lost = merge.without_history(self.folder, values, histories[values.experiment])
                for row, why in lost.items():
                    case = part.experiment.cases.table[row]
                    again = f"`met run {quoted(self.campaign.output)} --case '#{case}'` tries again"
                    self._note(f"no history of case #{case} of `{values.name}` is kept: {why}; {again}")
                history_places = places_among(part.rows, rows[~np.isin(rows, list(lost))])
            program = values.prepared
            parts.append(
                ArchivePart(
                    part.experiment,
                    part.rows,
                    history_places,
                    part.single,
                    program.code_key,
                    program.result_keys,
                    part.experiment.cases.until_shown * part.stops_early,
                    values.experiment in self.summaries,
                )
            )
        temporary = temporary_of(self.campaign.output)
        writer = ArchiveWriter(temporary, self.whole.plan, parts)
        try:
            for number, section in enumerate(self.final_sections):
                self.reporter.begin(f"{section.name}, merging", len(section.rows), 0, 0, "")
                outcomes = merge.merge(
                    writer,
                    number,
                    self.folder,
                    section,
                    histories.get(number),
                    lambda cases: self.reporter.advance(cases, 0),
                    threads=self._threads,
                )
                writer.look_back(number)
                whole = section
                if number in self.summaries:
                    outcomes, whole = self.summaries[number].outcomes, self.values[number]
                    writer.put_summary(number, self.summaries[number].summary)
                self.counted[section.name] = outcomes.counted(len(parts[number].history_places))
                self._verify(writer, number, whole, outcomes)
                for step_warning in instants.step_warnings(whole, outcomes, self._threads):
                    self.warned.setdefault((step_warning.code, step_warning.at), step_warning)
                self.reporter.end()
            writer.finish()
            sidecar = {
                "archive": self.campaign.output.name,
                "began": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(self.began)),
                "seconds": round(time.time() - self.began, 6),
                "workers": self.driver.executor.about if self.driver else "",
                "experiments": self._timings(),
                "notes": self.notes,
                **self.more(),
                **resuming.proof(self.campaign, self.key, temporary),
                **machine(),
            }
            publish(self.campaign.output, temporary, sidecar)
            writer.close()
        except BaseException as reason:
            writer.abandon()
            if writer.failure is not None and isinstance(reason, Exception):
                raise writer.failure from reason
            raise

    @property
    def _threads(self) -> int | None:
        return getattr(self.driver and self.driver.executor, "threads", None)

    def _verify(self, writer: ArchiveWriter, number: int, section: CampaignSection, outcomes: CaseOutcomes) -> None:
        """Run some of an experiment's cases, which are all in the archive by now, with shorter steps, if that is
        wanted."""
        way = verifying.resolve(self.campaign.verify, section.prepared, len(section.rows))
        if way == "none":
            return
        experiment = self.whole.parts[number].experiment
        done = outcomes.done
        places = done.select(np.arange(done.set)) if way == "all" else verifying.chosen(experiment, outcomes)
        if len(places):
            own = {use.name for use in experiment.structure.metrics}
            named = writer.groups[number].layout.role("metric")
            names = {variable.key: variable.name for variable in named if variable.key in own}
            self.reporter.begin(f"{section.name}, with shorter steps", len(verifying.FACTORS) * len(places), 0, 0, "")
            verified = verifying.verify(
                experiment, section.rows[places], names, self._threads, lambda runs: self.reporter.advance(runs, 0)
            )
            writer.put_verified(number, verified)

    def _timings(self) -> list[dict[str, Any]]:
        """The number of cases of each experiment, and the seconds that they took, for the sidecar."""
        counts = self.driver.counts if self.driver else {}
        return [
            {
                "experiment": section.name,
                "cases": self.summaries[number].summary.cases if number in self.summaries else len(section.rows),
                "seconds": round(
                    sum(
                        counts[n].seconds
                        for n, s in self.sections.items()
                        if s.experiment == section.experiment and n in counts
                    ),
                    6,
                ),
            }
            for number, section in enumerate(self.final_sections)
        ]

    def _tell_found(self, *, first: bool) -> None:
        """Say what was found of an earlier run of the campaign."""
        driver = self.driver
        assert driver is not None
        self._note(*driver.messages)
        driver.messages.clear()
        done = sum(count.done for count in driver.counts.values())
        if first and done:
            self._note(f"goes on: {self._of_all(done)} are done")

    def _note(self, *texts: str) -> None:
        """Say these lines, and keep them for the archive's sidecar."""
        self.notes += texts
        for text in texts:
            self.say(text)


def _stopped(code: str, message: str, work: _CampaignWork, how: str = "") -> Diagnostic:
    """The error of a campaign that stopped, with what is kept of it. how: further words on how to go on"""
    going_on = f"what is done is kept in {work.folder.path}: the same command goes on{how}"
    helps = going_on if work.folder.path.exists() else "nothing was kept"
    return error(code, message, help=helps)
