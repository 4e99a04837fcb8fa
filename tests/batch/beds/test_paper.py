"""The paper's test over the wire (docs/bed.md): the same bits from every build, and figures 7 and 8 within the band.

Numbers are asserted in lock-step. In real time they depend on what else a machine does:
`python -m tests.batch.beds.paper free` measures them.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import batch
import ic
from hw.boards.build import CROSS_COMPILER, EMULATOR
from met import cli
from tests.batch.beds import paper

pytestmark = pytest.mark.slow

slow = pytest.mark.slow
on_arm = pytest.mark.firmware


def tools() -> None:
    packages = {CROSS_COMPILER: "gcc-arm-none-eabi", EMULATOR: "qemu-system-arm"}
    missing = [name for name in packages if shutil.which(name) is None]
    if missing:
        pytest.skip(
            f"no {' and no '.join(missing)}; on Debian or Ubuntu: "
            f"apt-get install {' '.join(packages[name] for name in missing)}"
        )


@pytest.mark.release
@pytest.mark.compiler
@pytest.mark.parametrize("name", ["wired", pytest.param("fast", marks=slow)])
@pytest.mark.parametrize("port", ["firmware", pytest.param("qemu", marks=on_arm)])
def test_20_s_in_lock_step_have_the_bits_of_the_bed_in_process(tmp_path: Path, name: str, port: str) -> None:
    if port == "qemu":
        tools()
    source = paper.deck(tmp_path)
    here = paper.driven(source, name, tmp_path / "here.h5", "--port", "emulated")
    there = paper.driven(source, name, tmp_path / "there.h5", "--port", port, "--lock-step")
    assert batch.diff(here, there).verdict == "identical"
    assert cli.main(["diff", str(here), str(there), "--require", "identical"]) == cli.YES
    assert batch.open(there).time.values[-1] == 20.0
    if name == "fast":  # the wire's period is the servo's: so has the simulation
        batch.run(ic.compile(source, select=["fast"]), output=tmp_path / "alone.h5")
        assert batch.diff(tmp_path / "alone.h5", there).verdict == "identical"


@pytest.mark.release
@on_arm
def test_figures_7_and_8_from_a_cortex_m3_behind_a_terminal_are_inside_the_band(tmp_path: Path) -> None:
    """Measured: 94.2 % of the shoulder's instants and 96.8 % of the elbow's; of a seed beside 19 others 92.6 % at
    least."""
    tools()
    instants, run, seeds = paper.at_the_paper_s_rates(tmp_path)
    assert instants[-1] == 20.0 and len(seeds) == paper.SEEDS
    assert (paper.inside(run, seeds) > 0.92).all()
    late = instants >= 5.0
    assert abs(run[late].mean(axis=0) / paper.SLOW - 1.0).max() < 1e-3
    # the band is narrow enough to tell a bed that has no faults from one that has
    assert 0.002 < paper.reach(seeds)[late, 0].mean() / paper.SLOW < 0.02
