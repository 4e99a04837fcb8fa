"""docs/diff.md: a mended servo, from two versions of an installed package, told as the page tells it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "diff.md").read_text(encoding="utf-8")


def shown(name: str) -> str:
    """A file of the page."""
    found = re.search(rf"<!-- {re.escape(name)} -->\n```\w+\n(.*?)```", PAGE, re.DOTALL)
    assert found is not None
    return found[1]


def install(folder: Path, version: int, text: str) -> None:
    """The package of the page, of this version, in place of an earlier one."""
    told = folder / "packages" / "arm_drive-0.dist-info"
    told.mkdir(parents=True, exist_ok=True)
    (told / "METADATA").write_text(f"Metadata-Version: 2.1\nName: arm-drive\nVersion: {version}\n")
    (told / "entry_points.txt").write_text("[met.servos]\narm_drive = arm_drive:SERVO\n")
    (folder / "packages" / "arm_drive.py").write_text(text)


def met(folder: Path, *words: str, status: int) -> str:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(folder / "packages")])}
    environment["PYTHONDONTWRITEBYTECODE"] = "1"
    command = [sys.executable, "-m", "met.cli", *words]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where both archives are, made as the page says."""
    folder = tmp_path_factory.mktemp("story")
    (folder / "drive.ic").write_text(shown("drive.ic"))
    install(folder, 1, shown("arm_drive.py"))
    met(folder, "run", "drive.ic", "tuning", "-o", "before.h5", "-q", "--no-picture", status=1)
    install(folder, 2, shown("arm_drive.py, version 2"))
    met(folder, "run", "before.h5", "--all", "-o", "after.h5", "-q", "--no-picture", status=1)
    return folder


def test_the_page_shows_what_is_said(folder: Path) -> None:
    found = re.search(r"\$ met diff before\.h5 after\.h5\n(.*?)```", PAGE, re.DOTALL)
    assert found is not None
    said = met(folder, "diff", "before.h5", "after.h5", status=1)
    assert "".join(line for line in said.splitlines(keepends=True) if "MET's commit" not in line) == found[1]


def test_the_mended_servo_stops_at_once(folder: Path) -> None:
    import numpy as np

    import batch

    found = batch.diff(folder / "before.h5", folder / "after.h5")
    assert found.verdict == "different" and not found.changed.meaning and not found.changed.decks
    [experiment] = found.experiments
    assert experiment.cases.count == 28 and not experiment.ended
    assert experiment.requirements == [("creep < 0.001 rad/s", 20, 23)]
    before, after = (batch.open(folder / name).sel(recorded_case=27, joint="shoulder").qd for name in
                     ("before.h5", "after.h5"))  # fmt: skip
    at_rest = [float(qd.time[np.abs(qd) > 0.01][-1]) for qd in (before, after)]
    assert at_rest[0] - at_rest[1] > 2.0  # s


def test_an_archive_that_is_run_again_by_the_same_version_is_identical(folder: Path) -> None:
    met(folder, "run", "after.h5", "--all", "-o", "again.h5", "-q", "--no-picture", status=1)
    met(folder, "diff", "after.h5", "again.h5", "--require", "identical", status=0)
