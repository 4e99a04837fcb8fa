"""The units that a deck's author uses for a signal: `deg` where the deck wrote `deg`. Archives hold SI."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.queries.signals import Panel
from met.diagnostic import Place, Problem
from met.plan import Experiment, Plan
from met.unit_parser import parse_unit
from met.units import Measure

MOTION = re.compile(r"initial\.|metrics\.|guides?\.|environment\.|(.*\.)?servo\.command\.")
"""Parameters whose units are those of a motion; lengths of links and torques of friction do not count."""

WRITTEN = re.compile(r"[\d.\])]\s*([A-Za-z%][\w*/^()]*)\s*$")
"""The unit at the end of a value: `30 deg`, `[0, 0, 90] deg`."""


class DeckUnits:
    """The deck's unit for each SI unit: for a signal, that of a requirement on it, else that of most of its values.

    archive     the group's, or the plan that was run (`written_plan`, where a caller has several groups); None where
                that cannot be read
    experiment  what was run, as the plan has it; None where the plan cannot be read here: units are SI then
    """

    def __init__(self, archive: ArchiveFile | Plan | None, group: ArchiveGroup) -> None:
        self.group = group
        plan = written_plan(archive) if isinstance(archive, ArchiveFile) else archive
        experiments = (
            [] if plan is None else [experiment for experiment in plan.experiments if experiment.name == group.name]
        )
        self.experiment: Experiment | None = experiments[0] if experiments else None
        self._votes = _votes(self.experiment, plan) if plan is not None and self.experiment is not None else {}
        self._required = self._of_metrics()

    def panel(self, panel: Panel) -> Panel:
        """The panel in the deck's unit."""
        if panel.unit in ("", "1"):
            return panel
        required = [*self._required.get(panel.name, ()), *self._required.get(panel.variable, ())]
        usual = self._votes.get(panel.unit, ())
        unit = next((deck_unit for deck_unit in (*required, *usual) if _scale(deck_unit, panel.unit)), "")
        scale = _scale(unit, panel.unit)
        return replace(panel, unit=unit, scale=scale, in_si=panel.unit) if scale not in (0.0, 1.0) else panel

    def _of_metrics(self) -> dict[str, list[str]]:
        """For each signal, the units of requirements of it; a joint's speaks for all of its signal."""
        out: dict[str, list[str]] = {}
        if self.experiment is None:
            return out
        named = {metric.name: metric.of for metric in self.experiment.structure.metrics}
        judged = {requirement.metric for requirement in self.experiment.requirements}
        for variable in self.group.role("metric"):
            signal_path = named.get(variable.path, "")
            if signal_path and variable.path in judged:
                for signal in (signal_path, signal_path.rpartition(".")[2]):
                    out.setdefault(signal, []).append(str(variable.attributes.get("deck_unit", variable.unit)))
        return out


def written_plan(archive: ArchiveFile) -> Plan | None:
    """The archive's plan, for display; None where it cannot be read here."""
    try:
        return archive.plan(as_written=True)
    except Problem:
        return None


def _votes(experiment: Experiment, plan: Plan) -> dict[str, tuple[str, ...]]:
    """By SI unit, the units of the deck's values, the most frequent first; zeros do not count."""
    texts = {source.name: source.text.split("\n") for source in plan.sources}
    counts: dict[str, Counter[str]] = {}
    seen: set[tuple[str, Place | None]] = set()
    for path, quantity in experiment.parameters.items():
        place = quantity.origin.place
        if place is None or not MOTION.match(path) or quantity.value == 0.0 or (quantity.unit, place) in seen:
            continue
        seen.add((quantity.unit, place))
        match_ = WRITTEN.search(_text(place, texts))
        if match_:
            counts.setdefault(quantity.unit, Counter())[match_[1]] += 1
    return {unit: tuple(text for text, _ in counter.most_common()) for unit, counter in counts.items()}


def _text(place: Place, texts: Mapping[str, list[str]]) -> str:
    lines = texts.get(place.file, [])
    line = lines[place.line - 1] if 0 < place.line <= len(lines) else ""
    return line[place.column - 1 : place.column - 1 + place.length]


def _scale(unit: str, si: str) -> float:
    """The size of a unit in an SI unit; 0 where they are of different kinds."""
    mine, theirs = _measure(unit), _measure(si)
    if mine is None or theirs is None or mine.dimension != theirs.dimension:
        return 0.0
    return mine.scale / theirs.scale


def _measure(unit: str) -> Measure | None:
    try:
        return parse_unit(unit)
    except ValueError:
        return None
