"""MCAP files for Foxglove and Lichtblick: https://mcap.dev. Their clock is the simulated time, from 0.

    metadata     met.export: what made the file; met.case, one a case: what case it is
    attachments  the deck's files, as they were read
    /tf          foxglove.FrameTransforms: each link's frame in that of the link that carries it, at each row
    /scene       foxglove.SceneUpdate: what the links look like, once
    /log         foxglove.Log: how the cases went; one topic for all of them
    /result      met.result: metrics, requirements, status, once at the end
    /<signal>    of a signal, a field for each joint and component: `/qd.elbow`, `/reaction/force.elbow.x`

Of several cases each has frames and topics of its own, under its prefix, as `/case7/qd`; all but the first are ghosts.
The case of a link `world` aside, frames hang on `world`, which is the base, or what a base that is a link moves in.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from batch.archive.read import ArchiveFile
from batch.arms.meshes import arm_meshes
from batch.campaigns.campaign import Campaign
from batch.export import layout, scene, wire
from batch.export.case_log import LogLine, log_lines, result, varied
from batch.export.formats import ExportFormat, ExportRequest, WrittenExport
from batch.export.output import check, whole
from batch.export.picking import ExportedCase, SignalColumn
from batch.export.poses import PosedArm, arm_of, lacking_text, root_frame
from batch.export.wire import plain
from met.diagnostic import Diagnostic, Problem, error
from met.frozen import frozen
from met.host.files import open_regular
from met.outputs import quoted
from met.version import VERSION

if TYPE_CHECKING:
    from mcap.writer import Writer

MAGIC = b"\x89MCAP0\r\n"
ABOUT = "met.export"
"""The first record of an export of MET's."""

HEAD_BYTES = 1000
OVERLAID = 8
"""Largest number of cases that are shown together unless they are asked for by name."""

BLOCK_ROWS = 1000
"""Number of rows whose messages are made at once."""

SECOND = 1_000_000_000

LONGEST = 1 << 63
"""Upper bound of times in nanoseconds: they are counted in 64 bits, one of them a sign."""

Message = tuple[int, int, int, bytes]
"""Time, ns; the case and channel, by which messages of one time are ordered; content."""


def arms(file: ArchiveFile, cases: Sequence[ExportedCase], *, named: bool) -> list[PosedArm]:
    """The arms of the cases. named: whether the cases were asked for one by one. Raises Problem E370, E372,
    E376."""
    for case in cases:
        end = max(case.time, default=0.0)
        if end * SECOND >= LONGEST:
            message = f"`{case.run_name}` ends at {end:g} s: times of an MCAP file are below {LONGEST / SECOND:.3g} s"
            raise Problem(error("E376", message, help="`-o FILE.csv` has times of any length"))
    if len(cases) > OVERLAID and not named:
        helps = (
            f"`--case '#{cases[0].number}' --case '#{cases[1].number}'` shows these over one another",
            f"`met show {quoted(file.path)}` lists the cases, the worst first",
        )
        raise Problem(too_many(len(cases), cases[0].run_name, helps))
    plan = file.plan(as_written=True)
    one_run = len({case.run_name for case in cases}) == 1
    prefixes = [f"case{case.number}/" if one_run else f"{case.run_name}/case{case.number}/" for case in cases]
    return [arm_of(plan, case, prefix if len(cases) > 1 else "") for case, prefix in zip(cases, prefixes, strict=True)]


def too_many(cases: int, names: str, helps: Sequence[str]) -> Diagnostic:
    """The error that more than `OVERLAID` cases were asked for."""
    return error("E372", f"{cases:,} cases of `{names}` are too many to show over one another", help=helps)


def write(file: ArchiveFile, arms: Sequence[PosedArm], output: Path) -> int:
    """Write the cases of these arms; returns the number of their rows. Raises Problem E305."""
    from mcap.writer import Writer

    with whole(output) as sink:
        writer = Writer(sink)  # type: ignore[arg-type]  # which writes, and tells where it is
        writer.start(library=f"MET {VERSION}")
        _about(writer, file, arms)
        channels = Channels(writer)
        streams = [_messages(channels, arms, number) for number in range(len(arms))]
        for time, _, channel, data in heapq.merge(*streams):
            writer.add_message(channel, time, data, time)
            sink.check()
        writer.finish()
    return sum(len(arm.case.time) for arm in arms)


def _about(writer: Writer, file: ArchiveFile, arms: Sequence[PosedArm]) -> None:
    """Write the origin of the file, before all else: a later export recognises by it that it may overwrite the file."""
    about = {
        "archive": file.path.name,
        "deck": file.deck,
        "arm": arms[0].experiment.structure.arm,
        "base_frame": root_frame(arms),
        "met": VERSION,
        **{name: str(value) for name, value in file.provenance.items()},
    }
    writer.add_metadata(ABOUT, {plain(name): plain(value) for name, value in about.items()})
    for arm in arms:
        case, group = arm.case, arm.case.group
        keys = {name: str(case.value(name)) for name in ("case_id", "case_key") if name in group.variables}
        data = {
            "prefix": arm.prefix,
            "run": case.run_name,
            "case": str(case.number),
            **keys,
            **{f"varied.{path}": value for path, value in varied(case).items()},
        }
        writer.add_metadata("met.case", {plain(name): plain(value) for name, value in data.items()})
    for name, text in file.sources().items():
        writer.add_attachment(0, 0, plain(name), "text/plain", plain(text).encode())


class Channels:
    """The channels of a file. A schema that several channels share is stored once; schemas of one name are equal."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._schemas: dict[tuple[str, bytes], int] = {}
        self._described: dict[tuple[str, tuple[wire.MessageField, ...]], tuple[str, bytes]] = {}
        self._topics: dict[str, int] = {}

    def foxglove(self, topic: str, kind: Any) -> int:
        """The channel of one of foxglove's messages."""
        from mcap_protobuf.schema import build_file_descriptor_set

        data = build_file_descriptor_set(kind).SerializeToString(deterministic=True)
        return self._channel(topic, kind.DESCRIPTOR.full_name, data, {})

    def own(self, topic: str, name: str, fields: tuple[wire.MessageField, ...], metadata: dict[str, str]) -> int:
        """The channel of a message type of MET's. metadata: of the channel, such as units"""
        if (name, fields) not in self._described:
            used = {known.removeprefix(f"{wire.PACKAGE}.") for known, _ in self._described.values()}
            numbered = (f"{name}_{number}" for number in itertools.count(2))  # of another structure of the sweep
            unlike = next(candidate for candidate in itertools.chain([name], numbered) if candidate not in used)
            self._described[name, fields] = f"{wire.PACKAGE}.{unlike}", wire.schema(unlike, fields)
        return self._channel(topic, *self._described[name, fields], metadata)

    def _channel(self, topic: str, name: str, data: bytes, metadata: dict[str, str]) -> int:
        """The number of a topic's channel, made at the first call."""
        if topic in self._topics:
            return self._topics[topic]
        if (name, data) not in self._schemas:
            self._schemas[name, data] = self._writer.register_schema(name, "protobuf", data)
        schema = self._schemas[name, data]
        self._topics[topic] = self._writer.register_channel(topic, "protobuf", schema, metadata)
        return self._topics[topic]


@frozen
class SignalStream:
    """A signal's messages to be made. values: its numbers, (row, column)."""

    channel: int
    fields: tuple[wire.MessageField, ...]
    values: np.ndarray


def _messages(channels: Channels, arms: Sequence[PosedArm], number: int) -> Iterator[Message]:
    """The messages of a case, in the order of their times."""
    from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
    from foxglove_schemas_protobuf.Log_pb2 import Log
    from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

    arm, base = arms[number], root_frame(arms)
    case = arm.case
    frames = channels.foxglove(arm.topic("tf"), FrameTransforms)
    drawn = channels.foxglove(arm.topic("scene"), SceneUpdate)
    log = channels.foxglove("/log", Log)
    streams = [_stream(channels, arm, name, columns) for name, columns in case.signals.items()]
    lines = log_lines(case)
    update = scene.scene(arm, base, number > 0, scene.size(arms))
    yield 0, number, drawn, update.SerializeToString(deterministic=True)
    yield from ((0, number, log, _log(case, arm, line)) for line in lines if line.time == 0.0)
    times = nanoseconds(case.time)
    for first in range(0, len(times), BLOCK_ROWS):
        block = slice(first, first + BLOCK_ROWS)
        blocks = [(frames, _transforms(arm, base, times, block))]
        blocks += [(stream.channel, wire.rows(stream.fields, stream.values[block])) for stream in streams]
        for row, time in enumerate(times[block]):
            for channel, messages in blocks:
                yield time, number, channel, messages[row]
    yield from ((_ns(line.time), number, log, _log(case, arm, line)) for line in lines if line.time > 0.0)
    parts, data = result(case)
    units = {v.name.rpartition(".")[2]: v.unit for v in case.group.role("metric")}
    metadata = {f"unit.{name}": unit for name, unit in units.items()}
    channel = channels.own(arm.topic("result"), "result", parts, metadata)
    yield _ns(lines[-1].time), number, channel, wire.message(parts, data)


def _stream(channels: Channels, arm: PosedArm, name: str, columns: Sequence[SignalColumn]) -> SignalStream:
    """The channel and the values [row, column] of a signal that an MCAP file gets."""
    values = arm.case.signal(name)[:, [column.place for column in columns]]
    parts = wire.tree([column.parts or ("value",) for column in columns])
    units = {".".join(column.parts or ("value",)): column.unit for column in columns}
    same_unit = len(set(units.values())) == 1
    metadata = {"unit": columns[0].unit} if same_unit else {f"unit.{path}": unit for path, unit in units.items()}
    channel = channels.own(arm.topic(name), name.replace(".", "_"), parts, {**metadata, "about": columns[0].about})
    return SignalStream(channel, parts, values)


def _transforms(arm: PosedArm, base: str, times: Sequence[int], block: slice) -> list[bytes]:
    """The frames of all links at some rows."""
    from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
    from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
    from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
    from foxglove_schemas_protobuf.Vector3_pb2 import Vector3

    moved = []
    for link, pose in arm.poses.items():
        parent = arm.parents[link]
        names = (arm.prefix + parent if parent in arm.poses else base, arm.prefix + link)
        moved.append((*names, pose.position[block].tolist(), pose.orientation[block].tolist()))
    out = []
    for row, time in enumerate(times[block]):
        stamp = _stamp(time)
        message = FrameTransforms()
        for parent, child, position, orientation in moved:
            (px, py, pz), (w, x, y, z) = position[row], orientation[row]
            place, turn = Vector3(x=px, y=py, z=pz), Quaternion(x=x, y=y, z=z, w=w)
            message.transforms.append(
                FrameTransform(
                    timestamp=stamp, parent_frame_id=parent, child_frame_id=child, translation=place, rotation=turn
                )
            )
        out.append(message.SerializeToString())
    return out


def _log(case: ExportedCase, arm: PosedArm, line: LogLine) -> bytes:
    """A line of a case's log as a message for Foxglove."""
    from foxglove_schemas_protobuf.Log_pb2 import Log

    name = arm.prefix.rstrip("/") or case.run_name
    level = Log.Level.Value(line.level)
    return bytes(
        Log(timestamp=_stamp(_ns(line.time)), level=level, message=plain(line.text), name=name).SerializeToString()
    )


def nanoseconds(seconds: np.ndarray) -> list[int]:
    """Simulated times in nanoseconds, as of a clock."""
    whole: list[int] = np.rint(seconds * SECOND).astype(np.int64).tolist()
    return whole


def _ns(seconds: float) -> int:
    return nanoseconds(np.array([seconds]))[0]


def _stamp(time: int) -> Any:
    from google.protobuf.timestamp_pb2 import Timestamp

    return Timestamp(seconds=time // SECOND, nanos=time % SECOND)


def _check_positions(campaign: Campaign, target: Path) -> None:
    """Refuse a campaign that does not record q of every joint, without which no arm can be shown. Raises Problem
    E370."""
    for part in campaign.parts:
        structure = part.experiment.structure
        recorded = {channel for recording in structure.record for channel in recording.channels}
        lacking = [joint.name for joint in structure.moving if f"{joint.name}.q" not in recorded]
        if part.recorded and lacking:
            which = lacking_text(lacking, structure.moving)
            message = (
                f"the arm of `{part.experiment.name_in_deck}` could not be shown in {target}: {which} is not recorded"
            )
            helps = (
                "`record = [q, ...]` in the run keeps where its joints are",
                f"`-o {quoted(target.with_suffix('.csv'))}` needs no positions",
            )
            raise Problem(error("E370", message, help=helps))


class Mcap(ExportFormat):
    """Histories for Foxglove and Lichtblick, and a layout beside them."""

    title = "an MCAP file"
    tables = ("histories",)
    options = ("layout", "meshes")
    metrics_in = "in an MCAP file they are in `/result`"

    def is_own(self, path: Path) -> bool:
        """Return True where a file is an export of MET's, whole or in part."""
        with open_regular(path) as file:
            head = file.read(HEAD_BYTES)
        return head.startswith(MAGIC) and ABOUT.encode() in head

    def check_campaign(self, campaign: Campaign, target: Path) -> None:
        """Refuse a campaign that cannot be shown: positions are not recorded, or it has too many cases. Raises Problem
        E370, E372."""
        _check_positions(campaign, target)
        recorded = sum(len(part.history_places) for part in campaign.parts)
        if recorded > OVERLAID:
            archive = quoted(target.with_suffix(".h5"))
            helps = (
                "`--case '#0'` runs one alone, and `--histories '#0'` keeps the signals of one",
                f"or run all, and choose then: `-o {archive}`, `met export {archive} --case '#0'`",
            )
            raise Problem(too_many(recorded, ", ".join(campaign.run_names), helps))

    def write_histories(
        self, file: ArchiveFile, cases: Sequence[ExportedCase], target: Path, request: ExportRequest
    ) -> WrittenExport:
        """Write the histories of these cases, and, if asked for, a layout that shows them in Foxglove."""
        solid, *ghosts = arms(file, cases, named=request.named)
        if request.meshes:
            solid = replace(solid, meshes=arm_meshes(solid.experiment.structure, file.path.parent))
        posed_arms, note = [solid, *ghosts], solid.meshes.words
        if not request.layout:
            return WrittenExport(write(file, posed_arms, target), note=note)
        text, beside = layout.text(posed_arms), target.with_suffix(layout.ENDING)
        check(beside, file.path, lambda path: path.read_text("utf-8", "replace") == text, force=request.force)
        rows = write(file, posed_arms, target)
        with whole(beside) as sink:
            sink.write(memoryview(text.encode()))
        return WrittenExport(rows, beside, note)


FORMAT = Mcap()
