"""What the host says of beds that cannot be driven and lines that cannot be used: whole messages."""

from __future__ import annotations

import math
import os
import socket
import struct
import threading
import tty
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hw.bed import BedDriver, BedState, Fault
from hw.beds.serial_line import SerialBed
from tests.hw import device as model
from tests.hw.conftest import LineBed, refusal
from tests.hw.device import Device
from tests.hw.relay import Faults, VirtualLine

pytestmark = pytest.mark.alone


def bed_of(device: Device, **more: Any) -> LineBed:
    return LineBed(lambda: VirtualLine(device, None), **more)


# Greeting


def test_nobody_there() -> None:
    class Silent(VirtualLine):
        def send(self, frame: bytes) -> None:
            pass

    bed = LineBed(lambda: Silent(Device(), None))
    assert refusal(bed.connect) == (
        "error[E402]: nobody answers HELLO on a line\n"
        " = help: is the bed switched on, and this the line that it is on?\n"
        " = help: does it expect this baud rate?"
    )
    assert bed.stop()


@pytest.mark.parametrize(
    ("answer", "said", "helps"),
    [
        (
            lambda frame: b"\x8f\x01\0" * 3,
            "162 bytes came, and no frame that decodes",
            ("give the baud rate that the bed has, `--baud`", "is another device on this line?"),
        ),
        (
            lambda frame: b"\xff" * 2000,
            "36,000 bytes came, and no frame that decodes",
            ("give the baud rate that the bed has, `--baud`", "is another device on this line?"),
        ),
        (
            lambda frame: frame,
            "what comes back is what was sent, 18 of 18 frames",
            ("take away a loop-back plug, or a bridge between its two wires", "switch a modem's echo off"),
        ),
        (
            lambda frame: model.frame(b"\x84\0\0" + bytes(10)),
            "18 frames came, and no answer among them",
            ("is another computer on the same line?", "is it the firmware of a bed, of this version?"),
        ),
    ],
)
def test_somebody_there_who_does_not_answer(
    answer: Callable[[bytes], bytes], said: str, helps: tuple[str, str]
) -> None:
    class Other(VirtualLine):
        def send(self, frame: bytes) -> None:
            self._push(self.time, "down", answer(frame))

    assert refusal(LineBed(lambda: Other(Device(), None)).connect) == (
        f"error[E402]: nobody answers HELLO on a line: {said}\n = help: {helps[0]}\n = help: {helps[1]}"
    )


def test_a_line_that_echoes_and_answers_is_a_bed_s() -> None:
    class Echoing(VirtualLine):
        def send(self, frame: bytes) -> None:
            self._push(self.time, "down", frame)
            super().send(frame)

    assert LineBed(lambda: Echoing(Device(), None)).connect().name == "model"


def test_a_device_that_boots_when_its_line_is_opened() -> None:
    device = Device()

    class Booting(VirtualLine):
        def send(self, frame: bytes) -> None:
            if self.time > 2.0:
                super().send(frame)

    assert LineBed(lambda: Booting(device, None)).connect().name == "model"


@pytest.mark.parametrize("name", [b"model", b"a longer greeting, as others may have"])
def test_another_version(name: bytes) -> None:
    assert refusal(bed_of(Device(version=2, name=name)).connect) == (
        "error[E403]: the bed speaks version 2 of the protocol, and this MET 1\n"
        " = help: put the firmware of this version of MET on it, or take the MET that its firmware came with"
    )


LIMITS, SCALES = Device.limits, Device.scales


@pytest.mark.parametrize(
    ("device", "said"),
    [
        ({"scales": (0.0, *SCALES[1:])}, "a count of its voltage is 0 V"),
        ({"scales": (*SCALES[:2], math.nan, *SCALES[3:])}, "a count of its rate is nan rad/s"),
        ({"scales": (*SCALES[:3], -1.0, *SCALES[4:])}, "a count of its angle is -1 rad"),
        ({"limits": (math.inf, *LIMITS[1:])}, "its limit of voltage is inf V"),
        ({"limits": (*LIMITS[:3], 0.0, *LIMITS[4:])}, "its limit of arming rate is 0 rad/s"),
        ({"limits": (1e9, *LIMITS[1:])}, "its limit of voltage, 1e+09 V, is 1.02e+11 counts"),
        ({"limits": (LIMITS[0], 1e-4, *LIMITS[2:])}, "its limit of current, 0.0001 A, is 0.0683 counts"),
        ({"tick_hz": -1.0}, "its ticks come at -1 Hz"),
        ({"deadman": 0.1}, "its deadman is 100 ms, which is not 10 to 20 ms"),
    ],
)
def test_a_bed_that_says_what_cannot_be(device: dict[str, Any], said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Device, "own", lambda self: None)
    assert refusal(bed_of(Device(**device)).connect) == (
        f"error[E404]: bed `model` cannot be driven: {said}\n = help: correct the configuration in its firmware"
    )


def test_the_scale_of_a_sensor_that_is_not_there_may_be_anything() -> None:
    device = Device(scales=(*SCALES[:4], 0.0, math.nan))
    assert bed_of(device).connect().name == "model"


@pytest.mark.parametrize("name", [b"", b"\x1b[31m", b"caf\xe9", b"a\0b"])
def test_a_name_that_is_none_is_shown_without_doing_anything(name: bytes) -> None:
    told = refusal(bed_of(Device(name=name)).connect)
    shown = {b"": "", b"\x1b[31m": r"\x1b[31m", b"caf\xe9": r"caf\xe9", b"a\0b": r"a\x00b"}[name]
    assert told == (
        f"error[E404]: bed `{shown}` cannot be driven: its name is not printable ASCII\n"
        " = help: correct the configuration in its firmware"
    )


def test_a_period_that_is_no_whole_number_of_ticks() -> None:
    assert refusal(bed_of(Device(), period=1.5e-3).connect) == (
        "error[E405]: a period of 1.5 ms is 1.5 ticks of bed `model`\n"
        " = help: its ticks come at 1000 Hz: take a whole number of them, 1 to 255"
    )


# While it is driven


def test_a_line_that_is_lost_is_told_and_not_taken_up_again() -> None:
    host, own = os.openpty()
    tty.setraw(own)
    name, device = os.ttyname(own), Device(lock_step=False)
    from tests.hw.relay import Relay

    relay = Relay(host, device)
    bed = SerialBed(name, period=1e-3)
    bed.patience = 0.05
    bed.connect()
    bed.arm()
    assert bed.exchange(1.0, 0.0) is not None
    relay.close()
    os.close(own)
    os.close(host)
    told = refusal(lambda: [bed.exchange(1.0, 0.0) for _ in range(3)])
    assert told == (
        f"error[E401]: the line to the bed on {name} was lost: input/output error\n"
        " = help: the bed stops itself when it hears nothing for the time of its deadman\n"
        " = help: look at the cable and the bed's supply, then start again: nothing goes on by itself"
    )
    assert not bed.stop()
    assert "E401" in refusal(bed.read)
    bed.close()


def test_over_a_socket_and_when_it_ends() -> None:
    device = Device()
    server = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        line, _ = server.accept()
        with line:
            for _ in range(9):
                line.sendall(device.take(line.recv(4096)))

    thread = threading.Thread(target=serve)
    thread.start()
    url = f"socket://127.0.0.1:{server.getsockname()[1]}"
    bed = SerialBed(url, period=1e-3, baud=9600)
    bed.patience = 1.0
    bed.connect()
    bed.arm()
    assert [bed.exchange(0.5, 0.0).tick for _ in range(7)] == list(range(1, 8))  # type: ignore[union-attr]
    thread.join()
    server.close()
    told = refusal(lambda: [bed.exchange(0.5, 0.0) for _ in range(3)])
    assert told.startswith(f"error[E401]: the line to the bed on {url} was lost: ")
    bed.close()


def test_a_port_that_cannot_be_waited_for() -> None:
    bed = SerialBed("loop://", period=1e-3)
    line = bed.open()
    line.send(b"abc")
    assert line.receive(line.now() + 1.0) == b"abc"
    before = line.now()
    assert line.receive(before + 0.02) == b""
    assert 0.02 <= line.now() - before < 0.2
    line.close()


def test_no_answer_any_more() -> None:
    device = Device()
    faults = Faults("drop", 0.0, 0, device)
    bed = LineBed(lambda: VirtualLine(device, faults))
    bed.connect()
    bed.arm()
    faults.share = 1.0
    assert bed.exchange(0.0, 0.0) is None
    assert refusal(bed.read) == (
        "error[E402]: bed `model` does not answer READ\n"
        " = help: it was there before: look at its supply and at the line"
    )
    assert not bed.stop() and not bed.confirmed
    faults.share = 0.0
    bed.connect()
    assert device.state == model.DISARMED and bed.stop() and bed.confirmed


def test_a_line_that_babbles_holds_nobody_up() -> None:
    class Babbling(VirtualLine):
        def receive(self, until: float) -> bytes:
            return b"\x55" * 100

    device = Device()
    lines = [VirtualLine(device, None), Babbling(device, None)]
    bed = LineBed(lambda: lines[0])
    bed.connect()
    bed.arm()
    bed._line = lines[1]
    assert bed.exchange(0.0, 0.0) is None


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (
            "DEADMAN",
            (
                "no new command came within the deadman's time",
                "the computer or the line was late: leave the computer less to do, or exchange at a lower rate",
            ),
        ),
        (
            "RANGE",
            (
                "a command was beyond a limit",
                "limits that the host knows are checked before: it has others than the bed; greet the bed anew",
            ),
        ),
        (
            "SLEW",
            (
                "a command changed faster than a limit",
                "command it more smoothly, or give the bed a wider limit of slew where it can bear it",
            ),
        ),
        (
            "RATE",
            (
                "the shaft was faster than its limit",
                "look whether the load drives the shaft; lower the rate that is asked for",
            ),
        ),
        ("CURRENT", ("a current was beyond its limit", "look for a short circuit or a shaft that is held")),
        ("HEAT", ("the load motor was loaded for too long", "let it cool, and load it less, or for less time")),
        (
            "TACHOMETER_DEAD",
            (
                "torque did not change the measured rate",
                "look whether the tachometer is connected, and whether the shaft is free",
            ),
        ),
        (
            "TACHOMETER_REVERSED",
            (
                "the measured rate changed against the torque",
                "exchange the two wires of the tachometer, or of the motor",
            ),
        ),
        (
            "NOISE",
            (
                "too many frames did not decode",
                "look at the line's cable, its shield and its ground; try a lower baud rate",
            ),
        ),
    ],
)
def test_why_a_bed_does_not_arm(fault: str, said: tuple[str, str]) -> None:
    device = Device()
    bed = bed_of(device)
    bed.connect()
    device.stop(int(Fault[fault]))
    assert (
        refusal(bed.arm) == f"error[E406]: bed `model` does not arm: it stopped itself: {said[0]}\n = help: {said[1]}"
    )


def test_a_reset_since_it_was_greeted() -> None:
    device = Device()
    bed = bed_of(device)
    bed.connect()
    device.boot()
    assert refusal(bed.arm) == (
        "error[E406]: bed `model` does not arm: it was reset since it was greeted\n"
        " = help: look at its supply, then begin anew"
    )
    device.greeted = True  # another host's greeting
    assert refusal(bed.arm) == (
        "error[E406]: bed `model` does not arm: it does not say why\n = help: switch it off and on, and begin anew"
    )


def test_why_a_bed_that_turns_does_not_arm_or_clear() -> None:
    device = Device()
    bed = bed_of(device)
    bed.connect()
    bed.preset(rate=50.0)
    said = "its shaft turns at 50 rad/s, and 5 rad/s is the most for that"
    helps = "wait until it has come to rest; a shaft that does not is driven by something"
    assert refusal(bed.arm) == f"error[E406]: bed `model` does not arm: {said}\n = help: {helps}"
    device.stop(model.RATE)
    assert refusal(bed.clear) == f"error[E406]: bed `model` does not clear: {said}\n = help: {helps}"


def test_what_is_asked_in_another_state() -> None:
    bed = bed_of(Device())
    bed.connect()
    bed.arm()
    for do, words in ((bed.arm, "arm"), (bed.clear, "clear"), (bed.preset, "start its plant anew")):
        assert refusal(do) == f"error[E406]: bed `model` does not {words}: it is armed\n = help: stop it first"
    assert refusal(lambda: bed.limit({"rate": 10.0})) == (
        "error[E406]: bed `model` does not take a tighter limit of rate\n = help: limits are set before it is armed"
    )


def test_a_real_plant_is_not_started_anew() -> None:
    device = Device(lock_step=False)
    device.capabilities = 0
    bed = bed_of(device)
    bed.connect()
    assert refusal(bed.preset) == "error[E406]: only a simulated bed can be started anew\n = help: this one has a motor"


def test_commands_that_are_not_sent() -> None:
    device = Device()
    bed = bed_of(device)
    bed.connect()
    helps = "the simulation diverges, or asks more than the bed may give"
    for command, wrong in (
        ((math.nan, 0.0), "a voltage of nan V for bed `model` is no finite number"),
        ((0.0, -math.inf), "a current of -inf A for bed `model` is no finite number"),
        ((20.1, 0.0), "a voltage of 20.1 V for bed `model` is beyond the limit of 20 V"),
        ((0.0, -3.1), "a current of -3.1 A for bed `model` is beyond the limit of 3 A"),
    ):
        bed.arm()
        assert (
            refusal(lambda c=command: bed.exchange(*c))
            == f"error[E408]: {wrong}; the bed was stopped\n = help: {helps}"
        )  # type: ignore[misc]
        assert device.state == model.DISARMED and device.outputs[-2:] == [("current", 0.0), ("voltage", 0.0)]
    assert refusal(lambda: bed.limit({"current_slew": -1.0})) == (
        "error[E408]: a limit of current slew of -1 A/s for bed `model`\n = help: a limit is a number from 0 on"
    )


def test_before_it_is_greeted() -> None:
    assert refusal(bed_of(Device()).read) == (
        "error[E401]: there is no line to a bed on a line\n"
        " = help: connect to it first; a line that was lost is not taken up again by itself"
    )


# Rules of the wire


def test_the_answer_to_arm_that_was_lost_is_asked_for_again() -> None:
    class Lossy(VirtualLine):
        lose = False

        def receive(self, until: float) -> bytes:
            data = super().receive(until)
            if data and self.lose:
                self.lose = False
                return super().receive(until)
            return data

    device = Device()
    line = Lossy(device, None)
    bed = LineBed(lambda: line)
    bed.connect()
    line.lose = True
    sample = bed.arm()
    assert sample.state == BedState.ARMED and device.state == model.ARMED


def test_numbers_go_around() -> None:
    device = Device()
    bed = bed_of(device, first=65530)
    bed.connect()
    bed.arm()
    for n in range(20):
        sample = bed.exchange(0.0, 0.0)
        assert sample is not None and sample.tick == n + 1
    assert device.number == (65530 + 22) % 65536


def test_an_angle_that_wraps_around_goes_on() -> None:
    device = Device()
    device.plant.shaft_angle = (2**31 - 3) * device.scales[3]
    bed = bed_of(device)
    bed.connect()
    bed.arm()
    angles = []
    for _ in range(50):
        sample = bed.exchange(10.0, 0.0)
        assert sample is not None and sample.angle is not None
        angles.append(sample.angle)
        assert sample.angle == pytest.approx(device.plant.shaft_angle, abs=device.scales[3])
    assert angles[-1] > 2**31 * device.scales[3] and angles == sorted(angles)


@pytest.mark.parametrize(("how", "fault"), [("dead", Fault.TACHOMETER_DEAD), ("reversed", Fault.TACHOMETER_REVERSED)])
def test_a_tachometer_that_lies_stops_the_model(how: str, fault: Fault) -> None:
    device = Device(tachometer=how)
    bed: BedDriver = bed_of(device)
    bed.connect()
    bed.arm()
    for _ in range(100):
        sample = bed.exchange(5.0, 0.0)
        assert sample is not None
        if sample.state == BedState.STOPPED:
            break
    assert sample.faults == fault and (device.voltage, device.current) == (0.0, 0.0)


def test_a_command_beyond_a_limit_that_the_host_does_not_know_stops_the_model() -> None:
    device = Device()
    bed = bed_of(device)
    bed.connect()
    bed.arm()
    device.force[0] = 10
    sample = bed.exchange(5.0, 0.0)
    assert sample is not None and sample.faults == Fault.RANGE and device.voltage == 0.0


def test_the_watchdog_is_told_and_is_no_reason_not_to_arm() -> None:
    bed = bed_of(Device(by_watchdog=True))
    bed.connect()
    assert bed.read().faults == Fault.WATCHDOG
    assert bed.arm().state == BedState.ARMED


def test_frames_of_the_model_are_those_of_the_page() -> None:
    device = Device()
    told = device.take(model.frame(b"\x01\x34\x12\x01"))
    said = model.payload(told[:-1])
    assert said is not None and said[:3] == b"\x81\x34\x12" and len(said) == 154
    assert struct.unpack_from("<15d", said, 34) == (device.tick_hz, device.deadman, *device.scales, *device.limits)


# Sockets of this machine


def test_a_socket_of_this_machine(tmp_path: Path) -> None:
    device, path = Device(), tmp_path / "line"
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(path))
        server.listen()

        def serve() -> None:
            line, _ = server.accept()
            with line:
                for _ in range(5):
                    line.sendall(device.take(line.recv(4096)))

        thread = threading.Thread(target=serve)
        thread.start()
        bed = SerialBed(f"unix://{path}", period=1e-3)
        bed.patience = 1.0
        bed.connect()
        bed.arm()
        assert [bed.exchange(0.5, 0.0).tick for _ in range(3)] == [1, 2, 3]  # type: ignore[union-attr]
        thread.join()
        told = refusal(lambda: [bed.exchange(0.5, 0.0) for _ in range(3)])
        assert told.startswith(f"error[E401]: the line to the bed on unix://{path} was lost: ")
        bed.close()


def test_a_socket_that_is_not_there(tmp_path: Path) -> None:
    assert refusal(SerialBed(f"unix://{tmp_path}/line", period=1e-3).connect) == (
        f"error[E400]: unix://{tmp_path}/line cannot be opened: no such file or directory\n"
        " = help: is there someone who made that socket, and listens?"
    )


# Another master


def drives_beside(number: int, seconds: float) -> tuple[LineBed, list[BedState]]:
    """A bed whose answers to another master come too: the state after each exchange. number: of the other's first"""
    line = VirtualLine(Device(), None)
    bed = LineBed(lambda: line)
    bed.connect()
    bed.arm()
    found = []
    for n in range(round(seconds / 1e-3)):
        if n % 10 == 5:
            line._put("up", model.frame(struct.pack("<BHiiB", 5, (number + n) % (1 << 16), 40, 0, 1)), line.time)
        sample = bed.exchange(0.0, 0.0)
        assert sample is not None
        found.append(sample.state)
        if sample.state != BedState.ARMED:
            assert sample.faults == Fault.OTHER_MASTER
            break
    return bed, found


def test_an_answer_to_a_question_that_this_host_has_not_asked_is_to_another_master() -> None:
    bed, states = drives_beside(30_000, 0.1)
    assert states[-1] == BedState.STOPPED and 12 <= len(states) <= 20
    assert bed.confirmed
