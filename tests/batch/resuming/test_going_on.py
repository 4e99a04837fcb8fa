"""Running again what was begun: what is missing is run, what is damaged is told and run again, and the bytes are the
same."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import batch
from batch.campaigns import status as status_files
from batch.campaigns import tasks
from batch.campaigns.folder import Folder
from tests.batch import plans, whole
from tests.batch.begun import CASES, OF_TASK, begin, flip, go_on, plan, refused

# What is there is kept


@pytest.mark.slow
def test_only_what_is_missing_is_run(archive: Path, undisturbed: bytes) -> None:
    kept = begin(archive)
    rest, notes = go_on(archive)
    assert not kept.keys() & set(rest.names)
    assert rest.cases == CASES - OF_TASK * len(kept)
    assert notes == (f"goes on: {OF_TASK * len(kept)} of {CASES} cases are done",)
    assert archive.read_bytes() == undisturbed


@pytest.mark.slow
def test_what_is_there_is_not_touched(archive: Path) -> None:
    kept = begin(archive, after=1)
    assert kept.items() < begin(archive, after=1).items()


@pytest.mark.slow
def test_going_on_again_and_again(archive: Path, undisturbed: bytes) -> None:
    while whole.done(archive, CASES) < CASES:
        before = whole.done(archive, CASES)
        begin(archive, after=1)
        assert whole.done(archive, CASES) > before
    rest, notes = go_on(archive)
    assert (rest.tasks, notes) == ([], (f"goes on: {CASES} of {CASES} cases are done",))
    assert archive.read_bytes() == undisturbed


@pytest.mark.slow
def test_the_last_shards_alone_are_enough(archive: Path, undisturbed: bytes) -> None:
    kept = begin(archive)
    first = min(kept)
    (whole.folder_of(archive).shards / first).unlink()
    rest, notes = go_on(archive)
    assert rest.names[0] == first
    assert notes == (f"goes on: {OF_TASK * (len(kept) - 1)} of {CASES} cases are done",)
    assert archive.read_bytes() == undisturbed


@pytest.mark.slow
def test_shards_of_cases_that_overlap(archive: Path, undisturbed: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    begin(archive, after=1)
    shards = whole.folder_of(archive).shards
    aside = archive.parents[1] / "aside"
    shards.rename(aside)
    monkeypatch.setattr(tasks, "MOST_CASES", 7)
    begin(archive, after=3)
    for path in aside.iterdir():
        path.rename(shards / path.name)
    assert whole.run_twice(archive)
    go_on(archive)
    assert archive.read_bytes() == undisturbed


# What does not count is told, and run again


def cut_short(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-1000])


def emptied(path: Path) -> None:
    path.write_bytes(b"")


def turned_over(path: Path) -> None:
    flip(path, path.stat().st_size // 2)


def of_another_plan(path: Path) -> None:
    """A shard of another plan, whole, under the name that it would have in ours."""
    other = path.parents[3] / "other" / "a.h5"
    other.parent.mkdir()
    begin(other, plans.plan(plans.gains(CASES + 1)))
    shutil.copy(whole.folder_of(other).shards / path.name, path)


def of_other_cases(path: Path) -> None:
    """A shard of this plan under the name of another."""
    shutil.copy(max(path.parent.glob("[0-9]*")), path)


def fewer_cases(path: Path) -> None:
    """A sound shard with fewer cases than its name says."""
    found = tasks.shard_of_file(path)
    assert found.history is not None
    tasks.write_shard(path, tasks.Shard(found.key, found.outputs[:-1], found.history[:-1], found.seconds))


CHECKSUM = "is not what was written: its checksum differs"
ANOTHER = "is of another plan, or of another version of MET's code"
DAMAGES = (
    (cut_short, CHECKSUM),
    (emptied, "is cut short"),
    (turned_over, CHECKSUM),
    (of_another_plan, ANOTHER),
    (of_other_cases, ANOTHER),
    (fewer_cases, "holds other cases than its name says"),
)


@pytest.mark.release
@pytest.mark.parametrize(("damage", "why"), DAMAGES, ids=[damage.__name__ for damage, _ in DAMAGES])
def test_a_shard_that_does_not_count(
    archive: Path, undisturbed: bytes, damage: Callable[[Path], None], why: str
) -> None:
    kept = begin(archive)
    name = sorted(kept)[1]
    damage(whole.folder_of(archive).shards / name)
    rest, notes = go_on(archive)
    assert notes == (
        f"shard {name} {why}; its 8 cases are run again",
        f"goes on: {OF_TASK * (len(kept) - 1)} of {CASES} cases are done",
    )
    assert name in rest.names
    assert rest.cases == CASES - OF_TASK * (len(kept) - 1)
    assert archive.read_bytes() == undisturbed


def test_no_byte_of_a_shard_may_change_and_none_may_lack(tmp_path: Path) -> None:
    path = tmp_path / "0-000000000-000000003"
    numbers = np.arange(12.0)
    tasks.write_shard(
        path, tasks.Shard("5a" * 32, numbers.reshape(3, 4), numbers.reshape(3, 2, 2), 0.25, {1: (3, "gone")})
    )
    sound = path.read_bytes()
    for position in range(len(sound)):
        flip(path, position, position % 8)
        with pytest.raises(tasks.UnsoundShard):
            tasks.shard_of_file(path)
        path.write_bytes(sound[:position])
        with pytest.raises(tasks.UnsoundShard):
            tasks.shard_of_file(path)
        path.write_bytes(sound)
    found = tasks.shard_of_file(path)
    assert (found.key, found.seconds, found.fates) == ("5a" * 32, 0.25, {1: (3, "gone")})


@pytest.mark.slow
def test_a_shard_that_is_damaged_after_it_was_counted(archive: Path, undisturbed: bytes) -> None:
    """Merging proves each shard once more."""
    shards = whole.folder_of(archive).shards
    name = "0-000000008-000000016"
    executor = whole.Watched(after=4, then=lambda: turned_over(shards / name))
    notes = batch.run(plan(), output=archive, executor=executor).notes
    assert notes == (f"shard {name} {CHECKSUM}; its 8 cases are run again",)
    assert archive.read_bytes() == undisturbed


@pytest.mark.slow
def test_a_shard_that_is_damaged_before_histories_are_chosen(archive: Path) -> None:
    shards = whole.folder_of(archive).shards
    name = "0-000000008-000000016"
    executor = whole.Watched(after=CASES // OF_TASK, then=lambda: turned_over(shards / name))
    notes = batch.run(plan(), output=archive, histories="worst:3", executor=executor).notes
    assert notes == (f"shard {name} {CHECKSUM}; its 8 cases are run again",)
    alone = batch.run(plan(), output=archive.with_name("b.h5"), histories="worst:3", threads=1).path
    assert archive.read_bytes() == alone.read_bytes()


@pytest.mark.slow
def test_a_shard_of_the_second_pass_that_does_not_count(archive: Path) -> None:
    begin(archive, after=7, histories="every:2")
    name = "1-000000000-000000008"
    turned_over(whole.folder_of(archive).shards / name)
    rest, notes = go_on(archive, histories="every:2")
    assert name in rest.names
    assert notes == (
        f"goes on: {CASES} of {CASES} cases are done",
        f"shard {name} {CHECKSUM}; its 8 cases are run again",
    )


@pytest.mark.slow
def test_what_workers_had_begun_to_write_is_swept_away(archive: Path, undisturbed: bytes) -> None:
    begin(archive)
    left = whole.folder_of(archive).shards / ".0-000000032-000000040.elsewhere.4711.tmp"
    left.write_bytes(b"MET shard 1\n")
    begin(archive, after=1)
    assert not left.exists()
    go_on(archive)
    assert archive.read_bytes() == undisturbed


@pytest.mark.release
@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"updated": 1}', '{"updated": "now"}', "\0\xff"])
def test_a_damaged_status_file_is_harmless(archive: Path, undisturbed: bytes, text: str) -> None:
    begin(archive)
    folder = whole.folder_of(archive)
    for name in ("status.json", "status.3.json"):
        (folder.path / name).write_text(text, encoding="latin-1")
    go_on(archive)
    assert archive.read_bytes() == undisturbed


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"updated": null}', '{"updated": "now"}', "\0\xff"])
def test_a_damaged_status_file_tells_nothing(tmp_path: Path, text: str) -> None:
    (tmp_path / "status.json").write_text(text, encoding="latin-1")
    assert status_files.status_records(Folder(tmp_path)) == []


def damaged(data: bytes) -> Iterator[tuple[str, bytes]]:
    yield "empty", b""
    yield "cut short", data[: len(data) // 2]
    yield "no JSON", b"\x89HDF\r\n\x1a\n"
    yield "a list", b"[]"
    yield "a number", b"7"
    yield "nothing in it", b"{}"
    yield "another schema", data.replace(b"met.campaign", b"met.champagne")
    yield "a newer format", data.replace(b'"version": 1', b'"version": 2')
    yield "no key", data.replace(b'"key"', b'"kex"')
    yield "no sections", data.replace(b'"sections"', b'"sectiona"')
    yield "odd sections", json.dumps({**json.loads(data), "sections": {"number": 0}}).encode()


@pytest.mark.slow
def test_a_damaged_description_is_refused(archive: Path, undisturbed: bytes) -> None:
    kept = begin(archive)
    path = whole.folder_of(archive).path / "campaign.json"
    sound = path.read_bytes()
    for _, data in damaged(sound):
        path.write_bytes(data)
        assert refused(archive) == (
            f"error[E350]: {path} is damaged, or of another version of MET\n"
            " = help: `--fresh` starts over, and removes what is in it\n"
            "\n1 error\n"
        )
        assert whole.shards(archive) == kept
    path.write_bytes(sound)
    go_on(archive)
    assert archive.read_bytes() == undisturbed


@pytest.mark.slow
def test_a_description_that_is_gone_is_written_anew(archive: Path, undisturbed: bytes) -> None:
    """The shards prove themselves."""
    kept = begin(archive)
    (whole.folder_of(archive).path / "campaign.json").unlink()
    rest, notes = go_on(archive)
    assert not kept.keys() & set(rest.names)
    assert notes == (f"goes on: {OF_TASK * len(kept)} of {CASES} cases are done",)
    assert archive.read_bytes() == undisturbed


@pytest.mark.slow
@pytest.mark.parametrize("text", ["", "{}", "[1]"])
def test_a_damaged_plan_file_is_written_anew(archive: Path, undisturbed: bytes, text: str) -> None:
    begin(archive)
    (whole.folder_of(archive).path / "plan.json").write_text(text)
    go_on(archive)
    assert archive.read_bytes() == undisturbed
