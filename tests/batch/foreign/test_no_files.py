"""Named pipes, sockets, devices and folders in the place of files: refused at once, with their place."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import batch
from batch.campaigns.folder import Folder, beside
from hw.lines.transcript import read
from met.diagnostic import Problem
from met.messages.render import render
from met.plan import file as plan_file
from tests.batch import plans
from tests.batch.begun import begin, go_on, plan, refused, short_tasks
from tests.batch.foreign.archives import DECK, met


@pytest.fixture(autouse=True)
def patience() -> Iterator[None]:
    """What hangs fails."""

    def too_long(*_: object) -> None:
        raise AssertionError("it waits for something that never comes")

    before = signal.signal(signal.SIGALRM, too_long)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.slow
@pytest.mark.parametrize("command", ["show", "diff", "plot", "report", "export", "status"])
def test_a_pipe_in_the_place_of_an_archive(command: str, archive: Path, here: Path) -> None:
    os.mkfifo("a.h5")
    said = met(command, "a.h5", *([str(archive)] if command == "diff" else []))
    assert said.status == 2
    assert "error[E301]: cannot read the archive a.h5: it is a named pipe, not a regular file\n" in said.text


def test_a_socket_in_the_place_of_an_archive(here: Path) -> None:
    with socket.socket(socket.AF_UNIX) as made:
        made.bind("a.h5")
        said = met("show", "a.h5")
    assert said.status == 2
    assert said.text == (
        "error[E301]: cannot read the archive a.h5: it is a socket, not a regular file\n"
        " = help: an archive is read from a file: save it as NAME.h5 first\n\n1 error\n"
    )


def test_a_folder_in_the_place_of_an_archive(archive: Path, here: Path) -> None:
    Path("results").mkdir()
    empty = (
        "error[E301]: cannot read the archive results: is a directory\n = help: there is no archive in it\n\n1 error\n"
    )
    assert met("show", "results").text == empty
    shutil.copy(archive, "results/b.h5")
    shutil.copy(archive, "results/a.h5")
    assert "\n = help: archives in it: a.h5, b.h5\n" in met("show", "results").text


def test_a_pipe_in_the_place_of_a_plan_and_of_its_table(here: Path) -> None:
    os.mkfifo("plan.json")
    assert met("run", "plan.json").text == (
        "error[E301]: cannot read the plan plan.json: it is a named pipe, not a regular file\n\n1 error\n"
    )
    made = plans.plan(plans.gains(plan_file.LISTED_ROWS + 1))
    _, table = sorted(plan_file.write(made, "big.json"))
    table.unlink() if table.suffix == ".npy" else None
    [name] = Path().glob("big.*.npy") or [Path("big.gains.cases.npy")]
    name.unlink(missing_ok=True)
    os.mkfifo(name)
    said = met("plan", "big.json")
    assert said.status == 2 and "cannot be read: it is a named pipe, not a regular file" in said.text


def test_a_pipe_where_a_plans_table_is_to_be_written(here: Path) -> None:
    [plan_there, table] = sorted(
        plan_file.write(plans.plan(plans.gains(plan_file.LISTED_ROWS + 1)), "big.json"), key=lambda path: path.suffix
    )
    table.unlink()
    os.mkfifo(table)
    with pytest.raises(Problem) as caught:
        plan_file.write(plans.plan(plans.gains(plan_file.LISTED_ROWS + 1)), plan_there)
    assert render(caught.value.diagnostics) == (
        "error[E300]: cannot write big.gains.cases.npy: it is not a regular file\n\n1 error\n"
    )


@pytest.mark.release
@pytest.mark.parametrize("output", ["a.h5", "a.mcap", "a.parquet", "a.html", "a.svg", "a.json"])
def test_a_pipe_where_something_is_to_be_written(output: str, archive: Path, here: Path) -> None:
    os.mkfifo(output)
    Path("door.ic").write_text(DECK, encoding="utf-8")
    words = {
        ".h5": ("run", "door.ic", "open", "-o"),
        ".html": ("report", str(archive), "-o"),
        ".svg": ("plot", str(archive), "-o"),
        ".json": ("plan", "door.ic", "open", "-o"),
    }
    said = met(*words.get(Path(output).suffix, ("export", str(archive), "-o")), output)
    assert said.status == 2
    assert f"cannot write {output}: it is not a regular file" in said.text


@pytest.mark.slow
@pytest.mark.parametrize("words", ["export -o a.csv/", "report -o a.html/", "plot -o a.png/", "view -o a.html/"])
def test_a_name_that_ends_as_a_folders_is_no_files(words: str, archive: Path, here: Path) -> None:
    command, option, output = words.split()
    said = met(command, str(archive), option, output)
    assert said.status == 2
    assert f"error[E305]: cannot write {output}: there is no such folder\n" in said.text
    assert os.listdir(here) == []


def test_a_pipe_in_the_place_of_a_deck_an_include_a_table_and_a_robot(here: Path) -> None:
    os.mkfifo("pipe")
    os.mkfifo("a.ic")
    Path("b.ic").write_text('#include "pipe"\n' + DECK, encoding="utf-8")
    Path("c.ic").write_text(DECK + 'sweep more of open { vary from csv("pipe"); }\n', encoding="utf-8")
    Path("d.ic").write_text('arm a from urdf("pipe") { }\n', encoding="utf-8")
    for deck in ("a.ic", "b.ic", "d.ic"):
        for command in ("check", "run", "explain"):
            said = met(command, deck, *(["open.duration"] if command == "explain" else []))
            assert said.status == 2 and "is not a regular file" in said.text, (deck, command)
    assert met("check", "c.ic").status == 2
    assert met("fmt", "a.ic").status == 2
    assert met("fmt", "--check", "b.ic").status in (0, 1)
    assert met("import", "pipe").status == 2


def test_a_pipe_in_the_place_of_a_transcript(here: Path) -> None:
    os.mkfifo("a.transcript")
    with pytest.raises(Problem) as caught:
        read("a.transcript")
    assert render(caught.value.diagnostics) == (
        "error[E409]: a.transcript cannot be read: it is a named pipe, not a regular file\n"
        " = help: give the file that a run with a bed wrote\n"
        "\n1 error\n"
    )


# A campaign's folder


@pytest.fixture
def campaign(here: Path, engine: None, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An archive whose campaign has begun."""
    short_tasks(monkeypatch)
    begin(Path("a.h5"))
    return beside(Path("a.h5"))


def test_a_pipe_in_the_place_of_a_shard_counts_as_none(campaign: Path) -> None:
    first = sorted((campaign / "shards").iterdir())[0]
    first.unlink()
    os.mkfifo(first)
    _, notes = go_on(Path("a.h5"))
    assert f"shard {first.name} cannot be read: it is a named pipe, not a regular file; its 8 cases are run again" in (
        notes
    )


def test_a_shard_with_a_hole_of_a_terabyte_counts_as_none(campaign: Path) -> None:
    first = sorted((campaign / "shards").iterdir())[0]
    os.truncate(first, 1 << 40)
    _, notes = go_on(Path("a.h5"))
    assert f"shard {first.name} is larger than its cases make it; its 8 cases are run again" in notes


def test_rows_with_a_hole_of_a_terabyte_are_damaged(here: Path, engine: None, monkeypatch: pytest.MonkeyPatch) -> None:
    short_tasks(monkeypatch)
    begin(Path("a.h5"), cases=list(range(30)))
    os.truncate("a.h5.campaign/rows.0.npy", 1 << 40)
    with pytest.raises(Problem, match=r"a\.h5\.campaign/rows\.0\.npy is damaged"):
        Folder(Path("a.h5.campaign")).sections()


def test_a_folder_in_the_place_of_a_shard_counts_as_none(campaign: Path) -> None:
    first = sorted((campaign / "shards").iterdir())[0]
    first.unlink()
    (first / "within").mkdir(parents=True)
    _, notes = go_on(Path("a.h5"))
    assert f"shard {first.name} cannot be read: Is a directory; its 8 cases are run again" in notes


@pytest.mark.parametrize("name", ["campaign.json", "status.json"])
def test_a_pipe_in_the_place_of_what_a_campaign_says_of_itself(name: str, campaign: Path) -> None:
    (campaign / name).unlink()
    os.mkfifo(campaign / name)
    said = met("status", "a.h5")
    assert said.status == (2 if name == "campaign.json" else 1)
    if name == "campaign.json":
        assert "error[E350]: a.h5.campaign/campaign.json is damaged, or of another version of MET" in said.text


@pytest.mark.parametrize("target", ["elsewhere", "a.h5"])
def test_a_link_in_the_place_of_the_lock_is_refused_and_what_it_leads_to_is_left(target: str, campaign: Path) -> None:
    (campaign / "lock").unlink()
    (campaign / "lock").symlink_to(f"../{target}")
    assert refused(Path("a.h5")) == (
        "error[E350]: a.h5.campaign/lock is not a regular file\n"
        " = help: nobody at work in a campaign has such a lock: remove it, `rm -r a.h5.campaign/lock`\n"
        "\n1 error\n"
    )
    assert not Path(target).exists()


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir])
def test_a_pipe_or_a_folder_in_the_place_of_the_lock_is_refused(make: Callable[[Path], None], campaign: Path) -> None:
    (campaign / "lock").unlink()
    make(campaign / "lock")
    assert refused(Path("a.h5")).startswith("error[E350]: a.h5.campaign/lock is not a regular file\n")


def test_a_pipe_in_the_place_of_a_sidecar_is_as_if_there_were_none(archive: Path, here: Path) -> None:
    shutil.copy(archive, "a.h5")
    os.mkfifo("a.h5.run.json")
    said = met("status", "a.h5")
    assert (said.status, said.text) == (0, "a.h5 is whole: 7 cases\n")


def test_a_pipe_in_the_place_of_a_sidecar_is_not_replaced(here: Path, engine: None) -> None:
    os.mkfifo("a.h5.run.json")
    with pytest.raises(Problem) as caught:
        batch.run(plans.plan(), output="a.h5")
    assert render(caught.value.diagnostics) == (
        "error[E305]: cannot write a.h5.run.json: it is not a regular file\n\n1 error\n"
    )


@pytest.mark.slow
def test_an_archive_in_the_place_of_a_link_to_itself_is_written(archive: Path, here: Path) -> None:
    Path("a.h5").symlink_to("a.h5")
    said = met("run", str(archive), "open", "--case", "#0", "-o", "a.h5", "--no-picture")
    assert said.status == 0, said.text
    assert Path("a.h5").is_file() and not Path("a.h5").is_symlink()


def test_a_link_in_the_place_of_a_campaigns_rows_is_not_written_through(
    here: Path, engine: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    short_tasks(monkeypatch)
    begin(Path("a.h5"), cases=list(range(30)))
    Path("mine").write_bytes(b"mine")
    rows = Path("a.h5.campaign/rows.0.npy")
    rows.unlink()
    rows.symlink_to("../mine")
    batch.run(plan(), output="a.h5", cases=list(range(30)))
    assert Path("mine").read_bytes() == b"mine"


def test_a_pipe_in_the_place_of_a_temporary_sidecar_is_not_waited_for(here: Path, engine: None) -> None:
    os.mkfifo(".a.h5.run.json.tmp")
    batch.run(plans.plan(), output="a.h5")
    assert json.loads(Path("a.h5.run.json").read_text(encoding="utf-8"))["experiments"]
