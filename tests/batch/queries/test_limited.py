"""A load motor that reached its limit is told: in the archive, in what a run prints, and in its JSON."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import batch
from met.cli import main

DECK = """
#include <two_link.ic>
run weak like hybrid { duration = 1 s;  remove settle;  remove volts; }
sweep limits of weak { vary shoulder.bed.i_max = [0.05, 3] A; }
"""


@pytest.mark.release
def test_ticks_at_a_beds_limit_are_counted_and_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "weak.ic").write_text(DECK, encoding="utf-8")
    out = str(tmp_path / "a.h5")
    assert main(["run", str(tmp_path / "weak.ic"), "limits", "-o", out, "--no-picture"]) == 0
    note = "  note: the load motor of a bed was at its limit in 1 of 2 cases: the run is not what the joint would do\n"
    assert note in capsys.readouterr().out
    counted = batch.open(out)["bed_limited"]
    # 0.05 A are 0.0036 N m, of some 0.009 N m that the arm takes while it gains speed
    assert counted.values.tolist()[0] > 10 and counted.values.tolist()[1] == 0
    assert main(["show", out, "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["experiments"][0]["limited"] == 1
