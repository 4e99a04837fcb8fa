"""The design of a sweep to use: in lines, and as data."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from batch.queries.best import ENDS, Designs, Goal, Stretch
from batch.queries.pool import CaseColumn, failure_lines
from batch.queries.signals import deck_unit, number_text, number_texts, pretty_unit
from batch.queries.stability_words import KEPT, margin_words, stability_data, stability_texts, wrapped
from batch.queries.summary import finite
from ic.driver.written_value import WrittenValue
from ic.printing.columns import columns, count
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.outputs import quoted, setting_option, setting_path
from met.plan.searches import JudgedDesign
from met.unit_parser import written
from met.units import text as unit_text

MACRO = "macro "
"""Prefix of the path of a choice among values of a macro."""

RUNNERS_UP = 3
"""Number of designs that are shown after the best."""

MOST_ON_FRONT = 15
"""Largest number of rows of a trade-off, evenly chosen if there are more."""

NEAREST = 3
"""Number of designs that are shown where none is good."""


@frozen
class BestRow:
    """A design in a table: its number, and the reason for its row, in words."""

    design: int
    label: str


class BestAnswer:
    """The answer on the designs of one run or sweep.

    deck       of the archive;  name: of the sweep;  seed: the campaign's
    defines    what `-D` defined for it, `NAME=VALUE`;  remarks: what else is to be known of it
    overrides  what `--set` and `--vary` set and varied for it (`met.outputs`)
    front      goals that are traded off against each other
    judged     the stability of designs, by their numbers, the best by the goals first, until one keeps `least_margin`
    """

    def __init__(
        self,
        designs: Designs,
        goals: Sequence[Goal],
        front: Sequence[Goal],
        *,
        deck: str,
        name: str,
        seed: int,
        defines: Sequence[str] = (),
        overrides: Sequence[str] = (),
        remarks: Sequence[str] = (),
        judged: Mapping[int, JudgedDesign] | None = None,
        least_margin: float = 0.0,
    ) -> None:
        """Order the designs by the goals, those first that keep the least margin of stability."""
        self.designs, self.goals, self.front = designs, tuple(goals), tuple(front)
        self.deck, self.name, self.seed = deck, name, seed
        self.defines, self.overrides, self.remarks = tuple(defines), tuple(overrides), tuple(remarks)
        self.judged, self.least_margin = dict(judged or {}), least_margin
        order = designs.order(goals)
        keeping = [number for number, judged_design in self.judged.items() if judged_design.keeps(least_margin)]
        self.order = np.concatenate([np.array(keeping, order.dtype), order[~np.isin(order, keeping)]])
        required = [
            goal
            for column in designs.pool.metrics()
            if column.limits and column.label not in {goal.text for goal in (*goals, *front)}
            for goal in [designs.goal(f"{column.label}:{'smallest' if column.limits[0].sense == '<' else 'largest'}")]
        ]
        self.shown_goals = tuple({goal.text: goal for goal in (*self.goals, *self.front, *required)}.values())
        """Goals with a column of their own."""

    @property
    def best(self) -> int | None:
        """The design to use, or, where none that was judged keeps the least margin, the best by the goals; None where
        none is good."""
        return int(self.order[0]) if len(self.order) else None

    @property
    def advised(self) -> bool:
        """True where there is a design to use."""
        judged = self.judged.get(self.best) if self.best is not None else None
        return self.best is not None and (judged is None or judged.keeps(self.least_margin))

    @property
    def left(self) -> int | None:
        """The design that is better by the goals than the one to use, and not advised; None where there is none."""
        first = next(iter(self.judged), self.best)
        return first if self.advised and first != self.best else None

    def rows(self) -> list[BestRow]:
        """The rows: the best, those that are best in only one number, and the runners-up."""
        designs = self.designs
        first = f"{_least(self.goals[0])}" if self.goals else "farthest from the border"
        if not self.goals and designs.steps is None:
            first = "most room"
        labels = {int(self.order[0]): first}
        if (better := self.left) is not None:
            labels = {int(self.order[0]): "keeps the margin", better: first}
        for goal in self.shown_goals:
            if all(goal is not shown_goal for shown_goal in self.goals):
                labels.setdefault(int(designs.order([goal])[0]), _least(goal))
        for number, design in enumerate(self.order[1 : 1 + RUNNERS_UP].tolist(), start=2):
            judged = self.judged.get(design)
            place = f"{number}{ {2: 'nd', 3: 'rd'}.get(number, 'th') }"
            labels.setdefault(design, place if judged is None or judged.keeps(self.least_margin) else "not advised")
        return [BestRow(design, label) for design, label in labels.items()]

    # Text

    def lines(self, width: int) -> list[str]:
        out = list(self._none(width)) if self.best is None else self._use(self.best, width)
        if self.front and self.best is not None:
            out += ["", *self._trade_off()]
        return out

    def _use(self, best: int, width: int) -> list[str]:
        """The lines about the design to use: why, how far each value may go, the table, and how to confirm it."""
        out = [self.headline, *_wrapped(self.why, width), *wrapped(*self.stability())]
        if stretches := self.stretches():
            out += ["", "how far each may go by itself:", *columns(stretches)]
        out += ["", *self.table(self.rows()), ""]
        sentence, command = self.confirmation()
        out += [f"{sentence} {command}"] if sentence.endswith("it:") else [sentence, f"  {command}"]
        return [*out, *self.notes()]

    @property
    def headline(self) -> str:
        """The headline, `use drive.kp = 0.33 V*s/rad`, or that no design is good."""
        if self.best is None:
            return f"none of {self.designs.count:,} designs meets all requirements"
        settings = ", ".join(f"{path} = {value}" for path, value in self.settings(self.best))
        return f"{'use' if self.advised else 'not advised:'} {settings}"

    def stability(self) -> list[str]:
        """A text on the stability of the best design, and one on a better design that was left for it."""
        assert self.best is not None
        out = stability_texts(self.judged.get(self.best), self.least_margin)
        if not self.advised:
            several = f"none of the {len(self.judged)} designs that were judged keeps"
            keeps = several if len(self.judged) > 1 else "it does not keep"
            out.append(f"{keeps} the least margin of {self.least_margin:g}")
        elif self.left is not None:
            margins = self.judged[self.left].margins
            assert margins is not None  # else it would be advised
            settings = ", ".join(f"{path} = {value}".replace(" ", KEPT) for path, value in self.settings(self.left))
            out.append(f"better, and not advised: {settings}, {margin_words(margins)}")
        return out

    def stretches(self) -> list[list[str]]:
        """The range of the best along each axis, all else unchanged: the parameter, its ends, and the obstacles
        there."""
        assert self.best is not None
        return [
            [
                axis.columns[0].label,
                _range_text(axis.columns[0], axis.values[[stretch.first, stretch.last]]),
                _ends(stretch),
            ]
            for number, axis in enumerate(self.designs.axes)
            if (stretch := self.designs.stretch(self.best, number)) is not None
        ]

    def notes(self) -> list[str]:
        """Further notes: that better designs may lie beyond the sweep, or that all parameters count as chosen."""
        assert self.best is not None
        designs = self.designs
        ended = [
            axis.columns[0].label
            for number, axis in enumerate(designs.axes)
            if len(axis.values) > 2
            and (stretch := designs.stretch(self.best, number)) is not None
            and _at_an_end(stretch, int(axis.level[self.best]))
        ]
        out = (
            [f"it lies where the sweep of {' and of '.join(ended)} ends: a wider one may find better"] if ended else []
        )
        if not designs.against and len(designs.axes) > 1:
            last = quoted(designs.axes[-1].columns[0].label)
            out.append(f"all that varies is taken for chosen; `--over {last}` of `met best` holds designs against it")
        return [*out, *self.remarks]

    @property
    def why(self) -> str:
        """The reasons for the best, and the number of designs that meet all requirements."""
        assert self.best is not None
        designs, best = self.designs, self.best
        cases, good = int(designs.cases[best]), int(designs.good.sum())
        number = len(designs.pool.requirements)
        what = "it reaches the end"
        if number:
            what = f"it meets {'the requirement' if number == 1 else f'all {number} requirements'}"
        cases_text = "both" if cases == 2 else f"all {cases:,}"
        where = "" if cases == 1 else f" in {cases_text} of its cases"
        if cases > 1 and (designs.shares < 1.0).any():
            where = f", each in the share of its {cases:,} cases that is asked for"
        if designs.against:
            where += f" ({', '.join(map(_range, designs.against))})"
        steps = "" if designs.steps is None else f", {count(int(designs.steps[best]), 'cell')} from the border"
        room = float(designs.room[best])
        alike = math.isfinite(room) and bool((designs.shares == 1.0).all())
        room_said = f", {100.0 * room:.3g} % of a limit from the nearest one" if alike else ""
        so = f"So {'does' if good == 1 else 'do'} {good:,} of {designs.count:,} designs."
        return f"{what}{where}{steps}{room_said}. {so}"

    def _none(self, width: int) -> Iterator[str]:
        """The text where no design is good: the nearest ones."""
        designs = self.designs
        yield self.headline
        for text, met in zip(designs.demands, designs.meets.T, strict=True):
            yield (
                f"  require {text}  met by {count(int(met.sum()), 'design')}"
                if designs.pool.requirements
                else f"  {text}"
            )
        yield from ["", "those that come nearest:", *self.table(self.nearest())]
        if failed := int(designs.failing.sum()):
            yield from ["", f"{failed:,} of {count(designs.pool.count, 'case')} failed:"]
            yield from failure_lines(designs.pool.failures, width)

    def nearest(self) -> list[BestRow]:
        """The designs that miss least, with their misses."""
        designs = self.designs
        order = np.lexsort((-designs.room, (~designs.meets).sum(axis=1)))[:NEAREST].tolist()
        return [BestRow(design, self._short(design)) for design in order]

    def _short(self, design: int) -> str:
        """The faults of a design that is not good, in words: `fails in 2 of 4 cases, misses settle < 4 s`."""
        failing, cases = int(self.designs.failing[design]), int(self.designs.cases[design])
        faults = []
        if failing:
            faults.append("fails" if cases == 1 else f"fails in {failing:,} of {cases:,} cases")
        if missed := self.designs.missed(design):
            faults.append(f"misses {', '.join(missed)}")
        return ", ".join(faults)

    def _trade_off(self) -> list[str]:
        """The lines about designs of which none is better in one goal and as good in the others."""
        front = self.designs.front(self.front)
        some = front[np.unique(np.linspace(0, len(front) - 1, min(len(front), MOST_ON_FRONT)).astype(int))]
        names = " against ".join(goal.text for goal in self.front)
        head = f"{names}: no good design is better in one and as good in the other"
        left = f"; {len(some)} of {len(front):,} are shown" if len(some) < len(front) else ""
        return [f"{head}{left}", *self.table([BestRow(int(design), "") for design in some])]

    def table(self, rows: Sequence[BestRow]) -> list[str]:
        """The table of some designs, as lines for the terminal."""
        lines = self.cells(rows)
        if any(int(self.designs.cases[row.design]) > 1 for row in rows):
            lines[1][0] = "in the worst case:"
        return columns(lines, right=self.right)

    @property
    def right(self) -> list[int]:
        """Columns of the table that are numbers."""
        chosen = [column for axis in self.designs.axes for column in axis.columns]
        words = {1 + i for i, column in enumerate(chosen) if column.role == "choice"}
        return [i for i in range(1, len(self.cells([])[0])) if i not in words]

    def cells(self, rows: Sequence[BestRow]) -> list[list[str]]:
        """Designs as a table whose first lines are heads and units: the reason for the row, chosen values, distance to
        the border, and each number in the worst case."""
        designs = self.designs
        chosen = [column for axis in designs.axes for column in axis.columns]
        numbers = [row.design for row in rows]
        cells = [["", "", *(row.label for row in rows)]]
        for column in chosen:
            cells.append([column.label, column.unit, *_values(column, designs.first[numbers])])
        if designs.steps is not None:
            cells.append(["border", "cells", *(str(designs.steps[number]) for number in numbers)])
        for goal in self.shown_goals:
            scale, unit = self._unit(goal)
            values = self._worst(goal)[numbers] / scale
            cells.append([goal.text, unit, *("-" if math.isnan(value) else number_text(value) for value in values)])
        return [list(row) for row in zip(*cells, strict=True)]

    def _worst(self, goal: Goal) -> np.ndarray:
        """[design] a goal in the worst of its cases, SI."""
        return self.designs.worst(goal.values, largest=not goal.largest)

    def _unit(self, goal: Goal) -> tuple[float, str]:
        """The unit in which a goal is shown, after how many SI units it is."""
        for variable in self.designs.pool.variables("metric"):
            if variable.path == goal.text:
                return deck_unit(variable)
        unit = unit_text(goal.dimension)
        return 1.0, "" if unit == "1" else pretty_unit(unit)

    def settings(self, design: int) -> Iterator[tuple[str, str]]:
        """The choices that make a design: each path, and its value as a deck would write it."""
        for column, si, unit in self._chosen(design):
            if column.role == "choice":
                yield (column.label, column.words[int(si)])
            else:
                yield (column.label, written(si, unit))

    def values(self, design: int) -> Iterator[WrittenValue]:
        """The choices that make a design, as texts for a deck. Raises Problem E397 for a choice among words."""
        for column, si, unit in self._chosen(design):
            if column.role == "choice":
                path, word = column.label.removeprefix(MACRO), column.words[int(si)]
                what = f"`#define {path} {word}`" if column.label.startswith(MACRO) else f"`{path} = {word};`"
                message = f"`{path}` cannot be written into the deck: it is a choice among words, not a number"
                raise Problem(error("E397", message, help=f"write it by hand: {what}"))
            yield WrittenValue(column.label, si, unit)

    def _chosen(self, design: int) -> Iterator[tuple[CaseColumn, float, str]]:
        """The parameters and choices that make a design, with SI value (of a choice its word's place), and unit."""
        pool, place = self.designs.pool, int(self.designs.first[design])
        variables = {coordinate.path: coordinate for coordinate in pool.variables("coordinate")}
        for axis in self.designs.axes:
            for column in axis.columns:
                if np.isnan(column.values[place]):
                    continue  # another part of a sum of sweeps chooses it
                if column.role == "choice":
                    yield column, float(column.values[place]), ""
                    continue
                variable = variables[column.label]
                unit = str(variable.attributes.get("deck_unit", variable.unit))
                yield column, float(pool.gathered(variable.name)[place]), unit

    def command(self, design: int, *, seed: int | None = None) -> str:
        """The command that runs a design's cases again, with other draws where there is a seed."""
        words = [f"-D {quoted(define)}" for define in self.defines]
        chosen = dict(self.settings(design))
        replaced = {*chosen, *(["seed"] if seed is not None else [])}
        words += [setting_option(setting) for setting in self.overrides if setting_path(setting) not in replaced]
        for path, value in chosen.items():
            option = "-D" if path.startswith(MACRO) else "--set"
            words.append(f"{option} {quoted(f'{path.removeprefix(MACRO)}={value}')}")
        words += [f"--set seed={seed}"] if seed is not None else []
        return " ".join([f"met run {quoted(self.deck)} {quoted(self.name)}", *words])

    def confirmation(self) -> tuple[str, str]:
        """The value of confirming the best, in words, and the command for it: with other draws where its cases were
        drawn."""
        assert self.best is not None
        if not self.designs.draws:
            return "run it:", f"{self.command(self.best)} -o chosen.h5"
        reason = f"it was picked out of {self.designs.count:,} by these very cases, so its numbers flatter it: "
        return (
            f"{reason}other draws confirm it or not",
            f"{self.command(self.best, seed=self.seed + 1)} -o confirmed.h5",
        )

    # Data

    def as_data(self) -> dict[str, Any]:
        """The answer for programs: SI, null for non-finite numbers."""
        designs = self.designs
        rows = self.rows() if self.best is not None else []
        data = {
            "experiment": designs.pool.name,
            "designs": designs.count,
            "good": int(designs.good.sum()),
            "over": [column.label for column in designs.against],
            "best": None if self.best is None else self._as_row(BestRow(self.best, rows[0].label)),
            "advised": self.advised,
            "least_margin": self.least_margin,
            "rows": [self._as_row(row) for row in rows],
            "front": [self._as_row(BestRow(int(i), "")) for i in designs.front(self.front)] if self.front else [],
            "command": "" if self.best is None else self.command(self.best),
        }
        return dict(finite(data))

    def _as_row(self, row: BestRow) -> dict[str, Any]:
        """A row of the answer for JSON: the design's chosen values, its worst metrics, room to limits, and
        stability."""
        designs = self.designs
        return {
            "why": row.label,
            "chosen": dict(self.settings(row.design)),
            "cases": int(designs.cases[row.design]),
            "cells_to_border": None if designs.steps is None else int(designs.steps[row.design]),
            "room": float(designs.room[row.design]),
            "stability": stability_data(self.judged.get(row.design)),
            "worst": {goal.text: float(self._worst(goal)[row.design]) for goal in self.shown_goals},
        }


def _least(goal: Goal) -> str:
    return f"{'largest' if goal.largest else 'least'} {goal.text}"


def _values(column: CaseColumn, places: Iterable[int]) -> list[str]:
    """The values of a column for these cases, in words."""
    values = [float(column.values[place]) for place in places]
    texts = [column.words[int(value)] if column.role == "choice" and value == value else "" for value in values]
    numbers = texts if column.role == "choice" else number_texts(values)
    return ["" if math.isnan(value) else text for value, text in zip(values, numbers, strict=True)]


def _range(column: CaseColumn) -> str:
    """The range of a parameter under which designs are judged, in words."""
    if column.role == "choice":
        return f"{column.label} {', '.join(column.words)}"
    known = column.values[np.isfinite(column.values)]
    return f"{column.label} {_range_text(column, [known.min(), known.max()])}"


def _range_text(column: CaseColumn, ends: Iterable[float]) -> str:
    """The range between two values of a column, in its unit: `0.1 .. 0.4 V*s/rad`."""
    low, high = number_texts(ends)
    return f"{low} .. {high} {column.unit}".rstrip()


def _at_an_end(stretch: Stretch, level: int) -> bool:
    """True if a level is the first or the last of the sweep."""
    return (stretch.first == level and stretch.below == ENDS) or (stretch.last == level and stretch.above == ENDS)


def _ends(stretch: Stretch) -> str:
    if stretch.below == stretch.above == ENDS:
        return f"on both sides {ENDS}"
    return f"below: {_beyond(stretch.below)}; above: {_beyond(stretch.above)}"


def _beyond(why: str) -> str:
    if not why.startswith("`"):
        return why
    return f"{why} {'are' if why.endswith(' more') else 'is'} missed"


def _wrapped(text: str, width: int) -> list[str]:
    return textwrap.wrap(text, max(40, width), initial_indent="  ", subsequent_indent="  ", break_on_hyphens=False)
