"""Transcripts: every byte that went over a line, either way, when, and in its order with the others.

    line       MET bed transcript 1
    header     a record whose bytes are JSON
    records    kind u8, time f64, length u16, bytes, CRC-32 u32, little-endian

time is that of the line's clock, s. The CRC is of the record, from the CRC of the one before it, so that none can be
missing. A record is written with one call: a crash loses at most the last one.
"""

from __future__ import annotations

import contextlib
import json
import math
import struct
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from hw.line import BedLine, LineOverLine
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.host.files import parse_json, read_regular, settle

MAGIC = b"MET bed transcript 1\n"

HEADER, OPENED, SENT, RECEIVED, LOST = range(5)
"""Kinds of records. OPENED: the line was opened, without bytes; LOST: the line was lost, with the reason in words."""

_HEAD = struct.Struct("<BdH")
_MOST = 0xFFFF


@frozen
class TranscriptRecord:
    kind: int
    time: float
    data: bytes


@frozen
class Transcript:
    """The contents of a transcript's file. cut: bytes at its end that are no whole record."""

    header: Mapping[str, Any]
    records: tuple[TranscriptRecord, ...]
    cut: int


class TranscriptWriter:
    """Writes a transcript. put: takes the bytes of one record, or of the file's beginning; it is called once for
    each."""

    def __init__(self, put: Callable[[bytes], object], header: Mapping[str, Any]) -> None:
        self._put, self._crc = put, 0
        self._put(MAGIC + self._record(HEADER, 0.0, json.dumps(header).encode()))

    def add(self, kind: int, time: float, data: bytes) -> None:
        for start in range(0, len(data) or 1, _MOST):
            self._put(self._record(kind, time, data[start : start + _MOST]))

    def _record(self, kind: int, time: float, data: bytes) -> bytes:
        body = _HEAD.pack(kind, time, len(data)) + data
        self._crc = zlib.crc32(body, self._crc)
        return body + self._crc.to_bytes(4, "little")


class TranscriptFile:
    """A new file, written without a buffer in this process, so that its contents outlive it."""

    def __init__(self, path: str | Path) -> None:
        """Make the file, and its folder if it does not exist."""
        try:
            with contextlib.suppress(FileExistsError):  # no folder: then no file can be made in it
                Path(path).parent.mkdir(parents=True, exist_ok=True)
            self._file = open(path, "xb", buffering=0)  # noqa: SIM115
        except FileExistsError:
            helps = "give another name: what was said to a bed is not overwritten"
            raise Problem(error("E409", f"{path} is there already", help=helps)) from None
        except OSError as reason:
            message = f"{path} cannot be written: {reason.strerror}"
            raise Problem(error("E409", message, help="give another place")) from None

    def __call__(self, data: bytes) -> None:
        self._file.write(data)

    def close(self) -> None:
        """Put all of it on the disk, and close it."""
        settle(self._file.fileno())
        self._file.close()


class TranscribedLine(LineOverLine):
    """A line with a transcript of its traffic. If the transcript cannot be written, that is raised once, and the line
    goes on without it."""

    def __init__(self, line: BedLine, writer: TranscriptWriter) -> None:
        super().__init__(line)
        self._writer = writer
        self._writing = True
        self._add(OPENED, b"")

    def send(self, frame: bytes) -> None:
        """Send bytes, and put them into the transcript, also where the line is lost."""
        try:
            self._line.send(frame)
        except Problem as lost:
            self._add(SENT, frame)
            self._lost(lost)
            raise
        self._add(SENT, frame)

    def receive(self, until: float) -> bytes:
        """The bytes that come before the time `until`, s, put into the transcript."""
        try:
            data = self._line.receive(until)
        except Problem as lost:
            self._lost(lost)
            raise
        if data:
            self._add(RECEIVED, data)
        return data

    def _lost(self, lost: Problem) -> None:
        self._add(LOST, lost.diagnostics[0].message.encode())

    def _add(self, kind: int, data: bytes) -> None:
        """Add a record to the transcript. Raises Problem E409, once, where it cannot be written."""
        if not self._writing:
            return
        try:
            self._writer.add(kind, self._line.now(), data)
        except OSError as reason:
            self._writing = False
            message = f"the transcript of the bed cannot be written: {reason.strerror}"
            raise Problem(error("E409", message, help="make room for it, or give another place")) from None


def read(path: str | Path) -> Transcript:
    """Read all records of a transcript up to the first that is not sound. Raises Problem E409."""
    try:
        data = read_regular(path)
    except OSError as reason:
        helps = "give the file that a run with a bed wrote"
        raise Problem(error("E409", f"{path} cannot be read: {reason.strerror}", help=helps)) from None
    records = list[TranscriptRecord]()
    position, crc = len(MAGIC), 0
    while len(data) - position >= _HEAD.size + 4:
        kind, time, length = _HEAD.unpack_from(data, position)
        end = position + _HEAD.size + length
        crc = zlib.crc32(data[position:end], crc)
        if end + 4 > len(data) or crc != int.from_bytes(data[end : end + 4], "little"):
            break
        if kind > LOST or not math.isfinite(time):
            break
        records.append(TranscriptRecord(kind, time, data[position + _HEAD.size : end]))
        position = end + 4
    try:
        if not data.startswith(MAGIC) or not records or records[0].kind != HEADER:
            raise ValueError
        header = parse_json(records[0].data)
        if not isinstance(header, dict):
            raise ValueError
    except ValueError:
        helps = "give the file that a run with a bed wrote"
        raise Problem(error("E409", f"{path} is no transcript of a bed", help=helps)) from None
    return Transcript(header, tuple(records[1:]), len(data) - position)
