"""Ports: the places where a bed is, `--port` on the command line, and the drivers that reach one there.

A driver is a file in hw/beds with a `PortKind`, and a line in `PORTS` of hw/beds/__init__.py. A package of your own
offers one by an entry point, whose name is the scheme and whose object is the `PortKind`:

    [project.entry-points."met.bed_ports"]
    flywheel = "my_bed.flywheel:PORT"

and `met bed run deck.ic --port flywheel:ADDRESS` drives it. docs/bed.md, "A driver of your own", is an example.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

from hw.bed import BedDriver
from hw.line import BAUD
from hw.transcript import TranscriptFile
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.host.entry_points import EntryPoint, offered
from met.parameter import Parameter
from met.plan import Experiment
from met.program.control.plant import bed_values

ENTRY_POINTS = "met.bed_ports"
"""The group of entry points in which other packages offer drivers."""


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

    def bed_values(self) -> dict[str, float]:
        """The parameters of the deck's bed model in this case, SI, by name."""
        return bed_values(self.simulated(), self.joint, self.row)

    def transcript(self) -> Callable[[bytes], object] | None:
        """Takes the bytes of a transcript, in a new file; None where none is to be kept. Raises Problem E409."""
        return None if self.port.transcript is None else TranscriptFile(self.port.transcript)


def as_requested(name: str, requested: bool) -> bool:
    """The `lock_step` of a port whose bed may be either: what the user says with `--lock-step`."""
    return requested


@frozen(kw_only=True)
class PortKind:
    """The declaration of a driver: which ports are its own, and how a bed there is opened.

    scheme      the ports `SCHEME`, or `SCHEME:ADDRESS` where there is an `address`; "" where `recognizes` says which
    address     what stands behind the scheme, in a word for the help: `SERIAL_NUMBER`; of no scheme, the whole port
    doc         what is there, for the help, in a line
    open        (Opening) -> the driver, which is not connected yet. Raises Problem
    simulated   True where the deck's bed is simulated, so that a deck must be given, and each joint has its own bed
    needs       parameters that the deck's bed model must declare, besides `met.substitution.bed.PARAMETERS`
    lock_step   (port, requested) -> True where the bed has no time of its own and waits for each exchange; requested:
                whether the user says `--lock-step`
    replays     True where the bed answers from a transcript, so that only what made it can be asked again
    recognizes  (port) -> True where a port is of this kind that begins with no scheme
    """

    doc: str
    open: Callable[[Opening], BedDriver]
    scheme: str = ""
    address: str = ""
    simulated: bool = False
    needs: tuple[Parameter, ...] = ()
    lock_step: Callable[[str, bool], bool] = as_requested
    replays: bool = False
    recognizes: Callable[[str], bool] = lambda name: False

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


def opened(port: Port, experiment: Experiment | None, joint: str, row: int, period: float) -> BedDriver:
    """The driver of the bed at a port, not connected yet. Raises Problem.

    experiment  None where no deck was given: only a bed that is there without one can be opened then
    joint, row  the joint whose motor is on the bed, and the case's row in the case table
    period      s from one exchange to the next; infinite for a bed that is only read
    """
    kind = kind_of(port.name)
    if experiment is not None:
        check_model(port.name, experiment, joint)
    elif kind.simulated:
        helps = "give a deck, and the name of a run in it that substitutes a joint"
        raise Problem(error("E425", f"port `{port.name}` simulates a deck's bed, and there is no deck", help=helps))
    return kind.open(Opening(port, period, experiment, joint, row))


def check_model(name: str, experiment: Experiment, joint: str) -> None:
    """Raises Problem E429, at the deck's `substitute`, where the bed model of a joint lacks a parameter that the driver
    at a port reads."""
    kind = kind_of(name)
    if not kind.needs:
        return
    use = next(each for each in experiment.structure.substitutions if each.joint == joint)
    for needed in kind.needs:
        if f"{joint}.bed.{needed.name}" not in experiment.parameters:
            whose = f"bed model `{use.bed}` of joint `{joint}`"
            message = f"{whose} has no parameter `{needed.name}`, which port `{name}` reads"
            helps = (f"`{needed.name}`, {needed.unit}: {needed.doc}", "declare it in the model, or give another port")
            raise Problem(error("E429", message, use.place, help=helps))


def in_lock_step(name: str, requested: bool) -> bool:
    """True where the bed at a port has no time of its own. requested: whether the user says `--lock-step`."""
    return kind_of(name).lock_step(name, requested)


def same_bed(one: str, other: str) -> bool:
    """True where what was driven at one port may be gone on with at the other: serial lines may get another name,
    simulated beds and transcripts are told apart by theirs."""
    kinds = kind_of(one), kind_of(other)
    if any(kind.simulated or kind.replays for kind in kinds):
        return one == other
    return kinds[0] is kinds[1]


def kind_of(name: str) -> PortKind:
    """The kind of a port. Raises Problem E215 where another package offers its scheme wrongly."""
    own = own_kinds()
    for kind in own:
        if kind.scheme and kind.has(name):
            return kind
    scheme = name.partition(":")[0]
    if not any(kind.scheme == scheme for kind in own):
        for kind in _of_others(scheme):
            if kind.has(name):
                return kind
    return next(kind for kind in own if not kind.scheme and kind.has(name))


def kinds() -> tuple[PortKind, ...]:
    """All kinds of port, MET's own first, then those of other packages. Raises Problem E215."""
    return own_kinds() + _of_others(None)


def own_kinds() -> tuple[PortKind, ...]:
    """MET's own kinds of port. The last one, a serial line, recognizes every port."""
    from hw.beds import PORTS

    return PORTS


def ports_in_words() -> str:
    """All that a user may write after `--port`, in words: "a serial line, `emulated`, ... or a transcript"."""
    schemes = [f"`{kind.written}`" for kind in kinds() if kind.scheme]
    return f"a serial line, {', '.join(schemes)}, or a transcript"


def _of_others(scheme: str | None) -> tuple[PortKind, ...]:
    """The kinds of port that other packages offer, of this scheme or, with None, all. Raises Problem E215."""
    found: dict[str, PortKind] = {}
    for point in offered(ENTRY_POINTS):
        if scheme not in (None, point.name):
            continue
        kind = _loaded(point)
        if kind.scheme in found or any(own.scheme == kind.scheme for own in own_kinds()):
            raise _refused(point, f"offers port `{kind.scheme}`, which exists already", "give the port another scheme")
        found[kind.scheme] = kind
    return tuple(found.values())


def _loaded(point: EntryPoint) -> PortKind:
    """The declaration that an entry point names. Raises Problem E215."""
    try:
        kind: Any = point.load()
    except KeyboardInterrupt:
        raise
    except BaseException as reason:  # another package's code: whatever it raises, `sys.exit` too, is its user's
        message = f"cannot be loaded: {type(reason).__name__}: {reason}"
        raise _refused(point, message, "mend or uninstall the package that offers it") from reason
    if not isinstance(kind, PortKind):
        message = f"is a {type(kind).__name__}, not a {PortKind.__module__}.{PortKind.__name__}"
        raise _refused(point, message, "let it name the PortKind that the file declares")
    if kind.scheme != point.name or not re.fullmatch("[a-z][a-z0-9_]*", kind.scheme):
        message = f"offers a port of scheme `{kind.scheme}`"
        raise _refused(point, message, "name the entry point as the scheme: small letters, digits and _")
    return kind


def _refused(point: EntryPoint, what: str, help: str) -> Problem:
    where = f"entry point `{point.name} = {point.value}` of {point.package} in group `{ENTRY_POINTS}`"
    return Problem(error("E215", f"{where} {what}", help=help))
