"""A search as a campaign: each generation is a batch of ordinary cases, and its results decide the next one.

The next cases depend only on the search and on the shards. So a campaign that was killed asks for the same cases again,
finds them done, and goes on to the same bits and the same answer; it does not matter who ran which case, or when.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from batch.campaigns import tasks
from batch.campaigns.drive import Count, Driver, Stopped
from batch.campaigns.folder import uncovered
from batch.campaigns.judging import judged_designs
from batch.campaigns.points import grown, grown_program, with_cases, write_points
from batch.campaigns.tasks import CampaignSection, Task
from batch.queries.search_answers import progress
from met import run as engine
from met.analysis.linear.gradient import FAILED, GradientProgram
from met.analysis.stability import margins_at_start
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.plan import Experiment
from met.plan.judged import Requirement
from met.plan.searches import Confirmation, Search
from met.run import DONE, Run
from met.searches import search_method, starts_of, steps_of
from met.searches.answer import Answer, answer, designs_that_stand
from met.searches.slopes import CaseSlopes
from met.searches.values import MET, MetricLimit, hurt, served


class TuningSlopes:
    """Slopes of a campaign's tuning (`SlopeSource`). The program is compiled when slopes are first asked for.

    The results depend on the cases alone, to the bit, so a resumed tuning asks for the same cases again.

    requirements  of the run, by which each case is judged
    """

    def __init__(self, experiment: Experiment) -> None:
        assert experiment.search is not None
        self._experiment, self._search = experiment, experiment.search
        self.requirements: Sequence[Requirement] = experiment.requirements
        names = (self._search.metric, *(requirement.metric for requirement in experiment.requirements))
        self._metrics = tuple(dict.fromkeys(names))

    @cached_property
    def _program(self) -> GradientProgram:
        return GradientProgram(self._experiment, len(self._search.parameters))

    def slopes(self, cases: np.ndarray) -> CaseSlopes | str:
        """The slopes of these cases, or the reason why there are none (`SlopeSource.slopes`)."""
        experiment = with_cases(self._experiment, cases)
        try:
            case_slopes = self._program.of(range(len(cases)), self._metrics, experiment=experiment, edges=False)
        except Problem as refused:
            return refused.diagnostics[0].message
        done, why_not = np.ones(len(cases), dtype=bool), dict[str, str]()
        for (case, metric, _), why in case_slopes.why_not.items():
            name = case_slopes.metrics[metric]
            done[case] &= why != FAILED
            why_not.setdefault(name, f"`{name}`: {why}")
        values = dict(zip(case_slopes.metrics, case_slopes.value.T, strict=True))
        slopes = {name: case_slopes.slope[:, number] for number, name in enumerate(case_slopes.metrics)}
        return CaseSlopes(done, values, slopes, why_not)


READS = 2
"""Number of tries to read back results that were just computed."""


def check_first_generation(experiment: Experiment) -> None:
    """Refuse a plan of a search whose cases are not the search's first generation. Raises Problem E302."""
    assert experiment.search is not None
    first_generation = search_method(experiment.search).ask()
    table = np.stack([np.asarray(coordinate.values) for coordinate in experiment.cases.coordinates], axis=1)
    if first_generation.shape != table.shape or not (first_generation == table).all():
        message = f"the cases of `{experiment.name}` in this plan are not those that it begins with"
        helps = "they were changed, or are of another version of MET: make the plan again from its deck"
        raise Problem(error("E302", message, help=helps))


DISK = "stability:disk"
"""The name, among metrics, of the disk margin by which a tuning is steered: no metric of a deck has it."""


def aimed_at(least_margin: float) -> float:
    """The disk margin at which a tuning aims, 2 % above the least and below 2: it looks at some frequencies, and where
    cases begin."""
    return min(1.02 * least_margin, 0.5 * (least_margin + 2.0))


@frozen
class _LeastDisk:
    """The requirement of a least disk margin, as `met.searches.values` takes one."""

    limit: float
    metric: str = DISK
    comparison: str = ">="


class CampaignSearch:
    """A search on its way.

    section  all cases that were asked for so far, in the order in which they were
    table    the same, [case, coordinate], SI
    worth    what each of those is worth that are done, by the least margin too where that steers
    """

    def __init__(self, section: CampaignSection) -> None:
        experiment = section.prepared.experiment
        assert experiment.search is not None
        self.search: Search = experiment.search
        self.section = section
        self.worth = np.empty(0)
        self._requirements = experiment.requirements
        self._metrics: dict[str, list[np.ndarray]] = {}
        self._done: list[np.ndarray] = []
        self._by_requirements: list[np.ndarray] = []
        self._method = search_method(self.search, TuningSlopes(experiment) if self.search.gradients else None)
        self.table = np.empty((0, len(experiment.cases.coordinates)))
        self._generations: list[int] = []

    def grow(self) -> tuple[int, int] | None:
        """Ask for the next generation: the stretch of its cases; None when the search has ended, and the section is
        whole."""
        generation, first = self._method.ask(), len(self.table)
        if not len(generation):
            self._complete()
            return None
        self.table = np.concatenate([self.table, generation])
        self._generations.append(len(generation))
        self.section = grown(self.section, self.table)
        return first, len(self.table)

    def take(self, run: Run) -> None:
        """Take the results of the last generation's cases, in their order."""
        done = run.status == DONE
        goal = run.metrics[self.search.metric]
        if self.search.kind == "tune":
            worth = self._served(run, done, self._requirements, run.metrics)
            self._by_requirements.append(worth)
            if self.search.steers and (worth < MET).any():
                limits: list[MetricLimit] = [*self._requirements, _LeastDisk(aimed_at(self.search.least_margin))]
                worth = self._served(run, done, limits, {**run.metrics, DISK: self._disks(run, worth < MET)})
        else:
            worth = hurt(goal, self.search.largest, done)
        self._done.append(done)
        for name, values in run.metrics.items():
            self._metrics.setdefault(name, []).append(values)
        self.worth = np.concatenate([self.worth, worth])
        self._method.tell(worth)

    def _served(
        self, run: Run, done: np.ndarray, limits: Sequence[MetricLimit], metrics: Mapping[str, np.ndarray]
    ) -> np.ndarray:
        return served(run.metrics[self.search.metric], self.search.largest, done, limits, metrics, self.search.margin)

    def _disks(self, run: Run, wanted: np.ndarray) -> np.ndarray:
        """The least disk margin of the loops of these cases where they begin, [case]; infinite where there is none, and
        where it is not wanted."""
        disks = np.full(len(run.case), np.inf)
        rows, least = run.case[wanted].tolist(), aimed_at(self.search.least_margin)
        margins = margins_at_start(self.section.prepared.experiment, rows, least)
        if margins is not None:
            disks[wanted] = margins
        return disks

    @property
    def answer(self) -> Answer:
        """The best so far."""
        metrics = {name: np.concatenate(parts) for name, parts in self._metrics.items()}
        table = self.table[: len(self.worth)]
        return answer(self.search, table, np.concatenate(self._done), metrics, self._requirements)

    def _complete(self) -> None:
        """Complete the search at its end: its generations, its starts, the stability of its designs, and the answer on
        fresh cases where the deck asks for it."""
        prepared = self.section.prepared
        search = replace(self.search, generations=tuple(self._generations), **steps_of(self._method))
        search = replace(search, starts=starts_of(self._method, search, self.table, self.worth))
        if search.kind == "tune" and search.least_margin:
            designs = designs_that_stand(search, self.table, self.worth)
            if search.steers and not designs:  # none keeps the margin: judge those that meet the requirements
                designs = designs_that_stand(search, self.table, np.concatenate(self._by_requirements))
            search = replace(search, judged=judged_designs(prepared, search, designs))
        self.search = search
        if search.fresh and self.answer.stands:
            self.search = search = replace(search, confirmation=(self._confirmation(self.answer),))
        experiment = replace(prepared.experiment, search=search)
        self.section = replace(self.section, prepared=prepared.of_cases(experiment))

    def _confirmation(self, best: Answer) -> Confirmation:
        """The result of a tuning's answer in fresh cases, which did not choose it: the best design is run with each row
        of plant values that the search drew for this. best: the answer so far"""
        search, prepared = self.search, self.section.prepared
        chosen = self.table[best.case, : len(search.parameters)]
        table = np.array([[*chosen, *plant] for plant in search.fresh])
        program = grown_program(prepared, table)
        rows = np.arange(len(table))
        run = engine.results(program, rows, None, engine.compute(program, rows, record=False)[1], {})
        done = run.status == DONE
        worth, goals = self._served(run, done, self._requirements, run.metrics), run.metrics[search.metric][done]
        known = goals[~np.isnan(goals)]
        worst = float(known.min() if search.largest else known.max()) if len(known) else np.nan
        return Confirmation(search.confirms, len(table), int((~done).sum()), int((done & (worth >= MET)).sum()), worst)


def run_search(driver: Driver, search: CampaignSearch, sections: dict[int, CampaignSection]) -> None:
    """Run a search to its end. Raises Stopped.

    sections  of the campaign by their numbers, as the executor looks them up; the search's grows in it
    """
    number = search.section.number
    driver.counts[number] = Count()
    with driver.telling(search.section, cases=search.search.at_most):
        while (stretch := search.grow()) is not None:
            section = sections[number] = search.section
            write_points(driver.folder.path, number, search.table)
            shards, missing = _held(driver, section, *stretch, tell=True)
            for _ in range(READS):
                if missing:
                    driver.work(section, missing)
                    shards, missing = _held(driver, section, *stretch, tell=False)
            if missing:
                raise Stopped(f"what is computed of {section.name} cannot be read back from {driver.folder.shards}")
            search.take(_results(section, *stretch, shards))
            driver.more = progress(search.answer, section.prepared.experiment)
            driver.tell()
            driver.check()
    sections[number] = search.section


Held = list[tuple[Task, tasks.Shard]]
"""Shards with their tasks."""


def _held(
    driver: Driver, section: CampaignSection, first: int, last: int, *, tell: bool
) -> tuple[Held, list[tuple[int, int]]]:
    """The shards (files of results) that there are for a stretch of cases, and the parts of it that are missing.

    tell  whether what is found counts as done before, and what is no shard is told of
    """
    count, end, new_shards = driver.counts[section.number], first, list[tuple[Task, tasks.Shard]]()
    for task, held_shard in driver.folder.sound_shards(section, driver.messages, (first, last)):
        if task.last > end:
            new_shards.append((task, held_shard))
            if tell:
                count.done += task.last - max(end, task.first)
                count.failed += held_shard.failed_from(max(0, end - task.first))
                count.seconds += held_shard.seconds
            end = task.last
    inside = [Task(task.section, task.first - first, task.last - first) for task, _ in new_shards]
    return new_shards, [(first + a, first + b) for a, b in uncovered(inside, last - first)]


def _results(section: CampaignSection, first: int, last: int, shards: Held) -> Run:
    """The results of a stretch of cases from its shards; a case counts once, as it is merged."""
    outputs, fates, end = list[np.ndarray](), dict[int, tuple[int, str]](), first
    for task, held_shard in shards:
        skipped = max(0, end - task.first)
        outputs.append(held_shard.outputs[skipped:])
        fates |= {task.first + case - first: fate for case, fate in held_shard.fates.items() if case >= skipped}
        end = task.last
    return engine.results(section.prepared, np.arange(first, last), None, np.concatenate(outputs), fates)
