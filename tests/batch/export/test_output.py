"""An export is there whole or not at all, and covers nothing but an export of MET's."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

import batch
from batch.archive.sink import Sink, temporary_of
from batch.export import export
from batch.export.formats import ExportFormat, ExportRequest
from batch.export.output import whole
from met.diagnostic import Problem
from tests.batch import plans
from tests.batch.export.decks import Mcap, said
from tests.batch.refusals import fail_for_folders

FORMATS = ("mcap", "csv", "parquet")

KILLED = """
import os, signal, sys
from batch.archive.sink import Sink

write, left = Sink.write, int(sys.argv[2])

def dying(self, data):
    global left
    left -= len(data)
    if left < 0:
        os.kill(os.getpid(), signal.SIGKILL)
    return write(self, data)

Sink.write = dying
settle = Sink.settle
Sink.settle = lambda self: os.kill(os.getpid(), signal.SIGKILL) if sys.argv[3] == "settled" else settle(self)
from batch.export import export
export("a.h5", sys.argv[1])
"""
"""An export that is killed by the system after it wrote so many bytes, or when all but its name is done."""


@pytest.fixture
def archive(here: Path, engine: None) -> Path:
    batch.run(plans.plan(), output="a.h5")
    return Path("a.h5")


def killed(output: str, after: int, when: str = "") -> None:
    surroundings = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    words = [sys.executable, "-c", KILLED, output, str(after), when]
    assert subprocess.run(words, env=surroundings, timeout=120).returncode == -9


@pytest.mark.release
@pytest.mark.parametrize("after", [0, 10, 2000, 20_000])
def test_a_writer_that_is_killed_leaves_no_file_under_the_name(archive: Path, after: int) -> None:
    killed("a.mcap", after)
    assert not Path("a.mcap").exists() and temporary_of(Path("a.mcap")).exists()
    assert len(Mcap(export(archive).path).of("/tf")) == 51
    assert not temporary_of(Path("a.mcap")).exists()  # taken over


@pytest.mark.release
@pytest.mark.parametrize("form", FORMATS)
def test_nor_does_one_that_is_killed_before_it_is_named_and_what_was_there_stays(archive: Path, form: str) -> None:
    killed(f"a.{form}", 1 << 30, "settled")
    assert not Path(f"a.{form}").exists()
    before = export(archive, form=form).path.read_bytes()
    if form == "mcap":
        killed("a.mcap", 5000)
        assert Path("a.mcap").read_bytes() == before


@pytest.mark.release
@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("reason", [KeyboardInterrupt, MemoryError])
def test_what_stops_a_writer_leaves_nothing(
    archive: Path, form: str, reason: type[BaseException], monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(self: Sink) -> None:
        raise reason

    monkeypatch.setattr(Sink, "settle", stop)
    with pytest.raises(reason):
        export(archive, form=form)
    assert sorted(path.name for path in Path().iterdir()) == ["a.h5", "a.h5.run.json"]


@pytest.mark.slow
@pytest.mark.parametrize("form", ["mcap", "csv"])
def test_a_full_disk_is_said_and_leaves_nothing(archive: Path, form: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "pwrite", full)
    with pytest.raises(Problem) as caught:
        export(archive, form=form)
    assert said(caught.value) == (
        f"error[E305]: cannot write a.{form}: no space left on device\n"
        " = help: `-o FILE` names another place\n"
        "\n1 error\n"
    )
    assert sorted(path.name for path in Path().iterdir()) == ["a.h5", "a.h5.run.json"]


@pytest.mark.parametrize("number", [errno.EINVAL, errno.EIO])
def test_an_export_that_has_its_name_is_whole(number: int, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Some file systems cannot flush a folder; on a disk that fails in it, the file is there nevertheless."""
    fail_for_folders(monkeypatch, number)
    refused = []
    try:
        with whole(Path("a.csv")) as sink:
            sink.write(memoryview(b"time"))
    except Problem as problem:
        refused = [each.message for each in problem.diagnostics]
    assert refused == ["a.csv is whole, but its disk may lose it: input/output error"] * (number == errno.EIO)
    assert Path("a.csv").read_bytes() == b"time"
    assert not temporary_of(Path("a.csv")).exists()


@pytest.mark.slow
def test_two_exports_into_one_file_do_not_mix(archive: Path) -> None:
    other = Sink(temporary_of(Path("a.mcap")))
    with pytest.raises(Problem) as caught:
        export(archive)
    assert said(caught.value) == (
        "error[E307]: cannot write a.mcap: another export is writing it now\n"
        " = help: wait until it is done, or give another name with `-o`\n"
        "\n1 error\n"
    )
    other.remove()
    other.close()


@pytest.mark.slow
@pytest.mark.parametrize("form", ["mcap", pytest.param("parquet", marks=pytest.mark.oracle)])
def test_an_export_of_ours_is_written_over(archive: Path, form: str) -> None:
    first = export(archive, form=form, signals=["qd"]).path.read_bytes()
    assert export(archive, form=form).path.read_bytes() != first


@pytest.mark.slow
def test_half_an_export_of_ours_is_too(archive: Path) -> None:
    path = export(archive).path
    path.write_bytes(path.read_bytes()[:1200])
    assert len(Mcap(export(archive).path).of("/tf")) == 51


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a.csv", "a.mcap", pytest.param("a.parquet", marks=pytest.mark.oracle)])
def test_what_is_not_ours_is_not_written_over_unless_that_is_said(archive: Path, name: str) -> None:
    if name == "a.csv":
        export(archive, name)
    else:
        Path(name).write_bytes(b"\x89MCAP0\r\n, of somebody else, PAR1")
    before = Path(name).read_bytes()
    with pytest.raises(Problem) as caught:
        export(archive, name)
    assert said(caught.value) == (
        f"error[E374]: {name} exists, and may hold work that is not in the archive: it is not written over\n"
        " = help: give another name with `-o`, or say `--force`\n"
        "\n1 error\n"
    )
    assert Path(name).read_bytes() == before
    assert export(archive, name, force=True, signals=["q"]).path.read_bytes() != before


@pytest.mark.slow
def test_an_empty_file_is_no_loss(archive: Path) -> None:
    Path("a.csv").touch()
    assert export(archive, "a.csv").rows == 51


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a.h5", "b.csv"])
def test_the_archive_itself_is_never_written_over(archive: Path, name: str) -> None:
    if name != "a.h5":
        Path(name).hardlink_to(archive)
    before = archive.read_bytes()
    with pytest.raises(Problem) as caught:
        export(archive, name, form="csv", force=True)
    assert said(caught.value) == (
        f"error[E374]: {name} is the archive itself: it is not written over\n"
        " = help: give another name with `-o`\n"
        "\n1 error\n"
    )
    assert archive.read_bytes() == before


@pytest.mark.slow
def test_a_place_that_is_none_is_said_before_anything_is_read(archive: Path) -> None:
    Path("folder.mcap").mkdir()
    Path("file").touch()
    for output, words in {
        "folder.mcap": "cannot write folder.mcap: it is a folder\n = help: name a file in it: `-o folder.mcap/a.mcap`",
        "no/a.csv": "cannot write no/a.csv: no does not exist\n = help: make it first: `mkdir -p no`",
        "file/a.csv": "cannot write file/a.csv: file is a file, not a folder",
    }.items():
        with pytest.raises(Problem) as caught:
            export(archive, output)
        assert said(caught.value) == f"error[E305]: {words}\n\n1 error\n"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a.xlsx", "a"])
def test_a_name_that_says_no_format_is_refused(archive: Path, name: str) -> None:
    with pytest.raises(Problem) as caught:
        export(archive, name)
    assert said(caught.value) == (
        f"error[E371]: {name} does not say in which format it is to be\n"
        " = help: formats are known by their endings: .mcap, .csv, .parquet\n"
        " = help: `--to csv` says it for any other name\n"
        "\n1 error\n"
    )
    assert export(archive, name, form="csv").path == Path(name)


@pytest.mark.slow
def test_the_name_is_the_archives_unless_it_is_given(archive: Path) -> None:
    assert export(archive).path == Path("a.mcap")
    assert export(archive, form="csv").path == Path("a.csv")
    assert export(archive, "b.MCAP").path == Path("b.MCAP")


@pytest.mark.slow
def test_an_archive_that_is_damaged_within_leaves_nothing(archive: Path) -> None:
    import h5py

    with h5py.File(archive, "r+") as file:
        chunk = file["tau"].id.get_chunk_info(0)
    with archive.open("r+b") as raw:
        raw.seek(chunk.byte_offset)
        raw.write(b"\xff" * 64)
    with pytest.raises(Problem, match="E302"):
        export(archive, "a.csv")
    assert sorted(path.name for path in Path().iterdir()) == ["a.h5", "a.h5.run.json"]


class MetricsAlone(ExportFormat):
    """A format that another version of MET may have: a row a case, and nothing else."""

    title = "a file of lines"
    tables = ("metrics",)


@pytest.mark.parametrize("request_", [ExportRequest(table="histories"), ExportRequest(signals=("qd",))])
def test_a_format_without_histories_refuses_what_asks_for_them(request_: ExportRequest) -> None:
    with pytest.raises(Problem, match=r"a\.lines would be a table of metrics: a file of lines holds no histories"):
        MetricsAlone().check_request(request_, Path("a.lines"))
