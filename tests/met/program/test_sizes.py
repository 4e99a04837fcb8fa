"""The smallest arm and a long one, from deck to archive; and a run's memory, which its length does not change."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import batch
import ic
from met import run as engine
from tests.oracles.friction_deck import friction_deck

RUN = """
run swinging {{
    arm = chain;  environment {{ gravity = [0, 0, -9.81] m/s^2; }}
    initial {{ j0.q = 0.3 rad; }}
    rates {{ dynamics = 1 kHz; record = 100 Hz; }}  duration = {duration};
    record = [q, qd, qdd, tau];
    metric top = max {{ of = j0.qd; }}
}}
"""


def chain(joints: int, duration: str) -> str:
    """A hanging chain: joints that turn about x and y in turn, links alike and 0.1 m long."""
    lines = ["arm chain {"]
    for i in range(joints):
        lines.append(f"    link l{i} {{ mass = 0.2 kg; shape = rod(length = 0.1 m, along = z); }}")
        lines.append(
            f"    joint j{i} revolute {{ parent = {f'l{i - 1}' if i else 'base'}; child = l{i};"
            f" axis = {'xy'[i % 2]}; at = [0, 0, {0.1 if i else 0}] m; rpy = [{0 if i else 180}, 0, 0] deg; }}"
        )
    return "\n".join([*lines, "}", RUN.format(duration=duration)])


@pytest.mark.release
@pytest.mark.parametrize("joints", [1, pytest.param(100, marks=pytest.mark.slow)])
def test_arms_of_one_joint_and_of_a_hundred_run_from_decks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, joints: int
) -> None:
    monkeypatch.chdir(tmp_path)
    plan = ic.compile(text=chain(joints, "0.5 s"))
    run = engine.run(plan.experiments[0])
    assert run.status.tolist() == [engine.DONE] and run.signals["q"].shape == (1, 51, joints)
    assert np.ptp(run.signals["q"][0, :, 0]) > 0.05, "it swings"
    batch.run(plan, output="chain.h5")
    with batch.open("chain.h5") as data:
        for name, values in run.signals.items():
            assert np.array_equal(np.asarray(data[name]).reshape(values.shape), values), name
        assert float(data["top"].item()) == run.metrics["top"][0]


@pytest.mark.release
def test_a_hundred_joints_that_stick_run_from_a_deck() -> None:
    run = engine.run(ic.compile(text=friction_deck(100, 9, duration="0.2 s"), select=["many"]).experiments[0])
    assert not run.status.any() and run.events["splits"].max() > 10 and not run.events["undecided"].any()


MEASURE = """
import json, resource, sys
import batch, ic
plan = ic.compile(sys.argv[1], select=["many"])
archive = batch.run(plan, output=sys.argv[2], histories=sys.argv[3], fresh=True)
print(json.dumps([resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0, archive.ok]))
"""


@pytest.mark.release
def test_memory_does_not_grow_with_the_number_of_steps(tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "MET_CACHE_DIR": str(tmp_path / "cache")}

    def peak(duration: str, histories: str) -> float:
        """MiB at most of a process of its own."""
        deck = tmp_path / "deck.ic"
        deck.write_text(friction_deck(2, 45, duration=duration))
        words = [sys.executable, "-c", MEASURE, str(deck), str(tmp_path / "out.h5"), histories]
        # Linux counts to a new process what its parent held when it began: a shell between holds little.
        done = subprocess.run(
            ["/bin/sh", "-c", '"$0" "$@"; exit $?', *words],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        size, ok = json.loads(done.stdout.splitlines()[-1])
        assert ok
        return float(size)

    peak("0.4 s", "none")  # compiles: the others find the kernel in the cache
    short, long, kept = peak("0.4 s", "none"), peak("40 s", "none"), peak("40 s", "all")
    print(f"peak memory: 100 steps {short:.1f} MiB, 10,000 steps {long:.1f} MiB, with histories {kept:.1f} MiB")
    # The rows that are not kept are 5.5 MiB; allocators and threads vary by about one.
    assert abs(long - short) < 3.0, (short, long)
    assert kept - long > 4.0, "the measure sees rows where they are kept"
