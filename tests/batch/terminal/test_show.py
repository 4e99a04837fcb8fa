"""`met show`: what it prints of an archive."""

import json
import math
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import batch
from batch.archive.read import ArchiveFile
from batch.queries.given import settings_lines
from batch.queries.signals import number_text, number_texts, panels, pretty_unit
from batch.terminal.show import _range_texts, as_json, show
from met.diagnostic import Problem
from tests.batch import plans

pytestmark = pytest.mark.usefixtures("engine")


QD_RANGES = """\
                first     last  smallest   at  largest      at
  qd  shoulder      0  0.02999         0  0 s  0.03094  0.72 s  rad/s  joint rate
  qd  elbow         0  0.02699         0  0 s  0.02784  0.72 s  rad/s  joint rate
`met plot a.h5 qd --case '#19'` draws them
"""


@pytest.fixture
def sweep(here: Path) -> Iterator[ArchiveFile]:
    batch.run(plans.plan(plans.gains(20)), output="a.h5")
    with ArchiveFile("a.h5") as file:
        yield file


@pytest.mark.slow
def test_the_numbers_of_a_sweep(sweep: ArchiveFile) -> None:
    lines = show(sweep, width=100).splitlines()
    assert lines[0].startswith("a.h5  (") and lines[0].endswith("), from two_link.ic")
    assert lines[1 : lines.index("cases, worst first:") - 1] == [
        "  -D: FAST=1",
        "",
        "gains  20 cases, 2 s, modified_euler at 25 Hz, recorded at 25 Hz, arm two_link, velocity products",
        "       off",
        "  gearbox.kp = 20 values from 0.01 to 0.04 V·s/rad",
        "  links.lower.mass = 20000, 20100, 20200 g",
        "",
        "20 of 20 cases reached their end",
        "            min  median    max",
        "  settle    2.5   3.878  8.636 s  settling_time of shoulder.qd; infinite in 1",
        "  volts   5.156     5.5  6.849 V  max of shoulder.servo.voltage",
        "  require settle < 10 s  met by 19 of 20 (95 %)",
        "  require volts < 5 V    met by 0 of 20 (0 %)",
        "  warning[D341]: `require settle < 10 s` looks beyond this run, which ends at 2 s: `settle` is not",
        "      seen by then in 1 of 20 cases, and it may yet come",
        "    help: let the run last longer, or write an earlier limit",
    ]


def test_the_ranges_of_signals_of_one_case(sweep: ArchiveFile) -> None:
    text = show(sweep, ["qd"], case="#19")
    assert text.endswith(f"\n\n{QD_RANGES}")


@pytest.mark.slow
def test_a_case_has_the_ranges_of_its_first_signals_and_the_names_of_the_others(sweep: ArchiveFile) -> None:
    lines = show(sweep, case="#3").splitlines()
    assert lines[-1] == "`met plot a.h5 q qd tau shoulder.servo.voltage --case '#3'` draws them"


@pytest.mark.slow
def test_failed_cases_are_named_with_their_cause(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from met import run

    monkeypatch.setattr(run, "run", partial(plans.answer, fails=frozenset({1, 2, 5, 6, 7, 8, 9})))
    batch.run(plans.plan(plans.gains(10)), output="a.h5")
    with ArchiveFile("a.h5") as file:
        lines = show(file, width=100).splitlines()
    at = lines.index("3 of 10 cases reached their end, 7 failed")
    cause = "t = 0.2 s: joint elbow: D is not above 0 kg m^2, so qdd is undefined."
    assert lines[at + 1 : at + 3] == [f"  7 cases  {cause} (#1)", "    #1-#2, #5-#9"]
    assert "  require settle < 10 s  met by 2 of 10 (20 %), not known of 7" in lines


@pytest.mark.slow
def test_json_has_what_the_text_has(sweep: ArchiveFile) -> None:
    said = json.loads(as_json(sweep))
    assert said["experiments"][0]["cases"] == 20
    assert said["experiments"][0]["metrics"][0]["infinite"] == 1
    assert {"name": "qd", "role": "signal", "dims": ["recorded_case", "time", "joint"], "unit": "rad/s"} in said[
        "experiments"
    ][0]["variables"]


@pytest.mark.slow
def test_a_signal_that_is_not_there(sweep: ArchiveFile) -> None:
    with pytest.raises(Problem) as caught:
        show(sweep, ["shoulder.gd"])
    [diagnostic] = caught.value.diagnostics
    assert diagnostic.message == "no signal `shoulder.gd` in `gains`"
    assert diagnostic.help == (
        "did you mean `shoulder.qd`?",
        "signals here: q, qd, tau, shoulder.servo.voltage; `<joint>.q` is one joint's",
    )


@pytest.mark.slow
def test_a_case_that_is_not_there(sweep: ArchiveFile) -> None:
    with pytest.raises(Problem) as caught:
        show(sweep, case="#20")
    assert caught.value.diagnostics[0].message == "no case `#20` in `gains`"
    assert caught.value.diagnostics[0].help == ("cases here: #0 to #19; or the beginning of a case_id",)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["#²", "#" + "9" * 5000, "#99999999999999999999"])
def test_a_position_that_no_table_has(sweep: ArchiveFile, case: str) -> None:
    with pytest.raises(Problem) as caught:
        show(sweep, case=case)
    assert caught.value.diagnostics[0].code == "E321"


@pytest.mark.slow
def test_an_archive_without_histories_says_how_to_get_them(here: Path) -> None:
    batch.run(plans.plan(plans.gains(3)), output="a.h5", histories="none")
    with ArchiveFile("a.h5") as file:
        assert show(file, case="#0").endswith("no histories kept\n")
        with pytest.raises(Problem) as caught:
            show(file, ["q"])
    assert caught.value.diagnostics[0].message == "no histories of `gains` are in the archive"


@pytest.mark.slow
def test_joints_of_unlike_unit_are_signals_apart(here: Path) -> None:
    from dataclasses import replace

    experiment = plans.nominal()
    q = replace(experiment.structure.record[0], unit=("rad", "m"))
    experiment = replace(experiment, structure=replace(experiment.structure, record=(q,)))
    batch.run(plans.plan(experiment), output="a.h5")
    with ArchiveFile("a.h5") as file:
        assert [(p.axis, p.lines) for p in panels(file.groups[0])] == [
            ("q  (rad)", ("shoulder",)),
            ("q  (m)", ("elbow",)),
        ]


@pytest.mark.parametrize(
    ("values", "texts"),
    [
        ([2.0, 5.0, -1.0, 5.0], ("2", "5", "-1", "0.2 s", "5", "0.1 s")),
        ([math.nan, 1.0, 2.0, math.nan], ("1", "2", "1", "0.1 s", "2", "0.2 s")),
        ([math.nan, math.inf, -math.inf, math.nan], ("-",) * 6),
    ],
)
def test_a_range_is_of_the_finite_values(values: list[float], texts: tuple[str, ...]) -> None:
    assert _range_texts(0.1 * np.arange(4), np.array(values)) == texts


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (20100.0, "20100"),
        (0.0025, "0.0025"),
        (0.123456, "0.1235"),
        (1.2e-5, "1.2e-05"),
        (3e9, "3e+09"),
        (-0.0, "0"),
        (math.inf, "inf"),
        (100.0, "100"),
        (9999.96, "10000"),
        (-2.35, "-2.35"),
    ],
)
def test_numbers_are_short(value: float, text: str) -> None:
    assert number_text(value) == text


def test_numbers_that_differ_are_written_so_that_they_do() -> None:
    close = [0.02, 0.020000000000000004, 0.02, 0.5, math.inf]
    assert number_texts(close) == ["0.02", "0.020000000000000004", "0.02", "0.5", "inf"]
    assert number_texts([20.001, 20.002, math.nan]) == ["20.001", "20.002", "nan"]
    assert number_texts([0.01, 0.015]) == ["0.01", "0.015"] and number_texts([]) == []


@pytest.mark.parametrize(("unit", "text"), [("kg*m^2", "kg·m²"), ("1/s^10", "1/s¹⁰"), ("m*s^-2", "m·s⁻²"), ("1", "1")])
def test_units_are_typeset(unit: str, text: str) -> None:
    assert pretty_unit(unit) == text


@pytest.mark.parametrize(
    ("written", "defines", "lines"),
    [
        ("", "", []),
        ("drive.kp=2 V/rad\nlinks.fore.mass = 3 kg\n", "", ["set: drive.kp = 2 V/rad; links.fore.mass = 3 kg"]),
        ("N 2\nGRIP 1\nmacro PARTS=3\n", "N=2 GRIP", ["set: macro PARTS = 3", "-D: N=2 GRIP"]),
        ("A b = c\nvary drive.kp=[1, 2] V/rad\n", "A=b = c", ["varied: drive.kp = [1, 2] V/rad", "-D: A=b = c"]),
    ],
)
def test_what_the_command_line_gave_is_told(written: str, defines: str, lines: list[str]) -> None:
    sources = {"deck.ic": "", "<command line>": written} if written else {"deck.ic": ""}
    archive: Any = SimpleNamespace(provenance={"defines": defines}, sources=lambda: sources)
    assert settings_lines(archive) == lines
