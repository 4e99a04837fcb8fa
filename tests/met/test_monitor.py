"""Requirements over time of 1,000 random traces, computed in the kernel, against rtamt, an independent monitor of
signal temporal logic.

rtamt's answers are kept (tests/oracles/monitor_rtamt.py says why, and makes them): so this needs no package. The traces
are commands of joints that follow them exactly, which both sides compute from the same numbers.
"""

from __future__ import annotations

import csv

import numpy as np
import pytest

import ic
from met import run as engine
from tests.oracles import monitor_rtamt as oracle

CLOSE = 1e-12

CONDITION = "x.servo.command < 0.6 rad and y.servo.command > -0.7 rad or not z.servo.command <= 0.2 * x.servo.command"
RARE = "x.servo.command < -0.6 rad and y.servo.command > 0.5 rad"
REQUIRED = {
    "always": f"always({CONDITION})",
    "always_late": f"always({CONDITION}, after = 0.25 s)",
    "always_within": f"always({CONDITION}, after = 0.07 s, within = 0.28 s)",
    "eventually": f"eventually({RARE})",
    "eventually_within": f"eventually({RARE}, after = 0.3 s, within = 0.06 s)",
    "never": f"never({RARE})",
    "never_within": f"never({RARE}, after = 0.5 s, within = 0.1 s)",
    "nearer": "always(abs(x.servo.command - y.servo.command) < 2.5 rad + z.servo.command, within = 0.4 s)",
    "stretch": f"holds_for({CONDITION}, 0.3 s)",
    "stretch_late": f"holds_for({RARE}, 0.05 s, after = 0.25 s)",
    "share_of_time": f"share_of_time({CONDITION}) > 50 %",
    "share_late": f"share_of_time({CONDITION}, after = 0.25 s) > 50 %",
}


def deck() -> str:
    """Three joints, each of which is commanded a sine; the sweep's cases are the traces of a file."""
    joints, parents = "", {"x": "base", "y": "arm_x", "z": "arm_y"}
    servos, words = "", ""
    for name, parent in parents.items():
        joints += f"    link arm_{name} {{ mass = 1 kg; shape = rod(length = 1 m, along = x); }}\n"
        joints += f"    joint {name} revolute {{ parent = {parent}; child = arm_{name}; axis = z; }}\n"
        servos += (
            f"servo swing_{name} like ideal {{ command = position(sine(amplitude = 1 rad, frequency = 1 Hz, "
            "offset = 0.1 rad, phase = 0.1 rad)); }\n"
        )
        words += f"{name} = swing_{name}; "
    required = "".join(f"    require {name}: {text};\n" for name, text in REQUIRED.items())
    return f"""
arm three {{
{joints}}}
servo ideal {{ model = ideal; bandwidth = 5 1/s; }}
{servos}run trace {{
    arm = three;
    servos {{ {words}}}
    rates {{ dynamics = {oracle.RATE} Hz; servos = {oracle.RATE} Hz; record = {oracle.RATE} Hz; }}
    duration = 1 s;
    record = [];
{required}}}
sweep traces of trace {{ from "traces.csv"; }}
"""


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> tuple[engine.Run, list[dict[str, float]]]:
    """The answers of MET for the traces, and those of rtamt."""
    folder = tmp_path_factory.mktemp("traces")
    rows, answers = oracle.read()
    units = {"amplitude": "rad", "frequency": "Hz", "phase": "rad", "offset": "rad"}
    with (folder / "traces.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        paths = [name.split(".") for name in rows[0]]
        writer.writerow(f"swing_{signal}.command.{number} [{units[number]}]" for signal, number in paths)
        writer.writerows([repr(value) for value in row.values()] for row in rows)
    (folder / "deck.ic").write_text(deck(), encoding="utf-8")
    (experiment,) = ic.compile(folder / "deck.ic", select=["traces"]).experiments
    return engine.run(experiment), answers


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in REQUIRED if not name.startswith("stretch")])
def test_margins_and_shares_are_rtamts(both: tuple[engine.Run, list[dict[str, float]]], name: str) -> None:
    found, answers = both
    assert len(found.metrics[name]) == oracle.TRACES
    np.testing.assert_allclose(found.metrics[name], [each[name] for each in answers], rtol=0.0, atol=CLOSE)


@pytest.mark.parametrize("name", REQUIRED)
def test_requirements_are_met_where_rtamts_formula_holds(
    both: tuple[engine.Run, list[dict[str, float]]], name: str
) -> None:
    found, answers = both
    robustness = np.array([each[name] for each in answers])
    holds = robustness > 0.5 if name.startswith("share") else robustness >= 0.0
    (met,) = (values for text, values in found.met.items() if text.startswith(f"{name}:"))
    np.testing.assert_array_equal(met, holds)
    assert 20 < holds.sum() < oracle.TRACES - 20  # both happen


def test_the_traces_are_those_that_rtamt_saw() -> None:
    assert oracle.read()[0] == oracle.rows_of_traces()
