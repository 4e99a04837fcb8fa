"""Models of another installed package go all the way: check, doc, plan, run and the cache of compiled code."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent

DECK = """
#include <two_link.ic>
servo drive { model = velocity_servo; gain = 2000 N*m*s/rad; limit = 80 N*m; rotor = 50 kg*m^2; command = rate(slow); }
run blown like nominal {
    servos      { shoulder = drive;  elbow = drive; }
    environment { breeze = wind { link = lower; velocity = [0, 8, 0] m/s; point = [1, 0, 0] m; area = 0.4 m^2; }; }
    rates       { dynamics = 500 Hz;  servos = 100 Hz;  record = 100 Hz; }
    duration    = 2 s;
    record      = [q, qd, elbow.servo.wanted];
    remove volts;  remove settle;
}
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder into which pip has installed the example package."""
    folder = tmp_path_factory.mktemp("site")
    package = folder.parent / "package"
    shutil.copytree(HERE, package, ignore=shutil.ignore_patterns("__pycache__", "test_*"))
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation",
               "--disable-pip-version-check", "--no-index", "--target", str(folder), str(package)]  # fmt: skip
    subprocess.run(command, check=True, capture_output=True, text=True)
    return folder


@pytest.fixture
def met(site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):  # type: ignore[no-untyped-def]
    """Runs `met` in a folder of its own, with the package installed and an empty cache."""
    (tmp_path / "blown.ic").write_text(DECK)
    environment = os.environ | {
        "PYTHONPATH": f"{HERE.parents[1]}{os.pathsep}{site}", "MET_CACHE_DIR": str(tmp_path / "cache"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }  # fmt: skip

    def run(*words: str, status: int = 0) -> str:
        command = [sys.executable, "-m", "met.cli", *words]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert done.returncode == status, done.stdout + done.stderr
        return done.stdout + done.stderr

    return run


def rates(archive: Path) -> np.ndarray:
    with h5py.File(archive) as file:
        return np.asarray(file["qd"])[0]


def test_a_servo_and_an_environment_of_another_package_go_all_the_way(met, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    assert "no errors" in met("check", "blown.ic")
    page = met("doc", "servo", "velocity_servo")
    assert "largest torque" in page and "torque that the drive goes to" in page
    assert "steady wind" in met("doc", "environment", "wind")
    assert "velocity_servo" in met("plan", "blown.ic", "blown")
    met("plan", "blown.ic", "blown", "-o", "blown.json")
    assert json.loads((tmp_path / "blown.json").read_text())
    met("run", "blown.ic", "blown", "-o", "deck.h5", "--no-picture")
    met("run", "blown.json", "-o", "plan.h5", "--no-picture")
    qd = rates(tmp_path / "deck.h5")
    # the drag on the lower link's middle, at the wind's speed less the link's own, over the servo's gain; the arm has
    # turned by 0.1 rad and more by then, whose cosine is a few per cent off 1
    drag = 0.5 * 1.225 * 0.4 * (8.0 - qd[-1] @ [3.0, 1.0]) ** 2
    assert qd[-1] - 0.03 == pytest.approx([3.0 * drag / 2000.0, drag / 2000.0], rel=0.04)
    assert (rates(tmp_path / "plan.h5") == qd).all()


def test_an_edited_servo_runs_as_edited_and_the_old_one_comes_from_the_cache(met, site: Path, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    source = site / "met_example_models" / "velocity_servo.py"
    original = source.read_text()

    def run(name: str) -> tuple[np.ndarray, int]:
        met("run", "blown.ic", "blown", "-o", name, "--no-picture")
        return rates(tmp_path / name), len([path for path in (tmp_path / "cache").rglob("*") if path.is_file()])

    try:
        before, kept = run("before.h5")
        law = "p.gain * (held.qd_cmd - joint.qd)"
        source.write_text(original.replace(law, f"0.5 * {law}"))
        assert source.read_text() != original
        edited, more = run("edited.h5")
        assert (edited != before).any(), "the edit is to be seen in the very next run"
        assert more > kept
    finally:
        source.write_text(original)
    after, still = run("after.h5")
    assert (after == before).all() and still == more, "what was compiled before is used again"


def test_a_servo_that_branches_on_a_recorded_value_is_told_where(met, site: Path) -> None:  # type: ignore[no-untyped-def]
    source = site / "met_example_models" / "velocity_servo.py"
    original = source.read_text()
    wanted = "    wanted = clip(p.gain * (held.qd_cmd - joint.qd), -p.limit, p.limit)\n"
    branching = original.replace(wanted, wanted + "    if wanted > 10.0:\n        wanted = 10.0\n")
    line = branching[: branching.index("if wanted")].count("\n") + 1
    try:
        source.write_text(branching)
        said = met("run", "blown.ic", "blown", "-o", "x.h5", "--no-picture", status=2)
    finally:
        source.write_text(original)
    assert f"velocity_servo.py:{line}:" in said
    assert "where(condition, a, b)" in said
    assert "Traceback" not in said


def test_a_servo_that_raises_is_told_where(met, site: Path) -> None:  # type: ignore[no-untyped-def]
    source = site / "met_example_models" / "velocity_servo.py"
    original = source.read_text()
    broken = original.replace("held.qd_cmd - joint.qd)", "held.qd_cmd - joint.qdot)")
    line = broken[: broken.index("joint.qdot")].count("\n") + 1
    try:
        source.write_text(broken)
        said = met("run", "blown.ic", "blown", "-o", "x.h5", "--no-picture", status=2)
        source.write_text(original.replace('unit="effort*s/joint"', 'unit="efort*s/joint"'))
        unit = met("check", "blown.ic", status=2)
    finally:
        source.write_text(original)
    who = "servo `drive` of joint `shoulder` (model velocity_servo)"
    assert f"error[E213]: {who}: `drive` raises AttributeError" in said
    assert f"velocity_servo.py:{line}:" in said and "joint.qdot" in said and "Traceback" not in said
    assert "error[E215]" in unit and "`gain`" in unit and "`efort` is not a unit" in unit
