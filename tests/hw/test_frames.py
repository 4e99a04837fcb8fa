"""Frames: what goes in comes out, in whatever pieces; nothing else does; and memory has an end."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hw.protocol.frames import LONGEST, Decoder, framed, unframed
from tests.hw import device as model

payloads = st.binary(min_size=3, max_size=200) | st.lists(st.sampled_from([0, 1, 255]), min_size=3, max_size=200).map(
    bytes
)


def test_the_crc_is_the_one_of_the_page() -> None:
    assert framed(b"123456789") == b"\x0c123456789\xb1\x29\x00"


@pytest.mark.slow
@given(payloads)
def test_a_frame_is_what_another_reading_of_the_page_makes(payload: bytes) -> None:
    frame = framed(payload)
    assert frame == model.frame(payload)
    assert frame.index(0) == len(frame) - 1 < LONGEST
    assert unframed(frame[:-1]) == model.payload(frame[:-1]) == payload


@pytest.mark.slow
@given(st.binary(max_size=220))
def test_what_is_no_frame_is_none_for_both_readings(data: bytes) -> None:
    data = data.replace(b"\0", b"\1")
    found = unframed(data)
    assert found is None or 3 <= len(found) <= 200
    assert found == model.payload(data) or len(data) > 203


@pytest.mark.slow
@given(st.lists(payloads | st.binary(max_size=30).map(lambda x: b"-" + x), max_size=8), st.randoms())
def test_pieces_do_not_matter(parts: list[bytes], chance: random.Random) -> None:
    stream, wanted = b"", []
    for part in parts:
        if part.startswith(b"-"):
            stream += part[1:].replace(b"\0", b"\1") + b"\0"  # garbage
        else:
            stream += framed(part)
            wanted.append(part)
    whole = Decoder()
    assert whole.feed(stream) == wanted
    pieces, at, found = Decoder(), 0, []
    while at < len(stream):
        size = chance.randrange(1, 40)
        found += pieces.feed(stream[at : at + size])
        at += size
    assert found == wanted
    assert pieces.bad == whole.bad


@given(payloads, payloads, st.integers(0, 2000))
def test_after_anything_at_all_the_second_frame_is_found(first: bytes, second: bytes, cut: int) -> None:
    decoder = Decoder()
    begun = framed(first)
    decoder.feed(begun[: cut % len(begun)])
    found = decoder.feed(framed(first) + framed(second))
    assert found[-1:] == [second]
    assert all(each in (first, second) for each in found)


def test_garbage_without_an_end_takes_no_memory_and_is_one_bad_frame() -> None:
    decoder = Decoder()
    for _ in range(1000):
        assert decoder.feed(b"\x55" * 1000) == []
        assert len(decoder._held) < LONGEST
    assert decoder.feed(b"\x55\0" + framed(b"abc")) == [b"abc"]
    assert decoder.bad == 1


@pytest.mark.parametrize("frame", [b"", b"\0", b"\0\0\0"])
def test_empty_frames_mean_nothing(frame: bytes) -> None:
    decoder = Decoder()
    assert decoder.feed(frame) == [] and decoder.bad == 0


def test_no_single_flip_is_taken() -> None:
    frame = framed(bytes(range(12)))
    for bit in range(8 * len(frame)):
        flipped = bytearray(frame)
        flipped[bit // 8] ^= 1 << bit % 8
        assert bytes(range(12)) not in Decoder().feed(bytes(flipped) + framed(b"abc"))
