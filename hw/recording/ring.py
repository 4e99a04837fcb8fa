"""Records on their way from the loop to the disk: memory that two processes share, so that the loop never waits.

The loop puts records in, the writer takes them out. The count is written after the record, and a record proves itself,
so the writer takes none that is half there.
"""

from __future__ import annotations

import mmap
import os
import struct
import zlib
from collections.abc import Iterator

from hw.recording.records import SIZE
from met.host import system

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


def make(room: int) -> Ring:
    """A ring for `room` records, in memory without a name: it is gone with the last process that has it open."""
    file = system.nameless_file()
    os.ftruncate(file, 2 * _HEAD + room * SIZE)
    return Ring(file, room)
