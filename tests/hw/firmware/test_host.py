"""The firmware behind a pseudo-terminal, with a simulated plant: lock-step, free-running, reboots and lost hosts."""

from __future__ import annotations

import os
import signal
import socket
import struct
import subprocess
import time
from dataclasses import replace
from pathlib import Path

import pytest

from hw.boards.build import build
from tests.hw.firmware import wire
from tests.hw.firmware.line import FREE, PLANT, STEPPED, Line, behind_a_terminal, ended

pytestmark = pytest.mark.alone


def logged(path: Path, since: int = 0) -> list[tuple[int, str, int]]:
    """Outputs that changed: ns, i or v, counts."""
    lines = [line.split() for line in path.read_text(encoding="utf-8").splitlines()]
    return [(int(ns), output, int(counts)) for ns, _, output, counts in lines if int(ns) >= since]


def test_in_lock_step_a_plant_moves_by_steps_alone() -> None:
    with behind_a_terminal(STEPPED) as (line, _):
        assert line.arm().tick == 0
        assert line.step(300, 0, 10).state == wire.ARMED
        first = line.step(300, 0, 10)
        assert first.tick == 20 and first.rate > 0 and first.more[0] > 0
        time.sleep(0.05)
        assert line.ask(wire.READ).rate == first.rate


def test_the_same_steps_are_the_same_samples() -> None:
    found = []
    for _ in range(2):
        with behind_a_terminal(STEPPED) as (line, _):
            line.arm()
            found.append([line.step(20 * k, -k, 3) for k in range(50)])
    assert found[0] == found[1]
    assert found[0][-1].rate > 100


def test_a_plant_begins_anew_at_a_preset_rate_seed_and_repeat() -> None:
    with behind_a_terminal(STEPPED) as (line, _):
        line.greet()
        scale = 800.0 / 4096
        assert line.preset(0, 100.0).rate == round(100.0 / scale)
        line.preset(1, 10.0)
        line.preset(2, 4.0)
        assert line.ask(wire.READ).rate == round(100.0 / scale)  # from the next start on
        assert line.preset(0, 0.0).rate == round(6.0 / scale)  # the tests' plant adds seed/2 + repeat/4
        for which, value in ((3, 1.0), (0, float("nan")), (0, float("inf")), (1, float("-inf"))):
            assert line.preset(which, value).refused


@pytest.mark.parametrize(
    ("rate", "counts"),
    [(1e9, 2**31 - 1), (-1e9, -(2**31)), (0.5 * 800 / 4096, 0), (1.5 * 800 / 4096, 2), (-2.5 * 800 / 4096, -2)],
)
def test_a_rate_is_rounded_to_the_nearest_count_and_does_not_go_round(rate: float, counts: int) -> None:
    with behind_a_terminal(STEPPED) as (line, _):
        line.greet()
        assert line.preset(0, rate).rate == counts


def test_an_angle_goes_round_at_its_end() -> None:
    fine = replace(STEPPED, scales=replace(STEPPED.scales, angle=1e-9))
    with behind_a_terminal(fine) as (line, _):
        line.greet()
        line.preset(0, 1000.0)
        coarse = 0.0
        with behind_a_terminal(STEPPED) as (other, _):
            other.greet()
            other.preset(0, 1000.0)
            coarse = other.step(0, 0, 10).more[0] * 1e-3
        angle = line.step(0, 0, 10).more[0]
    assert coarse > 2**31 * 1e-9
    assert abs((angle - round(coarse * 1e9) + 2**31) % 2**32 - 2**31) < 1e6


def test_free_running_time_passes_by_itself() -> None:
    with behind_a_terminal(FREE) as (line, _):
        first, begun = line.ask(wire.READ).tick, time.monotonic()
        time.sleep(0.2)
        ticks, passed = line.ask(wire.READ).tick - first, time.monotonic() - begun
        assert 150 < ticks <= 1000 * passed + 2


def test_a_host_that_falls_silent_leaves_safe_outputs_within_the_deadman(tmp_path: Path) -> None:
    log = tmp_path / "log"
    with behind_a_terminal(FREE, "--log", str(log)) as (line, _):
        for _ in range(30):
            line.arm()
            for _ in range(30):
                line.drive(200, -40)
                time.sleep(0.002)
            sent = time.monotonic_ns()
            if line.drive(201, -41).state == wire.ARMED:
                break
            line.ask(wire.CLEAR)  # this machine was busy for longer than the deadman
        time.sleep(0.1)
        assert line.ask(wire.READ).faults == wire.DEADMAN
    (_, *first), (_, *second), (stopped, *third), (_, *fourth) = logged(log, sent)
    assert (first, second, third, fourth) == (["i", -41], ["v", 201], ["i", 0], ["v", 0])
    # one tick more for a machine that is busy
    assert 13e6 < stopped - sent < 15e6 + 40e6


def test_a_host_that_is_killed_leaves_safe_outputs_within_the_deadman(tmp_path: Path) -> None:
    log = tmp_path / "log"
    with behind_a_terminal(FREE, "--log", str(log)) as (line, _):
        child = os.fork()
        if child == 0:
            while True:
                if line.drive(100, -40).state != wire.ARMED:  # at first, and where this machine was busy for long
                    line.ask(wire.CLEAR)
                    line.arm()
                time.sleep(0.001)
        time.sleep(0.2)
        os.kill(child, signal.SIGKILL)
        killed = time.monotonic_ns()
        os.waitpid(child, 0)
        time.sleep(0.1)
    assert logged(log)[-2][1:] == ("i", 0) and logged(log)[-1][1:] == ("v", 0)
    assert logged(log)[-1][0] - killed < 15e6 + 40e6
    assert ("v", 100) in [each[1:] for each in logged(log)]


def test_an_overspeed_stops_it_at_the_output(tmp_path: Path) -> None:
    log = tmp_path / "log"
    with behind_a_terminal(STEPPED, "--log", str(log)) as (line, _):
        line.arm()
        sample, k = line.ask(wire.READ), 0
        while sample.state == wire.ARMED and k < 500:
            sample, k = line.step(min(2000, 100 * k), min(1000, 20 * k)), k + 1
        assert sample.faults == wire.RATE
        assert abs(sample.rate) > 350 / (800 / 4096)
        for _ in range(60):
            assert line.step(0, 0, 10).refused
        assert line.ask(wire.CLEAR).state == wire.DISARMED  # it has braked
    assert [each[1:] for each in logged(log)[-2:]] == [("i", 0), ("v", 0)]


def test_a_reboot_is_another_session_disarmed_and_safe(tmp_path: Path) -> None:
    log = tmp_path / "log"
    with behind_a_terminal(STEPPED, "--log", str(log)) as (line, process):
        before = line.greet().session
        line.ask(wire.ARM, struct.pack("<I", before))
        line.step(100, 50)
        process.send_signal(signal.SIGHUP)
        time.sleep(0.05)
        sample = line.ask(wire.READ)
        assert (sample.status, sample.tick) == (wire.DISARMED, 0)
        after = line.greet().session
        assert after != before
        assert line.ask(wire.ARM, struct.pack("<I", before)).refused
    assert [each[1:] for each in logged(log)] == [("i", 0), ("v", 0), ("i", 50), ("v", 100), ("i", 0), ("v", 0)]


def test_a_reset_by_the_watchdog_is_seen() -> None:
    with behind_a_terminal(STEPPED) as (line, process):
        line.arm()
        process.send_signal(signal.SIGUSR1)
        time.sleep(0.05)
        assert line.ask(wire.READ).status == wire.DISARMED | wire.WATCHDOG


def test_clients_come_and_go_and_half_a_frame_is_left_behind() -> None:
    with behind_a_terminal(STEPPED) as (line, _):
        name = os.ttyname(line.handle)
        os.write(line.handle, wire.frame(wire.READ, 1)[:4])
        other = os.open(name, os.O_RDWR | os.O_NOCTTY)
        try:
            os.write(other, b"\0")
            assert Line(other).greet().version == 1
        finally:
            os.close(other)


def test_frames_at_once_are_answered_one_by_one() -> None:
    with behind_a_terminal(STEPPED) as (line, _):
        os.write(line.handle, b"".join(wire.frame(wire.READ, k) for k in range(1, 101)))
        came = b""
        while came.count(b"\0") < 100:
            came += os.read(line.handle, 4096)
        assert [wire.told(each).number for each in wire.payloads(came)] == list(range(1, 101))


def test_it_ends_when_it_is_told() -> None:
    with behind_a_terminal(FREE) as (line, process):
        line.greet()
        process.terminate()
        assert process.wait(5.0) == 0


def test_on_a_socket_it_answers_and_ends_when_nobody_is_at_the_other_end() -> None:
    ours, theirs = socket.socketpair()
    with ours:
        number = theirs.fileno()
        process = subprocess.Popen([build("host", FREE, PLANT), "--line", str(number)], pass_fds=[number])
        with ended(process):
            theirs.close()
            Line(ours.fileno()).greet()
            ours.close()
            assert process.wait(5.0) == 0


@pytest.mark.parametrize(
    "words",
    [
        ["--log"],
        ["--lock-step"],
        ["--line"],
        ["--log", "/nowhere/at/all"],
        ["--line", "77"],
        ["--line", "0x3"],
    ],
)
def test_what_it_does_not_understand_it_says(words: list[str]) -> None:
    program = build("host", FREE, PLANT)
    done = subprocess.run([program, *words], capture_output=True, text=True, stdin=subprocess.DEVNULL)
    why = {"/nowhere/at/all": "No such file or directory", "77": "Bad file descriptor", "0x3": "Bad file descriptor"}
    if words[-1] in why:
        assert (done.returncode, done.stderr) == (1, f"bed-host: {words[-1]}: {why[words[-1]]}\n")
    else:
        assert (done.returncode, done.stderr) == (2, "usage: bed-host [--log FILE] [--line NUMBER]\n")
