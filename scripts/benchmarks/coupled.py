"""Coupled joints and contacts beside MuJoCo, whose constraints are soft: coupling error, creep, and ns per step.

Seven links in a chain swing under gravity on dampers, and the last joint follows the one before it by -1.5. Both
programs take one evaluation a step of 1 ms, with the rates first. MuJoCo steps one case a call; ours is one case, or
512 at once, on one core. The creep is that of a sphere that cannot roll, on a slope of half its coefficient of
friction; ours is in closed form. MuJoCo comes from its PyPI wheel `mujoco`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

import ic
from benchmarks.benchmark import Benchmark, Untaken
from met import run as engine
from met.plan import Experiment

TITLE = "coupled joints and contacts beside MuJoCo: coupling error, creep, and ns per step and case, one core"

LINKS, RATIO, BEGIN, STEPS = 7, -1.5, 0.3, 2000
MU, SLOPE = 0.5, 0.5
"""Coefficient of friction, and the slope as a share of it."""

DEFAULT, STIFFEST = "0.02 1", "0.002 1"
"""Time constant, s, and damping ratio of MuJoCo's constraints: its default, and the stiffest that it takes at 1 ms."""


def mujoco() -> Any:
    """The module; raises Untaken where it is not installed."""
    try:
        import mujoco
    except ImportError:
        raise Untaken("`mujoco` is not installed: `.venv/bin/pip install mujoco` adds it") from None
    return mujoco


def chain_of_mujoco(coupled: bool, softness: str = DEFAULT) -> tuple[Any, Any, Any]:
    """The module, the chain's model, and its state where it begins."""
    program = mujoco()
    bodies = "".join(
        f'<body pos="{0.3 * (k > 0)} 0 0"><joint name="j{k}" axis="{"0 1 0" if k % 2 else "0 0 1"}" damping="0.5"/>'
        '<inertial pos="0.15 0 0" mass="2" diaginertia="0.001 0.016 0.016"/>'
        for k in range(LINKS)
    )
    pair = f'joint1="j{LINKS - 1}" joint2="j{LINKS - 2}" polycoef="0 {RATIO} 0 0 0" solref="{softness}"'
    model = program.MjModel.from_xml_string(
        '<mujoco><option timestep="0.001"><flag contact="disable"/></option>'
        f"<worldbody>{bodies}{'</body>' * LINKS}</worldbody>"
        f"{f'<equality><joint {pair}/></equality>' if coupled else ''}</mujoco>"
    )
    data = program.MjData(model)
    data.qpos[:] = [BEGIN] * (LINKS - 1) + [RATIO * BEGIN]
    return program, model, data


def chain(coupled: bool, cases: int = 1) -> Experiment:
    """The same chain as a run of ours."""
    links = "".join(
        f"link l{k} {{ mass = 2 kg;  com = [0.15, 0, 0] m;  inertia = [0.001, 0.016, 0.016] kg*m^2; }} "
        f"joint j{k} revolute {{ parent = {f'l{k - 1}' if k else 'base'};  child = l{k};  "
        f"axis = {'y' if k % 2 else 'z'};  at = [{0.3 * (k > 0)}, 0, 0] m;  "
        + (f"follows = j{k - 1};  ratio = {RATIO}; }}\n" if coupled and k == LINKS - 1 else "}\n")
        for k in range(LINKS)
    )
    starts = " ".join(f"j{k}.q = {BEGIN} rad;" for k in range(LINKS - 1))
    starts += "" if coupled else f" j{LINKS - 1}.q = {RATIO * BEGIN} rad;"
    text = (
        f"arm chain {{ {links} }} servo damper {{ model = passive;  damping = 0.5 N*m*s/rad; }} "
        f"run swing {{ arm = chain;  servos {{ * = damper;  j{LINKS - 1} = damper; }}  initial {{ {starts} }}  "
        "environment { gravity = [0, 0, -9.81] m/s^2; }  integrator = semi_implicit_euler;  "
        "rates { dynamics = 1 kHz;  record = 1 kHz; }  duration = 2 s;  record = [q]; } "
        f"sweep many of swing {{ vary links.l0.mass = linspace(2 kg, 2.1 kg, {cases}); }}"
    )
    return ic.compile(text=text, select=["many" if cases > 1 else "swing"]).experiments[0]


def _error_of_mujoco(softness: str) -> Callable[[], float]:
    program, model, data = chain_of_mujoco(True, softness)
    errors = []
    for _ in range(STEPS):
        program.mj_step(model, data)
        errors.append(1e6 * abs(data.qpos[-1] - RATIO * data.qpos[-2]))
    return lambda: max(errors)


def _error() -> Callable[[], float]:
    q = engine.run(chain(True)).signals["q"][0]
    return lambda: 1e6 * float(np.abs(q[:, -1] - RATIO * q[:, -2]).max())


def _steps_of_mujoco(coupled: bool) -> Callable[[], float]:
    program, model, data = chain_of_mujoco(coupled)
    begin = data.qpos.copy()

    def measure() -> float:
        program.mj_resetData(model, data)
        data.qpos[:] = begin
        begun = time.thread_time()
        program.mj_step(model, data, nstep=STEPS)
        return (time.thread_time() - begun) * 1e9 / STEPS

    return measure


def _steps(coupled: bool, cases: int) -> Callable[[], float]:
    prepared = engine.prepare(chain(coupled, cases))
    inputs = engine.inputs(prepared.experiment, np.arange(cases))
    steps = STEPS if cases == 1 else STEPS // 10

    def measure() -> float:
        begun = time.thread_time()
        prepared.kernel.run(inputs, steps, record=False, threads=1)
        return (time.thread_time() - begun) * 1e9 / (cases * steps)

    return measure


def _creep_of_mujoco(cone: str, ratio: int) -> Callable[[], float]:
    program, angle = mujoco(), math.atan(SLOPE * MU)
    gravity = f"{9.81 * math.sin(angle)} 0 {-9.81 * math.cos(angle)}"
    slides = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    model = program.MjModel.from_xml_string(
        f'<mujoco><option timestep="0.001" gravity="{gravity}" cone="{cone}" impratio="{ratio}"/>'
        f'<worldbody><geom type="plane" size="9 9 1" friction="{MU} 0 0"/><body pos="0 0 0.1">'
        f'{slides}<geom type="sphere" size="0.1" mass="1" friction="{MU} 0 0"/></body></worldbody></mujoco>'
    )
    data = program.MjData(model)
    program.mj_step(model, data, nstep=STEPS)
    begin = data.qpos[0]
    program.mj_step(model, data, nstep=STEPS)
    return lambda: 1e6 * (data.qpos[0] - begin) / (1e-3 * STEPS)


BENCHMARKS = (
    Benchmark("coupled.error.mujoco", "MuJoCo, default constraint", "urad", partial(_error_of_mujoco, DEFAULT)),
    Benchmark("coupled.error.stiff", "the stiffest that it takes", "urad", partial(_error_of_mujoco, STIFFEST)),
    Benchmark("coupled.error", "MET", "urad", _error),
    *(
        Benchmark(f"{'coupled' if coupled else 'free'}.{name}", doc, "ns", prepare)
        for coupled in (False, True)
        for name, doc, prepare in (
            ("mujoco", "mj_step, one case", partial(_steps_of_mujoco, coupled)),
            ("one", "MET, one case", partial(_steps, coupled, 1)),
            ("many", "MET, 512 cases", partial(_steps, coupled, 512)),
        )
    ),
    *(
        Benchmark(f"creep.{cone}.{ratio}", "MuJoCo and its impratio", "um/s", partial(_creep_of_mujoco, cone, ratio))
        for cone, ratio in (("pyramidal", 1), ("elliptic", 1), ("elliptic", 100))
    ),
)  # fmt: skip
