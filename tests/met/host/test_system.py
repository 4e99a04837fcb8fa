"""What operating systems differ in is named in one file, which does without what a system lacks."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from hw import realtime
from met.host import system

ROOT = Path(__file__).parents[3]
OF_LINUX = ("sched_", "SCHED_", "memfd_create", "/proc/", "prctl", "mlockall", "eventfd", "epoll", "inotify")
"""Words for what other systems lack."""


def test_one_file_of_the_product_names_what_other_systems_lack() -> None:
    files = [path for package in ("met", "ic", "batch", "hw") for path in ROOT.glob(f"{package}/**/*.py")]
    naming = {path for path in files if any(word in path.read_text("utf-8") for word in OF_LINUX)}
    assert naming == {ROOT / "met/host/system.py"}


def test_cores_are_those_of_the_process_where_the_system_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {2, 5, 6}, raising=False)
    assert system.cores() == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: 7)
    assert system.cores() == 7
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert system.cores() == 1


@pytest.mark.parametrize("in_memory", [True, False])
def test_a_nameless_file_can_be_written_and_is_in_no_folder(
    in_memory: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not in_memory:
        monkeypatch.delattr(os, "memfd_create", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with os.fdopen(system.nameless_file(), "w+b") as file:
        file.write(b"record")
        file.seek(0)
        assert file.read() == b"record"
        assert not os.get_inheritable(file.fileno())
        assert list(tmp_path.iterdir()) == []
        assert os.fstat(file.fileno()).st_dev == tmp_path.stat().st_dev or in_memory


def test_a_process_runs_until_it_is_waited_for() -> None:
    assert system.is_running(os.getpid()) and system.is_running(1)
    child = subprocess.Popen([sys.executable, "-c", ""])
    assert system.is_running(child.pid)
    child.wait()
    assert not system.is_running(child.pid)


@pytest.mark.parametrize("pid", [0, -1, 1 << 70])
def test_a_number_that_no_process_has_runs_not(pid: int) -> None:
    assert not system.is_running(pid)


def test_facts_of_the_processor_are_left_out_where_they_cannot_be_read(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object, **__: object) -> None:
        raise FileNotFoundError

    monkeypatch.setattr("builtins.open", refused)
    monkeypatch.setattr("platform.processor", lambda: "arm")
    assert (system.cpu(), system.cpu_flags()) == ("arm", ())


def test_what_a_system_lacks_and_what_it_does_not_allow_have_their_own_remedies(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for collecting in ("collect", "freeze", "disable"):
        monkeypatch.setattr(f"gc.{collecting}", lambda: None)

    def forbidden(*_: object, **__: object) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(system, "put_first", forbidden)
    monkeypatch.setattr(system, "keep_in_memory", forbidden)
    assert realtime.take_precedence() == [
        "no precedence over other processes (operation not permitted): exchanges may be late; "
        "`@GROUP - rtprio 50` allows it",
        "memory may be swapped out (operation not permitted): exchanges may be late; "
        "`@GROUP - memlock unlimited` allows it",
    ]
    monkeypatch.undo()
    for collecting in ("collect", "freeze", "disable"):
        monkeypatch.setattr(f"gc.{collecting}", lambda: None)
    monkeypatch.delattr(os, "SCHED_RESET_ON_FORK", raising=False)
    monkeypatch.setattr("ctypes.CDLL", lambda *_, **__: object())
    assert realtime.take_precedence() == [
        "no precedence over other processes (this system has no such call): exchanges may be late; "
        "drive motors from Linux",
        "memory may be swapped out (this system has no such call): exchanges may be late; drive motors from Linux",
    ]
    realtime.put_first(os.getpid())
    system.end_with_parent(signal.SIGTERM)
