"""docs/fmu.md is true: its deck becomes an FMU, and its program prints what the page shows."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.pages import Page, differs


@pytest.mark.slow
@pytest.mark.oracle
@pytest.mark.compiler
def test_fmpy_prints_what_the_page_shows(tmp_path: Path) -> None:
    pytest.importorskip("fmpy")
    page = Page("fmu.md")
    commands = list(page.follow(tmp_path))
    if "sources alone" in commands[0][2]:
        pytest.skip("no cc; on Debian or Ubuntu: apt-get install gcc libc6-dev")
    assert len(commands) == 2
    for command, shown, said in commands:
        assert not differs(shown, said), command
    (printed,) = re.findall(r"This prints\n\n```text\n(.*?)```", page.text, re.DOTALL)
    done = subprocess.run([sys.executable, "push.py"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout == printed
