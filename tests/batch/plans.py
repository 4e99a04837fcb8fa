"""Plans made by hand, and an engine that answers at once, for tests of what is done with results."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np

from met import run as engine
from met.diagnostic import Place
from met.plan import (
    Cases,
    Command,
    Coordinate,
    Experiment,
    Formula,
    Joint,
    Link,
    Origin,
    Plan,
    Quantity,
    Recorded,
    Schedule,
    ServoUse,
    Source,
    Structure,
)
from met.plan.judged import MetricUse, Requirement
from met.trace.graph import Formulas, Graph

COMPARE = {"<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal}
DECK = Origin("deck", Place("two_link.ic", 12, 5, 6, included=(("main.ic", 3),)))
TABLE_1: dict[str, tuple[float | str, str]] = {
    "ratio": (1570.0, "rad/rad"), "kp": (0.02, "V*s/rad"), "ki": (0.125, "V/rad"), "v_max": (20.0, "V"),
    "resistance": (2.05, "ohm"), "kt": (0.061, "N*m/A"), "tau_max": (0.144, "N*m"), "j_m": (6.38e-5, "kg*m^2"),
    "f_c": (0.0205, "N*m"), "f_v": (2.58e-5, "N*m*s/rad"), "k_position": (0.0, "1/s"),
    "friction": ("coulomb", ""),
}  # fmt: skip


def structure(ticks: int = 200, record: int = 4) -> Structure:
    """Two links in a plane, 100 Hz base rate, dynamics and record at 25 Hz."""
    servos = tuple(
        ServoUse(joint, "gearbox", "rigid_gearbox", Command("rate", "constant"), 1) for joint in ("shoulder", "elbow")
    )
    both = ("shoulder", "elbow")
    return Structure(
        arm="two_link",
        links=(Link("upper", shape=("rod", (("length", 2.0),))), Link("lower")),
        joints=(Joint("shoulder", "revolute", "base", "upper"), Joint("elbow", "revolute", "upper", "lower")),
        servos=servos,
        environment=(),
        metrics=(
            MetricUse("settle", "settling_time", "shoulder.qd"),
            MetricUse("volts", "max", "shoulder.servo.voltage"),
        ),
        velocity_products=False,
        integrator="modified_euler",
        schedule=Schedule(100.0, 4, record, ticks),
        record=(
            Recorded("q", tuple(f"{joint}.q" for joint in both), both, ("rad",), "joint position"),
            Recorded("qd", tuple(f"{joint}.qd" for joint in both), both, ("rad/s",), "joint rate"),
            Recorded(
                "tau", tuple(f"{joint}.tau" for joint in both), both, ("N*m",), "torque of the servo on the joint"
            ),
            Recorded("shoulder.servo.voltage", ("shoulder.servo.voltage",), (), ("V",), "voltage on the drive motor"),
        ),
    )


def parameters() -> dict[str, Quantity]:
    """The numbers of the two links and their servos."""
    out: dict[str, Quantity] = {}

    def put(path: str, value: Any, unit: str, origin: Origin = DECK) -> None:
        out[path] = Quantity(value, unit, origin)

    for link, mass in (("upper", 40.0), ("lower", 20.0)):
        put(f"links.{link}.mass", mass, "kg")
        for axis, value in zip("xyz", (1.0, 0.0, 0.0), strict=True):
            put(f"links.{link}.com.{axis}", value, "m")
        spread = mass * 4.0 / 12.0
        for entry, value in zip(("xx", "yy", "zz", "xy", "xz", "yz"), (0.0, spread, spread, 0, 0, 0), strict=True):
            put(f"links.{link}.inertia.{entry}", float(value), "kg*m^2", Origin("derived", note="a rod's"))
    for joint, at in (("shoulder", 0.0), ("elbow", 2.0)):
        for axis, value in zip("xyz", (at, 0.0, 0.0), strict=True):
            put(f"{joint}.at.{axis}", value, "m")
            put(f"{joint}.rpy.{axis}", 0.0, "rad")
            put(f"{joint}.axis.{axis}", float(axis == "z"), "1")
        for name, (value, unit) in TABLE_1.items():
            put(f"{joint}.servo.{name}", value, unit, Origin("default") if name in ("k_position", "friction") else DECK)
        put(f"{joint}.servo.command.value", 0.03, "rad/s")
        put(f"initial.{joint}.q", 0.0, "rad")
        put(f"initial.{joint}.qd", 0.0, "rad/s")
    put("metrics.settle.target", 0.03, "rad/s")
    put("metrics.settle.band", 0.02, "1")
    put("metrics.settle.within", 0.0, "rad/s")
    return out


def nominal(name: str = "nominal", ticks: int = 200) -> Experiment:
    """A single case."""
    return Experiment(
        name=name,
        structure=structure(ticks),
        parameters=parameters(),
        formulas=Formulas(),
        cases=Cases(1),
        requirements=(Requirement("settle < 10 s", "settle", "<", 10.0),),
    )


def gains(cases: int = 7, name: str = "gains", ticks: int = 200) -> Experiment:
    """A sweep of the proportional gain, and of the lower link's mass, whose inertia follows."""
    graph = Graph()
    kp, mass = graph.input("gearbox.kp"), graph.input("links.lower.mass")
    spread = mass * 4.0 / 12.0
    formulas = Formulas.of(graph, [kp, mass, spread])
    place = Place("two_link.ic", 40, 9, 10)
    varied = parameters()
    follows = {
        "shoulder.servo.kp": 0,
        "elbow.servo.kp": 0,
        "links.lower.mass": 1,
        "links.lower.inertia.yy": 2,
        "links.lower.inertia.zz": 2,
    }
    for path, output in follows.items():
        varied[path] = Quantity(Formula(output), varied[path].unit, Origin("case", place))
    rows = np.arange(cases)
    coordinates = (
        Coordinate(
            "gearbox.kp",
            "V*s/rad",
            1.0,
            0.01 + 0.03 * rows / max(1, cases - 1),
            ("shoulder.servo.kp", "elbow.servo.kp"),
            place,
        ),
        Coordinate("links.lower.mass", "g", 1e-3, 20.0 + 0.1 * (rows % 3), ("links.lower.mass",), place),
    )
    return Experiment(
        name=name,
        structure=structure(ticks),
        parameters=varied,
        formulas=formulas,
        cases=Cases(cases, coordinates, seed=7),
        requirements=(Requirement("settle < 10 s", "settle", "<", 10.0), Requirement("volts < 5 V", "volts", "<", 5.0)),
    )


def plan(*experiments: Experiment) -> Plan:
    text = "// two_link.ic: Gelenkträgheit\nrun nominal { }\n"
    source = Source("two_link.ic", text, "0" * 64)
    return Plan("two_link.ic", experiments or (nominal(),), (source,), ("FAST=1",))


class Answering:
    """In place of `met.run.Prepared`."""

    kernel = None
    wire = True  # so its program is not looked at

    def __init__(self, experiment: Experiment) -> None:
        self.experiment = experiment
        self.code_key = self.work_key = self.old_code_key = f"answers of {experiment.name}"
        self.result_keys: dict[str, str] = {}
        columns = sum(len(recorded.channels) for recorded in experiment.structure.record)
        self.recording = SimpleNamespace(sections=(), cells=())
        self.program = SimpleNamespace(outputs=("failure",), columns=columns)
        self.outputs = self.program.outputs

    def is_work(self, key: str) -> bool:
        return key == self.work_key


def computed(
    prepared: Answering,
    rows: np.ndarray,
    *,
    threads: Any = None,
    record: bool = True,
    progress: Any = None,
    memories: Any = None,
) -> tuple[np.ndarray | None, np.ndarray]:
    """In place of `met.run.compute`: histories and outputs are zeros; `results` has the answers."""
    engine.run(prepared.experiment, rows)  # for what a test lets happen meanwhile
    if progress is not None:
        progress(len(rows))
    if memories is not None:
        memories.by_case.update((row, np.zeros((len(memories.ticks), 0))) for row in rows.tolist())
    rowsof = prepared.experiment.structure.schedule.rows
    history = np.zeros((len(rows), rowsof, prepared.program.columns)) if record else None
    return history, np.zeros((len(rows), 1))


def results(prepared: Any, rows: Any, history: Any, outputs: Any, fates: Any = None) -> Any:
    """In place of `met.run.results`: what `met.run.run` says, which tests put in its place."""
    return engine.run(prepared.experiment, rows)


def answering(monkeypatch: Any) -> None:
    """Puts these in the place of the engine."""
    for name, mine in {"prepare": Answering, "run": answer, "compute": computed, "results": results}.items():
        monkeypatch.setattr(engine, name, mine)


def answer(
    experiment: Any,
    cases: Any = None,
    *,
    threads: Any = None,
    record: bool = True,
    progress: Any = None,
    fails: frozenset[int] = frozenset(),
) -> Any:
    """What `met.run.run` gives back, by closed formulas: first-order rise of the rates; cases in `fails` break off."""
    from met.plan.limits import extremes, limits
    from met.run import Run

    experiment = getattr(experiment, "experiment", experiment)  # of what is prepared
    schedule = experiment.structure.schedule
    rows = np.arange(experiment.cases.count) if cases is None else np.asarray(cases)
    time = np.arange(schedule.rows) * schedule.record / schedule.base_hz
    values = {c.path: c.values[rows] for c in experiment.cases.coordinates}
    gain = values.get("gearbox.kp", np.full(len(rows), 0.02))[:, None]
    rate = 0.03 * (1.0 - np.exp(-time[None, :] * gain * 100.0) * np.cos(3.0 * time[None, :]))
    joints = np.stack([rate, 0.9 * rate], axis=2)
    signals = {"q": np.cumsum(joints, axis=1) * 0.04, "qd": joints, "tau": 100.0 * np.sin(joints * 50.0)}
    signals["shoulder.servo.voltage"] = 5.0 * rate / 0.03
    failed = np.array([int(row) in fails for row in rows])
    n_valid = np.where(failed, 5, schedule.rows)
    for history in signals.values():
        history[failed, 5:] = math.nan
    settle = np.where(failed, math.nan, 0.1 / gain[:, 0])
    settle[~failed & (gain[:, 0] < 0.011)] = math.inf
    volts = np.where(failed, math.nan, signals["shoulder.servo.voltage"].max(axis=1))
    metrics = {"settle": settle, "volts": volts}
    text = "t = 0.2 s: joint elbow: D is not above 0 kg m^2, so qdd is undefined."
    return Run(
        case=rows,
        status=failed.astype(np.int8),
        cause=[text if bad else "" for bad in failed],
        n_valid=n_valid,
        time=time,
        signals=signals if record else {},
        metrics=metrics,
        met={r.text: COMPARE[r.comparison](metrics[r.metric], r.limit) for r in experiment.requirements},
        coordinates=values,
        events={name: np.zeros(len(rows), dtype=np.int64) for name in ("splits", "clamped", "undecided")},
        limited=np.zeros(len(rows), dtype=np.int64),
        at_limit={
            use.path: np.where(failed, math.nan, 0.0) for use in limits(experiment.structure, experiment.parameters)
        },
        excess={},
        extreme_at={name: np.zeros(len(rows), dtype=np.int64) for name in extremes(experiment)},
        grapples={},
        warning=[""] * len(rows),
    )
