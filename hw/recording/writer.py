"""Records on their way from the loop to the disk: the ring that takes them, and the process that writes them.

    python -m hw.recording.writer RING ROOM PIPE PATH < head

RING and PIPE are files that are open already: the ring's memory, and the reading end of a pipe whose other end the loop
has. When the loop is done, or is no more, the pipe ends; then what is left in the ring is written, and synced.

The loop puts records in, the writer takes them out. The count is written after the record, and a record proves itself,
so the writer takes none that is half there.
"""

from __future__ import annotations

import contextlib
import json
import mmap
import os
import select
import signal
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from hw.recording import records
from hw.recording.records import SIZE
from met.diagnostic import Problem, error
from met.host import interpreter, system
from met.host.files import settle

_COUNT = struct.Struct("<Q")
_HEAD = 64
"""Bytes before the records: the number of records put in, and in another cache line the number taken out."""


class RingFull(Exception):
    """The writer is a whole ring behind: the disk has stalled."""


class Ring:
    """A ring of records in shared memory. file: of the memory, from `make`;  room: number of records"""

    def __init__(self, file: int, room: int) -> None:
        self.file, self.room = file, room
        self._memory = mmap.mmap(file, 2 * _HEAD + room * SIZE)
        self._put = _COUNT.unpack_from(self._memory, 0)[0]
        self._taken = _COUNT.unpack_from(self._memory, _HEAD)[0]

    def put(self, record: bytes) -> None:
        """Put a record in. Raises RingFull."""
        if self._put - self._taken >= self.room:
            self._taken = _COUNT.unpack_from(self._memory, _HEAD)[0]
            if self._put - self._taken >= self.room:
                raise RingFull
        start = 2 * _HEAD + self._put % self.room * SIZE
        self._memory[start : start + SIZE] = record
        self._put += 1
        _COUNT.pack_into(self._memory, 0, self._put)

    def take(self) -> Iterator[bytes]:
        """Take the present records, each once. A record counts as taken when the next is asked for."""
        put_count = _COUNT.unpack_from(self._memory, 0)[0]
        while self._taken < put_count:
            start = 2 * _HEAD + self._taken % self.room * SIZE
            record = self._memory[start : start + SIZE]
            if zlib.crc32(record[:-4]) != int.from_bytes(record[-4:], "little"):
                return  # it is not completely visible from here yet
            yield record
            self._taken += 1
            _COUNT.pack_into(self._memory, _HEAD, self._taken)

    def close(self) -> None:
        self._memory.close()
        os.close(self.file)


def make_ring(room: int) -> Ring:
    """A ring for `room` records, in memory without a name: it is gone with the last process that has it open."""
    file = system.nameless_file()
    os.ftruncate(file, 2 * _HEAD + room * SIZE)
    return Ring(file, room)


RING_BYTES = 64 << 20
"""Largest size of the ring, bytes: records of some minutes may wait for the disk."""

PAUSE = 0.005
"""s between two looks into the ring."""


def write(through: Ring, pipe: int, path: Path, head: bytes) -> None:
    """Write the records from the ring, until the pipe ends. head: JSON, written before the records"""
    with path.open("xb", buffering=0) as file:
        file.write(records.MAGIC + len(head).to_bytes(8, "little") + head)
        ended = False
        while not ended:
            ended = bool(select.select([pipe], [], [], PAUSE)[0]) and not os.read(pipe, 1)
            waiting = b"".join(through.take())
            while waiting:
                waiting = waiting[file.write(waiting) :]
        settle(file.fileno())


_LOOK = 64
"""Number of records between two checks that the process is still there."""


class WriterGone(Exception):
    """The writer's process has ended before the loop: nobody writes the records."""


class RecordsWriter:
    """The process that writes the records of a run, from the loop's side."""

    def __init__(self, through: Ring, path: Path, head: bytes) -> None:
        """Start the process. through: the ring that the loop fills; path: of the file; head: its first bytes, JSON"""
        self._ring, self._path, self._count = through, path, 0
        read, self._alive = os.pipe()
        os.set_inheritable(self._alive, False)
        command = interpreter.command("hw.recording.writer", str(through.file), str(through.room), str(read), str(path))
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stderr=subprocess.PIPE,
            pass_fds=[through.file, read],
            start_new_session=True,
            env=interpreter.environment(),
        )
        os.close(read)
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # it has ended, and is heard of at the first look
            self._process.stdin.write(head)
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.close()

    def put(self, record: bytes) -> None:
        """Hand over a record. Raises WriterGone, RingFull."""
        self._count += 1
        if self._count % _LOOK == 0 and self._process.poll() is not None:
            raise WriterGone
        self._ring.put(record)

    def close(self) -> str:
        """Wait until all records are on the disk. Returns why they are not, in words; "" where they are."""
        os.close(self._alive)
        assert self._process.stderr is not None
        with self._process.stderr as stderr:
            complaint = stderr.read().decode("utf-8", "replace").strip()
        status = self._process.wait()
        self._ring.close()
        return complaint or (f"cannot write {self._path}: its process ended with {status}" if status else "")


@contextlib.contextmanager
def recording(path: Path, head: Mapping[str, Any], most: int) -> Iterator[Callable[[bytes], None]]:
    """Give a function that takes records, at most `most`. All are in the file at the end. Raises Problem E413, in
    the middle of a run too, so that no bed is driven without records."""
    writer = RecordsWriter(make_ring(min(most, RING_BYTES // records.SIZE)), path, json.dumps(head).encode())
    stalled = ""
    try:
        yield writer.put
    except WriterGone:
        stalled = f"cannot write {path}: its process has ended"
    except RingFull:
        stalled = f"cannot write {path}: the disk has taken nothing for minutes"
    finally:
        if wrong := writer.close() or stalled:
            raise Problem(error("E413", wrong, help="free the disk, or give another place with `-o`"))


def main() -> None:
    """The process that writes the records."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # it ends with the loop
    memory, room, pipe = map(int, sys.argv[1:4])
    path = Path(sys.argv[4])
    try:
        write(Ring(memory, room), pipe, path, sys.stdin.buffer.read())
    except OSError as reason:
        sys.exit(f"cannot write {path}: {(reason.strerror or str(reason)).lower()}")


if __name__ == "__main__":
    main()
