"""Serial lines of two ODrives, USB or UART: text of the ASCII protocol, each command and each answer a line.

    COMMAND *SUM        SUM: exclusive or of all characters before the asterisk, in decimal; a drive drops a line whose
                        sum is wrong, and answers with one where the command had one
    f ..., r ...        are answered; c, v, w, sc and others are not

An answer does not say to what, and a drive throws away an answer while the one before it is still being sent. So each
drive is asked one question at a time. That bounds when what is answered was so: after the question was sent, before
the answer was read. Where none comes, the next question is one of the other kind, whose answer looks otherwise: as a
line keeps its order, the answer that was late is before it, or never comes. Where that has none either, the line is
left alone until it is silent.

Facts are from ODrive's documentation of the ASCII protocol; no ODrive was there.
"""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Iterable, Sequence

from hw.drives.drive import CanFrame, CanLine

USB_ANSWER = 8e-4
"""Time that a question and its answer are reckoned to take on USB at full speed, s. It was not measured: where they
take much longer the drive is refused when it is greeted."""

UART_TURN = 2e-4
"""Time that a drive is reckoned to take for an answer on a UART, besides the bits, s."""

LATE = 2.0
"""Factor over the expected time of an answer beyond which it does not count, since its sampling time is not known."""

OWED = 4.0
"""Factor over that limit after which a missing answer counts as lost."""

SILENCE = 0.01
"""Time without a byte after which nothing is taken to come any more, s."""

LONGEST_LINE = 128
"""Largest length of a line in bytes."""

BITS = 10
"""Bits of a byte on a UART."""

PULLED = (
    "the drives stop themselves when they hear nothing for the time of their watchdog",
    "look at the drive's supply and its cable, then start again",
)
"""Remedy where a line was lost."""

FEEDBACK = b"f "
PROPERTY = b"r "
ANY = {FEEDBACK: b"f 0", PROPERTY: b"r axis0.current_state"}
"""A question of each kind, where none waits."""

_PAIR = re.compile(rb"[-+]?[\d.]\S* [-+]?[\d.]\S*")


def summed(text: bytes) -> bytes:
    """A line of text with its checksum and its end."""
    text += b" "
    return b"%s*%d\n" % (text, _sum(text))


def checked(line: bytes) -> bytes | None:
    """The text of a line without its checksum; None where that is wrong, or missing."""
    text, star, digits = line.partition(b"*")
    digits = digits.strip()
    if not star or not digits.isdigit() or len(digits) > 3 or int(digits) != _sum(text):
        return None
    return text.strip()


def _sum(text: bytes) -> int:
    """The checksum of a line: all of its bytes by exclusive or."""
    checksum = 0
    for byte in text:
        checksum ^= byte
    return checksum


def answer_time(text: bytes, answer: bytes, baud: int | None) -> float:
    """Estimated time of a question and its answer on the line, s. baud: bits a second of a UART; None: USB."""
    if baud is None:
        return USB_ANSWER
    return BITS * (len(summed(text)) + len(summed(answer)) + 1) / baud + UART_TURN


def on_lines(frames: Iterable[CanFrame], baud: int | None) -> float:
    """Estimated time of an exchange's questions and answers, s: that of the slower drive, as each has a line of its
    own."""
    time_of: dict[int, float] = {}
    for frame in frames:
        asks = frame.data.startswith((FEEDBACK, PROPERTY))
        if baud is None:
            time = USB_ANSWER if asks else 0.0
        else:
            time = BITS * (len(summed(frame.data)) + 1) / baud + UART_TURN * asks
        time_of[frame.id] = time_of.get(frame.id, 0.0) + time
    return max(time_of.values())


class _Questions:
    """The questions to a drive. waiting: to be sent, in order;  sent: that which is not answered yet;  sent_at: when,
    s"""

    def __init__(self) -> None:
        self.waiting = deque[bytes]()
        self.sent: bytes | None = None
        self.sent_at = 0.0
        self.lost: set[bytes] = set()
        """Kinds of questions whose answers are late or lost, and may still come."""
        self.silent_at = 0.0
        """Time until which the line will be silent, s: until then nothing is asked, where both kinds are lost."""
        self.rest = b""
        self.heard = b""
        """The last line that came and was no answer, as it came."""

    def give_up(self, now: float) -> None:
        """Count the answer to the last question as lost."""
        assert self.sent is not None
        self.lost.add(kind_of(self.sent))
        self.sent, self.silent_at = None, now + SILENCE

    def next(self) -> bytes | None:
        """The question to ask now, which does not wait any more; None where none waits."""
        if not self.waiting:
            return None
        if not self.lost:
            return self.waiting.popleft()
        other = PROPERTY if FEEDBACK in self.lost else FEEDBACK
        question = next((waiting for waiting in self.waiting if waiting.startswith(other)), None)
        if question is None:
            return ANY[other]
        self.waiting.remove(question)
        return question

    def fits(self, answer: bytes) -> bool:
        """True where a text can be the answer to the last question."""
        if self.sent is None:
            return False
        return (_PAIR.fullmatch(answer) is not None) == self.sent.startswith(FEEDBACK)


def kind_of(question: bytes) -> bytes:
    """The kind of a question: `FEEDBACK` or `PROPERTY`."""
    return FEEDBACK if question.startswith(FEEDBACK) else PROPERTY


class OdriveLines:
    """Serial lines of two ODrives as one line of frames: a frame's identifier is the drive's number in the bench, its
    data a text. A frame that comes is a question, a line feed, and its answer; `time` and `time_unsure` of one say
    between when what is answered was so.

    wires  carry bytes: frames of the same identifiers, whose data is what has come, however it is cut
    baud   bits a second of a UART; None: USB
    """

    def __init__(self, wires: CanLine, nodes: Sequence[int], baud: int | None = None) -> None:
        self._wires, self._drives = wires, {node: _Questions() for node in nodes}
        self._frames = deque[CanFrame]()
        longest = answer_time(b"r axis0.current_state", b"-1000.000000 -1000.000000", baud)
        self.late = LATE * longest
        """Time from a question beyond which its answer does not count, s."""
        self._owed = OWED * self.late
        self._fastest: dict[int, float] = {}
        try:
            for node in nodes:  # ends a line that somebody else may have begun
                wires.send(CanFrame(node, b"\n"))
        except BaseException:
            wires.close()
            raise

    def now(self) -> float:
        return self._wires.now()

    def sleep(self, seconds: float) -> None:
        self._wires.sleep(seconds)

    def close(self) -> None:
        self._wires.close()

    def fastest(self, node: int) -> float:
        """Shortest time that an answer of a drive has taken, s; 0 where none has come."""
        return self._fastest.get(node, 0.0)

    def heard(self, node: int) -> bytes:
        """The last line of a drive that was no answer; empty where there was none."""
        return self._drives[node].heard

    def send(self, frame: CanFrame) -> None:
        """Send a command at once, and a question when it is its turn: that for feedback first, and none twice."""
        drive, text = self._drives[frame.id], frame.data
        if not text.startswith((FEEDBACK, PROPERTY)):
            self._wires.send(CanFrame(frame.id, summed(text)))
            return
        if text.startswith(FEEDBACK):
            if text not in drive.waiting:
                drive.waiting.appendleft(text)
        elif text not in drive.waiting:
            drive.waiting.append(text)
        self._ask(frame.id, self.now())

    def receive(self, until: float) -> CanFrame | None:
        """The next answer that comes before the time `until`, s, asking the drives their next questions meanwhile; None
        where none does."""
        while not self._frames:
            frame = self._wires.receive(-1.0)
            if frame is None:  # no unread input: an overdue answer is late because of the drive
                now = self.now()
                for drive in self._drives.values():
                    if drive.sent is not None and now > drive.sent_at + self._owed:
                        drive.give_up(now)
                due = min(self._ask(node, now) for node in self._drives)
                frame = self._wires.receive(min(until, due))
            if frame is not None:
                self._take(frame)
            elif self.now() >= until:
                return None
        return self._frames.popleft()

    def _ask(self, node: int, now: float) -> float:
        """Ask a drive the next question, where it may be asked. Returns when the one after it may be, s; infinite where
        none waits."""
        drive = self._drives[node]
        if len(drive.lost) == 2:
            if now < drive.silent_at:
                return drive.silent_at if drive.waiting else math.inf
            drive.lost.clear()
        if drive.sent is None and (text := drive.next()) is not None:
            drive.sent, drive.sent_at = text, now
            self._wires.send(CanFrame(node, summed(text)))
        return drive.sent_at + self._owed + 1e-6 if drive.waiting else math.inf

    def _take(self, frame: CanFrame) -> None:
        """Cut the input into lines, and take the answers to questions."""
        drive = self._drives.get(frame.id)
        if drive is None:
            return
        drive.silent_at = self.now() + SILENCE
        *lines, drive.rest = (drive.rest + frame.data).split(b"\n")
        if len(drive.rest) > LONGEST_LINE:  # after its end a new line begins
            drive.rest = bytes(LONGEST_LINE + 1)
        for line in lines:
            answer = checked(line) if len(line) <= LONGEST_LINE else None
            if answer is None or not drive.fits(answer):
                drive.heard = line.strip()[:LONGEST_LINE] or drive.heard
                continue
            assert drive.sent is not None
            sent_at, now = drive.sent_at, max(frame.time, drive.sent_at)
            took, text = now - sent_at, drive.sent + b"\n" + answer
            drive.sent = None
            drive.lost.clear()
            self._fastest[frame.id] = min(took, self._fastest.get(frame.id, took))
            if not text.startswith(FEEDBACK):
                self._frames.append(CanFrame(frame.id, text, time=now))
            elif took <= self.late:
                self._frames.append(CanFrame(frame.id, text, time=sent_at + 0.5 * took, time_unsure=0.5 * took))
            elif not any(question.startswith(FEEDBACK) for question in drive.waiting):
                drive.waiting.append(text.partition(b"\n")[0])  # asked for again
            self._ask(frame.id, self.now())
