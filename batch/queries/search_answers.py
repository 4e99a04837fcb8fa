"""The answer of a search in an archive: found from its cases alone, in words, with commands for the next steps."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from functools import cached_property
from typing import Any

import numpy as np

from batch.archive.limits import deck_unit
from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.archive.searched import search_of
from batch.queries.given import context
from batch.queries.pool import Pool
from batch.queries.requirements import GroupRequirement, group_requirements, outcomes
from batch.queries.signals import number_text, pretty_unit
from batch.queries.stability_words import KEPT, WIDTH, margin_words, stability_data, stability_texts, wrapped
from ic.driver.written_value import WrittenValue
from ic.printing.columns import count
from met.frozen import frozen
from met.outputs import quoted, setting_option, setting_path
from met.plan import Experiment
from met.plan.outputs import metric_units
from met.plan.searches import SHORTEST, Confirmation, Search
from met.run import DONE
from met.searches.answer import Answer, answer, nearest

OVER_CASES = re.compile(r" in [^<>]* of cases\b[^<>]*$")
"""The words by which a requirement is one over a share of cases."""

NEAR_BEST = 0.02
"""Share of a goal by which two starts of a tuning, or two halves of a search, may differ, and are taken to have come to
the same optimum."""

SLIGHTLY = 0.01
"""Share of a goal beyond which a candidate counts as worse than the answer of a tuning."""

ROUNDING = 1e-9
"""Share of the largest goal of all cases below which goals differ by rounding."""

NEAREST = 1
"""Number of requirements that are named as nearest to their limits."""


class SearchAnswer:
    """The answer of a search or a tuning whose cases are a group of an archive."""

    def __init__(self, group: ArchiveGroup, search: Search) -> None:
        self.group, self.search = group, search

    @staticmethod
    def of(group: ArchiveGroup) -> SearchAnswer | None:
        """The answer of a group; None where it is not a search, or has only some of its cases."""
        search = search_of(group)
        return None if search is None else SearchAnswer(group, search)

    @cached_property
    def best(self) -> Answer:
        """The best of the search's cases, or of a tuning's candidates."""
        return answer(self.search, *self._judged_cases)

    @cached_property
    def _judged_cases(self) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray], list[GroupRequirement]]:
        """Coordinates of the cases, a truth for each that reached its end, their metrics, and the requirements on
        these."""
        group = self.group
        columns = [group.values(variable.name) for variable in group.role("coordinate")]
        metrics = {variable.path: group.values(variable.name) for variable in group.role("metric")}
        by_name = {variable.name: variable.path for variable in group.role("metric")}
        required = [replace(requirement, metric=by_name[requirement.metric]) for requirement in self.required]
        return np.stack(columns, axis=1), group.values("status") == DONE, metrics, required

    def progress(self, most: int) -> list[tuple[int, int, Answer]]:
        """The best after some of the generations, `most` of them spread over all, the last among them: the number of
        the generation, the cases by then, the best of these."""
        ends = np.flatnonzero(np.diff(self.group.values("generation"), append=self.generations)) + 1
        some = np.unique(np.linspace(0, len(ends) - 1, min(len(ends), most)).astype(int))
        table, done, metrics, required = self._judged_cases
        return [
            (int(number), int(end), answer(self.search, table[:end], done[:end], cut(metrics, int(end)), required))
            for number, end in zip(some, ends[some], strict=True)
        ]

    @property
    def generations(self) -> int:
        """The number of its generations."""
        return int(self.group.values("generation")[-1]) + 1

    @property
    def position(self) -> int:
        """The position in the case table of the answer's representative case."""
        return int(self.group.values("case")[self.best.case])

    @cached_property
    def required(self) -> list[GroupRequirement]:
        """The requirements by which each case is judged: one over a share of cases applies to every case, and each
        occurs once."""
        by_condition: dict[tuple[str, str, float], GroupRequirement] = {}
        for group_requirement in group_requirements(self.group):
            of_every_case = replace(
                group_requirement, text=OVER_CASES.sub("", group_requirement.text), share=None, confidence=None
            )
            by_condition.setdefault(
                (group_requirement.metric, group_requirement.comparison, group_requirement.limit), of_every_case
            )
        return list(by_condition.values())

    @cached_property
    def ok(self) -> bool:
        """True if a tuning's result meets all requirements; for a search, if it found no case that fails or misses
        one."""
        if self.search.kind == "tune":
            return self.best.serves and all(confirmation.withstood for confirmation in self.search.confirmation)
        return bool((self.group.values("status") == DONE).all() and (outcomes(self.group) == 1).all())

    def values(self, case: int | None = None) -> Iterator[WrittenValue]:
        """The chosen values, for a deck's text or `--set`; those of another case, by its place, where one is given."""
        for parameter, variable in zip(self.search.parameters, self.group.role("coordinate"), strict=False):
            value = float(self.group.at(variable.name, [self.best.case if case is None else case])[0])
            yield WrittenValue(parameter.path, value, str(variable.attributes.get("deck_unit", variable.unit)))

    @property
    def draws(self) -> bool:
        """True if a tuning was judged against drawn cases, so that other draws may confirm it or not."""
        return any(variable.attributes.get("design") for variable in self.group.role("coordinate"))

    def goal(self, value: float) -> str:
        """A value of the goal, SI, in the deck's unit."""
        variable = next(metric for metric in self.group.role("metric") if metric.path == self.search.metric)
        scale = float(variable.attributes.get("deck_scale", 1.0))
        unit = str(variable.attributes.get("deck_unit", variable.unit))
        return goal_text(value, unit, scale)

    def lines(self) -> list[str]:
        """The answer in lines, without the commands for further steps."""
        best, search = self.best, self.search
        sureness = self._sureness() if best.stands else []
        out = [*self._tuned(), *self._by_slopes(), *sureness] if search.kind == "tune" else self._worst()
        if best.missed:
            out.append(f"  misses {', '.join(best.missed)}")
        elif best.rooms and not best.failed:
            out.append(f"  nearest to its limit: {best.rooms[0].text}, {100.0 * best.rooms[0].share:.3g} % inside")
        beyond = "worse" if search.kind == "search" else "better"
        out += [f"  {path} is at the {end} end of its range: beyond it may be {beyond}" for path, end in best.ends]
        out += [line for confirmation in search.confirmation for line in self._confirmed(confirmation)]
        return out + (self._border() if best.serves and search.kind == "tune" else [])

    def _confirmed(self, confirmation: Confirmation) -> list[str]:
        """Lines about the answer of a tuning in cases that did not choose it."""
        worst = f"{self.search.metric} is {self.goal(confirmation.worst)} in the worst"
        cases_text = f"{confirmation.cases:,} cases of {confirmation.against}"
        if confirmation.withstood:
            return wrapped(f"confirmed by all {cases_text}, which did not choose it: {worst}")
        bad = [
            f"{n:,} {what}"
            for n, what in ((confirmation.failed, "failed"), (confirmation.missed, "missed a requirement"))
            if n
        ]
        return wrapped(f"not confirmed: of {cases_text}, which did not choose it, {' and '.join(bad)}; {worst}")

    def _by_slopes(self) -> list[str]:
        """Lines about a tuning along exact slopes: its steps, and why there were no more."""
        search = self.search
        steps, why_not = search.along_slopes, search.without_slopes
        out = [f"  {steps:,} of them along exact slopes of the metrics"] if steps else []
        if why_not and search.gradients:
            out += wrapped(f"no slopes {'at some candidates' if steps else 'to go by'}: {why_not}")
        return out

    @cached_property
    def starts(self) -> list[float]:
        """The goal that each start of a tuning came to on all plants (the cases that it judges candidates on), SI,
        not-a-number where none did; none where the archive was made before MET kept its starts."""
        goal = self._judged_cases[2][self.search.metric]
        return [float(goal[start.best]) if start.best >= 0 else math.nan for start in self.search.starts]

    def _sureness(self) -> list[str]:
        """Lines about how sure it is that a tuning's optimum is the best: the goals that its starts came to."""
        optimum, reached = self.best, np.array(self.starts)
        if not np.isfinite(reached).any():
            return []
        if optimum.left is not None:
            words = "the tuning asks for it only where its cases begin, and the best by the goal does not keep it"
            if not self.search.steers:
                words = f"`least_margin = {self.search.least_margin:g};` in it makes it look for one that keeps it"
                words = f"the tuning went by the goal alone; {words}"
            return wrapped(f"not sure that it is the best with its margin: {words}")
        if len(reached) == 1:
            return wrapped("not sure that it is the best: there was one start alone; another `seed` may find better")
        best = np.nanmax(reached) if self.search.largest else np.nanmin(reached)
        near = np.abs(reached - best) <= max(NEAR_BEST * abs(best), self._rounding)
        if near.sum() > 1:
            share = f"{100.0 * NEAR_BEST:g} %"
            return wrapped(f"{near.sum()} of its {len(reached)} starts came to within {share} of one another")
        others = [
            self.goal(value).replace(" ", KEPT) if np.isfinite(value) else "none that meets all"
            for value in reached[~near]
        ]
        starts = f"{len(reached)} starts one alone came to {self.goal(float(best))}, the other{'s' * (len(others) > 1)}"
        return wrapped(f"not sure that it is the best: of {starts} to {', '.join(others)}; "
                       "another `seed` or a larger `at_most` may find better")  # fmt: skip

    def _border(self) -> list[str]:
        """The nearest tried candidates that do not meet the requirements, and that have a worse goal, in lines."""
        miss, out = self.best.miss, []
        if miss is None:
            out += ["  none of the candidates that were tried misses a requirement"] if self.required else []
        else:
            out += self._nearest(f"misses {miss.text}" if miss.text else "fails", miss.case, miss.distance)
        if (worse := self._worse) is not None and (miss is None or worse[1] != miss.distance):
            out += self._nearest(f"is worse by more than {100.0 * SLIGHTLY:g} %", *worse)
        return out

    def _nearest(self, what: str, place: int, distance: float) -> list[str]:
        case, away = int(self.group.values("case")[place]), f"{100.0 * distance:.2g} % of a range away"
        values = ", ".join(f"{value.path} = {value.text}".replace(" ", KEPT) for value in self.values(place))
        return wrapped(f"nearest tried that {what}: {away}, case #{case} with {values}")

    @property
    def _rounding(self) -> float:
        """The difference of goals that is of rounding."""
        goals = self._judged_cases[2][self.search.metric]
        return float(ROUNDING * np.abs(goals[np.isfinite(goals)]).max(initial=0.0))

    @cached_property
    def _worse(self) -> tuple[int, float] | None:
        """The nearest candidate whose goal is worse than the answer's on some plant (a case that candidates are judged
        on): its case, and its distance as of `nearest`. None where there is none, or where the answer's goal is 0 but
        for rounding."""
        table, done, metrics, _ = self._judged_cases
        goals, value = metrics[self.search.metric], self.best.value
        loss = value - goals if self.search.largest else goals - value
        worse = np.flatnonzero(done & (loss > SLIGHTLY * abs(value)))
        has_worse = abs(value) > self._rounding and len(worse)
        return nearest(self.search, table, self.best.case, worse) if has_worse else None

    @property
    def _cases(self) -> str:
        return f"{count(self.group.count, 'case')} in {count(self.generations, 'generation')}"

    @property
    def _tried(self) -> str:
        """The number of candidates that were run, on all plants (the cases that they are judged on) or on some."""
        candidates = np.unique(self._judged_cases[0][:, : len(self.search.parameters)], axis=0)
        return f"{count(len(candidates), 'candidate')} tried"

    @property
    def _cause(self) -> list[str]:
        """The cause of failure of the answer's representative case, in lines."""
        cause = str(self.group.at("cause", [self.best.case])[0])
        return textwrap.wrap(cause, WIDTH, initial_indent="  ", subsequent_indent="  ", break_on_hyphens=False)

    @property
    def _chosen(self) -> str:
        return ", ".join(f"{chosen.path} = {chosen.text}" for chosen in self.values())

    def _tuned(self) -> list[str]:
        """Lines about the result of a tuning: the values to use, what they miss, and how sure that is."""
        best, search = self.best, self.search
        none = f"none of the {self._tried} is found to meet all that is required; nearest: {self._chosen}"
        out = [f"use {self._chosen}" if self.ok else f"not advised: {self._chosen}" if best.stands else none]
        if best.failed:
            out += [f"  case #{self.position} of it fails; {self._cases}", *self._cause]
        else:
            among = f" in the worst of {best.tried} cases of {search.against}" if best.all > 1 else ""
            out.append(f"  {search.metric} is {self.goal(best.value)}{among}; {self._cases}")
        if best.confirmed and not best.stands and search.budget - self.group.count < SHORTEST * best.all:
            out.append(f"  its cases are spent, of {search.at_most:,} at most; a larger `at_most` goes on")
        if not best.stands and search.steers:
            out.append(f"  `least_margin = {search.least_margin:g};` is required too: without it more may be found")
        if not best.confirmed:
            out[0] = f"not tried with all that it must bear: {self._chosen}"
            out.append(
                f"  {best.tried} of {best.all} cases of {search.against} were run of it; a larger `at_most` goes on"
            )
        return [*out, *(self._stability() if best.stands else [])]

    def _stability(self) -> list[str]:
        """Lines about the stability of the design, and of a better one that was left for it."""
        best, search = self.best, self.search
        if "search_least_margin" not in self.group.attributes:
            return ["  stability not judged: this archive was made before MET judged it; run it again"]
        out = wrapped(*stability_texts(best.stability, search.least_margin))
        if not best.serves:
            tried = f"none of the {len(search.judged)} designs that were judged" if search.judged[1:] else "it does not"
            out += wrapped(f"{tried} {'keeps' if search.judged[1:] else 'keep'} the least margin of "
                           f"{search.least_margin:g}" + ("" if search.steers else "; with `least_margin = "
                           f"{search.least_margin:g};` in the tuning it looks for one that does"))  # fmt: skip
        left = best.left
        if left is not None and left.margins is not None:
            place = int(np.flatnonzero(self.group.values("case") == left.case)[0])
            values = ", ".join(f"{chosen.path} = {chosen.text}".replace(" ", KEPT) for chosen in self.values(place))
            value = self.goal(best.left_value)
            out += wrapped(
                f"{search.metric} is {value} with {values}, which is not advised: {margin_words(left.margins)}"
            )
        return out

    def _worst(self) -> list[str]:
        """The lines about the worst case that a search found, with the chosen parameters and the metric's value."""
        best, search = self.best, self.search
        case, worst = f"case #{self.position} with {self._chosen}", f"the worst of search `{self.group.name}`"
        if best.failed:
            failed = int(np.count_nonzero(self.group.values("status") != DONE))
            words = f"{failed:,} of {self._cases} fail, which hurts more than any {search.metric}"
            return [f"{worst}: {case} fails", *self._cause, f"  {words}"]
        if np.isnan(best.value):
            return [f"{worst}: {case}, in which {search.metric} has no value", f"  of {self._cases}"]
        which = "largest" if search.largest else "least"
        out = [
            f"{worst}: {search.metric} = {self.goal(best.value)}, {case}",
            f"  the {which} {search.metric} of {self._cases}",
        ]
        return [*out, *self._settled()]

    def _settled(self) -> list[str]:
        """Lines about how sure it is that a search's case is the worst: what the second half of its cases brought."""
        table, done, metrics, required = self._judged_cases
        half = len(table) // 2
        if not half:
            return []
        before = answer(self.search, table[:half], done[:half], cut(metrics, half), required).value
        if abs(self.best.value - before) <= NEAR_BEST * abs(self.best.value):
            return [f"  the second half of its cases found nothing that is worse by more than {100.0 * NEAR_BEST:g} %"]
        return wrapped(f"not sure that it is the worst: the first half of its cases came to {self.goal(before)}; "
                       "another `seed` or a larger `at_most` may find worse")  # fmt: skip

    def as_data(self) -> dict[str, Any]:
        """The answer for programs, SI."""
        best = self.best
        return {
            "kind": self.search.kind,
            "goal": self.search.goal,
            "case": self.position,
            "value": best.value,
            "failed": best.failed,
            "chosen": {chosen.path: chosen.text for chosen in self.values()},
            "cases": self.group.count,
            "generations": self.generations,
            "tried": best.tried,
            "against": best.all,
            "serves": best.serves,
            "stability": stability_data(best.stability),
            "stability_not_judged": best.stability.why_not or None if best.stability is not None else None,
            "least_margin": self.search.least_margin if self.search.kind == "tune" else None,
            "missed": list(best.missed),
            "nearest": [{"requirement": room.text, "inside": room.share} for room in best.rooms],
            "at_ends": [{"path": path, "end": end} for path, end in best.ends],
            "confirmation": [asdict(confirmation) for confirmation in self.search.confirmation],
            "starts": self.starts if self.search.kind == "tune" else None,
            "along_slopes": self.search.along_slopes if self.search.gradients else None,
            "without_slopes": self.search.without_slopes or None,
            "nearest_miss": None
            if (miss := best.miss) is None
            else {
                "case": int(self.group.values("case")[miss.case]),
                "requirement": miss.text,
                "distance": miss.distance,
            },
            "nearest_worse": None
            if self.search.kind == "search" or (worse := self._worse) is None
            else {"case": int(self.group.values("case")[worse[0]]), "distance": worse[1]},
        }


def cut(metrics: dict[str, np.ndarray], count: int) -> dict[str, np.ndarray]:
    """The metrics of the first cases only."""
    return {name: values[:count] for name, values in metrics.items()}


def goal_text(value: float, unit: str, scale: float) -> str:
    """A goal's value, SI, in a unit of `scale` SI units."""
    unit_suffix = "" if unit == "1" else f" {pretty_unit(unit)}"
    return "no value" if np.isnan(value) else f"{number_text(value / scale)}{unit_suffix}"


def progress(answer_so_far: Answer, experiment: Experiment) -> str:
    """The best so far in a few words, for the progress display: `best settle 4.81 s, over < 10 % binds`."""
    search = answer_so_far.search
    if answer_so_far.failed:
        best = "a case fails" if search.kind == "search" else "every candidate fails so far"
        return best
    unit, scale = deck_unit(
        search.metric,
        metric_units(experiment.structure, experiment.linear_metrics)[search.metric],
        experiment.requirements,
    )
    word = "worst" if search.kind == "search" else "best"
    return f"{word} {search.metric} {goal_text(answer_so_far.value, unit, scale)}{_binding(answer_so_far)}"


def _binding(best: Answer) -> str:
    """The end of a progress line: the requirement that the best candidate misses, or is nearest to missing."""
    if best.missed:
        return f", misses {best.missed[0]}"
    near: Sequence[str] = [room.text for room in best.rooms[:NEAREST] if best.search.kind == "tune"]
    return f", {near[0]} is nearest" if near else ""


# The answer as `met run` and `met show` give it


@frozen
class SearchResult:
    """The answer of a search: as lines, for programs, and whether it is what was asked for.

    commands  that follow from it, each with what it is for
    tunes     whether it is a tuning: then the requirements count in its answer alone;  name: of the search
    values    what it chose;  among: among what, in words
    """

    name: str
    lines: tuple[str, ...]
    commands: tuple[tuple[str, str], ...]
    data: dict[str, Any]
    ok: bool
    tunes: bool
    values: tuple[WrittenValue, ...]
    among: str


def search_result(archive: ArchiveFile, group: ArchiveGroup) -> SearchResult | None:
    """The answer of a group of an archive; None where it is not a search, or has only some of its cases."""
    answer = SearchAnswer.of(group)
    if answer is None:
        return None
    commands = _commands(archive, group, answer)
    tunes = answer.search.kind == "tune"
    lines = (
        *answer.lines(),
        *(line for purpose, command in commands for line in _purpose_and_command(purpose, command)),
    )
    data = {**answer.as_data(), "commands": [command for _, command in commands]}
    cases_text = f"{len(group.values('case')):,} cases"
    return SearchResult(group.name, lines, tuple(commands), data, answer.ok, tunes, tuple(answer.values()), cases_text)


def _purpose_and_command(purpose: str, command: str) -> Sequence[str]:
    return [f"{purpose} {command}"] if len(purpose) + len(command) < 100 else [purpose, f"  {command}"]


def _commands(archive: ArchiveFile, group: ArchiveGroup, answer: SearchAnswer) -> list[tuple[str, str]]:
    """Commands for the next steps after an answer, each with its purpose."""
    again = f"met run {quoted(archive.path)} --case '#{answer.position}'"
    if answer.search.kind == "search":
        return [("run it again:", again)]
    how = context(archive, Pool(group.name, [group]))
    name = answer.search.against or answer.search.of
    words = [f"-D {quoted(macro)}" for macro in how["defines"]]
    chosen = [value.setting for value in answer.values()]
    replaced = {*map(setting_path, chosen), *(["seed"] if answer.draws else [])}
    words += [setting_option(setting) for setting in how["overrides"] if setting_path(setting) not in replaced]
    words += [setting_option(setting) for setting in chosen]
    command = f"met run {quoted(how['deck'])} {quoted(name)} {' '.join(words)}"
    steps = [("its worst case again:", again), ("run it:", f"{command} -o chosen.h5")]
    if answer.draws:
        confirmed = len(answer.search.confirmation)
        seed = f"--set seed={answer.search.drawn_with + 1 + confirmed}"
        purpose = "these cases chose it, so they flatter it: other draws confirm it or not:"
        steps[1] = ("with yet other draws:" if confirmed else purpose, f"{command} {seed} -o confirmed.h5")
    elif answer.search.against:
        steps[1] = (f"nothing was drawn in {name}, so that no other draws confirm it; run it:", steps[1][1])
    return steps
