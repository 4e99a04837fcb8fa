"""`met show`: what it prints, and that its plots show what is there."""

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
from batch.queries.given import given
from batch.queries.signals import number_text, number_texts, panels, pretty_unit
from batch.terminal import braille
from batch.terminal.show import as_json, show
from met.diagnostic import Problem
from tests.batch import plans

pytestmark = pytest.mark.usefixtures("engine")


QD_PLOT = (
    "   0.03 ┤          ⢀⣠⠤⠴⠒⠒⠒⢚⣉⣉⣉⣉⣙⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒⠒ shoulder\n"
    "        │       ⢀⡤⣞⡭⠴⠒⠚⠉⠉⠉⠉    ⠈⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉⠉ elbow\n"
    "   0.02 ┤     ⢀⣴⡿⠚⠁\n"
    "        │    ⣰⡿⠋\n"
    "        │  ⢀⣾⠋\n"
    "   0.01 ┤ ⢀⡾⠁\n"
    "        │⢠⡟\n"
    "      0 ┤⡞\n"
    "        └┬──────────────────────────┬─────────────────────────┬\n"
    "         0                          1                         2 s\n"
)


@pytest.fixture
def sweep(here: Path) -> Iterator[ArchiveFile]:
    batch.run(plans.plan(plans.gains(20)), output="a.h5")
    with ArchiveFile("a.h5") as file:
        yield file


@pytest.mark.slow
def test_the_numbers_of_a_sweep(sweep: ArchiveFile) -> None:
    lines = show(sweep, width=100, plots=False).splitlines()
    assert lines[0].startswith("a.h5  (") and lines[0].endswith("), from two_link.ic")
    assert lines[1 : lines.index("cases, worst first:") - 1] == [
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


def test_a_plot_in_the_terminal(sweep: ArchiveFile) -> None:
    text = show(sweep, ["qd"], case="#19", width=72)
    assert text[text.index("qd  (rad/s)") :] == "qd  (rad/s)  joint rate\n" + QD_PLOT


@pytest.mark.slow
def test_a_plot_fits_the_width(sweep: ArchiveFile) -> None:
    for width in (60, 80, 100):
        lines = show(sweep, ["q", "tau"], width=width).splitlines()
        assert max(len(line) for line in lines if line[:1] >= "⠀" or "│" in line or "┤" in line) <= width


@pytest.mark.slow
def test_failed_cases_are_named_with_their_cause(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from met import run

    monkeypatch.setattr(run, "run", partial(plans.answer, fails=frozenset({1, 2, 5, 6, 7, 8, 9})))
    batch.run(plans.plan(plans.gains(10)), output="a.h5")
    with ArchiveFile("a.h5") as file:
        lines = show(file, width=100, plots=False).splitlines()
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
        assert show(file).endswith("no histories kept\n")
        with pytest.raises(Problem) as caught:
            show(file, ["q"])
    assert caught.value.diagnostics[0].message == "no histories of `gains` are in the archive"


@pytest.mark.slow
def test_joints_of_unlike_unit_are_drawn_apart(here: Path) -> None:
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


class TestBraille:
    def draw(self, values: list[float], **options: object) -> list[str]:
        time = np.arange(len(values), dtype=float)
        given = {"title": "y", "width": 30, "height": 4, **options}
        return braille.draw(time, [np.array(values)], [""], **given)  # type: ignore[arg-type]

    def test_a_rising_line_rises(self) -> None:
        rows = [line.split("│")[-1].split("┤")[-1] for line in self.draw([0.0, 1.0])[1:5]]
        lefts = [len(row) - len(row.lstrip()) for row in rows]
        assert lefts == sorted(lefts, reverse=True) and lefts[0] > lefts[-1]

    def test_a_spike_between_columns_is_seen(self) -> None:
        values = [0.0] * 10_000
        values[4321] = 1.0
        assert self.draw(values)[1].strip(" │┤1.0") != ""

    def test_a_line_that_breaks_off_ends(self) -> None:
        rows = self.draw([0.0, 1.0, 2.0, math.nan, math.nan, math.nan, math.nan, math.nan])
        assert max(len(row) for row in rows[1:5]) < 20

    def test_a_constant_is_a_line_in_the_middle(self) -> None:
        rows = self.draw([2.0] * 9)
        drawn = [row for row in rows[1:5] if any("⠁" <= character <= "⣿" for character in row)]
        assert len(drawn) == 1

    def test_nothing_finite_is_said(self) -> None:
        assert self.draw([math.nan, math.inf]) == ["y", "  (no finite values)"]

    @pytest.mark.parametrize("size", [1e-300, 1e-9, 1.0, 1e9, 1e300])
    def test_any_size_of_number_is_drawn(self, size: float) -> None:
        for low in (0.0, -size, size * (1 - 1e-9)):
            assert len(self.draw([low, size, low])) == 7

    def test_labels_do_not_cover_one_another(self) -> None:
        time = np.arange(5.0)
        names = ["one", "two", "three"]
        rows = braille.draw(time, [np.ones(5)] * 3, names, title="y", width=40, height=4)
        assert [sum(row.endswith(name) for row in rows) for name in names] == [1, 1, 1]

    def test_colour_is_undone_at_the_end_of_a_line(self) -> None:
        for row in self.draw([0.0, 1.0, 0.0], colour=True)[1:5]:
            assert row.count("\x1b[38") == row.count("\x1b[0m")


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


@pytest.mark.slow
def test_an_unknown_signal_is_told_without_plots_too(sweep: ArchiveFile) -> None:
    for plots in (True, False):
        with pytest.raises(Problem) as caught:
            show(sweep, ["nothing"], plots=plots)
        assert caught.value.diagnostics[0].code == "E324"


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
    assert given(archive) == lines
