"""A bench file says what is there, and each mistake in one has its line and its remedy."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from hw.drives.bench_file import two_drives
from met.diagnostic import Problem
from tests.hw.conftest import said
from tests.hw.drives.played import bench_file


def test_its_figures_are_si_and_what_it_does_not_say_has_a_default(tmp_path: Path) -> None:
    path = bench_file(tmp_path)
    path.write_text(path.read_text().replace('rate_max = "380 rad/s"', 'rate_max = "600 rpm"'))
    bench = two_drives(path)
    assert bench.name == "paper" and bench.bus == {"interface": "virtual", "channel": "bench"}
    assert bench.shaft == {
        "inertia": 1.3e-4,
        "rate_max": pytest.approx(20.0 * math.pi, rel=1e-15),
        "arming_rate": 5.0,
        "filter": 0.0,
    }
    assert (bench.drive.role, bench.drive.node, bench.drive.sense) == ("drive", 1, 1)
    assert (bench.load.sense, bench.load.figures["watchdog"]) == (-1, 0.020)
    assert bench.drive.endpoints == str(tmp_path / "flat_endpoints.json")


@pytest.mark.parametrize(
    ("old", "new", "changed"),
    [
        ("1.3e-4 kg*m^2", "1.4e-4 kg*m^2", ["shaft.inertia"]),
        ("node          = 2", "node          = 3", ["load.node"]),
        ("reversed      = true", "", ["load.reversed"]),
        ('interface = "virtual"', 'interface = "socketcan"', ["bus.interface"]),
        ('name = "paper"', 'name = "other"', ["name"]),
        ('"40 V"', '"7 V"', ["supply.voltage_max"]),
        ("1.3e-4 kg*m^2", "0.13 g*m^2", []),
        ('channel   = "bench"', 'channel   = "another"  # adapter', []),
    ],
)
def test_what_tells_a_bench_from_another_is_not_how_its_file_is_written(
    tmp_path: Path, old: str, new: str, changed: list[str]
) -> None:
    path = bench_file(tmp_path)
    before, text = two_drives(path).identity, path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    now = two_drives(path).identity
    assert [name for name in before | now if before.get(name) != now.get(name)] == changed


@pytest.mark.parametrize(
    ("old", "new", "line", "message", "help"),
    [
        ('"1.3e-4 kg*m^2"', '"1.3 N*m"', 8, "`inertia` of `[shaft]` is no quantity above zero in kg*m^2", "write"),
        ('"1.3e-4 kg*m^2"', "1.3e-4", 8, "`inertia` of `[shaft]` is no quantity above zero in kg*m^2", "write"),
        ('"3 A"', '"0 A"', 28, "`current_max` of `[load]` is no quantity above zero in A", "write"),
        ("kt          =", 'watchdog = "2 s"\nkt =', 17, "`watchdog` of `[drive]` is more than a second", "10 to 20 ms"),
        ("node          = 2", "node = true", 25, "`node` of `[load]` is no number of a node", "`node = 1`: 0 to 127"),
        ("node          = 2", "node = 1", 25, "drive and load are both node 1", "each has a number of its own"),
        ("= true", "= 1", 26, "`reversed` of `[load]` is neither true nor false", "`reversed = true`"),
        ("torque_max ", "torque_most", 20, "`[drive]` has no `torque_most`", "did you mean `torque_max`?"),
        ("[supply]", "[suply]", 11, "a bench has no `suply`", "did you mean `supply`?"),
        ('name = "paper"', 'name = ""', 1, "`name` is no name of 1 to 16 letters", '`name = "mine"`'),
        ("channel  ", "chanel", 3, "`[bus]` has no `channel`", "such as"),
        ('"bench"', "[1]", 5, "`channel` is no word and no number", "python-can's documentation has them"),
        ("[supply]", "[[supply]]", 11, "`supply` is no table", "write `[supply]` above what belongs to it"),
        ("reversed      = true", 'reversed = "', 26, "is no TOML", "docs/drives.md shows a bench file"),
    ],
)
def test_a_mistake_has_its_place_and_its_remedy(
    tmp_path: Path, old: str, new: str, line: int, message: str, help: str
) -> None:
    path = bench_file(tmp_path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(Problem) as caught:
        two_drives(path)
    words = said(caught.value)
    assert words.startswith("error[E446]: ") and message in words and f"  = help: {help}" in words, words
    assert f"--> {path}:{line}:" in words, words


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("fd = true", "an fdcanusb has no `fd`"),
        ("bitrat = 5", "an fdcanusb has no `bitrat`"),
        ("bitrate = 0", "`bitrate` is no number of bits a second"),
        ("data_bitrate = true", "`data_bitrate` is no number of bits a second"),
        ('bitrate = "1\\ncan on"', "`bitrate` is no number of bits a second"),
        ("data_bitrate = 9000000", "`data_bitrate` is no number of bits a second"),
    ],
)
def test_an_fdcanusb_has_speeds_and_no_other_settings(tmp_path: Path, line: str, message: str) -> None:
    path = bench_file(tmp_path, "moteus", "fdcanusb")
    path.write_text(path.read_text().replace("[bus]\n", f"[bus]\n{line}\n"))
    with pytest.raises(Problem) as caught:
        two_drives(path)
    words = said(caught.value)
    assert words.startswith(f"error[E446]: {message}\n") and f"--> {path}:4:" in words, words


def test_drives_on_serial_lines_have_a_port_each(tmp_path: Path) -> None:
    path = bench_file(tmp_path, "odrive_ascii")
    bench = two_drives(path)
    assert bench.drive.port == str(tmp_path / "ttyDrive") and bench.load.port == str(tmp_path / "ttyLoad")
    assert bench.bus["ports"] == {1: bench.drive.port, 2: bench.load.port} and bench.bus["baud"] is None
    path.write_text(path.read_text().replace('"serial"\n', '"serial"\nbaud = 921600\n'))
    assert two_drives(path).bus["baud"] == 921600


@pytest.mark.parametrize(
    ("old", "new", "line", "message", "help"),
    [
        ('"serial"', '"serial"\nbaud = 0', 5, "`baud` is no number of bits a second", "`baud = 921600`"),
        ('"serial"', '"serial"\nchannel = "can0"', 5, "serial lines have no `channel`", "`baud` of UARTs, and nothing"),
        ('"serial"', '"socketcan"', 14, "dialect `odrive_ascii` is spoken on no CAN bus", '`interface = "serial"` is'),
        ('"odrive_ascii"', '"damiao"', 14, "dialect `damiao` is spoken on no serial line", '`interface = "serial"` is'),
        ("port = ", "node = 1\nport = ", 15, "a drive on a serial line has no `node`", "`port` says which it is"),
        ("port = ", "endpoints = ", 13, "`[drive]` has no `port`", '`port = "/dev/ttyACM0"`'),
        ("ttyDrive", "ttyLoad", 23, "drive and load are both on FOLDER/ttyLoad", "each has a line of its own"),
    ],
)
def test_a_mistake_about_serial_lines_has_its_place_and_its_remedy(
    tmp_path: Path, old: str, new: str, line: int, message: str, help: str
) -> None:
    path = bench_file(tmp_path, "odrive_ascii")
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(Problem) as caught:
        two_drives(path)
    words = said(caught.value).replace(str(tmp_path), "FOLDER")
    assert words.startswith(f"error[E446]: {message}\n") and f" = help: {help}" in words, words
    assert f"--> FOLDER/bench.toml:{line}:" in words, words


def test_a_drive_on_a_bus_has_no_port(tmp_path: Path) -> None:
    path = bench_file(tmp_path)
    path.write_text(path.read_text().replace("node        = 1", 'node = 1\nport = "/dev/ttyACM0"'))
    with pytest.raises(Problem) as caught:
        two_drives(path)
    assert said(caught.value).startswith("error[E446]: a drive on a CAN bus has no `port`\n")


def test_a_file_that_is_large_or_no_file_is_not_read(tmp_path: Path) -> None:
    with pytest.raises(OSError):
        two_drives(tmp_path)
    (tmp_path / "large.toml").write_text("#" * (1 << 17))
    with pytest.raises(OSError):
        two_drives(tmp_path / "large.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff")
    with pytest.raises(Problem, match=r"E446: .*bytes.toml is no text in UTF-8"):
        two_drives(tmp_path / "bytes.toml")
