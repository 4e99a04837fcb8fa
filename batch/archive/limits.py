"""The unit in which a metric's requirement is written: a deck with `sag > -136 deg` shows the metric in degrees."""

from __future__ import annotations

import re
from collections.abc import Iterable

from met import units
from met.plan.judged import Requirement
from met.unit_parser import parse_unit

# text before a unit: a number, or the end of a sum in parentheses
_NUMBER = re.compile(r"\d[\d.]*(?:[eE][-+]?\d+)?|\)")
_OVER_TIME = re.compile(r"(?:\w+: )?\w+\(")
_OVER_CASES = re.compile(r"\s+(?:in\s.*\sof\s+cases\b.*|with\s.*\sconfidence)$")
_COMPARED = re.compile(r"[<>]=?\s*\(?[-+]?[\d.]+(?:[eE][-+]?\d+)?\s*([A-Za-z][\w/*^]*)")


def deck_unit(metric: str, unit: str, requirements: Iterable[Requirement]) -> tuple[str, float]:
    """Unit and scale (shown = SI value / scale) of the first requirement of a metric that has one, else its SI unit."""
    for requirement in requirements:
        if requirement.metric == metric and (unit_and_scale := written_unit(requirement.text, unit)) is not None:
            return unit_and_scale
    return unit, 1.0


def written_unit(text: str, unit: str) -> tuple[str, float] | None:
    """The unit at the end of a requirement's text and its size in SI; for one over time, that of a comparison in it.
    None where no unit of this dimension is there."""
    try:
        wanted = parse_unit(unit).dimension
    except ValueError:
        return None
    limit = _OVER_CASES.sub("", re.split(r"[<>]=?", text, maxsplit=1)[-1])
    words = [limit[number.end() :].strip() for number in _NUMBER.finditer(limit)]
    words += _COMPARED.findall(text) if _OVER_TIME.match(text) else []
    for written in words:
        try:
            measure = parse_unit(written)
        except ValueError:
            continue
        if units.same(measure.dimension, wanted):
            return written, measure.scale
    return None
