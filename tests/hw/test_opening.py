"""Opening a line to a bed: what it is not, who else has it, and whether it is fast enough; whole messages."""

from __future__ import annotations

import fcntl
import os
import socket
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from subprocess import PIPE
from typing import Any

import pytest

from hw.beds.serial_line import SerialBed
from hw.lines import serial_port
from tests.hw.conftest import LineBed, refusal
from tests.hw.device import Device
from tests.hw.relay import VirtualLine

pytestmark = pytest.mark.alone

TIOCGEXCL = 0x80045440
"""The system's request for whether a line is open for one process alone (Linux)."""


def bed_of(device: Device, **more: Any) -> LineBed:
    return LineBed(lambda: VirtualLine(device, None), **more)


def test_a_line_that_is_not_there() -> None:
    told = refusal(SerialBed("/dev/ttyNONE", period=1e-3).connect).splitlines()
    assert told[0] == "error[E400]: /dev/ttyNONE cannot be opened: no such file or directory"
    assert told[1].startswith(
        (" = help: serial lines here: /dev/", " = help: there is no serial line on this machine: plug it in")
    )


def test_a_line_that_another_program_has() -> None:
    text = "import fcntl, os; own = os.openpty()[1]; fcntl.flock(own, fcntl.LOCK_EX); print(os.ttyname(own)); input()"
    with subprocess.Popen([sys.executable, "-uc", text], stdin=PIPE, stdout=PIPE, text=True) as other:
        assert other.stdin is not None and other.stdout is not None
        name = other.stdout.readline().strip()
        assert refusal(SerialBed(name, period=1e-3).connect) == (
            f"error[E400]: {name} cannot be opened: resource temporarily unavailable\n"
            f" = help: another program uses it; `fuser -v {name}` says which"
        )
        other.stdin.write("\n")


def test_a_line_that_another_joint_s_bed_is_on(on_pty: Callable[..., str]) -> None:
    name = on_pty(Device())
    with SerialBed(name, period=1e-3) as bed:
        bed.connect()
        assert refusal(SerialBed(name, period=1e-3).connect) == (
            f"error[E400]: {name} cannot be opened: this run has it open already\n"
            " = help: each bed is on a line of its own: give each joint another port"
        )


def test_a_line_is_open_for_one_process_alone_until_it_is_closed() -> None:
    """The system then lets no other open it, but one of the superuser's: the flag alone is looked at here."""

    def exclusive() -> bool:
        return bool(struct.unpack("i", fcntl.ioctl(own, TIOCGEXCL, bytes(4)))[0])

    host, own = os.openpty()
    try:
        line = serial_port.SerialLine(os.ttyname(own), 921600)
        assert exclusive()
        line.close()
        assert not exclusive()
    finally:
        os.close(host)
        os.close(own)


@pytest.mark.parametrize("text", [None, "", "anything"])
def test_what_is_no_serial_line(tmp_path: Path, text: str | None) -> None:
    path = Path(os.devnull) if text is None else tmp_path / "file"
    if text is not None:
        path.write_text(text)
    why = "it is no serial line" if text is None else "it is a file, and no transcript, which could be replayed"
    told = refusal(SerialBed(str(path), period=1e-3).connect).splitlines()
    assert told[0] == f"error[E400]: {path} cannot be opened: {why}"
    assert len(told) == 2 and told[1].startswith((" = help: serial lines here: ", " = help: there is no serial line"))


def test_a_line_that_may_not_be_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    def no(*words: Any, **more: Any) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("serial.serial_for_url", no)
    assert refusal(SerialBed("/dev/ttyUSB0", period=1e-3).connect) == (
        "error[E400]: /dev/ttyUSB0 cannot be opened: permission denied\n"
        " = help: `sudo usermod -a -G dialout $USER` lets you use serial lines, once you have logged in again"
    )


def test_an_address_at_which_nobody_listens() -> None:
    with socket.socket() as own:
        own.bind(("127.0.0.1", 0))
        port = own.getsockname()[1]
        assert refusal(SerialBed(f"socket://127.0.0.1:{port}", period=1e-3).connect) == (
            f"error[E400]: socket://127.0.0.1:{port} cannot be opened: connection refused\n"
            " = help: is there someone who listens at that address?"
        )


@pytest.mark.parametrize(
    ("url", "why", "remedy"),
    [
        (
            "wire://x",
            "invalid URL, protocol 'wire' not known",
            "such as /dev/ttyUSB0, socket://HOST:PORT or rfc2217://HOST:PORT",
        ),
        ("loop://?x=y", "unknown option: 'x'", "such as /dev/ttyUSB0, socket://HOST:PORT or rfc2217://HOST:PORT"),
        ("hwgrep://[", "unterminated character set at position 0", "is there someone who listens at that address?"),
        ("socket://localhost", "it names no port", "write `socket://HOST:PORT`, where PORT is 1 to 65535"),
        ("socket://localhost:0", "it names no port", "write `socket://HOST:PORT`, where PORT is 1 to 65535"),
        ("socket://:7000", "it names no host", "write `socket://HOST:PORT`, where PORT is 1 to 65535"),
        ("rfc2217://bench", "it names no port", "write `rfc2217://HOST:PORT`, where PORT is 1 to 65535"),
        (
            "socket://bench:serial",
            "it is no address of a host and a port",
            "write `socket://HOST:PORT`, where PORT is 1 to 65535",
        ),
        (
            "socket://bench:70000",
            "it is no address of a host and a port",
            "write `socket://HOST:PORT`, where PORT is 1 to 65535",
        ),
        (
            "socket://[::1",
            "it is no address of a host and a port",
            "write `socket://HOST:PORT`, where PORT is 1 to 65535",
        ),
    ],
)
def test_an_address_that_is_none(url: str, why: str, remedy: str) -> None:
    assert refusal(SerialBed(url, period=1e-3).connect) == (
        f"error[E400]: {url} cannot be opened: {why}\n = help: {remedy}"
    )


def test_a_line_too_slow_for_the_rate(on_pty: Callable[..., str]) -> None:
    name = on_pty(Device(lock_step=False, capabilities=0))
    assert refusal(SerialBed(name, period=1e-3, baud=115200).connect) == (
        f"error[E405]: {name} at 115200 baud: an exchange takes 286% of its period of 1 ms, and 80% is the most\n"
        " = help: at least 412500 baud, or a lower rate of the servo"
    )
    with SerialBed(name, period=1e-3, baud=460800) as bed:
        bed.connect()


def test_more_sensors_take_more_of_a_line(on_pty: Callable[..., str]) -> None:
    name = on_pty(Device(lock_step=False, capabilities=0b111))
    assert refusal(SerialBed(name, period=1e-3, baud=460800).connect) == (
        f"error[E405]: {name} at 460800 baud: an exchange takes 98% of its period of 1 ms, and 80% is the most\n"
        " = help: at least 562500 baud, or a lower rate of the servo"
    )


def test_in_lock_step_no_line_is_too_slow(on_pty: Callable[..., str]) -> None:
    with SerialBed(on_pty(Device()), period=1e-3, baud=9600) as bed:
        assert bed.connect().name == "model"


def test_an_adapter_that_keeps_bytes_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial_port, "ADAPTERS", tmp_path)
    (tmp_path / "ttyUSB7").mkdir()
    (tmp_path / "ttyUSB7" / "latency_timer").write_text("16\n")
    [found] = serial_port.latency("/dev/ttyUSB7")
    assert (found.code, found.severity, found.message) == (
        "E405",
        "warning",
        "the adapter of /dev/ttyUSB7 keeps bytes back for up to 16 ms: exchanges will be late",
    )
    file = tmp_path / "ttyUSB7" / "latency_timer"
    assert found.help == (f"`echo 1 | sudo tee {file}`, after each time that it is plugged in",)
    file.write_text("1\n")
    assert serial_port.latency("/dev/ttyUSB7") == ()
    assert serial_port.latency("/dev/ttyUSB8") == ()
