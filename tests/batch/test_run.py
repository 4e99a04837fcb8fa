"""Running campaigns: which cases, how much is kept, what is refused before anything runs, and what an end leaves."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import batch
from batch import campaign, tasks
from batch.performing import perform
from batch.progress import Bar, duration, status
from batch.running import run_and_tell
from ic.printing.columns import size as size_text
from met import keys, plan_file
from met.diagnostic import Problem
from tests.batch import plans

ROOT = Path(__file__).resolve().parents[2]


def refused(caught: pytest.ExceptionInfo[Problem]) -> str:
    """A message whole, as the user reads it."""
    from met.render import render

    return render(caught.value.diagnostics)


@pytest.mark.usefixtures("engine")
class TestWhichCases:
    def test_a_position_an_id_and_a_row_name_the_same_case(self, here: Path) -> None:
        plan = plans.plan(plans.gains(9))
        case_id = keys.case_ids(plans.gains(9))[4]
        for case in (4, "#4", case_id, case_id[:6]):
            rows = campaign.prepare(plan, cases=[case]).parts[0].rows
            assert list(rows) == [4]

    def test_several_cases_are_run_in_the_order_of_the_table(self, here: Path) -> None:
        parts = campaign.prepare(plans.plan(plans.gains(9)), cases=["#7", 2, "#7"]).parts
        assert list(parts[0].rows) == [2, 7]

    def test_a_position_is_taken_in_every_experiment(self, here: Path) -> None:
        parts = campaign.prepare(plans.plan(plans.nominal(), plans.gains(3)), cases=["#0"]).parts
        assert [list(part.rows) for part in parts] == [[0], [0]]

    def test_an_id_runs_only_the_experiment_it_is_in(self, here: Path) -> None:
        case_id = keys.case_ids(plans.gains(3))[2]
        parts = campaign.prepare(plans.plan(plans.nominal(), plans.gains(3)), cases=[case_id]).parts
        assert [(part.experiment.name, list(part.rows)) for part in parts] == [("gains", [2])]

    def test_no_such_case(self, here: Path) -> None:
        with pytest.raises(Problem) as caught:
            campaign.prepare(plans.plan(plans.gains(9)), cases=["#9"])
        assert refused(caught) == (
            "error[E311]: no case `#9`\n"
            " = help: `gains` has #0 to #8\n"
            " = help: `met cases DECK` lists them\n"
            "\n1 error\n"
        )  # fmt: skip

    def test_an_id_of_several_cases(self, here: Path) -> None:
        ids = keys.case_ids(plans.gains(40))
        twice = next(i[0] for i in ids if sum(other[0] == i[0] for other in ids) == 2)
        rows = [row for row, case_id in enumerate(ids) if case_id[0] == twice]
        with pytest.raises(Problem) as caught:
            campaign.prepare(plans.plan(plans.gains(40)), cases=[twice])
        expected = f"case `{twice}` may be any of 2: #{rows[0]} of `gains`, #{rows[1]} of `gains`"
        assert caught.value.diagnostics[0].message == expected

    def test_no_such_run(self, here: Path) -> None:
        with pytest.raises(Problem) as caught:
            campaign.prepare(plans.plan(plans.nominal(), plans.gains()), experiments=["gain"])
        assert refused(caught) == (
            "error[E310]: no run or sweep `gain` in two_link.ic\n"
            " = help: did you mean `gains`?\n"
            " = help: runs and sweeps of two_link.ic: nominal, gains\n"
            "\n1 error\n"
        )  # fmt: skip


@pytest.mark.usefixtures("engine")
class TestWhatIsKept:
    def test_all_histories_of_a_small_campaign(self, here: Path) -> None:
        made = campaign.prepare(plans.plan(plans.gains(20)))
        assert made.parts[0].all_recorded
        assert made.notes == ()

    def test_metrics_only_beyond_a_gigabyte_and_it_is_said_before(self, here: Path) -> None:
        # 2 s at 25 Hz, 7 columns: 2.8 kB a case
        made = campaign.prepare(plans.plan(plans.gains(400_000)))
        assert not made.parts[0].recorded
        assert made.notes == (
            "histories would take 1.3 GiB, over 1.0 GiB: metrics only are kept (`--histories all` keeps them; any case "
            "can be run again alone: `--case '#0'`)",
        )

    def test_what_is_asked_for(self, here: Path) -> None:
        assert campaign.prepare(plans.plan(plans.gains(400_000)), histories="all").parts[0].recorded
        archive = batch.run(plans.plan(plans.gains(5)), output="a.h5", histories="none")
        with archive.open() as data:
            assert "q" not in data and "recorded_case" not in data.sizes
            assert np.isfinite(data.volts).all()

    def test_memory_is_bounded_by_batches(self, here: Path) -> None:
        [section] = campaign.values_sections(campaign.prepare(plans.plan(plans.gains(400_000)), histories="all"))
        assert section.most * section.prepared.experiment.structure.history_bytes <= tasks.MOST_BYTES
        assert section.most % 32 == 0

    def test_the_size_said_is_about_the_size_written(self, here: Path) -> None:
        made = campaign.prepare(plans.plan(plans.gains(500)))
        perform(made)
        assert 0.7 < made.bytes / made.output.stat().st_size < 1.3  # strings and chunk indices are estimates


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

    def test_what_another_run_is_writing(self, here: Path) -> None:
        from batch.archive.sink import Sink, temporary_of

        other = Sink(temporary_of(Path("a.h5")))
        assert self.run("a.h5") == (
            "error[E307]: cannot write a.h5: another run is writing it now\n"
            " = help: `met status a.h5` says how far it is\n"
            " = help: wait until it is done, or give another name with `-o`\n"
            "\n1 error\n"
        )  # fmt: skip
        other.remove()
        other.close()

    def test_no_such_folder(self, here: Path) -> None:
        assert self.run("no/such/a.h5") == (
            "error[E305]: cannot write no/such/a.h5: no/such does not exist\n"
            " = help: make it first: `mkdir -p no/such`\n"
            "\n1 error\n"
        )  # fmt: skip

    def test_a_file_where_a_folder_should_be(self, here: Path) -> None:
        (here / "file").write_text("x")
        assert self.run("file/a.h5") == "error[E305]: cannot write file/a.h5: file is a file, not a folder\n\n1 error\n"

    def test_somebody_elses_file_is_not_written_over(self, here: Path) -> None:
        (here / "two_link.ic").write_text("run nominal { }")
        assert self.run("two_link.ic") == (
            "error[E305]: two_link.ic exists and is no archive of MET: it is not written over\n"
            " = help: give another name with `-o`, or remove the file\n"
            "\n1 error\n"
        )  # fmt: skip

    def test_a_place_that_refuses_files(self, here: Path) -> None:
        assert self.run("/proc/a.h5") == (
            "error[E305]: cannot write /proc/a.h5: no such file or directory\n"
            " = help: nothing was kept; `-o FILE` names another place\n"
            "\n1 error\n"
        )  # fmt: skip

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
            "error[E306]: cannot write a.h5: it needs about 79.5 KiB until it is whole, and the disk has 4.9 KiB left\n"
            " = help: `--histories none` keeps metrics only; `--float32`, fewer signals in `record`, or a slower "
            "`rates.record`, take less\n"
            "\n1 error\n"
        )  # fmt: skip


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

    def test_an_archive_is_written_over_by_the_next(self, here: Path) -> None:
        batch.run(plans.plan(plans.gains(3)), output="a.h5")
        batch.run(plans.plan(plans.gains(4)), output="a.h5")
        with batch.open("a.h5") as data:
            assert data.sizes["case"] == 4

    def test_what_a_killed_run_left_is_swept_up_by_the_next(self, here: Path) -> None:
        (here / ".a.h5.tmp").write_bytes(b"half an archive" * 100_000)
        (here / ".a.h5.run.json.tmp").write_bytes(b"{")
        batch.run(plans.plan(plans.gains(3)), output="a.h5")
        fresh = (here / "a.h5").read_bytes()
        assert sorted(path.name for path in here.iterdir()) == ["a.h5", "a.h5.run.json"]
        batch.run(plans.plan(plans.gains(3)), output="a.h5")
        assert (here / "a.h5").read_bytes() == fresh

    def test_a_run_that_starts_while_another_writes_is_told_and_the_other_ends_well(
        self, here: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from met import run

        said = []

        def meanwhile(*arguments: Any, **options: Any) -> Any:
            monkeypatch.setattr(run, "run", plans.answer)
            with pytest.raises(Problem) as caught:
                perform(second)
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

    def test_the_default_name_is_the_same_from_python(self, here: Path) -> None:
        import ic

        def output(select: Any, **options: Any) -> str:
            return campaign.prepare(ic.compile("two_link.ic", select=select), **options).output.name

        assert output(None) == "two_link.h5"
        assert output(["gains"]) == output("gains") == "two_link.gains.h5"
        assert output("all") == "two_link.all.h5"
        assert output("all", experiments=["gains"]) == "two_link.gains.h5"
        plan_file.write(ic.compile("two_link.ic", select=["gains"]), here / "p.json")
        assert batch.run("p.json", cases=["#3"]).path == Path("two_link.gains.case3.h5")

    def test_what_is_no_plan_is_named(self, here: Path) -> None:
        with pytest.raises(TypeError) as caught:
            batch.run("gantry.ic")
        said = "batch.run takes a plan, and 'gantry.ic' is none: batch.run(ic.compile('gantry.ic'))"
        assert str(caught.value) == said
        with pytest.raises(TypeError) as caught:
            batch.run(7)  # type: ignore[arg-type]
        assert str(caught.value) == "batch.run takes a plan, as ic.compile gives it, and not int"

    def test_a_case_that_is_run_again_does_not_take_its_sweeps_place(self, here: Path) -> None:
        def output(*cases: str | int) -> str:
            return campaign.prepare(plans.plan(plans.gains(9)), experiments=["gains"], cases=cases).output.name

        assert output("#7") == "two_link.gains.case7.h5"
        assert output("#7", 2) == "two_link.gains.case2-7.h5"
        assert output(*range(8)) == "two_link.gains.cases.h5"
        assert output(*range(9)) == "two_link.gains.h5"


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


@pytest.mark.usefixtures("engine")
class TestWhatIsSaid:
    def plan(self, here: Path, *experiments: Any) -> str:
        plan_file.write(plans.plan(*experiments), here / "p.json")
        return "p.json"

    def test_a_single_case(self, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run_and_tell(self.plan(here, plans.nominal()), no_picture=True)
        said = capsys.readouterr().out
        size = size_text((here / "two_link.h5").stat().st_size)
        assert without_times(said) == (
            "nominal: 1 case, 2 s in 50 steps of 40 ms, modified_euler\n"
            "  histories: q, qd, tau, shoulder.servo.voltage; 51 rows, 2.8 KiB a case\n"
            "writing two_link.h5, about 56.8 KiB\n"
            "\n"
            "the case reached its end, TIME of computing\n"
            "  settle      5 s  settling_time of shoulder.qd\n"
            "  volts   5.758 V  max of shoulder.servo.voltage\n"
            "  require settle < 10 s  met\n"
            "\n"
            f"archive  two_link.h5  ({size})\n"
            "next     met show two_link.h5\n"
        )

    def test_a_sweep_that_misses_says_why_it_ends_with_1(self, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert not run_and_tell(self.plan(here, plans.gains(20)), no_picture=True)
        said = capsys.readouterr().out.splitlines()
        assert "  settle    2.5   3.878  8.636 s  settling_time of shoulder.qd; infinite in 1" in said
        assert "  require settle < 10 s  met by 19 of 20 (95 %)" in said
        assert said[-1] == "exit 1: not met everywhere: settle < 10 s, volts < 5 V"

    def test_quiet_says_nothing(self, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
        run_and_tell(self.plan(here, plans.nominal()), quiet=True, no_picture=True)
        assert capsys.readouterr() == ("", "")

    def test_json(self, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
        run_and_tell(self.plan(here, plans.gains(20)), json=True, no_picture=True)
        said = json.loads(capsys.readouterr().out)
        assert said["ok"] is False
        assert said["archive"] == "two_link.h5"
        assert said["experiments"][0]["metrics"][0]["infinite"] == 1
        assert said["experiments"][0]["requirements"][0] == {
            "text": "settle < 10 s",
            "met": 19,
            "missed": 1,
            "unknown": 0,
            "no_value": 0,
        }

    def test_the_picture_lies_beside_the_archive(self, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
        run_and_tell(self.plan(here, plans.nominal()))
        assert "picture  two_link.png\n" in capsys.readouterr().out
        assert (here / "two_link.png").read_bytes().startswith(b"\x89PNG")

    def test_a_picture_of_one_of_several_runs_says_of_which(
        self, here: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        run_and_tell(self.plan(here, plans.nominal(), replace(plans.nominal(), name="other")))
        told = "picture  two_link.png, of nominal alone: `met plot two_link.h5 --run other` draws another\n"
        assert told in capsys.readouterr().out

    def test_a_picture_of_somebody_elses_is_left_alone(self, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
        (here / "two_link.png").write_bytes(b"\x89PNG mine")
        run_and_tell(self.plan(here, plans.nominal()))
        assert (
            "picture  none: two_link.png exists and was not drawn by MET: it is not written over\n"
            in capsys.readouterr().out
        )
        assert (here / "two_link.png").read_bytes() == b"\x89PNG mine"


    def test_a_metric_without_a_value_is_not_called_a_failure(
        self, here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from met import run

        def unknown(*arguments: Any, **options: Any) -> Any:
            answer = plans.answer(*arguments, **options)
            answer.metrics["settle"][0] = np.nan
            return answer

        monkeypatch.setattr(run, "run", unknown)
        run_and_tell(self.plan(here, plans.nominal()), no_picture=True)
        assert "  require settle < 10 s  not known: its metric has no value here\n" in capsys.readouterr().out
        run_and_tell(self.plan(here, plans.gains(4)), no_picture=True)
        said = capsys.readouterr().out
        assert "  require settle < 10 s  met by 3 of 4 (75 %), not known of 1 (its metric has no value in 1)\n" in said

    def test_names_that_look_like_options_are_quoted(self, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
        run_and_tell(self.plan(here, plans.nominal()), output="-x y.h5", no_picture=True)
        assert "next     met show './-x y.h5'\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["p.json", "-D", "X=1"], "-D is for decks: `p.json` is a plan, whose macros are expanded already"),
        (["p.json", "-I", "."], "-I is for decks: `p.json` is a plan, whose macros are expanded already"),
        (["two_link.ic", "nominal", "--all"], "--all and `nominal` exclude each other"),
    ],
)
@pytest.mark.parametrize("command", ["run", "plan"])
def test_options_that_clash_or_do_nothing_are_refused(
    here: Path, capsys: pytest.CaptureFixture[str], command: str, words: list[str], said: str
) -> None:
    from met import cli

    plan_file.write(plans.plan(), here / "p.json")
    assert cli.main([command, *words]) == cli.BAD_INPUT
    assert said in capsys.readouterr().err
    assert [path.name for path in here.iterdir()] == ["p.json"]


@pytest.mark.parametrize("case", ["#²", "#" + "9" * 5000, "#99999999999999999999", "#-1", "#"])
def test_odd_positions_are_no_cases(here: Path, case: str) -> None:
    with pytest.raises(Problem) as caught:
        campaign.prepare(plans.plan(plans.gains(3)), cases=[case])
    assert caught.value.diagnostics[0].code == "E311"


def without_times(text: str) -> str:
    import re

    return re.sub(r"[\d.]+ s of computing\n", "TIME of computing\n", text)


class Terminal:
    """A stream that remembers what was written."""

    def __init__(self, live: bool) -> None:
        self.live, self.text = live, ""

    def isatty(self) -> bool:
        return self.live

    def write(self, text: str) -> None:
        self.text += text

    def flush(self) -> None:
        pass


class TestProgress:
    def bar(self, live: bool) -> tuple[Terminal, Bar, list[float]]:
        stream, now = Terminal(live), [0.0]
        return stream, Bar(stream, lambda: now[0]), now  # type: ignore[arg-type]

    def test_a_status_line(self) -> None:
        assert status("gains", 250, 1000, 2.0, bar=False) == "gains   25 %  250 of 1,000 cases  125 cases/s  6.0 s left"
        line = status("gains", 250, 1000, 2.0, bar=True)
        assert line == "gains  ██████                  ▏  25 %  250 of 1,000 cases  125 cases/s  6.0 s left"

    def test_what_is_over_at_once_shows_nothing(self) -> None:
        for live in (True, False):
            stream, bar, now = self.bar(live)
            bar.begin("gains", 100)
            now[0] = 0.2
            bar.advance(50)
            bar.advance(100)
            bar.end()
            assert stream.text == ""

    def test_a_terminal_gets_a_bar_that_is_wiped_away(self) -> None:
        stream, bar, now = self.bar(True)
        bar.begin("gains", 100)
        now[0] = 1.0
        bar.advance(50)
        bar.advance(51)  # at the same instant: not drawn again
        bar.end()
        assert stream.text.count("\r") == 2
        assert stream.text.endswith("\r\x1b[K")

    def test_a_log_gets_a_plain_line_every_five_seconds(self) -> None:
        stream, bar, now = self.bar(False)
        bar.begin("gains", 1000)
        for tick in range(1, 120):
            now[0] = 0.1 * tick
            bar.advance(tick)
        assert stream.text.splitlines() == [
            "gains    5 %  50 of 1,000 cases  10 cases/s  1 min 35 s left",
            "gains   10 %  100 of 1,000 cases  10 cases/s  1 min 30 s left",
        ]

    @pytest.mark.parametrize(
        ("seconds", "said"), [(0.04, "0.0 s"), (42.4, "42 s"), (95, "1 min 35 s"), (3725, "1 h 2 min")]
    )
    def test_durations(self, seconds: float, said: str) -> None:
        assert duration(seconds) == said


class TestTheRealEngine:
    """The plan made by hand, run by the engine: what was faked above is what the engine gives."""

    def test_bits_do_not_depend_on_the_batch(self, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        plan = plans.plan(plans.gains(9))
        found = []
        for cases in (9, 2):
            monkeypatch.setattr(tasks, "MOST_BYTES", cases * plans.gains(1).structure.history_bytes)
            found.append(batch.run(plan, output="a.h5", fresh=True).path.read_bytes())
        assert found[0] == found[1]

    @pytest.mark.parametrize("name", ["failure", "friction.splits", "metrics.kp", "q"])
    def test_a_coordinate_and_a_metric_of_the_engines_own_names(self, here: Path, name: str) -> None:
        from dataclasses import replace

        from met import run
        from tests.batch.test_archive import renamed

        experiment = renamed(plans.gains(3), "gearbox.kp", name)
        uses = (replace(experiment.structure.metrics[0], name="kp"),)
        structure = replace(experiment.structure, metrics=uses)
        parameters = {p.replace("metrics.settle.", "metrics.kp."): q for p, q in experiment.parameters.items()}
        experiment = replace(experiment, structure=structure, parameters=parameters, requirements=())
        found, plain = run.run(experiment), run.run(plans.gains(3))
        np.testing.assert_array_equal(found.coordinates[name], plain.coordinates["gearbox.kp"])
        np.testing.assert_array_equal(found.metrics["kp"], plain.metrics["settle"])
        assert not found.status.any()

    def test_a_case_run_alone_is_the_case_of_the_sweep(self, here: Path) -> None:
        plan = plans.plan(plans.gains(9))
        with (
            batch.run(plan, output="all.h5").open() as whole,
            batch.run(plan, output="one.h5", cases=["#5"]).open() as one,
        ):
            np.testing.assert_array_equal(one.qd.values[0], whole.qd.values[5])
            assert one.case_id.values[0] == whole.case_id.values[5]


def test_where_it_will_be_written_is_said_once_there_is_a_kernel(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from met import cli
    from met import run as engine
    from met.diagnostic import error

    def refuse(*_: object) -> None:
        raise Problem(error("E200", "a model asks for the truth of a recorded condition"))

    monkeypatch.setattr(engine, "prepare", refuse)
    plan_file.write(plans.plan(plans.nominal()), Path("p.json"))
    assert cli.main(["run", "p.json", "-o", "a.h5"]) == 2
    assert "writing" not in capsys.readouterr().out
    assert not Path("a.h5").exists()
