"""Measured signals of an MCAP file, as the channels of a run: what `met export` writes, and joint states as JSON.

    /q, /elbow/servo/voltage   protobuf: a signal's topic, and a field for each joint and component; units are told by
                               the channel's metadata, `unit`, or `unit.FIELD` where they differ
    any topic                  JSON with the lists `name`, `position`, `velocity`, `effort`, in SI: joints' q, qd, tau

The file may come from anybody, so the amount of data taken from it is bounded. Times count from the run's beginning;
where they are those of a clock (`CLOCK`), from the log's first shown message.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any, cast

import numpy as np

from met.diagnostic import Place, Problem, error
from met.frozen import frozen
from met.host.files import open_regular
from met.messages.visible import visible
from met.unit_parser import parse_unit
from met.units import same, text

MOST_RECORD = 64 << 20
"""Largest size of a record, and of an uncompressed chunk."""

MOST_BYTES = 1 << 30
"""Largest size of all messages together."""

MOST_NUMBERS = 5_000_000
"""Largest number of numbers that are taken from a log."""

CLOCK = 1e9
"""Seconds from which on times count as those of a clock, which counts from 1970."""

SECOND = 1e9
STATES = {"position": "q", "velocity": "qd", "effort": "tau"}
"""Lists of a joint state, with the signals that they hold."""

DEEPEST = 3
"""Largest number of names in a field: its joint, its component, and one more."""

SHOWN = 40
"""Largest number of characters of a name in a message."""


@frozen
class MeasuredSignals:
    """A log's signals of a run: by channel the times (s, rising) and the numbers in SI, nan where there is none.

    column_texts  the columns that are shown, with their units; and where times count from
    unused        columns or topics that are not shown
    head          where a log that is a text names what it has
    """

    signals: dict[str, tuple[np.ndarray, np.ndarray]]
    column_texts: list[str]
    unused: list[str]
    head: Place | None = None


Reading = Callable[[bytes], Iterator[tuple[str, float]]]
"""The numbers of a message, by channel, in SI."""


def mcap_signals(path: str | Path, columns: Sequence[Mapping[str, str]]) -> MeasuredSignals:
    """The channels of a run in an MCAP file. columns: the channel, signal and SI unit of each. Raises Problem E478."""
    from google.protobuf.message import DecodeError
    from mcap.exceptions import EndOfFile, InvalidMagic, McapError

    log = _Log(str(path), columns)
    try:
        with open_regular(path) as file:
            log.read(file)
    except OSError as reason:
        raise Problem(error("E478", f"cannot read the MCAP file `{path}`: {reason.strerror}")) from None
    except InvalidMagic:
        raise Problem(error("E478", f"`{path}` is no MCAP file", help="MCAP files begin with `\\x89MCAP`")) from None
    except (EndOfFile, struct.error):
        helps = "`mcap recover` keeps what is in a file whose writer was killed"
        raise Problem(error("E478", f"`{path}` breaks off before its end, or is damaged", help=helps)) from None
    except (McapError, DecodeError, ValueError, TypeError, KeyError, RuntimeError, OverflowError) as reason:
        reason_text = visible(str(reason).split("\n")[0])[:120]
        raise Problem(error("E478", f"`{path}` cannot be read as an MCAP file: {reason_text}")) from None
    return log.measured_signals()


class _Log:
    """A log while it is being read."""

    def __init__(self, path: str, columns: Sequence[Mapping[str, str]]) -> None:
        """Begin with no record read. columns: of the run, the channel, signal and SI unit of each"""
        self.path = path
        self.units = {column["channel"]: column["unit"] for column in columns}
        self.signals: dict[str, set[str]] = {}
        for column in columns:
            self.signals.setdefault("/" + column["signal"].replace(".", "/"), set()).add(column["channel"])
        self.schemas: dict[int, Any] = {}
        self.topics: dict[int, str] = {}
        self.readings: dict[int, Reading | None] = {}
        self.channels: dict[int, Any] = {}
        self.shown_topics: set[str] = set()
        self.taken: dict[str, tuple[list[int], list[float]]] = {}
        self.count = 0
        self.prefixes: set[str] = set()

    def read(self, file: IO[bytes]) -> None:
        """Read all records. Raises the library's errors where it is not an MCAP file."""
        from mcap.records import Channel, Chunk, Message, Metadata, Schema
        from mcap.stream_reader import StreamReader, breakup_chunk

        total = 0
        for record in StreamReader(cast(Any, _Bounded(file)), emit_chunks=True, record_size_limit=MOST_RECORD).records:
            within: list[Any] = [record]
            if isinstance(record, Chunk):
                data = _uncompressed(record)
                total += len(data)
                if total > MOST_BYTES:
                    raise self.problem(f"has more than {MOST_BYTES >> 20:,} MiB of messages", "cut out what is shown")
                plain = Chunk("", data, record.message_end_time, record.message_start_time, 0, len(data))
                within = breakup_chunk(plain)
            for mcap_record in within:
                if isinstance(mcap_record, Schema):
                    self.schemas[mcap_record.id] = mcap_record
                elif isinstance(mcap_record, Channel):
                    self.channels[mcap_record.id], self.topics[mcap_record.id] = mcap_record, mcap_record.topic
                    self.readings.pop(mcap_record.id, None)
                elif isinstance(mcap_record, Message):
                    self.message(mcap_record)
                elif isinstance(mcap_record, Metadata) and mcap_record.name == "met.case":
                    self.prefixes.add(str(mcap_record.metadata.get("prefix", "")))
                    if len(self.prefixes) > 1:
                        helps = "export one: `met export ARCHIVE --case '#0' -o log.mcap`"
                        raise self.problem("has several cases, and a log is of one", helps)

    def message(self, message: Any) -> None:
        """Take the numbers of a message, by channel. Raises Problem for one of an unknown channel, or too many
        numbers."""
        number = message.channel_id
        if number not in self.channels:
            raise self.problem(f"has a message of channel {number}, which it does not describe")
        if number not in self.readings:
            self.readings[number] = self.reading(self.channels[number])
        reading = self.readings[number]
        for channel, value in reading(message.data) if reading is not None else ():
            times, values = self.taken.setdefault(channel, ([], []))
            times.append(message.log_time)
            values.append(value if math.isfinite(value) else math.nan)
            self.shown_topics.add(self.topics[number])
            self.count += 1
            if self.count > MOST_NUMBERS:
                raise self.problem(f"has more than {MOST_NUMBERS:,} numbers that are shown", "thin it out")

    def reading(self, channel: Any) -> Reading | None:
        """A reader of the numbers in a channel's messages; None where they are none of the run's."""
        schema = self.schemas.get(channel.schema_id)
        if channel.message_encoding == "json":
            return self.joint_states
        channels = self.signals.get(channel.topic)
        if channels is None or channel.message_encoding != "protobuf" or schema is None:
            return None
        from mcap_protobuf.decoder import DecoderFactory

        try:
            decoder = DecoderFactory().decoder_for(channel.message_encoding, schema)
        except RecursionError:
            raise self.problem("has a schema that is too deep") from None
        if decoder is None:
            return None
        signal = channel.topic[1:].replace("/", ".")
        scales: dict[tuple[str, ...], tuple[str, float] | None] = {}

        def scale(path: tuple[str, ...]) -> tuple[str, float] | None:
            """The channel of the run that a message's field is, and SI units of one of it; None where it is none."""
            if path not in scales:
                names = (_own(signal, path), _of_joint(signal, path))
                name = next((candidate for candidate in names if candidate in channels), None)
                scales[path] = None if name is None else (name, self.scale(channel, path, name))
            return scales[path]

        def read(data: bytes) -> Iterator[tuple[str, float]]:
            """The numbers of a message that channels of the run have, by channel, SI."""
            for path, value in _numbers(decoder(data)):
                reading = scale(path)
                if reading is not None:
                    yield reading[0], value * reading[1]

        return read

    def scale(self, channel: Any, path: tuple[str, ...], name: str) -> float:
        """SI units of one of a field's. Raises Problem E478."""
        wanted = self.units[name]
        unit_text = channel.metadata.get(f"unit.{'.'.join(path)}", channel.metadata.get("unit"))
        topic = f"topic `{_short(channel.topic)}` of `{self.path}`"
        if unit_text is None:
            if wanted == "1":
                return 1.0
            helps = f"let the metadata of its channel have `unit`, as `{wanted}`"
            raise Problem(error("E478", f"{topic} tells no unit", help=helps))
        try:
            measure = parse_unit(unit_text)
            scale = measure.scale
        except (ValueError, OverflowError, ZeroDivisionError, RecursionError):
            raise Problem(error("E478", f"{topic}: `{_short(unit_text)}` is not a unit")) from None
        if not same(measure.dimension, parse_unit(wanted).dimension):
            dimension = text(measure.dimension)
            message = f"{topic}: `{name}` is in {dimension}, and the run records it in {wanted}"
            raise Problem(error("E478", message, help=f"write it in {wanted}"))
        return scale

    def joint_states(self, data: bytes) -> Iterator[tuple[str, float]]:
        """The numbers of a joint state; none for another message."""
        try:
            state = json.loads(data)
        except RecursionError:
            raise self.problem("has a message that is too deep") from None
        names = state.get("name") if isinstance(state, dict) else None
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            return
        for part, signal in STATES.items():
            values = state.get(part) or []
            if not isinstance(values, list) or len(values) not in (0, len(names)):
                message = f"has a joint state with {len(names)} names whose `{part}` is not as long"
                raise self.problem(message, "a joint state has a number for each name, or an empty list")
            for name, value in zip(names, values, strict=False):
                if f"{name}.{signal}" in self.units:
                    number = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300
                    yield f"{name}.{signal}", float(value) if number else math.nan

    def measured_signals(self) -> MeasuredSignals:
        """The signals of the log by channel, each with rising instants in s from the first message on; of several
        numbers at one instant, the last."""
        unused = [
            visible(_short(topic)) for topic in dict.fromkeys(self.topics.values()) if topic not in self.shown_topics
        ]
        first = min((min(times) for times, _ in self.taken.values()), default=0)
        begin = first if first / SECOND >= CLOCK else 0
        signals = {}
        for channel, (times, values) in self.taken.items():
            instants = (np.array(times, object) - begin).astype(np.float64) / SECOND
            order = np.argsort(instants, kind="stable")
            instants, numbers = instants[order], np.array(values)[order]
            last = np.append(instants[1:] > instants[:-1], True)  # among several at one instant, the last
            signals[channel] = (instants[last], numbers[last])
        shown_channels = [f"{name} [{self.units[name]}]" for name in self.units if name in signals]
        since = [f"time since its first message, {begin / SECOND:.3f} s after 1970"] if begin else ["time [s]"]
        return MeasuredSignals(signals, [*since, *map(visible, shown_channels)] if signals else [], unused)

    def problem(self, message: str, helps: str = "") -> Problem:
        return Problem(error("E478", f"`{self.path}` {message}", help=[helps] if helps else []))


class _Bounded:
    """A file from which no more is read at once than a record may have, whatever lengths it declares."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file

    def read(self, count: int) -> bytes:
        return self._file.read(min(count, MOST_RECORD + 1))


def _own(signal: str, path: tuple[str, ...]) -> str:
    """The channel of a field of a signal that is of no joint: `links.tip.position.x`."""
    return signal if path == ("value",) else ".".join((signal, *path))


def _of_joint(signal: str, path: tuple[str, ...]) -> str:
    """The channel of a field whose first name is a joint: `elbow.reaction.force.x`."""
    return ".".join((path[0], signal, *path[1:]))


def _numbers(message: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], float]]:
    """The floating-point numbers of a message by their fields; of messages within it, too."""
    for field in message.DESCRIPTOR.fields:
        value, inner_path = getattr(message, field.name), (*path, field.name)
        if isinstance(value, float):
            yield inner_path, value
        elif hasattr(value, "DESCRIPTOR") and len(inner_path) < DEEPEST:
            yield from _numbers(value, inner_path)


def _uncompressed(chunk: Any) -> bytes:
    """The records of a chunk, whose declared sizes are not trusted. Raises ValueError."""
    import zstandard

    data: bytes = chunk.data
    try:
        if chunk.compression == "zstd":
            with zstandard.ZstdDecompressor(max_window_size=MOST_RECORD).stream_reader(data) as stream:
                data = stream.read(MOST_RECORD + 1)
        elif chunk.compression == "lz4":
            from lz4.frame import LZ4FrameDecompressor

            data = LZ4FrameDecompressor().decompress(data, MOST_RECORD + 1)
        elif chunk.compression:
            raise ValueError(f"it is compressed by {chunk.compression[:SHOWN]}, and zstd or lz4 are known")
    except (zstandard.ZstdError, RuntimeError, EOFError) as reason:  # lz4 raises RuntimeErrors
        raise ValueError(f"a chunk cannot be unpacked: {reason}") from None
    if len(data) > MOST_RECORD:
        raise ValueError(f"a chunk has more than {MOST_RECORD >> 20} MiB")
    return data


def _short(name: str) -> str:
    return name if len(name) <= SHOWN else name[:SHOWN] + "..."
