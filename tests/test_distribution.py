"""A source distribution is a checkout without its history: it can be run, tested and read."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

LEFT_OUT = (".ci/", ".gitignore", ".gitattributes")
"""What is for the repository alone."""


@pytest.mark.slow
def test_a_source_distribution_has_all_that_a_checkout_has(tmp_path: Path) -> None:
    if not (ROOT / ".git").exists() or shutil.which("git") is None:
        pytest.skip("no checkout that git can list")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    tracked = {name for name in listed.split("\0") if name and not name.startswith(LEFT_OUT)}
    for name in tracked:
        (tmp_path / "met" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, tmp_path / "met" / name)
    build = "import sys; from setuptools.build_meta import build_sdist; build_sdist(sys.argv[1])"
    command = [sys.executable, "-P", "-c", build, str(tmp_path)]
    subprocess.run(command, cwd=tmp_path / "met", check=True, capture_output=True)
    (made,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(made) as archive:
        names = {each.name.partition("/")[2] for each in archive.getmembers() if each.isfile()}
    assert sorted(tracked - names) == []
    made_anew = {name for name in names if name.startswith("met_arm.egg-info/")} | {"PKG-INFO"}
    assert sorted(names - tracked - made_anew) == []
