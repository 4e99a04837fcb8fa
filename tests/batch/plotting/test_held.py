"""Signals in the units that the deck wrote, and the limits that they are held against."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.plotting import draw
from batch.plotting.held import DOTS
from batch.queries.limits import limits_of
from batch.queries.signals import DeckUnits, history, panels
from batch.terminal.show import show
from tests.batch.plotting.pictures import shown

DECK = """
#include <two_link.ic>
servo quick like gearbox { command = rate(3 deg/s);  v_max = 6 V; }
run slew like nominal {
    servos { shoulder = quick;  elbow = quick; }
    initial { shoulder.q = 30 deg;  elbow.q = -45 deg; }
    environment { end = joint_stop { joint = elbow;  upper = -30 deg;  stiffness = 1000 N*m/rad; } }
    duration = 12 s;
    record += [servo.command];
    metric far = max { of = shoulder.q; }
    require far < 60 deg;
    metric fast = peak { of = shoulder.qd; }
    require fast < 3.5 deg/s;
}
run turning like nominal {
    metric fast = max { of = elbow.qd; }
    require fast < 6 rpm;
}
"""


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, ArchiveFile]]:
    """By run its archive, of the real engine."""
    folder = tmp_path_factory.mktemp("held")
    (folder / "arm.ic").write_text(DECK, encoding="utf-8")
    with ExitStack() as stack:
        files = {}
        for name in ("slew", "turning"):
            batch.run(ic.compile(folder / "arm.ic", select=[name]), output=folder / f"{name}.h5")
            files[name] = stack.enter_context(ArchiveFile(folder / f"{name}.h5"))
        yield files


def units(file: ArchiveFile) -> tuple[DeckUnits, dict[str, Any]]:
    found = DeckUnits(file, file.groups[0])
    return found, {panel.name: found.panel(panel) for panel in panels(file.groups[0])}


@pytest.mark.slow
def test_a_signal_is_in_the_unit_in_which_the_deck_wrote_what_it_does(ran: dict[str, ArchiveFile]) -> None:
    _, found = units(ran["slew"])
    assert {name: panel.unit for name, panel in found.items()} == {
        "q": "deg",
        "qd": "deg/s",
        "tau": "N*m",
        "shoulder.servo.voltage": "V",
        "servo.command": "deg/s",
    }
    start = history(ran["slew"].groups[0], found["q"], 0)[0]
    np.testing.assert_allclose(start, [30.0, -45.0], rtol=1e-12)
    assert found["q"].axis == "q  (deg)" and found["q"].si == "rad"


@pytest.mark.slow
def test_a_requirement_of_a_joint_speaks_for_its_signal(ran: dict[str, ArchiveFile]) -> None:
    _, found = units(ran["turning"])
    assert (found["q"].unit, found["qd"].unit) == ("rad", "rpm")


@pytest.mark.slow
def test_limits_are_those_of_requirements_stops_and_servos(ran: dict[str, ArchiveFile]) -> None:
    known, found = units(ran["slew"])
    assert known.experiment is not None
    marks = {
        (name, line): limits_of(known.experiment, panel, line)
        for name, panel in found.items()
        for line in range(len(panel.lines))
    }
    assert {key: [(m.text, round(m.value, 9), m.time) for m in each] for key, each in marks.items() if each} == {
        ("q", 0): [("far < 60 deg", 60.0, False)],
        ("q", 1): [("end.upper -30 deg", -30.0, False)],
        ("qd", 0): [("settle < 10 s", 10.0, True), ("fast < 3.5 deg/s", 3.5, False), ("fast < 3.5 deg/s", -3.5, False)],
        ("shoulder.servo.voltage", 0): [("v_max 6 V", 6.0, False), ("v_max 6 V", -6.0, False)],
    }


@pytest.mark.release
def test_limits_that_are_near_are_thin_lines_with_their_names(
    ran: dict[str, ArchiveFile], figures: list[Any], tmp_path: Path
) -> None:
    draw(ran["slew"], tmp_path / "a.png")
    drawn = {}
    for ax in shown(figures[0]):
        lines = [line for line in ax.lines if line.get_label() == DOTS["label"]]
        level = [float(line.get_ydata()[0]) for line in lines if len(set(line.get_ydata())) == 1]
        assert all(line.get_linewidth() < 1.0 for line in lines)
        drawn[ax.get_ylabel()] = (np.round(level, 6).tolist(), [text.get_text().strip() for text in ax.texts])
    assert drawn == {
        "q  (deg)": ([60.0, -30.0], ["far < 60 deg", "end.upper -30 deg"]),
        "qd  (deg/s)": ([3.5], ["fast < 3.5 deg/s", "settle < 10 s"]),
        "tau  (N·m)": ([], []),
        "shoulder.servo.voltage\n(V)": ([6.0], ["v_max 6 V"]),
    }


@pytest.mark.slow
def test_a_limit_that_is_far_off_is_named_above_the_panel(
    ran: dict[str, ArchiveFile], figures: list[Any], tmp_path: Path
) -> None:
    draw(ran["turning"], tmp_path / "a.png", ["qd"])
    [ax] = shown(figures[0])
    assert ax.get_title("right") == "fast < 6 rpm ↑"
    assert ax.get_ylim()[1] < 1.0


@pytest.mark.slow
def test_lines_of_a_panel_are_equally_thick(ran: dict[str, ArchiveFile], figures: list[Any], tmp_path: Path) -> None:
    draw(ran["slew"], tmp_path / "a.png")
    for ax in shown(figures[0]):
        assert len({line.get_linewidth() for line in ax.lines if line.get_label() != DOTS["label"]}) == 1


def test_a_line_that_lies_on_another_has_gaps(ran: dict[str, ArchiveFile], figures: list[Any], tmp_path: Path) -> None:
    draw(ran["turning"], tmp_path / "a.png", ["q", "tau"])
    styles = [
        [line.get_linestyle() for line in ax.lines if line.get_label() != DOTS["label"]] for ax in shown(figures[0])
    ]
    assert styles == [["-", "--"], ["-", "-"]]


def test_a_terminal_shows_the_same_units(ran: dict[str, ArchiveFile]) -> None:
    text = show(ran["slew"], ["q", "qd"])
    assert " deg    joint position\n" in text and " deg/s  joint rate\n" in text
