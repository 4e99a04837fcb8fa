"""Frames: a payload and its CRC, without zeros by COBS, ended by a zero."""

from __future__ import annotations

from binascii import crc_hqx

LONGEST_PAYLOAD = 200
LONGEST = 208
"""Largest number of bytes of a frame, with its final zero."""

_CODES = [bytes((n,)) for n in range(256)]


def framed(payload: bytes) -> bytes:
    """The frame of a payload of 3 to 200 bytes, as it goes over the wire."""
    whole = payload + crc_hqx(payload, 0xFFFF).to_bytes(2, "little")
    # a run without zeros is shorter than the 254 bytes at which COBS begins a new one
    return b"".join([_CODES[len(run) + 1] + run for run in whole.split(b"\0")]) + b"\0"


def unframed(frame: bytes) -> bytes | None:
    """The payload of a frame without its zero; None if it is not one."""
    if len(frame) >= LONGEST or b"\0" in frame:
        return None
    runs, position = [], 0
    while position < len(frame):
        end = position + frame[position]
        runs.append(frame[position + 1 : end])
        position = end
    whole = b"\0".join(runs)
    if position != len(frame) or not 5 <= len(whole) <= LONGEST_PAYLOAD + 2:
        return None
    payload = whole[:-2]
    return payload if crc_hqx(payload, 0xFFFF) == int.from_bytes(whole[-2:], "little") else None


class Decoder:
    """Finds frames in bytes that come in any pieces. It holds less than a frame's bytes back.

    bad  frames that did not decode, empty ones not counted
    """

    def __init__(self) -> None:
        self.bad = 0
        self._held = b""
        self._too_long = False

    def feed(self, data: bytes) -> list[bytes]:
        """The payloads that these bytes complete."""
        *frames, held = (self._held + data).split(b"\0")
        if self._too_long and frames:
            del frames[0]
            self._too_long = False
        if len(held) >= LONGEST:
            held = b""
            self.bad += not self._too_long
            self._too_long = True
        self._held = b"" if self._too_long else held
        payloads = []
        for frame in frames:
            payload = unframed(frame)
            if payload is not None:
                payloads.append(payload)
            elif frame:
                self.bad += 1
        return payloads
