"""`scripts/analyse`: cppcheck, its MISRA rules and clang-tidy find nothing in the firmware, and would find a fault."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.oracle

ROOT = Path(__file__).parents[3]
TOOLS = f"{sys.prefix}/bin:{os.environ['PATH']}"


def analyse(root: Path) -> subprocess.CompletedProcess[str]:
    for tool in ("cppcheck", "clang-tidy"):
        if shutil.which(tool, path=TOOLS) is None:
            pytest.skip(f"no {tool}: `scripts/environment all` installs it")
    environment = {**os.environ, "PATH": TOOLS}
    return subprocess.run([root / "scripts" / "analyse"], capture_output=True, text=True, env=environment, timeout=500)


def test_nothing_is_found() -> None:
    done = analyse(ROOT)
    assert (done.returncode, done.stderr) == (0, "")
    assert "nothing found by Cppcheck" in done.stdout


def test_each_of_the_three_finds_what_was_put_there(tmp_path: Path) -> None:
    (tmp_path / "scripts").mkdir()
    shutil.copy(ROOT / "scripts" / "analyse", tmp_path / "scripts")
    for name in ("core", "bare", "pico", "plant"):
        (tmp_path / "hw" / "firmware" / name).mkdir(parents=True)
    shutil.copy(ROOT / "hw" / "firmware" / "bare" / "memory.c", tmp_path / "hw" / "firmware" / "core")
    for name in ("bare", "pico"):
        (tmp_path / "hw" / "firmware" / name / "empty.c").write_text("/* Nothing. */\nvoid nothing(void);\n")
    (tmp_path / "hw" / "firmware" / "core" / "faulty.c").write_text(
        "int faulty(int at);\n"
        "int faulty(int at)\n{\n"
        "    int kept[4] = {1, 2, 3, 4};\n"
        "    if (at == 7)\n"  # MISRA 15.6, and of clang-tidy: no braces
        "        return kept[5];\n"  # cppcheck: beyond its end
        "    return kept[at & 3];\n}\n"
    )
    done = analyse(tmp_path)
    assert done.returncode == 1
    for found in ("core/faulty.c:6: arrayIndexOutOfBounds", "misra-c2012-15.6", "readability-braces-around-statements"):
        assert found in done.stdout
    assert "memory.c" not in done.stdout
