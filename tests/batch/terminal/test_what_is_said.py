"""What `met run` says: before, meanwhile, and at the end."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from batch.campaigns.status import duration
from batch.terminal.progress import Bar, status
from batch.terminal.running import run_and_tell
from ic.printing.columns import size as size_text
from met.diagnostic import Problem
from met.plan import file as plan_file
from tests.batch import plans


@pytest.mark.usefixtures("engine")
class TestWhatIsSaid:
    def plan(self, here: Path, *experiments: Any) -> str:
        plan_file.write(plans.plan(*experiments), here / "p.json")
        return "p.json"

    @pytest.mark.slow
    def test_a_single_case(self, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run_and_tell(self.plan(here, plans.nominal()), no_picture=True)
        said = capsys.readouterr().out
        size = size_text((here / "two_link.h5").stat().st_size)
        assert without_times(said) == (
            "nominal: 1 case, 2 s in 50 steps of 40 ms, modified_euler\n"
            "  histories: q, qd, tau, shoulder.servo.voltage; 51 rows, 2.8 KiB a case\n"
            "writing two_link.h5, about 64.2 KiB\n"
            "\n"
            "the case reached its end, TIME of computing\n"
            "  settle      5 ± 0.01 s  settling_time of shoulder.qd\n"
            "  volts   5.758 ± 0    V  max of shoulder.servo.voltage\n"
            "  ± by the step: 1 case at half and a quarter of the step\n"
            "  require settle < 10 s  met\n"
            "\n"
            f"archive  two_link.h5  ({size})\n"
            "next     met show two_link.h5\n"
        )

    @pytest.mark.slow
    def test_a_sweep_that_misses_says_why_it_ends_with_1(self, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert not run_and_tell(self.plan(here, plans.gains(20)), no_picture=True)
        said = capsys.readouterr().out.splitlines()
        assert "  settle    2.5   3.878  8.636 s  settling_time of shoulder.qd; infinite in 1" in said
        assert "  require settle < 10 s  met by 19 of 20 (95 %)" in said
        assert said[-1] == "exit 1: not met everywhere: settle < 10 s, volts < 5 V"

    @pytest.mark.slow
    def test_quiet_says_nothing(self, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
        run_and_tell(self.plan(here, plans.nominal()), quiet=True, no_picture=True)
        assert capsys.readouterr() == ("", "")

    @pytest.mark.slow
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
            "evidence": [],
        }

    @pytest.mark.slow
    def test_the_picture_lies_beside_the_archive(self, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
        run_and_tell(self.plan(here, plans.nominal()))
        assert "picture  two_link.png\n" in capsys.readouterr().out
        assert (here / "two_link.png").read_bytes().startswith(b"\x89PNG")

    @pytest.mark.slow
    def test_a_picture_of_one_of_several_runs_says_of_which(
        self, here: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        run_and_tell(self.plan(here, plans.nominal(), replace(plans.nominal(), name="other")))
        told = "picture  two_link.png, of nominal alone: `met plot two_link.h5 --run other` draws another\n"
        assert told in capsys.readouterr().out

    @pytest.mark.slow
    def test_a_picture_of_somebody_elses_is_left_alone(self, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
        (here / "two_link.png").write_bytes(b"\x89PNG mine")
        run_and_tell(self.plan(here, plans.nominal()))
        assert (
            "picture  none: two_link.png exists and was not drawn by MET: it is not written over\n"
            in capsys.readouterr().out
        )
        assert (here / "two_link.png").read_bytes() == b"\x89PNG mine"

    @pytest.mark.slow
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

    @pytest.mark.slow
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
