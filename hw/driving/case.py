"""One case driven on beds, in a process of its own: `python -m hw.driving.case`, which reads a `CaseRequest` as JSON.

It says how it goes on its standard output, a line of JSON each: {"said": words}, {"bed": joint, "about": ...},
{"began": true}, at the end {"ended": ...} or {"wrong": diagnostics}. What came of each exchange is in the records.
It stops its beds when it is interrupted, terminated, or its parent is no more.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, field
from pathlib import Path
from typing import Any

from hw import refusals
from hw.bed import About, BedDriver, Capability
from hw.beds import latch
from hw.drivers import opened
from hw.driving import loop, process
from hw.driving.driven import LANES, CaseKernel, divisor, substituted
from hw.driving.pace import Pace, pace
from hw.ports import Port
from hw.recording.writer import recording
from met import models
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.plan import SEED, Experiment, Formula
from met.plan import file as plan_file
from met.plan.keys import case_seeds
from met.plant import bed_values
from met.run import prepare


@frozen
class CaseRequest:
    """The request to the process to drive a case.

    plan         plan of one experiment, as text (met.plan.file);  row: of its case table
    ports        by joint;  lock_step: True where the beds have no time of their own;  baud: of serial lines
    records      the file that the records go to;  head: what else stands at its beginning
    rest         s of rest before the case
    transcripts  by joint, files for what goes over the line
    clear        True: faults that a bed has latched are cleared first; False: such a bed is not driven
    """

    plan: str
    row: int
    ports: Mapping[str, str]
    records: str
    lock_step: bool = False
    baud: int = 921600
    rest: float = 0.0
    clear: bool = False
    head: Mapping[str, Any] = field(default_factory=dict)
    transcripts: Mapping[str, str] = field(default_factory=dict)


def pace_of(experiment: Experiment) -> Pace:
    """The rate at which the beds of an experiment exchange."""
    return pace(experiment.structure.schedule.base_hz / divisor(experiment))


def run(request: CaseRequest) -> loop.LoopEnd:
    """Drive the case. Raises Problem."""
    experiment = plan_file.loads(request.plan).experiments[0]
    bed_pace = pace_of(experiment)
    stop_requested = process.listening()
    joints = substituted(prepare(experiment, wire=True))
    check(experiment, request.row, request.lock_step)
    beds: list[BedDriver] = []
    abouts: list[About] = []
    try:
        for joint in joints:
            port = Port(request.ports[joint], request.baud, request.lock_step, request.transcripts.get(joint))
            beds.append(opened(port, experiment, joint, request.row, bed_pace.period))
            abouts.append(_greeted(beds[-1], joint, experiment, request))
            _check_drive(abouts[-1], experiment, joint)
        lock_step = request.lock_step
        _check_time(abouts, lock_step)
        _check_ticks(abouts, bed_pace, lock_step)
        prepared = prepare(experiment, wire=True, late=bed_pace.late(lock_step), lanes=LANES)
        driven = CaseKernel(prepared, request.row, bed_pace.repeats)
        if not lock_step:
            process.precedence()
        driven(0, [0.0] * len(beds), [[0.0, 0.0] for _ in beds])  # code and memory are there when time begins to count
        if not lock_step:  # a motor that is simulated in lock-step does not get hot
            _rest(beds, request.rest, stop_requested)
        for bed in beds:
            bed.patience = bed_pace.patience(lock_step)
        if stop_requested():  # nothing was begun
            return loop.LoopEnd(0, "the host was asked to stop")
        head = {
            **request.head,
            "row": request.row,
            "servo_hz": bed_pace.servo_hz,
            "repeats": bed_pace.repeats,
            "lock_step": lock_step,
            "joints": list(joints),
            "tick_hz": abouts[0].tick_hz,
            "beds": [{"name": about.name, "firmware": about.firmware} for about in abouts],
        }
        with recording(Path(request.records), head, (driven.exchanges + 1) * len(beds)) as put:
            process.say(began=True)
            ended = loop.drive(
                beds, driven, bed_pace, driven.exchanges, put, lock_step=lock_step, stop_requested=stop_requested
            )
        for joint, bed in zip(joints, beds, strict=True):
            for line in bed.account():
                process.say(said=f"{joint}: {line}")
        refusals.check_stopped(beds, abouts, ended.why)
        return ended
    finally:
        for bed in beds:
            bed.close()


def _rest(beds: Sequence[BedDriver], time: float, stop_requested: Callable[[], bool]) -> None:
    """Let all beds rest for `time` s at once, or until a stop is requested."""
    for _ in range(math.ceil(time / process.PAUSE - 1e-6)):
        if stop_requested():
            return
        beds[0].rest(process.PAUSE)


def _greeted(bed: BedDriver, joint: str, experiment: Experiment, request: CaseRequest) -> About:
    """Greet a bed, and return its description. A simulated one begins anew, with the case's noise."""
    about, row = bed.connect(), request.row
    process.say(bed=joint, about=process.about_as_json(about), unseen=process.unseen(bed))
    process.warnings(bed)
    if not request.clear:
        latch.check(bed, about, request.ports[joint])
    elif faults := latch.cleared(bed, about):
        process.say(said=f"{joint}: cleared: {refusals.words(faults)}")
    if Capability.SIMULATED in about.capabilities:
        cases = experiment.cases
        seed = int(case_seeds(experiment, [row])[0]) if SEED in cases.noise else cases.seed
        bed.preset(seed=seed, repeat=0 if cases.repeats is None else int(cases.repeats[row]))
    return about


def _check_drive(about: About, experiment: Experiment, joint: str) -> None:
    """Raise Problem E438 where a bed's drive is commanded another quantity than in the deck's bed model."""
    use = experiment.structure.on_beds[joint]
    commanded = models.find("bed", use.bed, use.place).drive
    if commanded != about.drive:
        message = f"bed `{about.name}` takes a {about.drive}, and `{use.bed}` of joint `{joint}` sends it a {commanded}"
        fit = [name for name, model in models.available("bed").items() if model.drive == about.drive]
        helps = f"bed models that send a {about.drive}: {', '.join(fit) or 'none'}"
        raise Problem(error("E438", message, help=helps))


def _check_time(abouts: Sequence[About], lock_step: bool) -> None:
    """Raise Problem E414 where a bed has a time of its own, and should have none, or the other way round."""
    for about in abouts:
        if (Capability.LOCK_STEP in about.capabilities) != lock_step:
            message = f"bed `{about.name}` has {'a' if lock_step else 'no'} time of its own"
            helps = "leave out `--lock-step`" if lock_step else "`--lock-step` drives it"
            raise Problem(error("E414", message, help=helps))


def _check_ticks(abouts: Sequence[About], bed_pace: Pace, lock_step: bool) -> None:
    """Raise Problem E405 where a bed reads its sensors less often than they are requested. Clocks may be off by 1 %."""
    for about in abouts:
        if not lock_step and about.tick_hz < 0.99 * bed_pace.hz:
            message = f"bed `{about.name}` ticks at {about.tick_hz:g} Hz, and would be spoken to at {bed_pace.hz:g} Hz"
            helps = "what it answers would be older than the law believes: a lower rate of the servo, or a faster bed"
            raise Problem(error("E405", message, help=helps))


def check(experiment: Experiment, row: int, lock_step: bool) -> None:
    """Raise Problem where a case cannot be driven, whatever its beds are: E415 where the law takes its commands for
    earlier than they are, E416 where a joint begins with a rate. Nothing is opened or written for that."""
    least = pace_of(experiment).late(lock_step)
    for use in experiment.structure.substitutions:
        if bed_values(experiment, use.joint, row)["delay"] < least:
            message = f"joint `{use.joint}`: its law takes the bed's delay for none, and over a wire it is a tick"
            helps = f"`bed = {use.bed}(delay = 1, ...)` in the deck says so"
            raise Problem(error("E415", message, use.place, help=helps))
    _check_start(experiment, [use.joint for use in experiment.structure.substitutions], row)


def _check_start(experiment: Experiment, joints: Sequence[str], row: int) -> None:
    """Raise Problem E416 where a joint on a bed begins with a rate: a bed's shaft begins at rest."""
    inputs = {coordinate.path: float(coordinate.values[row]) for coordinate in experiment.cases.coordinates}
    outputs = experiment.formulas.replay(inputs)
    for joint in joints:
        parameter = experiment.parameters[f"initial.{joint}.qd"]
        value = parameter.value
        if (outputs[value.output] if isinstance(value, Formula) else value) != 0.0:
            message = f"joint `{joint}` begins with a rate, and a bed's shaft begins at rest"
            helps = f"`initial {{ {joint}.qd = 0 rad/s; }}` in the run"
            raise Problem(error("E416", message, parameter.origin.place, help=helps))


def _driven(request: CaseRequest) -> dict[str, Any]:
    ended = run(request)
    return {"ended": {**asdict(ended), "faults": int(ended.faults)}}


if __name__ == "__main__":
    process.answer(CaseRequest, _driven)
