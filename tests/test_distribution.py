"""A source distribution is a checkout without its history: it can be run, tested and read. A wheel has what it says."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path
from sysconfig import get_path
from typing import Any

import h5py
import numpy as np
import pytest

from met.version import VERSION

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


def values(archive: Path) -> dict[str, tuple[str, Any]]:
    """Type and bytes, of texts the texts, of every dataset of an archive but those of its provenance, by name."""
    datasets: dict[str, tuple[str, Any]] = {}

    def keep(name: str, item: h5py.Dataset | h5py.Group) -> None:
        if isinstance(item, h5py.Dataset) and not name.startswith("provenance/"):
            array = np.asarray(item)
            datasets[name] = str(array.dtype), array.tolist() if array.dtype.hasobject else array.tobytes()

    with h5py.File(archive) as file:
        file.visititems(keep)
    return datasets


@pytest.mark.slow
def test_a_wheel_installs_into_any_python_and_gives_the_numbers_of_a_checkout(tmp_path: Path) -> None:
    """Built from the source distribution; installed beside the packages of this environment, far from the checkout."""
    copied(tmp_path / "met")
    built(tmp_path / "met", tmp_path, "sdist")
    shutil.unpack_archive(tmp_path / f"met_arm-{VERSION}.tar.gz", tmp_path / "unpacked", filter="data")
    built(tmp_path / "unpacked" / f"met_arm-{VERSION}", tmp_path, "wheel")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", tmp_path / "env"], check=True)
    python = tmp_path / "env/bin/python"
    find = [python, "-I", "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]
    site = Path(subprocess.run(find, check=True, capture_output=True, text=True).stdout.strip())
    (site / "locked.pth").write_text(f"{get_path('purelib')}\n")
    wheel = tmp_path / f"met_arm-{VERSION}-py3-none-any.whl"
    install = [
        "install",
        "--quiet",
        "--no-deps",
        "--no-index",
        "--no-compile",
        "--disable-pip-version-check",
        str(wheel),
    ]
    subprocess.run([sys.executable, "-m", "pip", "--python", str(python), *install], check=True)
    for name in ("met", "unpacked"):
        shutil.rmtree(tmp_path / name)

    def run(folder: str, *command: str | Path) -> str:
        (tmp_path / folder).mkdir(exist_ok=True)
        variables = {name: os.environ[name] for name in ("PATH", "LANG") if name in os.environ}
        variables |= {"HOME": str(tmp_path / "home")}
        done = subprocess.run(command, cwd=tmp_path / folder, env=variables, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    where = "import batch, hw, ic, met, met_arm; print(*(m.__file__ for m in (batch, hw, ic, met, met_arm)), sep='\\n')"
    assert all(Path(file).is_relative_to(site) for file in run("wheel", python, "-c", where).splitlines())
    met = tmp_path / "env/bin/met"
    assert f"{VERSION}, commit unknown\n" in run("wheel", met, "--version", "--long")
    assert run("wheel", met, "doc", "D060").startswith("D060: ")
    run("wheel", met, "run", "two_link.ic")
    run("wheel", met, "run", "two_link.ic", "gains", "-o", "gains.h5")
    run("wheel", met, "report", "gains.h5")
    assert (tmp_path / "wheel/gains.html").stat().st_size > 10_000
    run("checkout", sys.executable, "-P", ROOT / "met_arm.py", "met.cli", "run", "two_link.ic")
    of_wheel, of_checkout = (values(tmp_path / folder / "two_link.h5") for folder in ("wheel", "checkout"))
    assert of_wheel == of_checkout and any(name.endswith("qd") for name in of_wheel)
