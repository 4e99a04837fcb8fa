"""Messages: the bytes of docs/protocol.md, and nothing that is not one."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hw.bed import Limits, Scales
from hw.protocol import messages
from hw.protocol.frames import unframed
from hw.protocol.messages import (
    ArmMessage,
    ClearMessage,
    DriveMessage,
    HelloAnswer,
    HelloMessage,
    LimitMessage,
    LimitsAnswer,
    PresetMessage,
    ReadMessage,
    SampleAnswer,
    StepMessage,
    StopMessage,
)

WRITTEN = [
    (HelloMessage(), "01 3412 01"),
    (LimitMessage(3, -2), "02 3412 03 feffffff"),
    (ArmMessage(0x89ABCDEF), "03 3412 efcdab89"),
    (DriveMessage(1, -1), "04 3412 01000000 ffffffff 00"),
    (StepMessage(-2147483648, 2147483647, 255), "05 3412 00000080 ffffff7f ff"),
    (StopMessage(), "06 3412"),
    (ClearMessage(), "07 3412"),
    (ReadMessage(), "08 3412"),
    (PresetMessage(2, 1.0), "09 3412 02 000000000000f03f"),
]


@pytest.mark.parametrize(("message", "written"), WRITTEN, ids=lambda x: type(x).__name__)
def test_what_the_host_says_byte_by_byte(message: messages.HostMessage, written: str) -> None:
    frame = messages.frame_of(message, 0x1234)
    assert len(frame) <= 16
    payload = unframed(frame[:-1])
    assert payload == bytes.fromhex(written)
    assert messages.host_message(payload) == (0x1234, message)
    assert messages.host_message(payload + b"\0") is None


def test_what_a_bed_answers_byte_by_byte() -> None:
    numbers = [float(n) for n in range(1, 16)]
    hello = b"\x81\x34\x12" + b"\x01\x25\x00\x04\x03\x02\x01" + b"FIRMWARE" + b"bench".ljust(16, b"\0")
    hello += struct.pack("<15d", *numbers)
    assert messages.bed_answer(hello, 0) == (
        0x1234,
        HelloAnswer(
            1,
            0x25,
            0x01020304,
            b"FIRMWARE",
            b"bench".ljust(16, b"\0"),
            1.0,
            2.0,
            Scales(*numbers[2:8]),
            Limits(*numbers[8:]),
        ),
    )
    limits = b"\x82\x34\x12" + struct.pack("<5i", 1, 2, 3, 4, 5)
    assert messages.bed_answer(limits, 0) == (0x1234, LimitsAnswer(1, 2, 3, 4, 5))
    sample = b"\x84\x34\x12" + struct.pack("<HIi", 5, 7, -9)
    assert messages.bed_answer(sample, 0) == (0x1234, SampleAnswer(5, 7, -9, ()))
    assert messages.bed_answer(sample + struct.pack("<ii", -3, 4), 2) == (0x1234, SampleAnswer(5, 7, -9, (-3, 4)))


def test_a_sample_of_another_length_than_the_bed_announced_is_none() -> None:
    sample = b"\x84\x34\x12" + struct.pack("<HIi", 5, 7, -9)
    assert messages.bed_answer(sample, 1) is None
    assert messages.bed_answer(sample + bytes(4), 0) is None


def test_a_state_that_is_none_is_no_answer() -> None:
    assert messages.bed_answer(b"\x84\x34\x12" + struct.pack("<HIi", 3, 7, -9), 0) is None


@given(st.binary(min_size=3, max_size=200), st.integers(0, 3))
def test_any_payload_is_a_message_or_none(payload: bytes, sensors: int) -> None:
    messages.bed_answer(payload, sensors)
    found = messages.host_message(payload)
    if found is not None and not isinstance(found[1], PresetMessage | DriveMessage):
        assert unframed(messages.frame_of(found[1], found[0])[:-1]) == payload
