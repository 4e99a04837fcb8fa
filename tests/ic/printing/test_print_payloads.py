"""What `met plan` and `met explain` say of payloads."""

from __future__ import annotations

import pytest

import ic
from ic.printing.explain import find_paths, with_settings
from ic.printing.plan import print_plan
from tests.ic.meaning.mechanics.test_payloads import ARM, FLIES, RUN
from tests.ic.small_decks import changed

HELD = "    payload tool { mass = 1 kg;  shape = rod(length = 0.2 m, along = x);  on = bar; }\n    environment {}\n"
DECK = ARM + changed(RUN, FLIES, ("    environment {}\n", HELD))
SWEEP = "sweep many of it { vary payloads.box.mass = [5, 10] kg;  vary payloads.box.grapple = [3, 4] s; }\n"


def shown(select: str) -> list[str]:
    lines = list(print_plan(ic.compile(text=DECK + SWEEP, select=select)))
    first = lines.index("Payloads")
    return lines[first : lines.index("", first)]


def test_plan_shows_what_is_carried_grappled_and_released() -> None:
    assert shown("it") == [
        "Payloads",
        "  payload  mass  link  grappled             released",
        "  box      5 kg  hand  3 s                  8 s",
        "  tool     1 kg  bar   held from the start  never",
    ]
    assert shown("many")[2] == "  box      5 to 10 kg  hand  3 to 4 s             8 s"


@pytest.mark.parametrize(
    ("path", "found"),
    [
        ("payloads.box.grapple", ["payloads.box.grapple"]),
        ("box.grapple", ["payloads.box.grapple"]),
        ("payloads.tool.on", ["payloads.tool.on"]),
        ("box.velocity", ["payloads.box.velocity.x", "payloads.box.velocity.y", "payloads.box.velocity.z"]),
    ],
)
def test_explain_knows_payloads_by_their_names(path: str, found: list[str]) -> None:
    experiment = with_settings(ic.compile(text=DECK).experiments[0])
    assert find_paths(experiment, path) == found
    assert experiment.parameters["payloads.tool.on"].value == "bar"
