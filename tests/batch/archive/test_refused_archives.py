"""What is no archive, or a damaged one, is refused in words."""

from pathlib import Path
from typing import Any

import pytest

import batch
from batch.archive.read import ArchiveFile
from met.diagnostic import Problem
from tests.batch import plans

pytestmark = pytest.mark.usefixtures("engine")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "E301: cannot read the archive a.h5: no such file or directory"),
        (b"", "E302: a.h5 is no archive of MET: it is not an HDF5 file"),
        (b"run nominal {}", "E302: a.h5 is no archive of MET: it is not an HDF5 file"),
        (b"\x89HDF\r\n\x1a\n" + b"\0" * 100, "E302: the archive a.h5 is damaged"),
    ],
)
def test_what_is_no_archive_is_refused(here: Path, content: bytes | None, said: str) -> None:
    if content is not None:
        Path("a.h5").write_bytes(content)
    with pytest.raises(Problem) as caught:
        batch.open("a.h5")
    assert [f"{d.code}: {d.message}" for d in caught.value.diagnostics] == [said]


def test_what_is_no_archive_is_told_what_makes_one(here: Path) -> None:
    Path("a.txt").write_text("hello")
    with pytest.raises(Problem) as caught:
        batch.open("a.txt")
    [told] = caught.value.diagnostics
    assert (told.message, told.help) == (
        "a.txt is no archive of MET: it is not an HDF5 file",
        ("archives are written by `met run DECK`",),
    )


def test_a_truncated_archive_is_refused(here: Path) -> None:
    batch.run(plans.plan(plans.gains(3)), output="a.h5")
    whole = Path("a.h5").read_bytes()
    Path("a.h5").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(Problem) as caught:
        ArchiveFile("a.h5")
    assert caught.value.diagnostics[0].code == "E302"


def test_another_hdf5_file_is_refused(here: Path) -> None:
    import h5py

    with h5py.File("other.h5", "w") as file:
        file["x"] = [1.0]
    with pytest.raises(Problem) as caught:
        ArchiveFile("other.h5")
    assert caught.value.diagnostics[0].message == "other.h5 is an HDF5 file, but no archive of MET"


def test_an_archive_of_a_newer_met_is_refused(here: Path) -> None:
    import h5py

    batch.run(plans.plan(), output="a.h5")
    with h5py.File("a.h5", "r+") as file:
        file.attrs["schema_version"] = 2
    with pytest.raises(Problem) as caught:
        ArchiveFile("a.h5")
    assert caught.value.diagnostics[0].message == "a.h5 was written by a newer MET: schema 2, known here is 1"


def damaged(change: Any, *experiments: Any) -> str:
    """What is said of an archive after this change."""
    import h5py

    from batch.terminal.show import as_json, show

    batch.run(plans.plan(*experiments), output="a.h5")
    with h5py.File("a.h5", "r+") as file:
        change(file)
    with pytest.raises(Problem) as caught, ArchiveFile("a.h5") as file:
        show(file)
        as_json(file)
        file.plan()
    return "; ".join(f"{d.code}: {d.message}" for d in caught.value.diagnostics)


@pytest.mark.release
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda f: f.attrs.__delitem__("schema_version"),
            "E302: the archive a.h5 is damaged: it has no schema version",
        ),
        (
            lambda f: f.attrs.__setitem__("schema_version", "new"),
            "E302: the archive a.h5 is damaged: it has no schema version",
        ),
        (lambda f: f.attrs.__delitem__("deck"), "E302: the archive a.h5 is damaged: it does not name its deck"),
        (
            lambda f: f.attrs.__delitem__("experiment"),
            "E302: the archive a.h5 is damaged: attribute `experiment` is missing or of another type",
        ),
        (
            lambda f: f.attrs.__setitem__("duration_s", "long"),
            "E302: the archive a.h5 is damaged: attribute `duration_s` is missing or of another type",
        ),
        (lambda f: f.__delitem__("case"), "E302: the archive a.h5 is damaged"),
        (
            lambda f: f.__delitem__("status"),
            "E302: the archive a.h5 is damaged: variable `status` is missing or of another type",
        ),
        (lambda f: f.__delitem__("time"), "E302: the archive a.h5 is damaged"),
        (lambda f: f.__delitem__("joint"), "E302: the archive a.h5 is damaged"),
        (
            lambda f: f.__delitem__("provenance"),
            "E302: the archive a.h5 is damaged: it does not say where it comes from",
        ),
        (lambda f: f["provenance"].__delitem__("plan"), "E302: the archive a.h5 is damaged"),
    ],
)
def test_what_an_archive_lacks_is_said(here: Path, change: Any, said: str) -> None:
    assert damaged(change, plans.nominal()).startswith(said)


@pytest.mark.slow
def test_an_archive_without_experiments_is_damaged(here: Path) -> None:
    def empty(file: Any) -> None:
        del file["nominal"], file["gains"]

    said = damaged(empty, plans.nominal(), plans.gains(2))
    assert said == "E302: the archive a.h5 is damaged: it holds no run and no sweep"


@pytest.mark.slow
def test_a_flipped_bit_in_a_history_is_noticed(here: Path) -> None:
    batch.run(plans.plan(plans.nominal()), output="a.h5")
    with ArchiveFile("a.h5") as file:
        at = file._file["qd"].id.get_chunk_info(0).byte_offset
    data = bytearray(Path("a.h5").read_bytes())
    data[at + 100] ^= 4
    Path("a.h5").write_bytes(data)
    with ArchiveFile("a.h5") as file, pytest.raises(Problem) as caught:
        file.groups[0].signal("qd", 0)
    assert caught.value.diagnostics[0].code == "E302"


@pytest.mark.release
def test_flipped_bits_anywhere_are_a_problem_or_an_archive(here: Path) -> None:
    """In a process of its own, which has two minutes: HDF5 may not come back from some damage, nor may it be ours."""
    import os
    import subprocess
    import sys

    batch.run(plans.plan(plans.gains(3)), output="a.h5")
    program = """
import random, signal, sys
from pathlib import Path
from batch.archive.read import ArchiveFile, is_archive
from batch.terminal.show import as_json, show
from met.diagnostic import Problem

class Stuck(BaseException):
    pass

def stuck(*_):
    raise Stuck

signal.signal(signal.SIGALRM, stuck)
whole, target, chance = Path("a.h5").read_bytes(), Path("b.h5"), random.Random(1)
for trial in range(150):
    data = bytearray(whole)
    for _ in range(chance.choice((1, 1, 8))):
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    target.write_bytes(data)
    is_archive(target)
    signal.setitimer(signal.ITIMER_REAL, 5.0)
    try:
        with ArchiveFile(target) as file:
            show(file)
            as_json(file)
            file.plan()
    except (Problem, Stuck):
        pass
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
print("done")
"""
    surroundings = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[3])}
    said = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, env=surroundings, timeout=120
    )
    assert said.returncode < 0 or said.stdout == "done\n", said.stderr  # a signal is HDF5's own end


@pytest.mark.release
def test_what_may_be_written_over_is_seen_without_hdf5(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import h5py

    from batch.archive import read

    batch.run(plans.plan(plans.nominal(), *(plans.gains(2, f"g{n}") for n in range(20))), output="a.h5")
    with h5py.File("other.h5", "w") as file:
        file["x"] = [1.0]
    monkeypatch.setattr(read, "h5py", lambda: pytest.fail("HDF5 was asked"))
    assert read.is_archive(Path("a.h5"))
    assert not read.is_archive(Path("other.h5"))
    Path("a.h5").write_bytes(Path("a.h5").read_bytes()[:5000])
    assert read.is_archive(Path("a.h5"))  # a damaged one may be replaced
