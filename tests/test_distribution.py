"""A source distribution is a checkout without its history: it can be run, tested and read. A wheel has what it says."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

LEFT_OUT = (".ci/", ".github/", ".gitignore", ".gitattributes")
"""What is for the repository alone."""


def copied(folder: Path) -> set[str]:
    """The names of what git tracks, which is copied to this folder."""
    if not (ROOT / ".git").exists() or shutil.which("git") is None:
        pytest.skip("no checkout that git can list")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    tracked = {name for name in listed.split("\0") if name and not name.startswith(LEFT_OUT)}
    for name in tracked:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / name, follow_symlinks=False)
    return tracked


def built(folder: Path, to: Path, what: str) -> None:
    """Build a "wheel" or "sdist" of what is in a folder."""
    build = f"import sys; from setuptools.build_meta import build_{what}; build_{what}(sys.argv[1])"
    subprocess.run([sys.executable, "-P", "-c", build, str(to)], cwd=folder, check=True, capture_output=True)


@pytest.mark.slow
def test_a_source_distribution_has_all_that_a_checkout_has(tmp_path: Path) -> None:
    tracked = copied(tmp_path / "met")
    built(tmp_path / "met", tmp_path, "sdist")
    (made,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(made) as archive:
        names = {each.name.partition("/")[2] for each in archive.getmembers() if each.isfile() or each.issym()}
    assert sorted(tracked - names) == []
    made_anew = {name for name in names if name.startswith("met_arm.egg-info/")} | {"PKG-INFO"}
    assert sorted(names - tracked - made_anew) == []


@pytest.mark.slow
def test_a_wheel_has_what_met_reads_of_itself(tmp_path: Path) -> None:
    tracked = copied(tmp_path / "met")
    built(tmp_path / "met", tmp_path, "wheel")
    (made,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(made) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
        page = archive.read("ic/pages/diagnostics.md").decode()
    assert "### D060: " in page
    packages = ("batch/", "hw/", "ic/", "met/", "met_arm.py", "met_conformance.py")
    assert sorted({name for name in tracked if name.startswith(packages)} - names) == []
    assert sorted(name for name in names if not name.startswith(packages)) == []
