"""Archives for tests of `data.met`, and what is said of a mistake."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import batch
import ic
from met import run as engine
from met.diagnostic import Problem
from tests.batch import plans

TUNING = """
#include <two_link.ic>
run brief like nominal { duration = 0.4 s; }
sweep tuning of brief {
    vary gearbox.kp = linspace(0.010, 0.040, 4) V*s/rad;
    vary gearbox.ki = [60, 125, 250] mV/rad;
    zip  { links.upper.mass = [40, 60] kg;  links.lower.mass = [20000, 30000] g; }
    exclude when gearbox.kp > 0.032 V*s/rad and links.upper.mass > 50 kg;
}
sweep ways of brief {
    vary integrator = [rk4, midpoint];
    vary gearbox.kp = [0.02, 0.03] V*s/rad;
}
"""
"""`tuning` has 21 cases: kp and ki in turn, the loads last; `ways` two structures of two."""


def made(folder: Path, names: list[str], **options: Any) -> Path:
    """The archive of runs and sweeps of this deck."""
    (folder / "tuning.ic").write_text(TUNING, encoding="utf-8")
    output = folder / f"{'_'.join(names)}.h5"
    batch.run(ic.compile(folder / "tuning.ic", select=names), output=output, **options)
    return output


def answered(patch: pytest.MonkeyPatch, output: Path, *experiments: Any, fails: frozenset[int] = frozenset()) -> Path:
    """An archive whose cases are answered by closed formulas (tests/batch/plans.py)."""
    plans.answering(patch)
    patch.setattr(engine, "run", partial(plans.answer, fails=fails))
    batch.run(plans.plan(*experiments), output=output)
    return output


def said(ask: Callable[[], object]) -> tuple[str, str]:
    """Of the Problem that this raises the code, and the whole message as Python shows it behind the code."""
    with pytest.raises(Problem) as caught:
        ask()
    code, _, message = str(caught.value).partition(": ")
    return code, message
