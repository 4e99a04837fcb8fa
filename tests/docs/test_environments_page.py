"""docs/environments.md: its decks compile and are laid out, and its table says what the models give."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import dblquad

from ic.formatting.formatter import formatted
from met import models
from tests.ic.small_decks import check, told
from tests.met.environments.test_joint_stop import given_back
from tests.met.environments.test_plume import EXPONENT, THRUST, felt
from tests.met.environments.worlds import Link

PAGE = (Path(__file__).parents[2] / "docs" / "environments.md").read_text(encoding="utf-8")
ARM = """\
arm sail {
    link panel { mass = 12 kg;  shape = box(size = [0.02, 2, 1] m, along = x); }
    link mast  { mass = 5 kg;   shape = rod(length = 2 m, along = x); }
    joint hinge revolute  { parent = base;   child = panel;  axis = z; }
    joint slide prismatic { parent = panel;  child = mast;   axis = x; }
}
"""
RUN = "arm = sail;  rates { dynamics = 100 Hz; }  duration = 1 s;  record = [q];"


@pytest.mark.parametrize("deck", re.findall(r"^```c\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE))
def test_its_decks_compile_and_are_laid_out(deck: str, tmp_path: Path) -> None:
    assert formatted("deck.ic", deck) == deck
    whole = re.sub(r"^(run \w+ \{)", rf"\1 {RUN}", deck, flags=re.MULTILINE)
    compiled = check(tmp_path, ARM, whole)
    assert compiled.plan is not None and not compiled.diagnostics, told(compiled)


def test_its_table_of_a_plates_cells_is_what_the_model_gives() -> None:
    for far in (5.0, 2.0, 1.0):
        (row,) = re.findall(rf"^\| at {far:g} m.*?\| (.*) \|$", PAGE, re.MULTILINE)
        K = (EXPONENT + 1.5) / (4.0 * np.pi) * THRUST  # of n = 6
        exact = 4.0 * dblquad(
            lambda y, x, K=K, d=far: 2.0 * K * d**8 / (x * x + y * y + d * d) ** 5, 0.0, 0.5, 0.0, 0.5, epsrel=1e-10
        )[0]
        link = Link(np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, far))
        for cells, told_error in zip((1, 2, 4, 8, 16), row.split(" | "), strict=True):
            force = felt(link, nozzle=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), width=1.0, height=1.0, cells=cells,
                         exponent=6.0)[0][2]  # fmt: skip
            assert float(told_error.removesuffix(" %")) == float(f"{100.0 * abs(force / exact - 1.0):.1g}")


def test_its_table_of_what_stops_give_back_is_that_of_the_closed_form() -> None:
    (heads,) = re.findall(r"^\| a v \| (.*) \|$", PAGE, re.MULTILINE)
    (row,) = re.findall(r"^\| v'/v \| (.*) \|$", PAGE, re.MULTILINE)
    for av, share in zip(heads.split(" | "), row.split(" | "), strict=True):
        assert share == f"{given_back(float(av), 1.0) / float(av):.3f}"


def test_it_names_every_model() -> None:
    named = set(re.findall(r"`(\w+)`", PAGE))
    assert set(models.find_own("environment")) <= named
