"""`met bed probe`: who is at a port and what it says of itself; nothing is armed."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from batch.beds.probe import ASKED, ProbeResult, _line
from hw.bed import Capability
from hw.lines import serial_port
from met import cli
from tests.batch.beds.listening import DECK, HELLO, READ, STOP, Listening
from tests.hw.device import DEAD, DEADMAN, STOPPED, Device

pytestmark = pytest.mark.alone

__all__ = ["DECK"]  # deck.ic


@pytest.fixture
def probe(met_bed: Callable[..., tuple[int, str, str]]) -> Callable[..., tuple[int, str, str]]:
    """`met bed probe ...`: exit status, what was said, and what was complained of."""
    return partial(met_bed, "probe")


def test_an_emulated_bed(probe: Callable[..., tuple[int, str, str]]) -> None:
    assert probe("deck.ic", "wired", "--port", "emulated") == (
        cli.YES,
        """\
bed `emulated` at emulated
  firmware  0000000000000000, version 1 of the protocol, session 1
  has       drive voltage, load current, tachometer, encoder, no time of its own, no motor: it is simulated
  ticks     1000 Hz; stops itself after 20 ms without a command
  limits    60 V, 120000 V/s; 3 A, 6000 A/s, I2t 9 A^2 s; 1000 rad/s, armed below 5 rad/s
  a count   0.00976562 V, 0.00146484 A, 0.195312 rad/s, 1.52588e-05 rad
  sensors   rate 0 rad/s, angle 0 rad
  state     disarmed
  line      none: the bed is in this process
""",
        "",
    )


def test_firmware_as_data(probe: Callable[..., tuple[int, str, str]]) -> None:
    status, said, _ = probe("deck.ic", "wired", "--port", "firmware", "--format", "json")
    found = json.loads(said)
    assert status == cli.YES
    assert (found["name"], found["state"], found["faults"], found["warnings"]) == ("simulated", "disarmed", [], [])
    assert found["capabilities"] == ["encoder", "simulated"] and found["tick_hz"] == 1000.0
    assert found["sensors"] == {"rate": 0.0, "angle": 0.0}
    assert found["line"]["bytes"] == 37 and found["line"]["bytes_take"] is None
    assert 0.0 < found["line"]["answered_in"] <= found["line"]["answered_in_at_most"]
    assert found["line"]["fastest_hz"] == pytest.approx(0.8 / found["line"]["answered_in"])


def test_a_line_is_asked_and_never_armed(
    probe: Callable[..., tuple[int, str, str]], on_pty: Callable[..., str]
) -> None:
    device = Listening(lock_step=False)
    port = on_pty(device)
    status, said, _ = probe("--port", port, "--baud", "115200")
    assert status == cli.YES
    assert said.startswith(f"bed `model` at {port}\n")
    assert "115200 baud: 37 bytes an exchange take 3.21 ms; answered in " in said
    assert "500 Hz no, 1000 Hz no, 2000 Hz no, 4000 Hz no; up to " in said
    assert set(device.kinds) == {HELLO, STOP, READ}
    assert not any(value for _, value in device.outputs)


def test_by_its_bytes_alone_a_line_is_fast_enough_for_so_much(
    probe: Callable[..., tuple[int, str, str]], on_pty: Callable[..., str]
) -> None:
    found = json.loads(probe("--port", on_pty(Device(lock_step=False)), "--baud", "115200", "--format", "json")[1])
    assert found["line"]["bytes_take"] == pytest.approx(370 / 115200)
    assert found["line"]["fastest_hz"] <= 0.8 * 115200 / 370 * (1.0 + 1e-12)


def test_faults_that_are_latched_and_their_remedies(
    probe: Callable[..., tuple[int, str, str]], on_pty: Callable[..., str]
) -> None:
    device = Device(lock_step=False)
    device.state, device.faults = STOPPED, DEADMAN | DEAD
    port = on_pty(device)
    status, said, _ = probe("--port", port)
    assert status == cli.YES
    assert (
        """\
  fault: no new command came within the deadman's time
    = help: the computer or the line was late: leave the computer less to do, or exchange at a lower rate
  fault: torque did not change the measured rate
    = help: look whether the tachometer is connected, and whether the shaft is free
"""
        in said
    )
    assert "\n  state     stopped\n" in said
    found = json.loads(probe("--port", port, "--format", "json")[1])
    assert [each["name"] for each in found["faults"]] == ["deadman", "tachometer_dead"]


def test_an_adapter_that_keeps_bytes_back_is_warned_of(
    probe: Callable[..., tuple[int, str, str]], on_pty: Callable[..., str], here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    port = on_pty(Device(lock_step=False))
    file = here / Path(port).name / "latency_timer"
    file.parent.mkdir()
    file.write_text("16\n")
    monkeypatch.setattr(serial_port, "ADAPTERS", here)
    assert f"""\
  warning: the adapter of {port} keeps bytes back for up to 16 ms: exchanges will be late
    = help: `echo 1 | sudo tee {file}`, after each time that it is plugged in
""" in probe("--port", port)[1]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            "--port emulated",
            """\
error[E425]: port `emulated` simulates a deck's bed, and there is no deck
 = help: give a deck, and the name of a run in it that substitutes a joint
""",
        ),
        (
            "deck.ic both --port qemu",
            """\
error[E418]: port `qemu`: of which joint?
 = help: say `--port shoulder=qemu` or `--port elbow=qemu`
""",
        ),
        (
            "deck.ic wired --port elbow=firmware",
            """\
error[E418]: port `elbow=firmware`: joint `elbow` is on no bed here
 = help: on a bed here: `shoulder`
""",
        ),
        (
            "deck.ic both --port wrist=firmware",
            """\
error[E418]: port `wrist=firmware`: joint `wrist` is on no bed here
 = help: on a bed here: `shoulder`, `elbow`
""",
        ),
        (
            "--port elbow=firmware",
            """\
error[E425]: port `firmware` simulates a deck's bed, and there is no deck
 = help: give a deck, and the name of a run in it that substitutes a joint
""",
        ),
        (
            "--port elbow=/dev/nobody",
            """\
error[E400]: /dev/nobody cannot be opened: no such file or directory
""",
        ),
        (
            "--port socket://localhost:1/?logging=no=thing",
            """\
error[E400]: socket://localhost:1/?logging=no=thing cannot be opened: """,
        ),
        (
            "deck.ic soft --port emulated",
            """\
error[E333]: no joint is on a bed here
 = help: a run says so: `substitute JOINT { }`
 = help: name the run or sweep that does, if it is another one
""",
        ),
        (
            "--port old.transcript",
            """\
error[E428]: old.transcript is a transcript, and no bed that could be asked
 = help: give the line that it was made on; `met bed run --port FILE` replays it
""",
        ),
        (
            "--port /dev/nobody",
            """\
error[E400]: /dev/nobody cannot be opened: no such file or directory
""",
        ),
    ],
)
def test_what_is_wrong(probe: Callable[..., tuple[int, str, str]], here: Path, words: str, message: str) -> None:
    (here / "old.transcript").write_bytes(b"MET bed transcript 1\n")
    status, said, complaint = probe(*words.split())
    assert (status, said) == (cli.BAD_INPUT, "")
    assert complaint.startswith(message)


def test_one_bed_at_a_time(probe: Callable[..., tuple[int, str, str]]) -> None:
    status, _, complaint = probe("deck.ic", "wired", "both", "--port", "emulated")
    assert status == cli.BAD_INPUT and "one bed at a time: `wired` or `both`" in complaint


def test_a_joint_of_several_is_named_with_its_port(probe: Callable[..., tuple[int, str, str]]) -> None:
    assert probe("deck.ic", "both", "--port", "elbow=emulated")[0] == cli.YES
    assert probe("deck.ic", "wired", "--port", "shoulder=emulated")[1].startswith("bed `emulated` at emulated\n")


def test_a_line_s_joint_may_be_named_without_a_deck(
    probe: Callable[..., tuple[int, str, str]], on_pty: Callable[..., str]
) -> None:
    port = on_pty(Device(lock_step=False))
    assert probe("--port", f"elbow={port}")[1].startswith(f"bed `model` at {port}\n")


@pytest.mark.parametrize(("lost", "answer"), [(0, "500 Hz yes"), (1, "500 Hz no"), (32, "500 Hz no")])
def test_questions_without_an_answer_count_against_every_rate(lost: int, answer: str) -> None:
    trips = (5e-4,) * (ASKED - lost)
    about: Any = SimpleNamespace(capabilities=Capability(0))
    result = ProbeResult("can:b.toml", about, cast("Any", None), (), 0, 2e-4, trips, (("bus", "x"),), lost)
    line, rates = (row[1] for row in _line(result))
    assert rates.startswith(answer) and (result.fastest == 0.0) == (lost > 0)
    assert ("without an answer" in rates) == (lost > 0) and ("never an answer" in line) == (lost == ASKED)
