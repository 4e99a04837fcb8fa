"""Pictures of sweeps that are really run: over a third parameter, over structure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import batch
import ic
from batch.plotting import plot
from tests.batch.plotting.pictures import mesh, said, shown

DECK = """
#include <two_link.ic>
run brief like nominal { duration = 1 s; }
sweep all of brief {
    vary gearbox.kp = [0.01, 0.02, 0.03] V*s/rad;
    vary gearbox.ki = [0.1, 0.2] V/rad;
    vary links.lower.mass = [10, 30] kg;
}
sweep ways of brief {
    vary integrator = [modified_euler, rk4];
    vary gearbox.kp = [0.01, 0.02, 0.03] V*s/rad;
    vary gearbox.ki = [0.1, 0.2] V/rad;
}
"""


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sweeps")
    (folder / "a.ic").write_text(DECK, encoding="utf-8")
    batch.run(ic.compile(folder / "a.ic", select=["all", "ways"]), output=folder / "a.h5", histories="none")
    return folder / "a.h5"


def volts(archive: Path) -> np.ndarray:
    """By kp, ki and mass."""
    return np.asarray(batch.open(archive)["all"].volts.values).reshape(3, 2, 2)


@pytest.mark.release
def test_maps_stand_beside_one_another_for_a_third_parameter(archive: Path, figures: list[Any], tmp_path: Path) -> None:
    plot(archive, tmp_path / "a.png", ["volts"], over=["gearbox.kp", "gearbox.ki", "links.lower.mass"])
    light, heavy, bar = shown(figures[0])
    assert [ax.get_title("left") for ax in (light, heavy)] == ["links.lower.mass = 10 kg", "links.lower.mass = 30 kg"]
    np.testing.assert_array_equal(mesh(light), volts(archive)[:, :, 0].T)
    np.testing.assert_array_equal(mesh(heavy), volts(archive)[:, :, 1].T)
    assert bar.get_ylabel() == "volts  (V)" and said(figures[0]) == "12 cases: a cell a case"


@pytest.mark.slow
def test_a_map_says_what_stands_for_its_cases(archive: Path, figures: list[Any], tmp_path: Path) -> None:
    plot(archive, tmp_path / "a.png", ["volts"], over=["gearbox.kp", "gearbox.ki"])
    np.testing.assert_array_equal(mesh(shown(figures[0])[0]), np.sort(volts(archive), axis=2)[:, :, 0].T)
    assert said(figures[0]) == "12 cases: up to 2 cases in a cell, which shows the middle one"


@pytest.mark.slow
def test_points_say_what_is_varied_besides(archive: Path, figures: list[Any], tmp_path: Path) -> None:
    plot(archive, tmp_path / "a.png", ["volts"], run="ways")
    words = [text.get_text() for text in figures[0].legends[0].get_texts()]
    assert words == ["gearbox.ki = 0.1 V/rad", "gearbox.ki = 0.2 V/rad"]
    assert figures[0].get_suptitle().strip() == "a.ic · ways"  # all structures of it
    assert said(figures[0]) == "12 cases; integrator varied too"


@pytest.mark.slow
def test_points_stand_over_words(archive: Path, figures: list[Any], tmp_path: Path) -> None:
    plot(archive, tmp_path / "a.png", ["volts"], run="ways", over=["integrator"])
    ax = shown(figures[0])[0]
    assert [label.get_text() for label in ax.get_xticklabels()] == ["modified_euler", "rk4"]
    assert ax.get_xlim() == (-0.5, 1.5)


@pytest.mark.slow
def test_one_structure_may_be_drawn_alone(archive: Path, figures: list[Any], tmp_path: Path) -> None:
    plot(archive, tmp_path / "a.png", ["volts"], run="ways.rk4")
    assert said(figures[0]) == "6 cases"
    assert len([line for line in shown(figures[0])[0].lines if len(line.get_xdata()) == 3]) == 2
