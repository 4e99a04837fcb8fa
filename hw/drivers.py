"""Drivers by port: MET's own, and those that other packages offer.

A package of your own offers a driver by an entry point, whose name is the scheme and whose object is the `PortKind`:

    [project.entry-points."met.bed_ports"]
    flywheel = "my_bed.flywheel:PORT"

and `met bed run deck.ic --port flywheel:ADDRESS` drives it. docs/bed.md, "A driver of your own", is an example.
"""

from __future__ import annotations

import re
from typing import Any

from hw.bed import BedDriver
from hw.beds import PORTS
from hw.ports import Opening, Port, PortKind
from met.diagnostic import Problem, error
from met.host.entry_points import EntryPoint, offered
from met.plan import Experiment

ENTRY_POINTS = "met.bed_ports"
"""The group of entry points in which other packages offer drivers."""


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
    """Raise Problem E429, at the deck's `substitute`, where the bed model of a joint lacks a parameter that the driver
    at a port reads, or the driver itself rejects a deck made for another bed."""
    kind = kind_of(name)
    kind.check(name.partition(":")[2], experiment, joint)
    if not kind.needs:
        return
    use = experiment.structure.on_beds[joint]
    for needed in kind.needs:
        if f"{joint}.bed.{needed.name}" not in experiment.parameters:
            whose = f"bed model `{use.bed}` of joint `{joint}`"
            message = f"{whose} has no parameter `{needed.name}`, which port `{name}` reads"
            helps = (f"`{needed.name}`, {needed.unit}: {needed.doc}", "declare it in the model, or give another port")
            raise Problem(error("E429", message, use.place, help=helps))


def in_lock_step(name: str, requested: bool) -> bool:
    """True where the bed at a port has no time of its own. requested: whether the user says `--lock-step`."""
    return kind_of(name).lock_step(name, requested)


def same_bed(port: str, other: str) -> bool:
    """True where work at one port may go on at the other: serial lines may get another name, while simulated beds and
    transcripts are distinguished by name."""
    kinds = kind_of(port), kind_of(other)
    if any(kind.simulated or kind.replays for kind in kinds):
        return port == other
    return kinds[0] is kinds[1]


def bench_at(name: str) -> dict[str, str]:
    """The marks that tell the bench at a port from another, in words by name; empty where the port says nothing of it.
    Raises Problem."""
    return dict(kind_of(name).bench(name.partition(":")[2]))


def kind_of(name: str) -> PortKind:
    """The kind of a port. Raises Problem E215 where another package offers its scheme wrongly."""
    for kind in PORTS:
        if kind.scheme and kind.has(name):
            return kind
    scheme = name.partition(":")[0]
    if not any(kind.scheme == scheme for kind in PORTS):
        for kind in _of_others(scheme):
            if kind.has(name):
                return kind
    return next(kind for kind in PORTS if not kind.scheme and kind.has(name))


def kinds() -> tuple[PortKind, ...]:
    """All kinds of port, MET's own first, then those of other packages. Raises Problem E215."""
    return PORTS + _of_others(None)


def ports_in_words() -> str:
    """All that a user may write after `--port`, in words: "a serial line, `emulated`, ... or a transcript"."""
    schemes = [f"`{kind.written}`" for kind in kinds() if kind.scheme]
    return f"a serial line, {', '.join(schemes)}, or a transcript"


def _of_others(scheme: str | None) -> tuple[PortKind, ...]:
    """The kinds of port that other packages offer, of this scheme or, with None, all. Raises Problem E215."""
    kinds_by_scheme: dict[str, PortKind] = {}
    for point in offered(ENTRY_POINTS):
        if scheme not in (None, point.name):
            continue
        kind = _loaded(point)
        if kind.scheme in kinds_by_scheme or any(own.scheme == kind.scheme for own in PORTS):
            raise _refused(point, f"offers port `{kind.scheme}`, which exists already", "give the port another scheme")
        kinds_by_scheme[kind.scheme] = kind
    return tuple(kinds_by_scheme.values())


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
