"""`met run DECK -o FILE.mcap`: the archive and its export; what cannot be exported is refused before anything runs."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

import batch
import ic
from batch.terminal import running
from met import cli
from met.diagnostic import Problem, error
from tests.batch.export.decks import Mcap

SEVERAL = """\
#include <two_link.ic>
run brief like nominal { duration = 2 s;  remove settle; }
run blind like brief { record = []; }
sweep few of brief { vary gearbox.kp = [0.01, 0.02, 0.03] V*s/rad; }
sweep many of brief { vary gearbox.kp = linspace(0.01, 0.03, 9) V*s/rad; }
"""


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "deck.ic").write_text(SEVERAL)
    return tmp_path


def met(*words: str) -> int:
    return cli.main(["run", "deck.ic", *words])


def there(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()} - {"deck.ic"}


@pytest.mark.release
def test_the_archive_and_the_export(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert met("few", "-o", "x.mcap") == cli.YES
    assert there(here) == {"x.h5", "x.h5.run.json", "x.png", "x.mcap"}
    said = capsys.readouterr().out
    assert "\narchive  x.h5  (" in said and "\nexport   x.mcap  (" in said
    batch.run(ic.compile("deck.ic", select=["few"]), output="y.h5")
    assert cli.main(["export", "y.h5", "-o", "y.mcap", "-q"]) == cli.YES
    one, other = Mcap(here / "x.mcap"), Mcap(here / "y.mcap")
    assert one.topics() == other.topics() and len((here / "x.mcap").read_bytes()) == len((here / "y.mcap").read_bytes())


@pytest.mark.slow
def test_of_python_and_for_programs(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    archive = batch.run(ic.compile("deck.ic", select=["brief", "few"]), output="x.csv")
    assert archive.path == Path("x.h5") and archive.ok
    runs = {line.split(",")[0] for line in Path("x.csv").read_text().splitlines()[3:]}
    assert runs == {"brief", "few"}
    assert met("brief", "-o", "y.parquet", "--format", "json", "--no-picture") == cli.YES
    said = json.loads(capsys.readouterr().out)
    assert (said["archive"], said["export"]) == ("y.h5", "y.parquet") and Path("y.parquet").exists()


@pytest.mark.release
def test_it_may_be_run_again(here: Path) -> None:
    assert met("brief", "-o", "x.mcap", "-q") == cli.YES
    before = (here / "x.mcap").read_bytes()
    assert met("brief", "-o", "x.mcap", "-q") == cli.YES
    assert (here / "x.mcap").read_bytes() == before
    assert cli.main(["run", "x.h5", "--all", "-o", "z.mcap", "-q"]) == cli.YES
    assert (here / "z.mcap").exists() and (here / "z.h5").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("many", "-o", "x.mcap"),
            """\
error[E372]: 9 cases of `many` are too many to show over one another
 = help: `--case '#0'` runs one alone, and `--histories '#0'` keeps the signals of one
 = help: or run all, and choose then: `-o x.h5`, `met export x.h5 --case '#0'`

1 error
""",
        ),
        (
            ("few", "-o", "x.mcap", "--histories", "none"),
            """\
error[E323]: x.mcap would be empty: no histories are kept
 = help: `--histories all` keeps them, and `--histories '#0'` those of a case

1 error
""",
        ),
        (
            ("blind", "-o", "x.csv"),
            """\
error[E323]: x.csv would be empty: no histories are kept
 = help: `record = [q, qd, tau];` in the run records signals

1 error
""",
        ),
        (
            ("brief", "-o", "work.csv"),
            """\
error[E374]: work.csv exists, and may hold work that is not in the archive: it is not written over
 = help: give another name with `-o`, or remove the file

1 error
""",
        ),
        (
            ("brief", "-o", "none/x.mcap"),
            """\
error[E305]: cannot write none/x.h5: none does not exist
 = help: make it first: `mkdir -p none`

1 error
""",
        ),
    ],
)
def test_what_cannot_be_exported_does_not_run(
    here: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], message: str
) -> None:
    (here / "work.csv").write_text("mine")
    assert met(*words, "-q") == cli.BAD_INPUT
    assert capsys.readouterr().err.endswith(message)
    assert there(here) == {"work.csv"} and (here / "work.csv").read_text() == "mine"


def test_an_archive_of_another_format_is_refused(here: Path) -> None:
    from batch.campaigns.campaign import prepare

    with pytest.raises(Problem) as problem:
        prepare(ic.compile("deck.ic", select=["brief"]), output="x.mcap")
    [diagnostic] = problem.value.diagnostics
    assert diagnostic.message == "cannot write x.mcap: it is to be an archive, which ends in .h5"


@pytest.mark.slow
def test_an_export_that_fails_leaves_the_archive_and_says_so(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object, **options: object) -> None:
        raise Problem(error("E305", "cannot write x.mcap: no space left on device"))

    monkeypatch.setattr(running, "export_run", full)
    assert met("brief", "-o", "x.mcap") == cli.NO
    told = capsys.readouterr()
    assert "error[E305]: cannot write x.mcap: no space left on device" in told.err
    assert told.out.endswith("exit 1: x.mcap is missing: `met export x.h5 -o x.mcap`\n")
    assert batch.look("x.h5").ok


@pytest.mark.slow
def test_none_failed_so_there_is_nothing_to_export(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert met("few", "-o", "x.mcap", "--histories", "failed") == cli.NO
    told = capsys.readouterr()
    assert "error[E323]: no histories of `few` are in the archive" in told.err and "x.mcap is missing" in told.out


@pytest.mark.release
def test_killed_while_exporting_no_file_has_the_final_name(here: Path) -> None:
    """A long run's export, killed at several instants: the archive is whole, the export whole or not there."""
    import signal
    import sys
    import time

    text = SEVERAL + "run long like nominal { duration = 2000 s;  rates { record = 25 Hz; }  remove settle; }\n"
    (here / "deck.ic").write_text(text)
    command = [sys.executable, "-m", "met.cli", "run", "deck.ic", "long", "-o", "x.mcap", "-q", "--no-picture"]
    subprocess.run(command, check=True, capture_output=True)
    whole = (here / "x.mcap").read_bytes()
    (here / "x.mcap").unlink()
    for wait in (0.2, 0.5, 1.0):
        process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + 60.0
        while not any(path.name.startswith(".x.mcap") for path in here.iterdir()) and process.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.005)
        time.sleep(wait)
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert not (here / "x.mcap").exists() or (here / "x.mcap").read_bytes() == whole
        (here / "x.mcap").unlink(missing_ok=True)
    subprocess.run(command, check=True, capture_output=True)
    assert (here / "x.mcap").read_bytes() == whole and there(here) == {"x.h5", "x.h5.run.json", "x.mcap"}
