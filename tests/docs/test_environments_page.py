"""docs/environments.md: its decks compile and are laid out, and its table says what the models give."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from ic.formatting.formatter import formatted
from met import models
from tests.ic.small_decks import check, messages
from tests.met.environments.test_joint_stop import given_back
from tests.met.environments.test_plume import THRUST, felt
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
RUN = "arm = sail;  rates { dynamics = 100 Hz; }  duration = 2 s;  record = [q];"


@pytest.mark.parametrize("deck", re.findall(r"^```c\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE))
def test_its_decks_compile_and_are_laid_out(deck: str, tmp_path: Path) -> None:
    assert formatted("deck.ic", deck) == deck
    whole = re.sub(r"^(run \w+ \{)", rf"\1 {RUN}", deck, flags=re.MULTILINE)
    compiled = check(tmp_path, ARM, whole)
    assert compiled.plan is not None and not compiled.diagnostics, messages(compiled)


def test_its_table_of_a_plates_cells_is_what_the_model_gives() -> None:
    """Against the closed form along the radius, of which the rest is an integral over a quarter of a right angle."""
    exponent, rows = 0.0, re.findall(r"^\| (?:n = (\d+), )?at ([\d.]+) m \| (.*) \|$", PAGE, re.MULTILINE)
    assert len(rows) == 5
    for n, at, row in rows:
        exponent, far = float(n or exponent), float(at)
        K = (exponent + 2.0) / (4.0 * np.pi) * THRUST
        exact = (
            16.0
            * K
            / (exponent + 2.0)
            * quad(
                lambda a, far=far, n=exponent: 1.0 - (1.0 + (0.5 / np.cos(a) / far) ** 2) ** (-0.5 * n - 1.0),
                0.0,
                np.pi / 4.0,
                epsrel=1e-13,
            )[0]
        )
        link = Link(np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, far))
        for cells, stated in zip((1, 2, 4, 6, 8), row.split(" | "), strict=True):
            force = felt(link, nozzle=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), width=1.0, height=1.0, cells=cells,
                         exponent=exponent)[0][2]  # fmt: skip
            error = abs(force / exact - 1.0)
            percent = float(stated.removesuffix(" %")) / 100.0 if stated.endswith(" %") else None
            if stated == "< 1e-8":
                assert error < 1e-8
            else:
                assert float(f"{error:.1g}") == pytest.approx(percent or float(stated), rel=1e-9), (n, at, cells)


def test_its_table_of_what_stops_give_back_is_that_of_the_closed_form() -> None:
    (heads,) = re.findall(r"^\| a v \| (.*) \|$", PAGE, re.MULTILINE)
    (row,) = re.findall(r"^\| v'/v \| (.*) \|$", PAGE, re.MULTILINE)
    for av, share in zip(heads.split(" | "), row.split(" | "), strict=True):
        assert share == f"{given_back(float(av), 1.0) / float(av):.3f}"


def test_it_names_every_model() -> None:
    named = set(re.findall(r"`(\w+)`", PAGE))
    assert set(models.find_own("environment")) <= named
