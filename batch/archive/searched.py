"""A search in an archive: attributes of its group, and of the coordinates that it chose.

    search             `search` or `tune`;  search_of: the run
    search_goal        `maximise NAME` or `minimise NAME`, the name of a metric's variable
    search_at_most     cases in all;  search_seed: of what is tried
    search_against     the sweep that a tuning is held against;  search_plants: how many cases that has;
                       search_drawn_with: the seed of what it draws
    search_margin      share of its limit by which a tuning would stay inside each requirement
    search_least_margin    disk margin below which a tuning does not advise a design;  search_steers: 1 where it was
                           also steered by that, else 0
    search_judged  the designs whose stability was judged, as JSON: the fields of `met.plan.searches.JudgedDesign`
    search_starts  where a tuning began, and what it came to, as JSON: the fields of `met.plan.searches.TuningStart`
    search_confirmation    how its design came out in cases that did not choose it, as JSON: the fields of
                           `met.plan.searches.Confirmation`
    search_along_slopes    of a tuning that goes by slopes: how many of its cases were tried along them
    search_without_slopes  of such a one: why its metrics had none where they had none last; empty where they had

A coordinate that is chosen has its ends in SI, `low` and `high`, and `steps`, `equal` or `ratios`. The variable
`generation` says which generation, from 0, asked for each case.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from batch.archive.stored import Stored, StoredGroup
from met.plan.codec import Damaged, decode, encode
from met.plan.searches import (
    MOST_PLANTS,
    MOST_SEARCHED,
    SHORTEST,
    Confirmation,
    JudgedDesign,
    Search,
    SearchedParameter,
    TuningStart,
    are_starts,
)

GENERATION = "generation"
"""The variable that says which generation asked for each case."""

LISTS = ("search_judged", "search_starts", "search_confirmation")
WORDS = ("search", "search_of", "search_goal", "search_against", "search_without_slopes", *LISTS)
Judged = tuple[JudgedDesign, ...]
Starts = tuple[TuningStart, ...]
Confirmed = tuple[Confirmation, ...]
GOALS = {"maximise": True, "minimise": False}
STEPS = {"equal": False, "ratios": True}


def attributes(search: Search, metric: str) -> dict[str, Any]:
    """The attributes of a group. metric: the goal's variable."""
    attrs: dict[str, Any] = {
        "search": search.kind,
        "search_of": search.of,
        "search_goal": f"{'maximise' if search.largest else 'minimise'} {metric}",
        "search_at_most": search.at_most,
        "search_seed": search.seed,
    }
    if search.kind == "tune":
        attrs |= {"search_margin": search.margin, "search_least_margin": search.least_margin}
        attrs["search_steers"] = int(search.steers)
        attrs["search_starts"] = json.dumps(encode(Starts, search.starts))
        if search.judged:
            attrs["search_judged"] = json.dumps(encode(Judged, search.judged))
        if search.confirmation:
            attrs["search_confirmation"] = json.dumps(encode(Confirmed, search.confirmation))
        if search.gradients:
            attrs |= {"search_along_slopes": search.along_slopes, "search_without_slopes": search.without_slopes}
    if search.against:
        attrs |= {
            "search_against": search.against,
            "search_plants": len(search.plants),
            "search_drawn_with": search.drawn_with,
        }
    return attrs


def of_coordinate(search: Search | None, path: str) -> dict[str, Any]:
    """The attributes of a coordinate that a search chooses; none for any other."""
    for parameter in search.parameters if search is not None else ():
        if parameter.path == path:
            return {
                "low": parameter.low,
                "high": parameter.high,
                "steps": "ratios" if parameter.logarithmic else "equal",
            }
    return {}


def why_unsound(group: StoredGroup) -> str:
    """The reason why a group's data about a search is invalid; empty where it is valid or absent. The group's cases
    must rise, and there must be some."""
    attrs = group.attributes
    if "search" not in attrs:
        return ""
    if attrs["search"] not in ("search", "tune"):
        return "attribute `search` is no kind of a search"
    word, _, metric = str(attrs.get("search_goal", "")).partition(" ")
    if word not in GOALS or metric not in {variable.name for variable in group.role("metric")}:
        return "attribute `search_goal` is no goal"
    for name, least, most in (
        ("search_at_most", 1, MOST_SEARCHED),
        ("search_plants", 1, MOST_PLANTS),
        ("search_seed", 0, 1 << 53),
        ("search_drawn_with", 0, 1 << 53),
        ("search_along_slopes", 0, MOST_SEARCHED),
        ("search_steers", 0, 1),
    ):
        value = attrs.get(name, 1 if name != "search_at_most" else None)
        if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
            return f"attribute `{name}` is no number of it"
    if ("search_along_slopes" in attrs) != ("search_without_slopes" in attrs):
        return "attribute `search_along_slopes` is missing, or its other half"
    for name, bound, what in (("search_margin", 1.0, "share"), ("search_least_margin", 2.0, "disk margin")):
        margin = attrs.get(name, 0.0)
        if not isinstance(margin, float) or not 0.0 <= margin < bound:
            return f"attribute `{name}` is no {what}"
    cases = attrs["cases_in_table"]
    try:
        if not all(0 <= judged_case.case < cases for judged_case in _decoded(attrs, "search_judged", Judged)):
            return "attribute `search_judged` is no list of judged designs"
        if not are_starts(_decoded(attrs, "search_starts", Starts), cases):
            return "attribute `search_starts` is not of its cases"
        confirmed = _decoded(attrs, "search_confirmation", Confirmed)
        for confirmation in confirmed:
            if (
                min(confirmation.failed, confirmation.missed) < 0
                or not confirmation.failed + confirmation.missed <= confirmation.cases <= MOST_PLANTS
            ):
                return "attribute `search_confirmation` counts what it cannot"
    except (ValueError, RecursionError, Damaged) as reason:
        return f"an attribute of its search is no list of what it should be: {reason}"
    coordinates = list(group.role("coordinate"))
    chosen = [coordinate for coordinate in coordinates if "low" in coordinate.attributes]
    if not chosen or not all(map(_is_range, chosen)) or coordinates[: len(chosen)] != chosen:
        return "its search chooses nothing that it could"
    if GENERATION not in group.variables or group.type(GENERATION) != "<i8":
        return f"variable `{GENERATION}` is missing or of another type"
    if group.variables[GENERATION].dims != ("case",):
        return f"variable `{GENERATION}` is not over cases"
    return (
        _why_not_against(attrs, more=len(coordinates) - len(chosen))
        or _why_not_asked(group)
        or _why_not_in(group, chosen)
    )


def _decoded(attributes: Mapping[str, Any], name: str, kind: Any) -> Any:
    """The list of this kind that an attribute holds as JSON, empty where there is no attribute; raises ValueError,
    RecursionError or Damaged for a text that is none."""
    text = attributes.get(name, "")
    return decode(kind, json.loads(text), name) if text else ()


def _why_not_against(attrs: Mapping[str, Any], *, more: int) -> str:
    """The reason why the number of plants (cases of a sweep to judge candidates on) that a group's attributes have is
    unsound; empty where it is sound. more: coordinates that are not chosen."""
    against, plants, tunes = attrs.get("search_against", ""), attrs.get("search_plants", 0), attrs["search"] == "tune"
    if not bool(against) == bool(plants) == (more > 0):
        return "attribute `search_plants` is not of its coordinates"
    of_tunings = ("search_along_slopes", "search_least_margin", "search_steers", *LISTS)
    if not tunes and (plants or attrs.get("search_margin", 0.0) or not attrs.keys().isdisjoint(of_tunings)):
        return "a tuning alone is held against something"
    least = max(plants + SHORTEST if tunes else 1, attrs["cases_in_table"])
    return "" if attrs["search_at_most"] >= least else "attribute `search_at_most` is less than its cases"


def _why_not_asked(group: StoredGroup) -> str:
    """The reason why its cases cannot have been asked for in these generations, which must rise from 0 and each have a
    case."""
    generation, case = (group.values(name).astype(np.int64) for name in (GENERATION, "case"))
    if case[-1] >= group.attributes["cases_in_table"]:
        return "its cases are more than its table has"
    later = np.diff(generation, prepend=0)
    if generation.min() < 0 or later.min() < 0 or (later > np.diff(case, prepend=0)).any():
        return f"variable `{GENERATION}` has a value that it cannot have"
    return ""


def _why_not_in(group: StoredGroup, chosen: Sequence[Stored]) -> str:
    """The reason why a coordinate that a search chooses cannot have its values, or so many of them."""
    columns = [group.values(variable.name) for variable in chosen]
    for variable, values in zip(chosen, columns, strict=True):
        if not ((values >= variable.attributes["low"]) & (values <= variable.attributes["high"])).all():
            return f"variable `{variable.name}` has a value that it cannot have"
    if plants := group.attributes.get("search_plants", 0):
        order = np.lexsort(columns)
        new = np.any([np.diff(values[order]) != 0.0 for values in columns], axis=0)
        tried = np.diff(np.concatenate([[0], np.flatnonzero(new) + 1, [len(order)]]))
        if tried.max() > plants:
            return "attribute `search_plants` is less than it was tried with"
    return ""


def _is_range(variable: Stored) -> bool:
    """True if a coordinate's attributes are the ends of a range that can be searched."""
    low, high = (variable.attributes.get(name) for name in ("low", "high"))
    if not isinstance(low, float) or not isinstance(high, float) or not -math.inf < low < high < math.inf:
        return False
    steps = variable.attributes.get("steps")
    return high - low < math.inf if steps == "equal" else steps == "ratios" and (low > 0.0 or high < 0.0)


def is_search(group: StoredGroup) -> bool:
    """True if the cases of a group, all of them or some, were chosen by a search or a tuning."""
    return "search" in group.attributes


def search_of(group: StoredGroup) -> Search | None:
    """The search whose cases are a group's; its goal is a variable's name, and its plants are only counted. None where
    there is no search, or the group has only some of its cases."""
    attrs: Mapping[str, Any] = group.attributes
    if "search" not in attrs or group.shape("case")[0] < attrs["cases_in_table"]:
        return None
    word, _, metric = str(attrs["search_goal"]).partition(" ")
    parameters = [
        SearchedParameter(
            variable.path, variable.attributes["low"], variable.attributes["high"], STEPS[variable.attributes["steps"]]
        )
        for variable in group.role("coordinate")
        if "low" in variable.attributes
    ]
    confirmation = _decoded(attrs, "search_confirmation", Confirmed)
    return Search(
        kind=attrs["search"],
        metric=metric,
        largest=GOALS[word],
        parameters=tuple(parameters),
        at_most=attrs["search_at_most"],
        of=str(attrs.get("search_of", "")),
        seed=attrs.get("search_seed", 0),
        against=str(attrs.get("search_against", "")),
        plants=((),) * int(attrs.get("search_plants", 0)),
        drawn_with=attrs.get("search_drawn_with", 0),
        margin=attrs.get("search_margin", 0.0),
        least_margin=attrs.get("search_least_margin", 0.0),
        steers=attrs.get("search_steers", 0) == 1,
        judged=_decoded(attrs, "search_judged", Judged),
        starts=_decoded(attrs, "search_starts", Starts),
        fresh=((),) * sum(confirmation.cases for confirmation in confirmation[:1]),
        confirmation=confirmation[:1],
        gradients="search_along_slopes" in attrs,
        along_slopes=attrs.get("search_along_slopes", 0),
        without_slopes=attrs.get("search_without_slopes", ""),
    )
