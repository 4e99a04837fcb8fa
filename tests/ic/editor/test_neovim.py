"""Neovim, driven by the settings of docs/editors.md."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from met.host import interpreter


@pytest.mark.slow
def test_neovim_shows_a_mistake_mends_it_and_renames(tmp_path: Path) -> None:
    if shutil.which("nvim") is None:
        pytest.skip("no nvim; on Debian or Ubuntu: apt-get install neovim")
    (tmp_path / "arm.ic").write_text("#include <two_link.ic>\nrun more like nominal { duration = 5; }\n")
    met = tmp_path / "met"
    met.write_text(f'#!/bin/sh\nexec {sys.executable} -P -m met.cli "$@"\n')
    met.chmod(0o755)
    script = Path(__file__).with_name("neovim.lua")
    done = subprocess.run(
        ["nvim", "--headless", "-u", "NONE", "-c", f"luafile {script}", "arm.ic"],
        cwd=tmp_path,
        env={**os.environ, **interpreter.environment(), "MET_COMMAND": str(met), "HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=240,
    )
    lines = done.stdout.splitlines()
    assert lines[0] == "1 D060 `duration` of run `more` is in s, and this is a bare number", done.stdout + done.stderr
    assert "action write `5 s`" in lines and "line run more like nominal { duration = 5 s; }" in lines
    assert "left 0" in lines and "hover `duration = 3 s;`" in lines
    assert "renamed run longer like nominal { duration = 5 s; }" in lines and lines[-1] == "refused `kg` is a unit"
