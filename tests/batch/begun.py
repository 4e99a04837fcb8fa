"""A campaign of five tasks, begun and not ended: to be damaged, and gone on with."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import batch
from batch.campaigns import performing, tasks
from met.diagnostic import Problem
from met.messages.render import render
from met.plan import Plan
from tests.batch import plans, whole

CASES, OF_TASK = 40, 8


def plan() -> Plan:
    return plans.plan(plans.gains(CASES))


def short_tasks(patch: pytest.MonkeyPatch) -> None:
    """Eight cases each, and worth keeping."""
    patch.setattr(tasks, "MOST_CASES", OF_TASK)
    patch.setattr(performing, "WORTH_SECONDS", 0.0)


def begin(archive: Path, of: Plan | None = None, after: int = 3, **options: Any) -> dict[str, tuple[int, int]]:
    """Run a part of a plan; its shards."""
    with pytest.raises(KeyboardInterrupt):
        batch.run(of or plan(), output=archive, executor=whole.Watched(after=after), **options)
    found = whole.shards(archive)
    assert found and not archive.exists()
    return found


def go_on(archive: Path, of: Plan | None = None, **options: Any) -> tuple[whole.Watched, tuple[str, ...]]:
    """Run the rest; what was run, and the notes."""
    rest = whole.Watched()
    notes = batch.run(of or plan(), output=archive, executor=rest, **options).notes
    assert whole.beside_it(archive) == [archive.name, f"{archive.name}.run.json"]
    return rest, notes


def refused(archive: Path, of: Plan | None = None, **options: Any) -> str:
    """What is said where a campaign cannot be run, or cannot go on."""
    with pytest.raises(Problem) as caught:
        batch.run(of or plan(), output=archive, **options)
    return render(caught.value.diagnostics)


def flip(path: Path, position: int, bit: int = 3) -> None:
    """Turn a bit of a file over."""
    data = bytearray(path.read_bytes())
    data[position] ^= 1 << bit
    path.write_bytes(data)
