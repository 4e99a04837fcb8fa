"""A bed at the other end of a line: the host's side of docs/protocol.md, whatever the line is.

Questions that are safe to repeat are repeated, with a new number; commands never are. There is no automatic
reconnection.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from hw import refusals
from hw.bed import LIMIT_NAMES, About, BedDriver, BedSample, BedState, Capability, Fault, InterlockReason, real_plant
from hw.beds import greeting
from hw.line import BedLine, TappedLine
from hw.protocol import messages
from hw.protocol.frames import Decoder
from hw.protocol.messages import HelloAnswer, HostMessage, LimitsAnswer, OtherVersionAnswer, SampleAnswer
from met.diagnostic import Problem, error

_GREETED, _REFUSED = 1 << 2, 1 << 13
_FAULTS, _REASONS = sum(Fault), sum(InterlockReason)

_WAITS = (0.05, 0.15, 0.5)
"""s to wait for an answer, for each try of a question: first three times the latency of a slow USB adapter, then longer
for a busy machine."""

_BOOT = (0.05,) * 10 + (0.2,) * 5 + (0.5,) * 3
"""s to wait for each answer to HELLO, 3 s together, for some boards boot when their line is opened."""

_STOP = (0.02,) * 10 + (0.05, 0.1, 0.2, 0.4)
"""s to wait for each answer to STOP, 1 s together. A bed's deadman has acted long before."""

_SIMULATED = 0.01
"""Longest time for a tick of a simulated plant, s: an emulator of a small controller takes about a millisecond."""

_OURS = 4096
"""Last numbers of questions whose answers may still come."""

_FOREIGN = 2
"""Answers to questions that this host has not asked, after which another asks them."""

_NONSENSE = 1024
"""Bytes of other things after which the answer counts as missing, so that a line that babbles holds nobody up."""


T = TypeVar("T", HelloAnswer, LimitsAnswer, SampleAnswer)


class WireBed(BedDriver):
    """A bed that speaks the protocol, over the line that `open` gives.

    period     s from one exchange to the next; infinite where none are made
    first      the sequence number before the first one
    confirmed  True where the bed has confirmed that it is not armed, since it was last told to arm
    """

    def __init__(self, name: str, period: float, first: int) -> None:
        self.period, self.confirmed = period, True
        self._name, self._number = name, first
        self._line: BedLine | None = None
        self._about: About | None = None
        self._decoder = Decoder()
        self._in_force = LimitsAnswer(0, 0, 0, 0, 0)
        self._sensors: tuple[tuple[str, float], ...] = ()
        self._has_interlock = False
        self._step = 0
        """Ticks that a bed in lock-step advances by at an exchange; 0 for one with a time of its own."""
        self._question_count = self._foreign = 0
        """Questions since it was greeted, `_OURS` at most, and answers to another's since it was armed."""
        self._angle: tuple[int, int] | None = None
        """The encoder's last count as it came, and without the jumps where it wraps around."""

    @abstractmethod
    def open(self) -> BedLine:
        """Open a new line. Raises Problem E400, E405."""

    def connect(self) -> About:
        """Open the line, and greet the bed."""
        self.close()
        self._line, self._decoder, self._angle = self.open(), Decoder(), None
        self._question_count = 0
        try:
            self._about = self._greet()
        except BaseException:
            self.close()
            raise
        return self._about

    def _greet(self) -> About:
        """Ask the bed for its description until it answers. Raises Problem E402 where it does not, E403 or E404 where
        MET cannot drive it."""
        line = self._line
        assert line is not None
        self._line = heard = TappedLine(line)
        try:
            hello = self._ask_again(messages.HelloMessage(), HelloAnswer, _BOOT)
        finally:
            self._line = line
        if hello is None:
            raise refusals.no_greeting(self._name, bytes(heard.sent), bytes(heard.came))
        about = greeting.about(hello)
        scales: Mapping[Capability, tuple[str, float]] = {
            Capability.ENCODER: ("angle", about.scales.angle),
            Capability.DRIVE_CURRENT: ("drive_current", about.scales.drive_current),
            Capability.ACCELEROMETER: ("acceleration", about.scales.acceleration),
        }
        self._sensors = tuple(scales[name] for name in messages.SENSORS if name in about.capabilities)
        self._has_interlock = Capability.INTERLOCK in about.capabilities
        self._in_force = greeting.in_force(about)
        steps = Capability.LOCK_STEP in about.capabilities and math.isfinite(self.period)
        self._step = greeting.ticks(about, self.period) if steps else 0
        return about

    def limit(self, limits: Mapping[str, float]) -> None:
        """Send tighter limits. Raises Problem E406 where the bed does not take them."""
        about = self._require_about()
        for name, most in greeting.tighter(about, limits).items():
            limits_answer = self._ask(messages.LimitMessage(LIMIT_NAMES.index(name), most), LimitsAnswer)
            if getattr(limits_answer, name) > most:
                message = f"bed `{about.name}` does not take a tighter limit of {name.replace('_', ' ')}"
                raise Problem(error("E406", message, help="limits are set before it is armed"))
            self._in_force = limits_answer

    def arm(self) -> BedSample:
        """Ask the bed to arm, again where its answer is lost. Raises Problem E406 where it refuses."""
        about = self._require_about()
        # so that a bed whose answer was lost is asked again before its deadman has it; or says that it has
        waits = _WAITS if self._step else (*(about.deadman / 3,) * 3, _WAITS[-1])
        self.confirmed, self._foreign = False, 0
        message = messages.ArmMessage(about.session)
        first = self._answer(message, SampleAnswer, waits[0])
        sample = self._sample(first or self._ask(message, SampleAnswer, waits[1:]))
        if sample.state != BedState.ARMED or (sample.refused and first is not None):
            self.confirmed = sample.state != BedState.ARMED
            raise refusals.refused(about, "arm", sample)
        return sample

    def exchange(self, voltage: float, current: float) -> BedSample | None:
        """Send both commands in counts of the bed's scales; None where no answer comes within `patience`."""
        about = self._require_about()
        volts, amperes = greeting.commanded(self, about, self._in_force, voltage, current)
        command = (
            messages.StepMessage(volts, amperes, self._step) if self._step else messages.DriveMessage(volts, amperes)
        )
        answer = self._answer(command, SampleAnswer, self.patience)
        if answer is None:
            return None
        sample = self._sample(answer)
        if self._foreign < _FOREIGN:
            return sample
        self.stop()
        return replace(sample, state=BedState.STOPPED, faults=sample.faults | Fault.OTHER_MASTER)

    def read(self) -> BedSample:
        self._require_about()
        return self._sample(self._ask(messages.ReadMessage(), SampleAnswer))

    def look(self) -> BedSample | None:
        self._require_about()
        answer = self._answer(messages.ReadMessage(), SampleAnswer, self.patience)
        return None if answer is None else self._sample(answer)

    def clear(self) -> BedSample:
        """Ask the bed to forget its faults. Raises Problem E406 where it does not."""
        about = self._require_about()
        sample = self._sample(self._ask(messages.ClearMessage(), SampleAnswer))
        if sample.state != BedState.DISARMED:
            raise refusals.refused(about, "clear", sample)
        return sample

    def rest(self, time: float) -> BedSample:
        """Stop the bed, let `time` s pass, and read its sensors; a bed in lock-step advances by as many ticks. Raises
        Problem E402."""
        about = self._require_about()
        self.stop()
        if Capability.LOCK_STEP not in about.capabilities:
            assert self._line is not None
            self._line.sleep(time)
            return self.read()
        left = math.ceil(time * about.tick_hz - 1e-6)
        sample = None if left else self.read()
        while left:
            ticks = min(left, 255)
            answer = self._answer(messages.StepMessage(0, 0, ticks), SampleAnswer, _WAITS[-1] + ticks * _SIMULATED)
            if answer is None:
                raise refusals.silent(about.name, "STEP")
            sample, left = self._sample(answer), left - ticks
        assert sample is not None
        return sample

    def preset(self, *, rate: float = 0.0, seed: int = 0, repeat: int = 0) -> BedSample:
        """Start the bed's simulated plant anew. Raises Problem E406 for a real bed, or where it refuses."""
        about = self._require_about()
        if Capability.SIMULATED not in about.capabilities:
            raise real_plant()
        for which, value in ((1, float(seed)), (2, float(repeat)), (0, rate)):
            sample = self._sample(self._ask(messages.PresetMessage(which, value), SampleAnswer))
            if sample.refused:
                raise refusals.refused(about, "start its plant anew", sample)
        return sample

    def stop(self) -> bool:
        """Ask the bed to stop until it confirms; returns whether it did. A bed that stays armed is greeted, which
        disarms it."""
        if self._line is None or self._about is None:
            return self.confirmed
        for _ in range(2):  # a transcript that cannot be written is in the way once
            try:
                answer = self._ask_again(messages.StopMessage(), SampleAnswer, _STOP)
                if answer is not None and answer.status & messages.STATE == BedState.ARMED:
                    # another's number is ahead of this host's, whose frames are old then: a greeting disarms, whatever
                    # its number
                    self._ask_again(messages.HelloMessage(), HelloAnswer, _STOP)
                    answer = self._ask_again(messages.StopMessage(), SampleAnswer, _STOP)
                self.confirmed = answer is not None and answer.status & messages.STATE != BedState.ARMED
                break
            except Problem:
                self.confirmed = False  # the line is dead: the bed's deadman stops it
        return self.confirmed

    def close(self) -> None:
        self.stop()
        line, self._line, self._about = self._line, None, None
        if line is not None:
            line.close()

    # Questions and answers

    def _require_about(self) -> About:
        if self._about is None:
            raise refusals.not_connected(self._name)
        return self._about

    def _ask(self, message: HostMessage, kind: type[T], waits: Sequence[float] = _WAITS) -> T:
        """The answer to a question, asked again where it is lost. Raises Problem E402 where none comes."""
        answer = self._ask_again(message, kind, waits)
        if answer is None:
            raise refusals.silent(self._require_about().name, message.word)
        return answer

    def _ask_again(self, message: HostMessage, kind: type[T], waits: Sequence[float]) -> T | None:
        """The answer to a question, asked once for each wait, s; None where none comes."""
        for wait in waits:
            answer = self._answer(message, kind, wait)
            if answer is not None:
                return answer
        return None

    def _answer(self, message: HostMessage, kind: type[T], wait: float) -> T | None:
        """The answer to a message, or None where it does not come within `wait` s. Other frames are dropped."""
        line = self._line
        assert line is not None
        self._number = number = (self._number + 1) % messages.NUMBERS
        self._question_count = min(self._question_count + 1, _OURS)
        line.send(messages.frame_of(message, number))
        until, nonsense = line.now() + wait, 0
        while nonsense < _NONSENSE:
            data = line.receive(until)
            if not data:
                return None
            nonsense += len(data)
            for payload in self._decoder.feed(data):
                numbered = messages.bed_answer(payload, len(self._sensors) + self._has_interlock)
                if numbered is None or numbered[0] != number:
                    self._foreign += (
                        numbered is not None and (number - numbered[0]) % messages.NUMBERS >= self._question_count
                    )
                    continue
                if isinstance(numbered[1], kind):
                    return numbered[1]
                if isinstance(numbered[1], OtherVersionAnswer) and kind is HelloAnswer:
                    raise refusals.other_version(numbered[1].version)
        return None

    def _sample(self, answer: SampleAnswer) -> BedSample:
        """The sensors' readings in SI, and the bed's state, from its answer."""
        status, scale = answer.status, self._require_about().scales.rate
        read = dict[str, float]()
        for (name, scale_), counts in zip(self._sensors, answer.others, strict=not self._has_interlock):
            read[name] = (self._unwrapped(counts) if name == "angle" else counts) * scale_
        return BedSample(
            BedState(status & messages.STATE),
            bool(status & _GREETED),
            Fault(status & _FAULTS),
            bool(status & _REFUSED),
            answer.tick,
            answer.rate * scale,
            **read,
            interlock=InterlockReason(answer.others[-1] & _REASONS) if self._has_interlock else None,
        )

    def _unwrapped(self, counts: int) -> int:
        """The angle in counts without jumps, from counts that begin anew beyond 32 bits: the first as it is, each later
        one the shorter way from the one before."""
        before, angle = self._angle or (counts, counts)
        angle += (counts - before + messages.MOST + 1) % (2 * messages.MOST + 2) - messages.MOST - 1
        self._angle = counts, angle
        return angle
