"""docs/servos.md: the table of servos that come with MET has the numbers of their files."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import ic
from ic.find import LIBRARY

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "servos.md").read_text(encoding="utf-8")
NUMBER = r"([\d.]+)"
ROW = rf"^\| `(\w+\.ic)` \| `(\w+)` \| `(\w+)` \| {NUMBER} \| {NUMBER} \| {NUMBER} \|$"
ROWS = re.findall(ROW, PAGE, re.MULTILINE)

DECK = """#include <servos/{file}>
arm one {{
    link rod {{ mass = 100 kg;  shape = rod(length = 1 m, along = x); }}
    joint hinge revolute {{ parent = base;  child = rod;  axis = z; }}
}}
servo it like {servo} {{ command = rate(0 rad/s); }}
run still {{
    arm = one;  servos {{ hinge = it; }}
    rates {{ dynamics = 100 kHz;  servos = 1 kHz; }}
    duration = 1 ms;  record = [q];
}}
"""


@pytest.mark.parametrize(("file", "servo", "model", "ratio", "torque", "rate"), ROWS)
def test_a_row_has_the_numbers_of_its_file(
    file: str, servo: str, model: str, ratio: str, torque: str, rate: str
) -> None:
    [of] = ic.compile(text=DECK.format(file=file, servo=servo)).experiments
    values = {path.removeprefix("hinge.servo."): each.value for path, each in of.parameters.items()}
    assert of.structure.servos[0].model == model
    n = values["ratio"]
    assert (f"{n:.3g}" if n < 1000 else f"{n:.4g}") == ratio
    assert float(f"{n * values['tau_max']:.4g}") == pytest.approx(float(torque), rel=5e-4)
    assert f"{values['v_max'] / (values['kt'] * n):.3g}" == rate


def test_every_file_with_servos_is_in_the_table() -> None:
    assert len(ROWS) == 8
    table = PAGE[PAGE.index("## Servos that come with MET") : PAGE.index("## Laws: sampled or continuous")]
    assert {path.name for path in (LIBRARY / "servos").glob("*.ic")} == set(re.findall(r"`(\w+\.ic)`", table))
