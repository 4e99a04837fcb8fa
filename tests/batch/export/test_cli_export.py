"""`met export` from the command line."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import batch
from met import cli
from tests.batch import plans
from tests.batch.export.decks import Mcap


@pytest.fixture
def archive(here: Path, engine: None) -> Path:
    batch.run(plans.plan(plans.nominal(), plans.gains(3)), output="a.h5")
    return Path("a.h5")


@pytest.mark.slow
def test_it_says_what_it_wrote(archive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["export", "a.h5", "-o", "b.mcap", "--layout"]) == cli.YES
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith("b.mcap  (") and second.startswith("b.layout.json  (")
    assert cli.main(["export", "a.h5", "--to", "csv", "-q"]) == cli.YES
    assert capsys.readouterr().out == "" and Path("a.csv").exists()


@pytest.mark.slow
def test_programs_are_told_in_json(archive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["export", "a.h5", "-o", "b.csv", "--run", "gains", "--case", "#2", "--case", "#0", "--format", "json"]
    assert cli.main(words) == cli.YES
    assert json.loads(capsys.readouterr().out) == {"written": ["b.csv"], "cases": 2, "rows": 102, "table": "histories"}
    assert cli.main(words) == cli.BAD_INPUT
    assert json.loads(capsys.readouterr().out)["diagnostics"][0]["code"] == "E374"
    assert cli.main([*words, "--force"]) == cli.YES


@pytest.mark.slow
def test_signals_are_given_as_lists(archive: Path) -> None:
    words = ["--signals", "qd, elbow.q", "--signals", "shoulder.servo.voltage"]
    assert cli.main(["export", "a.h5", *words]) == cli.YES
    assert Mcap(Path("a.mcap")).topics() == {"/tf", "/scene", "/log", "/result", "/qd", "/q", "/shoulder/servo/voltage"}


def test_other_commands_do_not_load_what_it_needs() -> None:
    program = (
        "import sys; from met import cli; cli.main(['export', '--help']); import batch.export; "
        "print([name for name in ('mcap', 'google', 'foxglove_schemas_protobuf', 'pyarrow', 'h5py') "
        "if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
