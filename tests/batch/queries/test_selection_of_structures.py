"""Some of the cases of a sweep of several structures: they are chosen among all of them together."""

from __future__ import annotations

from pathlib import Path

import pytest

from met.cli import main

DECK = """
#include <two_link.ic>
sweep both of nominal { vary integrator = [rk4, modified_euler]; vary gearbox.kp = [0.02, 0.03] V*s/rad; }
"""


@pytest.mark.slow
def test_structures_of_a_sweep_are_chosen_among_together(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "deck.ic").write_text(DECK, encoding="utf-8")
    out = str(tmp_path / "a.h5")
    assert main(["run", str(tmp_path / "deck.ic"), "both", "-o", out, "-q", "--no-picture"]) == 0
    capsys.readouterr()
    assert main(["show", out, "--where", "integrator == rk4", "--all-cases"]) == 0
    said = capsys.readouterr().out
    assert "2 of 2 cases: where integrator == rk4" in said and "0 of 2 cases: where integrator == rk4" in said
    assert main(["show", out, "--over", "integrator", "--all-cases"]) == 0
