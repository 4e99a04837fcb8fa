"""A search in an archive: attributes of its group, and of the coordinates that it chose.

    search             `search` or `tune`;  search_of: the run
    search_goal        `maximise NAME` or `minimise NAME`, the name of a metric's variable
    search_at_most     cases in all;  search_seed: of what is tried
    search_against     the sweep that a tuning is held against;  search_plants: how many cases that has;
                       search_drawn_with: the seed of what it draws
    search_margin      share of its limit by which a tuning would stay inside each requirement

A coordinate that is chosen has its ends in SI, `low` and `high`, and `steps`, `equal` or `ratios`. The variable
`generation` says which generation, from 0, asked for each case.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from batch.archive.stored import Stored, StoredGroup
from met.plan.searches import MOST_PLANTS, MOST_SEARCHED, Search, SearchedParameter

GENERATION = "generation"
"""The variable that says which generation asked for each case."""

WORDS = ("search", "search_of", "search_goal", "search_against")
GOALS = {"maximise": True, "minimise": False}
STEPS = {"equal": False, "ratios": True}


def attributes(search: Search, metric: str) -> dict[str, Any]:
    """The attributes of a group. metric: the goal's variable."""
    told: dict[str, Any] = {
        "search": search.kind,
        "search_of": search.of,
        "search_goal": f"{'maximise' if search.largest else 'minimise'} {metric}",
        "search_at_most": search.at_most,
        "search_seed": search.seed,
    }
    if search.kind == "tune":
        told["search_margin"] = search.margin
    if search.against:
        told |= {
            "search_against": search.against,
            "search_plants": len(search.plants),
            "search_drawn_with": search.drawn_with,
        }
    return told


def of_coordinate(search: Search | None, path: str) -> dict[str, Any]:
    """The attributes of a coordinate that is chosen; of any other none."""
    for each in search.parameters if search is not None else ():
        if each.path == path:
            return {"low": each.low, "high": each.high, "steps": "ratios" if each.logarithmic else "equal"}
    return {}


def why_unsound(group: StoredGroup) -> str:
    """Why a group says of a search what none is; empty where it is one, or says nothing."""
    told = group.attributes
    if "search" not in told:
        return ""
    if told["search"] not in ("search", "tune"):
        return "attribute `search` is no kind of a search"
    word, _, metric = str(told.get("search_goal", "")).partition(" ")
    if word not in GOALS or metric not in {each.name for each in group.role("metric")}:
        return "attribute `search_goal` is no goal"
    for name, least, most in (
        ("search_at_most", 1, MOST_SEARCHED),
        ("search_plants", 1, MOST_PLANTS),
        ("search_seed", 0, 1 << 53),
        ("search_drawn_with", 0, 1 << 53),
    ):
        value = told.get(name, 1 if name != "search_at_most" else None)
        if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
            return f"attribute `{name}` is no number of it"
    margin = told.get("search_margin", 0.0)
    if not isinstance(margin, float) or not 0.0 <= margin < 1.0:
        return "attribute `search_margin` is no share"
    chosen = [each for each in group.role("coordinate") if "low" in each.attributes]
    if not chosen or not all(map(_is_range, chosen)) or list(group.role("coordinate"))[: len(chosen)] != chosen:
        return "its search chooses nothing that it could"
    if GENERATION not in group.variables or group.type(GENERATION) != "<i8" or group.values(GENERATION).min() < 0:
        return f"variable `{GENERATION}` is missing or of another type"
    return ""


def _is_range(variable: Stored) -> bool:
    low, high = (variable.attributes.get(name) for name in ("low", "high"))
    if not isinstance(low, float) or not isinstance(high, float) or not -math.inf < low < high < math.inf:
        return False
    steps = variable.attributes.get("steps")
    return steps == "equal" or (steps == "ratios" and low * high > 0.0)


def is_search(group: StoredGroup) -> bool:
    """True if the cases of a group, all of them or some, were chosen by a search or a tuning."""
    return "search" in group.attributes


def search_of(group: StoredGroup) -> Search | None:
    """The search whose cases are a group's, of which the goal is a variable's name, and plants are counted alone; None
    where it is none, or some of its cases alone."""
    told: Mapping[str, Any] = group.attributes
    if "search" not in told or group.shape("case")[0] < told["cases_in_table"]:
        return None
    word, _, metric = str(told["search_goal"]).partition(" ")
    parameters = [
        SearchedParameter(each.path, each.attributes["low"], each.attributes["high"], STEPS[each.attributes["steps"]])
        for each in group.role("coordinate")
        if "low" in each.attributes
    ]
    return Search(
        kind=told["search"],
        metric=metric,
        largest=GOALS[word],
        parameters=tuple(parameters),
        at_most=told["search_at_most"],
        of=str(told.get("search_of", "")),
        seed=told.get("search_seed", 0),
        against=str(told.get("search_against", "")),
        plants=((),) * int(told.get("search_plants", 0)),
        drawn_with=told.get("search_drawn_with", 0),
        margin=told.get("search_margin", 0.0),
    )
