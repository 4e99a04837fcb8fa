"""The story of docs/diff.md: a servo of an installed package, of which version 2 mends what version 1 does wrong."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tests.docs.pages import ROOT, Page

PAGE = Page("diff.md")


def install(folder: Path, version: int, text: str) -> None:
    """The package of the page, of this version, in place of an earlier one."""
    told = folder / "packages" / "arm_drive-0.dist-info"
    told.mkdir(parents=True, exist_ok=True)
    (told / "METADATA").write_text(f"Metadata-Version: 2.1\nName: arm-drive\nVersion: {version}\n")
    (told / "entry_points.txt").write_text("[met.servos]\narm_drive = arm_drive:SERVO\n")
    (folder / "packages" / "arm_drive.py").write_text(text)


def met(folder: Path, *words: str, status: int | None) -> str:
    """What a command prints. status: with which it ends; None: yes or no."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(folder / "packages")])}
    environment["PYTHONDONTWRITEBYTECODE"] = "1"
    command = [sys.executable, "-m", "met.cli", *words]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode in ((0, 1) if status is None else (status,)), done.stdout + done.stderr
    return done.stdout


def told(folder: Path) -> Path:
    """The folder, in which before.h5 and after.h5 are made as the page says."""
    (folder / "drive.ic").write_text(PAGE.files["drive.ic"])
    install(folder, 1, PAGE.files["arm_drive.py"])
    met(folder, "run", "drive.ic", "tuning", "-o", "before.h5", "-q", "--no-picture", status=1)
    install(folder, 2, PAGE.files["arm_drive.py, version 2"])
    met(folder, "run", "before.h5", "--all", "-o", "after.h5", "-q", "--no-picture", status=1)
    return folder
