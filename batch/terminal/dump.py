"""The stages of `met dump` after the plan: the recorded program, and its code."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from ic.printing.dump import DumpRequest

if TYPE_CHECKING:
    from met.plan import Experiment
    from met.trace.program import Recording


def program(request: DumpRequest) -> Iterator[str]:
    """The listing of a program: control, then each straight piece by operations; `%n` is the result of number n."""
    from met.backends.reference.listing import lines

    for experiment, recording in _recorded(request):
        yield f"program of {experiment.name}: base rate {recording.program.base_hz:g} Hz"
        yield from lines(recording)


def kernel(request: DumpRequest) -> Iterator[str]:
    """The code of the program as MET writes it for this machine."""
    from met import backends

    for _, recording in _recorded(request):
        yield backends.find().emit(recording)


def _recorded(request: DumpRequest) -> Iterator[tuple[Experiment, Recording]]:
    """Record each run of the plan; returns it with its program."""
    from met.program.build import build
    from met.trace.recorder import record

    for experiment in request.plan().experiments:
        yield experiment, record(build(experiment))
