"""A bed that replays the answers of a transcript, and requires the same questions."""

from __future__ import annotations

import os
from pathlib import Path

from hw.bed import Scales
from hw.beds.wire import WireBed
from hw.line import BedLine
from hw.lines.transcript import LOST, MAGIC, OPENED, RECEIVED, SENT, Transcript, TranscriptRecord, read
from hw.ports import Opening, PortKind
from hw.protocol import messages
from hw.protocol.frames import Decoder, unframed
from met.diagnostic import Problem, error
from met.host.files import open_regular

LONGEST = 1000.0
"""A period between exchanges that no bed has, s: a header that says more is damaged."""


class ReplayBed(WireBed):
    """A bed that answers from the transcript in the file `path`.

    Raises Problem E409 where the file is no transcript. The methods raise E407 where the host asks for something
    else than it asked then, and E401 where the transcript ends.

    transcript  the whole transcript, with the header that `SerialBed` wrote
    """

    def __init__(self, path: str | Path) -> None:
        self.transcript = read(path)
        header = self.transcript.header
        try:
            period, first = float(header["period"]), int(header["first"])
            if not 0.0 < period < LONGEST or not 0 <= first <= 0xFFFF:
                raise ValueError
        except (KeyError, TypeError, ValueError, OverflowError):
            helps = "give the transcript of a bed on a serial line"
            raise Problem(error("E409", f"{path} does not say how its bed was driven", help=helps)) from None
        super().__init__(str(path), period, first)
        self._line_then = _ReplayedLine(self.transcript, str(path))

    def open(self) -> BedLine:
        self._line_then.open()
        return self._line_then


class _ReplayedLine:
    """The line of a transcript: its clock is at the time of the last message sent or received."""

    def __init__(self, transcript: Transcript, name: str) -> None:
        self._records, self._name, self._position = transcript.records, name, 0
        self._decoder = Decoder()
        self._scales: Scales | None = None
        self._tick = -1

    def open(self) -> None:
        if self._next(OPENED) is None:
            raise self._other("a line is opened")

    def now(self) -> float:
        return self._records[self._position - 1].time if self._position else 0.0

    def send(self, frame: bytes) -> None:
        """Check that the transcript has this question next. Raises Problem E407 or E401 where it has not."""
        position = self._position
        record = self._next(SENT)
        if record is None or record.data != frame:
            self._position = position
            raise self._other(f"{self._words(frame)} is asked")

    def receive(self, until: float) -> bytes:
        """The bytes that the transcript has next, or none where the bed did not answer in time. Raises Problem E401
        where the line was lost then."""
        record = self._next(RECEIVED)
        if record is not None:
            self._note(record.data)
            return record.data
        if (lost := self._next(LOST)) is not None:
            helps = "so it was when the transcript was made"
            raise Problem(error("E401", lost.data.decode("utf-8", "replace"), help=helps))
        if self._position == len(self._records):
            raise self._other("an answer is waited for")
        return b""  # then it did not come in time

    def sleep(self, seconds: float) -> None:
        """Do nothing: messages of that time are in the records."""

    def close(self) -> None:
        """Do nothing: no line is held."""

    def _next(self, kind: int) -> TranscriptRecord | None:
        if self._position == len(self._records) or self._records[self._position].kind != kind:
            return None
        self._position += 1
        return self._records[self._position - 1]

    def _note(self, data: bytes) -> None:
        """Note tick and scales from answers of the bed, for messages."""
        for payload in self._decoder.feed(data):
            if payload[0] == messages.SampleAnswer.kind:
                self._tick = int.from_bytes(payload[5:9], "little")
            numbered = messages.bed_answer(payload, 0)
            if numbered is not None and isinstance(numbered[1], messages.HelloAnswer):
                self._scales = numbered[1].scales

    def _other(self, question: str) -> Problem:
        """The error for a question that was not asked then: E407, or E401 where the transcript ends, as that of a
        lost line does."""
        after = f"after tick {self._tick} of the bed" if self._tick >= 0 else "at the beginning"
        if self._position == len(self._records):
            helps = "it was broken off there, or another deck or case made it"
            return Problem(error("E401", f"{self._name} ends {after}, where {question}", help=helps))
        record = self._records[self._position]
        then = self._words(record.data) if record.kind == SENT else _KINDS.get(record.kind, "something else")
        helps = "a transcript is replayed by what made it: the same deck, case and version of MET"
        return Problem(error("E407", f"{self._name}: {after} {question}; then it was {then}", help=helps))

    def _words(self, frame: bytes) -> str:
        """A message of the host in words, for the error that it differs from the transcript's."""
        payload = unframed(frame[:-1])
        numbered = None if payload is None else messages.host_message(payload)
        if numbered is None:
            return "no message"
        number, message = numbered
        name = message.word
        if isinstance(message, messages.DriveMessage | messages.StepMessage) and self._scales is not None:
            voltage, current = message.voltage * self._scales.voltage, message.current * self._scales.current
            return f"{name} {number} of {voltage:.9g} V and {current:.9g} A"
        fields = ", ".join(f"{key} {value}" for key, value in message.__dict__.items())
        return f"{name} {number}" + (f" ({fields})" if fields else "")


_KINDS = {OPENED: "a line that was opened", RECEIVED: "an answer", LOST: "a line that was lost"}


def is_transcript(name: str) -> bool:
    """True where a port is a file that begins as a transcript does."""
    if not os.path.isfile(name):
        return False
    try:
        with open_regular(name) as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:  # whoever opens the port says why
        return False


def _was_in_lock_step(name: str, requested: bool) -> bool:
    """True where a transcript has a STEP: its bed had no time of its own, whatever is requested now."""
    sent = (unframed(record.data[:-1]) for record in read(name).records if record.kind == SENT)
    return any(payload is not None and payload[0] == messages.StepMessage.kind for payload in sent)


def _opened_port(opening: Opening) -> ReplayBed:
    """The bed that replays a transcript. Raises Problem E409 where another transcript is asked for."""
    name = opening.port.name
    if opening.port.transcript is not None:
        helps = f"leave out `--transcripts`: {name} is what it would be"
        raise Problem(error("E409", "a transcript has no line whose transcript could be kept", help=helps))
    return ReplayBed(name)


PORT = PortKind(
    address="FILE",
    doc="The transcript of an earlier run, whose bed's answers are replayed.",
    open=_opened_port,
    lock_step=_was_in_lock_step,
    replays=True,
    recognizes=is_transcript,
)
