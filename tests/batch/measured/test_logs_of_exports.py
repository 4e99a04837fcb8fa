"""`met view --against` of what `met export` wrote, and of MCAP files of others."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from mcap.writer import CompressionType, Writer

from batch.export import wire
from batch.export.mcap import MAGIC
from batch.measured import mcap_log
from batch.portable.page import log_data
from met import cli
from met.diagnostic import Problem

DECK = """\
#include <two_link.ic>
run brief like nominal {
    duration = 1 s;  remove settle;  record = [q, qd, tau, reaction.force];  initial { elbow.q = 1 rad; }
}
sweep tuned of brief { vary gearbox.kp = [0.005, 0.02] V*s/rad; }
"""

JOINTS = ("shoulder", "elbow")
COLUMNS = [
    {"channel": f"{joint}.{signal}", "signal": signal, "unit": unit}
    for signal, unit in (("q", "rad"), ("qd", "rad/s"), ("tau", "N*m"))
    for joint in JOINTS
]
FORCES = [
    {"channel": f"{joint}.reaction.force.{part}", "signal": "reaction.force", "unit": "N"}
    for joint in JOINTS
    for part in "xyz"
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exports")
    (folder / "deck.ic").write_text(DECK, encoding="utf-8")
    run = ["run", str(folder / "deck.ic"), "tuned", "-q", "--no-picture", "-o", str(folder / "a.h5")]
    assert cli.main(run) == cli.YES
    for name, words in (("one", ["--case", "#1"]), ("both", ["--case", "#0", "--case", "#1"])):
        for ending in ("mcap", "csv"):
            output = str(folder / f"{name}.{ending}")
            assert cli.main(["export", str(folder / "a.h5"), "-q", "-o", output, *words]) == 0
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["mcap", "csv"])
def test_what_is_exported_comes_back_with_its_bits(folder: Path, ending: str) -> None:
    with xarray.open_dataset(folder / "a.h5") as data:
        found = log_data(folder / f"one.{ending}", [*COLUMNS, *FORCES], data["time"].values)
        joints = data["joint"].values.tolist()
        compared = 0
        for column, values in zip([*COLUMNS, *FORCES], found["values"], strict=True):
            joint, _, rest = column["channel"].partition(".")
            stored = data[column["signal"]].values[1][:, joints.index(joint)]
            expected = stored if column["signal"] == rest else stored[:, "xyz".index(rest[-1])]
            assert values.tolist() == expected.tolist()
            compared += len(values)
    assert compared == 312
    assert "shoulder.q [rad]" in found["told"] and "elbow.reaction.force.z [N]" in found["told"]


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["mcap", "csv"])
def test_an_export_of_several_cases_is_refused_and_one_of_them_makes_a_page(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], ending: str
) -> None:
    monkeypatch.chdir(folder)
    assert cli.main(["view", "a.h5", "--against", f"both.{ending}", "-o", "no.html"]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"error[E478]: `both.{ending}` has several cases, and a log is of one\n")
    assert f" = help: export one: `met export ARCHIVE --case '#0' -o log.{ending}`\n" in said
    assert cli.main(["view", "a.h5", "--against", f"one.{ending}", "-q", "-o", "page.html"]) == 0
    assert f'"name":"one.{ending}"' in (folder / "page.html").read_text(encoding="utf-8").replace('": "', '":"')


def test_a_line_of_units_has_one_a_column(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("# units: s\ntime,elbow.q\n0,1\n1,2\n", encoding="utf-8")
    assert refusal(tmp_path / "log.csv", code="D197") == "this line has 1 units, and 2 columns follow"
    (tmp_path / "log.csv").write_text("# units: s,deg\ntime,elbow.q\n0,0\n1,180\n", encoding="utf-8")
    found = log_data(tmp_path / "log.csv", COLUMNS, np.array([0.0, 0.5]))
    assert found["values"][1].tolist() == [0.0, pytest.approx(np.pi / 2)]


def refusal(path: Path, columns: Sequence[Mapping[str, str]] = COLUMNS, code: str = "E478") -> str:
    with pytest.raises(Problem) as raised:
        log_data(path, columns, np.arange(11) / 10)
    (found,) = raised.value.diagnostics
    assert found.code == code
    return found.message.replace(str(path), "log.mcap")


def written(path: Path, write: Callable[[Writer], None], **options: Any) -> Path:
    with path.open("wb") as file:
        writer = Writer(file, **options)
        writer.start()
        write(writer)
        writer.finish()
    return path


def states(messages: Sequence[tuple[float, Any]]) -> Callable[[Writer], None]:
    def write(writer: Writer) -> None:
        schema = writer.register_schema("JointState", "jsonschema", b'{"type": "object"}')
        channel = writer.register_channel("/joint_states", "json", schema)
        for time, message in messages:
            data = message if isinstance(message, bytes) else json.dumps(message).encode()
            writer.add_message(channel, round(time * 1e9), data, round(time * 1e9))

    return write


def state(position: Sequence[Any], **more: Any) -> dict[str, Any]:
    return {"name": ["elbow", "gripper"], "position": position, **more}


@pytest.mark.parametrize("compression", list(CompressionType))
def test_joint_states_as_json_are_taken_on_their_clock_or_from_their_first(
    tmp_path: Path, compression: CompressionType
) -> None:
    messages = [(0.0, state([1.0, 9.0])), (0.5, state([2.0, 9.0], velocity=[3.0, 0.0])), (1.0, state([3, None]))]
    rows = np.array([0.0, 0.25, 0.5, 1.0, 1.1])
    for since in (0.0, 1.7e9):
        moved = [(since + time, message) for time, message in messages]
        path = written(tmp_path / "log.mcap", states(moved), compression=compression)
        found = log_data(path, COLUMNS, rows)
        q, qd = found["values"][1], found["values"][3]
        assert q[:4].tolist() == [1.0, 1.5, 2.0, 3.0] and np.isnan(q[4])
        assert qd[2] == 3.0 and np.isnan(qd[[0, 1, 3, 4]]).all()
        assert found["values"][0] is None
        first = "time [s]" if not since else "time since its first message, 1700000000.000 s after 1970"
        assert found["told"] == [first, "elbow.q [rad]", "elbow.qd [rad/s]"]


def test_numbers_that_are_none_are_gaps(tmp_path: Path) -> None:
    messages = [(0.0, state([1.0, 0])), (0.5, b'{"name": ["elbow"], "position": [NaN]}'), (1.0, state([True, 0]))]
    found = log_data(written(tmp_path / "log.mcap", states(messages)), COLUMNS, np.array([0.0, 0.2, 0.5, 1.0]))
    assert found["values"][1][0] == 1.0 and np.isnan(found["values"][1][1:]).all()


def signal(topic: str, metadata: dict[str, str]) -> Callable[[Writer], None]:
    def write(writer: Writer) -> None:
        fields = wire.tree([("elbow",), ("hand",)])
        schema = writer.register_schema("met.q", "protobuf", wire.schema("q", fields))
        channel = writer.register_channel(topic, "protobuf", schema, metadata)
        for row, data in enumerate(wire.rows(fields, np.array([[0.0, 7.0], [180.0, 7.0]]))):
            writer.add_message(channel, row * 1_000_000_000, data, 0)

    return write


def test_units_of_a_channel_are_told_by_its_metadata(tmp_path: Path) -> None:
    path = written(tmp_path / "log.mcap", signal("/q", {"unit": "m", "unit.elbow": "deg"}))
    found = log_data(path, COLUMNS, np.array([0.0, 0.5, 1.0]))
    assert found["values"][1] == pytest.approx([0.0, np.pi / 2, np.pi])


@pytest.mark.parametrize(
    ("write", "said"),
    [
        (signal("/q", {}), "topic `/q` of `log.mcap` tells no unit"),
        (signal("/q", {"unit": "furlong"}), "topic `/q` of `log.mcap`: `furlong` is not a unit"),
        (
            signal("/q", {"unit": "V"}),
            "topic `/q` of `log.mcap`: `elbow.q` is in V, and the run records it in rad",
        ),
        (signal("/p", {"unit": "rad"}), "no topic of `log.mcap` is a signal that the run records"),
        (
            states([(5.0, state([1, 2])), (6.0, state([1, 2]))]),
            "the log is from 5 s to 6 s,",
        ),
        (states([(0.0, state([1]))]), "`log.mcap` has a joint state with 2 names whose `position` is not as long"),
        (states([(0.0, b"[" * 100_000)]), "`log.mcap` has a message that is too deep"),
        (states([(0.0, b"\xff")]), "`log.mcap` cannot be read as an MCAP file: 'utf-8' codec can't decode"),
    ],
)
def test_what_does_not_fit_is_refused_with_its_topic(
    tmp_path: Path, write: Callable[[Writer], None], said: str
) -> None:
    assert refusal(written(tmp_path / "log.mcap", write)).startswith(said)


def test_files_that_are_none_are_refused(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "log.mcap"
    assert refusal(path) == "cannot read the MCAP file `log.mcap`: No such file or directory"
    path.write_bytes(b"time [s], elbow.q [deg]\n")
    assert refusal(path) == "`log.mcap` is no MCAP file"
    whole = (folder / "one.mcap").read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    assert refusal(path) == "`log.mcap` breaks off before its end, or is damaged"
    path.write_bytes(MAGIC + b"\x06" + struct.pack("<Q", 1 << 60))
    assert "exceeds limit" in refusal(path)


def test_a_file_with_damaged_bytes_is_read_or_refused_and_nothing_else(tmp_path: Path) -> None:
    source = written(tmp_path / "small.mcap", signal("/q", {"unit": "rad"})).read_bytes()
    random = np.random.default_rng(25)
    refused = 0
    for _ in range(300):
        data = bytearray(source)
        for place in random.integers(8, len(data), 3):
            data[place] = random.integers(256)
        (tmp_path / "log.mcap").write_bytes(data)
        try:
            log_data(tmp_path / "log.mcap", COLUMNS, np.arange(11) / 10)
        except Problem:
            refused += 1
    assert refused > 50


def test_a_chunk_that_grows_when_it_is_unpacked_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mcap_log, "MOST_RECORD", 1 << 16)
    zstd = "a chunk cannot be unpacked: zstd decompress error: Frame requires too much memory"
    for compression, said in ((CompressionType.ZSTD, zstd), (CompressionType.LZ4, "a chunk has more than")):
        write = states([(0.0, b" " * 500_000)])
        path = written(tmp_path / "log.mcap", write, compression=compression, chunk_size=1 << 22)
        assert refusal(path).startswith(f"`log.mcap` cannot be read as an MCAP file: {said}")
    monkeypatch.setattr(mcap_log, "MOST_NUMBERS", 10)
    many = states([(n / 100, state([n, n])) for n in range(20)])
    assert refusal(written(tmp_path / "log.mcap", many)) == "`log.mcap` has more than 10 numbers that are shown"
