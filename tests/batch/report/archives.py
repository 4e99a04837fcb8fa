"""Archives to make reports of: of the engine that answers at once (tests/batch/plans.py), and of the real one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import batch
import ic
from met import run as engine
from met.plan import Experiment, Plan
from tests.batch import plans

HOSTILE = "</script><script>window.hostile=1</script><img src=x onerror=window.hostile=2>\u202egnp.\x00]]>--><!--"
"""What a name should never be."""

DECK = """
#include <two_link.ic>
run there like nominal {
    substitute shoulder { bed = emulated(delay = 1);  law = measured_acceleration; }
    rates { base = 1 kHz; dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }
    duration = 2 s;
}
sweep loads of there {
    vary links.lower.mass = [10, 40, 100] kg;
    vary shoulder.bed.delay = [0, 2];
}
run brief like nominal { duration = 4 s; }
sweep ways of brief {
    vary integrator = [modified_euler, rk4];
    vary gearbox.kp = [0.01, 0.02, 0.03] V*s/rad;
}
"""


def compiled(folder: Path, *names: str, deck: str = DECK) -> Plan:
    """These runs and sweeps of a deck of the real engine."""
    (folder / "bench.ic").write_text(deck, encoding="utf-8")
    return ic.compile(folder / "bench.ic", select=list(names))


def failing(patch: pytest.MonkeyPatch, *cases: int, cause: str = "") -> None:
    """These cases fail from now on; cause: instead of their own."""

    def answer(*args: Any, **options: Any) -> Any:
        found = plans.answer(*args, fails=frozenset(cases), **options)
        return replace(found, cause=[cause if each and cause else each for each in found.cause])

    patch.setattr(engine, "run", partial(answer))


def made(path: Path, *experiments: Experiment, **options: Any) -> Path:
    batch.run(plans.plan(*experiments), output=path, **options)
    return path


def grid(kps: Sequence[float], masses: Sequence[float], **options: Any) -> Experiment:
    """A sweep over all combinations of the gain and of the lower link's mass (kg)."""
    import numpy as np

    one = plans.gains(len(kps) * len(masses), **options)
    kp, mass = np.meshgrid(kps, masses, indexing="ij")
    first, second = one.cases.coordinates
    coordinates = replace(first, values=kp.ravel()), replace(second, values=mass.ravel())
    return replace(one, cases=replace(one.cases, coordinates=coordinates))
