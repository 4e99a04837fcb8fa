"""Ports: the places of beds, `--port` on the command line, and the declaration of a driver's ports.

A driver is a file in hw/beds with a `PortKind`, and a line in `PORTS` of hw/beds/__init__.py; `hw.drivers` finds the
one of a port. docs/bed.md, "A driver of your own", is an example.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from hw.bed import BedDriver
from hw.line import BAUD
from hw.lines.transcript import TranscriptFile
from met import models
from met.frozen import frozen
from met.parameter import Parameter
from met.plan import Experiment
from met.plant import bed_values
from met.substitution.bed import DriveCommand


@frozen
class Port:
    """The port that a user gives, with what belongs to it.

    name        as written after `--port`: /dev/ttyUSB0, `firmware`, `SCHEME:ADDRESS` ...
    baud        bits a second of a serial line
    lock_step   True where simulated firmware is to have no time of its own
    transcript  path of a new file for what goes over the line; None: none is kept
    """

    name: str
    baud: int = BAUD
    lock_step: bool = False
    transcript: str | None = None

    @property
    def address(self) -> str:
        """The part of the name behind `SCHEME:`."""
        return self.name.partition(":")[2]


@frozen
class Opening:
    """All that a driver is opened with.

    period      s from one exchange to the next; infinite where the bed is only read
    experiment  the run or sweep that has a joint on the bed; None where no deck was given
    joint, row  that joint, and the case's row in the case table
    """

    port: Port
    period: float = math.inf
    experiment: Experiment | None = None
    joint: str = ""
    row: int = 0

    def simulated(self) -> Experiment:
        """The experiment whose bed a simulated port simulates: `opened` has seen that there is one."""
        assert self.experiment is not None
        return self.experiment

    @property
    def drive(self) -> DriveCommand | None:
        """The quantity that the deck's bed model sends the drive; None where no deck was given."""
        if self.experiment is None:
            return None
        use = self.experiment.structure.on_beds[self.joint]
        return models.find("bed", use.bed, use.place).drive

    def bed_values(self) -> dict[str, float]:
        """The parameters of the deck's bed model in this case, SI, by name."""
        return bed_values(self.simulated(), self.joint, self.row)

    def transcript(self) -> Callable[[bytes], object] | None:
        """The writer of a transcript, to a new file; None where none is kept. Raises Problem E409."""
        return None if self.port.transcript is None else TranscriptFile(self.port.transcript)


@frozen(kw_only=True)
class PortKind:
    """The declaration of a driver: which ports are its own, and how a bed there is opened.

    scheme      the ports `SCHEME`, or `SCHEME:ADDRESS` where there is an `address`; "" where `recognizes` says which
    address     what stands behind the scheme, in a word for the help: `SERIAL_NUMBER`; of no scheme, the whole port
    doc         what is there, for the help, in a line
    open        (Opening) -> the driver, which is not connected yet. Raises Problem
    simulated   True where the deck's bed is simulated, so that a deck must be given, and each joint has its own bed
    needs       parameters that the deck's bed model must declare, besides `met.substitution.bed.PARAMETERS`
    check       (address, experiment, joint) raises Problem where the bed there cannot be that of a deck
    lock_step   (port, requested) -> True where the bed has no time of its own and waits for each exchange; requested:
                whether the user says `--lock-step`, which decides it unless a driver says otherwise
    replays     True where the bed answers from a transcript, so that only what made it can be asked again
    recognizes  (port) -> True where a port is of this kind that begins with no scheme
    bench       (address) -> what tells the bench there from another, in words by name, as it is now; empty where the
                address says nothing of it. Cases of one bench are not taken for those of another. Raises Problem
    """

    doc: str
    open: Callable[[Opening], BedDriver]
    scheme: str = ""
    address: str = ""
    simulated: bool = False
    needs: tuple[Parameter, ...] = ()
    check: Callable[[str, Experiment, str], None] = lambda address, experiment, joint: None
    lock_step: Callable[[str, bool], bool] = lambda name, requested: requested
    replays: bool = False
    recognizes: Callable[[str], bool] = lambda name: False
    bench: Callable[[str], Mapping[str, str]] = lambda address: {}

    @property
    def written(self) -> str:
        """The way in which a user writes such a port: `firmware`, `SCHEME:ADDRESS`, `FILE`."""
        return ":".join(part for part in (self.scheme, self.address) if part)

    def has(self, name: str) -> bool:
        """True where a port of this name is of this kind."""
        if not self.scheme:
            return self.recognizes(name)
        scheme, colon, address = name.partition(":")
        # SCHEME://... is a URL of pyserial, whatever the scheme
        return scheme == self.scheme and bool(colon) == bool(self.address) and not address.startswith("//")
