"""Two played drives on a shaft, in a time that whoever plays them gives. `play` gives it real time, on a bus of
python-can: `virtual` within a process, `udp_multicast` or vcan between two. `python -m tests.hw.players BENCH.toml` is
the same as a program."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence

from hw.drives.drive import CanFrame, CanLine
from tests.hw.players.shaft import OFF, Output, PlayedShaft


class PlayedDrive(ABC):
    """A drive's side of a dialect. node: its number;  sense: -1 where it counts the other way round than the shaft"""

    def __init__(self, node: int, sense: int = 1) -> None:
        self.node, self.sense = node, sense
        self.angle = self.rate = 0.0

    @abstractmethod
    def receive(self, frame: CanFrame, now: float) -> Sequence[CanFrame]:
        """Frames with which it answers a frame that has come at a time, s."""

    @abstractmethod
    def tick(self, now: float) -> Sequence[CanFrame]:
        """Watch the time, s. Returns the frames that it sends unasked."""

    @property
    @abstractmethod
    def bridge(self) -> Output:
        """The work of its bridge, in its own sense."""

    @property
    def output(self) -> Output:
        """The work of its bridge, in the shaft's sense."""
        out = self.bridge
        return Output(out.kind, self.sense * out.value) if out.value else out

    def see(self, angle: float, rate: float) -> None:
        """Read its encoder: angle rad and rate rad/s of the shaft."""
        self.angle, self.rate = self.sense * angle, self.sense * rate


class PlayedBench:
    """Two played drives on a shaft. slip: rad by which the load's encoder is ahead: a coupling that has slipped"""

    def __init__(self, shaft: PlayedShaft, drive: PlayedDrive, load: PlayedDrive) -> None:
        self.shaft, self.drive, self.load = shaft, drive, load
        self.drives = (drive, load)
        self.slip = 0.0
        self.ticked = 0.0
        """Time of the last tick, s."""

    def tick(self) -> list[CanFrame]:
        """Advance by a tick of the shaft. Returns the frames that the drives send unasked."""
        shaft = self.shaft
        shaft.step(self.drive.output, self.load.output)
        self.ticked += shaft.period
        self._look(0.0)
        return [*self.drive.tick(self.ticked), *self.load.tick(self.ticked)]

    def receive(self, frame: CanFrame, now: float) -> list[CanFrame]:
        """Frames with which the drives answer a frame that has come at a time, s."""
        self._look(now - self.ticked)
        return [answer for drive in self.drives for answer in drive.receive(frame, now)]

    def _look(self, ahead: float) -> None:
        """Let the encoders see the shaft `ahead` seconds after the last tick."""
        angle = self.shaft.angle + self.shaft.rate * ahead
        self.drive.see(angle, self.shaft.rate)
        self.load.see(angle + self.slip, self.shaft.rate)

    @property
    def off(self) -> bool:
        """True where no drive drives."""
        return all(drive.output == OFF or drive.output.kind == "short" for drive in self.drives)


def play(line: CanLine, bench: PlayedBench, stopped: Callable[[], bool]) -> None:
    """Play drives on a line in its own time until `stopped`. What was sent and comes back is dropped: `udp_multicast`
    hands it to its sender too, and no node of a bus hears itself."""
    begun = line.now() - bench.ticked
    own: deque[tuple[int, bool, bytes]] = deque(maxlen=32)

    def send(frames: Sequence[CanFrame]) -> None:
        for each in frames:
            own.append((each.id, each.remote, each.data))
            line.send(each)

    while not stopped():
        frame = line.receive(begun + bench.ticked + bench.shaft.period)
        now = line.now() - begun
        while bench.ticked + bench.shaft.period <= now:
            send(bench.tick())
        if frame is not None and (frame.id, frame.remote, frame.data) not in own:
            send(bench.receive(frame, now))
