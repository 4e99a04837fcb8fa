"""Files that others wrote are opened where they are regular files, at once or not at all; JSON is data."""

from __future__ import annotations

import errno
import os
import socket
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from met.host import files


def test_a_regular_file_is_read_also_through_a_link(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"words")
    (tmp_path / "link").symlink_to("a")
    assert files.read_regular(tmp_path / "link") == b"words"


def test_a_named_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="it is a named pipe, not a regular file"):
        files.open_regular(tmp_path / "pipe")


def test_a_pipe_that_takes_a_files_place_after_the_look_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a").touch()
    os.mkfifo(tmp_path / "pipe")
    before = os.stat(tmp_path / "a")
    monkeypatch.setattr(files.os, "stat", lambda _: before)
    with pytest.raises(OSError, match="it is a named pipe, not a regular file"):
        files.open_regular(tmp_path / "pipe")


def test_a_socket_a_device_and_a_folder_are_no_files(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(str(tmp_path / "socket"))
        with pytest.raises(OSError, match="it is a socket, not a regular file"):
            files.open_regular(tmp_path / "socket")
    with pytest.raises(OSError, match="it is a device, not a regular file"):
        files.open_regular("/dev/zero")
    with pytest.raises(IsADirectoryError):
        files.open_regular(tmp_path)


@pytest.mark.parametrize("most", [None, 100])
def test_a_file_that_has_neither_data_nor_an_end_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most: int | None
) -> None:
    """As /proc/kmsg, which says that it is a regular file: here a pipe, taken for one."""
    os.mkfifo(tmp_path / "pipe")
    end = os.open(tmp_path / "pipe", os.O_RDWR)
    monkeypatch.setattr(files, "_check_regular", lambda *_: None)
    with pytest.raises(OSError, match="it has nothing to give, and no end"):
        files.read_regular(tmp_path / "pipe", most)
    os.close(end)


def test_a_name_that_no_file_can_have_is_its_own_real_path(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to("other")
    names = ["/a\0b", "/\ud800", "/" + "a" * 5000, str(tmp_path / "link")]
    assert [files.real_path(name) for name in names] == [*names[:3], str(tmp_path / "other")]


def test_a_name_with_a_null_character_is_refused_as_a_file_is() -> None:
    with pytest.raises(OSError, match="its name holds a null character"):
        files.open_regular("a\0b")


def test_no_more_is_read_than_was_allowed(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(bytes(3 << 20))
    with pytest.raises(OSError, match="it has more than 2,097,152 bytes"):
        files.read_regular(tmp_path / "a", most=2 << 20)


def test_a_file_of_holes_that_is_larger_than_the_memory_is_not_read(tmp_path: Path) -> None:
    with open(tmp_path / "a", "wb") as file:
        file.truncate(4 * files.memory())
    with pytest.raises(OSError, match=r"it has more than [0-9,]+ bytes"):
        files.read_regular(tmp_path / "a")


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100_000,
        '{"a":' * 100_000,
        "1" * 30,
        "-" + "9" * 5000,
        "NaN",
        "-Infinity",
        "1e999",
        "{",
        b"\xff",
        "",
    ],
)
def test_json_that_no_program_of_ours_wrote_is_a_value_error(text: str | bytes) -> None:
    with pytest.raises(ValueError):
        files.parse_json(text)


def test_json_is_read_as_it_was_written() -> None:
    assert files.parse_json('{"a": [1, -2.5, null, true, 18446744073709551615]}') == {
        "a": [1, -2.5, None, True, (1 << 64) - 1]
    }


@pytest.mark.parametrize("make", [lambda at: at.symlink_to("other"), os.mkfifo, lambda at: at.write_bytes(b"old")])
def test_a_new_file_is_written_into_nothing_that_lies_in_wait_there(
    make: Callable[[Path], object], tmp_path: Path
) -> None:
    (tmp_path / "other").write_bytes(b"mine")
    make(tmp_path / "a")
    with files.new_file(tmp_path / "a") as file:
        file.write(b"new")
    assert (tmp_path / "other").read_bytes() == b"mine"
    assert not (tmp_path / "a").is_symlink() and (tmp_path / "a").read_bytes() == b"new"


def test_a_file_has_its_name_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("before")
    with files.whole_file(path) as file:
        file.write(b"after")
        assert path.read_text() == "before"
    assert path.read_text() == "after"
    with pytest.raises(KeyboardInterrupt), files.whole_file(path) as file:
        file.write(b"half")
        raise KeyboardInterrupt
    assert path.read_text() == "after"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_a_file_that_is_replaced_may_keep_its_permissions(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    with files.whole_file(path, mode=0o640) as file:
        file.write(b"text")
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_a_link_that_lies_where_a_file_is_made_is_not_written_through(tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.write_text("theirs")
    (tmp_path / f".a.txt.{socket.gethostname()}.{os.getpid()}.tmp").symlink_to(other)
    with files.whole_file(tmp_path / "a.txt") as file:
        file.write(b"ours")
    assert (other.read_text(), (tmp_path / "a.txt").read_text()) == ("theirs", "ours")


def refuse(monkeypatch: pytest.MonkeyPatch, call: str, number: int) -> None:
    """Let a system call fail as it does on some file systems."""

    def refused(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, call, refused)


@pytest.mark.parametrize(
    ("number", "of_files", "of_folders"),
    [
        *((each, True, True) for each in (errno.EINVAL, errno.ENOSYS, errno.EOPNOTSUPP)),
        *((each, False, True) for each in (errno.EBADF, errno.EPERM, errno.EACCES)),
        *((each, False, False) for each in (errno.EIO, errno.ENOSPC)),
    ],
)
def test_a_file_system_that_cannot_tell_what_is_on_the_disk_has_not_failed(
    number: int, of_files: bool, of_folders: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refuse(monkeypatch, "fsync", number)
    for settled, call in ((of_files, lambda: files.settle(0)), (of_folders, lambda: files.settle_folder(tmp_path))):
        if settled:
            call()
        else:
            with pytest.raises(OSError, match=os.strerror(number)):
                call()


def test_a_folder_that_may_be_written_to_but_not_read_is_no_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refuse(monkeypatch, "open", errno.EACCES)
    files.settle_folder(tmp_path)


def test_a_file_system_without_permissions_takes_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    refuse(monkeypatch, "fchmod", errno.EPERM)
    with files.whole_file(tmp_path / "a.txt", mode=0o640) as file:
        file.write(b"text")
    assert (tmp_path / "a.txt").read_text() == "text"
