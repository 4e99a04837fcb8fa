"""`met bed clear`: clear a bed's latched faults."""

from __future__ import annotations

import json
import math

from batch.beds.chosen_bed import chosen_bed
from hw import refusals
from hw.bed import About, Fault
from hw.beds import latch
from hw.drivers import kind_of, opened
from hw.ports import Port
from met.diagnostic import Problem, error
from met.messages.visible import say


def clear_and_tell(word: str, *, baud: int, form: str, quiet: bool = False, verbose: bool = False) -> None:
    """Run `met bed clear`. Raises Problem."""
    about, faults = clear(word, baud)
    if form == "json":
        names = [str(fault.name).lower() for fault in Fault if fault in faults]
        say(json.dumps({"name": about.name, "cleared": names}))
    elif not quiet:
        say(f"bed `{about.name}` at {word}: {cleared_line(faults)}")
        for remedy in refusals.remedies(faults):
            say(f"  = help: {remedy}")


def clear(word: str, baud: int) -> tuple[About, Fault]:
    """Clear the faults of the bed at a port, without arming it. Returns its description and the faults. Raises
    Problem."""
    if kind_of(word).simulated:
        helps = "each run begins with one in which nothing is latched"
        raise Problem(error("E425", f"port `{word}` simulates a bed, anew for each command", help=helps))
    with opened(Port(chosen_bed(word, None, ()).port, baud), None, "", 0, math.inf) as bed:
        about = bed.connect()
        return about, latch.cleared(bed, about)


def cleared_line(faults: Fault) -> str:
    """The line that says which latched faults were cleared."""
    return f"cleared: {refusals.words(faults)}" if faults else "nothing was latched"
