"""A bed whose firmware runs here, as a program of this machine or in an emulator of a Cortex-M3. No motor turns."""

from __future__ import annotations

import contextlib
import secrets
import select
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Literal

from hw import realtime, refusals
from hw.bed import Capability
from hw.beds import emulated
from hw.beds.wire import WireBed
from hw.boards.build import Config, Shaft, Uncountable, build, qemu
from hw.line import BAUD, BedLine, HostClock
from hw.lines.transcript import TranscribedLine, TranscriptWriter
from hw.ports import Opening, PortKind
from hw.protocol import messages
from met.diagnostic import Problem, error
from met.host import system
from met.plant import plant_c
from met.substitution.bed import SIMULATION_PARAMETERS

WITHIN = 20.0
"""Longest time for the firmware's process to start, s."""


class SimulatedBed(WireBed):
    """A bed whose firmware runs on this machine over a simulated plant.

    kind          "firmware": a program of this machine; "qemu": in an emulator of a Cortex-M3
    config, plant  as hw.boards.build.build takes them;  period: s from one exchange to the next
    transcript    as of `SerialBed`

    The process begins when the bed is connected, and ends when it is closed.
    """

    def __init__(
        self,
        kind: Literal["firmware", "qemu"],
        config: Config,
        plant: str,
        *,
        period: float,
        transcript: Callable[[bytes], object] | None = None,
    ) -> None:
        super().__init__(kind, period, secrets.randbelow(messages.NUMBERS))
        self._kind, self._lock_step = kind, Capability.LOCK_STEP in config.capabilities
        self._built = build("arm" if kind == "qemu" else "host", config, plant)
        header = {"line": kind, "baud": BAUD, "period": period, "first": self._number}
        self._writer = None if transcript is None else TranscriptWriter(transcript, header)
        self._process: subprocess.Popen[bytes] | None = None

    def open(self) -> BedLine:
        line = self._line_to_process() if self._kind == "firmware" else self._in_an_emulator()
        return line if self._writer is None else TranscribedLine(line, self._writer)

    def close(self) -> None:
        super().close()
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    def _line_to_process(self) -> BedLine:
        """Start the firmware as a program of this machine; returns the line to it."""
        ours, theirs = socket.socketpair()
        with theirs:
            number = theirs.fileno()
            self._process = subprocess.Popen(
                [str(self._built), "--line", str(number)], pass_fds=[number], start_new_session=True
            )
        realtime.put_first(self._process.pid)
        return SocketLine(ours)

    def _in_an_emulator(self) -> BedLine:
        """Start the firmware in an emulator; returns the line to it. Raises Problem E402 where it does not start in
        time."""
        with tempfile.TemporaryDirectory(prefix="met-bed-") as folder:
            path = Path(folder) / "line"
            self._process = subprocess.Popen(
                qemu(self._built, path),
                stdin=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
                preexec_fn=partial(system.end_with_parent, signal.SIGKILL),
            )
            if not self._lock_step:
                realtime.put_first(self._process.pid)
            end = time.monotonic() + WITHIN
            while True:
                connection = socket.socket(socket.AF_UNIX)
                try:
                    connection.connect(str(path))
                    return SocketLine(connection)
                except OSError:
                    connection.close()
                    if self._process.poll() is not None or time.monotonic() > end:
                        raise _not_started(f"the emulator ended with {self._process.poll()}") from None
                    time.sleep(0.01)


class SocketLine(HostClock):
    """A line over a socket that is connected already."""

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        self._connection = connection

    def send(self, frame: bytes) -> None:
        try:
            self._connection.sendall(frame)
        except OSError as reason:
            raise _lost(reason.strerror) from None

    def receive(self, until: float) -> bytes:
        """The bytes that come before the time `until`, s of the clock; none where none do. Raises Problem E401 where
        the line was closed."""
        if not select.select((self._connection,), (), (), max(0.0, until - time.perf_counter()))[0]:
            return b""
        try:
            data = self._connection.recv(4096)
        except OSError as reason:
            raise _lost(reason.strerror) from None
        if not data:
            raise _lost("it was closed")
        return data

    def close(self) -> None:
        with contextlib.suppress(OSError):
            self._connection.close()


def _lost(why: str | None) -> Problem:
    """The error that the firmware's process has ended (E401)."""
    return Problem(
        error(
            "E401",
            f"the line to the bed's firmware was lost: {(why or 'it does not say why').lower()}",
            help="its process has ended: start again",
        )
    )


def _not_started(why: str) -> Problem:
    return Problem(error("E402", f"the bed's firmware does not start: {why}", help="start it again"))


def config_of(values: Mapping[str, float], period: float, *, lock_step: bool) -> Config:
    """The configuration of firmware that simulates a bed.

    values     parameters of its model, SI, by name: `PARAMETERS` and `SIMULATION_PARAMETERS` of met.substitution.bed
    period     s of a tick
    lock_step  True where it has no time of its own
    """
    names = ("kt", "resistance", "tau_max", "kt_load", "inertia", "f_c", "f_v", "f_cut")
    return Config(
        name="simulated",
        tick_hz=1.0 / period,
        deadman=emulated.DEADMAN,
        scales=emulated.scales(values),
        limits=emulated.limits(values, period),
        continuous_current=values["i_max"],
        shaft=Shaft(**{name: values[name] for name in names}),
        capabilities=Capability.ENCODER | (Capability.LOCK_STEP if lock_step else Capability(0)),
    )


def _opened_port(opening: Opening, kind: Literal["firmware", "qemu"]) -> SimulatedBed:
    """The bed of `--port firmware` or `qemu`, from the deck's model of it. Raises Problem E404 where its numbers do not
    fit in counts."""
    transcript, period = opening.transcript(), opening.period
    config = config_of(opening.bed_values(), period, lock_step=opening.port.lock_step)
    text = plant_c(opening.simulated(), opening.joint, case=opening.row, period=period)
    try:
        return SimulatedBed(kind, config, text, period=period, transcript=transcript)
    except Uncountable as reason:
        raise refusals.uncountable(opening.joint, reason) from None


FIRMWARE = PortKind(
    scheme="firmware",
    doc="The bed's firmware as a program on this machine, with the deck's bed as its plant.",
    open=partial(_opened_port, kind="firmware"),
    simulated=True,
    needs=SIMULATION_PARAMETERS,
)
QEMU = PortKind(
    scheme="qemu",
    doc="The bed's firmware for a Cortex-M3 in an emulator, with the deck's bed as its plant.",
    open=partial(_opened_port, kind="qemu"),
    simulated=True,
    needs=SIMULATION_PARAMETERS,
)
