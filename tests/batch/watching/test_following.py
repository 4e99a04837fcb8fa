"""`met view DECK`: a save is a new page, a mistake stands beside the last good one, and in the end nothing is left."""

from __future__ import annotations

import base64
import json
import os
import pty
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import ic
from batch.watching import answers
from batch.watching.answers import WatchedDeck
from batch.watching.board import Board
from batch.watching.following import _Loop
from ic.sweeps import effects
from met import cli
from met.analysis.audit import idle_inputs
from met.analysis.memo import AnalysisMemo
from met.messages.render import render
from met.plan import Experiment
from met.run import prepare, run
from tests.batch.watching.watched import DECK, View, replace, started, viewing, write_deck

WATCHED = ("-q",)


def page_data(view: View) -> dict[str, object]:
    """What the script of the page that is shown is given."""
    data: dict[str, object] = json.loads(view.ask(f"page/{view.state['page']}").body)
    return data


def unexpected(defect: Exception) -> str:
    raise AssertionError from defect


def doubles(text: object) -> list[float]:
    """Numbers of which the page has the bytes."""
    found: list[float] = np.frombuffer(base64.b64decode(str(text)), "<f8").tolist()
    return found


@pytest.mark.release
def test_each_save_is_a_new_page_with_the_cases_that_met_run_has(tmp_path: Path) -> None:
    deck = write_deck(tmp_path)
    with viewing(deck, *WATCHED) as view:
        state = view.whole(page=1)
        assert (state["run"], state["names"], state["broken"]) == ("tuned", ["brief", "tuned"], False)
        replace(deck, "0.01,", "0.015,")
        view.whole(page=2)
        of_deck = view.numbers()
        replace(tmp_path / "length.ic", "2 s", "3 s")  # a file that it includes
        view.whole(page=3)
        assert page_data(view)["source"] == "sweep"
        of_file = view.numbers()
        for found, length in ((of_deck, "2 s"), (of_file, "3 s")):
            (tmp_path / "length.ic").write_text(f"let length = {length};\n")
            (experiment,) = ic.compile(deck).experiments
            expected = run(prepare(experiment), record=False)
            assert doubles(found["metrics"][0]) == expected.metrics["volts"].tolist()
            assert (found["status"], found["done"]) == ([0] * 6, 6)
            missed = int((~expected.met["volts < 3.55 V"]).sum())
            assert found["verdicts"] == [["volts < 3.55 V", 6 - missed, missed, 0]]
            points = found["cases"]["overview"]
            assert points["total"] == 6 and len(points["maps"]) == 1
        assert doubles(of_deck["metrics"][0]) != doubles(of_file["metrics"][0])


@pytest.mark.slow
def test_a_mistake_is_told_as_met_check_tells_it_beside_the_page_until_it_is_mended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    deck = write_deck(tmp_path)
    monkeypatch.chdir(tmp_path)
    with viewing("deck.ic", *WATCHED, cwd=tmp_path) as view:
        view.whole(page=1)
        replace(deck, "gearbox.kp = [0.005", "gearbox.kq = [0.005")
        state = view.until(broken=True, doing="")
        found = ic.check("deck.ic", select=None)
        assert state["messages"] == render(found.diagnostics, found.sources) and "deck.ic:9:10" in state["messages"]
        assert (state["page"], state["run"]) == (1, "tuned") and state["tried"] > state["saved"]
        replace(deck, "gearbox.kq = [0.005", "gearbox.kp = [0.006")
        state = view.whole(page=2)
        assert (state["broken"], state["messages"]) == (False, "")


@pytest.mark.release
def test_what_changes_no_number_changes_no_page(tmp_path: Path) -> None:
    deck = write_deck(tmp_path)
    with viewing(deck, *WATCHED) as view:
        saved = view.whole(page=1)["saved"]
        replace(deck, "    require", "    // no more volts than that\n    require")
        while view.until(doing="")["saved"] == saved:
            view.hear()
        assert (view.state["page"], view.state["numbers"]) == (1, 1)


@pytest.mark.slow
def test_a_file_that_was_missing_is_noticed_when_it_comes(tmp_path: Path) -> None:
    deck = write_deck(tmp_path)
    (tmp_path / "length.ic").rename(tmp_path / "away")
    with viewing(deck, *WATCHED) as view:
        state = view.until(broken=True, doing="")
        assert "error[D005]" in state["messages"] and state["page"] == 0
        (tmp_path / "away").rename(tmp_path / "length.ic")
        view.whole(page=1)


SEVERAL = DECK.replace("default ", "") + "sweep ways of brief { vary integrator = [modified_euler, rk4]; }\n"


@pytest.mark.release
def test_of_several_runs_one_is_chosen_on_the_page_or_named(tmp_path: Path) -> None:
    deck = write_deck(tmp_path, SEVERAL)
    with viewing(deck, *WATCHED) as view:
        state = view.until(broken=True, doing="")
        assert "error[D162]" in state["messages"] and state["names"] == ["brief", "tuned", "ways"]
        own = f"http://127.0.0.1:{view.port}"
        assert view.ask("choose", method="POST", body="run=brief", Origin=own).status == 200
        assert view.whole(page=1)["run"] == "brief"
        assert view.ask("choose", method="POST", body="run=ways", Origin=own).status == 200
        state = view.whole(page=2)
        assert state["groups"] == ["ways.modified_euler", "ways.rk4"] and state["group"] == "ways.modified_euler"
        assert view.ask("choose", method="POST", body="run=ways&group=ways.rk4", Origin=own).status == 200
        assert view.whole(page=3)["group"] == "ways.rk4"
        replace(deck, "3.55", "3.5")
        assert view.whole(page=4)["group"] == "ways.rk4"  # it stays chosen
    with viewing(deck, "tuned", *WATCHED) as view:
        assert view.whole(page=1)["run"] == "tuned"


@pytest.mark.release
def test_what_is_set_on_the_command_line_counts_each_time(tmp_path: Path) -> None:
    deck = write_deck(tmp_path)
    with viewing(deck, "brief", "--vary", "gearbox.kp=[0.01, 0.02] V*s/rad", "-D", "SPARE", *WATCHED) as view:
        view.whole(page=1)
        replace(deck, "3.55", "3.5")
        view.whole(page=2)
        assert len(view.numbers()["status"]) == 2


@pytest.mark.release
def test_of_many_cases_the_first_are_shown_and_run(tmp_path: Path) -> None:
    deck = write_deck(tmp_path, DECK.replace("[0.005, 0.01, 0.02] V", "linspace(0.005, 0.02, 600) V"))
    with viewing(deck, *WATCHED) as view:
        view.whole(page=1)
        found = view.numbers()
        assert (found["done"], len(found["status"]), set(found["status"])) == (1000, 1000, {0})
        assert "of 1,200 cases these are the first 1,000" in view.ask("page/1").body.decode()


FAILING = """\
arm rail {
    link cart { mass = 1 kg; shape = box(size = [0.1, 0.1, 0.1] m); }
    joint slide prismatic { parent = base; child = cart; axis = x; }
}
run it {
    arm = rail;  initial { slide.qd = 1 m/s; }
    environment { drag = joint_damping { sliding = 50 N*s/m; } }
    rates { dynamics = 100 Hz; record = 100 Hz; }  duration = 3200 ms;
    record = [qd];  metric late = final { of = slide.qd; }  require late < 1 m/s;
}
default sweep damped of it { vary environment.drag.sliding = [50, 220] N*s/m; }
"""


@pytest.mark.release
def test_cases_that_fail_are_told_with_their_cause(tmp_path: Path) -> None:
    deck = write_deck(tmp_path, FAILING)
    with viewing(deck, *WATCHED) as view:
        view.whole(page=1)
        found = view.numbers()
        assert (found["failed"], found["status"]) == (1, [0, 1])
        [[count, cause, first]] = found["failures"]
        assert (count, first) == (1, 1) and "slide" in cause
        assert found["verdicts"] == [["late < 1 m/s", 1, 0, 1]]


SEARCH = DECK + "search hardest of brief { gearbox.kp = between(0.005, 0.02) V*s/rad; maximise volts; at_most = 20; }\n"


@pytest.mark.release
def test_what_met_check_says_at_the_start_stands_in_the_terminal_too(tmp_path: Path) -> None:
    deck = write_deck(tmp_path, DECK.replace("volts < 3.55 V", "vols < 3.55 V"))
    with viewing("deck.ic", "brief", cwd=tmp_path) as view:
        view.until(broken=True, doing="")
        replace(deck, "vols <", "volts <")  # it is watched on
        view.until(page=1, broken=False)
        view.process.terminate()
        _, err = view.process.communicate(timeout=60)
    found = err.partition("\n")[2]
    (tmp_path / "deck.ic").write_text(DECK.replace("volts < 3.55 V", "vols < 3.55 V"))
    assert found.startswith("error[D") and "deck.ic:6:13" in found and found.count("error[") == 1


@pytest.mark.slow
def test_of_a_search_it_is_said_that_its_cases_are_not_known_yet(tmp_path: Path) -> None:
    write_deck(tmp_path, SEARCH)
    with viewing("deck.ic", "hardest", *WATCHED, cwd=tmp_path) as view:
        state = view.until(broken=True, doing="")
        assert state["messages"] == (
            "error[E476]: `hardest` is a search: which cases it has is known when it has run\n"
            " = help: `met run deck.ic hardest -o a.h5`, then `met view a.h5`\n"
            "\n1 error\n"
        )


@pytest.mark.slow
def test_a_deck_that_has_no_run_says_so_on_the_page(tmp_path: Path) -> None:
    (tmp_path / "deck.ic").write_text("let a = 1 m;\n")
    with viewing(tmp_path / "deck.ic", *WATCHED) as view:
        state = view.until(broken=True, doing="")
        assert state["messages"].startswith("error[D161]: this deck has no run\n") and state["page"] == 0


# Several at once, and the end


@pytest.mark.slow
def test_of_a_deck_that_is_saved_again_and_again_the_cases_of_one_are_run_at_a_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    deck = write_deck(tmp_path)
    begun, let = threading.Semaphore(0), threading.Event()

    def endless(*_: object) -> Iterator[object]:
        begun.release()
        assert let.wait(60)
        yield from ()

    monkeypatch.setattr(answers, "run_cases", endless)
    board = Board("deck.ic")
    loop = _Loop(WatchedDeck(str(deck), deck), "brief", board, unexpected)
    loop._once()
    assert begun.acquire(timeout=60)
    for limit in ("3.5", "3.4", "3.3"):
        deck.write_text(DECK.replace("3.55", limit))
        loop._once()
    assert not begun.acquire(timeout=1)
    let.set()
    assert begun.acquire(timeout=60) and not begun.acquire(timeout=1)  # of the last one alone
    loop.give_up(60)


LONG = """\
arm wheel { link disk { mass = 1 kg; shape = cylinder(radius = 0.1 m, length = 0.1 m, along = z); }
    joint turn revolute { parent = base; child = disk; axis = z; } }
run spun {
    arm = wheel;  initial { turn.qd = 1 rad/s; }  rates { dynamics = 10 kHz; record = 1 Hz; }
    duration = 100000 s;  record = [qd];  metric late = final { of = turn.qd; }
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 12])
def test_a_save_ends_a_long_case_of_the_deck_before_it(count: int) -> None:
    prepared = prepare(
        ic.compile(
            text=LONG + "sweep many of spun { vary initial.turn.qd = linspace(1, 2, 12) rad/s; }\n",
            select=["spun" if count == 1 else "many"],
        ).experiments[0]
    )
    prepared.kernel  # noqa: B018 - compiled before it is asked to end
    asked = threading.Event()
    threading.Timer(0.5, asked.set).start()
    assert list(answers.run_cases(prepared, asked.is_set)) == []  # a billion steps, which would take a minute or more


@pytest.mark.slow
def test_a_defect_is_told_in_terminal_and_page_and_the_next_save_is_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    deck = write_deck(tmp_path)
    board = Board("deck.ic")
    told = partial(cli.confess, arguments=["view", "deck.ic"], verbose=False)
    loop = _Loop(WatchedDeck(str(deck), deck), "brief", board, told)
    assert not loop._sound() and board.after(0, 0.0)[1]["page"] == 1  # type: ignore[index]

    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("of all things")

    compiled = answers.compiled
    monkeypatch.setattr(answers, "compiled", broken)
    assert not loop._sound()
    state = board.after(0, 0.0)[1]
    assert state is not None and (state["page"], state["broken"], state["fault"]) == (1, True, True)
    words = state["messages"]
    assert re.fullmatch(
        r"met: this is a defect of MET, not of what you gave it: ZeroDivisionError: of all things\. "
        r"The traceback is in (\S+)\. Please report it together with the deck and the command, `met view deck\.ic`\.",
        words,
    )  # fmt: skip
    assert capsys.readouterr().err == f"{words}\n"
    monkeypatch.setattr(answers, "compiled", compiled)
    assert not loop._sound()
    state = board.after(0, 0.0)[1]
    assert state is not None and (state["broken"], state["fault"], state["messages"]) == (False, False, "")

    monkeypatch.setattr(answers, "run_cases", broken)  # and in the thread that runs the cases
    deck.write_text(DECK.replace("3.55", "3.5"))
    assert not loop._sound()
    assert loop._cases is not None
    loop._cases.join(60)
    state = board.after(0, 0.0)[1]
    assert state is not None and state["fault"] and "ZeroDivisionError" in state["messages"]
    assert "ZeroDivisionError" in capsys.readouterr().err
    monkeypatch.setattr(answers, "compiled", lambda *_: (_ for _ in ()).throw(PermissionError(13, "no", "deck.ic")))
    assert not loop._sound()  # what is the machine's is none of MET's
    state = board.after(0, 0.0)[1]
    assert state is not None and "error[E338]: `deck.ic`: no" in state["messages"]
    loop.give_up(60)


@pytest.mark.release
def test_two_views_of_one_deck_and_two_pages_of_one_view_follow_it(tmp_path: Path) -> None:
    deck = write_deck(tmp_path)
    with viewing(deck, *WATCHED) as one, viewing(deck, "brief", *WATCHED) as other:
        again = View(one.process, one.address)
        views = (one, other, again)
        for view in views:
            view.whole(page=1)
        assert len({one.port, other.port}) == 2 and one.path != other.path
        replace(deck, "3.55", "3.5")
        for view in views:
            view.whole(page=2)
        assert [view.state["run"] for view in views] == ["tuned", "brief", "tuned"]


@pytest.mark.release
@pytest.mark.parametrize(("sent", "status"), [(signal.SIGINT, 0), (signal.SIGTERM, 143), (signal.SIGHUP, -1)])
def test_it_ends_when_it_is_told_to_without_a_word(tmp_path: Path, sent: signal.Signals, status: int) -> None:
    deck = write_deck(tmp_path)
    with viewing(deck, *WATCHED) as view:
        view.until(page=1)  # its cases are about to be run
        view.process.send_signal(sent)
        out, err = view.process.communicate(timeout=60)
        assert (out, err, view.process.returncode) == ("", "", status)


@pytest.mark.slow
def test_it_ends_with_its_terminal(tmp_path: Path) -> None:
    deck = write_deck(tmp_path)
    terminal, own = pty.openpty()
    command = [sys.executable, "-m", "met.cli", "view", str(deck)]
    script = "import fcntl, os, sys, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); os.execv(sys.argv[1], sys.argv[1:])"
    with subprocess.Popen(
        [sys.executable, "-c", script, *command], stdin=own, stdout=own, stderr=own, start_new_session=True
    ) as process:
        os.close(own)
        said = b""
        while b"Ctrl-C ends it" not in said:
            said += os.read(terminal, 1000)
        assert said.startswith(b"http://127.0.0.1:")
        os.close(terminal)
        assert process.wait(60) == -signal.SIGHUP


@pytest.mark.release
def test_killed_in_the_middle_it_leaves_nothing_and_its_port_is_free(tmp_path: Path) -> None:
    deck = write_deck(tmp_path, DECK.replace("[0.005, 0.01, 0.02] V", "linspace(0.005, 0.02, 500) V"))
    work = tmp_path / "tmp"
    work.mkdir()
    before = sorted(tmp_path.rglob("*"))
    with viewing(deck, *WATCHED, cwd=tmp_path, env={"TMPDIR": str(work)}) as view:
        view.until(page=1)
        view.process.kill()
        view.process.wait(60)
        assert sorted(tmp_path.rglob("*")) == before
        port = view.port
    with viewing(deck, "--port", str(port), *WATCHED) as view:
        assert view.port == port


# Mistakes of usage


@pytest.mark.slow
def test_a_port_that_is_taken_is_a_mistake_that_is_told(tmp_path: Path) -> None:
    deck = write_deck(tmp_path)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with started(deck, "--port", str(port)) as process:
            out, err = process.communicate(timeout=60)
    assert (out, process.returncode) == ("", 2)
    assert err == (
        f"error[E477]: cannot serve on port {port} of 127.0.0.1: address already in use\n"
        " = help: leave `--port` out: a free one is taken\n"
        "\n1 error\n"
    )


def test_what_is_no_deck_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_deck(tmp_path)
    (tmp_path / "page.html").write_text("<p>\n")
    (tmp_path / "empty.txt").write_text("")
    read_as = "is read as a deck: its name does not end like an archive's (.h5, .hdf5, .nc)\n\n1 error\n"
    write = " = help: write `run NAME { ... }`"
    for words, said in (
        (["deck.ic", "brif"], "error[D164]: no run or sweep `brif` in this deck\n = help: did you mean `brief`?\n"),
        (["page.html"], f" = help: page.html {read_as}"),
        (["empty.txt"], f"error[D161]: this deck has no run\n{write}\n = help: empty.txt {read_as}"),
        (["dek.ic"], "error[D173]: no deck `dek.ic`\n = help: did you mean `deck.ic`?\n"),
        (["plan.json"], "`plan.json` is a plan: `met run plan.json` runs it, and `met view` takes the archive\n"),
        (["deck.ic", "-o", "a.html"], "-o is for archives: the page of the deck `deck.ic` is served; "),
        (["a.h5", "--port", "8001"], "--port is for decks: the page of the archive `a.h5` is a file\n"),
        (["a.h5", "--set", "a=1"], "--set is for decks: `a.h5` is an archive, of what was run\n"),
        (["deck.ic", "--port", "0"], "Invalid value for '--port': 0 is not in the range 1<=x<=65535.\n"),
    ):
        assert cli.main(["view", *words]) == 2
        assert said in capsys.readouterr().err


def test_what_has_an_effect_is_asked_again_only_of_another_program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    deck = tmp_path / "deck.ic"
    text = "#include <two_link.ic>\nrun mine like nominal { with links.upper.mass = 50 kg; }\n"
    watched = WatchedDeck(str(deck), deck)
    found: list[tuple[str, ...]] = []

    def counted(experiment: Experiment) -> tuple[str, ...]:
        found.append(idle_inputs(experiment))
        return found[-1]

    monkeypatch.setattr(effects, "without_effect", counted)
    memo = AnalysisMemo()
    for changed, asked in (("50 kg", 1), ("51 kg", 1), ("0.5 kg", 1), ("51 kg; integrator = rk4", 2)):
        deck.write_text(text.replace("50 kg", changed), encoding="utf-8")
        answer = answers.compiled(watched, "mine", None, memo)
        memo = AnalysisMemo(memo.so_far)
        assert answer.experiment is not None and not answer.messages and len(found) == asked
