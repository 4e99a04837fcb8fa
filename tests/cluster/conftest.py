"""A SLURM for the tests of this folder, which carry the mark `cluster`."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Generator, Iterator

import pytest

from tests.cluster.slurm import PACKAGES, Slurm, cluster, missing


@pytest.fixture(scope="session")
def slurm() -> Iterator[Slurm]:
    """A cluster on this machine. Each worker of xdist that comes to need one has its own; `turn` keeps them apart."""
    absent = missing()
    if absent:
        pytest.skip(f"no {' and no '.join(absent)}; on Debian or Ubuntu: apt-get install {PACKAGES}")
    with cluster() as started:
        yield started


@pytest.fixture(autouse=True)
def turn(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Of all workers one test at a time uses SLURM, so that cores are free for its jobs; its queue begins empty.

    A lock for as long as a worker lives would make the others wait for all its tests. The system lets go of this one
    also when a worker is killed.
    """
    if "slurm" not in request.fixturenames:
        yield
        return
    assert request.node.get_closest_marker("cluster"), "a test with the fixture `slurm` needs the mark `cluster`"
    slurm: Slurm = request.getfixturevalue("slurm")
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    with (shared / "slurm.lock").open("w") as file:
        fcntl.lockf(file, fcntl.LOCK_EX)
        yield
        slurm.clear()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """What SLURM wrote, below the message of a test that failed."""
    report = yield
    slurm = getattr(item, "funcargs", {}).get("slurm")
    if report.failed and isinstance(slurm, Slurm):
        report.sections.append(("logs of SLURM", slurm.logs()))
    return report
