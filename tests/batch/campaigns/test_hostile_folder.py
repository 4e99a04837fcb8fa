"""What lies beside a deck is data: no module, package or entry point in the working folder is run by any command."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import met_arm
from met.host import entry_points, interpreter
from met.plan import file as plan_file
from tests.batch import plans

ROOT = Path(__file__).resolve().parents[3]

MET = "import sys\nfrom met_arm import main\nsys.exit(main())\n"
"""The script that an installer writes for `met`."""

SBATCH = """#!/bin/sh
cat > job.sh
for word in "$@"; do
    case $word in --array=*) export SLURM_ARRAY_TASK_ID=0 ;; esac
done
sh job.sh >> log 2>&1
echo 7
"""
"""A queue that runs its jobs at once, where they were submitted."""

PACKAGES = (
    "batch",
    "hw",
    "ic",
    "met",
    "numpy",
    "click",
    "h5py",
    "llvmlite",
    "distributed",
    "dask",
    "tornado",
    "xarray",
    "serial",
    "matplotlib",
    "sitecustomize",
    "usercustomize",
    "hostile",
)
"""What else is imported by somebody; `hostile` is what the entry points name."""

DECK = """\
#include <two_link.ic>
run wired like nominal {
    rates    { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    duration = 10 ms;
    record   = [q];
    remove settle;
    remove volts;
    substitute shoulder { bed = emulated;  law = velocity_tracking; }
}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A working folder full of modules that write `ran`, with entry points, a plan and a deck."""
    here = tmp_path / "here"
    here.mkdir()
    ran = tmp_path / "ran"
    hostile = f"with open({str(ran)!r}, 'a') as file:\n    file.write(__file__ + '\\n')\n"
    for name in {*sys.stdlib_module_names, *PACKAGES}:
        (here / f"{name}.py").write_text(hostile)
    for name in ("batch", "hw", "met", "json", "numpy"):
        (here / name).mkdir()
        (here / name / "__init__.py").write_text(hostile)
    info = here / "hostile-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: hostile\nVersion: 1.0\n")
    offered = "".join(f"[{group}]\nhostile = hostile:model\n" for group in ("met.servos", "met.commands", "met.beds"))
    (info / "entry_points.txt").write_text(offered)
    plan_file.write(plans.plan(plans.gains(9)), here / "p.json")
    (here / "deck.ic").write_text(DECK)
    (here / "matplotlibrc").write_text("text.usetex: True\nfont.size: 30\nbackend: module://hostile\n")
    return here


@pytest.fixture
def met(folder: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Runs `met` in that folder; nothing there must have been run."""
    script, queue = folder.with_name("met"), folder.with_name("sbatch")
    script.write_text(MET)
    queue.write_text(SBATCH)
    queue.chmod(0o755)
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONSAFEPATH")}
    environment["PATH"] = f"{folder.parent}{os.pathsep}{environment['PATH']}"

    def run(*words: str, **more: str) -> subprocess.CompletedProcess[str]:
        done = subprocess.run(
            [sys.executable, str(script), *words],
            cwd=folder,
            env=environment | more,
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert not folder.with_name("ran").exists(), folder.with_name("ran").read_text() + done.stderr
        return done

    return run


@pytest.mark.slow
@pytest.mark.parametrize(
    "way",
    [
        pytest.param((), marks=pytest.mark.slow),
        ("--processes", "1"),
        pytest.param(("--timeout", "60 s"), marks=pytest.mark.slow),
        pytest.param(("--dask", "local"), marks=pytest.mark.slow),
    ],
    ids=" ".join,
)
def test_a_campaign_runs_nothing_of_the_folder(
    met: Callable[..., subprocess.CompletedProcess[str]], way: tuple[str, ...], folder: Path
) -> None:
    done = met("run", "p.json", "-o", "a.h5", "--no-picture", "--quiet", *way)
    assert (done.stdout, done.stderr) == ("", "")
    assert (folder / "a.h5").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ("run", "p.json", "-o", "a.h5", "--no-picture", "--processes", "1"),
        ("run", "p.json", "-o", "a.h5", "--no-picture", "--dask", "local"),
        ("submit", "--slurm", "p.json", "-o", "a.h5", "--jobs", "1"),
        ("bed", "run", "deck.ic", "wired", "--port", "emulated", "-o", "a.h5", "--no-picture"),
    ],
    ids=" ".join,
)
def test_modules_of_mets_names_on_pythonpath_are_not_taken_for_it(
    met: Callable[..., subprocess.CompletedProcess[str]], words: tuple[str, ...], folder: Path
) -> None:
    others = folder.with_name("others")
    others.mkdir()
    for name in met_arm.PACKAGES:
        shutil.copy(folder / f"{name}.py", others)
    done = met(*words, "--quiet", PYTHONPATH=str(others))
    assert (done.stdout, done.stderr) == ("", "")
    assert (folder / "a.h5").exists()


@pytest.mark.release
def test_a_picture_takes_nothing_of_the_folder(
    met: Callable[..., subprocess.CompletedProcess[str]], folder: Path
) -> None:
    met("run", "p.json", "-o", "a.h5", "--quiet")
    assert met("plot", "a.h5", "settle", "-o", "a.svg").returncode == 0
    (folder / "matplotlibrc").unlink()
    met("plot", "a.h5", "settle", "-o", "b.svg")
    assert (folder / "a.png").exists() and (folder / "a.svg").read_bytes() == (folder / "b.svg").read_bytes()


@pytest.mark.release
def test_jobs_of_a_queue_run_nothing_of_the_folder(
    met: Callable[..., subprocess.CompletedProcess[str]], folder: Path
) -> None:
    done = met("submit", "--slurm", "p.json", "-o", "a.h5", "--jobs", "1", "--quiet")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (folder / "a.h5").exists(), (folder / "log").read_text()


@pytest.mark.release
@pytest.mark.parametrize("words", [("run", "-o", "a.h5", "--no-picture"), ("probe",)], ids=" ".join)
def test_beds_run_nothing_of_the_folder(
    met: Callable[..., subprocess.CompletedProcess[str]], words: tuple[str, ...]
) -> None:
    verb, *rest = words
    done = met("bed", verb, "deck.ic", "wired", "--port", "emulated", *rest)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout


def test_an_empty_folder_of_pythonpath_is_no_working_folder_of_a_child(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(["", "own", ""]))
    given = interpreter.packages()
    assert given == {"PYTHONPATH": os.pathsep.join([str(ROOT), str(folder / "own")]), "PYTHONSAFEPATH": "1"}


def test_a_child_finds_what_pythonpath_names_and_nothing_beside_it(tmp_path: Path, folder: Path) -> None:
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "mine.py").write_text("import met, json\nprint(met.__file__)\n")
    (tmp_path / "own" / "met.py").write_text("")  # where MET is installed, the user's folders come before it
    environment = {**interpreter.environment(), "PYTHONPATH": str(tmp_path / "own")}
    done = subprocess.run(interpreter.command("mine"), cwd=folder, env=environment, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == (f"{ROOT / 'met' / '__init__.py'}\n", "")
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("first", ["", "."])
def test_a_package_that_lies_in_the_working_folder_is_not_installed(
    folder: Path, monkeypatch: pytest.MonkeyPatch, first: str
) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", [first and str(folder), *sys.path])  # of `python -c`, and of `python -m`
    assert "hostile" not in {point.package for point in entry_points.offered("met.servos")}
    monkeypatch.setattr(sys, "path", [*sys.path, str(folder)])  # but where the user names it, it is
    assert "hostile" in {point.package for point in entry_points.offered("met.servos")}


def test_one_file_says_how_a_python_is_started() -> None:
    names = re.compile(r"sys\.executable|multiprocessing|processes=True|ProcessPool")
    paths = [path for room in ("batch", "hw", "ic", "met") for path in (ROOT / room).rglob("*.py")]
    found = {str(path.relative_to(ROOT)) for path in paths if names.search(path.read_text(encoding="utf-8"))}
    # the last four only print it
    assert found == {
        *("met/host/interpreter.py", "batch/cli/lsp.py", "batch/export/parquet.py", "ic/cli_new.py", "met/about.py")
    }
