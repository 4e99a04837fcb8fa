"""What lies beside archives is data: campaign.json, status.json, .run.json, shards, plans, transcripts, records."""

from __future__ import annotations

import hashlib
import json
import random
import shutil
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import batch
from batch.beds.case_result import check_head
from batch.beds.executor import OnBeds, Ports
from batch.campaigns import tasks
from batch.campaigns.folder import Folder
from batch.terminal import job
from hw.beds.replay import ReplayBed
from hw.lines import transcript
from hw.recording import records
from met.diagnostic import Problem
from met.messages.render import render
from met.plan import file as plan_file
from tests.batch import plans
from tests.batch.begun import begin, go_on, refused, short_tasks
from tests.batch.begun import plan as campaigns_plan
from tests.batch.foreign.archives import met
from tests.batch.foreign.mutations import mutate_json, wrong

DEEP = '{"a":' * 50_000
DAMAGED = (
    "error[E350]: a.h5.campaign/campaign.json is damaged, or of another version of MET\n"
    " = help: `--fresh` starts over, and removes what is in it\n"
    "\n1 error\n"
)


@pytest.fixture
def campaign(here: Path, engine: None, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a campaign that has begun."""
    short_tasks(monkeypatch)
    begin(Path("a.h5"))
    return Path("a.h5.campaign")


def changed(path: Path, **values: Any) -> None:
    data = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps({**data, **values}), encoding="utf-8")


# campaign.json


@pytest.mark.slow
@pytest.mark.parametrize("text", [DEEP, "1" * 30, '{"schema": NaN}', "[]", "null", '"met.campaign"', "{", "\ufeff{}"])
def test_a_description_that_is_none_is_told(text: str, campaign: Path) -> None:
    (campaign / "campaign.json").write_text(text, encoding="utf-8")
    assert met("status", "a.h5").text == DAMAGED
    assert refused(Path("a.h5")) == DAMAGED


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("rows", "../../rows.0.npy"),
        ("rows", "/etc/passwd"),
        ("rows", 0),
        ("number", -1),
        ("number", "0"),
        ("cases", -1),
        ("cases", 1e3),
        ("cases", 2**70),
        ("experiment", None),
        ("name", ["x"]),
        ("again", 0),
        ("recorded", "yes"),
    ],
)
def test_a_section_that_is_none_is_told(name: str, value: Any, campaign: Path) -> None:
    data = json.loads((campaign / "campaign.json").read_text(encoding="utf-8"))
    data["sections"][0][name] = value
    (campaign / "campaign.json").write_text(json.dumps(data), encoding="utf-8")
    assert met("status", "a.h5").text == DAMAGED


@pytest.mark.parametrize("name", ["../b.h5", "/tmp/b.h5", "", "b.h5"])
def test_a_campaign_writes_no_archive_but_the_one_that_its_folder_is_of(
    name: str, campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changed(campaign / "campaign.json", archive=name)
    assert job.main([str(campaign), "together"]) == 1
    said = capsys.readouterr().err
    assert said.startswith(
        "error[E350]: a.h5.campaign says that it fills b.h5, which has another folder\n" if name == "b.h5" else DAMAGED
    )
    assert not Path("b.h5").exists() and not Path("../b.h5").exists()


def test_rows_that_are_none_of_the_table_are_told(here: Path, engine: None, monkeypatch: pytest.MonkeyPatch) -> None:
    short_tasks(monkeypatch)
    begin(Path("a.h5"), cases=list(range(30)))
    folder = Folder(Path("a.h5.campaign"))
    rows = folder.path / "rows.0.npy"
    for wrong_rows in (np.arange(30)[::-1], np.arange(30.0), np.arange(11, 41), np.arange(30).reshape(5, 6)):
        np.save(rows, wrong_rows)
        with pytest.raises(Problem) as caught:
            folder.sections()
        assert render(caught.value.diagnostics).startswith("error[E350]: a.h5.campaign/rows.0.npy is damaged")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["campaign.json", "status.json", "plan.json"])
def test_whatever_it_says_the_campaign_goes_on_or_says_why_not(
    name: str, campaign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(campaign, "kept")
    for seed in range(5):
        shutil.rmtree(campaign, ignore_errors=True)
        shutil.copytree("kept", campaign)
        Path("a.h5").unlink(missing_ok=True)
        Path("a.h5.run.json").unlink(missing_ok=True)
        chance = random.Random(f"{name} {seed}")
        data = json.loads((campaign / name).read_text(encoding="utf-8"))
        did = [mutate_json(chance, data) for _ in range(chance.choice((1, 2)))]
        (campaign / name).write_text(json.dumps(data), encoding="utf-8")
        said = met("status", "a.h5")
        assert not wrong(said, ()), (seed, did, said.text)
        for ask in (lambda: job.merge_campaign(campaign), lambda: batch.run(campaigns_plan(), output="a.h5")):
            try:
                ask()
            except Problem as problem:
                assert render(problem.diagnostics).startswith("error[E"), (seed, did)


# .run.json


@pytest.mark.release
@pytest.mark.parametrize(
    "text",
    [
        DEEP,
        "[]",
        '{"experiments": [{"seconds": 1e400, "cases": 1}]}',
        '{"experiments": [{"seconds": NaN}]}',
        '{"experiments": 3}',
        '{"experiments": [{"seconds": 1e308, "cases": 9}, {"seconds": 1e308, "cases": 1}]}',
        '{"experiments": [{"seconds": 1e308, "cases": 9}, {"seconds": 1e308, "cases": 1}], "began": 1}',
        '{"experiments": [{"seconds": [], "cases": "x"}]}',
        '{"experiments": [{"cases": -1}], "began": []}',
        "1" * 5000,
        '{"experiments": [{"seconds": 0, "cases": 1}], "beds": 7, "began": "\\u001b[2J"}',
    ],
)
def test_a_sidecar_of_any_kind_is_read_or_left(text: str, here: Path, engine: None) -> None:
    batch.run(campaigns_plan(), output="a.h5")
    Path("a.h5.run.json").write_text(text, encoding="utf-8")
    said = met("status", "a.h5")
    assert not wrong(said, ()) and said.status == 0
    other = plans.plan(plans.gains(41))
    try:
        batch.run(other, output="a.h5")
    except Problem as problem:
        assert [each.code for each in problem.diagnostics] == ["E353"]


# Shards


def resummed(path: Path, change: Callable[[dict[str, Any]], object], tail: bytes = b"") -> None:
    """Another head, whose checksum is right."""
    data = path.read_bytes()[: -tasks.SUM_BYTES]
    at = len(tasks.MAGIC) + 8
    end = at + int.from_bytes(data[len(tasks.MAGIC) : at], "little")
    head = json.loads(data[at:end])
    found = change(head)
    text = (found if isinstance(found, str) else json.dumps(head)).encode()
    made = tasks.MAGIC + len(text).to_bytes(8, "little") + text + data[end:] + tail
    path.write_bytes(made + hashlib.sha256(made).digest())


HEADS: dict[str, Callable[[dict[str, Any]], object]] = {
    "no JSON": lambda head: "{",
    "deep": lambda head: DEEP,
    "a list": lambda head: "[]",
    "no key": lambda head: head.pop("key"),
    "no arrays": lambda head: head.update(arrays=[]),
    "a size below 0": lambda head: head["arrays"][0][2].__setitem__(0, -8),
    "a huge size": lambda head: head["arrays"][0][2].__setitem__(0, 1 << 62),
    "sizes whose product wraps around": lambda head: head["arrays"][0].__setitem__(2, [1 << 32, 1 << 32, 8]),
    "a type that is none": lambda head: head["arrays"][0].__setitem__(1, "O"),
    "outputs of four bytes": lambda head: head["arrays"][0].__setitem__(1, "f4"),
    "another array": lambda head: head["arrays"].append(["more", "f8", [0]]),
    "seconds in words": lambda head: head.update(seconds="long"),
    "seconds below 0": lambda head: head.update(seconds=-1.0),
    "seconds that are none": lambda head: head.update(seconds=float("nan")),
    "a fate of no case": lambda head: head.update(fates=[[8, 3, "lost"]]),
    "a fate that is none": lambda head: head.update(fates=[[0, 99, "lost"]]),
    "a fate without a word": lambda head: head.update(fates=[[0, 3, None]]),
    "a length beyond the file": lambda head: None,
}


@pytest.mark.release
@pytest.mark.parametrize("name", HEADS)
def test_a_shard_with_a_right_checksum_and_a_wrong_head_counts_as_none(name: str, campaign: Path) -> None:
    first = sorted((campaign / "shards").iterdir())[0]
    resummed(first, HEADS[name], b"more" if name == "a length beyond the file" else b"")
    rest, notes = go_on(Path("a.h5"))
    why = "has a head that does not go with what follows it"
    assert f"shard {first.name} {why}; its 8 cases are run again" in notes
    assert first.name in rest.names


def test_a_shard_of_other_outputs_than_the_programs_counts_as_none(campaign: Path) -> None:
    first = sorted((campaign / "shards").iterdir())[0]
    found = tasks.shard_of_file(first)
    wide = np.zeros((len(found.outputs), found.outputs.shape[1] + 1))
    tasks.write_shard(first, tasks.Shard(found.key, wide, found.history, found.seconds, found.fates))
    _, notes = go_on(Path("a.h5"))
    assert f"shard {first.name} holds other outputs than the program has; its 8 cases are run again" in notes


# Plans


@pytest.mark.slow
def test_plans_with_something_else_in_them_are_read_or_told(here: Path) -> None:
    plan_file.write(plans.plan(plans.gains(6)), "good.json")
    text = Path("good.json").read_text(encoding="utf-8")
    for seed in range(15):
        data = json.loads(text)
        did = mutate_json(random.Random(seed), data)
        Path("plan.json").write_text(json.dumps(data), encoding="utf-8")
        for words in (("plan", "plan.json"), ("cases", "plan.json")):
            said = met(*words)
            assert not wrong(said, words), (seed, did, said.text)


@pytest.mark.parametrize("text", [DEEP, '{"schema":"met.plan","version":' + "9" * 5000 + "}", '{"a": 1e999}', "NaN"])
def test_a_plan_that_is_none_is_told(text: str, here: Path) -> None:
    Path("plan.json").write_text(text, encoding="utf-8")
    said = met("run", "plan.json")
    assert said.status == 2 and said.text.startswith("error[E302]: ")


# Transcripts and records


def transcript_of(header: bytes, times: tuple[float, ...] = ()) -> bytes:
    data, crc = transcript.MAGIC, 0
    for kind, time, body in [(transcript.HEADER, 0.0, header), *((transcript.SENT, time, b"x") for time in times)]:
        record = transcript._HEAD.pack(kind, time, len(body)) + body
        crc = zlib.crc32(record, crc)
        data += record + crc.to_bytes(4, "little")
    return data


@pytest.mark.parametrize(
    "header", [DEEP.encode()[:60_000], b"[]", b"null", b"NaN", b"9" * 5000, b'{"period": 1e999, "first": 0}', b"\xff"]
)
def test_a_transcript_whose_header_is_none_is_told(header: bytes, here: Path) -> None:
    Path("a.transcript").write_bytes(transcript_of(header))
    with pytest.raises(Problem) as caught:
        ReplayBed("a.transcript")
    assert render(caught.value.diagnostics) == (
        "error[E409]: a.transcript is no transcript of a bed\n"
        " = help: give the file that a run with a bed wrote\n"
        "\n1 error\n"
    )


@pytest.mark.parametrize(
    "header",
    [
        b"{}",
        b'{"period": "x", "first": 0}',
        b'{"period": 0.001, "first": []}',
        b'{"period": 0, "first": 0}',
        b'{"period": -1, "first": 0}',
        b'{"period": 0.001, "first": -7}',
        b'{"period": 1e308, "first": 70000}',
    ],
)
def test_a_transcript_that_does_not_say_how_its_bed_was_driven_is_told(header: bytes, here: Path) -> None:
    Path("a.transcript").write_bytes(transcript_of(header))
    with pytest.raises(Problem) as caught:
        ReplayBed("a.transcript")
    assert "error[E409]: a.transcript does not say how its bed was driven" in render(caught.value.diagnostics)


def test_a_transcript_ends_where_a_time_is_none(here: Path) -> None:
    Path("a.transcript").write_bytes(transcript_of(b"{}", (0.0, 1.0, float("nan"), 2.0)))
    assert [each.time for each in transcript.read("a.transcript").records] == [0.0, 1.0]


GOOD_HEAD = {
    "key": "k",
    "row": 0,
    "joints": ["a"],
    "beds": [{"name": "b", "firmware": "1"}],
    "tick_hz": 100.0,
    "repeats": 1,
}


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("joints", "a"),
        ("joints", []),
        ("joints", [1]),
        ("beds", {}),
        ("beds", [1]),
        ("beds", [{"name": 3}]),
        ("tick_hz", 0),
        ("tick_hz", "x"),
        ("repeats", 0),
        ("repeats", 1.5),
    ],
)
def test_records_with_a_head_that_is_none_count_as_none(name: str, value: Any) -> None:
    rows = np.empty(0, records.LAYOUT)
    check_head(records.Records(GOOD_HEAD, rows, 0))
    with pytest.raises(records.UnsoundRecords, match="has a head that is damaged"):
        check_head(records.Records({**GOOD_HEAD, name: value}, rows, 0))


@pytest.mark.parametrize("ports", [[], "x", {"shoulder": 3}, {"shoulder": []}])
def test_records_with_ports_that_are_none_count_as_none(ports: Any, here: Path) -> None:
    folder = Folder(Path("a.h5.campaign"))
    folder.path.mkdir()
    folder.beds.mkdir()
    with open(folder.beds / "0-0.records", "xb") as file:
        records.begin(file, {**GOOD_HEAD, "ports": ports})
    OnBeds(Ports({"shoulder": "emulated"}, 921_600), lambda _: None).open(folder, {}, lambda: None)
