"""Where a campaign writes: what is refused before anything runs, and what an end leaves."""

import errno
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import batch
from batch.campaigns import campaign, tasks
from batch.campaigns.output import check_room, publish
from batch.campaigns.performing import perform
from batch.executors.threads import Threads
from met.diagnostic import Problem
from met.plan import file as plan_file
from tests.batch import plans
from tests.batch.refusals import fail_for_folders, refused

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.usefixtures("engine")
class TestRefusedBeforeAnythingRuns:
    @pytest.fixture(autouse=True)
    def nothing_runs(self, monkeypatch: pytest.MonkeyPatch) -> None:
        from met import run

        monkeypatch.setattr(run, "prepare", lambda _: pytest.fail("a case ran"))

    def run(self, output: str) -> str:
        before = sorted(Path(".").rglob("*"))
        with pytest.raises(Problem) as caught:
            batch.run(plans.plan(plans.gains(3)), output=output)
        assert sorted(Path(".").rglob("*")) == before
        return refused(caught)

    def test_a_folder(self, here: Path) -> None:
        (here / "out").mkdir()
        assert self.run("out") == (
            "error[E305]: cannot write out: it is a folder\n"
            " = help: name a file in it: `-o out/two_link.h5`\n"
            "\n1 error\n"
        )

    @pytest.mark.parametrize("output", ["", ".", "..", "/"])
    def test_a_folder_without_a_name(self, here: Path, output: str) -> None:
        said = f"error[E305]: cannot write {Path(output)}: it is a folder\n = help: name a file in it: "
        assert self.run(output).startswith(said)

    @pytest.mark.parametrize("output", ["no/", "no/such.h5/", "no/moves.csv//"])
    def test_a_folder_that_is_not_there_is_not_made_a_file(self, here: Path, output: str) -> None:
        name = output.rstrip("/")
        assert self.run(output) == (
            f"error[E305]: cannot write {output}: there is no such folder\n"
            f" = help: for a file: `-o {name}`\n"
            f" = help: for a folder, make it first: `mkdir -p {name}`\n"
            "\n1 error\n"
        )

    def test_what_another_run_is_writing(self, here: Path) -> None:
        from batch.archive.sink import Sink, temporary_of

        other = Sink(temporary_of(Path("a.h5")))
        assert self.run("a.h5") == (
            "error[E307]: cannot write a.h5: another run is writing it now\n"
            " = help: `met status a.h5` says how far it is\n"
            " = help: wait until it is done, or give another name with `-o`\n"
            "\n1 error\n"
        )
        other.remove()
        other.close()

    def test_no_such_folder(self, here: Path) -> None:
        assert self.run("no/such/a.h5") == (
            "error[E305]: cannot write no/such/a.h5: no/such does not exist\n"
            " = help: make it first: `mkdir -p no/such`\n"
            "\n1 error\n"
        )

    def test_a_file_where_a_folder_should_be(self, here: Path) -> None:
        (here / "file").write_text("x")
        assert self.run("file/a.h5") == "error[E305]: cannot write file/a.h5: file is a file, not a folder\n\n1 error\n"

    def test_a_file_where_the_campaigns_folder_should_be(self, here: Path) -> None:
        (here / "a.h5.campaign").touch()
        assert self.run("a.h5") == (
            "error[E305]: cannot write a.h5: a.h5.campaign is no folder, and a campaign's has to be there\n"
            " = help: give another name with `-o`, or move the file\n"
            "\n1 error\n"
        )

    def test_somebody_elses_file_is_not_written_over(self, here: Path) -> None:
        (here / "somebodys").write_text("run nominal { }")
        assert self.run("somebodys") == (
            "error[E305]: somebodys exists and is no archive of MET: it is not written over\n"
            " = help: give another name with `-o`, or remove the file\n"
            "\n1 error\n"
        )

    @pytest.mark.parametrize(
        ("output", "instead"),
        [("two_link.ic", "two_link.h5"), ("-", "two_link.h5"), ("x.TXT", "x.h5"), ("out/a.png", "out/a.h5")],
    )
    def test_an_archive_under_the_name_of_something_else(self, here: Path, output: str, instead: str) -> None:
        assert self.run(output) == (
            f"error[E305]: cannot write {output}: it is to be an archive, which ends in .h5\n"
            f" = help: `-o {instead}`\n"
            "\n1 error\n"
        )

    def test_a_place_that_refuses_files(self, here: Path) -> None:
        assert self.run("/proc/a.h5") == (
            "error[E305]: cannot write /proc/a.h5: no such file or directory\n"
            " = help: nothing was kept; `-o FILE` names another place\n"
            "\n1 error\n"
        )

    def test_what_is_no_file_is_not_replaced_by_one(self, here: Path) -> None:
        os.mkfifo("pipe")
        assert self.run("pipe") == "error[E305]: cannot write pipe: it is not a regular file\n\n1 error\n"

    def test_a_name_too_long(self, here: Path) -> None:
        assert "file name too long" in self.run("x" * 300 + ".h5")

    def test_a_full_disk(self, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        import shutil
        from collections import namedtuple

        usage = namedtuple("usage", "total used free")
        monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(10**9, 10**9 - 5000, 5000))
        assert self.run("a.h5") == (
            "error[E306]: cannot write a.h5: it needs about 88.6 KiB until it is whole, and the disk has 4.9 KiB left\n"
            " = help: `--histories none` keeps metrics only; `--float32`, fewer signals in `record`, or a slower "
            "`rates.record`, take less\n"
            "\n1 error\n"
        )


class TestNaming:
    """The end of a campaign: its archive is written, and gets its name."""

    def publish(self) -> str:
        """Name a new archive; what is refused."""
        Path("new").write_bytes(b"archive")
        try:
            publish(Path("a.h5"), Path("new"), {})
        except Problem as problem:
            return problem.diagnostics[0].message + "; " + "; ".join(problem.diagnostics[0].help)
        finally:
            assert Path("a.h5").read_bytes() == b"archive"
        return ""

    @pytest.mark.parametrize("number", [errno.EINVAL, errno.EBADF])
    def test_a_folder_that_cannot_be_flushed_does_not_matter(
        self, here: Path, monkeypatch: pytest.MonkeyPatch, number: int
    ) -> None:
        fail_for_folders(monkeypatch, number)
        assert self.publish() == ""
        assert sorted(path.name for path in here.iterdir()) == ["a.h5", "a.h5.run.json"]

    def test_a_disk_that_fails_then_takes_nothing_back(self, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        fail_for_folders(monkeypatch, errno.EIO)
        assert self.publish() == "a.h5 is whole, but its disk may lose it: input/output error; copy it to another disk"
        assert sorted(path.name for path in here.iterdir()) == ["a.h5", "a.h5.run.json"]

    def test_an_archive_whose_sidecar_is_refused_is_whole(self, here: Path) -> None:
        (here / "a.h5.run.json").mkdir()
        assert self.publish() == (
            "a.h5 is whole, but a.h5.run.json cannot be written: is a directory; without it the same command runs all "
            "cases again"
        )
        assert sorted(path.name for path in here.iterdir()) == ["a.h5", "a.h5.run.json"]


@pytest.mark.parametrize("told", [(0, 0, 0), (-4096, 0, -4096), (1 << 40, 0, -4096), None])
def test_a_disk_that_does_not_tell_its_room_is_not_full(
    monkeypatch: pytest.MonkeyPatch, told: tuple[int, ...] | None
) -> None:
    """File systems that do not know their size answer 0 of 0 blocks, all ones, or nothing."""

    def usage(_: object) -> tuple[int, ...]:
        if told is None:
            raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
        return told

    monkeypatch.setattr("shutil.disk_usage", usage)
    check_room(Path("a.h5"), 1 << 30)


@pytest.mark.usefixtures("engine")
class TestHowItEnds:
    def test_an_interrupt_leaves_no_half_file(self, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        from met import run

        def interrupted(*arguments: Any, **options: Any) -> Any:
            if arguments[1][0] > 0:
                raise KeyboardInterrupt
            return plans.answer(*arguments, **options)

        monkeypatch.setattr(run, "run", interrupted)
        monkeypatch.setattr(tasks, "MOST_BYTES", 1)
        with pytest.raises(KeyboardInterrupt):
            batch.run(plans.plan(plans.gains(3)), output="a.h5")
        assert list(here.iterdir()) == []

    def test_an_interrupt_leaves_the_archive_of_before(self, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        from met import run

        batch.run(plans.plan(plans.gains(3)), output="a.h5")
        before = (here / "a.h5").read_bytes()
        monkeypatch.setattr(run, "run", lambda *_, **__: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            batch.run(plans.plan(plans.gains(4)), output="a.h5")
        assert (here / "a.h5").read_bytes() == before
        assert sorted(path.name for path in here.iterdir()) == ["a.h5", "a.h5.run.json"]

    @pytest.mark.slow
    def test_an_archive_is_written_over_by_the_next(self, here: Path) -> None:
        batch.run(plans.plan(plans.gains(3)), output="a.h5")
        batch.run(plans.plan(plans.gains(4)), output="a.h5")
        with batch.open("a.h5") as data:
            assert data.sizes["case"] == 4

    @pytest.mark.slow
    def test_what_a_killed_run_left_is_swept_up_by_the_next(self, here: Path) -> None:
        (here / ".a.h5.tmp").write_bytes(b"half an archive" * 100_000)
        (here / ".a.h5.run.json.tmp").write_bytes(b"{")
        batch.run(plans.plan(plans.gains(3)), output="a.h5")
        fresh = (here / "a.h5").read_bytes()
        assert sorted(path.name for path in here.iterdir()) == ["a.h5", "a.h5.run.json"]
        batch.run(plans.plan(plans.gains(3)), output="a.h5")
        assert (here / "a.h5").read_bytes() == fresh

    @pytest.mark.slow
    def test_a_run_that_starts_while_another_writes_is_told_and_the_other_ends_well(
        self, here: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from met import run

        said = []

        def meanwhile(*arguments: Any, **options: Any) -> Any:
            monkeypatch.setattr(run, "run", plans.answer)
            with pytest.raises(Problem) as caught:
                perform(second, executor=Threads())
            said.append(caught.value.diagnostics[0].message)
            return plans.answer(*arguments, **options)

        second = campaign.prepare(plans.plan(plans.gains(4)), output="a.h5")
        monkeypatch.setattr(run, "run", meanwhile)
        batch.run(plans.plan(plans.gains(3)), output="a.h5")
        assert said == ["cannot write a.h5: another run is writing it now"]
        with batch.open("a.h5") as data:
            assert data.sizes["case"] == 3

    def test_the_default_name_is_the_decks(self, here: Path) -> None:
        assert campaign.prepare(plans.plan()).output == Path("two_link.h5")
        named = campaign.prepare(plans.plan(plans.nominal(), plans.gains()), experiments=["gains"])
        assert named.output == Path("two_link.gains.h5")

    @pytest.mark.slow
    def test_the_default_name_is_the_same_from_python(self, here: Path) -> None:
        import ic

        def output(select: Any, **options: Any) -> str:
            return campaign.prepare(ic.compile("two_link.ic", select=select), **options).output.name

        assert output(None) == output("nominal") == output("nominal", experiments=["nominal"]) == "two_link.h5"
        assert output(["gains"]) == output("gains") == "two_link.gains.h5"
        assert output("all") == "two_link.all.h5"
        assert output("all", experiments=["gains"]) == "two_link.gains.h5"
        plan_file.write(ic.compile("two_link.ic", select=["gains"]), here / "p.json")
        assert batch.run("p.json", cases=["#3"]).path == Path("two_link.gains.case3.h5")

    @pytest.mark.slow
    def test_a_deck_is_run_from_its_path(self, here: Path) -> None:
        assert batch.run("two_link.ic", cases=[0]).path == Path("two_link.h5")
        assert batch.run(Path("two_link.ic"), experiments=["gains"], cases=[3]).path == Path("two_link.gains.case3.h5")

    def test_what_is_no_plan_is_named(self, here: Path) -> None:
        with pytest.raises(Problem) as caught:
            batch.run("gantry.ic")
        assert caught.value.diagnostics[0].message == "cannot read `gantry.ic`: No such file or directory"
        with pytest.raises(TypeError) as refused:
            batch.run(7)  # type: ignore[arg-type]
        assert str(refused.value) == "batch.run takes a deck's path or a plan, and not int"

    def test_a_case_that_is_run_again_does_not_take_its_sweeps_place(self, here: Path) -> None:
        def output(*cases: str | int) -> str:
            made = plans.plan(plans.nominal(), plans.gains(9))
            return campaign.prepare(made, experiments=["gains"], cases=cases).output.name

        assert output("#7") == "two_link.gains.case7.h5"
        assert output("#7", 2) == "two_link.gains.case2-7.h5"
        assert output(*range(8)) == "two_link.gains.cases.h5"
        assert output(*range(9)) == "two_link.gains.h5"


@pytest.mark.usefixtures("engine")
@pytest.mark.parametrize(
    ("name", "why"), [("shards", "shards: file exists"), ("plan.json/x", "plan.json: is a directory")]
)
def test_what_is_in_the_way_in_the_campaigns_folder_is_named(here: Path, name: str, why: str) -> None:
    there = here / "a.h5.campaign" / name
    there.parent.mkdir(parents=True)
    there.touch()
    with pytest.raises(Problem) as caught:
        batch.run(plans.plan(plans.gains(3)), output="a.h5")
    said = refused(caught)
    assert said.startswith(f"error[E305]: cannot write a.h5: a.h5.campaign/{why}\n = help: ")
    assert said.endswith("; move away what is in the way, or give another name with `-o`\n\n1 error\n")


@pytest.mark.usefixtures("engine")
def test_where_no_more_files_can_be_opened_it_is_said(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any, **__: Any) -> Any:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE), "a.h5.campaign/lock")

    monkeypatch.setattr("batch.campaigns.folder.os.open", refuse)
    monkeypatch.setattr("batch.campaigns.output.resource.getrlimit", lambda _: (77, 77))
    with pytest.raises(Problem) as caught:
        batch.run(plans.plan(plans.gains(3)), output="a.h5")
    assert refused(caught) == (
        "error[E305]: cannot write a.h5: too many open files\n"
        " = help: nothing was kept; `ulimit -n` allows 77 open files: allow more in the shell that runs it, or use "
        "fewer processes\n"
        "\n1 error\n"
    )


@pytest.mark.slow
@pytest.mark.parametrize("room", [2_000, 60_000, 200_000, 700_000])  # full at the head, the layout, the histories
def test_a_disk_that_fills_up_leaves_nothing(tmp_path: Path, room: int) -> None:
    """A limit on the file's size stands for a full disk; in a process of its own, where HDF5 may fail as it likes."""
    program = """
import resource, signal, sys
from unittest import mock
import batch
from met import run
from met.diagnostic import Problem
from tests.batch import plans
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]),) * 2)
with mock.patch.multiple(
    run, run=plans.answer, prepare=plans.Answering, compute=plans.computed, results=plans.results
):
    try:
        batch.run(plans.plan(plans.gains(500)), output=sys.argv[1])
    except Problem as problem:
        print(problem.diagnostics[0].message)
"""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", program, str(tmp_path / "a.h5"), str(room)]
    said = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert said.stdout.strip().endswith(": file too large")
    assert said.returncode == 0, said.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.release
@pytest.mark.parametrize(("signal_name", "status", "last"), [("INT", 130, "interrupted"), ("TERM", 143, "terminated")])
def test_a_signal_ends_a_real_run_and_leaves_nothing(tmp_path: Path, signal_name: str, status: int, last: str) -> None:
    """Through the command line: kernels run outside Python, and must let it go."""
    import signal
    import time

    plan_file.write(plans.plan(plans.gains(3_000_000, ticks=20_000)), tmp_path / "p.json")
    (tmp_path / "out").mkdir()
    command = [sys.executable, "-m", "met.cli", "run", str(tmp_path / "p.json"), "-o", str(tmp_path / "out" / "a.h5")]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        for _ in range(600):  # until it writes: a minute is enough for any machine
            if list((tmp_path / "out").iterdir()):
                break
            time.sleep(0.1)
        time.sleep(1.0)
        process.send_signal(signal.Signals[f"SIG{signal_name}"])
        _, said = process.communicate(timeout=60)
    assert process.returncode == status
    assert said.endswith(f"met: {last}\n")
    assert list((tmp_path / "out").iterdir()) == []
