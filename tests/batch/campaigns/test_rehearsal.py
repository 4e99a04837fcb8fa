"""A model that crashes, ends or never ends while it is recorded is named, and takes no command along."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from batch.campaigns import rehearsal
from met import cli, models

DECK = """\
#include <two_link.ic>
servo brake { model = brake; }
run stopped like nominal {
    servos { shoulder = brake; }
    duration = 0.2 s;
    record = [q];
    remove settle;
    remove volts;
}
"""

MODEL = """\
import ctypes
import os
import sys

from met.servos.servo import Drive, Servo


def drive(p, held, states, joint):
    {does}
    return Drive(torque=0.0)


MODEL = Servo(name="brake", doc="A brake.", drive=drive)
"""


def ended_or_begun(process: subprocess.Popen[bytes], timeout: float | None = None) -> int:
    """`Popen.wait` by a clock that goes by what happens: the time limit is over when the model has been called and
    the process runs on, however long the machine takes until then; what is asked to end is waited for."""
    while timeout == rehearsal.LEAST_SECONDS and process.poll() is None:
        if Path("begun").exists():
            raise subprocess.TimeoutExpired(process.args, timeout)
        time.sleep(0.02)
    return wait(process)


wait = subprocess.Popen.wait


@pytest.fixture
def offered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], Path]]:
    """Installs the package of a brake that does something while it is recorded; its file."""
    site = tmp_path / "site"
    (site / "my_models-1.0.dist-info").mkdir(parents=True)
    (site / "my_models-1.0.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: my-models\nVersion: 1.0\n")
    table = "[met.servos]\nbrake = my_brake:MODEL\n"
    (site / "my_models-1.0.dist-info" / "entry_points.txt").write_text(table)
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    Path("deck.ic").write_text(DECK)
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.setenv("PYTHONPATH", str(site))

    def install(does: str) -> Path:
        (site / "my_brake.py").write_text(MODEL.format(does=does))
        sys.modules.pop("my_brake", None)
        models.available.cache_clear()
        return site / "my_brake.py"

    yield install
    sys.modules.pop("my_brake", None)
    models.available.cache_clear()


@pytest.mark.release
@pytest.mark.parametrize(
    ("does", "how"),
    [
        ("ctypes.string_at(0)", "was killed by SIGSEGV"),
        ("os._exit(3)", "ended with status 3"),
        ("while True: open('begun', 'w').close()", "has not ended after 60 s"),
    ],
)
def test_a_model_that_ends_its_process_is_named(
    offered: Callable[[str], Path],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    does: str,
    how: str,
) -> None:
    monkeypatch.setattr(subprocess.Popen, "wait", ended_or_begun)
    file = offered(does)
    assert cli.main(["run", "deck.ic", "stopped", "--timeout", "1 s", "-o", "a.h5"]) == cli.BAD_INPUT
    assert (
        capsys.readouterr().err
        == f"""\
error[E217]: a model of the deck cannot be recorded: in `drive`, a process that tried it {how}
 --> {file}:9:5
  |
9 |     {does}
  |     {"^" * len(does)} it was here
  = help: mend the model, or tell its author
  = help: without `--processes` or `--timeout` it would take `met` along

1 error
"""
    )
    assert not Path("a.h5.campaign").exists()


@pytest.mark.parametrize("does", ["sys.exit(3)", "raise SystemExit(3)", "raise GeneratorExit(3)"])
def test_a_model_that_leaves_by_an_exception_is_named_in_every_mode(
    offered: Callable[[str], Path], capsys: pytest.CaptureFixture[str], does: str
) -> None:
    file = offered(does)
    name = "GeneratorExit" if "Generator" in does else "SystemExit"
    assert cli.main(["run", "deck.ic", "stopped", "-o", "a.h5"]) == cli.BAD_INPUT
    said = capsys.readouterr().err
    head = f"error[E213]: servo `brake` of joint `shoulder` (model brake): `drive` raises {name}: 3\n --> {file}:9:5\n"
    assert head in said


@pytest.mark.slow
def test_a_package_that_leaves_while_it_is_loaded_is_named(
    offered: Callable[[str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    file = offered("pass")
    file.write_text("import sys\nsys.exit(4)\n")
    assert cli.main(["check", "deck.ic"]) == cli.BAD_INPUT
    assert capsys.readouterr().err.startswith(
        "error[E215]: cannot load the servo of entry point `brake = my_brake:MODEL` of my_models in group "
        "`met.servos`: SystemExit: 4\n"
    )


@pytest.mark.release
def test_a_model_that_does_none_of_it_is_run(offered: Callable[[str], Path]) -> None:
    offered("print('here')")
    assert cli.main(["run", "deck.ic", "stopped", "--processes", "1", "-o", "a.h5", "-q", "--no-picture"]) == cli.YES


def test_models_of_met_itself_need_no_rehearsal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("batch.campaigns.rehearsal.subprocess.Popen", lambda *_, **__: pytest.fail("started"))
    rehearsal.rehearse(1.0, source="two_link.ic")
