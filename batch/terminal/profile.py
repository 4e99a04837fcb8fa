"""Output of `met profile`: the time of a run's step, part by part, and properties of its kernel."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby

from ic.printing.columns import columns, count, size
from met.analysis.profile import RunProfile, WorkCost
from met.plan import Experiment


def profile_lines(profile: RunProfile, experiment: Experiment) -> Iterator[str]:
    """The profile in lines."""
    schedule = experiment.structure.schedule
    yield (
        f"{profile.experiment}: {count(profile.joints, 'joint')}, {count(profile.cases, 'case')}, "
        f"{experiment.structure.integrator}, steps of {1e3 * schedule.step:g} ms"
    )
    yield ""
    yield from columns(list(_table(profile)), right=(1, 2, 3, 4, 5))
    yield ""
    rates = profile.flops / profile.ns
    yield (
        f"  {rates:.1f} Gflop/s, {_percent(profile.share_of_peak)} of the {profile.peak * 1e-9:.1f} Gflop/s that "
        f"this core does at most; a fused multiply-add counts as two"
    )
    yield f"  {_events(profile.parts)}"
    yield ""
    yield from columns(list(_kernel(profile)))
    if profile.inputs:
        yield ""
        yield from columns(list(_inputs(profile)), right=(1, 2, 3, 4))
        yield ""
        yield "  sets: parameters that follow; once: operations that depend on it and are done before the first step;"
        yield "  kept: numbers that these leave in a case's memory; taken by: operations of a step that take one"


def _table(profile: RunProfile) -> Iterator[tuple[str, ...]]:
    """A row for each kind of work, with its parts under it; rare work in one row."""
    yield "a step of a case", "times", "operations", "flops", "ns", "share"
    steady = [part for part in profile.parts if not part.event]
    for work, group in groupby(steady, key=lambda part: part.work):
        parts = list(group)
        yield _row(work, parts, profile.ns)
        if len(parts) > 1:
            for part in parts:
                if part.part:
                    yield _row(f"  {part.part}", [part], profile.ns, times=False)
    events = [part for part in profile.parts if part.event and part.calls > 0.0]
    if events:
        yield _row("friction events", events, profile.ns, times=False)
    yield _row("all parts, each alone", profile.parts, profile.ns, times=False)
    yield "the whole run", "", "", "", _number(profile.ns), "100 %"


def _row(name: str, parts: Sequence[WorkCost], whole: float, *, times: bool = True) -> tuple[str, ...]:
    """A row of the profile: calls, operations, time (ns) and share of the step."""
    ns = sum(part.ns for part in parts)
    return (
        name,
        _number(max(part.calls for part in parts)) if times else "",
        _number(sum(part.operations for part in parts)),
        _number(sum(part.flops for part in parts)),
        _number(ns),
        _percent(ns / whole),
    )


def _events(parts: Sequence[WorkCost]) -> str:
    """A sentence on how often friction made a block decide again, or go back."""
    rate = {part.work: part.calls for part in parts if part.event}
    decided, split = rate.get("friction decisions", 0.0), rate.get("friction splits", 0.0)
    if "friction decisions" not in rate:
        return "no joint has dry friction: no events"
    return f"friction events of a block: {_number(decided)} decisions at rest and {_number(split)} splits a step"


def _kernel(profile: RunProfile) -> Iterator[tuple[str, str]]:
    """Rows about the kernel: how it was timed, its block, code size, and the time to make it."""
    yield "timed", f"{profile.steps:,} steps of {count(profile.blocks, 'block')} on one core, best of several"
    yield "block", f"{profile.lanes} cases, {profile.vector} of them in a register ({profile.cpu})"
    yield "code", f"{size(profile.code_bytes)} in {count(profile.pieces, 'piece')}"
    verb = "found in the cache in" if profile.cached else "compiled in"
    yield "made", f"recorded in {_seconds(profile.recording_s)}, {verb} {_seconds(profile.compiling_s)}"
    yield "folded", f"{count(profile.constants, 'parameter')} that no case varies"


def _inputs(profile: RunProfile) -> Iterator[tuple[str, ...]]:
    """Lines about varied parameters: the work done before the first step, and the work left to each step."""
    yield "varied", "sets", "once", "kept", "taken by"
    for parameter in profile.inputs:
        yield (
            parameter.path,
            *(f"{number:,}" for number in (parameter.sets, parameter.hoisted, parameter.kept, parameter.read_by)),
        )


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"


def _number(value: float) -> str:
    """A number in two digits, or with all digits before the point."""
    if value < 5e-4:
        return "0"
    return f"{value:,.0f}" if value >= 9.95 else f"{value:.2g}"


def _seconds(value: float) -> str:
    return f"{value:.2g} s" if value >= 0.9995 else f"{1e3 * value:.3g} ms"
