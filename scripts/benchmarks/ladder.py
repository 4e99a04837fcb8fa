"""The time that each model adds to a step: the Panda under gravity, 512 cases, modified Euler and servos at 10 kHz.

Every joint has the same servo. What servos add is over a step with `ideal` ones; what all else adds is over the same
step with `rigid_gearbox`. Differences are of figures that were taken in the same turns. Time is the core's.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks import decks
from benchmarks.arms import SEVEN
from benchmarks.benchmark import Benchmark, Derived
from benchmarks.decks import Variant
from met.backends.llvm import kernel
from met.program import build

TITLE = "what each model adds to a step of the Panda, ns per step and case, one core, many cases"

STEPS = 250

_ELASTIC = "model = compliant_gearbox;  stiffness = 1e5 N*m/rad;  damping = 5 N*m*s/rad;"
_CASCADE = """model = cascade;  ratio = 100;  kp = 1 A*s/rad;  ki = 5 A/rad;
    k_current = 1 V/A;  ki_current = 100 V/(A*s);
    resistance = 0.5 ohm;  inductance = 5 mH;  kt = 0.1 N*m/A;  j_m = 6e-5 kg*m^2;  f_c = 0.01 N*m;  i_max = 100 A;"""
_CURVE = "f_s = 0.015 N*m;  rate_s = 2 rad/s;"
_IDEAL = "model = ideal;  bandwidth = 30 s^-1;"

SERVOS: Mapping[str, Variant] = {
    "passive": Variant("model = passive;  damping = 5 N*m*s/rad;", like=False, command=""),
    "rigid_gearbox": Variant(),
    "stribeck": Variant(f"friction = stribeck;  {_CURVE}"),
    "lugre": Variant(f"friction = lugre;  {_CURVE}  sigma_0 = 0.1 N*m/rad;  sigma_1 = 1e-3 N*m*s/rad;"),
    "continuous": Variant("rate = continuous;"),
    "compliant_gearbox": Variant(_ELASTIC),
    "compliant_gearbox, play and loss": Variant(f"{_ELASTIC}  backlash = 1e-4 rad;  loss = 0.1;"),
    "cascade, rigid": Variant(f"{_CASCADE}  gear = rigid;", like=False),
    "cascade, elastic": Variant(f"{_CASCADE}  stiffness = 1e5 N*m/rad;  damping = 5 N*m*s/rad;", like=False),
}
"""Servos of all seven joints, over ideal ones."""

_LINK = SEVEN.bodies()[-1].name
_JOINT = SEVEN.joints[3]
_LOAD = f"mass = 3 kg;  shape = box(size = [0.1, 0.2, 0.1] m);  on = {_LINK};"
_FLYING = "grapple = 0.01 s;  position = [0.5, 0, 0.6] m;"
_WINDOW = "from = 0.01 s;  until = 0.02 s;"

OTHERS: Mapping[str, Variant] = {
    "tachometer on all": Variant("sensor qd = tachometer { resolution = 1e-3 rad/s; }"),
    "tachometer with a filter": Variant("sensor qd = tachometer { filter = butterworth;  cutoff = 2 kHz; }"),
    "tachometer with noise": Variant("sensor qd = tachometer { noise = 1e-4 rad/s; }"),
    "accelerometer": Variant(
        sensor=f"accelerometer {{ link = {_LINK};  at = [0, 0, 0.1] m;  along = [1, 0, 0];  cutoff = 200 Hz; }}"
    ),
    "gyroscope": Variant(sensor=f"gyroscope {{ link = {_LINK};  along = [0, 0, 1]; }}"),
    "gyroscope with a filter": Variant(
        sensor=f"gyroscope {{ link = {_LINK};  along = [0, 0, 1];  filter = butterworth;  cutoff = 200 Hz; }}"
    ),
    "base prescribed": Variant(base="prescribed { x = sine(amplitude = 1 cm, frequency = 1 Hz); }"),
    "base free": Variant(base="free;"),
    "wrench": Variant(environment=f"used = wrench {{ link = {_LINK};  force = [1, 2, 3] N; }}"),
    "wrench_table": Variant(
        environment=f"used = wrench_table {{ link = {_LINK};  times = [0, 1, 2] s;  force_x = [0, 3, 1] N; }}"
    ),
    "spring": Variant(environment=f"used = spring {{ link = {_LINK};  to = world;  stiffness = 10 N/m; }}"),
    "bushing": Variant(
        environment=f"used = bushing {{ link = {_LINK};  to = world;  stiffness = [9, 9, 9] N/m;  "
        "turning = [1, 1, 1] N*m/rad; }"
    ),
    "contact": Variant(
        environment=f"used = contact {{ link = {_LINK};  radius = 9 m;  normal = [0, 0, 1];  stiffness = 1 N/m;  "
        "friction = 0.3; }"
    ),
    "plume, 1 cell": Variant(
        environment=f"used = plume {{ link = {_LINK};  width = 1 m;  height = 1 m;  cells = 1;  "
        "thrust = 10 N;  exponent = 6;  nozzle = [3, 0, 1] m;  axis = [-1, 0, 0]; }"
    ),
    "plume, 36 cells": Variant(
        environment=f"used = plume {{ link = {_LINK};  width = 1 m;  height = 1 m;  cells = 6;  "
        "thrust = 10 N;  exponent = 6;  nozzle = [3, 0, 1] m;  axis = [-1, 0, 0]; }"
    ),
    "gravity_gradient": Variant(environment="used = gravity_gradient { radius = 6.8e6 m;  frame = inertial; }"),
    "joint_stop": Variant(
        environment=f"used = joint_stop {{ joint = {_JOINT};  upper = 9 rad;  stiffness = 1 N*m/rad; }}"
    ),
    "brake": Variant(environment=f"used = brake {{ joint = {_JOINT};  torque = 1 N*m;  {_WINDOW} }}"),
    "free_swinging": Variant(environment=f"used = free_swinging {{ joint = {_JOINT};  {_WINDOW} }}"),
    "runaway": Variant(environment=f"used = runaway {{ joint = {_JOINT};  {_WINDOW} }}"),
    "dead_sensor": Variant(environment=f"used = dead_sensor {{ joint = {_JOINT};  of = qd;  {_WINDOW} }}"),
    "payload held": Variant(payload=_LOAD),
    "payload grappled": Variant(payload=f"{_LOAD}  {_FLYING}"),
    "payload grappled, base free": Variant(base="free;", payload=f"{_LOAD}  {_FLYING}"),
    "space": Variant(_ELASTIC, base="free;", payload=_LOAD),
}
"""Other models, over rigid gearboxes on a fixed base. space: elastic gears on a free base, with a load."""


def _step(variant: Variant) -> Callable[[], float]:
    experiment = decks.experiment(SEVEN, "steady", variant=replace(variant, rate="10 kHz"))
    inputs = np.stack([coordinate.values for coordinate in experiment.cases.coordinates], axis=1)
    if experiment.cases.noise:
        raise AssertionError("the cases of a benchmark share their noise")
    compiled, inputs = kernel.compile(build(experiment)), np.ascontiguousarray(inputs)

    def measure() -> float:
        begun = time.thread_time()
        compiled.run(inputs, STEPS, record=False, threads=1)
        return (time.thread_time() - begun) * 1e9 / (len(inputs) * STEPS)

    return measure


def _name(model: str) -> str:
    return model.replace(", ", "-").replace(" ", "-")


_LEAST = "ideal"
_ALL = {_LEAST: Variant(_IDEAL, like=False), **SERVOS, **OTHERS}

BENCHMARKS: tuple[Benchmark | Derived, ...] = (
    *(
        Benchmark(f"with.{_name(model)}", "a whole step", "ns", partial(_step, variant))
        for model, variant in _ALL.items()
    ),
    *(
        Derived(f"adds.{_name(model)}", f"over a step with {over}", "ns",
                (f"with.{_name(model)}", f"with.{over}"), lambda a, b: a - b)
        for models, over in ((SERVOS, _LEAST), (OTHERS, "rigid_gearbox")) for model in models
    ),
)  # fmt: skip
