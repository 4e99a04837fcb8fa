"""Ends of a campaign: whole, killed while it merges, interrupted when it had hardly gone on, and on a full disk."""

from __future__ import annotations

import errno
import os
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import batch
from batch.campaigns import folder, performing, tasks
from met import cli
from met.host.streams import OutputLost
from met.plan import file as plan_file
from tests.batch import plans, whole
from tests.batch.begun import CASES, OF_TASK, begin, flip, go_on, plan, refused

# The finished archive


@pytest.mark.slow
def test_nothing_is_missing(archive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan_file.write(plan(), tmp_path / "p.json")
    words = ["run", str(tmp_path / "p.json"), "-o", str(archive), "--no-picture"]
    cli.main(words)
    before = [path.stat() for path in (archive, archive.with_name("a.h5.run.json"))]
    capsys.readouterr()
    cli.main(words)
    said = capsys.readouterr().out
    assert f"nothing is missing: {archive} has all of it (`--fresh` runs it again)\n" in said
    assert "writing" not in said
    after = [path.stat() for path in (archive, archive.with_name("a.h5.run.json"))]
    assert [(a.st_ino, a.st_mtime_ns, a.st_ctime_ns) for a in after] == [
        (b.st_ino, b.st_mtime_ns, b.st_ctime_ns) for b in before
    ]
    assert whole.beside_it(archive) == ["a.h5", "a.h5.run.json"]


@pytest.mark.release
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 1.0])
def test_a_flipped_bit_in_the_archive_is_noticed(archive: Path, undisturbed: bytes, share: float) -> None:
    go_on(archive)
    flip(archive, int(share * (len(undisturbed) - 1)))
    rest, _ = go_on(archive)
    assert rest.cases == CASES
    assert archive.read_bytes() == undisturbed


@pytest.mark.release
@pytest.mark.parametrize("text", ["", "[]", "null", "{}", '{"campaign": 7}', "\0\xff"])
def test_a_damaged_sidecar_costs_time_alone(archive: Path, undisturbed: bytes, text: str) -> None:
    go_on(archive)
    archive.with_name("a.h5.run.json").write_text(text, encoding="latin-1")
    rest, _ = go_on(archive)
    assert rest.cases == CASES
    assert archive.read_bytes() == undisturbed


@pytest.mark.slow
def test_an_archive_that_was_cut_short_is_made_again(archive: Path, undisturbed: bytes) -> None:
    go_on(archive)
    archive.write_bytes(undisturbed[: len(undisturbed) // 2])
    go_on(archive)
    assert archive.read_bytes() == undisturbed


@pytest.mark.slow
def test_the_archive_of_another_plan_stays_until_the_new_one_is_whole(archive: Path, undisturbed: bytes) -> None:
    other = plans.plan(plans.gains(7))
    go_on(archive, other)
    before = archive.read_bytes()
    with pytest.raises(KeyboardInterrupt):
        batch.run(plan(), output=archive, executor=whole.Watched(after=2))
    assert archive.read_bytes() == before
    go_on(archive)
    assert archive.read_bytes() == undisturbed


DIES = """
import os, signal
from batch.campaigns import folder, merge, output, performing
def die(*_, **__):
    os.kill(os.getpid(), signal.SIGKILL)
"""
DEATHS = {
    "while shards are read": "merge.shards_in_order = die",
    "before the archive has its name": "performing.publish = die",
    "before its sidecar has its name": "replace = output.Path.replace\n"
    "output.Path.replace = lambda old, new: replace(old, new) if new.name != 'a.h5.run.json' else die()",
}


KILLED = r"the run before this one was killed \(process \d+ on \S+\)(; if a case did it, .*)?"


def killed(where: str, archive: Path) -> None:
    """`met run` of the plan in a process of its own, which kills itself in its midst."""
    plan_file.write(plan(), archive.parents[1] / "p.json")
    words = ["run", str(archive.parents[1] / "p.json"), "-o", str(archive), "--no-picture"]
    assert whole.met(words, archive.parent, program=f"{DIES}{where}\n{whole.MET}").returncode == -9


@pytest.mark.slow
@pytest.mark.parametrize("where", DEATHS)
def test_what_is_killed_while_it_merges_merges_again(archive: Path, undisturbed: bytes, where: str) -> None:
    killed(DEATHS[where], archive)
    assert whole.done(archive, CASES) == CASES
    rest, notes = go_on(archive)
    assert rest.tasks == []
    assert re.fullmatch(KILLED, notes[0])
    assert notes[1:] == (f"goes on: {CASES} of {CASES} cases are done",)
    assert archive.read_bytes() == undisturbed


@pytest.mark.slow
def test_what_is_killed_before_its_folder_is_removed_is_tidied_up(archive: Path, undisturbed: bytes) -> None:
    killed("folder.Folder.remove = die", archive)
    assert archive.read_bytes() == undisturbed
    rest, _ = go_on(archive)
    assert rest.tasks == []


@pytest.mark.slow
def test_what_is_killed_while_its_folder_is_removed_is_tidied_up(archive: Path, undisturbed: bytes) -> None:
    killed("folder.shutil.rmtree = lambda path, **_: (path / 'campaign.json').unlink() or die()", archive)
    assert archive.read_bytes() == undisturbed
    go_on(archive)


@pytest.mark.slow
def test_what_another_campaign_has_begun_is_not_tidied_up(archive: Path, undisturbed: bytes) -> None:
    """As where somebody goes back to the deck before, for a look at its archive."""
    go_on(archive)
    other = plans.plan(plans.gains(2 * CASES))
    with pytest.raises(KeyboardInterrupt):
        batch.run(other, output=archive, executor=whole.Watched(after=3))
    kept = whole.shards(archive)
    assert batch.run(plan(), output=archive, executor=whole.Watched()).path.read_bytes() == undisturbed
    assert whole.shards(archive) == kept


# Earlier work is not lost to a later end


@pytest.mark.slow
def test_an_interrupt_while_shards_are_found_keeps_them(archive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(performing, "WORTH_SECONDS", 1e-9)
    kept = begin(archive)
    with monkeypatch.context() as patch:
        patch.setattr(folder, "shard_of_file", lambda *_: whole.interrupt())
        with pytest.raises(KeyboardInterrupt):
            batch.run(plan(), output=archive)
    assert whole.shards(archive) == kept


@pytest.mark.slow
def test_a_disk_that_is_full_when_it_goes_on_keeps_what_there_is(
    archive: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where a quota is used up, which the room on the disk does not tell."""
    monkeypatch.setattr(performing, "WORTH_SECONDS", 1e-9)
    kept = begin(archive)

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr("met.plan.file.write", full)
        assert "no space left on device" in refused(archive)
    assert whole.shards(archive) == kept


def interrupted_in(
    archive: Path, number: int, monkeypatch: pytest.MonkeyPatch, interrupt: type[KeyboardInterrupt] = KeyboardInterrupt
) -> str:
    """Run the plan, with an interrupt while its task of this number is computed, from 1; what is said of it."""
    computed, count = tasks.compute, 0

    def compute(*arguments: Any, **options: Any) -> tasks.Shard:
        nonlocal count
        count += 1
        if count == number:
            raise interrupt
        return computed(*arguments, **options)

    with monkeypatch.context() as patch, pytest.raises(interrupt) as caught:
        patch.setattr(tasks, "compute", compute)
        batch.run(plan(), output=archive, threads=1)
    return str(caught.value)


@pytest.mark.parametrize("interrupt", [KeyboardInterrupt, OutputLost])
def test_as_many_are_said_to_be_kept_as_are(
    interrupt: type[KeyboardInterrupt], archive: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = interrupted_in(archive, 4, monkeypatch, interrupt)
    folder = whole.folder_of(archive).path
    assert whole.done(archive, CASES) == 24
    assert said == f"24 of {CASES} cases are kept in {folder}; the same command goes on"


def test_a_task_that_took_long_is_kept_when_the_next_is_interrupted(
    archive: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(performing, "WORTH_SECONDS", 1e-9)
    interrupted_in(archive, 2, monkeypatch)
    assert whole.done(archive, CASES) == OF_TASK


# A full disk


class Disk:
    """A disk of four MiB, mounted where we may; else one that is only said to be full."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder, self.full = folder, False
        command = ["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", str(folder)]
        may = os.geteuid() == 0 and shutil.which("mount") is not None
        self.mounted = may and subprocess.run(command, capture_output=True).returncode == 0
        if not self.mounted:
            for name in ("write", "pwrite"):
                monkeypatch.setattr(os, name, self._unless_full(getattr(os, name)))

    def fill(self) -> None:
        """Somebody else takes all the room."""
        self.full = True
        if self.mounted:
            with (self.folder / "ballast").open("wb", buffering=0) as file, pytest.raises(OSError):
                while True:
                    file.write(bytes(4096))

    def clear(self) -> None:
        self.full = False
        (self.folder / "ballast").unlink(missing_ok=True)

    def unmount(self) -> None:
        if self.mounted:
            subprocess.run(["umount", "--lazy", str(self.folder)], check=True)

    def _unless_full(self, write: Callable[..., int]) -> Callable[..., int]:
        def limited(file: int, *data: Any) -> int:
            if self.full and os.readlink(f"/proc/self/fd/{file}").startswith(str(self.folder)):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return write(file, *data)

        return limited


@pytest.fixture
def disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Disk]:
    (tmp_path / "disk").mkdir()
    found = Disk(tmp_path / "disk", monkeypatch)
    yield found
    found.unmount()


@pytest.mark.slow
def test_a_disk_that_fills_up_while_cases_are_run(disk: Disk, undisturbed: bytes) -> None:
    archive = disk.folder / "a.h5"
    assert refused(archive, executor=whole.Watched(after=2, then=disk.fill)) == (
        f"error[E354]: the campaign cannot go on: cannot keep what was computed in {archive}.campaign: no space left "
        "on device\n"
        f" = help: what is done is kept in {archive}.campaign: the same command goes on\n"
        "\n1 error\n"
    )
    kept = whole.shards(archive)
    assert len(kept) >= 2 and not archive.exists()
    disk.clear()
    rest, _ = go_on(archive)
    assert rest.cases == CASES - OF_TASK * len(kept)
    assert archive.read_bytes() == undisturbed


@pytest.mark.slow
def test_a_disk_that_fills_up_while_shards_are_merged(disk: Disk, undisturbed: bytes) -> None:
    archive = disk.folder / "a.h5"
    assert refused(archive, executor=whole.Watched(after=CASES // OF_TASK, then=disk.fill)) == (
        f"error[E305]: cannot write {archive}: no space left on device\n"
        f" = help: {CASES} of {CASES} cases are kept in {archive}.campaign; the same command goes on\n"
        "\n1 error\n"
    )
    assert not archive.exists()
    disk.clear()
    rest, _ = go_on(archive)
    assert rest.tasks == []
    assert archive.read_bytes() == undisturbed


def room(free: int) -> Callable[[object], Any]:
    """In place of `shutil.disk_usage`."""
    return lambda _: shutil._ntuple_diskusage(1 << 40, (1 << 40) - free, free)  # type: ignore[attr-defined]


def test_a_disk_that_is_still_full_takes_nothing_away(archive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = begin(archive)
    monkeypatch.setattr(shutil, "disk_usage", room(0))
    assert refused(archive).startswith(f"error[E306]: cannot write {archive}: it needs about ")
    assert whole.shards(archive) == kept


@pytest.mark.slow
def test_room_is_asked_for_what_is_missing_alone(
    archive: Path, undisturbed: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = begin(archive)
    there = sum(path.stat().st_size for path in whole.folder_of(archive).shards.iterdir())
    needed = batch.campaigns.campaign.prepare(plan(), output=archive).bytes_missing
    assert there > needed // 10
    monkeypatch.setattr(shutil, "disk_usage", room(needed))
    rest, _ = go_on(archive)
    assert rest.cases == CASES - OF_TASK * len(kept)
    assert archive.read_bytes() == undisturbed


@pytest.mark.slow
def test_nothing_is_missing_on_a_full_disk(archive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    go_on(archive)
    monkeypatch.setattr(shutil, "disk_usage", room(0))
    rest, _ = go_on(archive)
    assert rest.tasks == []
