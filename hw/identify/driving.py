"""A bed led through the moves, in a process of its own: `python -m hw.identify.driving`, which reads a line of JSON, a
`MovesRequest`.

It says how it goes on its standard output, a line of JSON each: {"said": words}, {"about": ..., "peaks": ...}, at the
end {"ended": ...} (`LoopEnd`) or {"wrong": diagnostics}. What came of each exchange is in the records. It stops the bed
when it is interrupted, terminated, or its parent is no more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from hw import refusals
from hw.bed import Capability, Limits
from hw.beds import latch
from hw.drivers import opened
from hw.driving import loop, process
from hw.driving.case import pace_of
from hw.identify.moves import MoveGuide, Peaks, guided
from hw.ports import Port
from hw.recording.writer import recording
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.plan import file as plan_file

SHARE = 0.8
"""Share of a bed's own limits of current and rate that the moves go to at most."""

TURNS = 4.0
"""Torque that the moves' voltage must give at least, in units of the data sheet's dry friction."""


@frozen
class MovesRequest:
    """The request to the process to lead a bed through the moves.

    plan      plan of one experiment, as text (met.plan.file);  row: of its case table;  joint: whose motor is on the
              bed
    port, baud, lock_step, transcript  as of hw.ports.Port
    records   the file that the records go to
    sheet     parameters that are believed before, SI, by the names of hw.identify.fit.MOTOR, and `v_max`, V
    voltage, current, rate  the most that the moves may ask for, V, A, rad/s; None: what bed and sheet allow
    """

    plan: str
    row: int
    joint: str
    port: str
    records: str
    sheet: Mapping[str, float]
    baud: int = 921600
    lock_step: bool = False
    transcript: str | None = None
    voltage: float | None = None
    current: float | None = None
    rate: float | None = None


@frozen
class MovesResult:
    """The course of the moves.

    began      for each move, the exchange at which the bed was at rest
    lock_step  True where the bed has no time of its own;  seconds: that the moves took
    """

    began: tuple[int, ...]
    lock_step: bool
    seconds: float


def peaks(limits: Limits, sheet: Mapping[str, float], request: MovesRequest) -> tuple[Peaks, float]:
    """The largest commands of the moves, and the rate (rad/s) up to which the moves go that are to reach the drive's
    largest torque. Raises Problem E421."""
    for name, value, most, unit in (
        ("voltage", request.voltage, limits.voltage, "V"),
        ("current", request.current, limits.current, "A"),
        ("rate", request.rate, limits.rate, "rad/s"),
    ):
        if value is not None and value > most:
            message = f"a {name} of {value:.6g} {unit} is beyond the bed's limit, {most:.6g} {unit}"
            raise Problem(error("E421", message, help=f"give `--{name}` less, or leave it out"))
    voltage = min(limits.voltage, sheet.get("v_max", limits.voltage)) if request.voltage is None else request.voltage
    current = request.current
    if current is None:
        current = min(SHARE * limits.current, sheet["tau_max"] / sheet["kt_load"])
    rate = SHARE * limits.rate if request.rate is None else request.rate
    kt, resistance = sheet["kt"], sheet["resistance"]
    if kt / resistance * voltage < TURNS * sheet["f_c"]:
        least = TURNS * sheet["f_c"] * resistance / kt
        message = f"{voltage:.3g} V is too little for the moves: the shaft's friction takes {least / TURNS:.3g} V"
        raise Problem(error("E421", message, help=f"`--voltage`, or the bed's own limit, of {least:.3g} V at least"))
    free = (voltage - sheet["tau_max"] * resistance / kt) / kt
    top = 0.75 * free if free > 0.0 else 0.6 * voltage / kt
    return Peaks(voltage, current, rate), min(top, SHARE * rate)


def run(request: MovesRequest) -> MovesResult:
    """Lead the bed through the moves. Raises Problem."""
    experiment = plan_file.loads(request.plan).experiments[0]
    pace = pace_of(experiment)
    stop_requested = process.listening()
    port = Port(request.port, request.baud, request.lock_step, request.transcript)
    with opened(port, experiment, request.joint, request.row, pace.period) as bed:
        about = bed.connect()
        process.warnings(bed)
        if notice := process.unseen(bed):
            process.say(said=notice)
        latch.check(bed, about, request.port)
        if about.drive != "voltage":
            message = f"bed `{about.name}` takes a {about.drive}, and the moves that identify a motor are voltages"
            helps = "set its drive to voltages for the time of `met bed identify`, or take the data sheet's numbers"
            raise Problem(error("E438", message, help=helps))
        if Capability.SIMULATED in about.capabilities:
            bed.preset(seed=experiment.cases.seed)
        lock_step = Capability.LOCK_STEP in about.capabilities
        most, top = peaks(about.limits, request.sheet, request)
        scales = about.scales
        # a command is a whole count, the nearest
        bed.limit({"voltage": most.voltage + scales.voltage, "current": most.current + scales.current})
        # a change of command is of whole counts too
        slews = [SHARE * slew for slew in (about.limits.voltage_slew, about.limits.current_slew)]
        guide = MoveGuide(guided(top), most, pace.period, (slews[0], slews[1]))
        process.say(about=process.about_as_json(about), peaks={**asdict(most), "top": top})
        if not lock_step:
            process.precedence()
        bed.patience = pace.patience(lock_step)
        head = {
            "joint": request.joint,
            "hz": pace.hz,
            "lock_step": lock_step,
            "tick_hz": about.tick_hz,
            "bed": about.name,
            "firmware": about.firmware,
        }
        with recording(Path(request.records), head, guide.exchanges + 1) as put:
            ended = loop.drive(
                [bed],
                guide,
                pace,
                guide.exchanges,
                put,
                lock_step=lock_step,
                stop_requested=lambda: stop_requested() or guide.done or guide.stuck,
            )
        refusals.check_stopped([bed], [about], "" if guide.done else ended.why)
        seconds = ended.exchanges * pace.period
        if guide.stuck:
            when = f"after move {len(guide.began)}" if guide.began else "before the first move"
            message = f"bed `{about.name}` does not come to rest {when}, at 0 V and 0 A"
            helps = "look what drives its shaft, and whether its tachometer reads 0 at rest"
            raise Problem(error("E422", message, help=helps))
        if not guide.done:
            remedies = refusals.remedies(ended.faults) or ["run it again, with less else to do for this computer"]
            remedies.append("`--voltage`, `--current` and `--rate` make the moves smaller")
            count = len(guide.began)
            where = f"in move {count} ({guided(top)[count - 1].name})" if count else "before the first move"
            message = f"bed `{about.name}` at {seconds:.3g} s, {where}: {ended.why}"
            raise Problem(error("E420", message, help=remedies))
        return MovesResult(tuple(guide.began), lock_step, seconds)


if __name__ == "__main__":
    process.answer(MovesRequest, lambda request: {"ended": asdict(run(request))})
